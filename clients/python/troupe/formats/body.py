"""What a file of joints leaves open: up axis, unit, leading pose and left.

The reader of the server finds all of them. This finds whether they are as this package reads them, and refuses what it
cannot see with certainty.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from troupe import rotation
from troupe.arrays import F32, F64
from troupe.formats import names
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
_MAX_LEAN = np.radians(45)
"""Largest angle of legs and trunk from the vertical in a rest pose that is a stance."""
_STEADY_FLOOR, _UNSTEADY_FLOOR = 0.1, 0.2
"""The lowest joint's place varies by less along the axis that is up, by more along others, as a share of the body."""
_MAX_OFF_REST, _MIN_JUMP, _MIN_JUMP_RATIO = np.radians(1), np.radians(15), 5
_MAX_LOOKED_AT, _MAX_LOOKED_AT_FOR_LEFT = 256, 64
_MIN_WIDTH_M, _MIN_ALONG_X = 1e-3, 0.985
"""Least distance of a left joint from its counterpart, and the share of X from which left is exactly X."""
_BOTH = "up='y' and units_per_metre read it as it is"
_NEAR = 0.05
"""Farthest of a hand or foot from the end of a limb that the reader may hang it on, by the length of all bones."""
_FOOT = frozenset({"foot", "ankle"})
_ENDS = _FOOT | {"hand", "wrist"}


class UnclearError(ValueError):
    """A file does not show with certainty what it means, or means something else than this package reads."""


class _Body(NamedTuple):
    """Joints of a two-legged body, as indices."""

    pelvis: int
    legs: tuple[list[int], list[int]]
    """Left and right, from the hip to the foot."""
    spine: list[int]
    """From the pelvis to the head."""


def check(skeleton: Skeleton, rest: F64, root: F32, rotations: F32, *, is_unit_given: bool, is_up_given: bool) -> None:
    """Checks frames that were read as centimetres with Y up. `rest` has the file's offsets (joints, 3), metres.

    Raises:
        UnclearError: The reader of the server would make other frames of the file, or might.

    """
    if _begins_at_rest(rotations):
        raise UnclearError("its first frame is the rest pose, which is not of the motion")
    rest_world = _places(skeleton, rest)
    _check_ends(skeleton, rest_world)
    if is_unit_given and is_up_given:
        return
    body = _find(skeleton)
    length = _length(skeleton, body) if body else 0.0
    if body is None or length == 0:
        return
    if not is_unit_given:
        _check_unit(_HEIGHT_BY_LENGTH * length)
    if not is_up_given:
        _check_up(skeleton, body, length, rest_world, root, rotations)


