"""The compiled part, from `bindings/python/src`."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, TypeAlias, Unpack, final

import numpy as np
import numpy.typing as npt

from troupe_reader.options import Choice, FileOptions, Parts, RetargetFigures

Array: TypeAlias = npt.NDArray[np.float32]
Body: TypeAlias = "Figure | Clip | Skeleton | RobotDescription | str | PathLike[str]"
"""A body by itself, by its motion, or by its file."""
PartsSource: TypeAlias = Parts | str | PathLike[str]
"""Parts of a body, or the path of a TOML file of them."""

ENDINGS: tuple[str, ...]
"""Endings of files of joints, which may leave their up axis and unit open: `.bvh` and others, in small letters."""
ROBOT_ENDINGS: tuple[str, ...]
"""Endings of robots' files, which leave nothing open."""

class ReadError(ValueError):
    """A file that cannot be read: the message names the file, the place in it and the option that decides."""

    options: Sequence[Choice]
    """The options that decide, as the message names them; empty if no option helps."""

class RetargetError(ValueError):
    """Motion that cannot be carried over: the message names the joint or the pose, and what is allowed."""

@final
class Skeleton:
    """Joints with parents and offsets. Parents come before children; joint 0 is the root."""

    def __new__(
        cls,
        names: Sequence[str],
        parents: Sequence[int],
        offsets: npt.ArrayLike,
        *,
        left_axis: Sequence[float] = (1.0, 0.0, 0.0),
        ground_y_m: float = 0.0,
    ) -> Skeleton:
        """A skeleton without contact joints and hinges. Raises `ValueError` with the joint or field."""

    @staticmethod
    def of_tables(skeleton: Mapping[str, Any], robot: Mapping[str, Any] | None = None) -> Skeleton:
        """A skeleton of the tables `[skeleton]` and `[robot]` of a `pack.toml`. Raises `ValueError` with the field."""

    @property
    def names(self) -> list[str]: ...
    @property
    def parents(self) -> list[int]:
        """Index of each joint's parent, -1 for the root."""

    @property
    def offsets(self) -> Array:
        """`[joints, 3]`: places in the parents at rest, metres."""

    @property
    def left_axis(self) -> list[float]:
        """Direction of the character's left in the root's own frame of reference, unit length."""

    @property
    def ground_y_m(self) -> float:
        """Height of the ground, metres."""

    @property
    def table(self) -> dict[str, Any]:
        """The table `[skeleton]` of a `pack.toml`."""

    @property
    def robot(self) -> dict[str, Any] | None:
        """The table `[robot]` of a `pack.toml`; none for a skeleton without hinges."""

    def pose(self, root_rotations: npt.ArrayLike, angles: npt.ArrayLike) -> Array:
        """Rotations `[frames, joints, 4]` for the root's `[frames, 4]` and the hinges' angles `[frames, hinges]`, radians.

        Raises `ValueError` if the skeleton has no hinges, or if the shapes do not fit it.
        """

    def __len__(self) -> int:
        """Number of joints."""

