"""Clips out of a file's motion, in any format: cuts at implausible jumps, headings, contacts, splits."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any, Protocol

import numpy as np

from troupe_training.data.conventions import FPS
from troupe_training.data.rotations import columns_to_matrix
from troupe_training.data.skeleton import Skeleton

MIN_CLIP_FRAMES = 16
MAX_JOINT_SPEED_MPS = 20.0
# A root that leaves its neighbours' velocity for one frame alone was moved, not walked: retargeted
# motion is often solved in blocks and joined with a shift. Real roots stay below 0.65 m/s in the
# 2.2 hours of the G1's LaFAN1; hard landings change the velocity for good and are no shifts.
MAX_ROOT_SHIFT_MPS = 0.75
MAX_BELOW_GROUND_M = 0.15
CONTACT_HEIGHT_MARGIN_M = 0.05
CONTACT_MAX_SPEED_MPS = 0.4
MAX_FLOOR_ERROR_M = 0.03


class ClipError(ValueError):
    """Motion that cannot be used; the message says why."""


@dataclass
class FileMotion:
    """One file at 30 fps in the native axes, metres: joints with parents first, world positions and rotations."""

    names: list[str]
    parents: list[int]
    offsets: np.ndarray  # [J, 3]
    positions: np.ndarray  # [F, J, 3]
    rotations: np.ndarray  # [F, J, 3, 3]
    notes: list[str] = field(default_factory=list)
    report: dict[str, Any] | None = None  # what the reader understood of the file
    carried: dict[str, Any] | None = None  # from which skeleton it was carried over, and with which figures


@dataclass
class Clip:
    """Frames of a file that hold together; ``first_frame`` counts from the file's first at 30 fps."""

    name: str
    file: str
    first_frame: int
    positions: np.ndarray  # [F, J, 3], float32
    six_d: np.ndarray  # [F, J, 6], float32
    mirrored: bool = False


