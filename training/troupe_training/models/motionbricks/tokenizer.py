"""The structured multi-head tokenizer (paper section 4): pose encoder, K codebooks, conditional decoder.

The encoder sees poses only, never the root (root-pose disentanglement). The decoder sees the root trajectory and any
keyframes at every up-sampling rate, and refines the root as it decodes.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from troupe_training.data.precision import full_precision
from troupe_training.data.roots import integrate_root, local_root_of
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.models.layers import ConvStack, Standardiser, stack_frames, unstack_frames, valid_frames
from troupe_training.models.motionbricks.carried import CarriedPose, usual_heights
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, ModelConfig
from troupe_training.models.motionbricks.quantizers import quantizer_of

assert FRAMES_PER_TOKEN == 4, "the decoder up-samples twice by two"


@dataclass
class Decoded:
    """The decoder's output for each frame, in physical units; `rotations` is ``[B, T, J, 3, 3]``."""

    positions: Tensor
    rotations: Tensor
    lengths: Tensor  # of the two columns before they were made orthonormal: [B, T, J, 2]
    velocities: Tensor
    contact_logits: Tensor
    local_root: Tensor
    global_root: Tensor


class Encoder(nn.Module):
    """Poses ``[B, T, J*9]`` (standardised) to latents ``[B, T/4, K*code_dim]``."""

    def __init__(self, config: ModelConfig, pose_dim: int):
        super().__init__()
        low, mid, full = config.encoder_channels
        self.enter = nn.Linear(pose_dim, full)
        self.level_full = ConvStack(full, config.kernels[:2])
        self.down_half = nn.Linear(2 * full, mid)
        self.level_half = ConvStack(mid, config.kernels)
        self.down_quarter = nn.Linear(2 * mid, low)
        self.level_quarter = ConvStack(low, config.kernels)
        self.leave = nn.Linear(low, config.heads * config.code_dim)

    def forward(self, pose: Tensor) -> Tensor:
        """Latents, from frames of a whole number of tokens."""
        one = torch.ones(1, 1, 1, device=pose.device)
        x = self.level_full(self.enter(pose), one)
        x = self.level_half(self.down_half(stack_frames(x, 2)), one)
        x = self.level_quarter(self.down_quarter(stack_frames(x, 2)), one)
        return self.leave(x)


