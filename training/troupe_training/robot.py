"""Robots: a URDF's hinges as a skeleton, and motion as CSV, one frame a row: root x y z qx qy qz qw, then hinge angles.

Files are in ROS axes (X forward, Y left, Z up); everything that leaves this module is in the native ones (X left, Y up, Z
forward), metres and radians.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from troupe_training.rotations import matrix_to_quat
from troupe_training.sides import side_pairs
from troupe_training.urdf import Shape, Urdf, UrdfError, UrdfJoint

NATIVE_FROM_ROS = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ROS_UP, ROS_FORWARD = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
ROOT_COLUMNS = ["root x", "root y", "root z", "root qx", "root qy", "root qz", "root qw"]
# Points this near to the extreme one belong to the sole, to its front edge, to the end of a hand.
LAYER_M = 0.01
MIN_HAND_M = 0.01
UNLIMITED_RAD_PER_S = 1000.0  # for hinges whose URDF tells no speed
MAX_QUATERNION_ERROR = 0.02


class RobotError(ValueError):
    """Motion or options that do not fit the robot; the message names the column or joint."""


@dataclass
class Hinge:
    """One turning joint, in the native basis: world rotation = parent's * ``rest`` * rotation about ``axis``."""

    joint: int
    axis: np.ndarray  # [3], unit, in the joint's own frame
    rest: np.ndarray  # [3, 3], relative to the parent joint at angle 0
    lower_rad: float
    upper_rad: float
    max_speed_rad_per_s: float


@dataclass
class Robot:
    """A tree of joints, parents first: the floating root, the hinges in the order of the columns, the end effectors."""

    name: str
    names: list[str]
    parents: list[int]
    offsets: np.ndarray  # [J, 3], native, in the parent joint's frame
    hinges: list[Hinge]
    contacts: list[str]

    @property
    def columns(self) -> list[str]:
        """What each column of a motion file is."""
        return ROOT_COLUMNS + [self.names[hinge.joint] for hinge in self.hinges]

    def world(
        self, root_positions: np.ndarray, root_rotations: np.ndarray, angles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """World positions ``[F, J, 3]`` and rotations ``[F, J, 3, 3]`` from native root poses and angles ``[F, H]``."""
        frames, count = len(angles), len(self.names)
        positions, rotations = np.zeros((frames, count, 3)), np.zeros((frames, count, 3, 3))
        positions[:, 0], rotations[:, 0] = root_positions, root_rotations
        column = {hinge.joint: h for h, hinge in enumerate(self.hinges)}
        for j in range(1, count):
            parent = self.parents[j]
            positions[:, j] = positions[:, parent] + rotations[:, parent] @ self.offsets[j]
            rotations[:, j] = rotations[:, parent]
            if j in column:
                hinge = self.hinges[column[j]]
                turn = about_axis(hinge.axis, angles[:, column[j]])
                rotations[:, j] = rotations[:, j] @ hinge.rest @ turn
        return positions, rotations

    def hinge_angles(self, rotations: np.ndarray) -> np.ndarray:
        """Angles ``[F, H]`` whose turns are nearest to world rotations ``[F, J, 3, 3]``, moved by whole turns into the limits."""
        angles = np.zeros((len(rotations), len(self.hinges)))
        for h, hinge in enumerate(self.hinges):
            parent = rotations[:, self.parents[hinge.joint]] @ hinge.rest
            local = np.swapaxes(parent, -1, -2) @ rotations[:, hinge.joint]
            angles[:, h] = turn_about(hinge.axis, local)
            for turn in (2 * np.pi, -2 * np.pi):
                moved = angles[:, h] + turn
                fits = (moved >= hinge.lower_rad) & (moved <= hinge.upper_rad)
                outside = (angles[:, h] < hinge.lower_rad) | (angles[:, h] > hinge.upper_rad)
                angles[:, h] = np.where(outside & fits, moved, angles[:, h])
        return angles

    def table(self) -> dict:
        """The skeleton's ``robot``: the name and every hinge, in the order of the columns (MuJoCo's ``qpos``)."""
        hinges = [
            {
                "joint": self.names[hinge.joint],
                "axis": _rounded(hinge.axis),
                "rest": _rounded(_quaternion(hinge.rest)),
                "lower_rad": hinge.lower_rad,
                "upper_rad": hinge.upper_rad,
                "max_speed_rad_per_s": hinge.max_speed_rad_per_s,
            }
            for hinge in self.hinges
        ]
        return {"name": self.name, "hinges": hinges}


def about_axis(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotation matrices ``[F, 3, 3]`` about a unit axis (Rodrigues)."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sin * cross + (1 - cos) * (cross @ cross)


def turn_about(axis: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """The angle about ``axis`` whose rotation is nearest (least squares) to each of ``[F, 3, 3]``."""
    vee = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        -1,
    )
    along = np.einsum("i,fij,j->f", axis, rotations, axis)
    return np.arctan2(vee @ axis, np.trace(rotations, axis1=1, axis2=2) - along)


def _quaternion(matrix: np.ndarray) -> np.ndarray:
    return matrix_to_quat(torch.from_numpy(matrix)[None])[0].numpy()


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(v), 9) + 0.0 for v in values]


