"""Motion along a path, or of words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy.typing as npt

from troupe import clip as clips
from troupe.clip import Clip
from troupe.errors import AnswerError, InvalidArgumentError
from troupe.inbetween import clip, keyframes
from troupe.intent import path_points
from troupe.keyframe import Keyframe
from troupe.pack import Pack
from troupe.skeleton import Skeleton
from troupe.v1 import motion_pb2
from troupe.words import Prompt, Sampling


class Planner(IntEnum):
    """Whose network plans a path of a body on two legs. The answer's notes say which pack it was."""

    AUTO = 0
    """A pack of the same body, or for robots one of a robot, if it has the style and keeps up with the path. Otherwise the body's
    own pack."""
    OWN = 1
    """The body's own pack."""
    CARRIED = 2
    """Another pack that walks, whose motion is carried over to the body; refused if none can."""


@dataclass(frozen=True, eq=False)
class FollowPath:
    """A path to follow, in the world, metres; only x and z of places count."""

    points: npt.ArrayLike
    """(points, 3)."""
    headings: npt.ArrayLike | None = None
    """(points) radians. None: along the path."""
    times: npt.ArrayLike | None = None
    """(points) seconds from the begin. None: at `speed`."""
    speed: float | None = None
    """Metres a second, if points have no times. None: a walk of the body's size."""
    seconds: float | None = None
    """Length of the motion. None: that of the path."""
    words: Mapping[str, float] = field(default_factory=dict)
    """Words of the pack and how much of each, at most 1 in all. Packs that walk along paths take one style, as 1."""
    targets: Clip | Sequence[Keyframe] = ()
    """How the motion ends."""
    keyframes: Mapping[float, Keyframe] = field(default_factory=dict)
    """Poses to pass, by their seconds from the begin. For packs that walk along paths, such as `human` and `g1`."""
    steps: int | None = None
    """Steps of the sampler."""
    guidance: float | None = None
    """How much the words count; 1 as they were trained."""
    skeleton: Skeleton | None = None
    """A body of the caller's own, upright in its rest pose. Nothing promises that a model moves it well."""
    strict: bool = False
    """Whether the server is to refuse a path that the body cannot follow as its data shows."""
    planner: Planner = Planner.AUTO
    """Whose network plans the path. For packs with the capability `path`."""

    def to_message(self, pack: Pack) -> motion_pb2.PathGoal:
        """The goal on the wire."""
        return motion_pb2.PathGoal(
            body="" if self.skeleton else pack.body,
            skeleton=None if self.skeleton is None else _body(self.skeleton),
            points=path_points(self.points, self.headings, self.times),
            seconds=self.seconds,
            speed=self.speed,
            style=[motion_pb2.StyleWord(word=word, weight=weight) for word, weight in self.words.items()],
            steps=self.steps,
            guidance=self.guidance,
            targets=keyframes(self.targets, "goal.path.targets", None),
            strict=self.strict,
            keyframes=[
                motion_pb2.PathKeyframe(time=time, keyframe=key.to_message(f"goal.path.keyframes[{nth}].keyframe"))
                for nth, (time, key) in enumerate(self.keyframes.items())
            ],
            planner=motion_pb2.PathPlanner.Name(self.planner),
        )


def _body(skeleton: Skeleton) -> motion_pb2.BodySkeleton:
    x, y, z = skeleton.left_axis
    joints = [
        motion_pb2.BodyJoint(
            name=name,
            parent=skeleton.names[parent] if parent >= 0 else "",
            offset=motion_pb2.Vec3(x=float(offset[0]), y=float(offset[1]), z=float(offset[2])),
        )
        for name, parent, offset in zip(skeleton.names, skeleton.parents, skeleton.offsets, strict=True)
    ]
    left = motion_pb2.Vec3(x=x, y=y, z=z)
    return motion_pb2.BodySkeleton(joints=joints, left_axis=left, contact_joints=skeleton.contact_joints)


@dataclass(frozen=True, eq=False)
class GeneratedPart:
    """Frames of one character of a motion that is being made."""

    character: int
    """Whose they are: 0 for the first character, 1 and more for the others of a `Prompt`."""
    clip: Clip


@dataclass(frozen=True, eq=False)
class Generated:
    """A motion that was made."""

    clip: Clip
    """Its frames: those of the first character if there are several."""
    notes: tuple[str, ...]
    """Parts of the request that the model may not do well."""
    others: tuple[Clip, ...] = ()
    """Those of the other characters, in the order of the prompt."""
    feasibility: motion_pb2.Feasibility | None = None
    """Of the parts of a path the one that is farthest from feasible. None: the body has no limits."""

    def _repr_html_(self) -> str:
        return self.clip._repr_html_()


def request(
    pack: Pack,
    path: FollowPath | npt.ArrayLike | None,
    prompt: Prompt | str | None,
    past: Clip | Sequence[Keyframe],
    seed: int,
    sampling: Sampling | None,
    raw: bool,
) -> motion_pb2.GenerateRequest:
    """The request for a motion along a path, or of words."""
    message = motion_pb2.GenerateRequest(
        pack=pack.name,
        past=keyframes(past, "past", None),
        seed=seed,
        skeleton=pack.worn,
        sampling=None if sampling is None else sampling.to_message(),
        raw=raw,
    )
    if (path is None) == (prompt is None):
        raise InvalidArgumentError("goal: one of path and prompt", field="goal", allowed="path or prompt")
    if prompt is not None:
        words = prompt if isinstance(prompt, Prompt) else Prompt(prompt)
        message.prompt.CopyFrom(words.to_message())
    elif path is not None:
        of = path if isinstance(path, FollowPath) else FollowPath(path)
        message.path.CopyFrom(of.to_message(pack))
    return message


class Parts:
    """Parts of a motion as they come, up to the last."""

    def __init__(self, pack: Pack, path: FollowPath | npt.ArrayLike | None = None) -> None:
        own = path.skeleton if isinstance(path, FollowPath) else None
        self._pack = pack if own is None else replace(pack, skeleton=own)
        self.notes: list[str] = []
        self.feasibility: motion_pb2.Feasibility | None = None
        self.ended = False

    def take(self, part: motion_pb2.GenerateResponse) -> GeneratedPart:
        """Reads a part."""
        self.notes.extend(part.notes)
        found = part.feasibility if part.HasField("feasibility") else None
        if found and (self.feasibility is None or self.feasibility.ratio < found.ratio):
            self.feasibility = found
        self.ended = part.is_last
        if part.WhichOneof("part") != "frames":
            raise AnswerError("a part has no frames", field="part")
        return GeneratedPart(part.character, clip(part.frames, self._pack))

    def whole(self, came: Sequence[GeneratedPart]) -> Generated:
        """All of a motion."""
        self.check_end()
        characters = max(part.character for part in came) + 1
        first, *others = [
            clips.joined([part.clip for part in came if part.character == character]) for character in range(characters)
        ]
        return Generated(first, tuple(self.notes), tuple(others), self.feasibility)

    def check_end(self) -> None:
        """Refuses an answer that ended before its last part."""
        if not self.ended:
            raise AnswerError("the answer ended before its last part", field="is_last")
