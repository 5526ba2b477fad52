"""Clips as numpy archives (`.npz`). Native axes, metres. With many characters they have an axis behind that of the frames.

| array | shape | |
|---|---|---|
| `positions` | (frames, joints, 3) | world positions of the joints |
| `quaternions` | (frames, joints, 4) | w x y z: the first joint's in the world, others relative to their parents |
| `root` | (frames, 3) | world position of the first joint |
| `fps` | () | frames a second |
| `joint_names` | (joints) | text |
| `parents` | (joints) | index of each joint's parent; -1 of the first |
| `offsets` | (joints, 3) | offset from the parent in its frame |
| `contacts` | (frames, contact joints) | probability that each is on the ground; left out if it is not known |
| `contact_joints` | (contact joints) | text; left out as `contacts` |
"""

from __future__ import annotations

import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import NoReturn

import numpy as np

from troupe.arrays import F32
from troupe.errors import InvalidArgumentError
from troupe.skeleton import Skeleton

_NEEDED = ("quaternions", "root", "fps", "joint_names", "parents", "offsets")
_CONTACTS = ("contacts", "contact_joints")
_BROKEN = (
    *(zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, RuntimeError, MemoryError),
    *(tokenize.TokenError, SyntaxError),  # of a header
)
_WAY_ON = "`Clip.read` and `troupe clip convert` read more kinds of archives"
_UNIT_TOLERANCE = 1e-3
"""How far a quaternion's length may be from 1."""
_CHAINS_M = (0.05, 20.0)
"""Length of the longest chain of bones. Outside of it, a file is in another unit than metres."""
_MAX_FAR_M = 1e4
"""Farthest of a root from the world's origin."""


def write(
    path: str | Path, skeleton: Skeleton, fps: float, root: F32, rotations: F32, contacts: F32 | None = None
) -> None:
    """Writes a clip, or frames of many characters."""
    arrays: dict[str, np.ndarray] = {
        "positions": skeleton.world(root, rotations)[0],
        "quaternions": rotations,
        "root": root,
        "fps": np.float32(fps) * np.ones((), np.float32),
        "joint_names": np.array(skeleton.names),
        "parents": np.array(skeleton.parents, np.int32),
        "offsets": skeleton.offsets,
    }
    if contacts is not None:
        arrays |= {"contacts": contacts, "contact_joints": np.array(skeleton.contact_joints)}
    np.savez_compressed(path, allow_pickle=False, **arrays)


def read(path: str | Path) -> tuple[Skeleton, float, F32, F32, F32 | None]:
    """Reads a clip of one character.

    Raises:
        InvalidArgumentError: The file is no such archive, or its arrays make no clip; the message has the file's name.

    """
    name = Path(path).name
    arrays = _arrays(path, name)
    joints = arrays["joint_names"].tolist()
    if arrays["joint_names"].dtype.kind != "U" or arrays["joint_names"].ndim != 1 or not joints:
        _refuse(name, "`joint_names` must be a list of texts")
    if len(set(joints)) < len(joints):
        _refuse(name, "two joints of `joint_names` have one name")
    root = _numbers(name, arrays, "root", (None, 3))
    shape = (len(root), len(joints))
    rotations = _numbers(name, arrays, "quaternions", (*shape, 4))
    offsets = _numbers(name, arrays, "offsets", (len(joints), 3))
    _check_motion(name, joints, root, rotations)
    fps = _numbers(name, arrays, "fps", ())
    if not fps > 0:
        _refuse(name, f"`fps` is {fps:g}; allowed: above 0")
    parents = _parents(name, arrays, joints)
    _check_unit(name, parents, offsets)
    contacts, feet = None, ()
    if "contacts" in arrays:
        feet = tuple(arrays["contact_joints"].tolist()) if "contact_joints" in arrays else ()
        contacts = _numbers(name, arrays, "contacts", (len(root), len(feet)))
        if not set(feet) <= set(joints):
            _refuse(name, "`contact_joints` has names that `joint_names` has not")
    return Skeleton(tuple(joints), parents, offsets, feet), float(fps), root, rotations, contacts


