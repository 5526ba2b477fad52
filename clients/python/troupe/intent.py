"""The commands for a character, and which of them the server knows already."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from troupe.arrays import floats
from troupe.errors import InvalidArgumentError
from troupe.v1 import motion_pb2, session_pb2

Velocity = tuple[float, float, float]
STAND: Velocity = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Locomotion:
    """Move over the ground: velocity, facing, style. In the session's convention; by default, stand."""

    velocity: Velocity = STAND
    """Where to go and how fast, in the session's units a second, over the ground. Zero: stand."""
    facing: float | None = None
    """Where to face, radians. None: where it goes, or where it faces when it stands."""
    style: str | None = None
    """Style to move in. None: the one that it has."""
    gait: str | None = None
    """The only gait of the style to use. None: those that suit the velocity."""
    height: float | None = None
    """Height of the root joint, for styles that have a range of heights. None: the style's."""

    def to_message(self) -> session_pb2.Locomote:
        """The intent on the wire."""
        x, y, z = self.velocity
        return session_pb2.Locomote(
            velocity=None if self.velocity == STAND else motion_pb2.Vec3(x=x, y=y, z=z),
            facing=self.facing,
            style=self.style or "",
            gait=self.gait or "",
            height=self.height,
        )


@dataclass(frozen=True, slots=True)
class Act:
    """Something that a character does once. It goes to the server with the next step or tick."""

    command: session_pb2.Command
    """The command, without a session and a number."""
    lets_move: bool = False
    """Whether the character goes on moving as it did."""


def interact(instance: str, *, variant: str = "", approach: str = "") -> Act:
    """Go to an object of the scene and use it.

    `variant` is a way to use it (else one by weight and seed), `approach` a side to come from (else the nearest).
    """
    intent = session_pb2.Interact(instance=instance, variant=variant, approach=approach)
    return Act(session_pb2.Command(interact=intent))


def skill(name: str, *, variant: str = "") -> Act:
    """Do a skill of the pack where the character stands, such as `jump` or `lie-down`.

    `variant` is a way to do it (else one by weight and seed). `pack.skills` lists what there is.
    """
    return Act(session_pb2.Command(skill=session_pb2.UseSkill(name=name, variant=variant)))


def end_interaction() -> Act:
    """Leave an interaction or a skill that is held, such as sitting, by its exit."""
    return Act(session_pb2.Command(end_interaction=session_pb2.EndInteraction()))


def cancel() -> Act:
    """Break off at once, let go of the object in the hand, and stand."""
    return Act(session_pb2.Command(cancel=session_pb2.Cancel()))


def drop() -> Act:
    """Put down what is in the hand."""
    return Act(session_pb2.Command(drop=session_pb2.DropHeld()), lets_move=True)


def follow_path(
    points: npt.ArrayLike,
    *,
    headings: npt.ArrayLike | None = None,
    times: npt.ArrayLike | None = None,
    speed: float | None = None,
    style: str = "",
    loop: bool = False,
) -> Act:
    """Follow a path, and stand at its end.

    `points` is (2 to 1024, 3), of which only the ground plane counts; `headings` radians and `times` seconds from the command,
    one a point. Without times the path has one speed, in the session's units a second.
    """
    path = session_pb2.FollowPath(points=path_points(points, headings, times), speed=speed, style=style, loop=loop)
    return Act(session_pb2.Command(follow_path=path))


def path_points(
    points: npt.ArrayLike, headings: npt.ArrayLike | None, times: npt.ArrayLike | None
) -> list[motion_pb2.PathPoint]:
    """A path on the wire."""
    places = floats("points", points, (None, 3)).tolist()
    count = len(places)
    faced = [None] * count if headings is None else floats("headings", headings, (count,)).tolist()
    timed = [None] * count if times is None else floats("times", times, (count,)).tolist()
    return [
        motion_pb2.PathPoint(position=motion_pb2.Vec3(x=x, y=y, z=z), heading=heading, time=time)
        for (x, y, z), heading, time in zip(places, faced, timed, strict=True)
    ]