@final
class Clip:
    """Motion on a skeleton. Each array that is asked for is a copy, so keep it."""

    def __new__(cls, skeleton: Skeleton, fps: float, root_positions: npt.ArrayLike, rotations: npt.ArrayLike) -> Clip:
        """A clip of arrays `[frames, 3]` and `[frames, joints, 4]`. Raises `ValueError` with the frame."""

    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def fps(self) -> float:
        """Frames a second."""

    @property
    def root_positions(self) -> Array:
        """`[frames, 3]`: world places of joint 0, metres."""

    @property
    def rotations(self) -> Array:
        """`[frames, joints, 4]`: joint 0 in the world, others relative to their parents."""

    @property
    def rest(self) -> Array | None:
        """`[joints, 4]`: the file's rest pose; none for a clip on a given skeleton."""

    @property
    def report(self) -> dict[str, Any] | None:
        """What was understood of the file, as `troupe clip info --json` prints it; none for a clip of arrays."""

    def table(self) -> list[list[str]]:
        """The report as rows: what, its value, the evidence. Empty for a clip of arrays."""

    def world(self) -> tuple[Array, Array]:
        """World places `[frames, joints, 3]` and rotations `[frames, joints, 4]` of every joint."""

    def resample(self, fps: float) -> Clip:
        """The clip at another rate: rotations by slerp, the root along straight lines. Bones keep their length."""

    def retarget(
        self,
        to: Body,
        *,
        to_parts: PartsSource | None = None,
        body: Figure | None = None,
        parts: PartsSource | None = None,
    ) -> tuple[Clip, RetargetFigures]:
        """The clip on another body, and what it keeps of the motion: see `troupe retarget`.

        `body` is the clip's own, for several clips of one skeleton; without it this clip shows it. `to_parts` and `parts`
        correct the parts that are found of the other body and of the clip's, as `troupe clip info --parts` prints them.
        Figures beyond the bar stand in `faults`, and the clip is returned all the same. Raises `RetargetError`, or
        `ReadError` if `to` is a file that cannot be read.
        """

    def write(self, path: str | PathLike[str]) -> None:
        """Writes the clip as `.bvh` (centimetres) or `.glb`. Raises `ValueError` for other endings, or `OSError`."""

    def __len__(self) -> int:
        """Number of frames."""

@final
class Figure:
    """A body as motion is carried over to and from it: its parts, upright, heading along +Z, limbs hanging down."""

    def __new__(cls, body: Body, *, parts: PartsSource | None = None) -> Figure:
        """The body of a clip, a skeleton at rest (all rotations zero), a robot, or a file of a character or robot.

        Raises `RetargetError` if no body is found or if it does not stand, or `ReadError`.
        """

    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def parts(self) -> Parts:
        """The joints of trunk and limbs, as `troupe clip info --parts` prints them."""

    @property
    def leg_m(self) -> float:
        """Length of the legs from the hips to the ankles, metres."""

@final
class Agreement:
    """What the files of a folder agree on."""

    @property
    def up(self) -> str | None:
        """The axis that points up in all files that show one."""

    @property
    def unit_m(self) -> float | None:
        """Metres a unit in all files that show it."""

    @property
    def refused(self) -> dict[str, str]:
        """Why files cannot be read, by their paths."""

@final
class RobotDescription:
    """A robot as its maker describes it."""

    @property
    def skeleton(self) -> Skeleton:
        """Joints, hinges and joints that follow them, native axes. It has no contact joints: their heights come from motion."""

    @property
    def contacts(self) -> list[str]:
        """Joints that touch the ground."""

def read(
    source: str | PathLike[str] | bytes,
    *,
    name: str | None = None,
    beside: Mapping[str, bytes] | None = None,
    **options: Unpack[FileOptions],
) -> Clip:
    """Reads a file. Bytes need a `name` with an ending; `beside` has the files that a `.gltf` points to.

    Raises `ReadError`, or `OSError` if the file cannot be opened.
    """

def animations(
    source: str | PathLike[str] | bytes, *, name: str | None = None, beside: Mapping[str, bytes] | None = None
) -> list[str]:
    """Names of a file's animations, none for formats that hold one; arguments as those of `read`. Raises `ReadError`."""

def survey(paths: Sequence[PathLike[str]], **options: Unpack[FileOptions]) -> Agreement:
    """What files agree on; `troupe_reader.survey` takes a folder too."""

def read_robot(
    path: str | PathLike[str],
    *,
    legs: Sequence[str] = (),
    end_effectors: Sequence[tuple[str, str, Sequence[float]]] = (),
) -> RobotDescription:
    """Reads a URDF or MJCF and the STL meshes that it names.

    `legs` are the last hinges of the legs, left before right. `end_effectors` are more joints without hinges: name, the
    joint that carries it, and its place there in ROS axes, metres. Raises `ReadError`, with the joint and the option.
    """
