"""The motion autoencoder in whose latent space FID and MMD are measured.

TMR's autoencoder (Petrovich et al. 2023) without the text: an ACTOR-like transformer VAE, whose encoder reads frames behind
two tokens, one for the mean and one for the deviation. The latent is the mean, shifted and scaled so that those of the
train split have mean 0 and length one in the root mean square.
"""

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import FPS, MAX_FRAMES
from troupe_training.data.precision import full_precision
from troupe_training.data.store import Segments
from troupe_training.models.layers import Standardiser, sinusoids

LATENT = 256
DIM = 192
LAYERS = 4
DECODER_LAYERS = 3  # not exported
HEAD_DIM = 32
FEEDFORWARD = 2
INPUTS = ("root", "positions", "six_d")


class Norm(nn.Module):
    """Layer normalisation in plain operators."""

    def __init__(self) -> None:
        super().__init__()
        self.gain, self.shift = nn.Parameter(torch.ones(DIM)), nn.Parameter(torch.zeros(DIM))

    def forward(self, x: Tensor) -> Tensor:
        """``[..., DIM]`` to the same."""
        x = x - x.sum(-1, keepdim=True) / DIM
        return x / torch.sqrt((x * x).sum(-1, keepdim=True) / DIM + 1e-5) * self.gain + self.shift


class Layer(nn.Module):
    """Pre-norm self-attention and feed-forward, in plain operators."""

    def __init__(self) -> None:
        super().__init__()
        self.norm1, self.norm2 = Norm(), Norm()
        self.query, self.key, self.value, self.out = (nn.Linear(DIM, DIM) for _ in range(4))
        self.up, self.down = nn.Linear(DIM, FEEDFORWARD * DIM), nn.Linear(FEEDFORWARD * DIM, DIM)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, N, DIM]`` to the same."""
        y = self.norm1(x)
        q, k, v = (
            part(y).unflatten(-1, (DIM // HEAD_DIM, HEAD_DIM)).transpose(1, 2)
            for part in (self.query, self.key, self.value)
        )
        scores = torch.softmax(q @ k.transpose(-1, -2) * HEAD_DIM**-0.5, -1)
        x = x + self.out((scores @ v).transpose(1, 2).flatten(2))
        y = self.up(self.norm2(x))
        return x + self.down(y * torch.sigmoid(y))


class Evaluator(nn.Module):
    """The autoencoder. Frames go in as root ``[B, T, 5]``, positions ``[B, T, J, 3]`` and six_d ``[B, T, J, 6]``."""

    place: Tensor
    centre: Tensor
    spread: Tensor

    def __init__(self, joints: int):
        super().__init__()
        self.joints = joints
        self.widths = {"root": 5, "positions": joints * 3, "six_d": joints * 6, "velocities": joints * 3}
        self.scales = nn.ModuleDict({name: Standardiser(width) for name, width in self.widths.items()})
        total = sum(self.widths.values())
        self.enter = nn.Linear(total, DIM)
        self.tokens = nn.Parameter(torch.randn(2, DIM) * 0.02)
        self.register_buffer("place", sinusoids(MAX_FRAMES + 2, DIM))
        self.encoder = nn.Sequential(*(Layer() for _ in range(LAYERS)), Norm())
        self.mean, self.deviation = nn.Linear(DIM, LATENT), nn.Linear(DIM, LATENT)
        self.open = nn.Linear(LATENT, DIM)
        self.decoder = nn.Sequential(*(Layer() for _ in range(DECODER_LAYERS)), Norm())
        self.leave = nn.Linear(DIM, total)
        # Of the means over the train split; measured when training is done.
        self.register_buffer("centre", torch.zeros(LATENT))
        self.register_buffer("spread", torch.ones(()))

    @full_precision
    def features(self, root: Tensor, positions: Tensor, six_d: Tensor) -> Tensor:
        """Standardised features ``[B, T, D]``, joint velocities in the segment frame among them."""
        ground = torch.cat([root[..., 0:1], root[..., 1:2] * 0.0, root[..., 2:3]], -1)
        world = positions + ground[:, :, None]
        step = (world[:, 1:] - world[:, :-1]) * FPS
        velocities = torch.cat([step[:, :1], step], 1)
        values = {"root": root, "positions": positions, "six_d": six_d, "velocities": velocities}
        flat = {n: v if v.dim() == 3 else v.reshape(v.shape[0], -1, self.widths[n]) for n, v in values.items()}
        return torch.cat([scale(flat[name]) for name, scale in self.scales.items()], -1)

    def scale(self, name: str) -> Standardiser:
        """The standardiser of one of `widths`."""
        scale = self.scales[name]
        assert isinstance(scale, Standardiser)
        return scale

    def split(self, features: Tensor) -> dict[str, Tensor]:
        """Features ``[..., D]`` by the names of `widths`."""
        return dict(zip(self.widths, features.split(list(self.widths.values()), -1), strict=True))

    def encode(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the variance ``[B, 256]``."""
        x = self.enter(features)
        tokens = self.tokens[None] + x[:, :1] * 0.0
        x = torch.cat([tokens, x], 1)
        x = self.encoder(x + self.place[: x.shape[1]])
        return self.mean(x[:, 0]), self.deviation(x[:, 1])

    def decode(self, latent: Tensor, frames: int) -> Tensor:
        """Features ``[B, T, D]``. The latent is the only memory, so adding it to every query is what attention would do."""
        x = self.open(latent)[:, None] + self.place[:frames]
        return self.leave(self.decoder(x))

    def forward(self, root: Tensor, positions: Tensor, six_d: Tensor) -> Tensor:
        """Latents ``[B, 256]``."""
        mean, _ = self.encode(self.features(root, positions, six_d))
        return (mean - self.centre) / self.spread


def inputs_of(segments: Segments) -> dict[str, Tensor]:
    """The evaluator's inputs for captured segments."""
    return {"root": segments.global_root, "positions": segments.positions, "six_d": segments.six_d}
