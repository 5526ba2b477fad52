"""Characters on the server's clock: the part that no connection is needed for."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from troupe import errors, events, frames, io
from troupe.character import REFUSED, Character
from troupe.errors import StreamEndedError, TroupeError, UnreachableError
from troupe.events import Attached, Event, Left, NotAttached, Refused, Resumed, StreamEvent
from troupe.frames import Frames
from troupe.io import NOTHING, HangUp, Open, Pause, Poll, Receive, Received, Send, Steps
from troupe.options import Encoding
from troupe.route import Way
from troupe.v1 import event_pb2, motion_pb2, session_pb2

PAUSES_S = (0.05, 0.25)
"""Waits between tries to open a stream again: the first, and the longest. Sessions of a dead server can be resumed from the end
of its leases on, and should not wait for long then."""
CHUNK = 1024
"""Sessions of one call to take them up, as many as a server takes by default."""


@dataclass(frozen=True)
class DriveOptions:
    """How a stream is opened."""

    rate: int = 30
    """Ticks a second: 30, 50 or 60."""
    encoding: Encoding = Encoding.COMPACT
    positions: bool = False
    """Whether world joint positions come with the frames."""
    every_tick: bool = False
    """Give every tick that arrives, in order. By default the newest is given, and what was skipped is counted."""
    close_sessions: bool = False
    """Close the sessions of the stream when it ends. By default they wait for their time to live."""
    reconnect: float | None = 10.0
    """Seconds for which a stream is opened again that breaks, or whose sessions have all moved to another server.

    They go on where this client saw them last, on whatever server has them then. None: a stream that breaks ends with an
    error."""

    def to_message(self) -> session_pb2.DriveRequest:
        """The message that opens a stream."""
        opening = session_pb2.DriveOpen(
            rate_hz=self.rate,
            encoding=int(self.encoding),  # type: ignore[arg-type]
            return_positions=self.positions,
            close_sessions=self.close_sessions,
        )
        return session_pb2.DriveRequest(open=opening)


@dataclass(frozen=True, eq=False)
class Tick:
    """A tick: one frame of every character on the stream."""

    number: int
    """Counts the ticks of the stream from 0."""
    blocks: tuple[Frames, ...]
    """Frames of the characters, one block for each skeleton and convention."""
    events: tuple[Event, ...]
    """Events of characters in their scenes since the last tick, in order for each."""
    news: tuple[StreamEvent, ...]
    """News of the stream's sessions since the last tick."""
    dropped: int
    """Ticks so far that were not given: the server or this client skipped them, because this client was slow."""
    underruns: int
    """Characters of this tick that had to slow down because a plan was late."""
    held: tuple[event_pb2.HeldObject, ...] = field(repr=False)
    """Objects in the characters' hands."""

    @property
    def frames(self) -> Frames:
        """Frames of the characters, if all have one skeleton and convention.

        Raises:
            ValueError: They have several: see `blocks`.

        """
        (block,) = self.blocks
        return block

    def characters(self) -> Iterator[tuple[str, Frames, int]]:
        """Each character's session, its block, and its place there."""
        return ((name, block, place) for block in self.blocks for place, name in enumerate(block.ids))


