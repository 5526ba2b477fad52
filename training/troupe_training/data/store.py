"""From cached clips to training batches: segments in the segment frame.

A batch is a set of segments of one length T. The segment frame has its origin at the projected root of the last context
frame and heading 0 there; training then turns each segment by a random heading (see `HEADING_JITTER_RAD`).
"""

import json
import re
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import NotRequired, Protocol, TypedDict

import numpy as np
import torch
from torch import Generator, Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, LENGTH_STEP, MAX_FRAMES, MIN_FRAMES
from troupe_training.data.precision import full_precision
from troupe_training.data.roots import local_root_of
from troupe_training.data.rotations import wrap_angle, yaw_matrix
from troupe_training.data.skeleton import Skeleton

# The server turns every request so that its context heads along +Z. Most training samples therefore
# stay near heading 0; the rest are turned anywhere, as in the paper, so that a heading that is
# ill-defined does no harm.
HEADING_JITTER_RAD = 0.15
UNIFORM_HEADING_SHARE = 0.15
# A kind of motion with n possible segments is drawn in proportion to n to this power: 1 is by
# length, 0 is evenly.
BALANCE = 1.0
PIECE_FRAMES = 300
PIECES = 1000  # more than any clip has


class ClipEntry(TypedDict):
    """A clip in ``clips.json``: where it lies in the cache's arrays, in frames, and whether it is kept for testing."""

    name: str
    start: int
    frames: int
    test: bool
    file: NotRequired[str]  # these three where the clip is not a whole file as it was read
    first_frame: NotRequired[int]
    mirrored: NotRequired[bool]
    held_out: NotRequired[bool]  # of a held-out cell (`data/cells.py`): in no training


@dataclass
class Segments:
    """A batch of B segments of T frames, in the segment frame, metres."""

    positions: Tensor  # [B, T, J, 3], relative to the projected root
    six_d: Tensor  # [B, T, J, 6], world
    velocities: Tensor  # [B, T, J, 3], world, m/s
    contacts: Tensor  # [B, T, C], 0 or 1
    global_root: Tensor  # [B, T, 5]: x, y, z, cos, sin
    local_root: Tensor  # [B, T, 4]: vx, vz, angular velocity, height

    @property
    def pose(self) -> Tensor:
        """Pose features ``[B, T, J*9]``: position and 6D rotation, joint by joint."""
        return torch.cat([self.positions, self.six_d], -1).flatten(2)

    @property
    def frames(self) -> int:
        """T."""
        return self.positions.shape[1]


class SegmentSource(Protocol):
    """Where random segments come from: a `ClipStore`, or what stands in for one."""

    skeleton: Skeleton

    def lengths(self) -> list[int]:
        """Segment lengths, in frames, of which there are segments."""

    def batch(self, frames_budget: int, generator: Generator, frames: int | None = None) -> Segments:
        """A random batch of about ``frames_budget`` frames, all segments of one length, random where not given."""


def in_split(clip: ClipEntry, split: str) -> bool:
    """True for clips of ``train``, ``test``, or ``cell``: held-out cells, which may hold test clips and are in no training."""
    held_out = clip.get("held_out", False)
    if split == "cell":
        return held_out
    return clip["test"] if split == "test" else not clip["test"] and not held_out


def joined(clips: Sequence[ClipEntry]) -> list[ClipEntry]:
    """Clips with parts of one file that follow each other, in the file and in the cache, as one clip of the file's name."""
    out: list[ClipEntry] = []
    for clip in clips:
        before = out[-1] if out else None
        if (
            before is not None
            and "file" in clip
            and (before.get("file"), before.get("mirrored")) == (clip["file"], clip["mirrored"])
            and not clip["mirrored"]
            and before["start"] + before["frames"] == clip["start"]
            and before["first_frame"] + before["frames"] == clip["first_frame"]
        ):
            out[-1] = before | {"name": clip["file"], "frames": before["frames"] + clip["frames"]}
        else:
            out.append(clip)
    return out


