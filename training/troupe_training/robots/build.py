"""The robot of a URDF or MJCF, as the reader describes it: hinges in the order of a walk through its tree, toes and hands."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import troupe_reader
from troupe_training.data.neutral import quaternion_matrix
from troupe_training.robots.robot import Hinge, Robot, RobotError

EndEffector = tuple[str, str, tuple[float, float, float]]


def describe(path: Path, end_effectors: Sequence[str] = (), legs: Sequence[str] = ()) -> troupe_reader.RobotDescription:
    """What a file describes. ``end_effectors`` are ``NAME=JOINT:x,y,z``, metres in the file's frame of that joint's link.

    They add to or replace those found from the sole and the hands. ``legs`` are the last hinges of the legs, left before
    right, if the names do not show them. Raises `ValueError` with the joint and the option.
    """
    return troupe_reader.read_robot(path, legs=legs, end_effectors=[_end_effector(text) for text in end_effectors])


def build_robot(description: troupe_reader.RobotDescription, contacts: list[str] | None = None) -> Robot:
    """The robot of a description.

    ``contacts`` are the joints that touch the ground; the last joint of each leg and its toe if left out.
    """
    skeleton = description.skeleton
    names, table = skeleton.names, skeleton.robot
    assert table is not None
    contacts = description.contacts if contacts is None else contacts
    unknown = [name for name in contacts if name not in names]
    if unknown:
        raise RobotError(f"contact joints {unknown} are not among {names}")
    hinges = [
        Hinge(
            names.index(hinge["joint"]),
            np.array(hinge["axis"]),
            quaternion_matrix(np.array(hinge["rest"])),
            hinge["lower_rad"],
            hinge["upper_rad"],
            hinge["max_speed_rad_per_s"],
        )
        for hinge in table["hinges"]
    ]
    # The table has decimals that stand for the same numbers and end sooner than those of the array.
    offsets = np.array([joint["offset_m"] for joint in skeleton.table["joints"]])
    return Robot(table["name"], names, skeleton.parents, offsets, hinges, contacts, table.get("mimics", []))


def _end_effector(text: str) -> EndEffector:
    name, _, rest = text.partition("=")
    parent, _, numbers = rest.partition(":")
    try:
        x, y, z = (float(v) for v in numbers.split(","))
    except ValueError:
        raise RobotError(f"--end-effector {text}: expected NAME=JOINT:x,y,z") from None
    if not name or not np.isfinite([x, y, z]).all():
        raise RobotError(f"--end-effector {text}: expected NAME=JOINT:x,y,z")
    return name, parent, (x, y, z)
