"""Left-right mirroring of motion: the training data twice, once as seen in a mirror.

In the mirror x becomes -x (``WORLD``), and what the left arm did the right arm does. A joint's own axes on the other side
are no mere copies with other signs, so each joint j has a matrix S_j of determinant -1 that takes its partner's axes to the
mirror image of its own: R'_partner = WORLD * R_j * S_j. The motion's positions are mirrored exactly if every bone is:
offset_partner(k) = S_parent(k)^T * offset_k. Robots give S by their pose at angle 0; for other skeletons S is the signed
permutation of axes that mirrors the bones and under which the left side's average pose is the right side's.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import torch

from troupe_training.data.clips import Clip, with_suffix
from troupe_training.data.rotations import columns_to_matrix, quat_to_matrix
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import HingeTable, MimicTable, RobotTable, Skeleton

WORLD = np.diag([-1.0, 1.0, 1.0])
MAX_BONE_ERROR_M = 0.005
MAX_AXIS_ERROR = 0.01
MAX_POSE_ERROR_DEG = 60.0
MAX_LIMIT_ERROR_RAD = 0.02
SNAP = 0.05


class MirrorError(ValueError):
    """A skeleton that cannot be mirrored; the message names the joints."""


@dataclass
class Mirror:
    """The mirroring of one skeleton: each joint's partner (itself in the middle) and its matrix S ``[J, 3, 3]``."""

    skeleton: Skeleton
    partners: list[int]
    local: np.ndarray
    notes: list[str]

    def rotations(self, rotations: np.ndarray) -> np.ndarray:
        """World rotations ``[F, J, 3, 3]`` as seen in the mirror."""
        seen = np.empty_like(rotations)
        seen[:, self.partners] = WORLD @ rotations @ self.local
        return seen

    def clip(self, clip: Clip) -> Clip:
        """The clip in the mirror; its positions follow from its rotations with the skeleton's own bones."""
        seen = self.rotations(columns_to_matrix(clip.six_d))
        root = clip.positions[:, 0].astype(np.float64) @ WORLD
        return Clip(
            with_suffix(clip.name, "_M"),
            clip.file,
            clip.first_frame,
            self.skeleton.forward_kinematics(root, seen).astype(np.float32),
            np.concatenate([seen[..., 0], seen[..., 1]], -1).astype(np.float32),
            mirrored=True,
        )


def mirror_of(skeleton: Skeleton, clips: list[Clip]) -> Mirror:
    """The mirroring of a skeleton; ``clips`` tell the average pose if there are no hinges to go by.

    Raises `MirrorError` with every joint that has no mirror image.
    """
    partners = _partners(skeleton)
    notes: list[str] = []
    if skeleton.robot is not None:
        local, notes = _robot_axes(skeleton, skeleton.robot, partners)
    else:
        local = _average_axes(skeleton, partners, clips)
    errors = [
        f"{skeleton.names[k]} is {1000 * error:.0f} mm off the mirror image of {skeleton.names[partners[k]]}"
        for k, error in enumerate(_bone_errors(skeleton, partners, local))
        if error > MAX_BONE_ERROR_M
    ]
    if errors:
        raise MirrorError("the skeleton cannot be mirrored: " + "; ".join(errors))
    return Mirror(skeleton, partners, local, notes)


def _partners(skeleton: Skeleton) -> list[int]:
    names, parents = skeleton.names, skeleton.parents
    partners = list(range(len(names)))
    for left, right in side_pairs(names):
        partners[left], partners[right] = right, left
    if all(j == partner for j, partner in enumerate(partners)):
        raise MirrorError(f"the skeleton cannot be mirrored: no names tell left from right among {names}")
    odd = [names[j] for j, p in enumerate(parents) if p >= 0 and parents[partners[j]] != partners[p]]
    if odd:
        raise MirrorError(f"the skeleton cannot be mirrored: {odd} hang on another joint than their partners do")
    return partners


