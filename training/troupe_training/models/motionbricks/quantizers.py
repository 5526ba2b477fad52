"""Quantisers of latents: K codebooks, or fixed levels."""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.data.precision import full_precision
from troupe_training.models.motionbricks.config import ModelConfig


class Quantizer(nn.Module):
    """K heads of C codes with ``book`` ``[K, C, code_dim]``; `forward` gives embeddings, tokens and the commitment loss."""

    book: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.heads, self.codes, self.dim = config.heads, config.codes, config.code_dim

    def embed(self, tokens: Tensor) -> Tensor:
        """Tokens ``[B, n, K]`` to embeddings ``[B, n, K*code_dim]``."""
        offset = torch.arange(self.heads, device=tokens.device) * self.codes
        return self.book.reshape(-1, self.dim)[tokens + offset].flatten(2)

    def tokens(self, latent: Tensor) -> Tensor:
        """Codes ``[B, n, K]`` of latents ``[B, n, K*code_dim]``."""
        raise NotImplementedError


class MultiHeadQuantizer(Quantizer):
    """K codebooks of C codes, nearest neighbour, running-mean updates, dead codes drawn again from the batch."""

    count: Tensor
    total: Tensor

    def __init__(self, config: ModelConfig, decay: float = 0.99):
        super().__init__(config)
        self.decay = decay
        self.register_buffer("book", torch.randn(self.heads, self.codes, self.dim))
        self.register_buffer("count", torch.zeros(self.heads, self.codes))
        self.register_buffer("total", torch.zeros(self.heads, self.codes, self.dim))

    @full_precision
    def tokens(self, latent: Tensor) -> Tensor:
        """Nearest codes ``[B, n, K]`` of latents ``[B, n, K*code_dim]``."""
        split = latent.unflatten(-1, (self.heads, self.dim)).float()
        score = torch.einsum("bnkd,kcd->bnkc", split, self.book) - 0.5 * (self.book**2).sum(-1)
        return score.argmax(-1)

    def forward(self, latent: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Straight-through embeddings, tokens and the commitment loss; updates the codebooks when training."""
        latent = latent.float()
        tokens = self.tokens(latent)
        if self.training:
            self._update(latent.detach(), tokens)
        quantized = self.embed(tokens)
        commitment = F.mse_loss(latent, quantized.detach())
        return latent + (quantized - latent).detach(), tokens, commitment

    @torch.no_grad()
    def _update(self, latent: Tensor, tokens: Tensor) -> None:
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


class FiniteScalarQuantizer(Quantizer):
    """K heads whose few dimensions are each rounded to fixed levels (FSQ, Mentzer et al. 2023); nothing to learn.

    A head's code counts its levels, the first dimension fastest. Embeddings are the levels, -1 to 1.
    """

    levels: Tensor
    basis: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__(config)
        levels = torch.tensor(config.fsq_levels, dtype=torch.float32)
        if min(config.fsq_levels) < 3:
            raise ValueError(f"each of {config.fsq_levels} must be 3 or more: two levels have no middle")
        if int(levels.prod()) != self.codes or len(levels) != self.dim:
            raise ValueError(f"{config.fsq_levels} make {int(levels.prod())} codes of {len(levels)} dimensions")
        basis = torch.cat([torch.ones(1), levels[:-1].cumprod(0)])
        place = torch.arange(self.codes)[:, None].div(basis, rounding_mode="floor") % levels
        self.register_buffer("levels", levels)
        self.register_buffer("basis", basis)
        book = (place - levels.div(2, rounding_mode="floor")) / levels.div(2, rounding_mode="floor")
        self.register_buffer("book", book.expand(self.heads, -1, -1).clone())

    @full_precision
    def _rounded(self, latent: Tensor) -> tuple[Tensor, Tensor]:
        """Bounded latents ``[..., K, dim]`` before and after rounding, in whole levels about 0."""
        z = latent.float().unflatten(-1, (self.heads, self.dim))
        half = (self.levels - 1) * (1 - 1e-3) / 2
        # An even number of levels lies half a level off; the shift has a latent of 0 stay at 0.
        offset = torch.where(self.levels % 2 == 0, 0.5, 0.0)
        bounded = torch.tanh(z + torch.atanh(offset / half)) * half - offset
        return bounded, bounded.round()

    def tokens(self, latent: Tensor) -> Tensor:
        """Codes ``[B, n, K]`` of latents ``[B, n, K*code_dim]``."""
        _, rounded = self._rounded(latent)
        place = rounded + self.levels.div(2, rounding_mode="floor")
        return (place * self.basis).sum(-1).long()

    def forward(self, latent: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Straight-through embeddings, tokens and a commitment loss of zero."""
        bounded, rounded = self._rounded(latent)
        through = (bounded + (rounded - bounded).detach()) / self.levels.div(2, rounding_mode="floor")
        return through.flatten(2), self.tokens(latent), through.new_zeros(())


def quantizer_of(config: ModelConfig) -> Quantizer:
    """The quantizer that a configuration names."""
    return FiniteScalarQuantizer(config) if config.fsq_levels else MultiHeadQuantizer(config)
