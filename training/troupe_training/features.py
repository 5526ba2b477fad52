"""From cached clips to training batches: segments in the segment frame, keyframe masks, root values.

A batch is a set of segments of one length T. The segment frame has its origin at the projected root of the last context
frame and heading 0 there; training then turns each segment by a random heading (see `HEADING_JITTER_RAD`).
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from troupe_training.config import (
    BALANCE,
    CONTEXT_FRAMES,
    FPS,
    FRAMES_PER_TOKEN,
    MAX_TARGETS,
    MAX_TOKENS,
    MIN_TOKENS,
    SLOTS,
)
from troupe_training.layers import full_precision
from troupe_training.rotations import arc_tangent, wrap_angle, yaw_matrix
from troupe_training.skeleton import Skeleton

# The server turns every request so that its context heads along +Z. Most training samples therefore stay near
# heading 0; the rest are turned anywhere, as in the paper, so that a heading that is ill-defined does no harm.
HEADING_JITTER_RAD = 0.15
UNIFORM_HEADING_SHARE = 0.15


@dataclass
class Segments:
    """A batch of B segments of T frames, in the segment frame, metres."""

    positions: torch.Tensor  # [B, T, J, 3], relative to the projected root
    six_d: torch.Tensor  # [B, T, J, 6], world
    velocities: torch.Tensor  # [B, T, J, 3], world, m/s
    contacts: torch.Tensor  # [B, T, C], 0 or 1
    global_root: torch.Tensor  # [B, T, 5]: x, y, z, cos, sin
    local_root: torch.Tensor  # [B, T, 4]: vx, vz, angular velocity, height

    @property
    def pose(self) -> torch.Tensor:
        """Pose features ``[B, T, J*9]``: position and 6D rotation, joint by joint."""
        joined = torch.cat([self.positions, self.six_d], -1)
        return joined.flatten(2)

    @property
    def frames(self) -> int:
        """T."""
        return self.positions.shape[1]


def local_root_of(global_root: torch.Tensor) -> torch.Tensor:
    """Local root ``[..., T, 4]`` from global root ``[..., T, 5]`` by backward differences; frame 0 copies frame 1.

    The arc tangent is taken of T numbers a row, not of the T - 1 there are: ONNX Runtime computes it four at a time and
    rounds what is left over otherwise, and a row of the batch must not depend on where in the tensor it lies.
    """
    y, c, s = global_root[..., 1], global_root[..., 3], global_root[..., 4]
    # Metres in 16 bits are a centimetre off, which 30 times a second is more than walking differs by. Sixteenths are exact in
    # them up to 16 m, and what is left over is small.
    coarse = torch.round(global_root * 16) / 16
    fine = global_root - coarse
    step = (coarse[..., 1:, :] - coarse[..., :-1, :]) + (fine[..., 1:, :] - fine[..., :-1, :])
    dx, dz = step[..., 0] * FPS, step[..., 2] * FPS
    # sin and cos of the heading's change, without any arc tangent of the headings themselves
    turn_sin = step[..., 4] * c[..., :-1] - step[..., 3] * s[..., :-1]
    turn_cos = c[..., 1:] * c[..., :-1] + s[..., 1:] * s[..., :-1]
    moving = torch.stack([dx, dz, turn_sin, turn_cos], -1)
    dx, dz, turn_sin, turn_cos = torch.cat([moving[..., :1, :], moving], -2).unbind(-1)
    omega = arc_tangent(turn_sin, turn_cos) * FPS
    return torch.stack([dx, dz, omega, y], -1)


def kind_of(name: str) -> str:
    """What a clip shows: its file name without the take's number, ``walk_old_002.bvh`` to ``walk_old``."""
    return re.sub(r"[\W_]*\d*$", "", Path(name).with_suffix("").as_posix())


