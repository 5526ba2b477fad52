"""Reads motion files of every format that Troupe knows, and says what it understood.

This is the reader of the server and of `troupe clip`, as an extension. Axes are Troupe's (right-handed, Y up, +Z forward),
lengths are in metres, and quaternions are (w, x, y, z).
"""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Unpack

from troupe_reader import _native
from troupe_reader._native import (
    ENDINGS,
    ROBOT_ENDINGS,
    Agreement,
    Clip,
    Figure,
    ReadError,
    RetargetError,
    RobotDescription,
    Skeleton,
    animations,
    read,
    read_robot,
)
from troupe_reader.options import Choice, FileOptions, LimbParts, Parts, RetargetFigures, WorstJoints

__all__ = [
    "ENDINGS",
    "ROBOT_ENDINGS",
    "Agreement",
    "Choice",
    "Clip",
    "Figure",
    "LimbParts",
    "Parts",
    "ReadError",
    "RetargetError",
    "RetargetFigures",
    "RobotDescription",
    "Skeleton",
    "WorstJoints",
    "animations",
    "read",
    "read_robot",
    "survey",
]


def survey(files: str | PathLike[str] | Iterable[str | PathLike[str]], **options: Unpack[FileOptions]) -> Agreement:
    """What files of one origin agree on, for those that leave it open: a folder with all below it, or a list of files.

    Pass the result to `read` as `agreement`. A file that cannot be read stands in `Agreement.refused`.
    """
    if isinstance(files, str | PathLike):
        found = (path for path in Path(files).rglob("*") if path.suffix.lower() in ENDINGS and path.is_file())
        files = sorted(found)
    return _native.survey([Path(file) for file in files], **options)
