"""Skeletons and robots: what frames are of, and where their joints are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from troupe import rotation
from troupe.arrays import F32, Ints
from troupe.conventions import Convention

ROOT_QPOS = 7
"""Numbers of a `qpos` before the angles: the root's place and rotation."""
LIMIT_TOLERANCE_RAD = 1e-4
"""An angle that is no farther outside of its limits is within them but for rounding."""


@dataclass(frozen=True)
class Hinge:
    """A joint that turns about one axis: relative to its parent by `rest`, then by its angle about `axis`. Native axes."""

    joint: str
    index: int
    """The joint's index in the skeleton."""
    axis: tuple[float, float, float]
    rest: tuple[float, float, float, float]
    lower: float
    """Smallest angle, radians."""
    upper: float
    """Largest angle, radians."""
    max_speed: float
    """Radians a second. Frames may be faster, and then say so."""
    max_acceleration: float | None = None
    """Radians per second squared. None: no limit is known."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows a hinge: its angle is `multiplier` times that of the hinge, and `offset`. Native axes."""

    joint: str
    index: int
    """The joint's index in the skeleton."""
    hinge: int
    """Index of the hinge in the robot."""
    multiplier: float
    offset: float
    """Radians."""
    axis: tuple[float, float, float]
    rest: tuple[float, float, float, float]

    def turned(self, angles: F32) -> F32:
        """Its rotations (..., 4) relative to its parent at the hinges' angles (..., hinges)."""
        angle = self.multiplier * angles[..., self.hinge] + self.offset
        axis, rest = np.array(self.axis, np.float32), np.array(self.rest, np.float32)
        return rotation.multiply(rest, rotation.about_axis(axis, angle))


