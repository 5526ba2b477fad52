"""The deterministic baseline: one transformer that corrects linear interpolation, in the manner of the Δ-interpolator.

Oreshkin et al. (2024) have a transformer predict what the interpolation between the keyframes lacks. So does this: it
reads the interpolated motion with the given frames in it, and adds to the rotations and root of all others. It has
about as many parameters as a whole pack, sees the same frames and predicts no choice: one answer for each request, in one
pass.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_FRAMES
from troupe_training.data.interpolation import interpolate
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion, pose_features
from troupe_training.data.precision import full_precision
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import Segments
from troupe_training.models.layers import Standardiser, Transformer, sinusoids

ROOT_RESIDUAL_M = 0.25


@dataclass
class DeltaConfig:
    """Width and depth; of about as many parameters as all networks of a pack of the same preset together."""

    dim: int = 320
    layers: int = 9
    head_dim: int = 32


PRESETS = {"default": DeltaConfig(), "small": DeltaConfig(224, 8), "test": DeltaConfig(32, 1, 16)}


class DeltaInterpolator(nn.Module):
    """Interpolated frames to what they lack: 6D rotations ``[B, T, J, 6]`` and root positions ``[B, T, 3]``."""

    place: Tensor

    def __init__(self, config: DeltaConfig, joints: int):
        super().__init__()
        self.joints = joints
        self.pose_scale = Standardiser(joints * 9)
        self.global_scale = Standardiser(5)
        self.enter = nn.Linear(joints * 9 + 5 + 2, config.dim)
        self.register_buffer("place", sinusoids(MAX_FRAMES, config.dim))
        self.trunk = Transformer(config.dim, config.layers, config.head_dim)
        self.leave = nn.Linear(config.dim, joints * 6 + 3)
        with torch.no_grad():
            self.leave.weight.mul_(0.1)

    def forward(self, pose: Tensor, root: Tensor, given: Tensor) -> tuple[Tensor, Tensor]:
        """Interpolated poses ``[B, T, J*9]`` and roots ``[B, T, 5]``; ``given`` ``[T]`` is 1 where a frame was given."""
        frames = pose.shape[1]
        left = torch.linspace(1.0, 0.0, frames - CONTEXT_FRAMES + 1, device=pose.device)
        left = torch.cat([torch.ones(CONTEXT_FRAMES - 1, device=pose.device), left])
        about = torch.stack([given, left], -1).expand(len(pose), -1, -1)
        x = self.enter(torch.cat([self.pose_scale(pose), self.global_scale(root), about], -1))
        return self._read_out(self.trunk(x + self.place[:frames]), 1.0 - given)

    @full_precision
    def _read_out(self, hidden: Tensor, free: Tensor) -> tuple[Tensor, Tensor]:
        lacking = self.leave(hidden.float()) * free[:, None]
        six_d = lacking[..., :-3] * self.pose_scale.std.unflatten(0, (self.joints, 9))[:, 3:].flatten()
        return six_d.unflatten(-1, (self.joints, 6)), lacking[..., -3:] * ROOT_RESIDUAL_M


class DeltaMethod:
    """The model with the interpolation that it corrects; an evaluation's method."""

    def __init__(self, model: DeltaInterpolator, skeleton: Skeleton, device: str = "cpu"):
        self.model, self.parents = model, skeleton.parents
        self.kinematics = Kinematics(skeleton, device)
        self.left_axis = torch.tensor(skeleton.left_axis, device=device)

    def fill(self, segments: Segments) -> tuple[Tensor, Tensor, Tensor]:
        """6D rotations ``[B, T, J, 6]``, root positions ``[B, T, 3]`` and which frames were given ``[T]``."""
        pose, root, six_d = self._interpolation(segments)
        given = torch.zeros(segments.frames, device=pose.device)
        given[[*range(CONTEXT_FRAMES), segments.frames - 1]] = 1.0
        turned, moved = self.model(pose, root, given)
        return six_d + turned, root[..., :3] + moved, given

    @full_precision
    def _interpolation(self, segments: Segments) -> tuple[Tensor, Tensor, Tensor]:
        """Pose features ``[B, T, J*9]``, roots ``[B, T, 5]`` and 6D rotations."""
        between = interpolate(Motion.of(segments), segments.frames, self.parents)
        positions, six_d = pose_features(between, self.kinematics)
        return torch.cat([positions, six_d], -1).flatten(2), between.global_root(self.left_axis), six_d

    @torch.no_grad()
    def __call__(self, segments: Segments, frames: int, sampling: object = None) -> Motion:
        """The answer; there is but one."""
        six_d, root, _ = self.fill(segments)
        return Motion(root, six_d_to_matrix(six_d))
