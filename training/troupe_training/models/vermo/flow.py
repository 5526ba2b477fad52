"""FlowVQ's second stage (paper, section 4.2): a transformer that carries noise to motion, given the tokens.

It makes what the first stage's decoder leaves out: the motion is that decoder's draft and a remainder, and the flow goes from
noise to the remainder, in units of the remainder's own deviation. (The paper's flow makes the whole motion. With hours of
data and of training, that has to learn again what the draft has already.) It predicts the velocity of ``x_t = (1 - t) noise + t
remainder``. The tokens reach it twice: by cross-attention, and as the draft.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.models.layers import mlp3, sinusoids
from troupe_training.models.vermo.config import RATE, FlowConfig
from troupe_training.models.vermo.language import rotary, rotated
from troupe_training.models.vermo.tokenizer import Tokenizer

TIME_STEPS = 1000  # of the sinusoids that tell the time


class Attention(nn.Module):
    """Attention from frames to frames or tokens, with rotary places in frames."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.heads = heads
        self.query, self.key, self.value, self.out = (nn.Linear(width, width) for _ in range(4))

    def forward(self, x: Tensor, other: Tensor, places: Tensor, other_places: Tensor) -> Tensor:
        """``[B, F, C]`` from ``other`` ``[B, N, C]``; places ``[F]`` and ``[N]``."""
        split = (self.heads, x.shape[-1] // self.heads)
        q = self.query(x).unflatten(-1, split).transpose(1, 2)
        k, v = (part(other).unflatten(-1, split).transpose(1, 2) for part in (self.key, self.value))
        q = rotated(q, *(t[None, None] for t in rotary(places, split[1])))
        k = rotated(k, *(t[None, None] for t in rotary(other_places, split[1])))
        scores = torch.softmax(torch.matmul(q, k.transpose(-1, -2)) * split[1] ** -0.5, -1)
        return self.out(torch.matmul(scores, v).transpose(1, 2).flatten(2))


class FlowLayer(nn.Module):
    """Cross-attention, self-attention and feed-forward, each scaled and shifted by the time."""

    def __init__(self, config: FlowConfig):
        super().__init__()
        width = config.width
        self.norms = nn.ModuleList(nn.LayerNorm(width, elementwise_affine=False) for _ in range(3))
        self.cross, self.own = Attention(width, config.heads), Attention(width, config.heads)
        self.up = nn.Linear(width, config.feedforward * width)
        self.down = nn.Linear(config.feedforward * width, width)
        self.modulation = nn.Linear(width, 6 * width)
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, x: Tensor, tokens: Tensor, time: Tensor, places: Tensor, token_places: Tensor) -> Tensor:
        """``x`` ``[B, F, C]``, ``tokens`` ``[B, T, C]``, ``time`` ``[B, C]``."""
        scales = self.modulation(F.silu(time))[:, None].chunk(6, -1)
        first = self.norms[0](x) * (1.0 + scales[0]) + scales[1]
        x = x + self.cross(first, tokens, places, token_places)
        second = self.norms[1](x) * (1.0 + scales[2]) + scales[3]
        x = x + self.own(second, second, places, places)
        third = self.norms[2](x) * (1.0 + scales[4]) + scales[5]
        return x + self.down(F.gelu(self.up(third)))


class FlowDecoder(nn.Module):
    """Velocities of remainders, given tokens and the draft.

    ``spread`` ``[D]`` is the deviation of what the draft leaves, in units of standardised states.
    """

    time_table: Tensor
    spread: Tensor

    def __init__(self, config: FlowConfig, levels: int, state: int):
        super().__init__()
        self.config = config
        width = config.width
        self.enter = nn.Linear(2 * state, width)
        self.tokens = nn.Linear(levels, width)
        self.time = mlp3(width, width)
        self.layers = nn.ModuleList(FlowLayer(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(width)
        self.leave = nn.Linear(width, state)
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)
        frequency = sinusoids(2, width)[1:]  # of a step of one
        self.register_buffer("time_table", torch.asin(frequency[:, 0::2]), persistent=False)
        self.register_buffer("spread", torch.ones(state))

    def time_condition(self, time: Tensor) -> Tensor:
        """Embedding ``[B, C]`` of times ``[B]`` from 0 to 1."""
        angle = time[:, None] * TIME_STEPS * self.time_table
        return self.time(torch.cat([torch.sin(angle), torch.cos(angle)], -1))

    def finished(self, remainder: Tensor, drafted: Tensor) -> Tensor:
        """The standardised state ``[B, F, D]`` of a draft and its remainder."""
        return drafted + self.spread * remainder

    def forward(self, remainder: Tensor, drafted: Tensor, levels: Tensor, time: Tensor) -> Tensor:
        """Velocity ``[B, F, D]`` of ``remainder`` at ``time`` ``[B]``; ``drafted`` is the first stage's standardised state."""
        places = torch.arange(remainder.shape[1], device=remainder.device)
        token_places = torch.arange(levels.shape[1], device=remainder.device) * RATE + (RATE - 1) / 2
        x = self.enter(torch.cat([remainder, drafted], -1))
        tokens, condition = self.tokens(levels), self.time_condition(time)
        for layer in self.layers:
            x = layer(x, tokens, condition, places, token_places)
        return self.leave(self.norm(x))


def flow_sample(flow: FlowDecoder, tokenizer: Tokenizer, tokens: Tensor, noise: Tensor, steps: int) -> Tensor:
    """States ``[B, F, D]`` in physical units of codes ``[B, T]``, from standard normal noise by Euler's method."""
    levels = tokenizer.embed(tokens)
    drafted = tokenizer.decoder(levels).float()
    remainder = noise
    for step in range(steps):
        time = torch.full((len(tokens),), step / steps, device=noise.device)
        remainder = remainder + flow(remainder, drafted, levels, time).float() / steps
    return tokenizer.state_scale.invert(flow.finished(remainder, drafted))
