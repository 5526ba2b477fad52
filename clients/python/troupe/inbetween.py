"""Gaps to fill, and their answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from troupe.arrays import F32, Ints
from troupe.clip import Clip
from troupe.errors import AnswerError, InvalidArgumentError
from troupe.keyframe import CONTEXT_FRAMES, Keyframe
from troupe.pack import Pack
from troupe.v1 import motion_pb2


@dataclass(frozen=True)
class RootKey:
    """The wanted root in a frame of a segment: any part of place, height and heading.

    The rest is as the networks make it.
    """

    frame: int
    """Counted from the first context frame, which is 0."""
    x: float | None = None
    """World X of the root joint, metres; with `z`, or neither."""
    z: float | None = None
    """World Z of the root joint, metres."""
    height: float | None = None
    """Height of the root joint, metres."""
    heading: float | None = None
    """Radians about +Y."""

    def to_message(self) -> motion_pb2.RootKey:
        """The root on the wire."""
        return motion_pb2.RootKey(frame=self.frame, x=self.x, z=self.z, height=self.height, heading=self.heading)


@dataclass(frozen=True, eq=False)
class InBetween:
    """One character's gap: four context frames, one to four target keyframes, and how to fill what lies between."""

    context: Clip | Sequence[Keyframe]
    """Four consecutive frames at the pack's rate, oldest first, each with root and pose."""
    targets: Clip | Sequence[Keyframe]
    """One to four consecutive keyframes, of which any part may be given; the last is the final frame."""
    frames: int | None = None
    """Frames of the whole segment, context and targets included: 12 to 64. None: the model predicts it."""
    token_counts: Sequence[int] = ()
    """Without `frames`: lengths that the model may predict, in tokens of four frames, 3 to 16. None: all."""
    seed: int = 0
    """The same seed, input and pack give the same frames."""
    temperature: float = 0.0
    """0 takes the most likely motion; above it is sampled with the seed, up to 2."""
    pose_steps: int | None = None
    """Passes of the pose module, 1 (the default) to 10."""
    hold_feet: bool | None = None
    """Whether feet that stand are held still by bending the legs: they are by default."""
    id: str = ""
    """Comes back with the answer."""
    intermediates: bool = False
    """Whether to return what each stage produced as well."""
    strict: bool = False
    """Whether the server is to refuse the gap where its answer would not be feasible, and to say what would be."""
    root: Sequence[RootKey] = ()
    """Where the root is to be in some frames, in rising order, or in every one.

    In between the predicted way is moved along by a smooth curve. The pose tokens stay those of the predicted way. It needs
    `frames`.
    """

    @staticmethod
    def from_clip(clip: Clip, after: int, until: int, **options: object) -> InBetween:
        """The gap of a clip between `after`, the last context frame, and `until`, the target keyframe.

        Raises:
            InvalidArgumentError: The clip lacks these frames.

        """
        first = after - CONTEXT_FRAMES + 1
        if first < 0 or after >= until or until >= len(clip):
            allowed = f"{CONTEXT_FRAMES - 1} <= after < until < {len(clip)}"
            message = f"the gap from {after} to {until} is not in the clip; allowed: {allowed}"
            raise InvalidArgumentError(message, field="after" if first < 0 else "until", allowed=allowed)
        context, targets = clip[first : after + 1], clip[until : until + 1]
        return InBetween(context, targets, frames=until - first + 1, **options)  # type: ignore[arg-type]

    def to_message(self, pack: Pack, field: str) -> motion_pb2.Character:
        """The task on the wire."""
        return motion_pb2.Character(
            id=self.id,
            context=keyframes(self.context, f"{field}.context", pack),
            targets=keyframes(self.targets, f"{field}.targets", pack),
            frame_count=self.frames,
            allowed_token_counts=self.token_counts,
            seed=self.seed,
            temperature=self.temperature,
            pose_steps=self.pose_steps,
            return_intermediates=self.intermediates,
            return_qpos=pack.robot is not None,
            hold_feet=self.hold_feet,
            strict=self.strict,
            root=[key.to_message() for key in self.root],
        )


def keyframes(of: Clip | Sequence[Keyframe], field: str, pack: Pack | None) -> list[motion_pb2.Keyframe]:
    """Keyframes on the wire, of a pack's skeleton if that is known."""
    joints = pack.skeleton.joint_count if pack else None
    if isinstance(of, Clip):
        if pack and abs(of.fps - pack.fps) > 1e-2:
            message = (
                f"{field}: the clip runs at {of.fps:g} frames a second, the pack at {pack.fps:g}: resample it first"
            )
            raise InvalidArgumentError(message, field=field, allowed=f"{pack.fps:g} frames a second")
        of = of.keyframes()
    return [key.to_message(f"{field}[{nth}]", joints) for nth, key in enumerate(of)]