def left_axis(skeleton: Skeleton, rotations: F32) -> tuple[float, float, float]:
    """Which way is left in the first joint's frame: the mean direction from a joint of the right to its counterpart.

    Raises:
        UnclearError: Joints have a side by their names, but none is found to be the counterpart of another.

    """
    pairs = [
        (left, skeleton.names.index(other))
        for left, name in enumerate(skeleton.names)
        if (other := names.mirrored(name)) in skeleton.names
    ]
    # Hips show it in the skeleton, if they are apart.
    for left, right in pairs:
        if skeleton.parents[left] == 0 and skeleton.parents[right] == 0:
            apart = skeleton.offsets[left].astype(np.float64) - skeleton.offsets[right]
            if (width := float(np.linalg.norm(apart))) > 0:
                return _axis(apart / width)
    pairs.sort(key=lambda pair: max(len(_line(skeleton, joint)) for joint in pair))
    some = rotations[:: -(-len(rotations) // _MAX_LOOKED_AT_FOR_LEFT)].copy()
    some[:, 0] = (1, 0, 0, 0)
    world = skeleton.world(np.zeros((len(some), 3), np.float32), some)[0].astype(np.float64)
    for left, right in pairs:
        apart = (world[:, left] - world[:, right]).mean(axis=0)
        if (width := float(np.linalg.norm(apart))) > _MIN_WIDTH_M:
            return (1.0, 0.0, 0.0) if apart[0] > _MIN_ALONG_X * width else _axis(apart / width)
    parsed = {names.parse(name) for name in skeleton.names}
    if any(name.side == "left" and name._replace(side="right") in parsed for name in parsed):
        raise UnclearError("its names do not show which joints are the left and the right of a pair")
    return (1.0, 0.0, 0.0)


def _axis(direction: F64) -> tuple[float, float, float]:
    x, y, z = direction.tolist()
    return x, y, z


def _begins_at_rest(rotations: F32) -> bool:
    """Whether frame 0 is the rest pose, from which the motion jumps."""
    if len(rotations) < 3 or rotations.shape[1] < 4:
        return False
    identity = np.array([1, 0, 0, 0], np.float32)
    if rotation.angle_between(rotations[0, 1:], identity).max() > _MAX_OFF_REST:
        return False
    steps = rotation.angle_between(rotations[1:65, 1:], rotations[:64, 1:][: len(rotations) - 1]).max(axis=1)
    return bool(steps[0] >= _MIN_JUMP and steps[0] > _MIN_JUMP_RATIO * np.sort(steps[1:])[(len(steps) - 1) // 2])


def _check_ends(skeleton: Skeleton, rest_world: F64) -> None:
    """Refuses hands and feet that the reader may hang on the limbs that they move with."""
    parsed = [names.parse(name) for name in skeleton.names]
    near = _NEAR * np.linalg.norm(skeleton.offsets[1:], axis=1).sum()
    limbs = [
        joint
        for joint in set(range(skeleton.joint_count)) - set(skeleton.parents)
        if not parsed[joint].has(names.STEERING)
    ]
    for joint, name in enumerate(parsed):
        parent = skeleton.parents[joint]
        is_loose = name.side and name.has(_ENDS) and not name.has(names.STEERING)
        if not is_loose or parent < 0 or parsed[parent].side:
            continue
        for end in limbs:
            is_far = np.linalg.norm(rest_world[end] - rest_world[joint]) > near
            if parsed[end].side == name.side and not is_far and joint not in _line(skeleton, end):
                raise UnclearError(f"{skeleton.names[joint]} may belong on {skeleton.names[end]}")


def _find(skeleton: Skeleton) -> _Body | None:
    """The body by its joints' names; none if no joint is a foot, or none a head."""
    parsed = [names.parse(name) for name in skeleton.names]
    written = [name.lower() for name in skeleton.names]

    def topmost(found: list[bool]) -> list[int]:
        return [
            joint
            for joint, is_one in enumerate(found)
            if is_one and not any(found[above] for above in _line(skeleton, joint)[1:])
        ]

    def seen(word: str) -> list[int]:
        return topmost([word in name for name in written])

    all_feet = topmost([any(word in name for word in _FOOT) for name in written])
    word = "head" if seen("head") else "neck"
    heads = seen(word)
    if not all_feet or not heads:
        return None
    feet = [
        topmost([name.side == side and name.has(_FOOT) and not name.has(names.HELPERS) for name in parsed])
        for side in ("left", "right")
    ]
    is_head = len(heads) == 1 and not parsed[heads[0]].side and word in parsed[heads[0]].words
    is_pair = [len(of) for of in feet] == [1, 1] and sorted([*feet[0], *feet[1]]) == all_feet
    if not is_pair or not is_head:
        listed = ", ".join(skeleton.names[joint] for joint in [*all_feet, *heads])
        raise UnclearError(f"which joints are its two feet and its {word} is not clear: {listed[:200]}; {_BOTH}")
    if parsed[heads[0]].has(names.HELPERS):
        raise UnclearError(f"{skeleton.names[heads[0]]} may be no {word}; {_BOTH}")
    left, right = (_line(skeleton, of[0]) for of in feet)
    pelvis = next((joint for joint in left if joint in right), -1)
    legs = tuple(line[: line.index(pelvis)][::-1] for line in (left, right))
    spine = _line(skeleton, heads[0])
    # A hip, a knee and an ankle.
    if pelvis not in spine or min(map(len, legs)) < 3:
        return None
    spine = spine[: spine.index(pelvis) + 1][::-1]
    return _Body(pelvis, (_from_hip(legs[0], parsed), _from_hip(legs[1], parsed)), spine)


def _from_hip(leg: list[int], parsed: list[names.Name]) -> list[int]:
    """A leg from the joint that turns the thigh on: that before the knee, which is before the foot."""
    bones = [joint for joint in leg[:-1] if not parsed[joint].has(names.HELPERS | {"end"})]
    hip = bones[-2] if len(bones) > 1 else (bones or leg)[0]
    return leg[leg.index(hip) :]


def _line(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all above it."""
    line = []
    while joint >= 0:
        line.append(joint)
        joint = skeleton.parents[joint]
    return line


def _length(skeleton: Skeleton, body: _Body) -> float:
    """Length of a leg from the hip to the foot, and of the spine from the pelvis to the head, metres."""
    lengths = np.linalg.norm(skeleton.offsets.astype(np.float64), axis=1)
    legs = sum(lengths[leg[1:]].sum() for leg in body.legs) / 2
    return float(legs + lengths[body.spine[1:]].sum())


def _check_unit(height: float) -> None:
    if _PEOPLE_M[0] <= height <= _PEOPLE_M[1]:
        return
    others = [unit for unit, cm in _OTHER_UNITS.items() if _PEOPLE_M[0] <= height * cm <= _PEOPLE_M[1]]
    if others or not _FIGURES_M[0] <= height <= _FIGURES_M[1]:
        guess = f" and {height * _OTHER_UNITS[others[0]]:.2f} m in {others[0]}" if others else ""
        raise UnclearError(f"the person is {height:.2f} m tall in cm{guess}: units_per_metre decides")


def _check_up(skeleton: Skeleton, body: _Body, length: float, rest_world: F64, root: F32, rotations: F32) -> None:
    step = -(-len(root) // _MAX_LOOKED_AT)
    world = skeleton.world(root[::step], rotations[::step])[0].astype(np.float64)
    moving, share = _nearest(_upwards(body, world).mean(axis=0))
    resting, rest_share = _nearest(_upwards(body, rest_world[None])[0])
    rests = rest_share >= _MIN_RESTING and _is_stance(body, rest_world)
    if share >= _MIN_MOVING and moving != "y":
        raise UnclearError(f"from feet to head is {moving} over the frames: up='y' reads it as it is")
    if not rests or resting == "y":
        return
    below = [joint for joint in range(skeleton.joint_count) if body.pelvis in _line(skeleton, joint)]
    low, high = world[:, below].min(axis=1), world[:, below].max(axis=1)
    axis = "xyz".index(resting[-1])
    along = (high if resting[0] == "-" else low)[:, axis].std() / length
    is_upright = along <= _STEADY_FLOOR and low[:, 1].std() / length >= _UNSTEADY_FLOOR
    if share < _MIN_MOVING or is_upright:
        raise UnclearError(f"from feet to head is {resting} at rest: up='y' reads it as it is")


def _places(skeleton: Skeleton, offsets: F64) -> F64:
    """World positions (joints, 3) of joints that are not turned."""
    places = np.zeros_like(offsets)
    for joint, parent in enumerate(skeleton.parents):
        places[joint] = offsets[joint] + (places[parent] if parent >= 0 else 0)
    return places


def _upwards(body: _Body, world: F64) -> F64:
    """Directions (frames, 3) from the feet to the head in world positions (frames, joints, 3)."""
    upwards: F64 = world[:, body.spine[-1]] - world[:, [leg[-1] for leg in body.legs]].mean(axis=1)
    directions: F64 = upwards / np.maximum(np.linalg.norm(upwards, axis=1, keepdims=True), 1e-9)
    return directions


def _nearest(direction: F64) -> tuple[str, float]:
    """The axis that a direction is nearest to, and its share of it."""
    axis = int(np.abs(direction).argmax())
    return ("-" if direction[axis] < 0 else "") + "xyz"[axis], float(np.abs(direction[axis]))


def _is_stance(body: _Body, places: F64) -> bool:
    """Whether the legs point down and the head is above the pelvis. The bones of many files all point along one axis at rest."""
    up = _upwards(body, places[None])[0]

    def points(start: int, end: int, along: F64) -> bool:
        bone = places[end] - places[start]
        return bool(bone @ along >= np.cos(_MAX_LEAN) * np.linalg.norm(bone))

    legs = all(points(leg[0], leg[-1], -up) for leg in body.legs)
    return legs and points(body.pelvis, body.spine[-1], up)
