"""Files of every format, by the package troupe-reader: the reader of the server and the command line.

It is an extension that Rust builds, so this package does without it where no file is read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from troupe.arrays import F32
from troupe.errors import FailedPreconditionError, InvalidArgumentError
from troupe.skeleton import Skeleton


def read(
    path: str | Path, skeleton: Skeleton | None, options: dict[str, Any]
) -> tuple[Skeleton, float, F32, F32, dict[str, Any] | None]:
    """Skeleton, rate, roots and rotations of a file, and what was understood of it.

    Raises:
        FailedPreconditionError: The package troupe-reader is not installed.
        InvalidArgumentError: The file cannot be read; the message names the place and the option that decides.

    """
    try:
        import troupe_reader
    except ImportError as error:
        message = "clip: this needs the package troupe-reader (pip install ./bindings/python), or `troupe clip convert`"
        raise FailedPreconditionError(message) from error
    try:
        if skeleton is not None:
            tables = _tables(skeleton)
            options = options | {"skeleton": troupe_reader.Skeleton.of_tables(*tables)}
        clip = troupe_reader.read(path, **options)
    except ValueError as error:
        raise InvalidArgumentError(f"clip: {error}", field="clip") from error
    if skeleton is None:
        found = clip.skeleton
        left = tuple(found.left_axis)
        skeleton = Skeleton(
            tuple(found.names), tuple(found.parents), found.offsets, left_axis=(left[0], left[1], left[2])
        )
    return skeleton, clip.fps, clip.root_positions, clip.rotations, clip.report


def _tables(skeleton: Skeleton) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The tables `[skeleton]` and `[robot]` of a pack's manifest, without contact joints."""
    joints = [
        {"name": name, "parent": skeleton.names[parent] if parent >= 0 else "", "offset_m": offset}
        for name, parent, offset in zip(skeleton.names, skeleton.parents, skeleton.offsets.tolist(), strict=True)
    ]
    table = {"left_axis": list(skeleton.left_axis), "joints": joints}
    if skeleton.robot is None:
        return table, None
    hinges = [
        {
            "joint": hinge.joint,
            "axis": list(hinge.axis),
            "rest": list(hinge.rest),
            "lower_rad": hinge.lower,
            "upper_rad": hinge.upper,
            "max_speed_rad_per_s": hinge.max_speed,
        }
        | ({} if hinge.max_acceleration is None else {"max_acceleration_rad_per_s2": hinge.max_acceleration})
        for hinge in skeleton.robot.hinges
    ]
    mimics = [
        {
            "joint": mimic.joint,
            "follows": skeleton.robot.hinges[mimic.hinge].joint,
            "multiplier": mimic.multiplier,
            "offset_rad": mimic.offset,
            "axis": list(mimic.axis),
            "rest": list(mimic.rest),
        }
        for mimic in skeleton.robot.mimics
    ]
    robot = {"name": skeleton.robot.name, "hinges": hinges}
    return table, robot | {"mimics": mimics} if mimics else robot
