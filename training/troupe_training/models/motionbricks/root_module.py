"""The root module (paper section 5.1): step 1 predicts how many tokens, step 2 the root trajectory r_g3.

Both steps are transformers over 16 frame-slot embeddings, one constraint embedding f and one timing embedding g. The
trajectory is predicted as a residual to the straight line between the last context root and the last given target
root (or, without one, to the context's constant velocity), which keeps the regression small and the constraints close.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, MAX_FRAMES, MAX_TARGETS
from troupe_training.data.precision import full_precision
from troupe_training.models.layers import Standardiser, Transformer, mlp3, sinusoids, valid_frames
from troupe_training.models.motionbricks.config import COUNTS, FRAMES_PER_TOKEN, MAX_TOKENS, SLOTS, ModelConfig

RESIDUAL_SCALE = 0.25


@dataclass
class RootPass:
    """The result of step 2: the likeliest root, and the features that a choice of others reads."""

    root: Tensor  # r_g3: [B, 64, 5]
    hidden: Tensor  # slots, constraints and timing: [B, 18, dim]
    valid: Tensor  # which of them are inside the segment: [B, 18] of 0/1
    envelope: Tensor  # how free the root is at each frame: [B, 64], 0 if it is given


class RootModule(nn.Module):
    """Constraints in the segment frame to token count and global root ``[B, 64, 5]``."""

    place: Tensor

    def __init__(self, config: ModelConfig, joints: int):
        super().__init__()
        dim, layers, head = config.root_dim, config.root_layers, config.attention_head_dim
        self.pose_scale = Standardiser(joints * 9)
        self.local_scale = Standardiser(4)
        self.global_scale = Standardiser(5)
        widths = {"local_root": 4, "global_root": 5, "pose": joints * 9}
        self.missing = nn.ParameterDict({k: nn.Parameter(torch.randn(w) * 0.02) for k, w in widths.items()})
        constraint = SLOTS * (sum(widths.values()) + len(widths))
        self.embed_constraints = mlp3(constraint, 2 * dim)
        self.embed_timing = mlp3(COUNTS, dim)
        self.missing_timing = nn.Parameter(torch.randn(dim) * 0.02)
        self.slots = nn.Parameter(torch.randn(MAX_TOKENS, dim) * 0.02)
        self.register_buffer("place", sinusoids(MAX_TOKENS + 2, dim))
        self.step1 = Transformer(dim, layers, head)
        self.step2 = Transformer(dim, layers, head)
        self.count_head = nn.Linear(dim, COUNTS)
        self.root_head = nn.Linear(dim, FRAMES_PER_TOKEN * 5)
        with torch.no_grad():
            self.root_head.weight.mul_(0.1)

    def constraints(self, values: dict[str, Tensor], given: dict[str, Tensor]) -> Tensor:
        """f(T1, T2, T3): one embedding for each step, ``[B, 2, dim]``.

        ``values`` ``[B, 8, .]`` and ``given`` ``[B, 8]`` of 0/1 hold the local root, the global root and the pose of each slot.
        """
        scales = {"local_root": self.local_scale, "global_root": self.global_scale, "pose": self.pose_scale}
        scaled = {name: scale(values[name]) for name, scale in scales.items()}
        parts = []
        for name, value in scaled.items():
            mask = given[name][..., None]
            parts += [value * mask + self.missing[name] * (1.0 - mask), mask]
        flat = torch.cat(parts, -1).flatten(1)
        return self.embed_constraints(flat).unflatten(-1, (2, -1))

    def timing(self, one_hot: Tensor, known: Tensor) -> Tensor:
        """g(T): ``one_hot`` ``[B, 14]`` where ``known`` ``[B, 1]`` is 1, the mask embedding elsewhere."""
        return self.embed_timing(one_hot) * known + self.missing_timing * (1.0 - known)

    def count_logits(self, f: Tensor, one_hot: Tensor, known: Tensor) -> tuple[Tensor, Tensor]:
        """Step 1: hidden slots ``[B, 16, dim]`` and logits ``[B, 14]`` over 3 to 16 tokens."""
        batch = f.shape[0]
        slots = self.slots[None].expand(batch, -1, -1)
        x = torch.cat([slots, f[:, :1], self.timing(one_hot, known)[:, None]], 1) + self.place
        x = self.step1(x)
        return x[:, :MAX_TOKENS], self.count_head(x[:, MAX_TOKENS])

    def trajectory(self, hidden: Tensor, f: Tensor, count_one_hot: Tensor, num_tokens: Tensor, base: Tensor) -> Tensor:
        """Step 2: r_g3 ``[B, 64, 5]``; slots past ``num_tokens`` are masked out."""
        return self.read_out(self.refined(hidden, f, count_one_hot, num_tokens)[0], base)

    def refined(self, hidden: Tensor, f: Tensor, count_one_hot: Tensor, num_tokens: Tensor) -> tuple[Tensor, Tensor]:
        """What step 2 reads the root from, ``[B, 18, dim]``, and which of it is inside the segment, ``[B, 18]`` of 0/1."""
        known = torch.ones_like(count_one_hot[:, :1])
        x = torch.cat([hidden, f[:, 1:], self.timing(count_one_hot, known)[:, None]], 1) + self.place
        valid = valid_frames(num_tokens, MAX_TOKENS, 1)
        valid = torch.cat([valid, torch.ones_like(valid[:, :2])], 1)
        return self.step2(x, valid), valid

    def read_out(self, refined: Tensor, base: Tensor) -> Tensor:
        """r_g3 from what `refined` gives."""
        return self._read_out(refined[:, :MAX_TOKENS].float(), base)

    @full_precision
    def _read_out(self, hidden: Tensor, base: Tensor) -> Tensor:
        residual = self.root_head(hidden).reshape(hidden.shape[0], MAX_FRAMES, 5) * RESIDUAL_SCALE
        root = base + residual
        turn = root[..., 3:]
        turn = turn / torch.sqrt((turn * turn).sum(-1, keepdim=True) + 1e-6)
        return torch.cat([root[..., :3], turn], -1)


def baseline_trajectory(local_root: Tensor, global_root: Tensor, has_global: Tensor, num_tokens: Tensor) -> Tensor:
    """The line that step 2 refines, ``[B, 64, 5]``, from slot values ``[B, 8, .]``.

    Through the last context root and the last given target root; without a target along the last context velocity,
    which fades out over about half a second.
    """
    last = CONTEXT_FRAMES - 1
    start = global_root[:, last]
    given = has_global[:, CONTEXT_FRAMES:]
    steps = torch.arange(1, MAX_TARGETS + 1, device=given.device, dtype=given.dtype)
    rank = (given * steps).amax(1)
    chosen = (steps[None] == rank[:, None]).to(given.dtype)
    any_target = (rank > 0).to(given.dtype)[:, None]
    target = (global_root[:, CONTEXT_FRAMES:] * chosen[..., None]).sum(1)
    span = (num_tokens.to(given.dtype) * FRAMES_PER_TOKEN - MAX_TARGETS + rank - 1 - last).clamp_min(1.0)
    frame = torch.arange(MAX_FRAMES, device=given.device, dtype=given.dtype)[None] - last
    line = start[:, None] + (target - start)[:, None] * (frame / span[:, None])[..., None]
    fade = 0.5 * FPS
    reach = fade * (1.0 - torch.exp(-frame.clamp_min(0.0) / fade)) + frame.clamp_max(0.0)
    velocity = local_root[:, last, :2] / FPS
    moving = torch.stack([velocity[:, 0], torch.zeros_like(velocity[:, 0]), velocity[:, 1]], -1)
    drift = torch.cat(
        [start[:, None, :3] + moving[:, None] * reach[..., None], start[:, None, 3:].expand(-1, MAX_FRAMES, -1)], -1
    )
    base = line * any_target[..., None] + drift * (1.0 - any_target[..., None])
    context = global_root[:, :CONTEXT_FRAMES]
    return torch.cat([context, base[:, CONTEXT_FRAMES:]], 1)
