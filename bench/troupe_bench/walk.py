"""A walk of a pack's robot as a BVH file, by the gait of one of its styles: what the load tester takes keyframes from.

Its built-in walk fits the pack `human` alone.
"""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

FPS = 30
FRAMES = 200
STYLE, GAIT = "normal", "walk"
CM_PER_M = 100.0
CHANNELS = "Zrotation Xrotation Yrotation"
Quaternion = tuple[float, float, float, float]
"""w, x, y, z."""


def write_walk(pack: Path, file: Path) -> None:
    """Writes the walk of the pack in a folder."""
    joints = tomllib.loads((pack / "pack.toml").read_text())["skeleton"]["joints"]
    style = json.loads((pack / "styles" / f"{STYLE}.json").read_text())
    gait = next(gait for gait in style["gaits"] if gait["name"] == GAIT)
    order = _depth_first(joints, 0)
    motion = [frame_of(gait, number, order) for number in range(FRAMES)]
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = ["HIERARCHY", *_hierarchy(joints, 0, 0), "MOTION", f"Frames: {FRAMES}", f"Frame Time: {1 / FPS:.8f}"]
    lines += [" ".join(f"{number:.5f}" for number in frame) for frame in motion]
    file.write_text("\n".join(lines) + "\n")


def frame_of(gait: dict[str, Any], frame: int, order: list[int]) -> list[float]:
    """The channels of one frame: the root's place along +Z in centimetres, then the angles in degrees of joints in an order."""
    keys, seconds = gait["keys"], frame / FPS
    at = frame / gait["period_frames"] * len(keys)
    before, share = int(at), at - int(at)
    one, other = (keys[number % len(keys)] for number in (before, before + 1))
    height_m = (1 - share) * one["height"] + share * other["height"]
    numbers = [0.0, CM_PER_M * height_m, CM_PER_M * gait["forward"] * seconds]
    for joint in order:
        a, b = (tuple(key["rotations"][4 * joint : 4 * joint + 4]) for key in (one, other))
        numbers += angles(between(a, b, share))
    return numbers


def between(one: Quaternion, other: Quaternion, share: float) -> Quaternion:
    """A rotation between two that are near to each other."""
    sign = math.copysign(1.0, sum(a * b for a, b in zip(one, other, strict=True)))
    w, x, y, z = ((1 - share) * a + share * sign * b for a, b in zip(one, other, strict=True))
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def angles(rotation: Quaternion) -> list[float]:
    """Degrees about Z, X and Y, in the order of `CHANNELS`: the matrix is Rz Rx Ry."""
    w, x, y, z = rotation
    about_z = math.atan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
    about_x = math.asin(max(-1.0, min(1.0, 2 * (y * z + w * x))))
    about_y = math.atan2(2 * (w * y - x * z), 1 - 2 * (x * x + y * y))
    return [math.degrees(angle) for angle in (about_z, about_x, about_y)]


def _below(joints: list[dict[str, Any]], index: int) -> list[int]:
    return [number for number, other in enumerate(joints) if other["parent"] == joints[index]["name"]]


def _depth_first(joints: list[dict[str, Any]], index: int) -> list[int]:
    """A joint and all below it, in the order in which BVH files name joints. A pack has another."""
    return [index, *(number for child in _below(joints, index) for number in _depth_first(joints, child))]


def _hierarchy(joints: list[dict[str, Any]], index: int, depth: int) -> list[str]:
    """The lines of a joint and of all below it."""
    joint, indent = joints[index], "  " * depth
    offset = " ".join(f"{CM_PER_M * number:.6f}" for number in joint["offset_m"])
    channels = "3" if depth else "6 Xposition Yposition Zposition"
    inner = [f"  OFFSET {offset}", f"  CHANNELS {channels} {CHANNELS}"]
    children = _below(joints, index)
    if not children:
        inner += ["  End Site", "  {", "    OFFSET 0 0 0", "  }"]
    lines = [f"{indent}{line}" for line in (f"{'JOINT' if depth else 'ROOT'} {joint['name']}", "{", *inner)]
    for child in children:
        lines += _hierarchy(joints, child, depth + 1)
    return [*lines, f"{indent}}}"]
