"""Layers of the official networks. Time is the second axis everywhere; ``valid`` ``[B, T, 1]`` is 1 inside the segment."""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.models.motionbricks.official.sizes import Convolutions, Transformers

MASKED = -1e4  # added to attention scores of tokens after the segment


class Perceptron(nn.Module):
    """``layers`` hidden layers with leaky rectifiers, and one without."""

    def __init__(self, inputs: int, width: int, outputs: int, layers: int):
        super().__init__()
        self.hidden = nn.ModuleList(nn.Linear(inputs if i == 0 else width, width) for i in range(layers))
        self.out = nn.Linear(width, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """``[..., inputs] -> [..., outputs]``."""
        for layer in self.hidden:
            x = F.leaky_relu(layer(x))
        return self.out(x)


class PostNormLayer(nn.Module):
    """Self-attention and feed-forward, each normalised after it was added."""

    def __init__(self, width: int, heads: int, feedforward: int):
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.up, self.down = nn.Linear(width, feedforward), nn.Linear(feedforward, width)

    def forward(self, x: Tensor, bias: Tensor | None) -> Tensor:
        """``[B, N, width]``; ``bias`` ``[B, 1, 1, N]`` is added to the scores of keys."""
        batch, length, width = x.shape
        qkv = self.qkv(x).reshape(batch, length, 3, self.heads, width // self.heads)
        q, k, v = qkv.permute(2, 0, 3, 1, 4).unbind(0)
        scores = q @ k.transpose(-1, -2) * (width // self.heads) ** -0.5
        if bias is not None:
            scores = scores + bias
        mixed = (torch.softmax(scores, -1) @ v).transpose(1, 2).reshape(batch, length, width)
        x = self.norm1(x + self.out(mixed))
        return self.norm2(x + self.down(F.relu(self.up(x))))


class PostNormTransformer(nn.Module):
    """A stack of `PostNormLayer`."""

    def __init__(self, sizes: Transformers, layers: int | None = None):
        super().__init__()
        count = sizes.layers if layers is None else layers
        self.layers = nn.ModuleList(PostNormLayer(sizes.width, sizes.heads, sizes.feedforward) for _ in range(count))

    def forward(self, x: Tensor, valid: Tensor | None = None) -> Tensor:
        """``valid`` ``[B, N]`` of 0/1 masks keys out."""
        bias = None if valid is None else ((1.0 - valid) * MASKED)[:, None, None, :]
        for layer in self.layers:
            x = layer(x, bias)
        return x


class Window(nn.Module):
    """A convolution over time with zeros beyond both ends, as one product over gathered frames (`models.layers.UnrolledConv`).

    Of a sequence that never has more than ``longest`` frames, a wider dilation reads nothing but zeros: one tap is left.
    """

    def __init__(self, inputs: int, outputs: int, longest: int, dilation: int = 1):
        super().__init__()
        self.taps = 3 if dilation < longest else 1
        self.dilation = dilation
        self.weight = nn.Parameter(torch.empty(self.taps * inputs, outputs))
        self.bias = nn.Parameter(torch.zeros(outputs))
        nn.init.normal_(self.weight, std=(self.taps * inputs) ** -0.5)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, T, inputs] -> [B, T, outputs]``."""
        if self.taps > 1:
            batch, frames, channels = x.shape
            padded = F.pad(x, (0, 0, self.dilation, self.dilation))
            taps = torch.arange(self.taps, device=x.device) * self.dilation
            window = (torch.arange(frames, device=x.device)[:, None] + taps).flatten()
            x = padded.index_select(1, window).reshape(batch, frames, self.taps * channels)
        return x @ self.weight + self.bias


class Residual(nn.Module):
    """Adds a dilated convolution and one of single frames, each after a rectifier."""

    def __init__(self, channels: int, longest: int, dilation: int):
        super().__init__()
        self.wide = Window(channels, channels, longest, dilation)
        self.narrow = nn.Linear(channels, channels)

    def forward(self, x: Tensor, valid: Tensor) -> Tensor:
        """``x`` is zero outside the segment, and so is what comes out."""
        return (x + self.narrow(F.relu(self.wide(F.relu(x))))) * valid


class Stage(nn.Module):
    """One frame rate of the decoder: what is given at its frames, residual blocks, and twice as many frames out."""

    def __init__(self, sizes: Convolutions, longest: int, stacked: int, target: int, along: int):
        super().__init__()
        channels = sizes.channels
        self.stacked = stacked  # frames of a position
        self.target = nn.Linear(target, channels // stacked)
        self.join = nn.Linear(stacked * along + channels, channels)
        # The widest dilation first.
        spans = [sizes.dilation**i for i in reversed(range(sizes.depth))]
        self.blocks = nn.ModuleList(Residual(channels, longest, span) for span in spans)
        self.leave = Window(channels, channels, 2 * longest)

    def forward(self, x: Tensor, along: Tensor, target: Tensor, given: Tensor, valid: Tensor) -> Tensor:
        """``x`` and ``valid`` by positions ``[B, T, .]``, the others by frames; ``given`` ``[B, F, 1]`` marks targets."""
        batch, positions, channels = x.shape
        frames = x.reshape(batch, positions * self.stacked, channels // self.stacked)
        frames = torch.where(given > 0.5, F.relu(self.target(target)), frames)
        x = frames.reshape(batch, positions, channels)
        x = F.relu(self.join(torch.cat([x, along.reshape(batch, positions, -1)], -1))) * valid
        for block in self.blocks:
            x = block(x, valid)
        return self.leave(twice(x))


class ConditionedDecoder(nn.Module):
    """Tokens to frames: features along all frames are joined in, and targets replace what stands at theirs."""

    def __init__(
        self, sizes: Convolutions, halvings: int, tokens: int, inputs: int, outputs: int, target: int, along: int
    ):
        super().__init__()
        channels, frames = sizes.channels, tokens * 2**halvings
        self.enter = Window(inputs, channels, tokens)
        self.stages = nn.ModuleList(
            Stage(sizes, tokens * 2**i, 2 ** (halvings - i), target, along) for i in range(halvings)
        )
        self.mix = Window(channels, channels, frames)
        self.leave = Window(channels, outputs, frames)

    def forward(self, x: Tensor, along: Tensor, target: Tensor, given: Tensor, valid: Tensor) -> Tensor:
        """``x`` ``[B, N, inputs]`` and ``valid`` ``[B, N, 1]`` by tokens, the others by frames; out come frames."""
        x = F.relu(self.enter(x * valid))
        for stage in self.stages:
            x = stage(x, along, target, given, valid)
            valid = twice(valid)
        x = F.relu(self.mix(x * valid)) * valid
        return self.leave(x)


def twice(x: Tensor) -> Tensor:
    """``[B, T, C] -> [B, 2T, C]``, each frame two times."""
    batch, frames, channels = x.shape
    return x[:, :, None].expand(-1, -1, 2, -1).reshape(batch, 2 * frames, channels)
