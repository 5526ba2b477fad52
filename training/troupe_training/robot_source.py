"""A folder of a robot's CSV files as motion, with its URDF."""

from pathlib import Path

import numpy as np

from troupe_training.clips import (
    CONTACT_MAX_SPEED_MPS,
    Clip,
    Motion,
    contact_thresholds,
    mix,
    resample,
    resample_times,
)
from troupe_training.config import FPS
from troupe_training.robot import RobotError, build_robot, read_motion
from troupe_training.skeleton import Skeleton
from troupe_training.urdf import read_urdf

MAX_BEYOND_LIMIT_RAD = 0.5
NOTED_BEYOND_LIMIT_RAD = 0.05
MIN_UPRIGHT_SHARE = 0.5
LEFT_AXIS = [1.0, 0.0, 0.0]  # ROS's +Y


class RobotSource:
    """Reads CSV files of ``fps`` frames a second in the order of the URDF's hinges."""

    suffix = ".csv"

    def __init__(
        self,
        urdf: Path,
        end_effectors: list[str] = (),
        contact_names: list[str] | None = None,
        fps: float = FPS,
    ):
        self.fps = fps
        self.robot = build_robot(read_urdf(urdf), list(end_effectors), contact_names)
        self._options = {"urdf": str(Path(urdf).resolve()), "end_effectors": list(end_effectors), "fps": fps}

    def options(self) -> dict:
        """What the result depends on besides the files, to tell caches apart."""
        return self._options | {"contact_joints": self.robot.contacts}

    def load(self, path: Path) -> Motion:
        """Reads one file. Raises `RobotError` with the column's name where it does not fit the robot."""
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
        return Motion(robot.names, robot.parents, robot.offsets, positions, rotations, notes)

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
                notes.append(
                    f"{column} is up to {beyond.max():.2f} rad beyond {limits}, in {share:.1%} of frames"
                )
        return notes

    def skeleton(
        self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]
    ) -> Skeleton:
        """The robot's skeleton with its hinges."""
        contacts = [names.index(n) for n in self.robot.contacts]
        clearance, max_height = contact_thresholds(clips, contacts)
        return Skeleton(
            names=names,
            parents=parents,
            offsets=[[round(float(v), 9) + 0.0 for v in o] for o in self.robot.offsets],
            left_axis=LEFT_AXIS,
            contact_joints=contacts,
            contact_max_height_m=max_height,
            contact_max_speed_mps=CONTACT_MAX_SPEED_MPS,
            contact_clearance_m=clearance,
            robot=self.robot.table(),
        )
