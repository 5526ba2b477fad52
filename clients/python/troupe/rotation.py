"""Quaternions (w, x, y, z) in the last axis of arrays. All functions work on any leading axes at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from troupe.arrays import F32, F64


def multiply(a: F32, b: F32) -> F32:
    """The rotation `b`, then `a`. Leading axes broadcast."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    parts = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return np.stack(parts, axis=-1)


def rotate(q: F32, v: F32) -> F32:
    """Vectors (x, y, z) turned by unit quaternions. Leading axes broadcast."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    vx, vy, vz = v[..., 0], v[..., 1], v[..., 2]
    # t = 2 u × v; v' = v + w t + u × t
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    parts = (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)
    return np.stack(parts, axis=-1)


def conjugate(q: F32) -> F32:
    """The inverses of unit quaternions."""
    return q * np.array([1, -1, -1, -1], q.dtype)


def normalise(q: F32) -> F32:
    """Quaternions of unit length."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def about_axis(axis: F32, angle: F32) -> F32:
    """Turns by angles (radians) about axes of unit length."""
    half = 0.5 * np.asarray(angle)[..., None]
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=-1)


def angle_between(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> F64:
    """Angles (radians) between rotations, in double precision."""
    a, b = normalise64(a), normalise64(b)
    cosine = np.abs(np.sum(a * b, axis=-1))
    # |a - b| is exact where the angle is small, unlike the arc cosine.
    distance = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return np.where(cosine > 0.9, 4 * np.arcsin(np.minimum(distance / 2, 1)), 2 * np.arccos(np.minimum(cosine, 1)))


def normalise64(q: npt.NDArray[np.floating]) -> F64:
    """Quaternions of unit length in double precision."""
    q = np.asarray(q, np.float64)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def continuous(q: F32) -> F32:
    """Quaternions along axis 0 with the signs that make each the nearest to the one before."""
    turns = np.sum(q[1:] * q[:-1], axis=-1) < 0
    signs = np.where(np.cumsum(turns, axis=0) % 2 == 1, -1, 1).astype(q.dtype)
    return np.concatenate([q[:1], q[1:] * signs[..., None]])
