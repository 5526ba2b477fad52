"""A folder of files of joints as motion. The reader finds the pelvis, the up axis and the unit; the sides are found here."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import troupe_reader
from troupe_reader.options import FileOptions
from troupe_training.data.clips import Clip, ClipError, FileMotion, skeleton_of
from troupe_training.data.reader import file_motion
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import Skeleton

CONTACT_WORDS = ("foot", "toe", "ankle")


class JointSource:
    """Reads files of joints; ``scale`` is metres per unit, found by the body's proportions if left out."""

    endings = troupe_reader.ENDINGS

    def __init__(
        self, contact_names: list[str] | None = None, scale: float | None = None, given: FileOptions | None = None
    ):
        self.contact_names = contact_names
        self.scale = scale
        self._given: FileOptions = given or {}
        self._agreement: troupe_reader.Agreement | None = None

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""
        return {"contact_joints": self.contact_names, "scale": self.scale, **self._given}

    def survey(self, files: Sequence[Path]) -> None:
        """Finds what all files show, for those that leave it open."""
        self._agreement = troupe_reader.survey(files, **self._reading())

    def load(self, path: Path, animation: str | None = None) -> FileMotion:
        """Reads one file, or one of its animations. Raises `ValueError` with the reason if it cannot be used."""
        return file_motion(self.read(path, animation))

    def read(self, path: Path, animation: str | None = None) -> troupe_reader.Clip:
        """The same as the reader gives it, at the file's rate."""
        options: FileOptions = {"agreement": self._agreement, **self._reading(), "animation": animation}
        return troupe_reader.read(path, name=path.name, **options)

    def _reading(self) -> FileOptions:
        return {"unit": self.scale, **self._given} if self.scale is not None else self._given

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The skeleton with the usual offsets; its left axis points from the right hip to the left one."""
        offsets = offsets.copy()
        offsets[0] = 0.0
        left, right = _hips(names, parents)
        axis = offsets[left] - offsets[right]
        length = np.linalg.norm(axis)
        if length < 1e-6:  # hips without length stand where the pelvis does
            axis, length = _knees(names, parents, offsets, left, right)
        axis = np.round(axis / length, 3)
        found = [n for n in names if any(w in n.lower() for w in CONTACT_WORDS)]
        contact_names = self.contact_names if self.contact_names is not None else found
        unknown = [n for n in contact_names if n not in names]
        if unknown or not contact_names:
            raise ClipError(
                f"contact joints {unknown or '(none found by name)'} are not among {names}; set --contact-joints"
            )
        return skeleton_of(names, parents, offsets, 6, [float(v) for v in axis], contact_names, clips)


def _hips(names: list[str], parents: list[int]) -> tuple[int, int]:
    """The left and the right hip: two children of the root whose names differ in the side alone."""
    hips = [j for j, parent in enumerate(parents) if parent == 0]
    pairs = side_pairs([names[j] for j in hips])
    if not pairs:
        raise ClipError(
            f"cannot tell the left from the right hip among the children of the root {names[0]}: "
            f"{[names[j] for j in hips]}; {_advice(names, parents)}"
        )
    return hips[pairs[0][0]], hips[pairs[0][1]]


def _advice(names: list[str], parents: list[int]) -> str:
    """Which joints ``--root`` may name, if any has a left and a right child."""
    children = [[name for name, parent in zip(names, parents, strict=True) if parent == j] for j in range(len(names))]
    paired = [name for name, own in zip(names, children, strict=True) if side_pairs(own)]
    if not paired:
        return "no names of its joints differ in the side alone, as LeftUpLeg and RightUpLeg do: rename the hips"
    return f"--root decides; joints with a left and a right child: {', '.join(paired)}"


def _knees(
    names: list[str], parents: list[int], offsets: np.ndarray, left: int, right: int
) -> tuple[np.ndarray, np.floating[Any]]:
    """From the right to the left of the joints on the hips, and its length."""
    on = [next((j for j, parent in enumerate(parents) if parent == hip), None) for hip in (left, right)]
    if on[0] is not None and on[1] is not None:
        axis = offsets[on[0]] - offsets[on[1]]
        if (length := np.linalg.norm(axis)) >= 1e-6:
            return axis, length
    raise ClipError(f"{names[left]} and {names[right]} stand in one place at rest, so left and right are unclear")
