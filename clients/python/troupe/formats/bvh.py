"""BVH: written as the server's own tools do, and read where only the root moves in its parent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from troupe import rotation
from troupe.arrays import F32, F64
from troupe.errors import InvalidArgumentError
from troupe.skeleton import Skeleton

OFFSET_TOLERANCE_M = 5e-3
"""How far a bone may be from another skeleton's."""
_AXES = {"X": 0, "Y": 1, "Z": 2}


def write(skeleton: Skeleton, fps: float, root: F32, rotations: F32, units_per_metre: float = 100) -> str:
    """The text of a clip, rotations in the order Z X Y."""
    lines = ["HIERARCHY"]
    order: list[int] = []
    _joint(skeleton, 0, 0, units_per_metre, lines, order)
    angles = np.degrees(_zxy(rotations[:, order].astype(np.float64)))
    values = np.concatenate([root.astype(np.float64) * units_per_metre, angles.reshape(len(root), -1)], axis=1)
    lines += ["MOTION", f"Frames: {len(root)}", f"Frame Time: {1 / fps!r}"]
    lines += [" ".join(_number(value) for value in row) for row in values.tolist()]
    return "\n".join(lines) + "\n"


def _joint(skeleton: Skeleton, joint: int, depth: int, units: float, lines: list[str], order: list[int]) -> None:
    indent = "\t" * depth
    order.append(joint)
    offset = skeleton.offsets[joint].astype(np.float64) * units if joint else np.zeros(3)
    channels = "Zrotation Xrotation Yrotation"
    lines += [f"{indent}{'JOINT' if joint else 'ROOT'} {skeleton.names[joint]}", f"{indent}{{"]
    lines.append(f"{indent}\tOFFSET " + " ".join(_number(value) for value in offset.tolist()))
    moved = "CHANNELS 3" if joint else "CHANNELS 6 Xposition Yposition Zposition"
    lines.append(f"{indent}\t{moved} {channels}")
    children = skeleton.children(joint)
    for child in children:
        _joint(skeleton, child, depth + 1, units, lines, order)
    if not children:
        lines += [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 0 0", f"{indent}\t}}"]
    lines.append(f"{indent}}}")


def _number(value: float) -> str:
    """Six decimals, without trailing zeros."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _zxy(q: F64) -> F64:
    """Angles (z, x, y) in radians whose product Rz Rx Ry is the rotation, exact at gimbal lock too."""
    w, x, y, z = np.moveaxis(rotation.normalise64(q), -1, 0)
    # Columns of the matrix: m[row][column].
    m01, m11 = 2 * (x * y - w * z), 1 - 2 * (x * x + z * z)
    first = np.arctan2(-m01, m11)
    # After the first turn is undone, the rest has no z in it.
    half = -first / 2
    cos, sin = np.cos(half), np.sin(half)
    rest_w, rest_x = cos * w - sin * z, cos * x - sin * y
    rest_y, rest_z = cos * y + sin * x, cos * z + sin * w
    r21, r11 = 2 * (rest_y * rest_z + rest_w * rest_x), 1 - 2 * (rest_x**2 + rest_z**2)
    r02, r00 = 2 * (rest_x * rest_z + rest_w * rest_y), 1 - 2 * (rest_y**2 + rest_z**2)
    return np.stack([first, np.arctan2(r21, r11), np.arctan2(r02, r00)], axis=-1)


def text_of(data: bytes) -> str:
    """The text of a file, in UTF-8 with or without a mark.

    Raises:
        InvalidArgumentError: It has another encoding.

    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"bvh: byte {error.start} is no UTF-8; `Clip.read` and `troupe clip convert` read other encodings"
        raise InvalidArgumentError(message, field="bvh", allowed="UTF-8") from error


