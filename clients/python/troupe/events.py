"""Events of characters, and news beside their frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from troupe.errors import SessionError
from troupe.v1 import event_pb2


@dataclass(frozen=True)
class Event:
    """Something that happened to a character in its scene, or on its path."""

    session: str
    frame: int
    """Frame of the session's timeline."""
    kind: str
    """started, entered, reached, attached, released, done, failed, interrupted, fell, landed, arrived or bounded."""
    detail: Any
    """The message of that kind in `event.proto`."""


def of_message(of: event_pb2.SessionEvents) -> list[Event]:
    """The events of a session, in the order of their frames."""
    kinds = [(event, event.WhichOneof("kind")) for event in of.events]
    return [Event(of.session_id, event.frame, kind, getattr(event, kind)) for event, kind in kinds if kind]


def of_messages(all_sessions: Iterable[event_pb2.SessionEvents]) -> list[Event]:
    """The events of sessions, in order for each."""
    return [event for of in all_sessions for event in of_message(of)]


@dataclass(frozen=True)
class Fault:
    """The problem of one character among many."""

    member: int
    """Its number in the crowd."""
    problem: SessionError
    left: bool
    """Whether it has left the crowd: its session is gone. Else it is tried again with the next step."""


@dataclass(frozen=True)
class StreamEvent:
    """News of a session on a stream, beside frames and events of scenes."""

    session: str


@dataclass(frozen=True)
class Attached(StreamEvent):
    """The session is on the stream now."""


@dataclass(frozen=True)
class Resumed(StreamEvent):
    """The stream broke, and the session is taken up again behind the last frame that came.

    The client sends its locomotion again. Acts may be lost.
    """

    frame: int
    """The frame that it is at."""
    restored: bool
    """The server was started again and had kept the session. Else only the connection broke."""
    lost_commands: int
    """Commands that this client gave and the server does not know."""


@dataclass(frozen=True)
class NotAttached(StreamEvent):
    """The session could not be taken onto the stream."""

    problem: SessionError


@dataclass(frozen=True)
class Left(StreamEvent):
    """The session left the stream: detached, closed or expired."""

    problem: SessionError


@dataclass(frozen=True)
class Refused(StreamEvent):
    """The server refused the session's command; the session goes on as before."""

    problem: SessionError
