"""Motion of a robot as Unitree publishes it: CSV without a header, a frame a row.

The root's x y z (metres) and qx qy qz qw in ROS axes, then the angles of the hinges in their order, radians.
"""

from __future__ import annotations

from io import StringIO

import numpy as np

from troupe import rotation
from troupe.arrays import F32
from troupe.errors import InvalidArgumentError
from troupe.skeleton import ROOT_QPOS, Skeleton

UNIT_TOLERANCE = 1e-3
_XYZW, _WXYZ = [4, 5, 6, 3], [6, 3, 4, 5]


def check_robot(skeleton: Skeleton) -> None:
    """Refuses a skeleton that is no robot's."""
    if skeleton.robot is None:
        message = "skeleton: it is no robot's: it has no hinges that numbers could be angles of"
        raise InvalidArgumentError(message, field="skeleton", allowed="one with a robot")


def write(skeleton: Skeleton, root: F32, rotations: F32) -> str:
    """The text of native frames, on the hinges and within their limits, with six digits behind the point."""
    check_robot(skeleton)
    qpos = skeleton.to_qpos(root, rotations).astype(np.float64)
    # One who reads the columns as curves sees no jump to the other sign.
    qpos[:, 3:ROOT_QPOS] = rotation.continuous(qpos[:, 3:ROOT_QPOS].astype(np.float32))
    columns = np.concatenate([qpos[:, :3], qpos[:, _XYZW], qpos[:, ROOT_QPOS:]], axis=1)
    out = StringIO()
    np.savetxt(out, columns, fmt="%.6f", delimiter=",")
    return out.getvalue()


def read(text: str, skeleton: Skeleton) -> tuple[F32, F32]:
    """Native roots and rotations of a text. Angles are taken as they are, also outside of the hinges' limits."""
    check_robot(skeleton)
    size = skeleton.robot.qpos_size if skeleton.robot else ROOT_QPOS
    try:
        rows = np.loadtxt(StringIO(text), np.float32, delimiter=",", ndmin=2)
    except ValueError as error:
        raise InvalidArgumentError(f"csv: {error}", field="csv", allowed=f"{size} numbers a line") from error
    if rows.shape[1] != size or not np.isfinite(rows).all():
        message = f"csv: {rows.shape[1]} columns; allowed: {size} finite numbers a line"
        raise InvalidArgumentError(message, field="csv", allowed=f"{size} finite numbers a line")
    lengths = np.linalg.norm(rows[:, 3:ROOT_QPOS], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_TOLERANCE)
    if wrong.size:
        message = f"csv: the rotation of frame {wrong[0]} has length {lengths[wrong[0]]:g}; allowed: 0.999 to 1.001"
        raise InvalidArgumentError(message, field="csv", allowed="0.999 to 1.001")
    qpos = np.concatenate([rows[:, :3], rows[:, _WXYZ] / lengths[:, None], rows[:, ROOT_QPOS:]], axis=1)
    return skeleton.of_qpos(qpos)
