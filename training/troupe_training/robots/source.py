"""A folder of a robot's files as motion, with its URDF or MJCF."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import troupe_reader
from troupe_reader.options import FileOptions
from troupe_training.data.clips import Clip, FileMotion, skeleton_of
from troupe_training.data.conventions import FPS
from troupe_training.data.reader import file_motion
from troupe_training.data.skeleton import Skeleton
from troupe_training.robots.build import build_robot, describe

LEFT_AXIS = [1.0, 0.0, 0.0]  # ROS's +Y


class RobotSource:
    """Reads a robot's files. CSV and ``.npy`` have ``fps`` frames a second, 30 if left out."""

    endings = troupe_reader.ROBOT_ENDINGS

    def __init__(
        self,
        urdf: Path,
        end_effectors: Sequence[str] = (),
        contact_names: list[str] | None = None,
        fps: float | None = None,
        given: FileOptions | None = None,
        legs: Sequence[str] = (),
    ):
        self.fps = fps
        self._given: FileOptions = given or {}
        self._urdf, self._end_effectors, self._legs = urdf, list(end_effectors), list(legs)
        description = describe(urdf, self._end_effectors, self._legs)
        self._read: troupe_reader.Skeleton | None = description.skeleton
        self.robot = build_robot(description, contact_names)

    def __getstate__(self) -> dict[str, Any]:
        """For another process, which reads the description again."""
        return self.__dict__ | {"_read": None}

    @property
    def joints(self) -> troupe_reader.Skeleton:
        """The robot's joints and hinges as its description has them."""
        if self._read is None:
            self._read = describe(self._urdf, self._end_effectors, self._legs).skeleton
        return self._read

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""
        about = {"urdf": str(self._urdf.resolve()), "end_effectors": self._end_effectors, "fps": self.fps or FPS}
        legs = {"legs": self._legs} if self._legs else {}
        return about | {"contact_joints": self.robot.contacts, **legs, **self._given}

    def survey(self, files: Sequence[Path]) -> None:
        """Nothing: a robot's files leave nothing open that other files could decide."""

    def load(self, path: Path, animation: str | None = None) -> FileMotion:
        """Reads one file. Raises `ValueError` with the frame and the joint if it does not fit the robot."""
        options: FileOptions = {**self._given, "skeleton": self.joints, "fps": self.fps}
        return file_motion(troupe_reader.read(path, name=path.name, **options))

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The robot's skeleton with its hinges."""
        robot = self.robot
        skeleton = skeleton_of(names, parents, robot.offsets, 9, LEFT_AXIS, robot.contacts, clips)
        return replace(skeleton, robot=robot.table())
