"""Rotation maths in numpy (data preparation) and torch (training): matrices, Euler angles, 6D, headings.

The 6D form (Zhou et al. 2019) is the first two columns of the matrix, column 0 then column 1.
"""

import math

import numpy as np
import torch
from torch import Tensor


def axis_rotation(axis: str, degrees: np.ndarray) -> np.ndarray:
    """Rotation matrices ``[..., 3, 3]`` about the coordinate axis "X", "Y" or "Z"."""
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*angle.shape, 3, 3), dtype=np.float64)
    i = "XYZ".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    out[..., i, i] = 1.0
    out[..., j, j] = c
    out[..., k, k] = c
    out[..., j, k] = -s
    out[..., k, j] = s
    return out


def wrap_angle(angle: Tensor) -> Tensor:
    """Angle wrapped to (-pi, pi]."""
    return torch.arctan2(torch.sin(angle), torch.cos(angle))


def arc_tangent(sine: Tensor, cosine: Tensor) -> Tensor:
    """``torch.atan2``, zero at the origin, without its nodes in a graph.

    ONNX has no atan2. What PyTorch writes for it asks whether 0/0 came out, by an ``IsNaN`` that OpenVINO does not take: each
    cuts a network into parts that are handed back and forth.
    """
    slope = sine / torch.where(cosine == 0.0, 1e-20, cosine)
    half_turn = torch.where(sine < 0.0, -math.pi, math.pi)
    return torch.atan(slope) + torch.where(cosine < 0.0, half_turn, 0.0)


def yaw_matrix(psi: Tensor) -> Tensor:
    """Rotation about +Y by ``psi`` ``[...]`` as ``[..., 3, 3]``; takes +Z to (sin psi, 0, cos psi)."""
    c, s = torch.cos(psi), torch.sin(psi)
    zero, one = torch.zeros_like(c), torch.ones_like(c)
    rows = [torch.stack([c, zero, s], -1), torch.stack([zero, one, zero], -1), torch.stack([-s, zero, c], -1)]
    return torch.stack(rows, -2)


def six_d_to_matrix(six: Tensor) -> Tensor:
    """Gram-Schmidt of ``[..., 6]`` to ``[..., 3, 3]``."""
    a, b = six[..., :3], six[..., 3:]
    x = a / torch.sqrt((a * a).sum(-1, keepdim=True) + 1e-8)
    b = b - (x * b).sum(-1, keepdim=True) * x
    y = b / torch.sqrt((b * b).sum(-1, keepdim=True) + 1e-8)
    z = torch.stack(
        [
            x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
            x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
            x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0],
        ],
        -1,
    )
    return torch.stack([x, y, z], -1)


def matrix_to_six_d(matrix: Tensor) -> Tensor:
    """First two columns of ``[..., 3, 3]`` as ``[..., 6]``."""
    return torch.cat([matrix[..., 0], matrix[..., 1]], -1)


def columns_to_matrix(six_d: np.ndarray) -> np.ndarray:
    """Orthonormal columns ``[..., 6]`` to ``[..., 3, 3]`` in 64 bits."""
    x, y = six_d[..., :3].astype(np.float64), six_d[..., 3:].astype(np.float64)
    return np.stack([x, y, np.cross(x, y)], -1)


def quat_to_matrix(quat: Tensor) -> Tensor:
    """Unit quaternions (w, x, y, z) ``[..., 4]`` to ``[..., 3, 3]``."""
    w, x, y, z = quat.unbind(-1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def matrix_to_quat(matrix: Tensor) -> Tensor:
    """Rotation matrices ``[..., 3, 3]`` to unit quaternions (w, x, y, z), w or the largest part positive.

    Each of w, x, y, z gives a quaternion up to its length, which is exact where that part is large; the longest is taken.
    """
    xx, yy, zz = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 2, 2]
    x, y, z = (matrix[..., j, k] - matrix[..., k, j] for j, k in ((2, 1), (0, 2), (1, 0)))
    xy, xz, yz = (matrix[..., j, k] + matrix[..., k, j] for j, k in ((0, 1), (0, 2), (1, 2)))
    rows = (
        (1 + (xx + yy + zz), x, y, z),
        (x, 1 + xx - yy - zz, xy, xz),
        (y, xy, 1 - xx + yy - zz, yz),
        (z, xz, yz, 1 - xx - yy + zz),
    )
    candidates = torch.stack([torch.stack(row, -1) for row in rows], -2)
    best = candidates.norm(dim=-1).argmax(-1)
    quat = torch.gather(candidates, -2, best[..., None, None].expand(*best.shape, 1, 4)).squeeze(-2)
    return quat / quat.norm(dim=-1, keepdim=True).clamp_min(1e-8)
