"""BVH: written as the server's own tools do, and read as they write it.

A file of another kind is refused, because its frames would be wrong: `motion/tests/shared_files.json` has examples of each.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NoReturn

import numpy as np

from troupe import rotation
from troupe.arrays import F32, F64
from troupe.errors import InvalidArgumentError
from troupe.formats import body
from troupe.skeleton import Skeleton

OFFSET_TOLERANCE_M = 5e-3
"""How far a bone may be from another skeleton's."""
_AXES = {"x": 0, "y": 1, "z": 2}
_MAX_JOINTS = 512
_SLIDE_M = 1e-4
"""How far a joint below the root may move in its parent."""
_FRAME_TIMES_S = (1e-3, 1.0)
_WAY_ON = "`Clip.read` and `troupe clip convert` read more kinds of files"


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


def read(
    data: bytes, name: str, units_per_metre: float | None = None, up: str | None = None
) -> tuple[Skeleton, float, F32, F32]:
    """Skeleton, rate, roots and rotations of a file with the Y axis up, in centimetres unless a unit is given.

    A person who does not stand along Y is refused unless `up` is given, and one of a height that speaks for another unit unless
    the unit is given. A rig whose feet or head are not clear by their names is refused unless both are.

    Raises:
        InvalidArgumentError: It is of another kind, or no BVH; the message has the file's name and the line.

    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        _refuse(name, f"byte {error.start} is no UTF-8")
    words = _Words(text, name)
    units = 100.0 if units_per_metre is None else units_per_metre
    names, parents, offsets, channels = _hierarchy(words)
    if len(names) > _MAX_JOINTS:
        _refuse(name, f"it has {len(names)} joints; at most {_MAX_JOINTS} are supported")
    rest = np.array(offsets) / units
    fps, values = _frames(words, sum(map(len, channels)))
    if _places_only(parents, channels, values):
        _refuse(name, f"{names[0]} never moves: the root is {names[1]}, which has positions of its own")
    roots = np.zeros((len(values), 3)) + offsets[0]
    rotations = np.zeros((len(values), len(channels), 4), np.float64)
    column = 0
    for joint, of in enumerate(channels):
        turned = np.zeros((len(values), 4))
        turned[:, 0] = 1
        for channel in of:
            value, column = values[:, column], column + 1
            axis = _AXES[channel[0]]
            if channel.endswith("rotation"):
                turned = _turned(turned, axis, np.radians(value))
            elif joint == 0:
                roots[:, axis] = value
            elif np.ptp(value) > 2 * _SLIDE_M * units:
                _refuse(name, f"joint {names[joint]} moves in its parent; only the root may")
            elif offsets[joint][axis] != 0 and not value.any():
                _refuse(name, f"joint {names[joint]} has positions of 0, which its OFFSET has not")
            else:
                offsets[joint][axis] = np.median(value)
        rotations[:, joint] = turned
    skeleton = Skeleton(tuple(names), tuple(parents), (np.array(offsets) / units).astype(np.float32))
    root, turns = (roots / units).astype(np.float32), rotations.astype(np.float32)
    try:
        body.check(skeleton, rest, root, turns, is_unit_given=units_per_metre is not None, is_up_given=up is not None)
        left = body.left_axis(skeleton, turns)
    except body.UnclearError as error:
        _refuse(name, str(error))
    return replace(skeleton, left_axis=left), fps, root, turns


def _places_only(parents: list[int], channels: list[list[str]], values: F64) -> bool:
    """Whether the first joint never moves, and has one child, which has positions: the reader leaves the first joint out."""
    is_still = bool((values[:, : len(channels[0])] == values[0, : len(channels[0])]).all())
    return is_still and parents.count(0) == 1 and sum(channel.endswith("position") for channel in channels[1]) == 3


def _refuse(name: str, reason: str) -> NoReturn:
    raise InvalidArgumentError(f"{name}: {reason}; {_WAY_ON}", field="bvh", allowed="a BVH file as Troupe writes it")


def _turned(before: F64, axis: int, angle: F64) -> F64:
    """The rotation about an axis, then those before."""
    turn = np.zeros((len(angle), 4))
    turn[:, 0], turn[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    turned: F64 = rotation.multiply(before, turn)  # type: ignore[arg-type,assignment]
    return turned


class _Words:
    """The words of a text, one after the other, with the line of the last one."""

    def __init__(self, text: str, name: str) -> None:
        self._lines = text.splitlines()
        self._ahead: list[str] = []
        self.line = 0
        self._name = name

    def refuse(self, reason: str) -> NoReturn:
        _refuse(self._name, f"line {self.line}: {reason}")

    def next(self) -> str:
        while not self._ahead:
            if self.line == len(self._lines):
                self.refuse("the file ends in the middle")
            self._ahead = self._lines[self.line].split()[::-1]
            self.line += 1
        return self._ahead.pop()

    def expect(self, *allowed: str) -> str:
        word = self.next()
        if word not in allowed:
            self.refuse(f"{word[:40]!r} stands where {' or '.join(allowed)} belongs")
        return word

    def number(self) -> float:
        word = self.next()
        try:
            number = float(word)
        except ValueError:
            self.refuse(f"{word[:40]!r} is no number")
        if not np.isfinite(number):
            self.refuse(f"{word[:40]!r} is not finite")
        return number

    def count(self) -> int:
        word = self.next()
        if not (word.isascii() and word.isdigit()):
            self.refuse(f"{word[:40]!r} is no count")
        return int(word)

    def numbers(self) -> F64:
        """All numbers that follow."""
        first = self.line
        rest = " ".join([*self._ahead[::-1], *self._lines[first:]]).split()
        try:
            numbers = np.array(rest, np.float64)
        except ValueError:
            numbers = np.array([np.nan])
        if np.isfinite(numbers).all():
            return numbers
        # One of them is wrong: one by one, for its line.
        while True:
            self.number()


def _frames(words: _Words, channels: int) -> tuple[float, F64]:
    """Rate in frames a second, and the values (frames, channels)."""
    words.expect("Frames:")
    frames = words.count()
    words.expect("Frame")
    words.expect("Time:")
    frame_time_s = words.number()
    low, high = _FRAME_TIMES_S
    if not low <= frame_time_s <= high:
        words.refuse(f"Frame Time is {frame_time_s:g} s; allowed: {low:g} to {high:g}")
    numbers = words.numbers()
    if numbers.size != frames * channels or frames == 0:
        words.refuse(f"{frames} frames are declared, and {numbers.size} numbers follow, {channels} a frame")
    return 1 / frame_time_s, numbers.reshape(frames, channels)


def _hierarchy(words: _Words) -> tuple[list[str], list[int], list[list[float]], list[list[str]]]:
    """Names, parents, offsets in the file's unit, and channels in small letters."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    words.expect("HIERARCHY")
    words.expect("ROOT")
    stack: list[int] = []
    opening = "ROOT"
    while True:
        if opening in ("ROOT", "JOINT"):
            name = words.next()
            if name in names:
                words.refuse(f"two joints have the name {name}")
            names.append(name)
            parents.append(stack[-1] if stack else -1)
            stack.append(len(names) - 1)
            words.expect("{")
            words.expect("OFFSET")
            offsets.append([words.number() for _ in range(3)])
            words.expect("CHANNELS")
            channels.append([_channel(words) for _ in range(words.count())])
            if len(set(channels[-1])) < len(channels[-1]):
                words.refuse(f"a channel of joint {name} stands twice")
        elif opening == "End":
            for word in ("Site", "{", "OFFSET"):
                words.expect(word)
            for _ in range(3):
                words.number()
            words.expect("}")
        elif stack:
            stack.pop()
        opening = words.expect(*(("JOINT", "End", "}") if stack else ("MOTION",)))
        if opening == "MOTION":
            return names, parents, offsets, channels


def _channel(words: _Words) -> str:
    word = words.next()
    channel = word.lower()
    if channel[:1] not in _AXES or channel[1:] not in ("position", "rotation"):
        words.refuse(f"unknown channel {word[:40]!r}")
    return channel