class Intent:
    """The commands for one character, the part that the server knows, and their sequence numbers."""

    __slots__ = ("_acts", "_priority", "_sent", "_sent_priority", "_touched", "_wanted", "sequence")

    def __init__(self, sequence: int = 0) -> None:
        self.sequence = sequence
        """The highest sequence number so far."""
        self._wanted = Locomotion()
        self._sent: Locomotion | None = None
        # A session that is taken up goes on as it does until it gets a command.
        self._touched = False
        self._priority: float | None = None
        self._sent_priority: float | None = None
        self._acts: list[session_pb2.Command] = []

    @property
    def wanted(self) -> Locomotion:
        """The wanted locomotion."""
        return self._wanted

    @wanted.setter
    def wanted(self, locomotion: Locomotion) -> None:
        self._wanted = locomotion
        self._touched = True

    def set_priority(self, priority: float) -> None:
        """How much it matters that the character is planned for often, 0 to 1."""
        self._priority = priority

    def seen(self, sequence: int) -> None:
        """The server has seen sequence numbers up to here, whoever gave them."""
        self.sequence = max(self.sequence, sequence)

    def act(self, act: Act) -> None:
        """Does something once. Unless the character goes on moving meanwhile, its locomotion counts as sent until it is set."""
        before = self._changed()
        if before is not None:
            self._acts.append(session_pb2.Command(locomote=before))
        self._acts.append(act.command)
        if not act.lets_move:
            self._sent = None
            self._touched = False

    def commands(self, session: str) -> Iterator[session_pb2.Command]:
        """The commands that bring the server up to date. They count as sent from now on."""
        acts, self._acts = self._acts, []
        for act in acts:
            yield self._numbered(session, act)
        locomote, priority = self._changed(), self._changed_priority()
        if locomote is not None or priority is not None:
            yield self._numbered(session, session_pb2.Command(locomote=locomote, priority=priority))

    def command_at(self, session: str, frame: int) -> session_pb2.Command:
        """The command for what is wanted from a frame of the session's timeline on."""
        command = session_pb2.Command(locomote=self._send(), priority=self._changed_priority(), at_frame=frame)
        return self._numbered(session, command)

    def doubt(self) -> None:
        """The last command may not have arrived: the next look sends everything again."""
        self._sent_priority = None
        if self._sent is not None:
            # The style of an earlier command may hold or not, so the next command repeats it.
            self._wanted = replace(self._wanted, style=self._wanted.style or self._sent.style)
            # Differs from everything, so that the next look finds a change.
            self._sent = Locomotion(velocity=(math.nan, math.nan, math.nan))

    def unsent(self, command: session_pb2.Command) -> None:
        """A command that was not sent after all."""
        if command.WhichOneof("intent") in (None, "locomote"):
            self.doubt()
        else:
            self._acts.insert(0, command)

    def _numbered(self, session: str, command: session_pb2.Command) -> session_pb2.Command:
        self.sequence += 1
        numbered = session_pb2.Command()
        numbered.CopyFrom(command)
        numbered.session_id, numbered.sequence = session, self.sequence
        return numbered

    def _changed(self) -> session_pb2.Locomote | None:
        """The locomotion that the server does not know yet. It counts as sent from now on."""
        sent, wanted = self._sent, self._wanted
        if sent is None:
            # A character without a command stands in its own style.
            same = not self._touched or (self.sequence == 0 and wanted == Locomotion())
        else:
            style = wanted.style or sent.style
            same = sent == (wanted if style == wanted.style else replace(wanted, style=style))
        return None if same else self._send()

    def _changed_priority(self) -> float | None:
        changed = self._priority if self._priority != self._sent_priority else None
        self._sent_priority = self._priority
        return changed

    def _send(self) -> session_pb2.Locomote:
        before = self._sent.style if self._sent else None
        wanted = self._wanted
        self._sent = wanted if wanted.style else replace(wanted, style=before)
        return wanted.to_message()


def locomotions(
    velocities: npt.ArrayLike,
    facing: npt.ArrayLike | None,
    styles: str | Sequence[str | None] | None,
    before: Sequence[Locomotion],
) -> list[Locomotion]:
    """Locomotion of many characters, from arrays: velocities (n, 3), facing (n) with NaN for none, a style for all or each."""
    count = len(before)
    speeds = floats("velocities", velocities, (count, 3)).tolist()
    faced: list[float | None] = [None] * count
    if facing is not None:
        free = np.isnan(np.asarray(facing, np.float32))
        given = floats("facing", np.where(free, 0, facing), (count,)).tolist()
        faced = [None if is_free else value for value, is_free in zip(given, free.tolist(), strict=True)]
    named: Sequence[str | None] = [styles] * count if styles is None or isinstance(styles, str) else styles
    if len(named) != count:
        message = f"styles: has {len(named)} names; allowed: one, or {count}"
        raise InvalidArgumentError(message, field="styles", allowed=f"one name, or {count}")
    return [
        Locomotion((x, y, z), face, style or was.style, was.gait, was.height)
        for (x, y, z), face, style, was in zip(speeds, faced, named, before, strict=True)
    ]
