"""Animations of a glTF file as motion: all of a file's animations on one skeleton, at 30 fps."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import troupe_reader
from troupe_reader.options import FileOptions
from troupe_training.data.clips import FileMotion
from troupe_training.data.conventions import FPS
from troupe_training.data.reader import file_motion

UPRIGHT = [1.0, 0.0, 0.0, 0.0]
SAMPLED = {"evidence": "training's own: it samples the keys at this rate"}


class GltfError(ValueError):
    """A file whose animations do not share a skeleton; the message says what differs."""


@dataclass
class Rig:
    """A file's skeleton at rest and its animations by name, all with the same joints and bones."""

    rest: FileMotion  # one frame, on the ground
    clips: dict[str, FileMotion]
    notes: list[str]
    reports: list[dict[str, Any]]  # of the reader, one an animation
    refused: dict[str, str]  # why animations cannot be read, by their names


@dataclass
class _Animation:
    """What the reader makes of an animation."""

    skeleton: troupe_reader.Skeleton
    fps: float
    root_positions: np.ndarray
    rotations: np.ndarray  # [F, J, 4]
    rest: np.ndarray | None  # [J, 4]
    report: dict[str, Any]

    def on(self, names: list[str]) -> "_Animation":
        """With some of the joints; others do not hang on those that are left out."""
        own = self.skeleton
        kept = [own.names.index(name) for name in names]
        parents = [names.index(own.names[own.parents[j]]) if own.parents[j] >= 0 else -1 for j in kept]
        skeleton = troupe_reader.Skeleton(names, parents, own.offsets[kept])
        rest = None if self.rest is None else self.rest[kept]
        return replace(self, skeleton=skeleton, rotations=self.rotations[:, kept], rest=rest)


def read_rig(path: Path, given: FileOptions | None = None) -> Rig:
    """Reads all animations of a file. Raises `ValueError` with the reason if none can be read."""
    names = troupe_reader.animations(path, name=path.name)
    if not names:
        raise GltfError("no animation in it")
    options: FileOptions = {"fps": FPS, **(given or {})}
    read, refused = dict[str, _Animation](), dict[str, str]()
    for name in names:
        try:
            read[name] = _read(path, name, options)
        except ValueError as error:
            refused[name] = str(error).removeprefix(f"{path.name}: ")
    if not read:
        raise GltfError(f"none of {len(names)} animations can be read, e.g. {names[0]}: {refused[names[0]]}")
    # An animation in which only a joint below the root moves shows a root of fewer joints.
    root = min((one.skeleton.names for one in read.values()), key=len)[0]
    rooted: FileOptions = {**options, "root": root}
    read = {name: one if one.skeleton.names[0] == root else _read(path, name, rooted) for name, one in read.items()}
    read, left_out = _on_common_joints(read)
    skeletons = [one.skeleton for one in read.values()]
    bones = np.median([skeleton.offsets for skeleton in skeletons], axis=0)
    bones[0] = 0.0
    skeleton = troupe_reader.Skeleton(skeletons[0].names, skeletons[0].parents, bones)
    clips = {
        name: file_motion(troupe_reader.Clip(skeleton, one.fps, one.root_positions, one.rotations))
        for name, one in read.items()
    }
    reports = [one.report for one in read.values()]
    if given is None or "fps" not in given:
        reports = [report | {"fps": report["fps"] | SAMPLED} for report in reports]
    rest = next(iter(read.values())).rest
    return Rig(_rest(skeleton, rest), clips, left_out + _notes(reports), reports, refused)


def _read(path: Path, animation: str, options: FileOptions) -> _Animation:
    all_options: FileOptions = {**options, "animation": animation}
    clip = troupe_reader.read(path, name=path.name, **all_options)
    return _Animation(clip.skeleton, clip.fps, clip.root_positions, clip.rotations, clip.rest, clip.report or {})


def _on_common_joints(read: dict[str, _Animation]) -> tuple[dict[str, _Animation], list[str]]:
    """Animations without the joints that the reader leaves out of some of them, and a note of these.

    The reader leaves out only what carries nothing of the body, with all that hangs on it.
    """
    first, *others = (one.skeleton for one in read.values())
    common = [name for name in first.names if all(name in other.names for other in others)]
    for name, one in read.items():
        own = one.skeleton
        above = {of: own.names[parent] for of, parent in zip(own.names, own.parents, strict=True) if parent >= 0}
        odd = [of for of in common if of in above and above[of] not in common]
        if odd:
            raise GltfError(f"animations {next(iter(read))!r} and {name!r} differ in the joints above {', '.join(odd)}")
    left_out = sorted({of for one in read.values() for of in one.skeleton.names} - set(common))
    if not left_out:
        return read, []
    note = f"left out of all animations, as some have them left out: {', '.join(left_out)}"
    return {name: one.on(common) for name, one in read.items()}, [note]


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
