"""Paths to follow, made from captured roots: exact, smoothed at random, or through a few points of them (paper, section 3.3).

More than half of the windows get a path as users draw one instead, see `drawn.py`, with the root's own sway on it: a server
lays the sway of a walk on drawn paths (docs/unimogen-pack.md).
"""

import math

import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.precision import full_precision
from troupe_training.models.unimogen.state import Path2D
from troupe_training.train.unimogen.drawn import drawn_paths
from troupe_training.train.unimogen.filters import knots, smoothing, unwrapped

# Shares of the paths that are not drawn: the root's own, and smoothed ones. The rest run through
# points some frames apart.
EXACT, SMOOTHED = 0.3, 0.4
SIGMAS = tuple(1.0 + 0.25 * i for i in range(29))  # frames, 1 to 8; few enough to cache each filter
MIN_KNOTS, MAX_KNOTS = 8, 24  # frames between points
DRAWN = 0.6  # share of the windows that get a drawn path if one fits
SWAY_SIGMA = 12.0  # frames by which a root is smoothed; what that takes away is its sway
# Share of the drawn paths that ignore the past frames. In a motion of several windows the past ends
# a little off the path.
IGNORES_PAST = 0.5
# A given root lies on the path, which leaves it for its own way over as many frames.
EASE_FRAMES = 10.0


def captured_paths(true: Tensor, generator: Generator) -> Tensor:
    """Paths ``[B, T, 3]`` in the timing of the captured root: itself, smoothed, or through some of its points."""
    batch, frames = true.shape[:2]
    filters = torch.eye(frames).repeat(batch, 1, 1)
    kinds = torch.rand(batch, generator=generator)
    for b in range(batch):
        draw = torch.rand(2, generator=generator).tolist()
        if EXACT <= kinds[b] < EXACT + SMOOTHED:
            filters[b] = smoothing(frames, SIGMAS[int(draw[0] * len(SIGMAS))])
        elif kinds[b] >= EXACT + SMOOTHED:
            apart = MIN_KNOTS + int(draw[0] * (MAX_KNOTS - MIN_KNOTS + 1))
            filters[b] = knots(frames, apart, int(draw[1] * apart))
    return filters @ true


@full_precision
def wanted_paths(root: Tensor, heading: Tensor, given: Tensor, size_m: float, generator: Generator) -> Path2D:
    """Paths for windows of roots ``[B, T, 3]`` with headings ``[B, T]``, of a body of ``size_m`` metres.

    They pass the ``given`` ``[B, T]`` frames exactly. Half of the drawn ones pass only the given frames at the end.
    """
    batch = len(root)
    true = torch.cat([root[..., [0, 2]], unwrapped(heading)[..., None]], -1)
    path = captured_paths(true, generator)
    drawn, fits = drawn_paths(true, size_m, generator)
    draws = torch.rand(2, batch, generator=generator)
    is_drawn = fits & (draws[0] < DRAWN)
    sway = true - smoothing(true.shape[1], SWAY_SIGMA) @ true
    path = torch.where(is_drawn[:, None, None], drawn + sway, path)
    passed = given.clone()
    passed[is_drawn & (draws[1] < IGNORES_PAST), :CONTEXT_FRAMES] = 0.0
    return through(path, true, passed)


def through(smooth: Tensor, true: Tensor, given: Tensor) -> Path2D:
    """Bends paths ``[B, T, 3]`` (x, z, heading) so that they pass the true values in the given frames."""
    time = torch.arange(given.shape[1], dtype=torch.float32)
    distance = (time[:, None] - time).abs() + torch.where(given > 0, 0.0, 1e6)[:, None]  # [B, T, T]
    nearest, which = distance.min(-1)
    share = torch.where(nearest < EASE_FRAMES, 0.5 + 0.5 * torch.cos(math.pi * nearest / EASE_FRAMES), 0.0)
    gap = torch.gather(true - smooth, 1, which[..., None].expand(-1, -1, 3))
    path = smooth + share[..., None] * gap
    return Path2D(path[..., :2], path[..., 2])