def _refuse(name: str, reason: str) -> NoReturn:
    raise InvalidArgumentError(f"{name}: {reason}; {_WAY_ON}", field="npz", allowed="an archive that `to_npz` wrote")


def _arrays(path: str | Path, name: str) -> dict[str, np.ndarray]:
    """The arrays of the archive that are read, by their names."""
    with Path(path).open("rb") as file:
        if not zipfile.is_zipfile(file):
            _refuse(name, "it is no .npz archive, or only a part of one")
        file.seek(0)
        try:
            with np.load(file, allow_pickle=False) as archive:
                found = {key: archive[key] for key in (*_NEEDED, *_CONTACTS) if key in archive}
        except _BROKEN as error:
            _refuse(name, f"its arrays cannot be read: {error}")
    if missing := [key for key in _NEEDED if key not in found]:
        _refuse(name, f"it lacks {', '.join(missing)}")
    return found


def _numbers(name: str, arrays: dict[str, np.ndarray], key: str, shape: tuple[int | None, ...]) -> F32:
    """An array of finite numbers of this shape; `None` fits any length but 0."""
    array = arrays[key]
    if array.dtype.kind not in "fiu":
        _refuse(name, f"`{key}` must have numbers, not {array.dtype}")
    is_fit = array.ndim == len(shape) and all(
        found == wanted if wanted is not None else found > 0 for found, wanted in zip(array.shape, shape, strict=True)
    )
    if not is_fit:
        wanted = ", ".join("frames" if size is None else str(size) for size in shape)
        many = " of many characters" if key == "root" and array.ndim == len(shape) + 1 else ""
        _refuse(name, f"`{key}`{many} has the shape {array.shape}; allowed: ({wanted})")
    numbers = array.astype(np.float32)
    if not np.isfinite(numbers).all():
        _refuse(name, f"`{key}` has numbers that are not finite")
    return numbers


def _parents(name: str, arrays: dict[str, np.ndarray], joints: list[str]) -> tuple[int, ...]:
    numbers = _numbers(name, arrays, "parents", (len(joints),)).tolist()
    for joint, parent in enumerate(numbers):
        is_before = parent.is_integer() and (0 <= parent < joint if joint else parent == -1)
        if not is_before:
            allowed = f"0 to {joint - 1}: parents come before their children" if joint else "-1"
            _refuse(name, f"`parents` has {parent:g} for {joints[joint]}; allowed: {allowed}")
    return tuple(int(parent) for parent in numbers)


def _check_motion(name: str, joints: list[str], root: F32, rotations: F32) -> None:
    """Refuses rotations that are none, and roots that are too far away."""
    lengths = np.linalg.norm(rotations.astype(np.float64), axis=-1)
    frame, joint = np.unravel_index(int(np.abs(lengths - 1).argmax()), lengths.shape)
    if abs(lengths[frame, joint] - 1) > _UNIT_TOLERANCE:
        length = f"{lengths[frame, joint]:.4g}"
        _refuse(name, f"`quaternions` has one of length {length} in frame {frame} for {joints[joint]}; allowed: 1")
    if (far := float(np.abs(root).max())) > _MAX_FAR_M:
        _refuse(name, f"`root` is {far:g} m from the origin; allowed: up to {_MAX_FAR_M:g} m")


def _check_unit(name: str, parents: tuple[int, ...], offsets: F32) -> None:
    """Refuses bones that are not in metres."""
    lengths = np.linalg.norm(offsets.astype(np.float64), axis=1)
    chains = np.zeros(len(parents))
    for joint, parent in enumerate(parents[1:], 1):
        chains[joint] = chains[parent] + lengths[joint]
    low, high = _CHAINS_M
    if (longest := float(chains.max())) > 0 and not low <= longest <= high:
        allowed = f"{low:g} to {high:g} m"
        _refuse(
            name, f"`offsets` may not be in metres: the longest chain of bones has {longest:.4g} m; allowed: {allowed}"
        )
