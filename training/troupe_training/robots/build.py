"""The robot of a URDF: hinges in the order of a walk through its tree, toes and hands found in its shapes.

A URDF is in ROS axes (X forward, Y left, Z up); the robot is in the native ones.
"""

from collections.abc import Sequence

import numpy as np

from troupe_training.data.sides import side_pairs
from troupe_training.robots.robot import NATIVE_FROM_ROS, Hinge, Robot, RobotError
from troupe_training.robots.urdf import Shape, Urdf, UrdfError, UrdfJoint

ROS_UP, ROS_FORWARD = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
# Points this near to the extreme one belong to the sole, to its front edge, to the end of a hand.
LAYER_M = 0.01
MIN_HAND_M = 0.01
UNLIMITED_RAD_PER_S = 1000.0  # for hinges whose URDF gives no speed


def build_robot(urdf: Urdf, end_effectors: Sequence[str] = (), contacts: list[str] | None = None) -> Robot:
    """The robot of a URDF: fixed links become part of the link that carries them.

    ``end_effectors`` are ``NAME=JOINT:x,y,z`` (metres in the URDF frame of that joint's link); they add to or replace
    those found from the sole and the hands. ``contacts`` are the joints that touch the ground; the last joint of each leg
    and its toe if left out.
    """
    tree = _Tree(urdf)
    given = [_end_effector(text, tree.names) for text in end_effectors]
    names = [name for name, _, _ in given]
    effectors = tree.found_effectors(names) + given
    if contacts is None:
        contacts = []
        for leaf, side in tree.legs():
            contacts += [tree.names[leaf], f"{side}_toe"]
    for name, parent, offset in sorted(effectors, key=lambda e: _effector_order(e[0])):
        if name in tree.names:
            raise RobotError(f"--end-effector {name}: there is a joint of this name already")
        tree.names.append(name)
        tree.parents.append(parent)
        tree.offsets.append(offset)
    unknown = [name for name in contacts if name not in tree.names]
    if unknown:
        raise RobotError(f"contact joints {unknown} are not among {tree.names}")
    native = NATIVE_FROM_ROS
    hinges = [
        Hinge(
            j,
            native @ joint.axis,
            native @ rest @ native.T,
            joint.lower_rad,
            joint.upper_rad,
            joint.max_speed_rad_per_s or UNLIMITED_RAD_PER_S,
        )
        for j, (joint, rest) in tree.hinges.items()
    ]
    offsets = np.array(tree.offsets) @ native.T
    return Robot(urdf.name, tree.names, tree.parents, offsets, hinges, contacts)


def _effector_order(name: str) -> int:
    order = ["left_toe", "right_toe", "left_hand", "right_hand"]
    return order.index(name) if name in order else len(order)


def _end_effector(text: str, names: list[str]) -> tuple[str, int, np.ndarray]:
    name, _, rest = text.partition("=")
    parent, _, numbers = rest.partition(":")
    try:
        offset = np.array([float(v) for v in numbers.split(",")])
    except ValueError:
        offset = np.array([])
    if not name or offset.shape != (3,) or not np.isfinite(offset).all():
        raise RobotError(f"--end-effector {text}: expected NAME=JOINT:x,y,z")
    if parent not in names:
        raise RobotError(f"--end-effector {text}: there is no joint {parent!r}, only {names}")
    return name, names.index(parent), offset


