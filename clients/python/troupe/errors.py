"""Errors. Every error of this library is a `TroupeError`.

The server names the field that is wrong and what it may be; errors that the client finds before it asks say the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Protocol

import grpc
from google.protobuf.message import DecodeError
from google.rpc import error_details_pb2, status_pb2

from troupe.v1 import session_pb2

DETAILS = "grpc-status-details-bin"
# Problems of one session, as the server names them: also if they are a call's error.
GONE = frozenset({"SESSION_EXPIRED", "UNKNOWN_SESSION", "SESSION_CLOSED"})
OF_A_SESSION = GONE | {"SESSION_EXISTS", "SESSION_BUSY", "SESSION_ELSEWHERE", "SESSION_MOVED"}
# Problems of a session that is there, and can be resumed a little later.
PASSING = frozenset({"SESSION_BUSY", "SESSION_ELSEWHERE", "SESSION_MOVED", "STORE_UNREACHABLE"})


class TroupeError(Exception):
    """Something went wrong.

    `message` is for people; programs test the class, or `reason`, the server's word for the kind of error. `field` is the path
    of the field at fault, such as `characters[0].frame_count`, and `allowed` what it may be, such as `12 to 64`.
    """

    code = "UNKNOWN"

    def __init__(
        self,
        message: str,
        *,
        reason: str = "",
        field: str | None = None,
        allowed: str | None = None,
        retry_after: float | None = None,
        request_id: str | None = None,
        place: tuple[int, int] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.reason = reason
        self.field = field
        self.allowed = allowed
        self.retry_after = retry_after
        """Seconds after which another try may succeed."""
        self.request_id = request_id
        """The request's id, which the server's log lines show."""
        self.place = place
        """Line and column, from 1, of the error in a document."""


class InvalidArgumentError(TroupeError, ValueError):
    """A value, a field or a document is not accepted. Also raised before anything is sent."""

    code = "INVALID_ARGUMENT"


class UnauthenticatedError(TroupeError):
    """The server asks for a key, or does not accept the one it got."""

    code = "UNAUTHENTICATED"


class PermissionDeniedError(TroupeError):
    """The key's role does not allow this call."""

    code = "PERMISSION_DENIED"


class NotFoundError(TroupeError):
    """There is no such pack, session, scene, object, definition or style."""

    code = "NOT_FOUND"


class AlreadyExistsError(TroupeError):
    """The name of a new session or object is taken."""

    code = "ALREADY_EXISTS"


class FailedPreconditionError(TroupeError):
    """Not possible now, such as to use an object that another session holds, or not with this pack."""

    code = "FAILED_PRECONDITION"


class ResourceExhaustedError(TroupeError):
    """No room: queue, sessions, streams, memory. Most have `retry_after`."""

    code = "RESOURCE_EXHAUSTED"


class DeadlineExceededError(TroupeError, TimeoutError):
    """There was no answer in time."""

    code = "DEADLINE_EXCEEDED"


class UnavailableError(TroupeError, ConnectionError):
    """The server is starting or stopping."""

    code = "UNAVAILABLE"


class UnreachableError(UnavailableError):
    """Nothing answers at the address, or the connection broke."""


class UnimplementedError(TroupeError):
    """The server does not know this call."""

    code = "UNIMPLEMENTED"


class CancelledError(TroupeError):
    """The call was cancelled."""

    code = "CANCELLED"


class InternalError(TroupeError):
    """Inference failed."""

    code = "INTERNAL"


class AnswerError(TroupeError):
    """The server's answer breaks the contract."""

    code = "DATA_LOSS"


class SessionError(TroupeError):
    """One session cannot be served, or refuses its command. `code` is the gRPC status if that is a call's error."""

    def __init__(self, message: str, *, session: str = "", code: str = "NOT_FOUND", **more: Any) -> None:
        super().__init__(message, **more)
        self.session = session
        self.code = code

    @property
    def is_gone(self) -> bool:
        """Whether the session is gone for good."""
        return self.reason in GONE

    def __str__(self) -> str:
        return f"session {self.session!r}: {self.message}" if self.session else self.message


class StreamEndedError(TroupeError):
    """The server ended a stream: `reason` is DRAINING, SLOW_READER or INVALID_REQUEST."""

    code = "ABORTED"


_BY_CODE: dict[str, type[TroupeError]] = {
    kind.code: kind
    for kind in (
        InvalidArgumentError,
        UnauthenticatedError,
        PermissionDeniedError,
        NotFoundError,
        AlreadyExistsError,
        FailedPreconditionError,
        ResourceExhaustedError,
        DeadlineExceededError,
        UnavailableError,
        UnimplementedError,
        CancelledError,
        InternalError,
    )
}


class Status(Protocol):
    """gRPC's error, from a channel of either kind."""

    def code(self) -> grpc.StatusCode:
        """The status."""
        ...

    def details(self) -> str | None:
        """Its words."""
        ...

    def trailing_metadata(self) -> Iterable[tuple[str, str | bytes]] | None:
        """Metadata that came with it."""
        ...


def of_problem(problem: session_pb2.Problem, session: str) -> SessionError:
    """Why one of many sessions could not be served."""
    message = problem.message or problem.reason
    return SessionError(
        message, session=session, reason=problem.reason, field=problem.field or None, allowed=problem.allowed or None
    )


def of_status(status: Status, address: str, timeout_s: float | None) -> TroupeError:
    """The error behind a failed call."""
    code = status.code().name
    trailers = dict(status.trailing_metadata() or ())
    packed = trailers.get(DETAILS)
    request_id = trailers.get("x-request-id")
    words = status.details() or code
    if packed is None and request_id is None:
        # Not by the server: the transport's own.
        # A router that lost its server cancels the stream.
        if code in ("UNAVAILABLE", "UNKNOWN", "INTERNAL", "CANCELLED"):
            return UnreachableError(f"no Troupe server answers at {address}: {words}")
        if code == "DEADLINE_EXCEEDED" and timeout_s is not None:
            return DeadlineExceededError(f"the server at {address} did not answer within {timeout_s:g} s")
    more = _details(packed) if isinstance(packed, bytes) else {}
    more["request_id"] = request_id if isinstance(request_id, str) else None
    if more.get("reason") in OF_A_SESSION:
        return SessionError(words, code=code, **more)
    kind = _BY_CODE.get(code)
    if kind is None:
        error = TroupeError(words, **more)
        error.code = code
        return error
    return kind(words, **more)


def _details(packed: bytes) -> dict[str, Any]:
    """The `google.rpc` details of an error, by the names of a `TroupeError`'s arguments."""
    more: dict[str, Any] = {}
    try:
        details = status_pb2.Status.FromString(packed).details
    except DecodeError:
        return more
    info, bad, retry = error_details_pb2.ErrorInfo(), error_details_pb2.BadRequest(), error_details_pb2.RetryInfo()
    for detail in details:
        if detail.Unpack(info):
            more["reason"] = info.reason
            more["field"] = info.metadata.get("field")
            more["allowed"] = info.metadata.get("allowed")
            line, column = info.metadata.get("line", ""), info.metadata.get("column", "")
            if re.fullmatch(r"\d+", line) and re.fullmatch(r"\d+", column):
                more["place"] = (int(line), int(column))
        elif detail.Unpack(bad) and bad.field_violations:
            more["field"] = more.get("field") or bad.field_violations[0].field
        elif detail.Unpack(retry):
            more["retry_after"] = retry.retry_delay.ToTimedelta().total_seconds()
    return more
