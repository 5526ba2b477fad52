"""Live characters: one, many, and many on the server's clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from types import TracebackType
from typing import Self

from troupe import calls
from troupe.blocking import Connection
from troupe.character import Character
from troupe.crowd import CrowdCore, CrowdStep
from troupe.drive import DriveCore, DriveOptions, Tick
from troupe.frames import Frames
from troupe.io import Open
from troupe.options import FrameOptions, SessionOptions
from troupe.pack import Pack
from troupe.v1 import session_pb2


class Session(Character):
    """One live character, opened by `Client.session` and advanced by the caller's clock.

    A session that is not closed stays on the server until its time to live has passed.
    """

    def __init__(self, connection: Connection, pack: Pack, of: session_pb2.Session) -> None:
        super().__init__(pack, of)
        self._connection = connection
        self.frame_options = FrameOptions()
        """How its frames are taken."""

    def step(self, frames: int = 1) -> Frames:
        """Advances it and gives its next frames, 1 to 120. What it should do goes with it where it changed.

        Raises:
            SessionError: It is gone, in another's hands, or refuses what it should do.

        """
        return self._connection.run(self._step(frames, self.frame_options))

    def send(self) -> None:
        """Sends what it should do now, if it changed, without a step."""
        self._connection.run(self._send())

    def send_at(self, frame: int) -> None:
        """Sends how it should move from a frame of its timeline on."""
        self._connection.run(self._send_at(frame))

    def info(self) -> session_pb2.Session:
        """The session as the server has it: its place, what it does and has done."""
        return self._connection.run(self._info())

    def peek(self, frames: int = 0) -> session_pb2.PeekResponse:
        """Up to so many frames of its buffered future (0: all), and the plan behind it. Changes nothing."""
        return self._connection.run(self._peek(frames))

    def close(self) -> None:
        """Closes it on the server. That it is gone already is no error."""
        self._connection.run(calls.close_sessions([self.id]))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Crowd(CrowdCore[Session]):
    """Many characters of one pack, opened by `Client.crowd` and advanced together by the caller's clock.

    `walk` says what all should do, from arrays; `crowd[i]` is one of them. A step sends what changed and brings the next frames
    of all. A character whose session is gone is reported and leaves; the others go on, with the numbers that they had.
    """

    def __init__(self, connection: Connection, pack: Pack, options: FrameOptions, per_request: int = 1024) -> None:
        super().__init__(pack, options, per_request)
        self._connection = connection

    def add(self, options: int | Sequence[SessionOptions]) -> list[int]:
        """Opens sessions for new characters, all or none, and gives their numbers. A number of them stands on a grid."""
        return self._connection.run(self._add(options, self._made))

    def _made(self, pack: Pack, of: session_pb2.Session) -> Session:
        return Session(self._connection, pack, of)

    def step(self, frames: int = 1) -> CrowdStep:
        """Advances everybody by some frames, 1 to 120, and tells the server what changed.

        Raises:
            TroupeError: The server cannot be reached, or refuses the request as a whole.

        """
        return self._connection.run(self._step(frames))

    def close(self) -> int:
        """Closes all sessions and says how many were still open."""
        return self._connection.run(self._close())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Drive(DriveCore):
    """A stream on which the server advances many characters at 30, 50 or 60 Hz, opened by `Client.drive`.

    `for tick in drive` gives ticks as they come, until the stream has no character left or is closed. A stream that breaks is
    opened again, and its sessions go on behind the last frame that came (`DriveOptions.reconnect`).
    """

    def __init__(self, connection: Connection, options: DriveOptions) -> None:
        super().__init__(connection.target.address, connection.way, options)
        self._connection = connection
        self._stream = connection.stream()
        self._stream.do(Open(options.to_message()))

    def attach(self, sessions: Iterable[Character]) -> None:
        """Takes sessions onto the stream. `news` of a tick tell when each is there, or that it could not be taken."""
        self._connection.run(self._attach(sessions), self._stream)

    def detach(self, ids: Iterable[str]) -> None:
        """Takes sessions off the stream."""
        self._connection.run(self._detach(ids), self._stream)

    def next(self, timeout: float | None = None) -> Tick | None:
        """Sends what changed, and waits for the next tick. None: the stream ended as asked, or has no character left.

        Raises:
            DeadlineExceededError: None came in `timeout` seconds; the stream goes on.
            StreamEndedError: The server ended it.

        """
        return self._connection.run(self._next(timeout), self._stream)

    def __iter__(self) -> Iterator[Tick]:
        return self

    def __next__(self) -> Tick:
        tick = self.next()
        if tick is None:
            raise StopIteration
        return tick

    def close(self, timeout: float = 10.0) -> None:
        """Ends the stream and waits until the server has let go of its sessions."""
        try:
            self._connection.run(self._close(timeout), self._stream)
        finally:
            self._stream.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._stream.cancel()