class _Tree:
    """The joints that turn, depth first as MuJoCo orders them, still in ROS axes."""

    def __init__(self, urdf: Urdf):
        self.urdf = urdf
        root = urdf.root
        below = urdf.children(root)
        if len(below) == 1 and below[0].kind == "floating":
            root = below[0].child
        self.names, self.parents, self.offsets = [root], [-1], [np.zeros(3)]
        self.links = [root]
        self.hinges: dict[int, tuple[UrdfJoint, np.ndarray]] = {}
        self.zero_rotations, self.zero_positions = [np.eye(3)], [np.zeros(3)]
        self._walk(root, 0, np.zeros(3), np.eye(3))
        if not self.hinges:
            raise UrdfError("no joint turns")
        if len(set(self.names)) != len(self.names):
            raise UrdfError("two joints have the same name")

    def _walk(self, link: str, carrier: int, translation: np.ndarray, rotation: np.ndarray) -> None:
        for joint in self.urdf.children(link):
            offset = translation + rotation @ joint.translation
            rest = rotation @ joint.rotation
            if joint.kind == "fixed":
                self._walk(joint.child, carrier, offset, rest)
                continue
            if joint.kind not in ("revolute", "continuous"):
                raise UrdfError(f"joint {joint.name} is {joint.kind}; only revolute, continuous and fixed are read")
            index = len(self.names)
            self.names.append(joint.name.removesuffix("_joint"))
            self.parents.append(carrier)
            self.offsets.append(offset)
            self.links.append(joint.child)
            self.hinges[index] = (joint, rest)
            turned = self.zero_rotations[carrier]
            self.zero_rotations.append(turned @ rest)
            self.zero_positions.append(self.zero_positions[carrier] + turned @ offset)
            self._walk(joint.child, index, np.zeros(3), np.eye(3))

    def _limbs(self) -> list[tuple[int, int]]:
        """Pairs (left, right) of hinges that carry no further hinge."""
        pairs = side_pairs(self.names)
        return [p for p in pairs if not any(j in self.parents for j in p)]

    def legs(self) -> list[tuple[int, str]]:
        """The last hinge of each leg with its side: the pair of limbs that ends lowest at angle 0."""
        limbs = self._limbs()
        if not limbs:
            raise RobotError("no limbs are named left and right; give --end-effector and --contact-joints")
        left, right = min(limbs, key=lambda pair: self.zero_positions[pair[0]][2])
        return [(left, "left"), (right, "right")]

    def found_effectors(self, given: list[str]) -> list[tuple[str, int, np.ndarray]]:
        """Toes and hands of the limbs, without those in ``given``."""
        found, legs = [], self.legs()
        for leaf, side in legs:
            if f"{side}_toe" not in given:
                found.append((f"{side}_toe", leaf, self._toe(leaf, f"{side}_toe")))
        arms = [pair for pair in self._limbs() if pair[0] != legs[0][0]]
        for pair in arms:
            for leaf, side in zip(pair, ("left", "right"), strict=True):
                name = f"{side}_hand" if len(arms) == 1 else f"{self.names[leaf]}_end"
                if name not in given:
                    found.append((name, leaf, self._hand(leaf, name)))
        return found

    def _points(self, leaf: int, name: str, down: np.ndarray) -> np.ndarray:
        """Points on the link's collision shapes, or on the box of its inertia if it has no readable shape."""
        link = self.urdf.links[self.links[leaf]]
        shapes: list[Shape] = link.shapes or [s for s in (link.inertia_box,) if s is not None]
        if not shapes:
            raise RobotError(
                f"link {link.name} has no collision shape that can be read and no inertia; "
                f"give --end-effector {name}={self.names[leaf]}:x,y,z"
            )
        return np.concatenate([shape.surface(down) for shape in shapes])

    def _toe(self, leaf: int, name: str) -> np.ndarray:
        """The middle of the sole's front edge, in the leaf's frame: the sole is what is lowest at angle 0."""
        down, forward = (self.zero_rotations[leaf].T @ v for v in (-ROS_UP, ROS_FORWARD))
        points = self._points(leaf, name, down)
        depth = points @ down
        sole = points[depth > depth.max() - LAYER_M]
        ahead = sole @ forward
        front = sole[ahead > ahead.max() - LAYER_M]
        across = np.cross(down, forward)
        middle = (np.min(front @ across) + np.max(front @ across)) / 2
        return ahead.max() * forward + depth.max() * down + middle * across

    def _hand(self, leaf: int, name: str) -> np.ndarray:
        """The farthest link fixed to the last one; without any, the far end of that link's shape."""
        fixed = self._fixed(self.links[leaf], np.zeros(3), np.eye(3))
        if fixed:
            return max(fixed, key=np.linalg.norm)
        points = self._points(leaf, name, -ROS_UP)
        middle = (points.min(0) + points.max(0)) / 2
        axis = np.zeros(3)
        axis[np.argmax(np.abs(middle))] = np.sign(middle[np.argmax(np.abs(middle))])
        reach = points @ axis
        return points[reach > reach.max() - LAYER_M].mean(0)

    def _fixed(self, link: str, translation: np.ndarray, rotation: np.ndarray) -> list[np.ndarray]:
        found = []
        for joint in self.urdf.children(link):
            offset = translation + rotation @ joint.translation
            if np.linalg.norm(offset) > MIN_HAND_M:
                found.append(offset)
            found += self._fixed(joint.child, offset, rotation @ joint.rotation)
        return found
