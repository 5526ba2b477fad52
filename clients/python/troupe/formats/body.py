"""What a file of joints leaves open: whether its unit and its up axis are the usual ones, seen by how a person stands.

The reader of the server finds both. This only finds that they are not as this package reads them.
"""

from __future__ import annotations

import numpy as np

from troupe import rotation
from troupe.arrays import F32, F64
from troupe.skeleton import Skeleton

_HEIGHT_BY_LENGTH = 1.24
"""Height of a body by the length of its bones from a foot to the head."""
_PEOPLE_M = (1.25, 2.15)
_FIGURES_M = (0.3, 4.0)
_OTHER_UNITS = {"m": 100.0, "ft": 30.48, "dm": 10.0, "cmu": 2.54 / 0.45, "in": 2.54, "mm": 0.1}
"""Other units that programs write, by the centimetres that they have."""
_MIN_RESTING = 0.9
_MIN_MOVING = 0.8
"""Share of the direction from the feet to the head that an axis must have to be seen as up: at rest, and over the motion."""
_MAX_OFF_REST, _MIN_JUMP, _MIN_JUMP_RATIO = np.radians(1), np.radians(15), 5


def odd(
    skeleton: Skeleton, fps: float, root: F32, rotations: F32, *, is_unit_given: bool, is_up_given: bool
) -> str | None:
    """Why frames are not what the file means, or nothing if that cannot be seen. Frames are read as centimetres, Y up."""
    if _begins_at_rest(rotations):
        return "its first frame is the rest pose, which is not of the motion"
    found = _feet_and_head(skeleton)
    if found is None:
        return None
    feet, head = found
    height = _HEIGHT_BY_LENGTH * _length(skeleton, feet[0], head)
    if not is_unit_given and not _PEOPLE_M[0] <= height <= _PEOPLE_M[1]:
        others = [unit for unit, cm in _OTHER_UNITS.items() if _PEOPLE_M[0] <= height * cm <= _PEOPLE_M[1]]
        if others or not _FIGURES_M[0] <= height <= _FIGURES_M[1]:
            guess = f" and {height * _OTHER_UNITS[others[0]]:.2f} m in {others[0]}" if others else ""
            return f"the person is {height:.2f} m tall in cm{guess}: units_per_metre decides"
    if is_up_given:
        return None
    rest = np.zeros((1, skeleton.joint_count, 4), np.float32)
    rest[..., 0] = 1
    resting, rest_share = _up(skeleton, root[:1], rest, feet, head)
    moving, share = _up(skeleton, root, rotations, feet, head)
    if share >= _MIN_MOVING:
        return None if moving == "y" else f"from feet to head is {moving} over the frames: up='y' reads it as it is"
    if rest_share >= _MIN_RESTING and resting != "y":
        return f"from feet to head is {resting} at rest: up='y' reads it as it is"
    return None


def _begins_at_rest(rotations: F32) -> bool:
    """Whether frame 0 is the rest pose, from which the motion jumps."""
    if len(rotations) < 3 or rotations.shape[1] < 4:
        return False
    identity = np.array([1, 0, 0, 0], np.float32)
    if rotation.angle_between(rotations[0, 1:], identity).max() > _MAX_OFF_REST:
        return False
    steps = rotation.angle_between(rotations[1:65, 1:], rotations[:64, 1:][: len(rotations) - 1]).max(axis=1)
    return bool(steps[0] >= _MIN_JUMP and steps[0] > _MIN_JUMP_RATIO * np.sort(steps[1:])[(len(steps) - 1) // 2])


def _feet_and_head(skeleton: Skeleton) -> tuple[list[int], int] | None:
    """Two feet and a head by their names; none if there are not as many."""
    names = [name.lower() for name in skeleton.names]

    def topmost(*words: str) -> list[int]:
        has = [any(word in name for word in words) for name in names]
        return [
            joint for joint, is_one in enumerate(has) if is_one and not any(has[a] for a in _above(skeleton, joint))
        ]

    feet, heads = topmost("foot", "ankle"), topmost("head") or topmost("neck")
    return (feet, heads[0]) if len(feet) == 2 and len(heads) == 1 else None


def _above(skeleton: Skeleton, joint: int) -> list[int]:
    above = []
    while (joint := skeleton.parents[joint]) >= 0:
        above.append(joint)
    return above


def _length(skeleton: Skeleton, foot: int, head: int) -> float:
    """Length of the bones from a foot to the hip and from the pelvis to the head, metres."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    above = _above(skeleton, head)
    leg = [joint for joint in (foot, *_above(skeleton, foot)) if joint not in above and lengths[joint] > 0]
    spine = [joint for joint in (head, *above) if joint not in _above(skeleton, foot)]
    # The topmost bone of a leg leads from the pelvis to the side.
    return float(lengths[leg[:-1] + spine].sum())


def _up(skeleton: Skeleton, root: F32, rotations: F32, feet: list[int], head: int) -> tuple[str, float]:
    """The axis from the feet to the head, and its share of that direction, over all frames."""
    world = skeleton.world(root, rotations)[0].astype(np.float64)
    upwards: F64 = world[:, head] - world[:, feet].mean(axis=1)
    mean = (upwards / np.maximum(np.linalg.norm(upwards, axis=1, keepdims=True), 1e-9)).mean(axis=0)
    axis = int(np.abs(mean).argmax())
    return ("-" if mean[axis] < 0 else "") + "xyz"[axis], float(np.abs(mean[axis]))
