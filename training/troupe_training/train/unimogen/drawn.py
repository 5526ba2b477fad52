"""Paths as users draw them: a smooth curve through a few points, walked at even speed, mostly facing along it.

A captured root sways and changes its speed at every step, and a network that only saw such paths slides its feet on others.
"""

import math

import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import FPS
from troupe_training.data.rotations import wrap_angle
from troupe_training.train.unimogen.filters import curve, smoothing, unwrapped

SIGMA = 4.0  # frames by which the root is smoothed before points of it are taken
MAX_INNER_POINTS = 2  # besides both ends
POINT_GRID = 4  # frames; points on a grid leave few curves, so that each is computed once
# How far the root may be from the path, in body sizes: 25 cm of a person. Roots that stop or hurry
# are farther away, and keep a path in their own timing.
MAX_OFF = 0.27
ALONG = 0.7  # share of the paths that take their heading from the curve, of those that may
MIN_SPEED = 0.3  # body sizes a second; a slower path has no clear direction
MAX_ASIDE_RAD = math.radians(30)  # between heading and curve, on average over the window


def point_frames(frames: int, draw: Tensor) -> tuple[int, ...]:
    """Both ends and up to `MAX_INNER_POINTS` frames between them; ``draw`` ``[1 + MAX_INNER_POINTS]`` is uniform in 0..1."""
    inner = range(2 * POINT_GRID, frames - 2 * POINT_GRID + 1, POINT_GRID)
    count = min(int(draw[0] * (MAX_INNER_POINTS + 1)), len(inner))
    return tuple(sorted({0, frames - 1, *(inner[int(u * len(inner))] for u in draw[1 : 1 + count].tolist())}))


def at_even_speed(way: Tensor) -> Tensor:
    """Points ``[B, T, 2]`` of the same curves at equal distances along each."""
    frames = way.shape[1]
    length = torch.nn.functional.pad((way[:, 1:] - way[:, :-1]).norm(dim=-1).cumsum(1), (1, 0))
    wanted = length[:, -1:] * torch.linspace(0, 1, frames)
    after = torch.searchsorted(length, wanted).clamp(1, frames - 1)
    low, high = length.gather(1, after - 1), length.gather(1, after)
    share = ((wanted - low) / (high - low).clamp_min(1e-9)).clamp(0, 1)[..., None]
    pick = after[..., None].expand(-1, -1, 2)
    return torch.lerp(way.gather(1, pick - 1), way.gather(1, pick), share)


def direction(points: Tensor) -> Tensor:
    """Headings ``[B, T]`` along points ``[B, T, 2]``, without jumps of a full turn."""
    step = points[:, 2:] - points[:, :-2]
    step = torch.cat([points[:, 1:2] - points[:, :1], step, points[:, -1:] - points[:, -2:-1]], 1)
    return unwrapped(torch.atan2(step[..., 0], step[..., 1]))


def drawn_paths(true: Tensor, size_m: float, generator: Generator) -> tuple[Tensor, Tensor]:
    """A drawn path ``[B, T, 3]`` (x, z, heading) for each of the roots ``true`` ``[B, T, 3]``, and which fit ``[B]``.

    Headings are unwrapped. A path fits if the root stays near it in every frame, see `MAX_OFF`.
    """
    batch, frames = true.shape[:2]
    smooth = smoothing(frames, SIGMA) @ true
    draws = torch.rand(batch, 1 + MAX_INNER_POINTS, generator=generator)
    curves = torch.stack([curve(frames, point_frames(frames, draw)) for draw in draws])
    points = at_even_speed((curves @ smooth)[..., :2])
    speed = (points[:, 1:] - points[:, :-1]).norm(dim=-1).mean(1) * FPS
    along, facing = direction(points), smooth[..., 2]
    aside = wrap_angle(along - facing)
    full_turns = ((facing - along).mean(1, keepdim=True) / (2 * math.pi)).round() * (2 * math.pi)
    follows = (speed > MIN_SPEED * size_m) & (aside.abs().mean(1) < MAX_ASIDE_RAD)
    follows &= torch.rand(batch, generator=generator) < ALONG
    heading = torch.where(follows[:, None], along + full_turns, facing)
    off = (true[..., :2] - points).norm(dim=-1).amax(1)
    return torch.cat([points, heading[..., None]], -1), off <= MAX_OFF * size_m
