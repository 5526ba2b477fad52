"""A folder of a robot's CSV files as motion, with its URDF.

One frame a row: root x y z qx qy qz qw, then hinge angles; ROS axes, metres and radians.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from troupe_training.data.clips import Clip, FileMotion, mix, resample, resample_times, skeleton_of
from troupe_training.data.conventions import FPS
from troupe_training.data.skeleton import Skeleton
from troupe_training.robots.build import build_robot
from troupe_training.robots.robot import NATIVE_FROM_ROS, Robot, RobotError
from troupe_training.robots.urdf import read_urdf

MAX_BEYOND_LIMIT_RAD = 0.5
NOTED_BEYOND_LIMIT_RAD = 0.05
MIN_UPRIGHT_SHARE = 0.5
MAX_QUATERNION_ERROR = 0.02
LEFT_AXIS = [1.0, 0.0, 0.0]  # ROS's +Y


class RobotSource:
    """Reads CSV files of ``fps`` frames a second in the order of the URDF's hinges."""

    suffix = ".csv"

    def __init__(
        self, urdf: Path, end_effectors: Sequence[str] = (), contact_names: list[str] | None = None, fps: float = FPS
    ):
        self.fps = fps
        self.robot = build_robot(read_urdf(urdf), list(end_effectors), contact_names)
        self._options = {"urdf": str(urdf.resolve()), "end_effectors": list(end_effectors), "fps": fps}

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""
        return self._options | {"contact_joints": self.robot.contacts}

    def load(self, path: Path) -> FileMotion:
        """Reads one file. Raises `RobotError` with the column's name if it does not fit the robot."""
        robot = self.robot
        root_positions, root_rotations, angles = read_motion(path, robot)
        notes = self._limit_notes(angles)
        upright = (root_rotations[:, 1, 1] > 0).mean()
        if upright < MIN_UPRIGHT_SHARE:
            notes.append(
                f"the root stands upright in {upright:.0%} of the frames: is its quaternion x y z w, and Z up?"
            )
        times = resample_times(len(angles), self.fps)
        if times is not None:
            root_positions, root_rotations = resample(root_positions, root_rotations, self.fps)
            angles = mix(angles, times)
        positions, rotations = robot.world(root_positions, root_rotations, angles)
        return FileMotion(robot.names, robot.parents, robot.offsets, positions, rotations, notes)

    def _limit_notes(self, angles: np.ndarray) -> list[str]:
        notes = []
        for h, hinge in enumerate(self.robot.hinges):
            beyond = np.maximum(hinge.lower_rad - angles[:, h], angles[:, h] - hinge.upper_rad)
            column = f"column {8 + h} ({self.robot.names[hinge.joint]})"
            limits = f"its limits {hinge.lower_rad:.2f} to {hinge.upper_rad:.2f} rad"
            if len(beyond) and beyond.max() > MAX_BEYOND_LIMIT_RAD:
                frame = int(beyond.argmax())
                raise RobotError(
                    f"{column} is {angles[frame, h]:.2f} at frame {frame}, far beyond {limits}: "
                    "are the columns in the URDF's order and in radians?"
                )
            if (beyond > NOTED_BEYOND_LIMIT_RAD).any():
                share = (beyond > NOTED_BEYOND_LIMIT_RAD).mean()
                notes.append(f"{column} is up to {beyond.max():.2f} rad beyond {limits}, in {share:.1%} of frames")
        return notes

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The robot's skeleton with its hinges."""
        robot = self.robot
        skeleton = skeleton_of(names, parents, robot.offsets, 9, LEFT_AXIS, robot.contacts, clips)
        return replace(skeleton, robot=robot.table())


def read_motion(path: Path, robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Root positions ``[F, 3]`` and rotations ``[F, 3, 3]`` (native) and angles ``[F, H]`` of a CSV file.

    Raises `RobotError` with the row and the column's name.
    """
    columns, rows = robot.columns, []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
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
        raise RobotError(f"frame {row}: the root's quaternion (columns 4 to 7) has length {norm[row]:.3f}, not 1")
    ros = _rotations(values[:, 3:7] / norm[:, None])
    return values[:, :3] @ NATIVE_FROM_ROS.T, NATIVE_FROM_ROS @ ros @ NATIVE_FROM_ROS.T, values[:, 7:]


def _rotations(quat: np.ndarray) -> np.ndarray:
    """Unit quaternions (x, y, z, w) ``[F, 4]`` to ``[F, 3, 3]``; in numpy, because PyTorch may hang in a forked process."""
    x, y, z, w = quat.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _bad_word(words: list[str], columns: list[str]) -> str:
    for column, word in enumerate(words):
        try:
            float(word)
        except ValueError:
            return f"column {column + 1} ({columns[column]}) is {word.strip()[:40]!r}, not a number"
    return "not numbers"