def build_robot(urdf: Urdf, end_effectors: list[str] = (), contacts: list[str] | None = None) -> Robot:
    """The robot of a URDF: fixed links become part of what carries them.

    ``end_effectors`` are ``NAME=JOINT:x,y,z`` (metres in the URDF frame of that joint's link); they add to or replace
    those found from the sole and the hands. ``contacts`` are the joints that touch the ground; the last joint of each leg
    and its toe where left out.
    """
    tree = _Tree(urdf)
    given = [_end_effector(text, tree.names) for text in end_effectors]
    names = [name for name, _, _ in given]
    effectors = [e for e in tree.found_effectors(names) if e[0] not in names] + given
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
                raise UrdfError(
                    f"joint {joint.name} is {joint.kind}; only revolute, continuous and fixed are read"
                )
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
        """Points on the link's collision shapes, or on the box of its inertia where it has no readable shape."""
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


def read_motion(path: Path, robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Root positions ``[F, 3]`` and rotations ``[F, 3, 3]`` (native) and angles ``[F, H]`` of a CSV file.

    Raises `RobotError` with the row and the column's name.
    """
    columns, rows = robot.columns, []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip():
            continue
        words = line.split(",")
        if len(words) != len(columns):
            raise RobotError(
                f"row {number}: {len(words)} columns, {robot.name} has {len(columns)}: the root's 7 and "
                f"{len(robot.hinges)} angles, {columns[7]} to {columns[-1]}"
            )
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise RobotError(f"row {number}: {_bad_word(words, columns)}") from None
    values = np.array(rows).reshape(-1, len(columns))
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise RobotError(f"frame {row}: column {column + 1} ({columns[column]}) is not finite")
    norm = np.linalg.norm(values[:, 3:7], axis=-1)
    off = np.abs(norm - 1) > MAX_QUATERNION_ERROR
    if off.any():
        row = int(np.argmax(off))
        raise RobotError(
            f"frame {row}: the root's quaternion (columns 4 to 7) has length {norm[row]:.3f}, not 1"
        )
    x, y, z, w = (values[:, 3:7] / norm[:, None]).T
    ros = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )
    return values[:, :3] @ NATIVE_FROM_ROS.T, NATIVE_FROM_ROS @ ros @ NATIVE_FROM_ROS.T, values[:, 7:]


def _bad_word(words: list[str], columns: list[str]) -> str:
    for column, word in enumerate(words):
        try:
            float(word)
        except ValueError:
            return f"column {column + 1} ({columns[column]}) is {word.strip()[:40]!r}, not a number"
    return "not numbers"
