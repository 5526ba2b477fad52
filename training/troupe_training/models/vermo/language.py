"""The language model: a decoder like LLaMA's, with grouped keys, rotary positions and gated feed-forward layers.

Motion codes are points on a grid of few levels. A code's embedding is therefore its own vector plus one for each of its levels,
so that codes that are rarely seen still lie near their neighbours. The same table reads and writes.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.models.vermo.config import LanguageConfig
from troupe_training.models.vermo.messages import Vocabulary

ROTARY_BASE = 10000.0
MASKED = -1e9


def rotary(positions: Tensor, width: int) -> tuple[Tensor, Tensor]:
    """Cosines and sines ``[..., width / 2]`` of positions ``[...]``."""
    frequency = ROTARY_BASE ** (-torch.arange(0, width, 2, device=positions.device).float() / width)
    angle = positions.float()[..., None] * frequency
    return torch.cos(angle), torch.sin(angle)


def rotated(x: Tensor, cosine: Tensor, sine: Tensor) -> Tensor:
    """Queries or keys ``[S, H, L, W]`` turned by ``[S, 1, L, W / 2]``."""
    first, second = x.chunk(2, -1)
    return torch.cat([first * cosine - second * sine, second * cosine + first * sine], -1)


class Norm(nn.Module):
    """Root-mean-square normalisation in plain operators."""

    def __init__(self, width: int):
        super().__init__()
        self.gain = nn.Parameter(torch.ones(width))

    def forward(self, x: Tensor) -> Tensor:
        """``[..., width]`` to the same."""
        return x * torch.rsqrt(x.square().mean(-1, keepdim=True) + 1e-6) * self.gain


class Layer(nn.Module):
    """Pre-norm attention over grouped keys, and a gated feed-forward."""

    def __init__(self, config: LanguageConfig):
        super().__init__()
        self.config = config
        width, keys = config.width, config.key_heads * config.head_width
        self.norm1, self.norm2 = Norm(width), Norm(width)
        self.query, self.out = nn.Linear(width, width, bias=False), nn.Linear(width, width, bias=False)
        self.key, self.value = nn.Linear(width, keys, bias=False), nn.Linear(width, keys, bias=False)
        self.gate, self.up = (nn.Linear(width, config.feedforward, bias=False) for _ in range(2))
        self.down = nn.Linear(config.feedforward, width, bias=False)

    def projected(self, x: Tensor, cosine: Tensor, sine: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Queries ``[S, H, L, W]``, keys and values ``[S, K, L, W]``, queries and keys turned."""
        x = self.norm1(x)
        split = (-1, self.config.head_width)
        q, k, v = (part(x).unflatten(-1, split).transpose(1, 2) for part in (self.query, self.key, self.value))
        return rotated(q, cosine, sine), rotated(k, cosine, sine), v

    def finished(self, x: Tensor, mixed: Tensor) -> Tensor:
        """The layer's output from what attention mixed ``[S, H, L, W]``."""
        x = x + self.out(mixed.transpose(1, 2).flatten(2))
        y = self.norm2(x)
        return x + self.down(F.silu(self.gate(y)) * self.up(y))


class LanguageModel(nn.Module):
    """Tokens to logits: `forward` over whole messages, `Served` over a cache."""

    levels: Tensor

    def __init__(self, config: LanguageConfig, vocabulary: Vocabulary, levels: tuple[int, ...], dropout: float = 0.0):
        super().__init__()
        self.config, self.vocabulary = config, vocabulary
        self.dropout = dropout
        self.own = nn.Parameter(torch.randn(vocabulary.size, config.width) * 0.02)
        self.shared = nn.Parameter(torch.randn(sum(levels), config.width) * 0.02)
        self.register_buffer("levels", _levels_of(vocabulary.motion_codes, levels), persistent=False)
        self.layers = nn.ModuleList(Layer(config) for _ in range(config.layers))
        self.norm = Norm(config.width)
        deep = (2 * config.layers) ** -0.5
        for name, weight in self.layers.named_parameters():
            if weight.dim() == 2:
                nn.init.normal_(weight, std=0.02 * (deep if name.endswith(("out.weight", "down.weight")) else 1.0))

    def table(self) -> Tensor:
        """Embeddings of the whole vocabulary ``[V, width]``."""
        first, end = self.vocabulary.span("motion")
        motion = self.own[first:end] + self.shared[self.levels].sum(1)
        return torch.cat([self.own[:first], motion, self.own[end:]])

    def hidden(self, tokens: Tensor, table: Tensor) -> Tensor:
        """What logits are read from, ``[S, L, width]``, of whole messages ``[S, L]``; `<PAD>` only behind them."""
        positions = torch.arange(tokens.shape[1], device=tokens.device)
        cosine, sine = (t[None, None] for t in rotary(positions, self.config.head_width))
        x = F.dropout(F.embedding(tokens, table) * self.config.width**0.5, self.dropout, self.training)
        groups = self.config.heads // self.config.key_heads
        for layer in self.layers:
            assert isinstance(layer, Layer)
            q, k, v = layer.projected(x, cosine, sine)
            k, v = (part.repeat_interleave(groups, 1) for part in (k, v))
            mixed = F.scaled_dot_product_attention(q, k, v, is_causal=True)
            x = F.dropout(layer.finished(x, mixed) - x, self.dropout, self.training) + x
        return self.norm(x)

    def forward(self, tokens: Tensor) -> Tensor:
        """Logits ``[S, L, V]`` of whole messages ``[S, L]``, without a cache."""
        table = self.table()
        return F.linear(self.hidden(tokens, table), table)

    def served(self) -> "Served":
        """The model over a cache."""
        return Served(self).eval()


