"""The structured multi-head tokenizer (paper section 4): pose encoder, K codebooks, conditional decoder.

The encoder sees poses only, never the root (root-pose disentanglement). The decoder sees the root trajectory and any
keyframes at every up-sampling rate, and refines the root as it decodes.
"""

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from troupe_training.carried import CarriedPose, usual_heights
from troupe_training.config import FPS, FRAMES_PER_TOKEN, ModelConfig
from troupe_training.features import local_root_of
from troupe_training.layers import (
    ConvStack,
    Standardiser,
    full_precision,
    stack_frames,
    unstack_frames,
    valid_frames,
)
from troupe_training.rotations import arc_tangent, six_d_to_matrix


@dataclass
class Decoded:
    """What the decoder gives for each frame, in physical units; `rotations` is ``[B, T, J, 3, 3]``."""

    positions: torch.Tensor
    rotations: torch.Tensor
    lengths: torch.Tensor  # of the two columns before they were made orthonormal: [B, T, J, 2]
    velocities: torch.Tensor
    contact_logits: torch.Tensor
    local_root: torch.Tensor
    global_root: torch.Tensor


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

    def forward(self, pose: torch.Tensor) -> torch.Tensor:
        one = torch.ones(1, 1, 1, device=pose.device)
        x = self.level_full(self.enter(pose), one)
        x = self.level_half(self.down_half(stack_frames(x, 2)), one)
        x = self.level_quarter(self.down_quarter(stack_frames(x, 2)), one)
        return self.leave(x)


