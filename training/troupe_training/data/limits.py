"""Limits of the motion in a cache: the table ``[limits]`` of a pack, by which the server judges its answers.

Each figure is taken frame by frame. Its limit is the value that all but `BEYOND` of the training windows stay within, so that
one odd frame of a capture sets none. The server's figures (``motion/src/feasibility``) are computed the same way.
"""

import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
import torch

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, MAX_FRAMES
from troupe_training.data.rotations import columns_to_matrix, matrix_to_quat
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import ClipEntry, in_split

# Share of the training windows that may be beyond a limit. There are eleven figures, and windows
# that are beyond one are often beyond others: together they flag less than 2 % of windows.
BEYOND = 0.001
STRIDE = 8  # frames from one window to the next
# Share of the frames in which a joint may be beyond either end of its range of bends.
BEND_BEYOND = 0.0005
# Frames from the last context frame to a target for which the reach is measured; between them it is
# interpolated.
REACH_FRAMES = (1, 2, 4, 8, 12, 16, 24, 32, 44, 60)
# Limits are at least so large, in their units: what data without any such motion says of it is no
# more exact.
LEAST = {"below_ground_m": 0.05, "bend_rad": 0.1}
LEAST_OTHER = 0.01


@dataclass
class Bend:
    """How a joint bends: within a box around its usual rotation relative to its parent.

    The box is of the vector parts of ``usual⁻¹ · rotation``, its real part at least 0: the axis times the sine of half the angle.
    """

    joint: str
    usual: list[float]  # quaternion (w, x, y, z)
    low: list[float]
    high: list[float]


@dataclass
class Limits:
    """The table ``[limits]``; a list has an entry for each of ``reach_frames``, ``bends`` one for each joint but the root."""

    beyond: float  # share of training windows beyond each limit
    windows: int
    root_speed_mps: float  # over the ground
    root_acceleration_mps2: float
    turning_rad_per_s: float  # of the pelvis, about any axis
    joint_speed_mps: float  # of the fastest joint, relative to the root
    joint_acceleration_mps2: float
    below_ground_m: float  # of the lowest joint
    off_ground_m: float
    upright: list[float]  # the world's up in the pelvis's own frame, in the mean
    tilt_rad: float  # of the pelvis, from there
    bend_rad: float  # beyond the box of a joint
    reach_frames: list[int]
    root_reach_m: list[float]  # from where the context's velocity leads
    turn_reach_rad: list[float]  # of the pelvis
    pose_reach_m: list[float]  # of the joints in the mean, over the projected root
    bends: list[Bend] = field(default_factory=list)

    def lines(self) -> list[str]:
        """The table as TOML."""
        plain = [(f.name, getattr(self, f.name)) for f in fields(self) if f.name != "bends"]
        lines = ["[limits]", *(f"{name} = {json.dumps(value)}" for name, value in plain)]
        for bend in self.bends:
            lines += [
                "",
                "[[limits.bends]]",
                *(f"{name} = {json.dumps(value)}" for name, value in asdict(bend).items()),
            ]
        return lines


@dataclass
class Frames:
    """A clip of F frames, as limits are measured on it."""

    positions: np.ndarray  # [F, J, 3], world
    pelvis: np.ndarray  # [F, 4], world
    bends: np.ndarray  # [F, J - 1, 4], relative to the parent

    @staticmethod
    def of(positions: np.ndarray, rotations: np.ndarray, skeleton: Skeleton) -> "Frames":
        """From world positions ``[F, J, 3]`` and rotations ``[F, J, 3, 3]``."""
        local = rotations[:, skeleton.parents[1:]].swapaxes(-1, -2) @ rotations[:, 1:]
        pelvis, bends = (matrix_to_quat(torch.from_numpy(m)).numpy() for m in (rotations[:, 0], local))
        return Frames(positions, pelvis.astype(np.float32), bends.astype(np.float32))


def measure(cache: Path) -> Limits:
    """The limits of the training clips of a cache."""
    skeleton = Skeleton.load(cache / "skeleton.json")
    index: list[ClipEntry] = json.loads((cache / "clips.json").read_text())["clips"]
    positions, six_d = (np.load(cache / f"{name}.npy", mmap_mode="r") for name in ("positions", "six_d"))
    clips = []
    for entry in index:
        if in_split(entry, "train"):
            own = slice(entry["start"], entry["start"] + entry["frames"])
            rotations = columns_to_matrix(np.asarray(six_d[own]))
            clips.append(Frames.of(np.asarray(positions[own]), rotations, skeleton))
    return limits_of(skeleton, clips)


def limits_of(skeleton: Skeleton, clips: list[Frames]) -> Limits:
    """The limits of some clips of a skeleton."""
    upright = np.sum([_up_in(clip.pelvis).sum(0) for clip in clips], axis=0)
    upright = upright / np.linalg.norm(upright)
    bends = _bends(skeleton, np.concatenate([clip.bends for clip in clips]))
    peaks = np.concatenate([window_peaks(frame_figures(clip, upright, bends)) for clip in clips])
    limits = dict(zip(FIGURES, np.quantile(peaks, 1 - BEYOND, axis=0), strict=True))
    limits = {name: max(float(value), LEAST.get(name, LEAST_OTHER)) for name, value in limits.items()}
    reaches = np.maximum.accumulate([reach(clips, frames) for frames in REACH_FRAMES]).clip(LEAST_OTHER)
    root, turn, pose = ([round(float(v), 3) for v in one] for one in reaches.T)
    return Limits(
        beyond=BEYOND,
        windows=len(peaks),
        **{name: round(value, 3) for name, value in limits.items()},
        upright=[round(float(v), 5) for v in upright],
        reach_frames=list(REACH_FRAMES),
        root_reach_m=root,
        turn_reach_rad=turn,
        pose_reach_m=pose,
        bends=bends,
    )