class DriveCore:
    """A stream's sessions, and what came of them."""

    def __init__(self, address: str, way: Way, options: DriveOptions) -> None:
        self.options = options
        self._way = way
        self.sessions: dict[str, Character] = {}
        """The characters on the stream, by their names. They are commanded in place."""
        self.news: list[StreamEvent] = []
        """News of the stream since the last tick."""
        self._address = address
        self._events: list[Event] = []
        self._slots: dict[int, str] = {}
        self._blocks: tuple[Frames, ...] = ()
        # The last frames that came before the stream was last opened again.
        self._seen: dict[str, session_pb2.SessionResume] = {}
        self._skipped = 0
        # How it ended, reported after the last frame; and why it broke, until
        # it is opened again.
        self._ended = False
        self._error: TroupeError | None = None
        self._broken: TroupeError | None = None

    def __getitem__(self, session: str) -> Character:
        return self.sessions[session]

    def _attach(self, characters: Iterable[Character]) -> Steps[None]:
        new = {of.id: of for of in characters}
        self.sessions |= new
        if new:
            yield Send(session_pb2.DriveRequest(attach=session_pb2.DriveAttach(session_ids=new)))

    def _detach(self, ids: Iterable[str]) -> Steps[None]:
        yield Send(session_pb2.DriveRequest(detach=session_pb2.DriveDetach(session_ids=ids)))

    def _flush(self) -> Steps[None]:
        """Sends what changed. If the connection is busy it stays for the next time, so that the newest goes."""
        commands = [command for name, of in self.sessions.items() for command in of._intent.commands(name)]
        if not commands:
            return
        request = session_pb2.DriveRequest(command=session_pb2.CommandRequest(commands=commands))
        sent: bool = yield Send(request)
        if not sent:
            # The last first, so that they are in order again.
            for command in reversed(commands):
                self.sessions[command.session_id]._intent.unsent(command)

    def _next(self, timeout: float | None) -> Steps[Tick | None]:
        """Sends what changed, and waits for the next tick. None: the stream ended as asked, or has no character left."""
        until = None if timeout is None else time.monotonic() + timeout
        while True:
            if self._broken is not None:
                yield from self._mend(self._broken)
            if self._error is not None:
                error, self._error, self._ended = self._error, None, True
                raise error
            if self._ended or not self.sessions:
                return None
            yield from self._flush()
            newest = yield from self._newest(None if until is None else max(until - time.monotonic(), 0))
            tick = None if newest is None else self._read(newest)
            if tick is not None and tick.blocks:
                return tick

    def _newest(self, timeout: float | None) -> Steps[session_pb2.DriveFrames | None]:
        """Waits for a message and takes all that have come: the newest tick, or with `every_tick` the next."""
        newest: session_pb2.DriveFrames | None = None
        came: Received = yield Receive(timeout)
        while True:
            given = self._sort(came)
            if given is not None:
                self._skipped += newest is not None
                newest = given
            over = self._ended or self._error or self._broken
            if over or (self.options.every_tick and newest is not None):
                return newest
            more: Any = yield Poll()
            if more is NOTHING:
                return newest
            came = more

    def _sort(self, came: Received) -> session_pb2.DriveFrames | None:
        """Sorts one message of the server, and gives the frames if it has some."""
        if isinstance(came, TroupeError):
            self._ends(came)
            return None
        if came is None:
            if not (self._ended or self._error or self._broken):
                self._ends(StreamEndedError("the server ended the stream and did not say why"))
            return None
        kind = came.WhichOneof("message")
        if kind == "frames":
            return came.frames
        if kind == "attached":
            for attached in came.attached.sessions:
                self._slots[attached.slot] = attached.session_id
                self.news.append(Attached(attached.session_id))
            # Of another server that came back between the calls, and got the stream.
            self._drop(came.attached.problems, NotAttached, ("SESSION_ELSEWHERE",))
        elif kind == "left":
            for left in came.left.sessions:
                self._slots.pop(left.slot, None)
            self._drop(came.left.sessions, Left, ("SESSION_MOVED",))
        elif kind == "commands":
            refused = [result for result in came.commands.results if result.status == REFUSED]
            self.news.extend(Refused(of.session_id, errors.of_problem(of.problem, of.session_id)) for of in refused)
        elif kind == "events":
            self._events.extend(events.of_messages(came.events.sessions))
        elif kind == "closing":
            reason = came.closing.reason
            if reason.reason == "CLIENT_DONE":
                self._ended = True
            else:
                self._ends(StreamEndedError(f"the server ended the stream: {reason.message}", reason=reason.reason))
        return None

    def _drop(
        self,
        problems: Iterable[session_pb2.SessionProblem],
        kind: type[NotAttached] | type[Left],
        follows: tuple[str, ...] = (),
    ) -> None:
        """Takes sessions off the stream. If the last ones are on another server, for one of these reasons, it follows them."""
        for of in problems:
            error = errors.of_problem(of.problem, of.session_id)
            is_last = not self._slots and self.options.reconnect is not None
            if is_last and error.reason in follows and self._way.follow(error):
                self._ends(StreamEndedError(f"the server ended the stream: {error.message}", reason=error.reason))
                continue
            self.sessions.pop(of.session_id, None)
            self.news.append(kind(of.session_id, error))

    def _ends(self, error: TroupeError) -> None:
        """The stream ended with an error: for good, or until it is opened again."""
        if self.options.reconnect is not None and _is_break(error):
            self._broken = error
        else:
            self._error = error

    def _read(self, message: session_pb2.DriveFrames) -> Tick:
        """Decodes a tick. Blocks of which no character is known yet, or any more, are passed over."""
        blocks: list[Frames] = []
        for block in message.blocks:
            ids = [self._slots.get(slot) for slot in block.slots]
            known = next((self.sessions[name] for name in ids if name in self.sessions), None)
            if known is None:
                continue
            named = [name if name in self.sessions else None for name in ids]
            of = frames.Of(known.pack.skeleton, self.options.rate, known.convention, ())
            blocks += frames.of_mixed_block(block, named, lambda name: self.sessions[name].convention, of)
        if blocks:
            self._blocks = tuple(blocks)
        news, happened = (tuple(self.news), tuple(self._events)) if blocks else ((), ())
        if blocks:
            self.news, self._events = [], []
        return Tick(
            message.tick,
            tuple(blocks),
            happened,
            news,
            message.dropped_ticks + self._skipped,
            message.underruns,
            tuple(message.held),
        )

    def _mend(self, why: TroupeError) -> Steps[None]:
        """Opens a stream again that broke, and takes up its sessions; the error is why it broke, where that does not do."""
        until = time.monotonic() + (self.options.reconnect or 0)
        pause, longest = PAUSES_S
        # Without a word from a server, the router decides.
        if why.reason != "SESSION_ELSEWHERE":
            self._way.forget()
        while True:
            try:
                yield from self._take_up()
            except TroupeError as error:
                # A server that drains may take the sessions up, and end the new stream at once.
                if not _is_break(error) or time.monotonic() + pause > until:
                    self._broken, self._ended = None, True
                    raise why from error
            else:
                self._broken = None
                return
            yield Pause(pause)
            pause = min(pause * 2, longest)

    def _take_up(self) -> Steps[None]:
        self._seen = self._last_seen()
        try:
            resumed, problems = yield from self._resume()
        except TroupeError as error:
            if error.reason not in errors.PASSING:
                # The server that was named may be the one that is lost.
                self._way.forget()
            raise
        yield Open(self.options.to_message())
        self._slots.clear()
        self._blocks = ()
        self._drop(problems, NotAttached)
        for one in resumed:
            now = one.session
            of_session = self.sessions.get(now.id)
            if of_session is None:
                continue
            intent = of_session._intent
            lost = max(intent.sequence - now.last_sequence, 0)
            intent.seen(now.last_sequence)
            intent.doubt()
            self.news.append(Resumed(now.id, now.frame, one.restored, lost))
        yield from self._attach(list(self.sessions.values()))

    def _resume(self) -> Steps[tuple[list[session_pb2.ResumedSession], list[session_pb2.SessionProblem]]]:
        """Resumes the sessions on the server that the router, or another server, names."""
        resumed: list[session_pb2.ResumedSession] = []
        problems: list[session_pb2.SessionProblem] = []
        seen = [self._seen[name] for name in sorted(self._seen)]
        for first in range(0, len(seen), CHUNK):
            request = session_pb2.ResumeSessionsRequest(sessions=seen[first : first + CHUNK])
            answer = yield from io.ask(io.RESUME_SESSIONS, request)
            resumed += answer.sessions
            problems += answer.problems
        for of in problems:
            if of.problem.reason in errors.PASSING:
                # Its old server has a lease of it, or has not noticed that the old stream is gone,
                # or the store does not answer. Those that are here already keep this client here.
                if not resumed:
                    self._way.follow(errors.of_problem(of.problem, of.session_id))
                raise UnreachableError(f"{self._address}: {of.problem.message}", reason=of.problem.reason)
        return resumed, problems

    def _last_seen(self) -> dict[str, session_pb2.SessionResume]:
        """The last frame of each session that this client saw, on this stream or one before."""
        before = self._seen
        seen = {name: before.get(name) or session_pb2.SessionResume(session_id=name) for name in self.sessions}
        for block in self._blocks:
            for place, name in enumerate(block.ids):
                if name in seen:
                    seen[name] = _seen(block, place)
        return seen

    def _close(self, timeout: float) -> Steps[None]:
        """Ends the stream and waits until the server has let go of its sessions."""
        yield HangUp()
        until = time.monotonic() + timeout
        while not (self._ended or self._error or self._broken):
            self._sort((yield Receive(max(until - time.monotonic(), 0))))
        self._ended = True


