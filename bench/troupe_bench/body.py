"""The binary bodies of the Python servers: little-endian numbers, no parsing beyond a header.

A request, as `tests/examples/bench_requests.rs` writes it: ``TBQ1``, then frames, targets and a bit for each allowed token
count as 32-bit integers, then 32-bit floats for the context and target keyframes, one column after the other: which parts are
given ``[keys, 3]``, local root ``[keys, 4]``, global root ``[keys, 5]``, pose ``[keys, joints * 9]``.

An answer: ``TBA1``, tokens and frames as 32-bit integers, then 32-bit floats: rotations ``[frames, joints, 6]``, root
``[frames, 5]``, contacts ``[frames, contacts]``.
"""

import struct
from dataclasses import dataclass

import numpy as np

REQUEST = struct.Struct("<4sIII")
ANSWER = struct.Struct("<4sII")
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

    Raises ValueError where the body is none.
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