def _root_axes(skeleton: Skeleton) -> np.ndarray:
    """The root's S: the reflection along its left axis, along a coordinate axis if that is near."""
    left = np.array(skeleton.left_axis) / np.linalg.norm(skeleton.left_axis)
    if np.abs(left - np.round(left)).max() < SNAP:
        left = np.round(left)
    return np.eye(3) - 2 * np.outer(left, left)


def _bone_errors(skeleton: Skeleton, partners: list[int], local: np.ndarray) -> list[float]:
    """How far each joint's offset is from the mirror image of its partner's, metres.

    A hinge may stand anywhere along its own axis: that moves nothing but the offsets of the joints on it.
    """
    offsets, errors = np.array(skeleton.offsets), [0.0]
    turning = _turning(skeleton, skeleton.robot) if skeleton.robot is not None else {}
    axes = {joint: (np.array(table["axis"]), _rest(table)) for joint, table in turning.items()}
    along = np.zeros((skeleton.joint_count, 3))  # from the mirror image of each joint's place, in its own axes
    for k in range(1, skeleton.joint_count):
        parent = skeleton.parents[k]
        off = offsets[partners[k]] - local[parent].T @ offsets[k] + along[parent]
        if partners[k] in axes:
            axis, rest = axes[partners[k]]
            along[k] = (off @ rest @ axis) * axis
            off = off - rest @ along[k]
        errors.append(float(np.linalg.norm(off)))
    return errors


def _turning(skeleton: Skeleton, robot: RobotTable) -> dict[int, HingeTable | MimicTable]:
    """The joints that turn about an axis, with the tables that say so."""
    tables: list[HingeTable | MimicTable] = [*robot["hinges"], *robot.get("mimics", [])]
    return {skeleton.names.index(table["joint"]): table for table in tables}


def _rest(table: HingeTable | MimicTable) -> np.ndarray:
    """The rotation of a joint relative to its parent at angle 0."""
    matrix: np.ndarray = quat_to_matrix(torch.tensor(table["rest"], dtype=torch.float64)).numpy()
    return matrix


def _robot_axes(skeleton: Skeleton, robot: RobotTable, partners: list[int]) -> tuple[np.ndarray, list[str]]:
    """S of every joint from the pose at angle 0; the joints' axes must be each other's mirror images."""
    turning = _turning(skeleton, robot)
    hinges = {skeleton.names.index(hinge["joint"]): hinge for hinge in robot["hinges"]}
    mimics = {skeleton.names.index(mimic["joint"]): mimic for mimic in robot.get("mimics", [])}
    local = np.tile(_root_axes(skeleton), (skeleton.joint_count, 1, 1))
    signs: dict[int, int] = {}  # of the mirrored angles
    errors, notes = [], []
    for j in range(1, skeleton.joint_count):
        partner, name = partners[j], skeleton.names[j]
        local[j] = local[skeleton.parents[j]]
        if j not in turning:
            continue
        if partner not in turning or (j in mimics) != (partner in mimics):
            how = "follows another joint" if j in mimics else "turns by itself"
            errors.append(f"{name} {how}, {skeleton.names[partner]} does not")
            continue
        table, other = turning[j], turning[partner]
        local[j] = _rest(table).T @ local[j] @ _rest(other)
        seen, axis = local[j].T @ np.array(table["axis"]), np.array(other["axis"])
        sign = signs[j] = -1 if seen @ axis > 0 else 1
        if np.linalg.norm(seen + sign * axis) > MAX_AXIS_ERROR:
            errors.append(f"the axis of {name} is not the mirror image of {skeleton.names[partner]}'s")
        if j in mimics:
            leader = skeleton.names.index(mimics[j]["follows"])
            if not _follow_alike(skeleton, mimics[j], mimics[partner], (sign, signs.get(leader, 1)), partners[leader]):
                errors.append(f"{name} does not follow as the mirror image of {skeleton.names[partner]} does")
            continue
        limits = sorted((sign * hinges[j]["lower_rad"], sign * hinges[j]["upper_rad"]))
        wanted = [hinges[partner]["lower_rad"], hinges[partner]["upper_rad"]]
        if np.abs(np.array(limits) - wanted).max() > MAX_LIMIT_ERROR_RAD:
            notes.append(f"the limits of {name} are not the mirror image of {skeleton.names[partner]}'s")
    if errors:
        raise MirrorError("the robot cannot be mirrored: " + "; ".join(errors))
    return local, notes