def _levels_of(codes: int, levels: tuple[int, ...]) -> Tensor:
    """Rows of the shared table ``[codes, dimensions]`` that a code's embedding adds up, the first dimension fastest."""
    columns, step, first = [], 1, 0
    for count in levels:
        columns.append(torch.arange(codes) // step % count + first)
        step, first = step * count, first + count
    return torch.stack(columns, -1)


class Served(nn.Module):
    """The language model over a cache, as a server runs it: prefill with L columns, decode with one.

    The cache is read and never written: new columns are handed back. Attention takes cached and new keys apart, so that
    nothing of the cache is copied.
    """

    embedding: Tensor

    def __init__(self, model: LanguageModel):
        super().__init__()
        self.config = model.config
        self.layers, self.norm = model.layers, model.norm
        self.register_buffer("embedding", model.table().detach().clone())

    def forward(self, tokens: Tensor, count: Tensor, start: Tensor, cache: Tensor) -> tuple[Tensor, Tensor]:
        """Logits ``[S, V]`` after the last real token, and new columns ``[S, layers, 2, K, L, W]``.

        ``tokens`` ``[S, L]``, ``count`` and ``start`` ``[S]``, ``cache`` ``[S, layers, 2, K, C, W]``.
        """
        config = self.config
        length, cached = tokens.shape[1], cache.shape[4]
        place = torch.arange(length, device=tokens.device)
        cosine, sine = (t[:, None] for t in rotary(start[:, None] + place, config.head_width))
        filled = torch.arange(cached, device=tokens.device)[None] < start[:, None]
        past = torch.where(filled, 0.0, MASKED)[:, None, None, None, :]
        own = torch.where(place[None] <= place[:, None], 0.0, MASKED)
        x = F.embedding(tokens, self.embedding) * config.width**0.5
        columns = []
        for number, layer in enumerate(self.layers):
            assert isinstance(layer, Layer)
            q, k, v = layer.projected(x, cosine, sine)
            columns.append(torch.stack([k, v], 1))
            x = layer.finished(x, self._mixed(q, k, v, cache[:, number], past, own))
        last = (count - 1)[:, None, None].expand(-1, 1, config.width)
        x = self.norm(torch.gather(x, 1, last)[:, 0])
        return torch.matmul(x, self.embedding.transpose(0, 1)), torch.stack(columns, 1)

    def _mixed(self, q: Tensor, k: Tensor, v: Tensor, cache: Tensor, past: Tensor, own: Tensor) -> Tensor:
        """Attention's mix ``[S, H, L, W]`` over cached ``[S, 2, K, C, W]`` and new keys and values."""
        config = self.config
        groups = config.heads // config.key_heads
        q = q.unflatten(1, (config.key_heads, groups)) * config.head_width**-0.5  # [S, K, G, L, W]
        old_keys, old_values = cache[:, 0, :, None], cache[:, 1, :, None]
        old = torch.matmul(q, old_keys.transpose(-1, -2)) + past
        new = torch.matmul(q, k[:, :, None].transpose(-1, -2)) + own
        share = torch.softmax(torch.cat([old, new], -1), -1)
        before = cache.shape[3]
        mixed = torch.matmul(share[..., :before], old_values) + torch.matmul(share[..., before:], v[:, :, None])
        return mixed.flatten(1, 2)
