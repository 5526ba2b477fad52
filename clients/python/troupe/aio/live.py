"""Live characters for asyncio: one, many, and many on the server's clock."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable, Sequence
from types import TracebackType
from typing import Self

from troupe import calls
from troupe.aio.connection import Connection
from troupe.character import Character
from troupe.crowd import CrowdCore, CrowdStep
from troupe.drive import DriveCore, DriveOptions, Tick
from troupe.frames import Frames
from troupe.io import Open
from troupe.options import FrameOptions, SessionOptions
from troupe.pack import Pack
from troupe.v1 import session_pb2


class Session(Character):
    """As `troupe.Session`."""

    def __init__(self, connection: Connection, pack: Pack, of: session_pb2.Session) -> None:
        super().__init__(pack, of)
        self._connection = connection
        self.frame_options = FrameOptions()
        """How its frames are taken."""

    async def step(self, frames: int = 1) -> Frames:
        """As `troupe.Session.step`."""
        return await self._connection.run(self._step(frames, self.frame_options))

    async def send(self) -> None:
        """Sends what it should do now, if it changed, without a step."""
        await self._connection.run(self._send())

    async def send_at(self, frame: int) -> None:
        """Sends how it should move from a frame of its timeline on."""
        await self._connection.run(self._send_at(frame))

    async def info(self) -> session_pb2.Session:
        """The session as the server has it: its place, what it does and has done."""
        return await self._connection.run(self._info())

    async def peek(self, frames: int = 0) -> session_pb2.PeekResponse:
        """Up to so many frames of its buffered future (0: all), and the plan behind it. Changes nothing."""
        return await self._connection.run(self._peek(frames))

    async def close(self) -> None:
        """Closes it on the server. That it is gone already is no error."""
        await self._connection.run(calls.close_sessions([self.id]))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()


class Crowd(CrowdCore[Session]):
    """As `troupe.Crowd`."""

    def __init__(self, connection: Connection, pack: Pack, options: FrameOptions, per_request: int = 1024) -> None:
        super().__init__(pack, options, per_request)
        self._connection = connection

    async def add(self, options: int | Sequence[SessionOptions]) -> list[int]:
        """Opens sessions for new characters, all or none, and gives their numbers. A number of them stands on a grid."""
        return await self._connection.run(self._add(options, self._made))

    def _made(self, pack: Pack, of: session_pb2.Session) -> Session:
        return Session(self._connection, pack, of)

    async def step(self, frames: int = 1) -> CrowdStep:
        """As `troupe.Crowd.step`."""
        return await self._connection.run(self._step(frames))

    async def close(self) -> int:
        """Closes all sessions and says how many were still open."""
        return await self._connection.run(self._close())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()


class Drive(DriveCore):
    """As `troupe.Drive`: `async for tick in drive` gives ticks as they come."""

    def __init__(self, connection: Connection, options: DriveOptions) -> None:
        super().__init__(connection.target.address, connection.way, options)
        self._connection = connection
        self._stream = connection.stream()

    async def open(self) -> None:
        """Opens the stream."""
        await self._stream.do(Open(self.options.to_message()))

    async def attach(self, sessions: Iterable[Character]) -> None:
        """Takes sessions onto the stream. `news` of a tick tell when each is there, or that it could not be taken."""
        await self._connection.run(self._attach(sessions), self._stream)

    async def detach(self, ids: Iterable[str]) -> None:
        """Takes sessions off the stream."""
        await self._connection.run(self._detach(ids), self._stream)

    async def next(self, timeout: float | None = None) -> Tick | None:
        """As `troupe.Drive.next`."""
        return await self._connection.run(self._next(timeout), self._stream)

    def __aiter__(self) -> AsyncIterator[Tick]:
        return self

    async def __anext__(self) -> Tick:
        tick = await self.next()
        if tick is None:
            raise StopAsyncIteration
        return tick

    async def close(self, timeout: float = 10.0) -> None:
        """Ends the stream and waits until the server has let go of its sessions."""
        try:
            await self._connection.run(self._close(timeout), self._stream)
        finally:
            self._stream.cancel()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            await self.close()
        else:
            self._stream.cancel()
