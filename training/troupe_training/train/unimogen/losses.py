"""The five losses of the paper (section 3.2) and one of standing feet, over the frames that are not given."""

from dataclasses import dataclass

import torch
from torch import Tensor

from troupe_training.data.conventions import FPS
from troupe_training.data.precision import full_precision
from troupe_training.models.unimogen.state import BodyKinematics

# A foot that creeps is slow in every frame; over several frames its way counts as much as a slip.
WAY_FRAMES = 6


@dataclass(frozen=True)
class Weights:
    """Of the losses; lengths are in body sizes, times in seconds, turns in radians."""

    clean: float = 1.0
    place: float = 2.0  # of the root's place within it
    angular_velocity: float = 0.005
    position: float = 10.0
    velocity: float = 0.05
    foot: float = 0.5  # speed of standing feet
    way: float = 100.0  # way of standing feet over `WAY_FRAMES`


def angular_velocity(bends: Tensor) -> Tensor:
    """Turn rates ``[B, T - 1, J, 3]``, radians a second, of bends ``[B, T, J, 3, 3]``: the sine's part of each step."""
    step = bends[:, :-1].transpose(-1, -2) @ bends[:, 1:]
    axis = torch.stack(
        [step[..., 2, 1] - step[..., 1, 2], step[..., 0, 2] - step[..., 2, 0], step[..., 1, 0] - step[..., 0, 1]], -1
    )
    return axis * (FPS / 2)


def mean_over(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of ``[B, T, ...]`` over the frames of ``mask`` ``[B, T]``."""
    per_frame = values.flatten(2).mean(-1)
    return (per_frame * mask).sum() / mask.sum().clamp_min(1.0)


@full_precision
def all_losses(
    kinematics: BodyKinematics,
    size_m: float,
    rows: tuple[Tensor, Tensor],
    motion: tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]],
    contacts: Tensor,
    feet: list[int],
    free: Tensor,
    weights: Weights,
) -> dict[str, Tensor]:
    """Terms to add up. ``rows``: predicted and true ``[B, J + 1, T, 6]``; ``motion``: root and bends of both.

    ``contacts`` ``[B, T, C]`` of the joints ``feet``; ``free`` ``[B, T]`` is 1 in the frames that are not given.
    """
    (root, bends), (true_root, true_bends) = motion
    error = (rows[0] - rows[1]) ** 2
    terms = {
        "clean": weights.clean * mean_over(error[:, 1:].transpose(1, 2), free),
        "place": weights.clean * weights.place * mean_over(error[:, 0, :, :3], free),
    }
    steps = torch.maximum(free[:, 1:], free[:, :-1])
    turns = angular_velocity(bends) - angular_velocity(true_bends)
    terms["angular_velocity"] = weights.angular_velocity * mean_over(turns**2, steps)
    made = kinematics.positions(root, kinematics.turned(bends)) / size_m
    with torch.no_grad():
        truth = kinematics.positions(true_root, kinematics.turned(true_bends)) / size_m
    terms["position"] = weights.position * mean_over((made - truth) ** 2, free)
    moves = (made[:, 1:] - made[:, :-1]) * FPS
    true_moves = (truth[:, 1:] - truth[:, :-1]) * FPS
    terms["velocity"] = weights.velocity * mean_over((moves - true_moves) ** 2, steps)
    if feet:
        stands = contacts[:, 1:] * contacts[:, :-1] * steps[..., None]
        slide = (moves[:, :, feet] ** 2).sum(-1)
        terms["foot"] = weights.foot * (slide * stands).sum() / stands.sum().clamp_min(1.0)
        terms["way"] = weights.way * way_loss(made[:, :, feet], contacts, free)
    return terms


def way_loss(feet: Tensor, contacts: Tensor, free: Tensor) -> Tensor:
    """Mean squared way of feet ``[B, T, C, 3]`` that stand through `WAY_FRAMES` free frames, from the first to the last of them.

    ``contacts`` ``[B, T, C]`` and ``free`` ``[B, T]`` are 0 or 1; a way is in the unit of ``feet``.
    """
    stands = (contacts * free[..., None]).unfold(1, WAY_FRAMES, 1).amin(-1)  # [B, T - 5, C]
    way = feet[:, WAY_FRAMES - 1 :] - feet[:, : 1 - WAY_FRAMES]
    return ((way**2).sum(-1) * stands).sum() / stands.sum().clamp_min(1.0)
