"""The binary bodies of the Python servers: little-endian numbers, no parsing beyond a header.

A request, as `eval/src/files/requests.rs` writes it: ``TBQ1``, then frames, targets and a bit for each allowed token
count as 32-bit integers, then 32-bit floats for the context and target keyframes, one column after the other: which parts are
given ``[keys, 3]``, local root ``[keys, 4]``, global root ``[keys, 5]``, pose ``[keys, joints * 9]``.

An answer: ``TBA1``, tokens and frames as 32-bit integers, then 32-bit floats: rotations ``[frames, joints, 6]``, root
``[frames, 5]``, contacts ``[frames, contacts]``.

A part of a motion of words: ``TBW1``, frames and the bytes that follow as 32-bit integers, then 32-bit floats: root
``[frames, 5]``, world rotations ``[frames, joints * 6]``. A part without frames ends the answer.
"""

import struct
from dataclasses import dataclass

import numpy as np

REQUEST = struct.Struct("<4sIII")
ANSWER = struct.Struct("<4sII")
PART = struct.Struct("<4sII")
CONTEXT_FRAMES = 4


@dataclass
class Task:
    """One character's task; the arrays are views into the request's body."""

    frames: int
    targets: int
    allowed: int  # one bit for each token count
    given: np.ndarray
    local_root: np.ndarray
    global_root: np.ndarray
    pose: np.ndarray


def read_task(body: bytes, pose_width: int) -> Task:
    """Reads a request.

    Raises ValueError if the body is not one.
    """
    if len(body) < REQUEST.size:
        raise ValueError(f"the body has {len(body)} bytes, fewer than its header")
    magic, frames, targets, allowed = REQUEST.unpack_from(body)
    keys = CONTEXT_FRAMES + targets
    widths = (3, 4, 5, pose_width)
    if magic != b"TBQ1" or not 1 <= targets <= 4 or len(body) != REQUEST.size + 4 * keys * sum(widths):
        raise ValueError("the body is no request")
    columns, start = [], REQUEST.size
    for width in widths:
        columns.append(np.frombuffer(body, "<f4", keys * width, start).reshape(keys, width))
        start += 4 * keys * width
    return Task(frames, targets, allowed, *columns)


def write_answer(tokens: int, rotations: np.ndarray, root: np.ndarray, contacts: np.ndarray) -> bytes:
    """Writes an answer of one row of each output."""
    header = ANSWER.pack(b"TBA1", tokens, len(root))
    return b"".join((header, rotations.tobytes(), root.tobytes(), contacts.tobytes()))


def write_frames(root: np.ndarray | None, rotations: np.ndarray | None) -> bytes:
    """Writes a part of a motion of words, or its end."""
    if root is None or rotations is None:
        return PART.pack(b"TBW1", 0, 0)
    bodies = root.astype("<f4", copy=False).tobytes() + rotations.astype("<f4", copy=False).tobytes()
    return PART.pack(b"TBW1", len(root), len(bodies)) + bodies


def read_frames_header(header: bytes) -> tuple[int, int]:
    """Frames of a part, and the bytes behind its header.

    Raises ValueError if it is not a header.
    """
    if len(header) != PART.size:
        raise ValueError(f"the answer ends inside a part, after {len(header)} bytes of its header")
    magic, frames, size = PART.unpack(header)
    if magic != b"TBW1":
        raise ValueError("the answer is none of frames")
    return frames, size


def read_frames(body: bytes, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots ``[frames, 5]`` and rotations ``[frames, joints * 6]`` of a part."""
    numbers = np.frombuffer(body, "<f4")
    return numbers[: 5 * frames].reshape(frames, 5), numbers[5 * frames :].reshape(frames, -1)