def read(text: str, units_per_metre: float = 100) -> tuple[Skeleton, float, F32, F32]:
    """Skeleton, rate, roots and rotations of a text.

    Raises:
        InvalidArgumentError: It is no BVH of one root, or a joint below the root has position channels that move it.

    """
    tokens = iter(text.split())
    try:
        skeleton, channels = _hierarchy(tokens, units_per_metre)
        _expect(tokens, "Frames:")
        count = int(next(tokens))
        _expect(tokens, "Frame")
        _expect(tokens, "Time:")
        frame_time = float(next(tokens))
        values = np.array(list(tokens), np.float64).reshape(count, sum(map(len, channels)))
    except (StopIteration, ValueError) as error:
        if isinstance(error, InvalidArgumentError):
            raise
        message = f"bvh: {str(error) or 'it ends in the middle'}"
        raise InvalidArgumentError(message, field="bvh", allowed="a BVH file with one root") from error
    if not (np.isfinite(frame_time) and frame_time > 0):
        message = f"bvh: Frame Time is {frame_time:g} s; `Clip.read` and `troupe clip convert` take a rate"
        raise InvalidArgumentError(message, field="bvh", allowed="above 0")
    wrong = np.argwhere(~np.isfinite(values))
    if wrong.size:
        raise InvalidArgumentError(f"bvh: frame {wrong[0][0]} has a value that is not finite", field="bvh")
    root = skeleton.offsets[0].astype(np.float64) * np.ones((count, 1))
    rotations = np.zeros((count, len(channels), 4), np.float64)
    column = 0
    for joint, names in enumerate(channels):
        turned = np.zeros((count, 4))
        turned[:, 0] = 1
        for name in names:
            value, column = values[:, column], column + 1
            axis = _AXES[name[0]]
            if name.endswith("rotation"):
                turned = _turned(turned, axis, np.radians(value))
            elif joint == 0:
                root[:, axis] = value / units_per_metre
            elif np.abs(value / units_per_metre - skeleton.offsets[joint][axis]).max() > OFFSET_TOLERANCE_M:
                message = f"bvh: joint {skeleton.names[joint]} moves in its parent; only the root may"
                raise InvalidArgumentError(message, field="bvh")
        rotations[:, joint] = turned
    return skeleton, 1 / frame_time, root.astype(np.float32), rotations.astype(np.float32)


def _turned(before: F64, axis: int, angle: F64) -> F64:
    """The rotation about an axis, then those before."""
    turn = np.zeros((len(angle), 4))
    turn[:, 0], turn[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    turned: F64 = rotation.multiply(before, turn)  # type: ignore[arg-type,assignment]
    return turned


def _expect(tokens: Iterator[str], *words: str) -> str:
    token = next(tokens)
    if token not in words:
        raise ValueError(f"{token!r} stands where {' or '.join(words)} belongs")
    return token


def _hierarchy(tokens: Iterator[str], units: float) -> tuple[Skeleton, list[list[str]]]:
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    _expect(tokens, "HIERARCHY")
    _expect(tokens, "ROOT")
    stack: list[int] = []
    opening = "ROOT"
    while True:
        if opening in ("ROOT", "JOINT"):
            names.append(next(tokens))
            parents.append(stack[-1] if stack else -1)
            stack.append(len(names) - 1)
            _expect(tokens, "{")
            _expect(tokens, "OFFSET")
            offsets.append([float(next(tokens)) / units for _ in range(3)])
            _expect(tokens, "CHANNELS")
            channels.append([next(tokens) for _ in range(int(next(tokens)))])
            unknown = [
                name for name in channels[-1] if name[:1] not in _AXES or name[1:] not in ("position", "rotation")
            ]
            if unknown:
                raise ValueError(f"unknown channel {unknown[0]!r}")
        elif opening == "End":
            for word in ("Site", "{", "OFFSET"):
                _expect(tokens, word)
            for _ in range(3):
                float(next(tokens))
            _expect(tokens, "}")
        elif stack:
            stack.pop()
        else:
            break
        opening = _expect(tokens, *(("JOINT", "End", "}") if stack else ("MOTION",)))
    array = np.array(offsets, np.float32)
    return Skeleton(tuple(names), tuple(parents), array), channels
