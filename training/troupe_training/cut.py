"""Training batches of any length from 12 to 64 frames, for networks that do not work in tokens."""

import torch

from troupe_training.config import FRAMES_PER_TOKEN, MIN_TOKENS
from troupe_training.features import ClipStore, Segments

PIECE_FRAMES = 300
PIECES = 1000  # more than any clip has


def any_length(store: ClipStore, frames_budget: int, generator: torch.Generator) -> Segments:
    """A batch of about ``frames_budget`` frames in the segment frame, all of one random length, heading 0."""
    lengths = store.lengths()
    tokens = lengths[int(torch.randint(len(lengths), (1,), generator=generator))]
    spare = FRAMES_PER_TOKEN if tokens > MIN_TOKENS else 1
    frames = tokens * FRAMES_PER_TOKEN - int(torch.randint(spare, (1,), generator=generator))
    size = max(2, frames_budget // frames)
    return store.segments(store.sample(size, tokens, generator), frames)


def windows(store: ClipStore, frames: int, stride: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Start frames ``[W]`` of windows, every ``stride`` frames of every clip that is long enough, and their pieces.

    A piece is a clip, or ten seconds of a longer one: ``PIECES`` times the clip's index and the piece's within it.
    """
    starts, pieces = [], []
    for index, clip in enumerate(store.clips):
        own = range(0, clip["frames"] - frames + 1, stride)
        starts += [clip["start"] + start for start in own]
        pieces += [index * PIECES + start // PIECE_FRAMES for start in own]
    return torch.tensor(starts, dtype=torch.long), torch.tensor(pieces, dtype=torch.long)


def spread(count: int, most: int | None) -> torch.Tensor:
    """Indices of at most ``most`` of ``count`` windows, evenly over all."""
    if most is None or most >= count:
        return torch.arange(count)
    return torch.arange(most) * count // most
