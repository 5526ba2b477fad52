"""A connection for asyncio: it does what the library's steps ask for."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any, TypeVar

import grpc
import grpc.aio
from grpc_health.v1 import health_pb2

from troupe import drive, io
from troupe.blocking import HEALTH, QUEUE, serialised
from troupe.connection import Target
from troupe.errors import TroupeError, UnavailableError, of_status
from troupe.io import NOTHING, Call, Calls, Effect, HangUp, Method, Nothing, Open, Pause, Poll, Received, Send, Steps
from troupe.route import MOVES, Way
from troupe.v1 import session_pb2

T = TypeVar("T")


class Connection:
    """A channel, and calls on it."""

    def __init__(self, target: Target, way: Way, channel: Any = None) -> None:
        self.target = target
        self.way = way
        if channel is not None:
            self._channel = channel
        elif target.credentials is None:
            self._channel = grpc.aio.insecure_channel(target.address, target.options)
        else:
            self._channel = grpc.aio.secure_channel(target.address, target.credentials, target.options)
        self._methods: dict[str, Any] = {}

    def routed(self, way: Way) -> Connection:
        """The same channel with another route."""
        return Connection(self.target, way, self._channel)

    def metadata(self, path: str) -> tuple[tuple[str, str], ...]:
        """What goes with a call of a method."""
        return self.target.metadata + self.way.marks(path)

    async def run(self, steps: Steps[T], stream: Stream | None = None) -> T:
        """Does what steps ask for, to their end."""
        try:
            wanted = next(steps)
            while True:
                try:
                    outcome = await self._do(wanted, stream)
                except TroupeError as error:
                    wanted = steps.throw(error)
                else:
                    wanted = steps.send(outcome)
        except StopIteration as end:
            result: T = end.value
            return result

    async def _do(self, wanted: Effect, stream: Stream | None) -> Any:
        if isinstance(wanted, Call):
            return await self._call(wanted)
        if isinstance(wanted, Calls):
            return await asyncio.gather(*(self._outcome(call) for call in wanted.calls))
        if isinstance(wanted, Pause):
            return await asyncio.sleep(wanted.seconds)
        if stream is None:
            raise TypeError(f"{wanted} needs a stream")
        return await stream.do(wanted)

    async def _call(self, call: Call[Any]) -> Any:
        """Makes a call. If its sessions are on another server, it is made again there."""
        way = self.way.of(call.request)
        for _ in range(MOVES):
            try:
                return await self._call_once(call, way)
            except TroupeError as error:
                if not way.follow(error):
                    raise
        return await self._call_once(call, way)

    async def _call_once(self, call: Call[Any], way: Way) -> Any:
        method = self._unary(call.method)
        metadata = self.target.metadata + way.marks(call.method.path)
        try:
            return await method(call.request, timeout=self.target.timeout_s, metadata=metadata)
        except grpc.RpcError as error:
            raise self.error(error) from None

    async def _outcome(self, call: Call[Any]) -> Any:
        try:
            return await self._call(call)
        except TroupeError as error:
            return error

    async def parts(self, call: Call[io.A]) -> AsyncIterator[io.A]:
        """The answers of a method that gives many."""
        method = self._channel.unary_stream(
            call.method.path, request_serializer=serialised, response_deserializer=call.method.answer.FromString
        )
        try:
            async for part in method(call.request, metadata=self.metadata(call.method.path)):
                yield part
        except grpc.RpcError as error:
            raise self.error(error) from None

    def _unary(self, method: Method[Any]) -> Any:
        found = self._methods.get(method.path)
        if found is None:
            found = self._channel.unary_unary(
                method.path, request_serializer=serialised, response_deserializer=method.answer.FromString
            )
            self._methods[method.path] = found
        return found

    def error(self, status: Any) -> TroupeError:
        """The error behind a failed call."""
        return of_status(status, self.target.address, self.target.timeout_s)

    async def is_ready(self) -> bool:
        """Whether the server's health check says that it serves."""
        try:
            answer = await self._call(Call(HEALTH, health_pb2.HealthCheckRequest()))
        except UnavailableError:
            return False
        serving: bool = answer.status == health_pb2.HealthCheckResponse.SERVING
        return serving

    def stream(self) -> Stream:
        """A stream that is to be opened."""
        method = self._channel.stream_stream(
            io.DRIVE.path, request_serializer=serialised, response_deserializer=io.DRIVE.answer.FromString
        )
        return Stream(self, method)

    async def close(self) -> None:
        """Closes the channel."""
        await self._channel.close()


class Stream:
    """A stream of ticks: a task takes what comes, up to a few messages; then the server notices a slow reader."""

    def __init__(self, connection: Connection, method: Any) -> None:
        self._connection = connection
        self._method = method
        self._current: _Opened | None = None

    async def do(self, wanted: Effect) -> Any:
        """Does one thing."""
        if isinstance(wanted, Open):
            self.cancel()
            self._current = _Opened(self._connection, self._method, wanted.first)
            return None
        current = self._current
        if current is None:
            raise TypeError("the stream is not open")
        if isinstance(wanted, Send):
            is_full = wanted.message.HasField("command") and current.asks.qsize() >= QUEUE
            if not is_full:
                current.asks.put_nowait(wanted.message)
            return not is_full
        if isinstance(wanted, HangUp):
            return current.asks.put_nowait(None)
        if isinstance(wanted, Poll):
            return current.poll()
        if isinstance(wanted, io.Receive):
            return await current.receive(wanted.timeout)
        raise TypeError(f"{wanted} is nothing that a stream does")

    def cancel(self) -> None:
        """Ends it at once."""
        if self._current is not None:
            self._current.cancel()


class _Opened:
    """One call."""

    def __init__(self, connection: Connection, method: Any, first: session_pb2.DriveRequest) -> None:
        self._connection = connection
        self._came: asyncio.Queue[Received] = asyncio.Queue(QUEUE)
        self.asks: asyncio.Queue[session_pb2.DriveRequest | None] = asyncio.Queue()
        self.asks.put_nowait(first)
        self._call = method(metadata=connection.metadata(io.DRIVE.path))
        self._writing = asyncio.create_task(self._write())
        self._reading = asyncio.create_task(self._read())

    async def _write(self) -> None:
        # The reading task says why a call has ended.
        with suppress(grpc.RpcError, grpc.aio.UsageError, asyncio.InvalidStateError):
            while (message := await self.asks.get()) is not None:
                await self._call.write(message)
            await self._call.done_writing()

    async def _read(self) -> None:
        try:
            async for message in self._call:
                await self._came.put(message)
            await self._came.put(None)
        except grpc.RpcError as error:
            await self._came.put(self._connection.error(error))
        finally:
            self._writing.cancel()

    def poll(self) -> Received | Nothing:
        try:
            return self._came.get_nowait()
        except asyncio.QueueEmpty:
            return NOTHING

    async def receive(self, timeout: float | None) -> Received:
        try:
            return await asyncio.wait_for(self._came.get(), timeout)
        except TimeoutError:
            raise drive.no_answer(self._connection.target.address, timeout or 0) from None

    def cancel(self) -> None:
        self._reading.cancel()
        self._writing.cancel()
        self._call.cancel()