class MotionSource(Protocol):
    """Reads files as motion of one skeleton."""

    endings: tuple[str, ...]  # of its files, in small letters

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""

    def survey(self, files: Sequence[Path]) -> None:
        """Looks at all files before any is loaded: what they agree on decides for those that leave it open."""

    def load(self, path: Path, animation: str | None = None) -> FileMotion:
        """Reads one file, or one of its animations. Raises `ValueError` with the reason if it cannot be used."""

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The skeleton of all files from their joints, usual offsets ``[J, 3]`` (m) and clips."""


def in_test_split(file: str, pattern: str | None = None) -> bool:
    """True for the files kept for testing: those whose name ``pattern`` finds, else 5 % by a hash of the name."""
    if pattern is not None:
        return re.search(pattern, file) is not None
    return int.from_bytes(hashlib.sha256(file.encode()).digest()[:4], "big") % 20 == 0


def with_suffix(file: str, ending: str) -> str:
    """``walk.csv`` and ``_M`` to ``walk_M.csv``."""
    path = PurePath(file)
    return path.stem + ending + path.suffix


def cut(file: str, motion: FileMotion) -> tuple[list[Clip], list[str]]:
    """The clips of a file, and what was cut out of it and why. Raises `ClipError` if nothing is left.

    A file is split where a joint moves faster than is believed or the root shifts, and frames where a joint is deep
    below the ground are left out. Pieces too short to train on are dropped, and said.
    """
    positions, notes = motion.positions, list(motion.notes)
    if len(positions) < MIN_CLIP_FRAMES:
        raise ClipError(f"only {len(positions)} frames, at least {MIN_CLIP_FRAMES} are needed")
    jumps = _jumps(positions, motion.names)
    notes += [f"cut before frame {frame}: {what}" for frame, what in jumps.items()]
    height = positions[..., 1]
    below = height.min(1) < -MAX_BELOW_GROUND_M
    for first, end in _runs(below):
        joint = int(height[first:end].min(0).argmin())
        depth = -height[first:end, joint].min()
        notes.append(f"frames {first} to {end - 1} left out: {motion.names[joint]} is {depth:.2f} m below the ground")
    pieces = _pieces(below, sorted(jumps))
    kept = [(first, end) for first, end in pieces if end - first >= MIN_CLIP_FRAMES]
    if not kept:
        raise ClipError("nothing is left of it: " + "; ".join(notes))
    short = sum(end - first for first, end in pieces) - sum(end - first for first, end in kept)
    if short:
        notes.append(f"{short} frames left out in pieces of less than {MIN_CLIP_FRAMES}")
    whole = kept == [(0, len(positions))]
    six_d = np.concatenate([motion.rotations[..., 0], motion.rotations[..., 1]], -1).astype(np.float32)
    clips = [
        Clip(
            file if whole else with_suffix(file, f"_part{number}"),
            file,
            first,
            positions[first:end].astype(np.float32),
            six_d[first:end],
        )
        for number, (first, end) in enumerate(kept, 1)
    ]
    return clips, notes


def _jumps(positions: np.ndarray, names: list[str]) -> dict[int, str]:
    """The frames before which the motion is cut, and what jumps there."""
    velocity = np.diff(positions, axis=0) * FPS
    speed = np.linalg.norm(velocity, axis=-1)
    root = velocity[:, 0]
    shift = np.linalg.norm(root[1:-1] - (root[:-2] + root[2:]) / 2, axis=-1)
    change = np.linalg.norm(root[2:] - root[:-2], axis=-1)
    found = {
        int(step) + 2: f"{names[0]} shifts by {100 * shift[step] / FPS:.0f} cm in one frame"
        for step in np.flatnonzero((shift > MAX_ROOT_SHIFT_MPS) & (change < shift))
    }
    for step in np.flatnonzero(speed.max(1) > MAX_JOINT_SPEED_MPS):
        joint = int(speed[step].argmax())
        found[int(step) + 1] = (
            f"{names[joint]} moves at {speed[step, joint]:.1f} m/s, at most {MAX_JOINT_SPEED_MPS:.0f} is believed"
        )
    return dict(sorted(found.items()))


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and end of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def _pieces(left_out: np.ndarray, cuts: list[int]) -> list[tuple[int, int]]:
    """Runs of frames that are not left out, split before each frame of ``cuts``."""
    pieces = []
    for first, end in _runs(~left_out):
        inside = [c for c in cuts if first < c < end]
        borders = [first, *inside, end]
        pieces += list(pairwise(borders))
    return pieces


def skeleton_of(
    names: list[str],
    parents: list[int],
    offsets: np.ndarray,
    digits: int,
    left_axis: list[float],
    contacts: list[str],
    clips: list[Clip],
) -> Skeleton:
    """The skeleton of clips, with ``offsets`` ``[J, 3]`` (m) to some digits; ``contacts`` name what touches the ground.

    A contact joint's clearance is its height when it stands; some centimetres above it, it may still stand.
    """
    feet = [names.index(name) for name in contacts]
    clearance = np.percentile(np.concatenate([c.positions[:, feet, 1] for c in clips]), 1.0, axis=0)
    return Skeleton(
        names=names,
        parents=parents,
        offsets=[[round(float(v), digits) + 0.0 for v in offset] for offset in offsets],
        left_axis=left_axis,
        contact_joints=feet,
        contact_max_height_m=[round(float(h + CONTACT_HEIGHT_MARGIN_M), 4) for h in clearance],
        contact_max_speed_mps=CONTACT_MAX_SPEED_MPS,
        contact_clearance_m=[round(float(h), 4) for h in clearance],
    )


def floor_errors(clips: list[Clip], skeleton: Skeleton) -> list[float]:
    """How far above (or below) the usual ground the feet of each clip stand, metres, by the lowest contact joint."""
    clearance = np.array(skeleton.contact_clearance_m)
    over = [(c.positions[:, skeleton.contact_joints, 1] - clearance).min(1) for c in clips]
    floors = np.array([np.percentile(heights, 5.0) for heights in over])
    return list(floors - np.median(floors))


def headings(six_d: np.ndarray, left_axis: np.ndarray) -> np.ndarray:
    """Headings ``[F]``, radians, from the pelvis rotations in ``[F, J, 6]``: left x up, projected on the ground."""
    left = columns_to_matrix(six_d[:, 0]) @ left_axis
    return np.arctan2(-left[:, 2], left[:, 0])


def detect_contacts(positions: np.ndarray, skeleton: Skeleton, share_of_root: float = 0.0) -> np.ndarray:
    """``[F, C]`` of 0/1: a contact joint that is low and slow stands on the ground.

    A joint is slow below the skeleton's limit, or below ``share_of_root`` times the speed of the root if that is more.
    """
    feet = positions[:, skeleton.contact_joints]
    speed = np.linalg.norm(np.diff(feet, axis=0, prepend=feet[:1]), axis=-1) * FPS
    if len(speed) > 1:
        speed[0] = speed[1]
    low = feet[..., 1] < np.array(skeleton.contact_max_height_m)
    root = (
        np.linalg.norm(np.gradient(positions[:, 0, [0, 2]], axis=0), axis=-1) * FPS if len(speed) > 1 else np.zeros(1)
    )
    limit = np.maximum(skeleton.contact_max_speed_mps, share_of_root * root)[:, None]
    return (low & (speed < limit)).astype(np.float32)
