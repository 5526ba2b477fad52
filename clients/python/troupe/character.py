"""One live character: what it is, what it should do, and what came of it. Sessions, crowds and drives are made of these."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Self

import numpy.typing as npt

from troupe import errors, events, frames, io
from troupe.arrays import floats
from troupe.conventions import Convention
from troupe.errors import AnswerError, SessionError
from troupe.events import Event
from troupe.frames import Frames
from troupe.intent import STAND, Act, Intent, Locomotion
from troupe.io import Steps
from troupe.options import FrameOptions
from troupe.pack import Pack
from troupe.v1 import event_pb2, session_pb2

REFUSED = session_pb2.COMMAND_STATUS_REFUSED


class Character:
    """A session on the server. What it should do is set in place and goes to the server with the next step or tick."""

    def __init__(self, pack: Pack, of: session_pb2.Session) -> None:
        self.id = of.id
        """Its name on the server."""
        self.pack = pack
        self.convention = Convention(of.convention)
        """Axes and unit of all that it takes and gives."""
        self.events: list[Event] = []
        """Events of the last step: with objects, in skills, on its path."""
        self.held: event_pb2.HeldObject | None = of.held if of.HasField("held") else None
        """The object in its hand at the last frame of the last step."""
        self._intent = Intent(of.last_sequence)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.id!r}, pack={self.pack.name!r})"

    @property
    def locomotion(self) -> Locomotion:
        """How it should move."""
        return self._intent.wanted

    @locomotion.setter
    def locomotion(self, locomotion: Locomotion) -> None:
        self._intent.wanted = locomotion

    def walk(self, velocity: npt.ArrayLike, *, style: str | None = None, facing: float | None = None) -> Self:
        """Goes with this velocity from now on, in the session's units a second over the ground.

        It faces where it goes, unless `facing` (radians) says otherwise.
        """
        x, y, z = floats("velocity", velocity, (3,)).tolist()
        was = self._intent.wanted
        self._intent.wanted = replace(was, velocity=(x, y, z), facing=facing, style=style or was.style)
        return self

    def stand(self) -> Self:
        """Stands, and faces where it faces."""
        self._intent.wanted = replace(self._intent.wanted, velocity=STAND, facing=None)
        return self

    def face(self, heading: float | None) -> Self:
        """Faces this way, radians, at any velocity. None: it faces where it goes."""
        self._intent.wanted = replace(self._intent.wanted, facing=heading)
        return self

    def style(self, name: str) -> Self:
        """Moves in this style."""
        self._intent.wanted = replace(self._intent.wanted, style=name)
        return self

    def gait(self, name: str | None) -> Self:
        """Uses this gait of the style alone. None: those that suit the velocity."""
        self._intent.wanted = replace(self._intent.wanted, gait=name)
        return self

    def height(self, height: float | None) -> Self:
        """Holds the root joint at this height. None: the style's."""
        self._intent.wanted = replace(self._intent.wanted, height=height)
        return self

    def act(self, act: Act) -> Self:
        """Does something once, such as `troupe.interact("stool")`.

        Until it is to walk again its locomotion is left alone: a change breaks off what it does. An act goes with the next step;
        where that fails it may not have arrived, and is not sent again.
        """
        self._intent.act(act)
        return self

    def priority(self, priority: float) -> Self:
        """How much it matters that it is planned for often: 0 is far from the camera, 1 the hero."""
        self._intent.set_priority(priority)
        return self

    def _step(self, count: int, options: FrameOptions) -> Steps[Frames]:
        request = step_request([self], count, options)
        try:
            answer = yield from io.ask(io.STEP, request)
        except errors.TroupeError as error:
            self._intent.doubt()
            self._name(error)
            raise
        for problem in answer.problems:
            raise errors.of_problem(problem.problem, self.id)
        if not answer.blocks:
            raise AnswerError("`blocks` is missing", field="blocks")
        of = frames.Of(self.pack.skeleton, options.rate, self.convention, (self.id,))
        came = frames.of_block(answer.blocks[0], of)
        self.events = events.of_messages(answer.events)
        self.held = answer.held[0] if answer.held else None
        self._check(answer.command_results)
        return came

    def _send(self) -> Steps[None]:
        yield from self._command(list(self._intent.commands(self.id)))

    def _send_at(self, frame: int) -> Steps[None]:
        yield from self._command([self._intent.command_at(self.id, frame)])

    def _command(self, commands: list[session_pb2.Command]) -> Steps[None]:
        if not commands:
            return
        try:
            answer = yield from io.ask(io.COMMAND, session_pb2.CommandRequest(commands=commands))
        except errors.TroupeError as error:
            self._intent.doubt()
            self._name(error)
            raise
        self._check(answer.results)

    def _info(self) -> Steps[session_pb2.Session]:
        try:
            info = yield from io.ask(io.GET_SESSION, session_pb2.GetSessionRequest(id=self.id))
        except errors.TroupeError as error:
            self._name(error)
            raise
        self._intent.seen(info.last_sequence)
        return info

    def _peek(self, count: int) -> Steps[session_pb2.PeekResponse]:
        request = session_pb2.PeekRequest(session_id=self.id, frames=count)
        try:
            return (yield from io.ask(io.PEEK, request))
        except errors.TroupeError as error:
            self._name(error)
            raise

    def _name(self, error: errors.TroupeError) -> None:
        """Puts the session's name into an error that is about one."""
        if isinstance(error, SessionError):
            error.session = error.session or self.id

    def _check(self, results: Iterable[session_pb2.CommandResult]) -> None:
        """A refused command is an error. A late one is none: whoever commanded since knows better."""
        for result in results:
            if result.status == REFUSED and result.session_id == self.id:
                raise errors.of_problem(result.problem, self.id)


def step_request(characters: Iterable[Character], count: int, options: FrameOptions) -> session_pb2.StepRequest:
    """The request that advances characters and says what changed of what they should do."""
    request = session_pb2.StepRequest(
        frames=count,
        rate_hz=options.rate,
        encoding=int(options.encoding),  # type: ignore[arg-type]
        return_positions=options.positions,
    )
    for of in characters:
        request.session_ids.append(of.id)
        request.commands.extend(of._intent.commands(of.id))
    return request