class MultiHeadQuantizer(nn.Module):
    """K codebooks of C codes, nearest neighbour, running-mean updates, dead codes drawn anew from the batch."""

    def __init__(self, config: ModelConfig, decay: float = 0.99):
        super().__init__()
        self.heads, self.codes, self.dim, self.decay = config.heads, config.codes, config.code_dim, decay
        self.register_buffer("book", torch.randn(self.heads, self.codes, self.dim))
        self.register_buffer("count", torch.zeros(self.heads, self.codes))
        self.register_buffer("total", torch.zeros(self.heads, self.codes, self.dim))

    def embed(self, tokens: torch.Tensor) -> torch.Tensor:
        """Tokens ``[B, n, K]`` to embeddings ``[B, n, K*code_dim]``."""
        offset = torch.arange(self.heads, device=tokens.device) * self.codes
        return self.book.reshape(-1, self.dim)[tokens + offset].flatten(2)

    @full_precision
    def tokens(self, latent: torch.Tensor) -> torch.Tensor:
        """Nearest codes ``[B, n, K]`` of latents ``[B, n, K*code_dim]``."""
        split = latent.unflatten(-1, (self.heads, self.dim)).float()
        score = torch.einsum("bnkd,kcd->bnkc", split, self.book) - 0.5 * (self.book**2).sum(-1)
        return score.argmax(-1)

    def forward(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Straight-through embeddings, tokens and the commitment loss; updates the codebooks when training."""
        latent = latent.float()
        tokens = self.tokens(latent)
        if self.training:
            self._update(latent.detach(), tokens)
        quantized = self.embed(tokens)
        commitment = F.mse_loss(latent, quantized.detach())
        return latent + (quantized - latent).detach(), tokens, commitment

    @torch.no_grad()
    def _update(self, latent: torch.Tensor, tokens: torch.Tensor) -> None:
        flat = latent.reshape(-1, self.heads, self.dim)
        chosen = tokens.reshape(-1, self.heads)
        if float(self.count.sum()) == 0.0:  # first batch: start from real latents
            pick = torch.randint(len(flat), (self.codes,), device=flat.device)
            self.book.copy_(flat[pick].transpose(0, 1))
            self.count.fill_(1.0)
            self.total.copy_(self.book)
            return
        for head in range(self.heads):
            hits = torch.bincount(chosen[:, head], minlength=self.codes).float()
            sums = torch.zeros_like(self.total[head]).index_add_(0, chosen[:, head], flat[:, head])
            self.count[head].lerp_(hits, 1 - self.decay)
            self.total[head].lerp_(sums, 1 - self.decay)
            dead = self.count[head] < 0.02 * len(flat) / self.codes
            if dead.any():
                fresh = flat[torch.randint(len(flat), (int(dead.sum()),), device=flat.device), head]
                self.count[head][dead] = len(flat) / self.codes
                self.total[head][dead] = fresh * (len(flat) / self.codes)
            self.book[head] = self.total[head] / self.count[head][:, None].clamp_min(1e-5)


class FiniteScalarQuantizer(nn.Module):
    """K heads whose few dimensions are each rounded to fixed levels (FSQ, Mentzer et al. 2023); nothing to learn.

    A head's code counts its levels, the first dimension fastest. Embeddings are the levels, -1 to 1.
    """

    def __init__(self, config: ModelConfig):
        super().__init__()
        levels = torch.tensor(config.fsq_levels, dtype=torch.float32)
        self.heads, self.codes, self.dim = config.heads, config.codes, config.code_dim
        if min(config.fsq_levels) < 3:
            raise ValueError(f"each of {config.fsq_levels} must be 3 or more: two levels have no middle")
        if int(levels.prod()) != self.codes or len(levels) != self.dim:
            raise ValueError(
                f"{config.fsq_levels} make {int(levels.prod())} codes of {len(levels)} dimensions"
            )
        basis = torch.cat([torch.ones(1), levels[:-1].cumprod(0)])
        place = torch.arange(self.codes)[:, None].div(basis, rounding_mode="floor") % levels
        self.register_buffer("levels", levels)
        self.register_buffer("basis", basis)
        book = (place - levels.div(2, rounding_mode="floor")) / levels.div(2, rounding_mode="floor")
        self.register_buffer("book", book.expand(self.heads, -1, -1).clone())

    embed = MultiHeadQuantizer.embed

    @full_precision
    def _rounded(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Bounded latents ``[..., K, dim]`` before and after rounding, in whole levels about 0."""
        z = latent.float().unflatten(-1, (self.heads, self.dim))
        half = (self.levels - 1) * (1 - 1e-3) / 2
        # An even number of levels lies half a level off; the shift has a latent of 0 stay at 0.
        offset = torch.where(self.levels % 2 == 0, 0.5, 0.0)
        bounded = torch.tanh(z + torch.atanh(offset / half)) * half - offset
        return bounded, bounded.round()

    def tokens(self, latent: torch.Tensor) -> torch.Tensor:
        """Codes ``[B, n, K]`` of latents ``[B, n, K*code_dim]``."""
        _, rounded = self._rounded(latent)
        place = rounded + self.levels.div(2, rounding_mode="floor")
        return (place * self.basis).sum(-1).long()

    def forward(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Straight-through embeddings, tokens and a commitment loss of zero."""
        bounded, rounded = self._rounded(latent)
        through = (bounded + (rounded - bounded).detach()) / self.levels.div(2, rounding_mode="floor")
        return through.flatten(2), self.tokens(latent), through.new_zeros(())


def quantizer_of(config: ModelConfig) -> nn.Module:
    """The quantizer that a configuration names."""
    return FiniteScalarQuantizer(config) if config.fsq_levels else MultiHeadQuantizer(config)


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

    def condition(
        self, global_root: torch.Tensor, pose: torch.Tensor, frame_mask: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Per-frame condition ``[B, T, .]`` of the standardised poses that are carried, and the local root it holds."""
        local = self.root_scale(local_root_of(global_root))
        mask = frame_mask[..., None]
        pose = pose + self.missing_pose * (1.0 - mask)
        return torch.cat([local, global_root[..., 3:], pose, mask], -1), local

    def forward(
        self,
        embedded: torch.Tensor,
        global_root: torch.Tensor,
        frame_pose: torch.Tensor,
        frame_mask: torch.Tensor,
        num_tokens: torch.Tensor | None = None,
    ) -> Decoded:
        """``embedded`` ``[B, n, K*code_dim]``, roots ``[B, T, 5]``, poses ``[B, T, J*9]`` where ``frame_mask`` is 1."""
        carried, distance = self.carry(frame_pose, frame_mask, global_root)
        scaled = self.scaled(carried)
        hidden, local = self.hidden(embedded, global_root, scaled, frame_mask, num_tokens)
        return self._read_out(
            hidden.float(), local.float(), global_root, scaled, self.carried.shares(distance)
        )

    def carry(
        self, frame_pose: torch.Tensor, frame_mask: torch.Tensor, global_root: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """The keyframes' poses at every frame, less their usual heights, and distances to the nearest (`CarriedPose`)."""
        # Frames that are not given may hold anything.
        heights = usual_heights(self.pose_scale.mean)
        return self.carried(frame_pose * frame_mask[..., None], frame_mask, global_root, heights)

    def scaled(self, carried: torch.Tensor) -> torch.Tensor:
        """What `carry` gives, standardised."""
        mean = self.pose_scale.mean
        return (carried - (mean - usual_heights(mean))) / self.pose_scale.std

    def hidden(
        self,
        embedded: torch.Tensor,
        global_root: torch.Tensor,
        carried: torch.Tensor,
        frame_mask: torch.Tensor,
        num_tokens: torch.Tensor | None,
    ) -> tuple[torch.Tensor, torch.Tensor]:
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
    def _read_out(
        self,
        hidden: torch.Tensor,
        local: torch.Tensor,
        global_root: torch.Tensor,
        carried: torch.Tensor,
        trust: torch.Tensor,
    ) -> Decoded:
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


def integrate_root(start: torch.Tensor, local_root: torch.Tensor) -> torch.Tensor:
    """Global root ``[B, T, 5]`` from its first value ``[B, 5]`` and local roots ``[B, T, 4]`` (r_g4).

    The first heading is computed at every frame, for the reason that `local_root_of` tells.
    """
    start = start[:, None].expand(-1, local_root.shape[1], -1)
    step = local_root[..., :3] / FPS
    first = torch.zeros_like(step[:, :1])
    travelled = torch.cumsum(torch.cat([first, step[:, 1:]], 1), 1)
    psi = arc_tangent(start[..., 4], start[..., 3]) + travelled[..., 2]
    return torch.stack(
        [
            start[..., 0] + travelled[..., 0],
            local_root[..., 3],
            start[..., 2] + travelled[..., 1],
            torch.cos(psi),
            torch.sin(psi),
        ],
        -1,
    )


class Tokenizer(nn.Module):
    """Encoder, quantizer and decoder together, as trained."""

    def __init__(self, config: ModelConfig, joints: int, contacts: int):
        super().__init__()
        self.config = config
        self.encoder = Encoder(config, joints * 9)
        self.quantizer = quantizer_of(config)
        self.decoder = Decoder(config, joints, contacts)

    def encode(self, pose: torch.Tensor) -> torch.Tensor:
        """Latents of poses ``[B, T, J*9]`` in physical units."""
        return self.encoder(self.decoder.pose_scale(pose))


class DecoderStage(nn.Module):
    """The exported decoder: tokens in, frames out, every tensor as the pack contract names it.

    It reads out what a server needs. The two columns of a rotation are as the network gives them: who reads them
    orthonormalises (`six_d_to_matrix`), which costs a graph many small operations.
    """

    def __init__(self, tokenizer: Tokenizer):
        super().__init__()
        decoder = tokenizer.decoder
        self.decoder = decoder
        self.quantizer = tokenizer.quantizer
        pose_dim = decoder.joints * 9
        six_d = torch.arange(pose_dim).reshape(decoder.joints, 9)[:, 3:].flatten()
        root = torch.arange(pose_dim, pose_dim + 4)
        contacts = torch.arange(decoder.contacts) + pose_dim + 4 + decoder.joints * 3
        columns = torch.cat([six_d, root, contacts]).to(decoder.leave.weight.device)
        self.register_buffer("columns", columns, persistent=False)
        self.widths = [len(six_d), len(root), len(contacts)]
        self.leave = nn.Linear(decoder.leave.in_features, len(columns), device=columns.device)
        # Rotations come out in physical units less their usual heights, and so does what is carried.
        scale, centre = torch.ones(len(columns)), torch.zeros(len(columns))
        heights = usual_heights(decoder.pose_scale.mean)[six_d]
        scale[: len(six_d)], centre[: len(six_d)] = (
            decoder.pose_scale.std[six_d],
            decoder.pose_scale.mean[six_d] - heights,
        )
        with torch.no_grad():
            self.leave.weight.copy_(decoder.leave.weight[columns] * scale[:, None])
            self.leave.bias.copy_(decoder.leave.bias[columns] * scale + centre)
        self.register_buffer("heights", heights.unflatten(0, (decoder.joints, 6)), persistent=False)
        self.register_buffer("trust", decoder.carried.trust.detach()[:, six_d].clone())

    def forward(self, tokens, num_tokens, global_root, frame_pose, frame_mask):
        decoder = self.decoder
        embedded = self.quantizer.embed(tokens)
        carried, distance = decoder.carry(frame_pose, frame_mask, global_root)
        hidden, local = decoder.hidden(embedded, global_root, decoder.scaled(carried), frame_mask, num_tokens)
        rotations, root, contacts = self.leave(decoder.norm(hidden)).split(self.widths, -1)
        trust = self.trust.index_select(0, distance.flatten()).unflatten(0, distance.shape)
        carried = carried.unflatten(-1, (decoder.joints, 9))[..., 3:].flatten(2)
        rotations = rotations + trust * (carried - rotations)
        return (
            rotations.unflatten(-1, (decoder.joints, 6)) + self.heights,
            integrate_root(global_root[:, 0], decoder.root_scale.invert(local + 0.2 * root)),
            torch.sigmoid(contacts),
        )


assert FRAMES_PER_TOKEN == 4, "the decoder up-samples twice by two"