class Decoder(nn.Module):
    """Token embeddings, root trajectory and keyframes to frames (paper equation 3)."""

    def __init__(self, config: ModelConfig, joints: int, contacts: int):
        super().__init__()
        self.joints, self.contacts = joints, contacts
        pose_dim = joints * 9
        low, mid, full = config.decoder_channels
        self.pose_scale = Standardiser(pose_dim)
        self.root_scale = Standardiser(4)
        self.velocity_scale = Standardiser(joints * 3)
        self.missing_pose = nn.Parameter(torch.zeros(pose_dim))
        self.carried = CarriedPose(joints)
        condition = pose_dim + 1 + 6
        self.condition_quarter = nn.Linear(4 * condition, low)
        self.condition_half = nn.Linear(2 * condition, mid)
        self.condition_full = nn.Linear(condition, full)
        self.enter = nn.Linear(config.heads * config.code_dim, low)
        self.level_quarter = ConvStack(low, config.kernels)
        self.up_half = nn.Linear(low, 2 * mid)
        self.level_half = ConvStack(mid, config.kernels)
        self.up_full = nn.Linear(mid, 2 * full)
        self.level_full = ConvStack(full, config.kernels)
        self.norm = nn.LayerNorm(full)
        self.leave = nn.Linear(full, pose_dim + 4 + joints * 3 + contacts)
        with torch.no_grad():
            self.leave.weight.mul_(0.3)

    def condition(self, global_root: Tensor, pose: Tensor, frame_mask: Tensor) -> tuple[Tensor, Tensor]:
        """Per-frame condition ``[B, T, .]`` of the standardised poses that are carried, and the local root it holds."""
        local = self.root_scale(local_root_of(global_root))
        mask = frame_mask[..., None]
        pose = pose + self.missing_pose * (1.0 - mask)
        return torch.cat([local, global_root[..., 3:], pose, mask], -1), local

    def forward(
        self,
        embedded: Tensor,
        global_root: Tensor,
        frame_pose: Tensor,
        frame_mask: Tensor,
        num_tokens: Tensor | None = None,
    ) -> Decoded:
        """``embedded`` ``[B, n, K*code_dim]``, roots ``[B, T, 5]``, poses ``[B, T, J*9]`` where ``frame_mask`` is 1."""
        carried, distance = self.carry(frame_pose, frame_mask, global_root)
        scaled = self.scaled(carried)
        hidden, local = self.hidden(embedded, global_root, scaled, frame_mask, num_tokens)
        return self._read_out(hidden.float(), local.float(), global_root, scaled, self.carried.shares(distance))

    def carry(self, frame_pose: Tensor, frame_mask: Tensor, global_root: Tensor) -> tuple[Tensor, Tensor]:
        """The keyframes' poses at every frame, less their usual heights, and distances to the nearest (`CarriedPose`)."""
        # Frames that are not given may hold anything.
        heights = usual_heights(self.pose_scale.mean)
        return self.carried(frame_pose * frame_mask[..., None], frame_mask, global_root, heights)

    def scaled(self, carried: Tensor) -> Tensor:
        """The output of `carry`, standardised."""
        mean = self.pose_scale.mean
        return (carried - (mean - usual_heights(mean))) / self.pose_scale.std

    def hidden(
        self, embedded: Tensor, global_root: Tensor, carried: Tensor, frame_mask: Tensor, num_tokens: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """What frames are read from, ``[B, T, .]``, and the standardised local root of ``global_root``."""
        slots = embedded.shape[1]
        if num_tokens is None:
            num_tokens = torch.full((embedded.shape[0],), slots, device=embedded.device)
        valid = [valid_frames(num_tokens, slots * k, k)[..., None] for k in (1, 2, 4)]
        condition, local = self.condition(global_root, carried, frame_mask)
        x = self.enter(embedded) + self.condition_quarter(stack_frames(condition, 4))
        x = self.level_quarter(x, valid[0])
        x = unstack_frames(self.up_half(x), 2) + self.condition_half(stack_frames(condition, 2))
        x = self.level_half(x, valid[1])
        x = unstack_frames(self.up_full(x), 2) + self.condition_full(condition)
        return self.level_full(x, valid[2]), local

    @full_precision
    def _read_out(self, hidden: Tensor, local: Tensor, global_root: Tensor, carried: Tensor, trust: Tensor) -> Decoded:
        raw = self.leave(self.norm(hidden))
        widths = [self.joints * 9, 4, self.joints * 3, self.contacts]
        pose, root, velocity, contact = raw.split(widths, -1)
        pose = self.pose_scale.invert(pose + trust * (carried - pose)).unflatten(-1, (self.joints, 9))
        local_root = self.root_scale.invert(local + 0.2 * root)
        return Decoded(
            positions=pose[..., :3],
            rotations=six_d_to_matrix(pose[..., 3:]),
            lengths=pose[..., 3:].unflatten(-1, (2, 3)).square().sum(-1).add(1e-8).sqrt(),
            velocities=self.velocity_scale.invert(velocity).unflatten(-1, (self.joints, 3)),
            contact_logits=contact,
            local_root=local_root,
            global_root=integrate_root(global_root[:, 0], local_root),
        )


class Tokenizer(nn.Module):
    """Encoder, quantizer and decoder together, as trained."""

    def __init__(self, config: ModelConfig, joints: int, contacts: int):
        super().__init__()
        self.config = config
        self.encoder = Encoder(config, joints * 9)
        self.quantizer = quantizer_of(config)
        self.decoder = Decoder(config, joints, contacts)

    def encode(self, pose: Tensor) -> Tensor:
        """Latents of poses ``[B, T, J*9]`` in physical units."""
        return self.encoder(self.decoder.pose_scale(pose))
