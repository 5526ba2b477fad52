"""Which keyframes, constraints and tokens a training sample is given."""

import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS


def random_keyframe_mask(batch: int, frames: int, generator: Generator) -> Tensor:
    """``[B, T]`` of 0/1: which frames are given as pose keyframes.

    Two samples in three look like requests: the four context frames and a random subset of the last four. The others
    hold 0 to 10 keyframes anywhere (paper section 4.3).
    """
    mask = torch.zeros(batch, frames)
    as_served = torch.rand(batch, generator=generator) < 0.67
    mask[:, :CONTEXT_FRAMES] = 1.0
    kept = torch.rand(batch, MAX_TARGETS, generator=generator)
    subset = (kept < torch.rand(batch, 1, generator=generator)).float()
    only_one = torch.zeros(batch, MAX_TARGETS)
    only_one[torch.arange(batch), torch.randint(MAX_TARGETS, (batch,), generator=generator)] = 1.0
    one = torch.rand(batch, 1, generator=generator) < 0.5
    mask[:, -MAX_TARGETS:] = torch.where(one, only_one, subset)
    count = torch.randint(0, 11, (batch, 1), generator=generator)
    rank = torch.rand(batch, frames, generator=generator).argsort(-1).argsort(-1)
    anywhere = (rank < count).float()
    return torch.where(as_served[:, None], mask, anywhere)


def slot_frames(frames: int) -> list[int]:
    """Frame of each of the eight keyframe slots in a segment of T frames."""
    return list(range(CONTEXT_FRAMES)) + list(range(frames - MAX_TARGETS, frames))


def random_slot_masks(batch: int, generator: Generator) -> dict[str, Tensor]:
    """``[B, 8]`` masks of 0/1 for the root module: context roots always given, everything else a random subset."""
    masks = {}
    rank = torch.rand(batch, MAX_TARGETS, generator=generator).argsort(-1).argsort(-1)
    count = torch.randint(0, MAX_TARGETS + 1, (batch, 1), generator=generator)
    one = torch.rand(batch, 1, generator=generator) < 0.4
    target = (rank < torch.where(one, torch.ones_like(count), count)).float()
    for name, share, context_share in (("local_root", 0.4, 1.0), ("global_root", 0.85, 1.0), ("pose", 0.75, 0.95)):
        given = (torch.rand(batch, 1, generator=generator) < share).float()
        context = (torch.rand(batch, 1, generator=generator) < context_share).float()
        masks[name] = torch.cat([context.expand(-1, CONTEXT_FRAMES), target * given], 1)
    return masks


def cosine_token_mask(batch: int, slots: int, heads: int, generator: Generator) -> Tensor:
    """``[B, n, K]`` booleans, true for masked tokens: half of the samples entirely, the rest by a cosine schedule."""
    u = torch.rand(batch, 1, 1, generator=generator)
    share = torch.cos(u * torch.pi / 2)
    everything = torch.rand(batch, 1, 1, generator=generator) < 0.5
    return (torch.rand(batch, slots, heads, generator=generator) < share) | everything
