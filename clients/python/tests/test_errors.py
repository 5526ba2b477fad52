import socket
from collections.abc import Iterable

import grpc
import pytest
from google.protobuf import any_pb2, duration_pb2
from google.rpc import error_details_pb2, status_pb2

import troupe
from troupe import connection, errors, io
from troupe.v1 import event_pb2, motion_pb2, scene_pb2, session_pb2, skeleton_pb2


class Status:
    """An error as gRPC raises it."""

    def __init__(self, code: grpc.StatusCode, words: str, *details: object, request_id: str = "") -> None:
        self._code, self._words = code, words
        status = status_pb2.Status(code=code.value[0], message=words)
        for detail in details:
            packed = any_pb2.Any()
            packed.Pack(detail)
            status.details.append(packed)
        self._trailers: list[tuple[str, str | bytes]] = []
        if details:
            self._trailers.append((errors.DETAILS, status.SerializeToString()))
        if request_id:
            self._trailers.append(("x-request-id", request_id))

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str:
        return self._words

    def trailing_metadata(self) -> Iterable[tuple[str, str | bytes]]:
        return self._trailers


def read(status: Status) -> troupe.TroupeError:
    return errors.of_status(status, "host:1", 2.0)


def test_details_say_field_range_place_and_hint() -> None:
    info = error_details_pb2.ErrorInfo(
        reason="INVALID_FIELD", metadata={"field": "a[0].b", "allowed": "1 to 2", "line": "3", "column": "9"}
    )
    retry = error_details_pb2.RetryInfo(retry_delay=duration_pb2.Duration(seconds=1, nanos=500_000_000))
    error = read(Status(grpc.StatusCode.INVALID_ARGUMENT, "a[0].b: is 5", info, retry, request_id="r1"))
    assert isinstance(error, troupe.InvalidArgumentError) and isinstance(error, ValueError)
    assert (error.code, error.reason, error.field, error.allowed) == (
        "INVALID_ARGUMENT",
        "INVALID_FIELD",
        "a[0].b",
        "1 to 2",
    )
    assert (error.place, error.retry_after, error.request_id) == ((3, 9), 1.5, "r1")


def test_a_bad_request_names_the_field_where_nothing_else_does() -> None:
    bad = error_details_pb2.BadRequest(field_violations=[{"field": "x", "description": "no"}])
    info = error_details_pb2.ErrorInfo(reason="INVALID_FIELD")
    assert read(Status(grpc.StatusCode.INVALID_ARGUMENT, "x", info, bad)).field == "x"


def test_problems_of_sessions_are_their_own_kind() -> None:
    info = error_details_pb2.ErrorInfo(reason="SESSION_EXPIRED")
    error = read(Status(grpc.StatusCode.NOT_FOUND, "it expired", info))
    assert isinstance(error, troupe.SessionError) and error.is_gone and error.code == "NOT_FOUND"
    problem = session_pb2.Problem(reason="OBJECT_TAKEN", message="taken", field="f", allowed="free")
    error = errors.of_problem(problem, "guard")
    assert (str(error), error.field, error.allowed, error.is_gone) == ("session 'guard': taken", "f", "free", False)


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (grpc.StatusCode.NOT_FOUND, troupe.NotFoundError),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, troupe.ResourceExhaustedError),
        (grpc.StatusCode.UNAUTHENTICATED, troupe.UnauthenticatedError),
        (grpc.StatusCode.PERMISSION_DENIED, troupe.PermissionDeniedError),
        (grpc.StatusCode.FAILED_PRECONDITION, troupe.FailedPreconditionError),
        (grpc.StatusCode.UNAVAILABLE, troupe.UnavailableError),
        (grpc.StatusCode.INTERNAL, troupe.InternalError),
    ],
)
def test_each_code_has_a_class(code: grpc.StatusCode, kind: type[troupe.TroupeError]) -> None:
    info = error_details_pb2.ErrorInfo(reason="SOME")
    error = read(Status(code, "words", info))
    assert type(error) is kind and error.code == code.name


def test_what_the_transport_says_is_no_servers_word() -> None:
    assert isinstance(read(Status(grpc.StatusCode.UNAVAILABLE, "refused")), troupe.UnreachableError)
    # A router cancels the streams of a server that it has lost.
    assert isinstance(read(Status(grpc.StatusCode.CANCELLED, "RST_STREAM")), troupe.UnreachableError)
    late = read(Status(grpc.StatusCode.DEADLINE_EXCEEDED, "Deadline Exceeded"))
    assert isinstance(late, TimeoutError) and "within 2 s" in str(late)


def test_an_unreachable_server_is_named() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with troupe.Client(f"127.0.0.1:{port}") as client:
        assert not client.ready()
        with pytest.raises(troupe.UnreachableError, match=str(port)):
            client.packs()


@pytest.mark.parametrize("address", ["", "ftp://a", "a b", "http://a/b"])
def test_a_wrong_address_is_named(address: str) -> None:
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        troupe.Client(address)
    assert caught.value.field == "address"


def test_addresses_and_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(address: str, key: str | None = None) -> connection.Target:
        return connection.target(address, key, None, None, None, 1.0)

    assert of("http://127.0.0.1:8080/").address == "127.0.0.1:8080"
    assert of("https://a").address == "a:443" and of("https://a").credentials is not None
    assert of("[::1]:8080").address == "[::1]:8080"
    assert of("a:1").metadata == ()
    assert of("a:1", "troupe_1").metadata == (("authorization", "Bearer troupe_1"),)
    assert "troupe_1" not in repr(of("a:1", "troupe_1"))
    monkeypatch.setenv("TROUPE_KEY", "from_env")
    assert of("a:1").metadata == (("authorization", "Bearer from_env"),)
    with pytest.raises(troupe.InvalidArgumentError, match="key"):
        of("a:1", "a\nb")
    with pytest.raises(troupe.InvalidArgumentError, match="https"):
        connection.target("http://a", None, "ca.pem", None, None, 1.0)


def test_every_method_is_the_contracts() -> None:
    services = {}
    for module in (motion_pb2, session_pb2, scene_pb2, skeleton_pb2, event_pb2):
        for service in module.DESCRIPTOR.services_by_name.values():
            for method in service.methods:
                services[f"/{service.full_name}/{method.name}"] = method.output_type.full_name
    ours = {
        value.path: value.answer.DESCRIPTOR.full_name for value in vars(io).values() if isinstance(value, io.Method)
    }
    assert ours == services
