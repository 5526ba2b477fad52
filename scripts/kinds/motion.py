"""Motion that is known, apart from the reader: Y up, +Z forward, metres, quaternions w x y z."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def multiply(a: Array, b: Array) -> Array:
    """Products of quaternions: the turn `b`, then `a`."""
    (aw, ax, ay, az), (bw, bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    product = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return np.stack(product, -1)


def conjugate(q: Array) -> Array:
    """Inverse turns."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Array, v: Array) -> Array:
    """Vectors, turned."""
    pure = np.concatenate([np.zeros((*v.shape[:-1], 1)), v], -1)
    return multiply(multiply(q, pure), conjugate(q))[..., 1:]


def about(axis: Sequence[float] | Array, angle: Array | float) -> Array:
    """Turns by angles in radians about an axis of unit length."""
    half = np.asarray(angle, np.float64)[..., None] / 2
    return np.concatenate([np.cos(half), np.sin(half) * np.asarray(axis)], -1)


def matrix(q: Array) -> Array:
    """Matrices of turns."""
    return np.stack([rotate(q, np.broadcast_to(axis, (*q.shape[:-1], 3))) for axis in np.eye(3)], -1)


def angle_between(a: Array, b: Array) -> Array:
    """Angles between turns, radians."""
    apart = multiply(conjugate(a), b)
    return 2 * np.arctan2(np.linalg.norm(apart[..., 1:], axis=-1), np.abs(apart[..., 0]))


@dataclass
class Motion:
    """Joints with parents first, and their turns relative to the parents."""

    names: list[str]
    parents: list[int]
    offsets: Array  # [J, 3]
    fps: float
    roots: Array  # [F, 3]
    turns: Array  # [F, J, 4]

    def world(self) -> tuple[Array, Array]:
        """Places `[F, J, 3]` and turns `[F, J, 4]` in the world."""
        places, turns = np.empty((*self.turns.shape[:2], 3)), self.turns.copy()
        places[:, 0] = self.roots
        for joint, parent in enumerate(self.parents[1:], 1):
            above = turns[:, parent]
            offset = np.broadcast_to(self.offsets[joint], (len(above), 3))
            places[:, joint] = places[:, parent] + rotate(above, offset)
            turns[:, joint] = multiply(above, self.turns[:, joint])
        return places, turns

    def at(self, fps: float) -> "Motion":
        """At another rate: the root along straight lines, turns by slerp."""
        count = int((len(self.roots) - 1) / self.fps * fps + 1e-6) + 1
        when = np.arange(count) * self.fps / fps
        first = np.clip(when.astype(int), 0, max(len(self.roots) - 2, 0))
        second = np.minimum(first + 1, len(self.roots) - 1)
        share = when - first
        roots = self.roots[first] + share[:, None] * (self.roots[second] - self.roots[first])
        a, b = self.turns[first], self.turns[second]
        b = np.where((a * b).sum(-1, keepdims=True) < 0, -b, b)
        angle = np.arccos(np.clip((a * b).sum(-1, keepdims=True), -1, 1))
        part, sine = share[:, None, None], np.maximum(np.sin(angle), 1e-9)
        mixed = np.where(
            angle < 1e-6, a + part * (b - a), (np.sin((1 - part) * angle) * a + np.sin(part * angle) * b) / sine
        )
        turns = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
        return replace(self, fps=fps, roots=roots, turns=turns)

    def on_other_axes(self, axes: Array) -> "Motion":
        """The same motion of bones whose own axes are turned by `axes` `[J, 4]`."""
        above = np.array([axes[parent] if parent >= 0 else [1.0, 0, 0, 0] for parent in self.parents])
        turns = multiply(multiply(conjugate(above), self.turns), axes)
        return replace(self, offsets=rotate(conjugate(above), self.offsets), turns=turns)


def read_walk(text: str) -> Motion:
    """`examples/walk.bvh`: centimetres, channels Z X Y, all joints in the order of the rows."""
    head, body = text.split("MOTION")
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    stack: list[int] = []
    for line in head.splitlines():
        match line.split():
            case ["ROOT" | "JOINT", name]:
                parents.append(stack[-1] if stack else -1)
                names.append(name)
                stack.append(len(names) - 1)
            case ["End", "Site"]:
                stack.append(-1)
            case ["OFFSET", *numbers] if stack[-1] >= 0:
                offsets.append([float(n) / 100 for n in numbers])
            case ["}"]:
                stack.pop()
    frame_time, *rows = body.split("Frame Time:")[1].strip().splitlines()
    values = np.array([row.split() for row in rows], np.float64)
    angles = np.radians(values[:, 3:]).reshape(len(values), len(names), 3)
    z, x, y = (about(axis, angles[..., n]) for n, axis in enumerate(np.eye(3)[[2, 0, 1]]))
    turns = multiply(multiply(z, x), y)
    return Motion(names, parents, np.array(offsets), 1 / float(frame_time), values[:, :3] / 100, turns)