def kind_of(name: str) -> str:
    """The kind of a clip: its file name without the take's number, ``walk_old_002.bvh`` to ``walk_old``.

    Parts of a take and its mirror image, ``walk_old_002_part1_M.bvh``, are of the same kind.
    """
    take = re.sub(r"(_part\d+)?(_M)?$", "", Path(name).with_suffix("").as_posix())
    return re.sub(r"[\W_]*\d*$", "", take)


class ClipStore:
    """The cache of `prepare`, in memory, with random access to segments.

    Random segments are balanced over kinds of motion (`kind_of`) with the power ``balance``, so that a style of two takes is
    seen more often than its share of the frames; 1 draws every segment with equal chance. ``lengths`` are those of segments,
    in frames.
    """

    def __init__(
        self,
        cache: Path,
        split: str,
        device: str = "cpu",
        balance: float = BALANCE,
        lengths: Sequence[int] = range(MIN_FRAMES, MAX_FRAMES + 1, LENGTH_STEP),
    ):
        self.skeleton = Skeleton.load(cache / "skeleton.json")
        self.index: list[ClipEntry] = json.loads((cache / "clips.json").read_text())["clips"]
        self.clips = [c for c in self.index if in_split(c, split)]
        self.device = device
        self.positions, self.six_d, self.headings, self.contacts = (
            torch.from_numpy(np.load(cache / f"{name}.npy")).to(device)
            for name in ("positions", "six_d", "headings", "contacts")
        )
        self.balance = balance
        self._tables = {frames: self._start_table(frames) for frames in lengths}

    def of_split(self, split: str) -> "ClipStore":
        """The clips of another split of the same cache, which share its arrays."""
        return self._of([c for c in self.index if in_split(c, split)])

    def part(self, wanted: Callable[[ClipEntry], bool]) -> "ClipStore":
        """Those of the clips that are ``wanted``, which share the arrays."""
        return self._of([c for c in self.clips if wanted(c)])

    def _of(self, clips: list[ClipEntry]) -> "ClipStore":
        other = copy(self)
        other.clips = clips
        other._tables = {frames: other._start_table(frames) for frames in self._tables}
        return other

    def uncut(self) -> "ClipStore":
        """The same frames with the parts of a file that `prepare` has cut joined again, as who reads the file sees them."""
        other = copy(self)
        other.clips = joined(self.clips)
        other._tables = {frames: other._start_table(frames) for frames in self._tables}
        return other

    def _start_table(self, frames: int) -> tuple[Tensor, Tensor]:
        """Every frame at which a segment of ``frames`` may start, and the running sum of their chances."""
        long_enough = [c for c in self.clips if c["frames"] >= frames]
        if not long_enough:
            return torch.empty(0, dtype=torch.long), torch.empty(0, dtype=torch.double)
        counts: dict[str, int] = {}
        for c in long_enough:
            kind = kind_of(c["name"])
            counts[kind] = counts.get(kind, 0) + c["frames"] - frames + 1
        ranges, chances = [], []
        for c in long_enough:
            ranges.append(torch.arange(c["start"], c["start"] + c["frames"] - frames + 1))
            chance = counts[kind_of(c["name"])] ** (self.balance - 1.0)
            chances.append(torch.full((len(ranges[-1]),), chance, dtype=torch.double))
        shares = torch.cat(chances).cumsum(0)
        return torch.cat(ranges), shares / shares[-1]

    def lengths(self) -> list[int]:
        """Segment lengths, in frames, of which this store has segments."""
        return [frames for frames, (starts, _) in self._tables.items() if len(starts)]

    def random_length(self, generator: Generator) -> int:
        """One of `lengths`, all with equal chance."""
        lengths = self.lengths()
        return lengths[int(torch.randint(len(lengths), (1,), generator=generator))]

    def sample(self, batch: int, frames: int, generator: Generator) -> Tensor:
        """Random start frames ``[batch]`` of segments of one of `lengths`."""
        starts, shares = self._tables[frames]
        place = torch.rand(batch, generator=generator, dtype=torch.double)
        return starts[torch.searchsorted(shares, place, right=True).clamp_max(len(starts) - 1)]

    @full_precision
    def segments(self, starts: Tensor, frames: int, turn: Tensor | None = None) -> Segments:
        """Cuts segments at ``starts`` ``[B]`` into the segment frame; ``turn`` ``[B]`` (radians) adds a heading to each."""
        index = (starts[:, None] + torch.arange(frames)[None]).to(self.device)
        world = self.positions[index]
        heading = self.headings[index]
        anchor = CONTEXT_FRAMES - 1
        yaw = -heading[:, anchor]
        if turn is not None:
            yaw = yaw + turn.to(self.device)
        rotation = yaw_matrix(yaw)
        on_ground = torch.tensor([1.0, 0.0, 1.0], device=self.device)
        origin = world[:, anchor : anchor + 1, :1] * on_ground
        world = torch.einsum("bij,btkj->btki", rotation, world - origin)
        six = self.six_d[index].unflatten(-1, (2, 3))
        six = torch.einsum("bij,btkcj->btkci", rotation, six).flatten(-2)
        psi = wrap_angle(heading + yaw[:, None])
        root = world[:, :, 0]
        global_root = torch.cat([root, torch.cos(psi)[..., None], torch.sin(psi)[..., None]], -1)
        velocity = (world[:, 1:] - world[:, :-1]) * FPS
        return Segments(
            positions=world - (root * on_ground)[:, :, None],
            six_d=six,
            velocities=torch.cat([velocity[:, :1], velocity], 1),
            contacts=self.contacts[index],
            global_root=global_root,
            local_root=local_root_of(global_root),
        )

    def batch(self, frames_budget: int, generator: Generator, frames: int | None = None) -> Segments:
        """A random training batch of about ``frames_budget`` frames, all segments of one length, random where not given."""
        frames = frames or self.random_length(generator)
        size = max(2, frames_budget // frames)
        turn = torch.randn(size, generator=generator) * HEADING_JITTER_RAD
        anywhere = torch.rand(size, generator=generator) < UNIFORM_HEADING_SHARE
        turn = torch.where(anywhere, (torch.rand(size, generator=generator) * 2 - 1) * torch.pi, turn)
        return self.segments(self.sample(size, frames, generator), frames, turn)

    def batch_of_any_length(self, frames_budget: int, generator: Generator) -> Segments:
        """A batch of about ``frames_budget`` frames at heading 0, all of one length from 12 to 64 frames, no multiple of 4."""
        longest = self.random_length(generator)
        spare = LENGTH_STEP if longest > MIN_FRAMES else 1
        frames = longest - int(torch.randint(spare, (1,), generator=generator))
        size = max(2, frames_budget // frames)
        return self.segments(self.sample(size, longest, generator), frames)

    def windows(self, frames: int, stride: int, most: int | None = None) -> tuple[Tensor, Tensor]:
        """Start frames ``[W]`` of windows, every ``stride`` frames of every clip that is long enough, and their pieces ``[W]``.

        A piece is a clip, or ten seconds of a longer one: `PIECES` times the clip's index and the piece's within it. Of more
        than ``most`` windows as many are kept, evenly over all.
        """
        starts: list[int] = []
        pieces: list[int] = []
        for index, clip in enumerate(self.clips):
            own = range(0, clip["frames"] - frames + 1, stride)
            starts += [clip["start"] + start for start in own]
            pieces += [index * PIECES + start // PIECE_FRAMES for start in own]
        kept = spread(len(starts), most)
        return torch.tensor(starts, dtype=torch.long)[kept], torch.tensor(pieces, dtype=torch.long)[kept]


def spread(count: int, most: int | None) -> Tensor:
    """Indices of at most ``most`` of ``count`` windows, evenly over all."""
    if most is None or most >= count:
        return torch.arange(count)
    return torch.arange(most) * count // most
