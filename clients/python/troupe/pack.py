"""Model packs as the server describes them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from troupe.errors import AnswerError, InvalidArgumentError
from troupe.skeleton import Hinge, Mimic, Robot, Skeleton
from troupe.v1 import motion_pb2, skeleton_pb2


@dataclass(frozen=True)
class Body:
    """One of the bodies that a pack's network moves."""

    name: str
    skeleton: Skeleton = field(repr=False)
    """Without joints where the pack came with a list of all packs."""
    height: float
    """Height of the root where it stands, metres."""
    words: tuple[str, ...] = field(repr=False)
    """Words that its clips show."""


@dataclass(frozen=True)
class Pack:
    """A pack that the server has loaded."""

    name: str
    version: str
    fps: float
    capabilities: frozenset[str]
    """Its capabilities: inbetween, live, path, text, describe, agents."""
    skeleton: Skeleton = field(repr=False)
    bodies: tuple[Body, ...] = field(repr=False)
    """The bodies that the pack moves, the default one first. None: the pack has one skeleton."""
    body: str
    """Whose skeleton this is; empty for the pack's own."""
    message: motion_pb2.Pack = field(repr=False, compare=False)
    """All that the server says about it."""
    own: skeleton_pb2.OwnSkeleton | None = field(default=None, repr=False, compare=False)
    """The skeleton of your own that its characters wear, with its certificate (`Client.skeleton`). None: the pack's."""

    @property
    def worn(self) -> str:
        """Name of the skeleton of your own that its characters wear; empty for none."""
        return self.own.name if self.own else ""

    @property
    def scale(self) -> float:
        """Length of the legs of a skeleton of your own by that of the pack's: what lengths are multiplied by."""
        return self.own.fit.scale if self.own else 1.0

    def wearing(self, own: skeleton_pb2.OwnSkeleton) -> Pack:
        """The same pack, whose characters wear a skeleton of your own: all calls with it are on that skeleton."""
        return replace(self, skeleton=_skeleton(own, own.fit.contact_joints), own=own)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The skeleton's joints, in the order of frames."""
        return self.skeleton.names

    @property
    def robot(self) -> Robot | None:
        """The robot that it animates. None: it is no robot's."""
        return self.skeleton.robot

    @property
    def is_default(self) -> bool:
        """Whether it answers requests that name no pack."""
        return self.message.is_default

    @property
    def skills(self) -> tuple[str, ...]:
        """Names of its characters' skills: see `troupe.skill`."""
        return tuple(skill.name for skill in self.message.skills)

    def of_body(self, name: str) -> Pack:
        """The same pack with one of its bodies: its skeleton and robot are that body's. An empty name: the default body.

        Raises:
            InvalidArgumentError: The pack has no such body.

        """
        for body in self.bodies:
            if name in ("", body.name):
                if not body.skeleton.joint_count:
                    message = f"body: a list of packs has no joints of bodies: use client.pack({self.name!r})"
                    raise InvalidArgumentError(message, field="body")
                return replace(self, skeleton=body.skeleton, body=body.name)
        allowed = ", ".join(body.name for body in self.bodies) or "none: the pack has one skeleton"
        message = f"body: pack {self.name} has no body {name!r}; allowed: {allowed}"
        raise InvalidArgumentError(message, field="body", allowed=allowed)


def of_message(message: motion_pb2.Pack) -> Pack:
    """Reads a pack."""
    skeleton = _skeleton(message, message.contact_joints)
    return Pack(
        name=message.name,
        version=message.version,
        fps=message.fps,
        capabilities=frozenset(message.capabilities),
        skeleton=skeleton,
        bodies=tuple(
            Body(body.name, _skeleton(body, body.contact_joints), body.height, tuple(body.words))
            for body in message.bodies
        ),
        body="",
        message=message,
    )


def _skeleton(
    of: motion_pb2.Pack | motion_pb2.PackBody | skeleton_pb2.OwnSkeleton, contact_joints: Iterable[str]
) -> Skeleton:
    names = tuple(joint.name for joint in of.joints)
    parents = tuple(joint.parent for joint in of.joints)
    if any(not -1 <= parent < joint for joint, parent in enumerate(parents)) or parents.count(-1) > 1:
        raise AnswerError(f"the skeleton of {of.name}: a joint comes before its parent")
    offsets = np.array([(j.offset.x, j.offset.y, j.offset.z) for j in of.joints], np.float32).reshape(-1, 3)
    return Skeleton(
        names=names,
        parents=parents,
        offsets=offsets,
        contact_joints=tuple(contact_joints),
        left_axis=(of.left_axis.x, of.left_axis.y, of.left_axis.z),
        robot=_robot(of.robot, names) if of.HasField("robot") and names else None,
    )


def _robot(of: motion_pb2.Robot, names: tuple[str, ...]) -> Robot:
    unknown = [hinge.joint for hinge in of.hinges if hinge.joint not in names]
    if unknown:
        raise AnswerError(f"robot {of.name}: hinges of joints that are not there: {', '.join(unknown)}")
    hinges = tuple(
        Hinge(
            joint=hinge.joint,
            index=names.index(hinge.joint),
            axis=(hinge.axis.x, hinge.axis.y, hinge.axis.z),
            rest=(hinge.rest.w, hinge.rest.x, hinge.rest.y, hinge.rest.z),
            lower=hinge.lower,
            upper=hinge.upper,
            max_speed=hinge.max_speed,
            max_acceleration=hinge.max_acceleration if hinge.HasField("max_acceleration") else None,
        )
        for hinge in of.hinges
    )
    joints = [hinge.joint for hinge in hinges]
    lost = [mimic.joint for mimic in of.mimics if mimic.joint not in names or mimic.follows not in joints]
    if lost:
        raise AnswerError(f"robot {of.name}: joints that follow no hinge, or are not there: {', '.join(lost)}")
    mimics = tuple(
        Mimic(
            joint=mimic.joint,
            index=names.index(mimic.joint),
            hinge=joints.index(mimic.follows),
            multiplier=mimic.multiplier,
            offset=mimic.offset,
            axis=(mimic.axis.x, mimic.axis.y, mimic.axis.z),
            rest=(mimic.rest.w, mimic.rest.x, mimic.rest.y, mimic.rest.z),
        )
        for mimic in of.mimics
    )
    return Robot(of.name, hinges, mimics)
