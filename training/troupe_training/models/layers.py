"""Building blocks shared by the networks: normalisation constants, residual convolutions, transformer layers."""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class Standardiser(nn.Module):
    """Turns physical units into zero mean and unit deviation, and back; the constants live in the exported graph."""

    mean: Tensor
    std: Tensor

    def __init__(self, dim: int):
        super().__init__()
        self.register_buffer("mean", torch.zeros(dim))
        self.register_buffer("std", torch.ones(dim))

    def set(self, mean: Tensor, std: Tensor) -> None:
        """Fixes the constants, measured on training data."""
        self.mean.copy_(mean)
        self.std.copy_(std)

    def forward(self, x: Tensor) -> Tensor:
        """Physical to standardised."""
        return (x - self.mean) / self.std

    def invert(self, x: Tensor) -> Tensor:
        """Standardised to physical."""
        return x * self.std + self.mean


class FrameConv(nn.Conv1d):
    """A convolution over time of ``[B, T, C]`` with stride one, zeros beyond both ends.

    One matrix product over shifted copies: on CPU cores an eighth more updates a second than Conv1d and its transposes,
    at the cost of keeping the copies for the backward pass.
    """

    def __init__(self, channels: int, kernel: int):
        super().__init__(channels, channels, kernel, padding=kernel // 2)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, T, C] -> [B, T, C]``."""
        taps, frames = self.kernel_size[0], x.shape[1]
        padded = F.pad(x, (0, 0, taps // 2, taps // 2))
        shifted = torch.cat([padded[:, tap : tap + frames] for tap in range(taps)], -1)
        return F.linear(shifted, self.weight.permute(0, 2, 1).flatten(1), self.bias)


class UnrolledConv(nn.Module):
    """A `FrameConv` for export: its weights laid out once, and one Gather in place of slices.

    The same numbers in the same order of weights. The convolutions of ONNX Runtime multiply one row of the batch at a time and
    are slow where that row has only a few frames; one Gather makes the copies faster than slices and their concatenation.
    """

    weight: Tensor
    bias: Tensor

    def __init__(self, conv: FrameConv):
        super().__init__()
        assert conv.bias is not None
        self.taps = conv.kernel_size[0]
        self.register_buffer("weight", conv.weight.detach().permute(2, 1, 0).flatten(0, 1).contiguous())
        self.register_buffer("bias", conv.bias.detach().clone())

    def forward(self, x: Tensor) -> Tensor:
        """``[B, T, C] -> [B, T, C]``."""
        batch, frames, channels = x.shape
        padded = F.pad(x, (0, 0, self.taps // 2, self.taps // 2))
        taps = torch.arange(self.taps, device=x.device)
        window = (torch.arange(frames, device=x.device)[:, None] + taps).flatten()
        shifted = padded.index_select(1, window).reshape(batch, frames, self.taps * channels)
        return shifted @ self.weight + self.bias


def unroll_convolutions(module: nn.Module) -> None:
    """Replaces every convolution inside ``module`` by its `UnrolledConv`."""
    for name, child in module.named_children():
        if isinstance(child, FrameConv):
            setattr(module, name, UnrolledConv(child))
        else:
            unroll_convolutions(child)


class ResidualConv(nn.Module):
    """``x + conv(relu(norm(x)))`` with frames outside the segment held at zero; each frame is normalised for itself."""

    def __init__(self, channels: int, kernel: int):
        super().__init__()
        self.norm = nn.LayerNorm(channels)
        self.conv = FrameConv(channels, kernel)

    def forward(self, x: Tensor, valid: Tensor) -> Tensor:
        """``x`` ``[B, T, C]``, ``valid`` ``[B, T, 1]`` of 0/1."""
        return x + self.conv(F.relu(self.norm(x)) * valid)


class ConvStack(nn.Module):
    """Three residual convolutions with growing kernels (paper section 7.4)."""

    def __init__(self, channels: int, kernels: tuple[int, ...]):
        super().__init__()
        self.blocks = nn.ModuleList(ResidualConv(channels, k) for k in kernels)

    def forward(self, x: Tensor, valid: Tensor) -> Tensor:
        """``x`` ``[B, T, C]``, ``valid`` ``[B, T, 1]`` of 0/1."""
        for block in self.blocks:
            x = block(x, valid)
        return x


def stack_frames(x: Tensor, factor: int) -> Tensor:
    """``[B, T, D] -> [B, T/factor, factor*D]``."""
    batch, frames, dim = x.shape
    return x.reshape(batch, frames // factor, factor * dim)


def unstack_frames(x: Tensor, factor: int) -> Tensor:
    """Inverse of `stack_frames`."""
    batch, frames, dim = x.shape
    return x.reshape(batch, frames * factor, dim // factor)


def sinusoids(length: int, dim: int) -> Tensor:
    """Fixed positional encoding ``[length, dim]`` (Vaswani et al. 2017)."""
    position = torch.arange(length)[:, None]
    frequency = torch.exp(torch.arange(0, dim, 2) * (-math.log(10000.0) / dim))
    table = torch.zeros(length, dim)
    table[:, 0::2] = torch.sin(position * frequency)
    table[:, 1::2] = torch.cos(position * frequency)
    return table


class TransformerLayer(nn.Module):
    """Pre-norm self-attention and feed-forward; ``bias`` ``[B, 1, 1, N]`` is added to the attention scores."""

    def __init__(self, dim: int, head_dim: int, feedforward: int):
        super().__init__()
        self.heads = dim // head_dim
        self.norm1 = nn.LayerNorm(dim)
        self.qkv = nn.Linear(dim, 3 * dim)
        self.out = nn.Linear(dim, dim)
        self.norm2 = nn.LayerNorm(dim)
        self.up = nn.Linear(dim, feedforward * dim)
        self.down = nn.Linear(feedforward * dim, dim)

    def forward(self, x: Tensor, bias: Tensor | None) -> Tensor:
        """``[B, N, dim] -> [B, N, dim]``."""
        batch, length, dim = x.shape
        qkv = self.qkv(self.norm1(x)).reshape(batch, length, 3, self.heads, dim // self.heads)
        q, k, v = qkv.permute(2, 0, 3, 1, 4).unbind(0)
        scores = q @ k.transpose(-1, -2) * (dim // self.heads) ** -0.5
        if bias is not None:
            scores = scores + bias
        mixed = (torch.softmax(scores, -1) @ v).transpose(1, 2).reshape(batch, length, dim)
        x = x + self.out(mixed)
        return x + self.down(F.gelu(self.up(self.norm2(x))))


class Transformer(nn.Module):
    """A stack of `TransformerLayer` with a final norm; feed-forward layers are ``feedforward`` times as wide."""

    def __init__(self, dim: int, layers: int, head_dim: int, feedforward: int = 4):
        super().__init__()
        self.layers = nn.ModuleList(TransformerLayer(dim, head_dim, feedforward) for _ in range(layers))
        self.norm = nn.LayerNorm(dim)

    def forward(self, x: Tensor, valid: Tensor | None = None) -> Tensor:
        """``valid`` ``[B, N]`` of 0/1 masks keys out."""
        bias = None if valid is None else ((1.0 - valid) * -1e4)[:, None, None, :]
        for layer in self.layers:
            x = layer(x, bias)
        return self.norm(x)


def mlp3(inputs: int, dim: int) -> nn.Sequential:
    """The three-layer perceptron that embeds constraints and timing (paper section 5.1)."""
    return nn.Sequential(nn.Linear(inputs, dim), nn.GELU(), nn.Linear(dim, dim), nn.GELU(), nn.Linear(dim, dim))


def valid_frames(num_tokens: Tensor, length: int, per_token: int) -> Tensor:
    """``[B, length]`` of 0/1: steps inside the segment, with ``per_token`` steps a token."""
    steps = torch.arange(length, device=num_tokens.device)
    return (steps[None] < num_tokens[:, None] * per_token).float()
