"""Animations of glTF binaries (``.glb``) as motion: all of a file's animations on one skeleton, at 30 fps."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import troupe_reader
from troupe_training.data.clips import FileMotion
from troupe_training.data.conventions import FPS
from troupe_training.data.reader import file_motion

UPRIGHT = [1.0, 0.0, 0.0, 0.0]


class GltfError(ValueError):
    """A file whose animations do not share a skeleton; the message says what differs."""


@dataclass
class Rig:
    """A file's skeleton at rest and its animations by name, all with the same joints and bones."""

    rest: FileMotion  # one frame, on the ground
    clips: dict[str, FileMotion]
    notes: list[str]
    reports: list[dict[str, Any]]  # of the reader, one an animation


def read_glb(path: Path) -> Rig:
    """Reads all animations of a file. Raises `ValueError` with the reason if there are none."""
    names = troupe_reader.animations(path, name=path.name)
    if not names:
        raise GltfError("no animation in it")
    read = {name: _read(path, name, None) for name in names}
    # An animation in which only a joint below the root moves shows a root of fewer joints.
    root = min((clip.skeleton.names for clip in read.values()), key=len)[0]
    read = {name: clip if clip.skeleton.names[0] == root else _read(path, name, root) for name, clip in read.items()}
    first = read[names[0]].skeleton
    for name, clip in read.items():
        if clip.skeleton.names != first.names:
            odd = sorted(set(clip.skeleton.names) ^ set(first.names))
            raise GltfError(f"animations {names[0]!r} and {name!r} differ in the joints {', '.join(odd)}")
    bones = np.median([clip.skeleton.offsets for clip in read.values()], axis=0)
    bones[0] = 0.0
    skeleton = troupe_reader.Skeleton(first.names, first.parents, bones)
    clips = {
        name: file_motion(troupe_reader.Clip(skeleton, clip.fps, clip.root_positions, clip.rotations))
        for name, clip in read.items()
    }
    reports = [clip.report for clip in read.values() if clip.report is not None]
    return Rig(_rest(skeleton, read[names[0]].rest), clips, _notes(reports), reports)


def _read(path: Path, animation: str, root: str | None) -> troupe_reader.Clip:
    return troupe_reader.read(path, name=path.name, animation=animation, root=root, fps=FPS)


def _rest(skeleton: troupe_reader.Skeleton, pose: np.ndarray | None) -> FileMotion:
    """The rest pose, whose lowest joint is on the ground."""
    rotations = np.tile(UPRIGHT, (len(skeleton), 1)) if pose is None else pose
    rest = file_motion(troupe_reader.Clip(skeleton, FPS, np.zeros((1, 3)), rotations[None]))
    rest.positions[..., 1] -= rest.positions[..., 1].min()
    return rest


def _notes(reports: list[dict[str, Any]]) -> list[str]:
    """What was put right or looks odd, each once for all animations."""
    texts = [note["text"] for report in reports for note in report["repairs"] + report["oddities"]]
    return list(dict.fromkeys(texts))
