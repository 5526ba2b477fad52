"""Random windows of a corpus (`data/corpus.py`), balanced over what they show."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Generator, Tensor

from troupe_training.data.bodies import STEP, Body, is_symmetric, mirror_pairs
from troupe_training.data.cells import cell_of, mirrored_cell
from troupe_training.data.conventions import FPS
from troupe_training.data.corpus import CorpusClip
from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix, wrap_angle

# Clips that show the same are drawn by their length to this power, and bodies by that of all their
# clips. Bodies of half a minute would hardly be seen at 0.5.
BALANCE, BODY_BALANCE = 0.5, 0.4
# Speeds of the root that part windows into classes, body sizes a second. A class is drawn by its
# share to this power, because fast walks are rare.
SPEED_EDGES = (0.25, 0.6, 0.9, 1.2, 1.5, 1.8, 2.3, 3.0)
SPEED_BALANCE = 0.5
# Half of the windows that walk are stretched in time by up to a fifth: walks at more speeds.
STRETCH, STRETCH_SHARE = 1.2, 0.5
WALKING = (0.25, 2.3)  # body sizes a second


@dataclass
class Windows:
    """B windows of T frames of one body, as they were captured."""

    root: Tensor  # [B, T, 3], metres, world
    heading: Tensor  # [B, T], radians
    bends: Tensor  # [B, T, J, 6], columns of L
    contacts: Tensor  # [B, T, C]
    words: Tensor  # [B, K] of 0/1

    def mirrored(self, pairs: list[int], contact_pairs: list[int], word_pairs: Tensor, which: Tensor) -> "Windows":
        """Those of ``which`` ``[B]`` as seen in a mirror: x changes its sign, left and right change places."""
        sign = torch.tensor([1.0, -1.0, -1.0, -1.0, 1.0, 1.0])
        flip = which[:, None, None]
        return Windows(
            torch.where(flip, self.root * torch.tensor([-1.0, 1.0, 1.0]), self.root),
            torch.where(which[:, None], -self.heading, self.heading),
            torch.where(flip[..., None], self.bends[:, :, pairs] * sign, self.bends),
            torch.where(flip, self.contacts[:, :, contact_pairs], self.contacts),
            torch.where(which[:, None], self.words[:, word_pairs], self.words),
        )


class BodyStore:
    """The clips of one body of a split. ``words`` are all that any clip shows, in the order of the style vector."""

    def __init__(
        self,
        folder: Path,
        split: str,
        words: list[str],
        balance: float = BALANCE,
        mirror: bool = False,
        speed_balance: float = SPEED_BALANCE,
    ):
        self.body = Body.load(folder / "body.json")
        listing = json.loads((folder / "clips.json").read_text())
        clips: list[CorpusClip] = listing["clips"]
        self.clips = [c for c in clips if c["split"] == split]
        self.cells = frozenset(listing["options"]["cells"])
        self.bends, self.roots, self.headings, self.contacts = (
            np.load(folder / f"{name}.npy", mmap_mode="r") for name in ("bends", "roots", "headings", "contacts")
        )
        self.words, self.balance, self.speed_balance = words, balance, speed_balance
        places = {word: i for i, word in enumerate(words)}
        self.clip_words = torch.zeros(len(self.clips), len(words))
        for i, clip in enumerate(self.clips):
            self.clip_words[i, [places[word] for word in clip["words"] if word in places]] = 1.0
        swapped = [mirrored_cell(f"{word}_")[:-1] for word in words]
        self.word_pairs = torch.tensor([places.get(other, i) for i, other in enumerate(swapped)])
        self.mirror = mirror and is_symmetric(self.body)
        self.mirrorable = torch.tensor([self._may_mirror(clip, places) for clip in self.clips])
        self.pairs = mirror_pairs(self.body)
        feet = self.body.skeleton.contact_joints
        self.contact_pairs = [feet.index(self.pairs[j]) if self.pairs[j] in feet else i for i, j in enumerate(feet)]
        self._tables: dict[int, tuple[Tensor, Tensor, Tensor]] = {}

    def _may_mirror(self, clip: CorpusClip, places: dict[str, int]) -> bool:
        """False if the mirror image shows a held-out cell, or what no clip shows."""
        cell = cell_of(clip["name"])
        other = [mirrored_cell(f"{word}_")[:-1] for word in clip["words"]]
        return all(word in places for word in other) and (cell is None or mirrored_cell(cell) not in self.cells)

    @property
    def frames(self) -> int:
        """Frames of all clips."""
        return sum(c["frames"] for c in self.clips)

    def speeds(self, starts: Tensor, frames: int) -> Tensor:
        """Speeds of windows ``[N]`` from their first to their last place on the ground, body sizes a second."""
        first, last = self.roots[starts.numpy()], self.roots[starts.numpy() + frames - 1]
        way = np.linalg.norm((last - first)[:, [0, 2]], axis=-1)
        return torch.from_numpy(way * (FPS / (frames - 1) / self.body.size_m))

    def _table(self, frames: int) -> tuple[Tensor, Tensor, Tensor]:
        """First frames of all windows of ``frames``, their clips, and the running sum of their chances."""
        if frames not in self._tables:
            self._tables[frames] = self._chances(frames)
        return self._tables[frames]

    def _chances(self, frames: int) -> tuple[Tensor, Tensor, Tensor]:
        """Kinds of motion by their length to the power ``balance``, then speeds by their share to ``speed_balance``."""
        index = [i for i, c in enumerate(self.clips) if c["frames"] >= frames]
        if not index:
            none = torch.empty(0, dtype=torch.long)
            return none, none, torch.empty(0, dtype=torch.double)
        kinds: dict[tuple[str, ...], int] = {}
        for i in index:
            kind = tuple(self.clips[i]["words"])
            kinds[kind] = kinds.get(kind, 0) + self.clips[i]["frames"] - frames + 1
        starts, owners, chances = [], [], []
        for i in index:
            clip = self.clips[i]
            starts.append(torch.arange(clip["start"], clip["start"] + clip["frames"] - frames + 1))
            owners.append(torch.full_like(starts[-1], i))
            chance = kinds[tuple(clip["words"])] ** (self.balance - 1.0)
            chances.append(torch.full((len(starts[-1]),), chance, dtype=torch.double))
        first, chance = torch.cat(starts), torch.cat(chances)
        classes = torch.bucketize(self.speeds(first, frames), torch.tensor(SPEED_EDGES))
        mass = torch.zeros(len(SPEED_EDGES) + 1, dtype=torch.double).index_add_(0, classes, chance / chance.sum())
        shares = (chance * mass[classes] ** (self.speed_balance - 1.0)).cumsum(0)
        return first, torch.cat(owners), shares / shares[-1]

    def has(self, frames: int) -> bool:
        """True if some clip has as many frames."""
        return any(c["frames"] >= frames for c in self.clips)

    def draw(self, batch: int, frames: int, generator: Generator) -> Windows:
        """Random windows; of those that walk, half are stretched in time."""
        starts, owners, shares = self._table(frames)
        place = torch.rand(batch, generator=generator, dtype=torch.double)
        index = torch.searchsorted(shares, place, right=True).clamp_max(len(starts) - 1)
        starts, owners = starts[index], owners[index]
        windows = self.stretched(starts, frames, owners, self._paces(starts, frames, owners, generator))
        if self.mirror:
            which = (torch.rand(batch, generator=generator) < 0.5) & self.mirrorable[owners]
            windows = windows.mirrored(self.pairs, self.contact_pairs, self.word_pairs, which)
        return windows

    def _paces(self, starts: Tensor, frames: int, owners: Tensor, generator: Generator) -> Tensor:
        """Captured frames per frame of each window ``[B]``, at most as many as its clip has left."""
        draws = torch.rand(2, len(starts), generator=generator)
        speed = self.speeds(starts, frames)
        walks = (speed > WALKING[0]) & (speed < WALKING[1]) & (draws[0] < STRETCH_SHARE)
        pace = torch.where(walks, STRETCH ** (2 * draws[1] - 1), 1.0)
        ends = torch.tensor([self.clips[i]["start"] + self.clips[i]["frames"] for i in owners.tolist()])
        return torch.minimum(pace, (ends - 1 - starts) / (frames - 1))

    def stretched(self, starts: Tensor, frames: int, owners: Tensor, pace: Tensor) -> Windows:
        """Windows ``[B]`` that begin at ``starts`` and go on by ``pace`` captured frames a frame."""
        time = torch.arange(frames) * pace.double()[:, None]
        before = time.floor()
        share = (time - before).float()[..., None]
        last = torch.tensor([self.clips[i]["start"] + self.clips[i]["frames"] - 1 for i in owners.tolist()])
        low = starts[:, None] + before.long()
        a, b = (self._frames(index, owners) for index in (low, torch.minimum(low + 1, last[:, None])))
        turn = wrap_angle(b.heading - a.heading) * share[..., 0]
        return Windows(
            torch.lerp(a.root, b.root, share),
            a.heading + turn,
            matrix_to_six_d(six_d_to_matrix(torch.lerp(a.bends, b.bends, share[..., None]))),
            torch.where(share < 0.5, a.contacts, b.contacts),
            a.words,
        )

    def windows(self, starts: Tensor, frames: int, owners: Tensor) -> Windows:
        """The windows that begin at ``starts`` ``[B]``, in the clips ``owners`` ``[B]``."""
        return self._frames(starts[:, None] + torch.arange(frames), owners)

    def _frames(self, which: Tensor, owners: Tensor) -> Windows:
        """The captured frames ``which`` ``[B, T]``."""
        index = which.numpy()
        return Windows(
            torch.from_numpy(self.roots[index]),
            torch.from_numpy(self.headings[index]),
            torch.from_numpy(self.bends[index].astype(np.float32) * np.float32(STEP)),
            torch.from_numpy(self.contacts[index]),
            self.clip_words[owners],
        )

    def every(self, frames: int, stride: int, most: int | None = None) -> tuple[Tensor, Tensor]:
        """First frames and clips of windows, every ``stride`` frames of every clip; of more than ``most``, evenly over all."""
        found = [
            (clip["start"] + first, i)
            for i, clip in enumerate(self.clips)
            for first in range(0, clip["frames"] - frames + 1, stride)
        ]
        if most is not None and len(found) > most:
            found = [found[i * len(found) // most] for i in range(most)]
        return torch.tensor([f for f, _ in found], dtype=torch.long), torch.tensor(
            [c for _, c in found], dtype=torch.long
        )


class Corpus:
    """All bodies of a cache. ``bodies`` picks some; words come from what is trained on."""

    def __init__(
        self,
        cache: Path,
        split: str,
        bodies: list[str] | None = None,
        words: list[str] | None = None,
        balance: float = BALANCE,
        mirror: bool = False,
        speed_balance: float = SPEED_BALANCE,
    ):
        found = sorted(path.parent.name for path in cache.glob("*/clips.json"))
        self.names = [name for name in found if bodies is None or name in bodies]
        unknown = set(bodies or []) - set(found)
        if unknown or not self.names:
            raise SystemExit(f"{cache} has no body {sorted(unknown)}, only {found}")
        self.words = words if words is not None else words_in(cache, self.names)
        stores = {
            name: BodyStore(cache / name, split, self.words, balance, mirror, speed_balance) for name in self.names
        }
        self.stores = {name: store for name, store in stores.items() if store.clips}
        self.names = list(self.stores)

    def draw_body(self, frames: int, generator: Generator, balance: float = BODY_BALANCE) -> str:
        """A body that has windows of as many frames, by the length of its clips to the power ``balance``."""
        names = [name for name in self.names if self.stores[name].has(frames)]
        chances = torch.tensor([float(self.stores[name].frames) ** balance for name in names])
        return names[int(torch.multinomial(chances, 1, generator=generator))]


def words_in(cache: Path, names: list[str]) -> list[str]:
    """All that training clips of these bodies show, and what their mirror images do, sorted."""
    words: set[str] = set()
    for name in names:
        clips: list[CorpusClip] = json.loads((cache / name / "clips.json").read_text())["clips"]
        words |= {word for clip in clips if clip["split"] == "train" for word in clip["words"]}
    return sorted(words)
