"""The root's choice: what else the way might have been, beside the likeliest one that the root module gives.

A conditional factor analysis (Rubin and Thayer 1982) of what the root module misses: K curves, read from its hidden slots,
are added with weights z ~ N(0, I), so z = 0 is the likeliest root itself. Each curve is made of cubic B-splines, one a
token: with nothing faster in it, drawn roots do not shake. An envelope holds it at zero at context frames and given targets.
"""

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_FRAMES, MAX_TARGETS
from troupe_training.data.precision import full_precision
from troupe_training.models.layers import Transformer
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, MAX_TOKENS, ModelConfig
from troupe_training.models.motionbricks.root_module import RootPass

CHANNELS = 4  # x, y, z in metres, heading in radians
# Usual sizes of errors by channel. The read-out's numbers are multiples of them.
SCALES = (0.05, 0.02, 0.05, 0.1)
# Frames from the context, and from a target, at which half of the envelope is reached. The speed of
# the context is known, so misses begin with the square of time; at a target only the place is.
CONTEXT_FRAMES_TO_HALF, TARGET_FRAMES_TO_HALF = 3.0, 2.0


def envelope(has_global_root: Tensor, num_tokens: Tensor) -> Tensor:
    """``[B, 64]``: 0 at context frames and given target roots, near 1 far from both.

    ``has_global_root`` ``[B, 8]`` of 0/1 are the given slots, ``num_tokens`` ``[B]`` tells where the target slots lie.
    """
    frame = torch.arange(MAX_FRAMES, device=num_tokens.device, dtype=torch.float32)
    since = (frame - (CONTEXT_FRAMES - 1)).clamp_min(0.0).square()
    open_ = (since / (since + CONTEXT_FRAMES_TO_HALF**2))[None]
    for slot in range(MAX_TARGETS):
        place = (num_tokens * FRAMES_PER_TOKEN - MAX_TARGETS + slot).float()[:, None]
        apart = (frame[None] - place).abs()
        given = has_global_root[:, CONTEXT_FRAMES + slot, None]
        # Given: apart / (apart + half), which is 0 at the target itself.
        open_ = open_ * (apart + (1.0 - given) * TARGET_FRAMES_TO_HALF) / (apart + TARGET_FRAMES_TO_HALF)
    return open_


def splines(frames: int) -> Tensor:
    """Values ``[64, 16]`` at each frame of cubic B-splines that are centred on the tokens, with pieces of so many ``frames``.

    If pieces are longer than tokens they overlap more, and what they make is smoother.
    """
    centre = torch.arange(MAX_TOKENS) * FRAMES_PER_TOKEN + (FRAMES_PER_TOKEN - 1) / 2
    apart = ((torch.arange(MAX_FRAMES)[:, None] - centre[None]) / frames).abs()
    near = 2 / 3 - apart**2 + apart**3 / 2
    far = (2 - apart).clamp_min(0.0) ** 3 / 6
    return torch.where(apart < 1, near, far) * (FRAMES_PER_TOKEN / frames)


def moved(root: Tensor, delta: Tensor) -> Tensor:
    """Roots ``[..., 5]`` moved by ``delta`` ``[..., 4]``: places shifted, headings turned."""
    cosine, sine = torch.cos(delta[..., 3]), torch.sin(delta[..., 3])
    c, s = root[..., 3], root[..., 4]
    return torch.cat(
        [root[..., :3] + delta[..., :3], torch.stack([c * cosine - s * sine, s * cosine + c * sine], -1)], -1
    )


class RootChoice(nn.Module):
    """From a pass of the root module to K curves, and to the root that K numbers choose."""

    splines: Tensor
    scales: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.choices = config.root_choices
        self.trunk = Transformer(config.root_dim, 1, config.attention_head_dim)
        self.read = nn.Linear(config.root_dim, self.choices * CHANNELS)
        with torch.no_grad():
            self.read.weight.mul_(0.3)
        # Sizes of the unexplained errors of places and of their speeds, for training alone.
        self.log_rest = nn.Parameter(torch.zeros(2, CHANNELS))
        self.register_buffer("splines", splines(config.root_curve_frames))
        self.register_buffer("scales", torch.tensor(SCALES), persistent=False)

    def knots(self, root_pass: RootPass) -> Tensor:
        """Knots ``[B, 16, K, 4]`` of the curves."""
        hidden = self.trunk(root_pass.hidden, root_pass.valid)[:, :MAX_TOKENS]
        return self._scaled(self.read(hidden))

    @full_precision
    def _scaled(self, read: Tensor) -> Tensor:
        return read.float().unflatten(-1, (self.choices, CHANNELS)) * self.scales

    @full_precision
    def curves(self, root_pass: RootPass) -> Tensor:
        """The curves at every frame, ``[B, 64, K, 4]``."""
        knots = self.knots(root_pass)
        return (self.splines @ knots.flatten(2)).unflatten(-1, knots.shape[2:]) * root_pass.envelope[..., None, None]

    def forward(self, root_pass: RootPass, root_noise: Tensor) -> Tensor:
        """The root ``[B, 64, 5]`` that ``root_noise`` ``[B, K]`` chooses; zeros choose the likeliest."""
        return self.chosen(self.knots(root_pass), root_pass, root_noise)

    @full_precision
    def chosen(self, knots: Tensor, root_pass: RootPass, root_noise: Tensor) -> Tensor:
        """`forward` from knots that are at hand."""
        delta = self.splines @ (knots * root_noise[:, None, :, None]).sum(2)
        return moved(root_pass.root, delta * root_pass.envelope[..., None])