@dataclass(frozen=True)
class Robot:
    """The hinges of a skeleton, in the order of MuJoCo's `qpos`. Joints without one follow one, or their parents."""

    name: str
    hinges: tuple[Hinge, ...]
    mimics: tuple[Mimic, ...] = ()

    @property
    def qpos_size(self) -> int:
        """Numbers of a `qpos`: 7 of the root and one for each hinge."""
        return ROOT_QPOS + len(self.hinges)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints, parents before children.

    Offsets are in the parent's frame, in metres and native axes (X left, Y up, Z forward).
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    """Index of each joint's parent; -1 of the first."""
    offsets: F32 = field(repr=False)
    """(joints, 3)."""
    contact_joints: tuple[str, ...] = ()
    left_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Which way is left for the character, in the first joint's own frame."""
    robot: Robot | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Skeleton):
            return NotImplemented
        return self._identity() == other._identity() and np.array_equal(self.offsets, other.offsets)

    def __hash__(self) -> int:
        return hash(self._identity())

    def _identity(self) -> tuple[object, ...]:
        return self.names, self.parents, self.contact_joints, self.left_axis, self.robot

    @property
    def joint_count(self) -> int:
        """How many joints there are."""
        return len(self.names)

    @cached_property
    def _levels(self) -> list[tuple[Ints, Ints]]:
        """Joints and their parents, all of one depth together, from the root outwards."""
        depths = np.zeros(self.joint_count, np.int64)
        for joint, parent in enumerate(self.parents):
            depths[joint] = 0 if parent < 0 else depths[parent] + 1
        parents = np.array(self.parents)
        levels = [np.flatnonzero(depths == depth) for depth in range(1, int(depths.max(initial=0)) + 1)]
        return [(joints, parents[joints]) for joints in levels]

    def children(self, joint: int) -> list[int]:
        """Indices of the joints that hang from a joint."""
        return [child for child, parent in enumerate(self.parents) if parent == joint]

    def world(self, root: F32, rotations: F32, convention: Convention = Convention.NATIVE) -> tuple[F32, F32]:
        """World positions (..., joints, 3) and rotations (..., joints, 4) of all joints of all frames at once.

        `root` is (..., 3) and `rotations` (..., joints, 4), as frames have them; both in the convention.
        """
        offsets = convention.position_from_native(self.offsets)
        positions = np.empty((*rotations.shape[:-1], 3), np.float32)
        turned = np.empty(rotations.shape, np.float32)
        positions[..., 0, :] = root
        turned[..., 0, :] = rotations[..., 0, :]
        for joints, parents in self._levels:
            above = turned[..., parents, :]
            positions[..., joints, :] = positions[..., parents, :] + rotation.rotate(above, offsets[joints])
            turned[..., joints, :] = rotation.multiply(above, rotations[..., joints, :])
        return positions, turned

    def fit(self, rotations: F32) -> tuple[F32, F32]:
        """Brings native poses onto a robot's hinges and within their limits: rotations, and angles (..., hinges).

        From the root outwards each hinge turns as near as it can to where the pose has its joint in the world.
        """
        robot = self.robot
        if robot is None:
            raise ValueError("the skeleton has no hinges")
        hinges = {hinge.index: nth for nth, hinge in enumerate(robot.hinges)}
        mimics = {mimic.index: mimic for mimic in robot.mimics}
        made = np.empty_like(rotations)
        made[..., 0, :] = rotations[..., 0, :]
        angles = np.zeros((*rotations.shape[:-2], len(robot.hinges)), np.float32)
        lacking = np.zeros_like(rotations)
        lacking[..., 0, 0] = 1
        for joint, parent in enumerate(self.parents[1:], 1):
            wanted = rotation.normalise(rotation.multiply(lacking[..., parent, :], rotations[..., joint, :]))
            nth = hinges.get(joint)
            if joint in mimics:
                made[..., joint, :] = mimics[joint].turned(angles)
            elif nth is None:
                made[..., joint, :] = (1, 0, 0, 0)
            else:
                angles[..., nth], made[..., joint, :] = _turn(robot.hinges[nth], wanted)
            lacking[..., joint, :] = rotation.multiply(rotation.conjugate(made[..., joint, :]), wanted)
        return made, angles

    def pose(self, root: F32, angles: F32) -> F32:
        """The native poses (..., joints, 4) of a robot's root rotations (..., 4) and angles (..., hinges)."""
        rotations = np.zeros((*angles.shape[:-1], self.joint_count, 4), np.float32)
        rotations[..., 0] = 1
        rotations[..., 0, :] = root
        hinges: Sequence[Hinge] = self.robot.hinges if self.robot else ()
        if hinges:
            axes = np.array([hinge.axis for hinge in hinges], np.float32)
            rests = np.array([hinge.rest for hinge in hinges], np.float32)
            rotations[..., [hinge.index for hinge in hinges], :] = rotation.multiply(
                rests, rotation.about_axis(axes, angles)
            )
        for mimic in self.robot.mimics if self.robot else ():
            rotations[..., mimic.index, :] = mimic.turned(angles)
        return rotations

    def to_qpos(self, root: F32, rotations: F32) -> F32:
        """MuJoCo's `qpos` (..., qpos_size) of native frames, on the hinges and within their limits."""
        _, angles = self.fit(rotations)
        place = Convention.ROS.position_from_native(root)
        turned = Convention.ROS.rotation_from_native(rotations[..., 0, :])
        return np.concatenate([place, turned, angles], axis=-1)

    def of_qpos(self, qpos: F32) -> tuple[F32, F32]:
        """Native roots (..., 3) and rotations (..., joints, 4) of MuJoCo's `qpos`."""
        root = Convention.ROS.position_to_native(qpos[..., :3])
        turned = Convention.ROS.rotation_to_native(qpos[..., 3:ROOT_QPOS])
        return root, self.pose(turned, qpos[..., ROOT_QPOS:])


def _turn(hinge: Hinge, wanted: F32) -> tuple[F32, F32]:
    """The angles within the limits at which a hinge comes nearest to rotations, and its rotations there."""
    axis, rest = np.array(hinge.axis, np.float32), np.array(hinge.rest, np.float32)
    turn = rotation.multiply(rotation.conjugate(rest), wanted)
    angle = 2 * np.arctan2(turn[..., 1:] @ axis, turn[..., 0])
    middle = 0.5 * (hinge.lower + hinge.upper)
    angle = middle + (angle - middle + np.pi) % (2 * np.pi) - np.pi
    limited = np.clip(angle, hinge.lower, hinge.upper).astype(np.float32)
    return limited, rotation.multiply(rest, rotation.about_axis(axis, limited))
