"""Paths to follow, made from captured roots: exact, smoothed at random, or through a few points of them (paper, section 3.3)."""

import math

import torch
from torch import Generator, Tensor

from troupe_training.models.unimogen.state import Path2D

# What of the windows' paths are the root's own, and what are smoothed; the rest run through points
# some frames apart.
EXACT, SMOOTHED = 0.3, 0.4
MAX_SIGMA = 8.0  # frames
MIN_KNOTS, MAX_KNOTS = 8, 24  # frames between points
# A given root lies on the path, which leaves it for its own way over as many frames.
EASE_FRAMES = 10.0


def unwrapped(heading: Tensor) -> Tensor:
    """Headings ``[..., T]`` without jumps of a full turn."""
    step = heading[..., 1:] - heading[..., :-1]
    step = torch.remainder(step + math.pi, 2 * math.pi) - math.pi
    return torch.cat([heading[..., :1], heading[..., :1] + step.cumsum(-1)], -1)


def smoothing(frames: int, sigma: float) -> Tensor:
    """A Gaussian filter over time as ``[T, T]``; ends are held."""
    t = torch.arange(frames, dtype=torch.float32)
    reach = 3 * math.ceil(sigma)
    source = torch.arange(-reach, frames + reach, dtype=torch.float32)
    weights = torch.exp(-0.5 * ((t[:, None] - source) / sigma) ** 2)
    weights = weights / weights.sum(1, keepdim=True)
    held = torch.zeros(frames, frames)
    held.index_add_(1, source.clamp(0, frames - 1).long(), weights)
    return held


def knots(frames: int, apart: int, first: int) -> Tensor:
    """Cubic interpolation (Catmull and Rom) through every ``apart``-th frame from ``first`` on and both ends, as ``[T, T]``."""
    at = sorted({0, frames - 1, *range(first % apart, frames, apart)})
    matrix = torch.zeros(frames, frames)
    for i in range(len(at) - 1):
        a, b = at[i], at[i + 1]
        before, after = at[max(i - 1, 0)], at[min(i + 2, len(at) - 1)]
        for f in range(a, b + 1):
            u, gap = (f - a) / (b - a), float(b - a)
            h00, h10 = 2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u
            h01, h11 = -2 * u**3 + 3 * u**2, u**3 - u**2
            row = torch.zeros(frames)
            row[a] += h00
            row[b] += h01
            slope_a, slope_b = gap / (b - before), gap / (after - a)
            row[b] += h10 * slope_a
            row[before] -= h10 * slope_a
            row[after] += h11 * slope_b
            row[a] -= h11 * slope_b
            matrix[f] = row
    return matrix


def wanted_paths(root: Tensor, heading: Tensor, given: Tensor, generator: Generator) -> Path2D:
    """Paths for windows of roots ``[B, T, 3]`` with headings ``[B, T]``; ``given`` ``[B, T]`` frames lie on them exactly."""
    batch, frames = heading.shape
    true = torch.cat([root[..., [0, 2]], unwrapped(heading)[..., None]], -1)
    filters = torch.eye(frames).repeat(batch, 1, 1)
    kinds = torch.rand(batch, generator=generator)
    for b in range(batch):
        draw = torch.rand(2, generator=generator).tolist()
        if EXACT <= kinds[b] < EXACT + SMOOTHED:
            filters[b] = smoothing(frames, 1.0 + draw[0] * (MAX_SIGMA - 1.0))
        elif kinds[b] >= EXACT + SMOOTHED:
            apart = MIN_KNOTS + int(draw[0] * (MAX_KNOTS - MIN_KNOTS + 1))
            filters[b] = knots(frames, apart, int(draw[1] * apart))
    smooth = filters @ true
    return through(smooth, true, given)


def through(smooth: Tensor, true: Tensor, given: Tensor) -> Path2D:
    """Bends paths ``[B, T, 3]`` (x, z, heading) so that they pass the true values in the given frames."""
    time = torch.arange(given.shape[1], dtype=torch.float32)
    distance = (time[:, None] - time).abs() + torch.where(given > 0, 0.0, 1e6)[:, None]  # [B, T, T]
    nearest, which = distance.min(-1)
    share = torch.where(nearest < EASE_FRAMES, 0.5 + 0.5 * torch.cos(math.pi * nearest / EASE_FRAMES), 0.0)
    gap = torch.gather(true - smooth, 1, which[..., None].expand(-1, -1, 3))
    path = smooth + share[..., None] * gap
    return Path2D(path[..., :2], path[..., 2])
