"""Motion of a robot as Unitree publishes it: CSV without a header, a frame a row.

The root's x y z (metres) and qx qy qz qw in ROS axes, then the angles of the hinges in their order, radians.
"""

from __future__ import annotations

from io import StringIO
from typing import NoReturn

import numpy as np

from troupe import rotation
from troupe.arrays import F32
from troupe.errors import InvalidArgumentError
from troupe.skeleton import ROOT_QPOS, Skeleton

UNIT_TOLERANCE = 1e-3
_XYZW, _WXYZ = [4, 5, 6, 3], [6, 3, 4, 5]
_UPRIGHT, _CLEAR = 0.8, 0.5
"""Mean cosine of the tilt of a robot that stands, and the difference between two readings that leaves no doubt."""
_MIN_WAY_M = 1.0
_FAR_RAD = 0.5
"""An angle that is farther beyond its limits means something else."""


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


def read(data: bytes, name: str, skeleton: Skeleton) -> tuple[F32, F32]:
    """Native roots and rotations of a file.

    Angles may be beyond the hinges' limits, but not so far that the file must mean something else.
    """
    check_robot(skeleton)
    size = skeleton.robot.qpos_size if skeleton.robot else ROOT_QPOS
    try:
        text = data.decode("utf-8-sig")
        rows = np.loadtxt(StringIO(text), np.float32, delimiter=",", ndmin=2) if text.strip() else None
    except ValueError as error:
        _refuse(name, str(error), f"{size} numbers a line")
    if rows is None:
        _refuse(name, "it has no frames", "one frame or more")
    if rows.shape[1] != size:
        _refuse(name, f"{rows.shape[1]} columns; allowed: {size}", f"{size} finite numbers a line")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        _refuse(name, f"frame {int(finite.argmin())} is not finite", f"{size} finite numbers a line")
    lengths = np.linalg.norm(rows[:, 3:ROOT_QPOS], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_TOLERANCE)
    if wrong.size:
        _refuse(name, f"the rotation of frame {wrong[0]} has length {lengths[wrong[0]]:g}", "0.999 to 1.001")
    qpos = np.concatenate([rows[:, :3], rows[:, _WXYZ] / lengths[:, None], rows[:, ROOT_QPOS:]], axis=1)
    _check_order(name, qpos, rows[:, 3:ROOT_QPOS])
    _check_limits(name, rows[:, ROOT_QPOS:], skeleton)
    return skeleton.of_qpos(qpos)


def _refuse(name: str, reason: str, allowed: str) -> NoReturn:
    way_on = "`Clip.read` and `troupe clip convert` read more kinds of files"
    raise InvalidArgumentError(f"{name}: {reason}; {way_on}", field="csv", allowed=allowed)


def _check_order(name: str, qpos: F32, as_wxyz: F32) -> None:
    """Refuses quaternions that must be w x y z, because the robot then stands or walks ahead and else does not."""
    (upright, ahead), (other, other_ahead) = _stands(qpos[:, :3], qpos[:, 3:ROOT_QPOS]), _stands(qpos[:, :3], as_wxyz)
    is_other = other >= _UPRIGHT and (other - upright >= _CLEAR or (upright < _UPRIGHT and other > upright))
    if is_other or (ahead <= -_CLEAR and other_ahead >= _CLEAR):
        _refuse(name, "its quaternions seem to be w x y z", "x y z w")


def _stands(places: F32, quaternions: F32) -> tuple[float, float]:
    """Mean cosine of the root's tilt, and of the angle between where it faces and where it goes; 0 if it stays."""
    up = rotation.rotate(quaternions, np.array([0, 0, 1], np.float32))
    facing = rotation.rotate(quaternions, np.array([1, 0, 0], np.float32))[:-1, :2]
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-6)
    steps = np.diff(places[:, :2], axis=0)
    way = float(np.linalg.norm(steps, axis=1).sum())
    ahead = float((facing * steps).sum() / way) if way >= _MIN_WAY_M else 0.0
    return float(up[:, 2].mean()), ahead


def _check_limits(name: str, angles: F32, skeleton: Skeleton) -> None:
    """Refuses angles far beyond the limits: of another unit, order or robot."""
    hinges = skeleton.robot.hinges if skeleton.robot else ()
    lower, upper = np.array([hinge.lower for hinge in hinges]), np.array([hinge.upper for hinge in hinges])
    beyond = np.maximum(lower - angles, angles - upper)
    frame, nth = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[frame, nth] > _FAR_RAD:
        limits = f"{lower[nth]:.2f} to {upper[nth]:.2f} rad"
        reason = f"{hinges[nth].joint} is {beyond[frame, nth]:.2f} rad beyond its limits, {limits}, in frame {frame}"
        _refuse(name, reason, "radians, in the robot's order")
