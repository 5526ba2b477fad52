"""The judge of texts and motions: what a motion shows, and how near a text and a motion are. It is used to measure alone.

A motion's encoder reads content and style off it, and shares a space with an encoder of captions, as TMR's does (Petrovich et
al. 2023). The judge never sees tokens.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.models.layers import Standardiser, stack_frames
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.frames import features
from troupe_training.models.vermo.tokenizer import WideBlock


@dataclass(frozen=True)
class JudgeConfig:
    """Sizes of the judge, and the names that it tells apart."""

    contents: tuple[str, ...]
    styles: tuple[str, ...]
    pieces: int
    width: int = 160
    blocks: int = 3
    space: int = 128


class Judge(nn.Module):
    """Motions and captions to unit vectors of one space, and motions to contents and styles."""

    def __init__(self, config: JudgeConfig, joints: int):
        super().__init__()
        self.config = config
        width = config.width
        self.scale = Standardiser(9 * joints + 4)
        self.enter = nn.Linear(RATE * (9 * joints + 4), width)
        self.blocks = nn.ModuleList(WideBlock(width) for _ in range(config.blocks))
        self.pool = nn.Linear(3 * width, width)
        self.content = nn.Linear(width, len(config.contents))
        self.style = nn.Linear(width, len(config.styles))
        self.motion = nn.Linear(width, config.space)
        self.words = nn.Embedding(config.pieces + 1, width, padding_idx=config.pieces)
        self.pairs = nn.Linear(2 * width, width)
        self.caption = nn.Sequential(nn.Linear(2 * width, width), nn.GELU(), nn.Linear(width, config.space))
        self.sharpness = nn.Parameter(torch.tensor(2.5))

    def read(self, pose: Tensor, root: Tensor, tokens: Tensor) -> Tensor:
        """Hidden ``[B, width]`` of motions ``[B, F, 9 J]`` and ``[B, F, 5]`` of which 4 ``tokens`` ``[B]`` frames are real."""
        x = stack_frames(self.scale(features(pose, root)), RATE)
        real = (torch.arange(x.shape[1], device=x.device)[None] < tokens[:, None])[..., None]
        x = self.enter(x) * real
        for block in self.blocks:
            x = block(x) * real
        count = real.sum(1).clamp_min(1)
        mean = x.sum(1) / count
        deviation = (((x - mean[:, None]) * real).square().sum(1) / count + 1e-5).sqrt()
        most = x.masked_fill(~real, -1e4).amax(1)
        return F.gelu(self.pool(torch.cat([mean, deviation, most], -1)))

    def motions(self, hidden: Tensor) -> Tensor:
        """Unit vectors ``[B, space]`` of the output of `read`."""
        return F.normalize(self.motion(hidden), dim=-1)

    def captions(self, pieces: list[list[int]]) -> Tensor:
        """Unit vectors ``[B, space]`` of captions' pieces."""
        longest = max(map(len, pieces)) + 1
        pad = self.config.pieces
        ids = torch.tensor([row + [pad] * (longest - len(row)) for row in pieces], device=self.sharpness.device)
        real = (ids != pad)[..., None]
        x = self.words(ids)
        pair = F.gelu(self.pairs(torch.cat([x[:, :-1], x[:, 1:]], -1))) * real[:, :-1]
        count = real.sum(1).clamp_min(1)
        return F.normalize(self.caption(torch.cat([x.sum(1) / count, pair.sum(1) / count], -1)), dim=-1)
