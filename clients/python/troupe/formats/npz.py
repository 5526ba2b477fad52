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

from pathlib import Path

import numpy as np

from troupe.arrays import F32
from troupe.errors import InvalidArgumentError
from troupe.skeleton import Skeleton


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
        InvalidArgumentError: An array is missing, or the archive has many characters.

    """
    with np.load(path, allow_pickle=False) as archive:
        needed = ("quaternions", "root", "fps", "joint_names", "parents", "offsets")
        missing = [name for name in needed if name not in archive]
        if missing:
            message = f"npz: lacks {', '.join(missing)}; `Clip.read` and `troupe clip convert` read other archives"
            raise InvalidArgumentError(message, field="npz", allowed=", ".join(needed))
        skeleton = Skeleton(
            names=tuple(str(name) for name in archive["joint_names"]),
            parents=tuple(int(parent) for parent in archive["parents"]),
            offsets=archive["offsets"].astype(np.float32),
            contact_joints=tuple(str(name) for name in archive["contact_joints"]) if "contacts" in archive else (),
        )
        if archive["root"].ndim != 2:
            raise InvalidArgumentError("npz: `root` has many characters", field="root", allowed="(frames, 3)")
        contacts = archive["contacts"].astype(np.float32) if "contacts" in archive else None
        rotations = archive["quaternions"].astype(np.float32)
        return skeleton, float(archive["fps"]), archive["root"].astype(np.float32), rotations, contacts