class ClipStore:
    """The cache of `prepare`, in memory, with random access to segments.

    Random segments are balanced over kinds of motion (`kind_of`) with the power ``balance``, so that a style of two takes is
    seen more often than its share of the frames; 1 draws every segment with equal chance.
    """

    def __init__(self, cache: Path, split: str, device: str = "cpu", balance: float = BALANCE):
        cache = Path(cache)
        self.skeleton = Skeleton.load(cache / "skeleton.json")
        index = json.loads((cache / "clips.json").read_text())["clips"]
        self.clips = [c for c in index if c["test"] == (split == "test")]
        self.device = device
        load = lambda name: torch.from_numpy(np.load(cache / f"{name}.npy")).to(device)
        self.positions, self.six_d = load("positions"), load("six_d")
        self.headings, self.contacts = load("headings"), load("contacts")
        self.balance = balance
        tables = {
            tokens: self._start_table(tokens * FRAMES_PER_TOKEN)
            for tokens in range(MIN_TOKENS, MAX_TOKENS + 1)
        }
        self._starts = {tokens: starts for tokens, (starts, _) in tables.items()}
        self._shares = {tokens: shares for tokens, (_, shares) in tables.items()}

    def _start_table(self, frames: int) -> tuple[torch.Tensor, torch.Tensor]:
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
        """Token counts for which this store has segments."""
        return [tokens for tokens, starts in self._starts.items() if len(starts)]

    def sample(self, batch: int, tokens: int, generator: torch.Generator) -> torch.Tensor:
        """Random start frames ``[batch]`` of segments with ``tokens`` tokens."""
        starts, shares = self._starts[tokens], self._shares[tokens]
        place = torch.rand(batch, generator=generator, dtype=torch.double)
        return starts[torch.searchsorted(shares, place, right=True).clamp_max(len(starts) - 1)]

    @full_precision
    def segments(self, starts: torch.Tensor, frames: int, turn: torch.Tensor | None = None) -> Segments:
        """Cuts segments at ``starts`` into the segment frame; ``turn`` ``[B]`` adds a heading to each."""
        index = (starts[:, None] + torch.arange(frames)[None]).to(self.device)
        world = self.positions[index]
        heading = self.headings[index]
        anchor = CONTEXT_FRAMES - 1
        yaw = -heading[:, anchor]
        if turn is not None:
            yaw = yaw + turn.to(self.device)
        rotation = yaw_matrix(yaw)
        origin = world[:, anchor : anchor + 1, :1] * torch.tensor([1.0, 0.0, 1.0], device=self.device)
        world = torch.einsum("bij,btkj->btki", rotation, world - origin)
        six = self.six_d[index].unflatten(-1, (2, 3))
        six = torch.einsum("bij,btkcj->btkci", rotation, six).flatten(-2)
        psi = wrap_angle(heading + yaw[:, None])
        root = world[:, :, 0]
        global_root = torch.cat([root, torch.cos(psi)[..., None], torch.sin(psi)[..., None]], -1)
        ground = root * torch.tensor([1.0, 0.0, 1.0], device=self.device)
        velocity = (world[:, 1:] - world[:, :-1]) * FPS
        velocity = torch.cat([velocity[:, :1], velocity], 1)
        return Segments(
            positions=world - ground[:, :, None],
            six_d=six,
            velocities=velocity,
            contacts=self.contacts[index],
            global_root=global_root,
            local_root=local_root_of(global_root),
        )

    def batch(self, frames_budget: int, generator: torch.Generator, tokens: int | None = None) -> Segments:
        """A random training batch of about ``frames_budget`` frames, all segments of one random length."""
        lengths = self.lengths()
        if tokens is None:
            tokens = lengths[int(torch.randint(len(lengths), (1,), generator=generator))]
        frames = tokens * FRAMES_PER_TOKEN
        size = max(2, frames_budget // frames)
        turn = torch.randn(size, generator=generator) * HEADING_JITTER_RAD
        anywhere = torch.rand(size, generator=generator) < UNIFORM_HEADING_SHARE
        turn = torch.where(anywhere, (torch.rand(size, generator=generator) * 2 - 1) * torch.pi, turn)
        return self.segments(self.sample(size, tokens, generator), frames, turn)


def random_keyframe_mask(batch: int, frames: int, generator: torch.Generator) -> torch.Tensor:
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


def random_slot_masks(batch: int, generator: torch.Generator) -> dict[str, torch.Tensor]:
    """``[B, 8]`` masks of 0/1 for the root module: context roots always given, everything else a random subset."""
    masks = {}
    target = torch.zeros(batch, MAX_TARGETS)
    rank = torch.rand(batch, MAX_TARGETS, generator=generator).argsort(-1).argsort(-1)
    count = torch.randint(0, MAX_TARGETS + 1, (batch, 1), generator=generator)
    one = torch.rand(batch, 1, generator=generator) < 0.4
    target = (rank < torch.where(one, torch.ones_like(count), count)).float()
    for name, share, context_share in (
        ("local_root", 0.4, 1.0),
        ("global_root", 0.85, 1.0),
        ("pose", 0.75, 0.95),
    ):
        given = (torch.rand(batch, 1, generator=generator) < share).float()
        context = (
            (torch.rand(batch, 1, generator=generator) < context_share).float().expand(-1, CONTEXT_FRAMES)
        )
        masks[name] = torch.cat([context, target * given], 1)
        assert masks[name].shape[1] == SLOTS
    return masks
