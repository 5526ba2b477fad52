"""A folder of BVH files as motion: finds the pelvis, the unit and the sides, and brings every file to 30 fps."""

from pathlib import Path
from typing import Any

import numpy as np

from troupe_training.data.bvh import Bvh, BvhError, read_bvh
from troupe_training.data.clips import Clip, FileMotion, resample, skeleton_of
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import Skeleton

CONTACT_WORDS = ("foot", "toe", "ankle")


class BvhSource:
    """Reads BVH files; ``scale`` is metres per unit, from the pelvis height if left out."""

    suffix = ".bvh"

    def __init__(self, contact_names: list[str] | None = None, scale: float | None = None):
        self.contact_names = contact_names
        self.scale = scale

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""
        return {"contact_joints": self.contact_names, "scale": self.scale}

    def load(self, path: Path) -> FileMotion:
        """Parses one file. Raises `BvhError` with the reason if it cannot be used."""
        bvh = read_bvh(path)
        positions, rotations, local = bvh.world()
        first = _pelvis(bvh, local, rotations)
        positions, rotations, local = positions[:, first:], rotations[:, first:], local[:, first:]
        joints, scale = bvh.joints[first:], self.scale
        if scale is None:  # a pelvis more than ten units high can only be in centimetres
            scale = 0.01 if np.median(np.abs(positions[:, 0, 1])) > 10 else 1.0
        positions, local = positions * scale, local * scale
        if len(joints) > 1 and np.ptp(local[:, 1:], axis=0).max() > 1e-3:
            raise BvhError("bones change length over time")
        positions, rotations = resample(positions, rotations, 1.0 / bvh.frame_time)
        parents = [j.parent - first if j.parent >= first else -1 for j in joints]
        return FileMotion([j.name for j in joints], parents, local[0], positions, rotations)

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The skeleton with the usual offsets; its left axis points from the right hip to the left one."""
        offsets = offsets.copy()
        offsets[0] = 0.0
        left, right = _hips(names, parents)
        axis = offsets[left] - offsets[right]
        axis = np.round(axis / np.linalg.norm(axis), 3)
        found = [n for n in names if any(w in n.lower() for w in CONTACT_WORDS)]
        contact_names = self.contact_names if self.contact_names is not None else found
        unknown = [n for n in contact_names if n not in names]
        if unknown or not contact_names:
            raise BvhError(
                f"contact joints {unknown or '(none found by name)'} are not among {names}; set --contact-joints"
            )
        return skeleton_of(names, parents, offsets, 6, [float(v) for v in axis], contact_names, clips)


def _pelvis(bvh: Bvh, local_positions: np.ndarray, rotations: np.ndarray) -> int:
    """The joint that is the character's root: below joints (``joint_Root``) that only carry it, standing or moving.

    A joint carries its only child where the child has a position of its own and either the joint never moves or the
    child moves relative to it.
    """
    positions = {"Xposition", "Yposition", "Zposition"}
    joint = 0
    while sum(j.parent == joint for j in bvh.joints) == 1 and positions <= set(bvh.joints[joint + 1].channels):
        tolerance = 1e-3 * max(np.abs(local_positions).max(), 1e-9)
        still = max(np.ptp(v[:, joint], axis=0).max() for v in (local_positions, rotations)) < 1e-6
        carried = np.ptp(local_positions[:, joint + 1], axis=0).max() > tolerance
        if not (still or carried):
            break
        joint += 1
    return joint


def _hips(names: list[str], parents: list[int]) -> tuple[int, int]:
    """The left and the right hip: two children of the root whose names differ in the side alone."""
    hips = [j for j, parent in enumerate(parents) if parent == 0]
    pairs = side_pairs([names[j] for j in hips])
    if not pairs:
        raise BvhError(f"cannot tell the left from the right hip among {[names[j] for j in hips]}")
    return hips[pairs[0][0]], hips[pairs[0][1]]
