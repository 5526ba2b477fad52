"""Linear filters over the frames of a window, as matrices ``[T, T]``. Callers share them: do not change one."""

import math
from functools import lru_cache

import torch
from torch import Tensor

CACHED = 4096  # filters of 2 to 19 kB each


def unwrapped(heading: Tensor) -> Tensor:
    """Headings ``[..., T]`` without jumps of a full turn."""
    step = heading[..., 1:] - heading[..., :-1]
    step = torch.remainder(step + math.pi, 2 * math.pi) - math.pi
    return torch.cat([heading[..., :1], heading[..., :1] + step.cumsum(-1)], -1)


@lru_cache(CACHED)
def smoothing(frames: int, sigma: float) -> Tensor:
    """A Gaussian filter of ``sigma`` frames; both ends of the window are held."""
    t = torch.arange(frames, dtype=torch.float32)
    reach = 3 * math.ceil(sigma)
    source = torch.arange(-reach, frames + reach, dtype=torch.float32)
    weights = torch.exp(-0.5 * ((t[:, None] - source) / sigma) ** 2)
    weights = weights / weights.sum(1, keepdim=True)
    held = torch.zeros(frames, frames)
    held.index_add_(1, source.clamp(0, frames - 1).long(), weights)
    return held


@lru_cache(CACHED)
def curve(frames: int, at: tuple[int, ...]) -> Tensor:
    """Cubic interpolation (Catmull and Rom) through the frames ``at``, ascending, first and last frame among them."""
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


def knots(frames: int, apart: int, first: int) -> Tensor:
    """`curve` through every ``apart``-th frame from ``first`` on and both ends."""
    return curve(frames, tuple(sorted({0, frames - 1, *range(first % apart, frames, apart)})))