# In the order of the columns of `frame_figures`.
FIGURES = (
    "root_speed_mps",
    "root_acceleration_mps2",
    "turning_rad_per_s",
    "joint_speed_mps",
    "joint_acceleration_mps2",
    "below_ground_m",
    "off_ground_m",
    "tilt_rad",
    "bend_rad",
)


def frame_figures(clip: Frames, upright: np.ndarray, bends: list[Bend]) -> np.ndarray:
    """``[F, 9]``: `FIGURES` of each frame; those of a step belong to the frame that it leads to."""
    root = clip.positions[:, 0]
    relative = clip.positions - root[:, None]
    step, moved = np.diff(root, axis=0), np.diff(relative, axis=0)
    lowest = clip.positions[..., 1].min(1)
    found = np.zeros((len(root), len(FIGURES)), dtype=np.float64)
    found[1:, 0] = np.linalg.norm(step[:, [0, 2]], axis=-1) * FPS
    found[1:-1, 1] = np.linalg.norm(np.diff(step, axis=0), axis=-1) * FPS**2
    found[1:, 2] = _angle(clip.pelvis[1:], clip.pelvis[:-1]) * FPS
    found[1:, 3] = np.linalg.norm(moved, axis=-1).max(-1) * FPS
    found[1:-1, 4] = np.linalg.norm(np.diff(moved, axis=0), axis=-1).max(-1) * FPS**2
    found[:, 5], found[:, 6] = -lowest, lowest
    found[:, 7] = np.arccos(np.clip(_up_in(clip.pelvis) @ upright, -1.0, 1.0))
    found[:, 8] = _beyond(clip.bends, bends).max(-1)
    return found


def window_peaks(figures: np.ndarray) -> np.ndarray:
    """``[W, ...]``: the largest figures of each window of `MAX_FRAMES`; a shorter clip is one window."""
    starts = range(0, max(len(figures) - MAX_FRAMES, 0) + 1, STRIDE)
    return np.stack([figures[start : start + MAX_FRAMES].max(0) for start in starts])


def reach(clips: list[Frames], frames: int) -> tuple[float, float, float]:
    """How far root, pelvis and pose get in so many frames from all but `BEYOND` of the places to start from.

    The root's is over the ground, from where the velocity of the context leads.
    """
    root, turn, pose = [np.zeros(1)], [np.zeros(1)], [np.zeros(1)]
    context = CONTEXT_FRAMES - 1
    for clip in clips:
        if len(clip.positions) <= context + frames:
            continue
        ground = clip.positions[:, 0] * np.array([1, 0, 1], np.float32)
        start, end = slice(context, -frames), slice(context + frames, None)
        velocity = (ground[start] - ground[: -context - frames]) / context
        over = clip.positions - ground[:, None]
        root.append(np.linalg.norm(ground[end] - ground[start] - frames * velocity, axis=-1))
        turn.append(_angle(clip.pelvis[end], clip.pelvis[start]))
        pose.append(np.linalg.norm(over[end] - over[start], axis=-1).mean(-1))
    far = [float(np.quantile(np.concatenate(one[1:] or one), 1 - BEYOND)) for one in (root, turn, pose)]
    return far[0], far[1], far[2]


def _bends(skeleton: Skeleton, rotations: np.ndarray) -> list[Bend]:
    """The usual rotation of each joint but the root, and the box that its bends stay within, from ``[F, J - 1, 4]``."""
    found = []
    for j, name in enumerate(skeleton.names[1:]):
        own = rotations[:, j].astype(np.float64)
        usual = np.linalg.eigh(own.T @ own)[1][:, -1]
        usual *= np.sign(usual[0]) or 1.0
        parts = relative_parts(usual, own)
        low, high = np.quantile(parts, BEND_BEYOND, axis=0), np.quantile(parts, 1 - BEND_BEYOND, axis=0)
        found.append(Bend(name, *([round(float(v), 5) for v in values] for values in (usual, low, high))))
    return found


def relative_parts(usual: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Vector parts ``[..., 3]`` of ``usual⁻¹ · rotation``, whose real part is made positive, of ``[..., 4]``."""
    (w, v), (real, parts) = ((usual[..., :1], -usual[..., 1:]), (rotations[..., :1], rotations[..., 1:]))
    turned = w * parts + real * v + np.cross(np.broadcast_to(v, parts.shape), parts)
    return np.where(w * real < (v * parts).sum(-1, keepdims=True), -turned, turned)


def _beyond(rotations: np.ndarray, bends: list[Bend]) -> np.ndarray:
    """How far each joint is beyond its box, radians, ``[F, J - 1]`` of ``[F, J - 1, 4]``: the worst axis."""
    usual, low, high = (np.array([getattr(bend, name) for bend in bends]) for name in ("usual", "low", "high"))
    parts = relative_parts(usual, rotations)
    nearest = np.clip(parts, low, high)
    return (2 * np.abs(np.arcsin(np.clip(parts, -1, 1)) - np.arcsin(np.clip(nearest, -1, 1)))).max(-1)


def _up_in(pelvis: np.ndarray) -> np.ndarray:
    """The world's up in the frame of rotations ``[F, 4]``: the second row of their matrices."""
    w, x, y, z = pelvis.T
    return np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between unit quaternions ``[..., 4]``, radians."""
    return 2 * np.arccos(np.clip(np.abs((a * b).sum(-1)), 0.0, 1.0))
