"""The nearest training window as an answer: the baseline that tells a network from a memory of its training clips.

A window's given frames (context and target, roots and poses) are joint positions in the segment frame. Of all training
windows of the same length, `STRIDE` frames apart, the one whose given frames lie nearest is found exactly. Its frames are then
blended so that they meet the given ones.
"""

from collections.abc import Iterator

import torch
from torch import Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.interpolation import interpolate
from troupe_training.data.motion import Motion, local_rotations, world_rotations
from troupe_training.data.rotations import yaw_matrix
from troupe_training.data.store import ClipStore, Segments
from troupe_training.evaluate.bench import Sampling

NEAREST = "nearest training window"
STRIDE = 2  # frames between training windows
CHUNK = 8192  # training windows in memory at a time
CANDIDATES = 4  # of a chunk, beyond those asked for: products of matrices rank the nearest to within rounding


def given_frames(frames: int) -> list[int]:
    """The frames of a window that a request gives: four of context and the target."""
    return [*range(CONTEXT_FRAMES), frames - 1]


def blend(found: Motion, given: Motion, frames: int, parents: list[int]) -> Motion:
    """``found`` moved so that it meets context and target of ``given``.

    What a window has beyond the interpolation of its own keyframes is added to the interpolation of the given ones. So the
    answer meets them exactly, and what is lacking is spread over the gap as the interpolation baseline spreads it.
    """
    own, wanted = (interpolate(motion, frames, parents) for motion in (found, given))
    own_local, wanted_local, local = (local_rotations(m.rotations, parents) for m in (own, wanted, found))
    beyond = own_local.transpose(-1, -2) @ local
    return Motion(
        wanted.root + (found.root - own.root), world_rotations(wanted_local @ beyond, parents), found.contacts
    )


class NearestWindows:
    """Windows of a store of training clips by their given frames; an evaluation's method. Mirrored clips count if it has any."""

    def __init__(self, store: ClipStore):
        self.store = store

    def positions_of(self, starts: Tensor, frames: int) -> Tensor:
        """Joint positions ``[W, 5*J*3]`` of the given frames of windows at ``starts`` ``[W]``, in the segment frame."""
        index = starts[:, None] + torch.tensor(given_frames(frames))
        world = self.store.positions[index]
        anchor = CONTEXT_FRAMES - 1
        origin = world[:, anchor : anchor + 1, :1] * torch.tensor([1.0, 0.0, 1.0])
        turn = yaw_matrix(-self.store.headings[starts + anchor])
        return torch.einsum("bij,btkj->btki", turn, world - origin).flatten(1)

    def chunks(self, frames: int) -> Iterator[tuple[Tensor, Tensor]]:
        """Starts and positions of all windows, `CHUNK` at a time."""
        starts, _ = self.store.windows(frames, STRIDE)
        if not len(starts):
            raise SystemExit(f"no training clip has {frames} frames: there is no {NEAREST}")
        for chunk in starts.split(CHUNK):
            yield chunk, self.positions_of(chunk, frames)

    def find(self, segments: Segments, frames: int, count: int = 1) -> tuple[Tensor, Tensor]:
        """Starts ``[B, count]`` of the nearest windows, nearest first, and root mean square joint distances in metres."""
        root = segments.global_root[..., :3] * torch.tensor([1.0, 0.0, 1.0])
        wanted = (segments.positions + root[:, :, None])[:, given_frames(frames)].flatten(1)
        centre = wanted.mean(0)
        best = torch.full((len(wanted), count), torch.inf)
        found = torch.zeros(len(wanted), count, dtype=torch.long)
        for starts, positions in self.chunks(frames):
            a, b = wanted - centre, positions - centre
            rough = (b * b).sum(1) - 2.0 * a @ b.T
            few = rough.topk(min(count + CANDIDATES, len(starts)), largest=False).indices
            exact = (positions[few] - wanted[:, None]).square().sum(-1)
            both, which = torch.cat([best, exact], 1).topk(count, largest=False)
            found = torch.cat([found, starts[few]], 1).gather(1, which)
            best = both
        joints = wanted.shape[1] / 3
        return found, (best / joints).sqrt()

    def answers(self, segments: Segments, frames: int, starts: Tensor) -> Motion:
        """The windows at ``starts`` ``[B]``, blended into the given frames of ``segments``."""
        found = Motion.of(self.store.segments(starts, frames))
        return blend(found, Motion.of(segments), frames, self.store.skeleton.parents)

    def __call__(self, segments: Segments, frames: int, sampling: Sampling) -> Motion:
        """The nearest window's answer; there is no choice to sample."""
        return self.answers(segments, frames, self.find(segments, frames)[0][:, 0])