@dataclass(frozen=True, eq=False)
class InBetweenAnswer:
    """One character's answer."""

    id: str
    clip: Clip
    """The whole segment, from the first context frame to the last target keyframe."""
    qpos: F32 | None = field(repr=False)
    """(frames, qpos_size) MuJoCo's `qpos`. None: the pack has no robot."""
    hinge_residuals: F32 = field(repr=False)
    """(frames) how far a robot's hinges could not follow, radians; empty if the pack has no robot."""
    clamped_hinges: Ints = field(repr=False)
    """(frames) a robot's hinges that were asked for more than their limits; empty if the pack has no robot."""
    hinge_speed_ratios: F32 = field(repr=False)
    """(frames) speed of a robot's fastest hinge since the frame before, divided by its highest speed; empty if the pack
    has no robot. Above 1 the hinge would have to be faster than it can."""
    fastest_hinges: Ints = field(repr=False)
    """(frames) index of that hinge in the robot's; empty if the pack has no robot."""
    hinge_accelerations: F32 = field(repr=False)
    """(frames) largest acceleration of a robot's hinge, rad/s²; empty if the pack has no robot."""
    intermediates: motion_pb2.Intermediates | None = field(repr=False)
    """Each stage's output, if that was asked for."""
    feasibility: motion_pb2.Feasibility | None = field(repr=False)
    """Whether the motion stays within what the pack's data does. None: the pack has no limits."""
    timing: motion_pb2.Timing = field(repr=False)
    """Where the server's time went, for the whole request."""
    pack_version: str

    def _repr_html_(self) -> str:
        return self.clip._repr_html_()


def answers(response: motion_pb2.InBetweenResponse, pack: Pack, count: int) -> list[InBetweenAnswer]:
    """Reads an answer, checking the length of every array."""
    if len(response.characters) != count:
        raise AnswerError(
            f"{len(response.characters)} characters came where {count} were asked for", field="characters"
        )
    return [_answer(result, response, pack) for result in response.characters]


def _answer(result: motion_pb2.CharacterResult, response: motion_pb2.InBetweenResponse, pack: Pack) -> InBetweenAnswer:
    frames = result.frames
    size = pack.robot.qpos_size if pack.robot else 0
    return InBetweenAnswer(
        id=result.id,
        clip=clip(frames, pack),
        qpos=array("qpos", np.asarray(frames.qpos, np.float32), frames.frame_count, size) if size else None,
        hinge_residuals=np.asarray(frames.hinge_residuals, np.float32),
        clamped_hinges=np.asarray(frames.clamped_hinges, np.int64),
        hinge_speed_ratios=np.asarray(frames.hinge_speed_ratios, np.float32),
        fastest_hinges=np.asarray(frames.fastest_hinges, np.int64),
        hinge_accelerations=np.asarray(frames.hinge_accelerations, np.float32),
        intermediates=result.intermediates if result.HasField("intermediates") else None,
        feasibility=result.feasibility if result.HasField("feasibility") else None,
        timing=response.timing,
        pack_version=response.pack_version,
    )


def clip(frames: motion_pb2.Frames, pack: Pack) -> Clip:
    """Frames of a single request as a clip."""
    count, skeleton = frames.frame_count, pack.skeleton
    contacts = np.asarray(frames.contacts, np.float32)
    # Of a body of the caller's own the server may have chosen the contact joints.
    of_contacts = contacts.size and skeleton.contact_joints
    return Clip(
        skeleton,
        pack.fps,
        array("root_positions", np.asarray(frames.root_positions, np.float32), count, 3),
        array("rotations", np.asarray(frames.rotations, np.float32), count, skeleton.joint_count, 4),
        array("contacts", contacts, count, len(skeleton.contact_joints)) if of_contacts else None,
    )


def array(name: str, values: F32, *shape: int) -> F32:
    """The values in a shape.

    Raises:
        AnswerError: They are more or fewer.

    """
    expected = int(np.prod(shape))
    if values.size != expected:
        raise AnswerError(f"`frames.{name}` has {values.size} numbers where {expected} belong", field=name)
    return values.reshape(shape)
