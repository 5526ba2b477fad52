"""The compact form of frames: a root in tenths of a millimetre and smallest-three quaternions of 15 bits a component.

`FrameBlock` in `session.proto` describes it. Decoding is one pass over all characters, frames and joints.
"""

from __future__ import annotations

import numpy as np

from troupe.arrays import F32

BYTES_PER_ROOT = 12
BYTES_PER_ROTATION = 6
ROOT_STEP_M = 1e-4
MAX_ROTATION_ERROR_RAD = 1.6e-4
"""Largest angle between a rotation and what its encoding decodes to."""
MAX_ROOT_ERROR_M = 6e-5
"""Largest error of a root along an axis, within 256 m of the origin."""

# Which of (three written components, the one that is left out) each of (w, x, y, z) is, by the
# index of the one that is left out.
_PLACES = np.array([[3, 0, 1, 2], [0, 3, 1, 2], [0, 1, 3, 2], [0, 1, 2, 3]])


def decode_roots(data: bytes) -> F32:
    """(roots, 3) metres along the session's axes."""
    steps = np.frombuffer(data, "<i4").reshape(-1, 3)
    return (steps * np.float64(ROOT_STEP_M)).astype(np.float32)


def decode_rotations(data: bytes) -> F32:
    """(rotations, 4) unit quaternions (w, x, y, z)."""
    words = np.frombuffer(data, "<u2").reshape(-1, 3)
    left_out = (words[:, 0] >> 15) | (words[:, 1] >> 15) << 1
    parts = np.empty((len(words), 4), np.float32)
    written = parts[:, :3]
    np.multiply(words & 0x7FFF, np.float32(np.sqrt(2) / 0x7FFF), out=written)
    written -= np.float32(np.sqrt(0.5))
    parts[:, 3] = np.sqrt(np.maximum(1 - np.einsum("ij,ij->i", written, written), 0))
    quaternions = np.take_along_axis(parts, _PLACES[left_out], axis=1)
    quaternions /= np.sqrt(np.einsum("ij,ij->i", quaternions, quaternions))[:, None]
    return quaternions


def decode_contacts(data: bytes, joints: int) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """(frames, contact joints) whether each is on the ground: bit i of a byte is joint i."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8)[:, None], axis=1, bitorder="little")
    return bits[:, :joints].astype(bool)
