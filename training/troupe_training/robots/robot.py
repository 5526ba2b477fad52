"""A robot: joints, hinges and end effectors in the native axes (X left, Y up, Z forward), metres and radians."""

from dataclasses import dataclass, field

import numpy as np
import torch

from troupe_training.data.neutral import quaternion_matrix
from troupe_training.data.rotations import matrix_to_quat
from troupe_training.data.skeleton import HingeTable, MimicTable, RobotTable

NATIVE_FROM_ROS = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ROOT_COLUMNS = ["root x", "root y", "root z", "root qx", "root qy", "root qz", "root qw"]


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
    mimics: list[MimicTable] = field(default_factory=list)

    @property
    def columns(self) -> list[str]:
        """The meaning of each column of a motion file."""
        return ROOT_COLUMNS + [self.names[hinge.joint] for hinge in self.hinges]

    def world(
        self, root_positions: np.ndarray, root_rotations: np.ndarray, angles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """World positions ``[F, J, 3]`` and rotations ``[F, J, 3, 3]`` from native root poses and angles ``[F, H]``."""
        frames, count = len(angles), len(self.names)
        positions, rotations = np.zeros((frames, count, 3)), np.zeros((frames, count, 3, 3))
        positions[:, 0], rotations[:, 0] = root_positions, root_rotations
        turns = {hinge.joint: (hinge.rest, hinge.axis, angles[:, h]) for h, hinge in enumerate(self.hinges)}
        for mimic in self.mimics:
            followed = mimic["multiplier"] * turns[self.names.index(mimic["follows"])][2] + mimic["offset_rad"]
            rest = quaternion_matrix(np.array(mimic["rest"]))
            turns[self.names.index(mimic["joint"])] = rest, np.array(mimic["axis"]), followed
        for j in range(1, count):
            parent = self.parents[j]
            positions[:, j] = positions[:, parent] + rotations[:, parent] @ self.offsets[j]
            rotations[:, j] = rotations[:, parent]
            if j in turns:
                rest, axis, angle = turns[j]
                rotations[:, j] = rotations[:, j] @ rest @ about_axis(axis, angle)
        return positions, rotations

    def table(self) -> RobotTable:
        """The skeleton's ``robot``: the name and every hinge, in the order of the columns (MuJoCo's ``qpos``)."""
        hinges: list[HingeTable] = [
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
        table: RobotTable = {"name": self.name, "hinges": hinges}
        return table | {"mimics": self.mimics} if self.mimics else table


def about_axis(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotation matrices ``[F, 3, 3]`` about a unit axis (Rodrigues)."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sin * cross + (1 - cos) * (cross @ cross)


def _quaternion(matrix: np.ndarray) -> np.ndarray:
    return matrix_to_quat(torch.from_numpy(matrix)[None])[0].numpy()


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(v), 9) + 0.0 for v in values]
