"""Robots: world rotations onto hinge angles within their limits, and back.

``Skeleton.robot`` holds the hinges: the joint, its axis in its own frame, its rest rotation relative to the parent joint
(w x y z) and its limits in radians. The world rotation of a hinge joint is ``R_parent · rest · R(axis, angle)``; a joint
without a hinge follows one, or turns with its parent, and the root floats.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from troupe_training.data.motion import Motion
from troupe_training.data.rotations import matrix_to_quat, quat_to_matrix
from troupe_training.data.skeleton import Skeleton

FULL_TURN = 2.0 * torch.pi
# An angle that is past its limit by less is rounding, not a limit met.
TOLERANCE_RAD = 1e-4


@dataclass
class Projection:
    """What hinges within their limits make of rotations ``[..., J, 3, 3]``; H hinges in the robot's order."""

    rotations: Tensor  # [..., J, 3, 3], world
    angles: Tensor  # [..., H], radians, within the limits
    residual_rad: Tensor  # [..., H]: angle between the joint's rotation in the world and what is made of it
    clamped: Tensor  # [..., H], true for hinges whose nearest angle was out of the limits


class Hinges:
    """The hinges of a robot's skeleton as tensors."""

    def __init__(self, skeleton: Skeleton):
        if not skeleton.robot:
            raise ValueError("the skeleton is no robot's: it has no hinges")
        hinges = skeleton.robot["hinges"]
        self.parents = skeleton.parents
        self.joints = [skeleton.names.index(h["joint"]) for h in hinges]
        self.hinge_of = {joint: i for i, joint in enumerate(self.joints)}
        self.axis = torch.tensor([h["axis"] for h in hinges])
        self.rest = quat_to_matrix(torch.tensor([h["rest"] for h in hinges]))
        self.lower = torch.tensor([h["lower_rad"] for h in hinges])
        self.upper = torch.tensor([h["upper_rad"] for h in hinges])
        self.follows = {skeleton.names.index(of["joint"]): of for of in skeleton.robot.get("mimics", [])}
        self._leaders = {j: self.hinge_of[skeleton.names.index(of["follows"])] for j, of in self.follows.items()}

    def turn(self, hinge: int, angle: Tensor) -> Tensor:
        """Rotations ``[..., 3, 3]`` relative to the parent joint at a hinge's angles ``[...]``."""
        return _turn(self.rest[hinge], self.axis[hinge], angle)

    def followed(self, joint: int, angles: Tensor) -> Tensor:
        """Rotations ``[..., 3, 3]`` relative to the parent joint of a joint that follows a hinge, at all hinges' angles."""
        of = self.follows[joint]
        angle = of["multiplier"] * angles[..., self._leaders[joint]] + of["offset_rad"]
        return _turn(quat_to_matrix(torch.tensor(of["rest"])), torch.tensor(of["axis"]), angle)

    def nearest(self, hinge: int, relative: Tensor) -> Tensor:
        """Nearest angles ``[...]`` of one hinge to rotations ``[..., 3, 3]`` relative to the parent joint.

        Of the angles a full turn apart, that nearest to the limits.
        """
        quat = matrix_to_quat(self.rest[hinge].T @ relative)
        angle = 2.0 * torch.atan2((quat[..., 1:] * self.axis[hinge]).sum(-1), quat[..., 0])
        middle = (self.lower[hinge] + self.upper[hinge]) / 2
        return angle - FULL_TURN * torch.round((angle - middle) / FULL_TURN)

    def project(self, rotations: Tensor) -> Projection:
        """World rotations ``[..., J, 3, 3]`` onto the hinges and into their limits, as the server does it.

        From the root outwards each hinge turns as near as it can to where the motion has its joint in the world, so that a
        hinge makes up for what those above it lack.
        """
        shape = (*rotations.shape[:-3], len(self.joints))
        angles, residual = rotations.new_zeros(shape), rotations.new_zeros(shape)
        clamped = torch.zeros(shape, dtype=torch.bool)
        world: list[Tensor] = []
        for joint, parent in enumerate(self.parents):
            wanted = rotations[..., joint, :, :]
            if parent < 0:
                world.append(wanted)
            elif joint in self.follows:
                world.append(world[parent] @ self.followed(joint, angles))
            elif joint not in self.hinge_of:
                world.append(world[parent])
            else:
                hinge = self.hinge_of[joint]
                nearest = self.nearest(hinge, world[parent].transpose(-1, -2) @ wanted)
                angle = nearest.clamp(self.lower[hinge], self.upper[hinge])
                world.append(world[parent] @ self.turn(hinge, angle))
                lacking = matrix_to_quat(world[joint].transpose(-1, -2) @ wanted)
                angles[..., hinge] = angle
                residual[..., hinge] = 2.0 * torch.atan2(lacking[..., 1:].norm(dim=-1), lacking[..., 0].abs())
                clamped[..., hinge] = (angle - nearest).abs() > TOLERANCE_RAD
        made = torch.stack(world, -3)
        return Projection(made, angles, residual, clamped)


def _turn(rest: Tensor, axis: Tensor, angle: Tensor) -> Tensor:
    half = (angle / 2)[..., None]
    return rest @ quat_to_matrix(torch.cat([torch.cos(half), torch.sin(half) * axis], -1))


def on_hinges(hinges: Hinges, motion: Motion) -> tuple[Motion, dict[str, Tensor]]:
    """The motion that the robot can make, and for each of the B motions what that took (angles in degrees)."""
    made = hinges.project(motion.rotations)
    residual = torch.rad2deg(made.residual_rad).flatten(1)
    figures = {
        "hinge_residual_mean_deg": residual.mean(1),
        "hinge_residual_max_deg": residual.amax(1),
        "hinge_clamped_share": made.clamped.float().flatten(1).mean(1),
    }
    return Motion(motion.root, made.rotations, motion.contacts), figures
