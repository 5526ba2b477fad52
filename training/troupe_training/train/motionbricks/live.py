"""Training samples under the conditions of live control, for the refinement of the decoder.

A character under live control is planned a second ahead, again and again: four context frames, one target whose pose comes from
a gait cycle and whose root comes from the commanded speed, a keyframe or two of the cycle in between, and a smooth
heading. So the keyframes lie a few frames off the phase that the context would reach, and the path is longer or
shorter than the cycle's own. The feet should stand all the same.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, MAX_TARGETS
from troupe_training.data.precision import full_precision
from troupe_training.data.roots import local_root_of
from troupe_training.data.store import ClipStore, Segments
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, SLOTS
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.train.motionbricks.root import run_root

TOKENS = (7, 11)  # shortest and longest, inclusive; a plan of about one second
SPEED_FACTORS = (0.75, 1.15)  # of the path to the true one, where it differs
SPEED_RAMP_FRAMES = 6
PHASE_ERROR_FRAMES = 2
HEADING_WINDOW_FRAMES = 9


@dataclass
class LiveConditions:
    """A batch as live control poses it. ``exact`` marks the keyframes that are given as they truly are."""

    segments: Segments
    keyframes: Tensor  # [B, T, J*9], valid where mask is 1
    mask: Tensor  # [B, T]
    exact: Tensor  # [B, T]
    trajectory: Tensor  # [B, T, 5]


@full_precision
def change_speed(segments: Segments, factor: Tensor, feet: list[int]) -> Segments:
    """The same poses along a path that is ``factor`` ``[B]`` times as fast from shortly after the context on.

    Joint velocities follow the root, except those of feet that stand, which are to stay in place.
    """
    frames = segments.frames
    steps = (torch.arange(frames, device=factor.device) - (CONTEXT_FRAMES - 1)).clamp(0, SPEED_RAMP_FRAMES)
    gain = 1.0 + (factor[:, None] - 1.0) * (steps / SPEED_RAMP_FRAMES)
    root = segments.global_root
    moved = (root[:, 1:, [0, 2]] - root[:, :-1, [0, 2]]) * (gain[:, 1:, None] - 1.0)
    moved = F.pad(moved, (0, 0, 1, 0))
    shift = moved.cumsum(1)
    still = torch.zeros_like(shift[..., :1])
    global_root = root + torch.cat([shift[..., :1], still, shift[..., 1:], still, still], -1)
    extra = torch.cat([moved[..., :1], still, moved[..., 1:]], -1)[:, :, None] * FPS
    extra = extra.expand_as(segments.velocities).clone()
    extra[:, :, feet] = extra[:, :, feet] * (1.0 - segments.contacts[..., None])
    return replace(
        segments, global_root=global_root, local_root=local_root_of(global_root), velocities=segments.velocities + extra
    )


def smooth_heading(root: Tensor, window: int) -> Tensor:
    """Global roots ``[B, T, 5]`` with cosine and sine averaged over ``window`` frames, context frames as they are."""
    turn = F.pad(root[..., 3:].transpose(1, 2), (window // 2, window // 2), mode="replicate")
    turn = F.normalize(F.avg_pool1d(turn, window, 1).transpose(1, 2), dim=-1)
    turn = torch.cat([root[:, :CONTEXT_FRAMES, 3:], turn[:, CONTEXT_FRAMES:]], 1)
    return torch.cat([root[..., :3], turn], -1)


def keyframe_masks(batch: int, frames: int, generator: Generator) -> tuple[Tensor, Tensor]:
    """``[B, T]`` of 0/1 with context, target and none, one or two keyframes between, and the target's slot ``[B]``."""
    rows = torch.arange(batch)
    mask = torch.zeros(batch, frames)
    mask[:, :CONTEXT_FRAMES] = 1.0
    slot = torch.randint(MAX_TARGETS, (batch,), generator=generator)
    mask[rows, frames - MAX_TARGETS + slot] = 1.0
    between = torch.randint(3, (batch,), generator=generator)
    gap = frames - CONTEXT_FRAMES
    for number, place in ((1, 1 / 2), (2, 1 / 3), (2, 2 / 3)):
        jitter = torch.randint(-2, 3, (batch,), generator=generator)
        frame = CONTEXT_FRAMES + math.floor(place * gap) + jitter
        chosen = between == number
        mask[rows[chosen], frame[chosen]] = 1.0
    return mask, slot


def live_conditions(store: ClipStore, frames_budget: int, root: RootModule, generator: Generator) -> LiveConditions:
    """A random batch; half of each deviation's samples are left as they are."""
    tokens = int(torch.randint(TOKENS[0], TOKENS[1] + 1, (1,), generator=generator))
    segments = store.batch(frames_budget, generator, tokens * FRAMES_PER_TOKEN)
    batch, frames = segments.pose.shape[:2]

    def half() -> Tensor:
        return torch.rand(batch, generator=generator) < 0.5

    low, high = SPEED_FACTORS
    factor = low + (high - low) * torch.rand(batch, generator=generator)
    factor = torch.where(half(), factor, torch.ones(batch))
    segments = change_speed(segments, factor.to(store.device), store.skeleton.contact_joints)

    mask, slot = keyframe_masks(batch, frames, generator)
    masks = {name: torch.zeros(batch, SLOTS) for name in ("local_root", "global_root", "pose")}
    for given in masks.values():
        given[:, :CONTEXT_FRAMES] = 1.0
        given[torch.arange(batch), CONTEXT_FRAMES + slot] = 1.0
    with torch.no_grad():
        trajectory = run_root(root, segments, masks, torch.ones(batch))[1]
    smooth = smooth_heading(segments.global_root, HEADING_WINDOW_FRAMES)
    heading = torch.where(half().to(store.device)[:, None, None], smooth, segments.global_root)
    trajectory = torch.cat([trajectory[..., :3], heading[..., 3:]], -1)

    error = torch.randint(-PHASE_ERROR_FRAMES, PHASE_ERROR_FRAMES + 1, (batch, frames), generator=generator)
    error = error * half()[:, None]
    error[:, :CONTEXT_FRAMES] = 0
    source = (torch.arange(frames) + error).clamp(0, frames - 1)
    keyframes = segments.pose[torch.arange(batch)[:, None], source.to(store.device)]
    exact = mask * (source == torch.arange(frames))
    return LiveConditions(segments, keyframes, mask.to(store.device), exact.to(store.device), trajectory)
