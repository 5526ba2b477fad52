"""The root of a motion, globally (its place) and locally (its movement), and from one to the other."""

import torch
from torch import Tensor

from troupe_training.data.conventions import FPS
from troupe_training.data.rotations import arc_tangent


def local_root_of(global_root: Tensor) -> Tensor:
    """Local root ``[..., T, 4]`` from global root ``[..., T, 5]`` by backward differences; frame 0 copies frame 1.

    Global: x, y, z (m), cosine and sine of the heading. Local: x and z velocity (m/s), angular velocity (rad/s), height (m).

    The arc tangent is taken of T numbers a row, not of the T - 1 there are: ONNX Runtime computes it four at a time and
    rounds what is left over otherwise, and a row of the batch must not depend on where in the tensor it lies.
    """
    y, c, s = global_root[..., 1], global_root[..., 3], global_root[..., 4]
    # Metres in 16 bits are a centimetre off, which 30 times a second is more than walking differs
    # by. Sixteenths are exact in them up to 16 m, and what is left over is small.
    coarse = torch.round(global_root * 16) / 16
    fine = global_root - coarse
    step = (coarse[..., 1:, :] - coarse[..., :-1, :]) + (fine[..., 1:, :] - fine[..., :-1, :])
    dx, dz = step[..., 0] * FPS, step[..., 2] * FPS
    # sin and cos of the heading's change, without any arc tangent of the headings themselves
    turn_sin = step[..., 4] * c[..., :-1] - step[..., 3] * s[..., :-1]
    turn_cos = c[..., 1:] * c[..., :-1] + s[..., 1:] * s[..., :-1]
    moving = torch.stack([dx, dz, turn_sin, turn_cos], -1)
    dx, dz, turn_sin, turn_cos = torch.cat([moving[..., :1, :], moving], -2).unbind(-1)
    omega = arc_tangent(turn_sin, turn_cos) * FPS
    return torch.stack([dx, dz, omega, y], -1)


def integrate_root(start: Tensor, local_root: Tensor) -> Tensor:
    """Global root ``[B, T, 5]`` from its first value ``[B, 5]`` and local roots ``[B, T, 4]``.

    The first heading is computed at every frame, for the reason that `local_root_of` gives.
    """
    start = start[:, None].expand(-1, local_root.shape[1], -1)
    step = local_root[..., :3] / FPS
    first = torch.zeros_like(step[:, :1])
    travelled = torch.cumsum(torch.cat([first, step[:, 1:]], 1), 1)
    psi = arc_tangent(start[..., 4], start[..., 3]) + travelled[..., 2]
    return torch.stack(
        [
            start[..., 0] + travelled[..., 0],
            local_root[..., 3],
            start[..., 2] + travelled[..., 1],
            torch.cos(psi),
            torch.sin(psi),
        ],
        -1,
    )
