"""Reads BVH files: any hierarchy and channel order. Position channels replace the joint's OFFSET."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from troupe_training.data.rotations import axis_rotation


class BvhError(ValueError):
    """A file that is not a BVH this package can train on; the message says where and why."""


@dataclass
class BvhJoint:
    """One joint of the hierarchy; ``channels`` are in the file's order, e.g. ``Zrotation``."""

    name: str
    parent: int
    offset: np.ndarray
    channels: list[str]


@dataclass
class Bvh:
    """A parsed file: joints in file order (parents first) and channel values ``[frames, channels]``."""

    joints: list[BvhJoint]
    frame_time: float
    values: np.ndarray

    def world(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World positions ``[F, J, 3]``, world rotations ``[F, J, 3, 3]`` and local positions, in file units."""
        frames, count = len(self.values), len(self.joints)
        positions = np.zeros((frames, count, 3))
        rotations = np.zeros((frames, count, 3, 3))
        local_positions = np.zeros((frames, count, 3))
        column = 0
        for j, joint in enumerate(self.joints):
            translation = np.tile(joint.offset, (frames, 1))
            rotation = np.tile(np.eye(3), (frames, 1, 1))
            for channel in joint.channels:
                value = self.values[:, column]
                column += 1
                if channel.endswith("position"):
                    translation[:, "XYZ".index(channel[0])] = value
                else:
                    rotation = rotation @ axis_rotation(channel[0], value)
            local_positions[:, j] = translation
            if joint.parent < 0:
                positions[:, j], rotations[:, j] = translation, rotation
            else:
                parent = joint.parent
                positions[:, j] = positions[:, parent] + np.einsum("fij,fj->fi", rotations[:, parent], translation)
                rotations[:, j] = rotations[:, parent] @ rotation
        return positions, rotations, local_positions


CHANNELS = {f"{axis}{kind}" for axis in "XYZ" for kind in ("position", "rotation")}
MAX_VALUES = 50_000_000


def read_bvh(path: Path) -> Bvh:
    """Parses a file. Raises `BvhError` with the line number if the text is not BVH."""
    lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    motion = next((row for row, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if motion is None:
        raise BvhError("no MOTION section")
    joints = _read_hierarchy(lines[:motion])
    header = [line.split() for line in lines[motion + 1 : motion + 3]]
    if len(header) < 2 or header[0][:1] != ["Frames:"] or header[1][:2] != ["Frame", "Time:"]:
        raise BvhError(f"line {motion + 2}: expected 'Frames:' and 'Frame Time:'")
    try:
        frames, frame_time = int(header[0][1]), float(header[1][2])
    except (ValueError, IndexError):
        raise BvhError(f"line {motion + 2}: the number of frames or the frame time is not a number") from None
    if not 1e-4 <= frame_time <= 1.0:
        raise BvhError(f"line {motion + 3}: the frame time is {frame_time} s, 0.0001 to 1 is allowed")
    body = [line for line in lines[motion + 3 :] if line.strip()]
    if len(body) != frames:
        raise BvhError(f"Frames: says {frames}, but {len(body)} lines follow")
    width = sum(len(joint.channels) for joint in joints)
    if frames * width > MAX_VALUES:
        raise BvhError(f"{frames} frames x {width} channels are more than {MAX_VALUES} numbers")
    values = np.array(" ".join(body).split(), dtype=np.float64)
    if values.size != frames * width:
        raise BvhError(f"{values.size} numbers follow, expected {frames} frames x {width} channels")
    if not np.isfinite(values).all():
        raise BvhError("a value is not finite")
    return Bvh(joints, frame_time, values.reshape(frames, width))


def _read_hierarchy(lines: list[str]) -> list[BvhJoint]:
    """The joints in file order; braces may stand on lines of their own or not."""
    joints: list[BvhJoint] = []
    stack: list[int | None] = []  # None is an End Site
    pending: int | None = None
    for row, line in enumerate(lines, 1):
        words = line.replace("{", " { ").replace("}", " } ").split()
        while words:
            key = words.pop(0)
            if key.upper() in ("ROOT", "JOINT"):
                name = " ".join(words[: words.index("{")] if "{" in words else words)
                words = words[words.index("{") :] if "{" in words else []
                joints.append(BvhJoint(name, stack[-1] if stack and stack[-1] is not None else -1, np.zeros(3), []))
                pending = len(joints) - 1
            elif key.upper() == "END":
                words, pending = words[1:], None
            elif key == "{":
                stack.append(pending)
            elif key == "}":
                if not stack:
                    raise BvhError(f"line {row}: unexpected }}")
                stack.pop()
            elif key.upper() == "OFFSET":
                if stack and stack[-1] is not None:
                    joints[stack[-1]].offset = _offset(words[:3], row)
                words = words[3:]
            elif key.upper() == "CHANNELS":
                count = int(words[0]) if words and words[0].isdigit() else -1
                channels = words[1 : 1 + count]
                if len(channels) != count or not set(channels) <= CHANNELS or not stack or stack[-1] is None:
                    raise BvhError(f"line {row}: channels must be a count and as many of {sorted(CHANNELS)}")
                joints[stack[-1]].channels = channels
                words = words[1 + count :]
            elif key.upper() != "HIERARCHY":
                raise BvhError(f"line {row}: unexpected {key[:40]!r}")
    if not joints or stack:
        raise BvhError("the hierarchy is empty or not closed")
    return joints


def _offset(words: list[str], row: int) -> np.ndarray:
    try:
        offset = np.array([float(w) for w in words])
    except ValueError:
        raise BvhError(f"line {row}: OFFSET needs three numbers") from None
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise BvhError(f"line {row}: OFFSET needs three finite numbers")
    return offset
