"""A connection that blocks: it does what the library's steps ask for."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator
from typing import Any, TypeVar

import grpc
from grpc_health.v1 import health_pb2

from troupe import drive, io
from troupe.connection import Target
from troupe.errors import TroupeError, UnavailableError, of_status
from troupe.io import NOTHING, Call, Calls, Effect, HangUp, Method, Nothing, Open, Pause, Poll, Received, Send, Steps
from troupe.route import MOVES, Way
from troupe.v1 import session_pb2

T = TypeVar("T")
HEALTH = Method("/grpc.health.v1.Health/Check", health_pb2.HealthCheckResponse)
QUEUE = 64
"""Messages of a stream that wait for their reader; commands that wait to be sent."""
HUNG_UP_S = 0.1


class Connection:
    """A channel, and calls on it."""

    def __init__(self, target: Target, way: Way, channel: Any = None) -> None:
        self.target = target
        self.way = way
        if channel is not None:
            self._channel = channel
        elif target.credentials is None:
            self._channel = grpc.insecure_channel(target.address, target.options)
        else:
            self._channel = grpc.secure_channel(target.address, target.credentials, target.options)
        self._methods: dict[str, Any] = {}

    def routed(self, way: Way) -> Connection:
        """The same channel with another route."""
        return Connection(self.target, way, self._channel)

    def metadata(self, path: str) -> tuple[tuple[str, str], ...]:
        """What goes with a call of a method."""
        return self.target.metadata + self.way.marks(path)

    def run(self, steps: Steps[T], stream: Stream | None = None) -> T:
        """Does what steps ask for, to their end."""
        try:
            wanted = next(steps)
            while True:
                try:
                    outcome = self._do(wanted, stream)
                except TroupeError as error:
                    wanted = steps.throw(error)
                else:
                    wanted = steps.send(outcome)
        except StopIteration as end:
            result: T = end.value
            return result

    def _do(self, wanted: Effect, stream: Stream | None) -> Any:
        if isinstance(wanted, Call):
            return self._call(wanted)
        if isinstance(wanted, Calls):
            return self._calls(wanted)
        if isinstance(wanted, Pause):
            return time.sleep(wanted.seconds)
        if stream is None:
            raise TypeError(f"{wanted} needs a stream")
        return stream.do(wanted)

    def _call(self, call: Call[Any]) -> Any:
        """Makes a call. If its sessions are on another server, it is made again there."""
        way = self.way.of(call.request)
        for _ in range(MOVES):
            try:
                return self._call_once(call, way)
            except TroupeError as error:
                if not way.follow(error):
                    raise
        return self._call_once(call, way)

    def _call_once(self, call: Call[Any], way: Way) -> Any:
        method = self._unary(call.method)
        metadata = self.target.metadata + way.marks(call.method.path)
        try:
            return method(call.request, timeout=self.target.timeout_s, metadata=metadata)
        except grpc.RpcError as error:
            raise self.error(error) from None

    def _calls(self, calls: Calls[Any]) -> list[Any]:
        if len(calls.calls) == 1:
            try:
                return [self._call(calls.calls[0])]
            except TroupeError as error:
                return [error]
        futures = [
            self._unary(call.method).future(
                call.request, timeout=self.target.timeout_s, metadata=self.metadata(call.method.path)
            )
            for call in calls.calls
        ]
        return [self._outcome(call, future) for call, future in zip(calls.calls, futures, strict=True)]

    def _outcome(self, call: Call[Any], future: Any) -> Any:
        try:
            return future.result()
        except grpc.RpcError as failed:
            error = self.error(failed)
        if not self.way.follow(error):
            return error
        try:
            return self._call(call)
        except TroupeError as error:
            return error

    def parts(self, call: Call[io.A]) -> Iterator[io.A]:
        """The answers of a method that gives many."""
        method = self._channel.unary_stream(
            call.method.path, request_serializer=serialised, response_deserializer=call.method.answer.FromString
        )
        try:
            yield from method(call.request, metadata=self.metadata(call.method.path))
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

    def is_ready(self) -> bool:
        """Whether the server's health check says that it serves."""
        try:
            answer = self._call(Call(HEALTH, health_pb2.HealthCheckRequest()))
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

    def close(self) -> None:
        """Closes the channel."""
        self._channel.close()


def serialised(message: Any) -> bytes:
    """A message's bytes."""
    data: bytes = message.SerializeToString()
    return data


class Stream:
    """A stream of ticks: a thread takes what comes, up to a few messages; then the server notices a slow reader."""

    def __init__(self, connection: Connection, method: Any) -> None:
        self._connection = connection
        self._method = method
        self._current: _Opened | None = None

    def do(self, wanted: Effect) -> Any:
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
                current.asks.put(wanted.message)
            return not is_full
        if isinstance(wanted, HangUp):
            return current.asks.put(None)
        if isinstance(wanted, Poll):
            return current.poll()
        if isinstance(wanted, io.Receive):
            return current.receive(wanted.timeout)
        raise TypeError(f"{wanted} is nothing that a stream does")

    def cancel(self) -> None:
        """Ends it at once."""
        if self._current is not None:
            self._current.cancel()


class _Opened:
    """One call."""

    def __init__(self, connection: Connection, method: Any, first: session_pb2.DriveRequest) -> None:
        self._connection = connection
        self._came: queue.Queue[Received] = queue.Queue(QUEUE)
        self._is_over = threading.Event()
        self.asks: queue.SimpleQueue[session_pb2.DriveRequest | None] = queue.SimpleQueue()
        self.asks.put(first)
        self._call = method(iter(self.asks.get, None), metadata=connection.metadata(io.DRIVE.path))
        threading.Thread(target=self._pump, name="troupe-drive", daemon=True).start()

    def _pump(self) -> None:
        try:
            for message in self._call:
                self._put(message)
            self._put(None)
        except grpc.RpcError as error:
            self._put(self._connection.error(error))

    def _put(self, message: Received) -> None:
        while not self._is_over.is_set():
            try:
                self._came.put(message, timeout=HUNG_UP_S)
            except queue.Full:
                continue
            return

    def poll(self) -> Received | Nothing:
        try:
            return self._came.get_nowait()
        except queue.Empty:
            return NOTHING

    def receive(self, timeout: float | None) -> Received:
        try:
            return self._came.get(timeout=timeout)
        except queue.Empty:
            raise drive.no_answer(self._connection.target.address, timeout or 0) from None

    def cancel(self) -> None:
        self._is_over.set()
        self.asks.put(None)
        self._call.cancel()
