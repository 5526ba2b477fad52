"""Facts of a clip for captions: content and style from its name, speed, duration, turn and hand as measured."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from troupe_training.data.cells import CLIP_NAME, SAME_STYLE, mirrored_cell
from troupe_training.data.conventions import FPS
from troupe_training.data.skeleton import Skeleton

LEFT_HAND, RIGHT_HAND = ("hand_l", "left_hand", "lefthand", "wrist_l"), ("hand_r", "right_hand", "righthand", "wrist_r")
# A hand is named where it travels that many times as far as the other.
HAND_RATIO = 1.8


@dataclass(frozen=True)
class Facts:
    """Facts of a clip, or of a crop of it."""

    content: str  # as clips are named: "walk-turn-left"
    style: str | None
    seconds: float
    speed_mps: float  # of the root over the ground, in the mean
    turn_rad: float  # of the heading, from the first frame to the last; positive to the left
    hand: str | None = None  # "left" or "right" where one moves much more


def named(name: str, mirrored: bool = False) -> tuple[str, str | None]:
    """Content and style of a clip's name; names of another form are all content."""
    stem = Path(name).stem
    stem = stem.removesuffix("_M") if mirrored else stem
    found = CLIP_NAME.match(stem)
    if found is None:
        content = re.sub(r"(_part\d+|_\d+)$", "", stem).replace("_", "-")
        return (mirrored_cell(content) if mirrored else content), None
    style = SAME_STYLE.get(found["style"], found["style"])
    content = mirrored_cell(found["content"]) if mirrored else found["content"]
    return content, style


def hands(skeleton: Skeleton) -> tuple[int, int] | None:
    """The joints of the left and right hand by their names; None if there are none of these names."""
    names = [name.lower() for name in skeleton.names]
    left = [names.index(name) for name in LEFT_HAND if name in names]
    right = [names.index(name) for name in RIGHT_HAND if name in names]
    return (left[0], right[0]) if left and right else None


def measured(
    content: str, style: str | None, positions: np.ndarray, headings: np.ndarray, joints: tuple[int, int] | None
) -> Facts:
    """Facts of world positions ``[F, J, 3]`` (m) and headings ``[F]`` (rad); ``joints`` are the hands."""
    root = positions[:, 0, [0, 2]]
    seconds = len(positions) / FPS
    path = float(np.linalg.norm(np.diff(root, axis=0), axis=-1).sum())
    steps = np.diff(headings)
    turn = float(np.arctan2(np.sin(steps), np.cos(steps)).sum())
    hand = None
    if joints is not None:
        over_root = positions[:, list(joints)] - positions[:, :1]
        left, right = np.linalg.norm(np.diff(over_root, axis=0), axis=-1).sum(0)
        hand = "left" if left > HAND_RATIO * right else "right" if right > HAND_RATIO * left else None
    return Facts(content, style, seconds, path / seconds, turn, hand)


def contents_and_styles(names: Sequence[tuple[str, str | None]]) -> tuple[list[str], list[str]]:
    """All contents and styles of clips, sorted."""
    return sorted({content for content, _ in names}), sorted({style for _, style in names if style})