def _seen(block: Frames, place: int) -> session_pb2.SessionResume:
    """The last frame of a character."""
    if block.qpos is not None:
        pose = motion_pb2.Keyframe(qpos=block.qpos[-1, place])
    else:
        x, y, z = block.root[-1, place].tolist()
        root = motion_pb2.Root(position=motion_pb2.Vec3(x=x, y=y, z=z))
        pose = motion_pb2.Keyframe(root=root, pose=motion_pb2.Pose(rotations=block.rotations[-1, place].ravel()))
    frame = int(block.first_frames[place]) + len(block) - 1
    return session_pb2.SessionResume(session_id=block.ids[place], frame=frame, pose=pose)


def _is_break(error: TroupeError) -> bool:
    """Whether the stream broke although neither side wanted to end it for good: a server that stops may be started again."""
    if isinstance(error, StreamEndedError):
        return error.reason in ("", "DRAINING", "SESSION_ELSEWHERE", "SESSION_MOVED")
    may_pass = (errors.UnavailableError, errors.DeadlineExceededError, errors.ResourceExhaustedError)
    return isinstance(error, may_pass)


def no_answer(address: str, timeout: float) -> TroupeError:
    """The error of a stream on which nothing came in time."""
    return errors.DeadlineExceededError(f"nothing came on the stream from {address} within {timeout:g} s")
