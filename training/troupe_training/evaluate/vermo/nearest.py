"""How near samples are to the training clips: a model that learnt them by heart is at distance 0 everywhere.

Windows of 32 frames are compared by four of them, joint by joint, in the frame of the first root.
The distance is the mean over joints and frames to the nearest window of the train split.
"""

import torch
from torch import Tensor

from troupe_training.evaluate.vermo.answers import Clip, markdown
from troupe_training.models.vermo.frames import seen_from_first
from troupe_training.train.vermo.corpus import Motions

WINDOW = 32
PICKED = (0, 10, 21, 31)  # frames of a window that are compared
STRIDE = 4  # frames between windows of the train split
CHUNK = 16384
CANDIDATES = 4  # of each chunk


def windows_of(clip: Clip, stride: int) -> Tensor:
    """Joints ``[W, 4, J, 3]`` of a motion's windows, each in the frame of its first root."""
    starts = range(0, len(clip.pose) - WINDOW + 1, stride)
    return torch.stack([clip.part(start, start + WINDOW).joints[list(PICKED)] for start in starts])


def training_windows(motions: Motions) -> Tensor:
    """Windows ``[W, 4, J, 3]`` of all training clips."""
    found = []
    for clip in motions.clips:
        if clip["frames"] < WINDOW:
            continue
        starts = torch.arange(clip["start"], clip["start"] + clip["frames"] - WINDOW + 1, STRIDE)
        some = motions.store.segments(starts, WINDOW)
        found.append(seen_from_first(some.pose, some.global_root)[:, list(PICKED)])
    return torch.cat(found)


def nearest(windows: Tensor, training: Tensor) -> Tensor:
    """Mean joint distance ``[W]``, metres, of each window to the nearest of the training's.

    The nearest by the sum of squares are found first, by products of matrices; of these few the mean distance decides.
    """
    best = torch.full((len(windows),), float("inf"))
    for chunk in training.split(CHUNK):
        squared = torch.cdist(windows.flatten(1), chunk.flatten(1), compute_mode="use_mm_for_euclid_dist")
        found = squared.topk(min(CANDIDATES, len(chunk)), largest=False).indices
        exact = (chunk[found] - windows[:, None]).norm(dim=-1).mean((2, 3)).amin(1)
        best = torch.minimum(best, exact)
    return best


def nearest_table(figures: dict[str, dict[str, float]]) -> str:
    """Rows by split and source."""
    header = ["distance to the nearest training window (mm)", "mean", "median", "nearest tenth"]
    rows = [[name, *(f"{1e3 * f[key]:.0f}" for key in ("mean", "median", "tenth"))] for name, f in figures.items()]
    return markdown(header, rows)
