"""Paths as users give them: lines, arcs and S curves at an even speed, which begin at the last pose of a captured walk.

The network's own motion is measured, before anything is pinned or held. Beside it are captures of the same speed and turn.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from troupe_training.data.bodies_store import BodyStore
from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.data.rotations import wrap_angle
from troupe_training.evaluate.distribution import Gaussian, frechet
from troupe_training.evaluate.unimogen.encoders import Encoder
from troupe_training.evaluate.unimogen.measure import BATCH, Figures, Tally
from troupe_training.evaluate.unimogen.methods import Asked, Method, Setting, captured
from troupe_training.models.unimogen.state import Path2D
from troupe_training.train.unimogen.filters import smoothing, unwrapped

SPEEDS_MPS = (0.6, 1.2, 1.8)
TURN_DEG_PER_S = 30.0
LEAD_FRAMES = 15  # over which the heading leads over to the path's, as in the server
WALK = "walk"  # begins the words of clips that paths begin in
MAX_ASIDE_RAD = math.radians(30)
MAX_TURN_DEG_PER_S = 10.0  # of a straight walk, and by which a capture's turn may differ from the path's
SAME_SPEED_MPS = 0.15  # by which a capture's speed may differ
MIN_SPEED = 0.3  # of a walk, body sizes a second
SMOOTHED_FRAMES = 6  # by which a root is smoothed, so that its sway is no turn
STRIDE = 4  # frames between the windows that are looked through


@dataclass(frozen=True)
class Case:
    """A shape at a speed. An arc turns to the left or to the right, an S first to one side, then to the other."""

    shape: str  # line, arc or S
    speed_mps: float

    @property
    def name(self) -> str:
        """As it is named in tables."""
        return f"{self.shape} {self.speed_mps:g} m/s"

    def turned(self, time: Tensor) -> Tensor:
        """Heading in radians at ``time`` ``[T]``, seconds from the first to the last, of a path that first turns left."""
        rate = math.radians(TURN_DEG_PER_S)
        if self.shape == "arc":
            return rate * time
        if self.shape == "S":
            half = float(time[-1]) / 2
            return rate * (half - (time - half).abs())
        return torch.zeros_like(time)


CASES = tuple(Case(shape, speed) for shape in ("line", "arc", "S") for speed in SPEEDS_MPS)


@dataclass
class Gait:
    """How windows of captures go, ``[N]`` each."""

    speed_mps: Tensor
    turn_deg_per_s: Tensor  # on average, to the left
    bend_deg_per_s: Tensor  # turn of the second half less that of the first: large in an S
    aside_rad: Tensor  # between heading and direction of travel, on average


def gait_of(store: BodyStore, starts: Tensor, frames: int) -> Gait:
    """The gait of windows of at least 20 frames, by the direction in which the smoothed root goes."""
    index = (starts[:, None] + torch.arange(frames)).numpy()
    root, heading = torch.from_numpy(store.roots[index])[..., [0, 2]], torch.from_numpy(store.headings[index])
    inner = slice(SMOOTHED_FRAMES, frames - SMOOTHED_FRAMES)  # where the filter reaches over no end
    smooth = (smoothing(frames, SMOOTHED_FRAMES) @ root)[:, inner]
    step = smooth[:, 1:] - smooth[:, :-1]
    direction = unwrapped(torch.atan2(step[..., 0], step[..., 1]))
    middle, last = direction.shape[1] // 2, direction.shape[1] - 1
    per_s = FPS * 180 / math.pi
    first_half = (direction[:, middle] - direction[:, 0]) * (per_s / middle)
    second_half = (direction[:, last] - direction[:, middle]) * (per_s / (last - middle))
    return Gait(
        step.norm(dim=-1).mean(1) * FPS,
        (direction[:, last] - direction[:, 0]) * (per_s / last),
        second_half - first_half,
        wrap_angle(heading[:, inner][:, 1:] - direction).abs().mean(1),
    )


def begins(store: BodyStore, setting: Setting) -> tuple[Tensor, Tensor]:
    """First frames and clips of straight walks that paths begin in, evenly over all."""
    starts, owners = store.every(setting.frames, STRIDE)
    if not len(starts):
        return starts, owners
    walking = torch.tensor([any(word.startswith(WALK) for word in clip["words"]) for clip in store.clips])
    gait = gait_of(store, starts, setting.frames)
    straight = (gait.turn_deg_per_s.abs() < MAX_TURN_DEG_PER_S) & (gait.aside_rad < MAX_ASIDE_RAD)
    return _evenly(starts, owners, walking[owners] & straight & _moves(store, gait), setting.most)


def _moves(store: BodyStore, gait: Gait) -> Tensor:
    return gait.speed_mps > MIN_SPEED * store.body.size_m


def _evenly(starts: Tensor, owners: Tensor, which: Tensor, most: int | None) -> tuple[Tensor, Tensor]:
    starts, owners = starts[which], owners[which]
    if most is not None and len(starts) > most:
        pick = torch.arange(most) * len(starts) // most
        starts, owners = starts[pick], owners[pick]
    return starts, owners


def alike(store: BodyStore, case: Case, setting: Setting) -> tuple[Tensor, Tensor]:
    """First frames and clips of captures with the speed and turn of a case, to either side, evenly over all."""
    starts, owners = store.every(setting.frames, STRIDE)
    if not len(starts):
        return starts, owners
    gait = gait_of(store, starts, setting.frames)
    wanted = {"line": (0.0, 0.0), "arc": (TURN_DEG_PER_S, 0.0), "S": (0.0, 2 * TURN_DEG_PER_S)}[case.shape]
    same = (gait.speed_mps - case.speed_mps).abs() < SAME_SPEED_MPS
    same &= (gait.turn_deg_per_s.abs() - wanted[0]).abs() < MAX_TURN_DEG_PER_S
    same &= (gait.bend_deg_per_s.abs() - wanted[1]).abs() < 2 * MAX_TURN_DEG_PER_S
    same &= gait.aside_rad < MAX_ASIDE_RAD
    return _evenly(starts, owners, same & _moves(store, gait), setting.most)


def path_of(asked: Asked, case: Case, first: int) -> Path2D:
    """The captured past, then the case's path from its last pose on, in the direction of the walk. Sides alternate.

    ``first`` is the number of the first of these windows among all.
    """
    own, last = asked.path, CONTEXT_FRAMES - 1
    batch, frames = own.heading.shape
    ahead = own.points[:, -1] - own.points[:, 0]
    direction = torch.atan2(ahead[:, 0], ahead[:, 1])[:, None]
    time = torch.arange(1, frames - last) / FPS
    side = 1.0 - 2.0 * ((first + torch.arange(batch)) % 2)[:, None]
    heading = direction + side * case.turned(time)
    step = case.speed_mps / FPS * torch.stack([torch.sin(heading), torch.cos(heading)], -1)
    points = own.points[:, last : last + 1] + step.cumsum(1)
    share = (torch.arange(1, frames - last) / LEAD_FRAMES).clamp_max(1.0)
    lead = 1.0 - share * share * (3.0 - 2.0 * share)
    heading = heading + lead * wrap_angle(own.heading[:, last : last + 1] - direction)
    return Path2D(
        torch.cat([own.points[:, : last + 1], points], 1), torch.cat([own.heading[:, : last + 1], heading], 1)
    )


def measure_paths(
    store: BodyStore,
    captures: Sequence[BodyStore],
    methods: Mapping[str, Method],
    setting: Setting,
    encoder: Encoder | None,
) -> dict[str, dict[str, Figures]]:
    """Mean figures by case and method; ``captured`` are the windows of ``captures`` that go alike, as many as there are.

    Paths begin in windows of ``store``. The Fréchet distance is that to the captures.
    """
    starts, owners = begins(store, setting)
    report = {}
    for case in CASES:
        reference = Tally(store, encoder)
        count = 0
        for other in captures:
            found, clips = alike(other, case, setting)
            count += len(found)
            _measure(other, captured(other.body), found, clips, setting, reference, None)
        report[case.name] = {"captured": _means(reference, count)}
        true_latents = reference.encoded()
        for name, method in methods.items():
            tally = Tally(store, encoder)
            _measure(store, method, starts, owners, setting, tally, case)
            report[case.name][name] = _means(tally, len(starts))
            latents = tally.encoded()
            if len(latents) and len(true_latents):
                report[case.name][name]["fid"] = frechet(Gaussian(latents), Gaussian(true_latents))
    return report


def _measure(
    store: BodyStore, method: Method, starts: Tensor, owners: Tensor, setting: Setting, tally: Tally, case: Case | None
) -> None:
    """Adds a method's answers to a tally; without a case the path is the captured root's own."""
    truth_of = captured(store.body)
    for chunk in range(0, len(starts), BATCH):
        some = slice(chunk, chunk + BATCH)
        asked = Asked.of(store, starts[some], owners[some], setting.frames)
        truth = truth_of(asked)
        if case is not None:
            asked.path = path_of(asked, case, chunk)
        tally.add(method(asked), truth, asked.path)


def roots_of(store: BodyStore, setting: Setting) -> dict[str, Any]:
    """Roots of captured straight walks, x, z and heading in each frame, and what feet and joints of these captures do."""
    starts, owners = begins(store, setting)
    if not len(starts):
        raise SystemExit(f"no clip of {store.body.name} walks straight on for {setting.frames} frames")
    tally = Tally(store, None)
    _measure(store, captured(store.body), starts, owners, setting, tally, None)
    path = Asked.of(store, starts, owners, setting.frames).path
    figures = tally.means()
    return {
        "roots": torch.cat([path.points, path.heading[..., None]], -1).double().numpy().round(5).tolist(),
        "standing_foot_mm": 1e3 * figures["standing_foot_m_per_frame"],
        "sunk_share": figures["foot_penetration_share"],
        "acceleration_mps2": figures["jitter_mps2"],
        "highest_toe_m": max(float(part["toe_highest_m"].max()) for part in tally.parts),
    }


def _means(tally: Tally, windows: int) -> Figures:
    """A tally's means; the distance to the capture is left out, because its path was another."""
    found = tally.means() if windows else {}
    return {name: value for name, value in found.items() if name != "l2p_m"} | {"windows": float(windows)}
