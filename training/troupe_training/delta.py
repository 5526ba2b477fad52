"""The deterministic baseline: one transformer that corrects linear interpolation, in the manner of the Δ-interpolator.

Oreshkin et al. (2024) have a transformer predict what the interpolation between the keyframes lacks. So does this: it
reads the interpolated motion with the given frames in it, and adds to the rotations and root of all others. It has
about as many parameters as a whole pack (`delta_dim`, `delta_layers`), sees the same frames and predicts no choice: one
answer for each request, in one pass.
"""

import torch
from torch import nn

from troupe_training.baselines import interpolate
from troupe_training.config import CONTEXT_FRAMES, MAX_FRAMES, ModelConfig
from troupe_training.cut import any_length
from troupe_training.features import ClipStore, Segments
from troupe_training.layers import Standardiser, Transformer, full_precision, sinusoids
from troupe_training.losses import Kinematics
from troupe_training.motion import Motion, global_root_of, pose_features
from troupe_training.rotations import six_d_to_matrix
from troupe_training.skeleton import Skeleton

ROOT_RESIDUAL_M = 0.25


class DeltaInterpolator(nn.Module):
    """Interpolated frames to what they lack: 6D rotations ``[B, T, J, 6]`` and root positions ``[B, T, 3]``."""

    def __init__(self, config: ModelConfig, joints: int):
        super().__init__()
        self.joints = joints
        self.pose_scale = Standardiser(joints * 9)
        self.global_scale = Standardiser(5)
        self.enter = nn.Linear(joints * 9 + 5 + 2, config.delta_dim)
        self.register_buffer("place", sinusoids(MAX_FRAMES, config.delta_dim))
        self.trunk = Transformer(config.delta_dim, config.delta_layers, config.attention_head_dim)
        self.leave = nn.Linear(config.delta_dim, joints * 6 + 3)
        with torch.no_grad():
            self.leave.weight.mul_(0.1)

    def forward(
        self, pose: torch.Tensor, root: torch.Tensor, given: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Interpolated poses ``[B, T, J*9]`` and roots ``[B, T, 5]``; ``given`` ``[T]`` is 1 where a frame was given."""
        frames = pose.shape[1]
        left = torch.linspace(1.0, 0.0, frames - CONTEXT_FRAMES + 1, device=pose.device)
        left = torch.cat([torch.ones(CONTEXT_FRAMES - 1, device=pose.device), left])
        about = torch.stack([given, left], -1).expand(len(pose), -1, -1)
        x = self.enter(torch.cat([self.pose_scale(pose), self.global_scale(root), about], -1))
        return self._read_out(self.trunk(x + self.place[:frames]), 1.0 - given)

    @full_precision
    def _read_out(self, hidden: torch.Tensor, free: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        lacking = self.leave(hidden.float()) * free[:, None]
        six_d = lacking[..., :-3] * self.pose_scale.std.unflatten(0, (self.joints, 9))[:, 3:].flatten()
        return six_d.unflatten(-1, (self.joints, 6)), lacking[..., -3:] * ROOT_RESIDUAL_M


class DeltaMethod:
    """The model with the interpolation that it corrects; an evaluation's method."""

    def __init__(self, model: DeltaInterpolator, skeleton: Skeleton, device: str = "cpu"):
        self.model, self.parents = model, skeleton.parents
        self.kinematics = Kinematics(skeleton, device)
        self.left_axis = torch.tensor(skeleton.left_axis, device=device)

    @full_precision
    def start(self, segments: Segments) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Pose features, roots, given frames and 6D rotations of the interpolation."""
        frames = segments.frames
        between = interpolate(Motion.of(segments), frames, self.parents)
        positions, six_d = pose_features(between, self.kinematics)
        given = torch.zeros(frames, device=positions.device)
        given[[*range(CONTEXT_FRAMES), frames - 1]] = 1.0
        pose = torch.cat([positions, six_d], -1).flatten(2)
        return pose, global_root_of(between, self.left_axis), given, six_d

    def fill(self, segments: Segments) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """6D rotations, root positions and which frames were given."""
        pose, root, given, six_d = self.start(segments)
        turned, moved = self.model(pose, root, given)
        return six_d + turned, root[..., :3] + moved, given

    @torch.no_grad()
    def __call__(self, segments: Segments, frames: int, sampling: object = None) -> Motion:
        """The answer; there is but one."""
        six_d, root, _ = self.fill(segments)
        return Motion(root, six_d_to_matrix(six_d))


def delta_loss(store: ClipStore, frames_budget: int):
    """L1 of rotations, root and joint positions over the frames that were not given; segments of all lengths."""
    kinematics = Kinematics(store.skeleton, store.device)

    def loss(
        model: DeltaInterpolator, generator: torch.Generator, progress: float
    ) -> dict[str, torch.Tensor]:
        segments = any_length(store, frames_budget, generator)
        six_d, root, given = DeltaMethod(model, store.skeleton, store.device).fill(segments)
        free = given == 0
        made = kinematics.positions(six_d_to_matrix(six_d))[:, free] + root[:, free, None]
        truth = segments.positions + segments.global_root[:, :, None, :3] * torch.tensor(
            [1.0, 0.0, 1.0], device=root.device
        )
        return {
            "rotation": (six_d - segments.six_d)[:, free].abs().mean(),
            "root": 2.0 * (root - segments.global_root[..., :3])[:, free].abs().mean(),
            "fk": 6.0 * (made - truth[:, free]).abs().mean(),
        }

    return loss
