"""Keyframes: any part of a frame, to begin from or to reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from troupe.arrays import floats
from troupe.v1 import motion_pb2

CONTEXT_FRAMES = 4
"""Context frames in front of a gap."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """Any part of a frame, but at least one: root, velocity, pose, or a robot's `qpos` in place of root and pose.

    `Keyframe(root=(0, 0.93, 2), heading=math.pi / 2)` is two metres ahead, faces +X, and leaves the pose to the networks.
    """

    root: npt.ArrayLike | None = None
    """(3) world position of the root joint, metres."""
    heading: float | None = None
    """Radians about +Y, with a root. None: that of the pose, which must be given then."""
    rotations: npt.ArrayLike | None = None
    """(joints, 4) w x y z: the first joint's in the world, others relative to their parents."""
    velocity: npt.ArrayLike | None = None
    """(3): metres a second along world X and Z, and radians a second about +Y."""
    root_height: float | None = None
    """Height of the root joint, metres, which a keyframe without a root needs."""
    qpos: npt.ArrayLike | None = None
    """(qpos_size) MuJoCo's, for packs with a robot."""

    def to_message(self, field: str, joints: int | None = None) -> motion_pb2.Keyframe:
        """The keyframe on the wire. `field` names it in errors."""
        message = motion_pb2.Keyframe()
        if self.root is not None:
            x, y, z = floats(f"{field}.root", self.root, (3,)).tolist()
            message.root.position.x, message.root.position.y, message.root.position.z = x, y, z
            if self.heading is not None:
                message.root.heading = self.heading
        if self.velocity is not None:
            vx, vz, angular = floats(f"{field}.velocity", self.velocity, (3,)).tolist()
            message.velocity.x, message.velocity.z, message.velocity.angular = vx, vz, angular
            if self.root_height is not None:
                message.velocity.height = self.root_height
        if self.rotations is not None:
            message.pose.rotations.extend(floats(f"{field}.rotations", self.rotations, (joints, 4)).ravel())
            if self.root_height is not None:
                message.pose.root_height = self.root_height
        if self.qpos is not None:
            message.qpos.extend(floats(f"{field}.qpos", self.qpos, (None,)))
        return message