def _follow_alike(
    skeleton: Skeleton, mimic: MimicTable, other: MimicTable, signs: tuple[int, int], leader: int
) -> bool:
    """Whether ``other`` follows the joint ``leader`` as the mirror image of ``mimic`` does.

    ``signs`` are those of the mirrored angles of ``mimic`` and of the joint that it follows.
    """
    own, led = signs
    return (
        skeleton.names[leader] == other["follows"]
        and abs(own * led * mimic["multiplier"] - other["multiplier"]) < MAX_LIMIT_ERROR_RAD
        and abs(own * mimic["offset_rad"] - other["offset_rad"]) < MAX_LIMIT_ERROR_RAD
    )


def _average_axes(skeleton: Skeleton, partners: list[int], clips: list[Clip]) -> np.ndarray:
    """S of every joint: of the candidates that mirror its bones, the one under which the average poses fit best."""
    averages = _average_locals(skeleton, clips)
    offsets = np.array(skeleton.offsets)
    local = np.tile(_root_axes(skeleton), (skeleton.joint_count, 1, 1))
    candidates = [*_reflections(), local[0]]
    errors = []
    for j in range(1, skeleton.joint_count):
        partner, parent = partners[j], skeleton.parents[j]
        if partner < j:
            local[j] = local[partner].T
            continue
        children = [k for k, p in enumerate(skeleton.parents) if p == j]
        fitting = []
        for s in candidates:
            bones = [np.linalg.norm(offsets[partners[k]] - s.T @ offsets[k]) for k in children]
            if max(bones, default=0.0) > MAX_BONE_ERROR_M or (partner == j and not np.allclose(s, s.T)):
                continue
            fitting.append((_angle_deg(local[parent].T @ averages[j] @ s, averages[partner]), s))
        name, other = skeleton.names[j], skeleton.names[partner]
        if not fitting:
            errors.append(f"the bones below {name} are not the mirror image of those below {other}")
            continue
        angle, local[j] = min(fitting, key=lambda fit: fit[0])
        if angle > MAX_POSE_ERROR_DEG:
            single = [skeleton.names[k] for k in children if partners[k] == k]
            errors.append(
                f"the average pose of {name} is {angle:.0f}° off the mirror image of {other}'s"
                + (f"; below it {single} have no partner" if single else "")
            )
    if errors:
        raise MirrorError("the skeleton cannot be mirrored: " + "; ".join(errors))
    return local


def _reflections() -> list[np.ndarray]:
    """The signed permutations of axes with determinant -1."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.diag(signs)[list(order)]
            if np.linalg.det(matrix) < 0:
                found.append(matrix)
    return found


def _average_locals(skeleton: Skeleton, clips: list[Clip]) -> np.ndarray:
    """Average rotation ``[J, 3, 3]`` of each joint relative to its parent."""
    total = np.zeros((skeleton.joint_count, 3, 3))
    parents = [max(p, 0) for p in skeleton.parents]
    for clip in clips:
        world = columns_to_matrix(clip.six_d)
        total += (np.swapaxes(world[:, parents], -1, -2) @ world).sum(0)
    u, _, v = np.linalg.svd(total)
    u[..., -1] *= np.linalg.det(u @ v)[..., None]
    return u @ v


def _angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    """Angle of the rotation between two."""
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1.0, 1.0))))
