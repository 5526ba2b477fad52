"""Which server a router sends calls to, against servers by script behind one port."""

from collections.abc import Callable, Iterator
from concurrent import futures

import grpc
import pytest
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2

import troupe
from troupe import calls, io
from troupe.route import Way
from troupe.v1 import motion_pb2, scene_pb2, session_pb2

ROUTE = troupe.Route(session="guard")


class Script(grpc.GenericRpcHandler):
    """Servers `a:1` and `b:2`: a call without a name of a server reaches `a:1`, and `b:2` has the sessions."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, dict[str, str]]] = []
        self.resumes: list[session_pb2.ResumeSessionsRequest] = []
        self.closings: list[list[str]] = []
        self.streams = 0
        self.is_moving = False
        self.first_drive: Callable[[], Iterator[session_pb2.DriveResponse]] = self.moves
        server = grpc.server(futures.ThreadPoolExecutor(8), handlers=[self])
        self.address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
        self.server = server
        server.start()

    def service(self, details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler | None:
        """Finds the method, and notes the headers."""
        headers = {key: str(value) for key, value in details.invocation_metadata or () if key.startswith("troupe-")}
        name = str(details.method).rsplit("/", 1)[1]
        self.calls.append((name, headers))
        server = headers.get("troupe-server", "a:1")
        if name == "Drive":
            return grpc.stream_stream_rpc_method_handler(lambda asks, context: self.drive(asks))
        return grpc.unary_unary_rpc_method_handler(lambda request, context: self.answer(name, request, server, context))

    def answer(self, name: str, request: bytes, server: str, context: grpc.ServicerContext) -> bytes:
        """Answers a call."""
        if name == "ListPacks":
            return motion_pb2.ListPacksResponse().SerializeToString()
        if name == "ResumeSessions":
            return self.resumed(session_pb2.ResumeSessionsRequest.FromString(request), server).SerializeToString()
        if name == "CloseSessions" and (closed := self.closed(request, server)) is not None:
            return closed.SerializeToString()
        if server == "b:2":
            return session_pb2.CommandResponse().SerializeToString()
        reason = "SESSION_MOVED" if self.is_moving else "SESSION_ELSEWHERE"
        self.is_moving = False
        info = error_details_pb2.ErrorInfo(reason=reason, domain="troupe", metadata={"field": "x", "allowed": "b:2"})
        status = status_pb2.Status(code=9, message="session is on b:2")
        status.details.add().Pack(info)
        context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()),))
        context.abort(grpc.StatusCode.FAILED_PRECONDITION, "session is on b:2")
        raise AssertionError

    def closed(self, request: bytes, server: str) -> session_pb2.CloseSessionsResponse | None:
        """Closes sessions: `own` is on `a:1`, and others are on `b:2`. None: this server has none of them."""
        ids = session_pb2.CloseSessionsRequest.FromString(request).ids
        self.closings.append(list(ids))
        here = [name for name in ids if (name == "own") == (server == "a:1")]
        answer = session_pb2.CloseSessionsResponse(closed=len(here))
        for slot, name in enumerate(ids):
            if name not in here:
                problem = session_pb2.Problem(reason="SESSION_ELSEWHERE", message="it is on b:2", allowed="b:2")
                answer.problems.add(slot=slot, session_id=name, problem=problem)
        return answer if here else None

    def resumed(self, request: session_pb2.ResumeSessionsRequest, server: str) -> session_pb2.ResumeSessionsResponse:
        """Resumes sessions, on the one server."""
        self.resumes.append(request)
        answer = session_pb2.ResumeSessionsResponse()
        for asked in request.sessions:
            if server == "b:2":
                answer.sessions.add(
                    session=session_pb2.Session(id=asked.session_id, frame=asked.frame + 1), restored=True
                )
            else:
                problem = session_pb2.Problem(reason="SESSION_ELSEWHERE", message="it is on b:2", allowed="b:2")
                answer.problems.add(session_id=asked.session_id, problem=problem)
        return answer

    def drive(self, asks: Iterator[bytes]) -> Iterator[bytes]:
        """Answers a stream: the first one by the script, another with the next frame."""
        next(asks)
        next(asks)
        self.streams += 1
        messages = self.first_drive() if self.streams == 1 else iter([attached(), tick(8)])
        for message in messages:
            yield message.SerializeToString()
        for _ in asks:
            pass

    @staticmethod
    def moves() -> Iterator[session_pb2.DriveResponse]:
        """The session comes, and moves to another server after a frame."""
        yield attached()
        yield tick(7)
        left = session_pb2.DriveResponse()
        left.left.sessions.add(slot=3, session_id="guard", problem=session_pb2.Problem(reason="SESSION_MOVED"))
        yield left


def attached() -> session_pb2.DriveResponse:
    answer = session_pb2.DriveResponse()
    answer.attached.sessions.add(session_id="guard", slot=3)
    return answer


def tick(frame: int) -> session_pb2.DriveResponse:
    answer = session_pb2.DriveResponse()
    answer.frames.tick = frame
    answer.frames.blocks.add(
        slots=[3],
        frame_count=1,
        first_frames=[frame],
        root_positions=[0.0, 0.9, frame * 0.04],
        rotations=[1.0, 0.0, 0.0, 0.0],
        contacts=b"\x00",
    )
    return answer


@pytest.fixture
def script() -> Iterator[Script]:
    of = Script()
    yield of
    of.server.stop(None)


def guard() -> session_pb2.Session:
    return session_pb2.Session(id="guard")


def pack_of_one_joint() -> troupe.Pack:
    return calls.pack.of_message(motion_pb2.Pack(name="one", joints=[motion_pb2.Joint(name="hips", parent=-1)]))


def test_calls_about_sessions_have_the_route_and_others_have_not(script: Script) -> None:
    with troupe.Client(script.address, route=ROUTE) as client:
        client.packs()
        scene = client.routed(troupe.Route(scene="yard"))
        scene.list_sessions()
        assert script.calls[:2] == [("ListPacks", {}), ("ListSessions", {"troupe-scene": "yard"})]
    # Without a route each client has a name of its own.
    names = {Way(None).marks("/troupe.v1.Sessions/Step") for _ in range(3)}
    assert len(names) == 3
    with pytest.raises(troupe.InvalidArgumentError, match="route"):
        troupe.Route(session="two words")


@pytest.mark.parametrize("is_moving", [False, True])
def test_a_call_follows_the_server_that_has_the_session(script: Script, is_moving: bool) -> None:
    script.is_moving = is_moving
    with troupe.Client(script.address, route=ROUTE) as client:
        request = session_pb2.CommandRequest()
        client._connection.run(io.ask(io.COMMAND, request))
        client._connection.run(io.ask(io.COMMAND, request))
    servers = [headers.get("troupe-server") for _, headers in script.calls]
    assert servers == [None] * (2 if is_moving else 1) + ["b:2", "b:2"]


def test_a_call_about_a_scene_goes_to_its_server_and_sessions_stay(script: Script) -> None:
    with troupe.Client(script.address, route=ROUTE) as client:
        for asked in (client, client.routed(troupe.Route(scene="yard"))):
            asked.scene("yard")
            asked.list_sessions()
    own, yard, server = {"troupe-session": "guard"}, {"troupe-scene": "yard"}, {"troupe-server": "b:2"}
    assert [headers for _, headers in script.calls] == [
        yard,
        yard | server,
        own,
        own | server,
        yard,
        yard | server,
        yard | server,
    ]


@pytest.mark.parametrize(
    ("request_", "scene"),
    [
        (scene_pb2.PutSceneRequest(scene=scene_pb2.Scene(name="yard")), "yard"),
        (scene_pb2.DeleteSceneRequest(name="yard"), "yard"),
        (scene_pb2.AddObjectsRequest(scene="yard"), "yard"),
        (scene_pb2.MoveObjectsRequest(scene="yard"), "yard"),
        (scene_pb2.RemoveObjectsRequest(scene="yard"), "yard"),
        (scene_pb2.DetectRequest(box=scene_pb2.DetectBox(scene="yard")), "yard"),
        (scene_pb2.DetectRequest(session_id="guard"), ""),
        (scene_pb2.GetSceneRequest(name="two words"), ""),
        (scene_pb2.ListScenesRequest(), ""),
    ],
)
def test_the_way_of_a_call_is_by_the_scene_that_it_names(request_: Message, scene: str) -> None:
    way = Way(ROUTE)
    header = ("troupe-scene", scene) if scene else ("troupe-session", "guard")
    assert way.of(request_).marks("/troupe.v1.Scenes/X") == (header,)


def test_sessions_are_closed_on_the_servers_that_have_them(script: Script) -> None:
    with troupe.Client(script.address, route=ROUTE) as client:
        assert client.close_sessions(["guard", "own", "hero"]) == 3
    servers = [headers.get("troupe-server") for _, headers in script.calls]
    # What `a:1` has is closed there. Asked for the rest, it names the other one.
    assert servers == [None, None, "b:2"]
    assert script.closings == [["guard", "own", "hero"], ["guard", "hero"], ["guard", "hero"]]


def test_a_stream_follows_its_session_from_the_last_frame_on(script: Script) -> None:
    with troupe.Client(script.address, route=ROUTE) as client:
        session = troupe.Session(client._connection, pack_of_one_joint(), guard())
        with client.drive([session], troupe.DriveOptions(every_tick=True)) as drive:
            first, second = drive.next(10), drive.next(10)
            assert first is not None and second is not None
            assert [int(of.frames.first_frames[0]) for of in (first, second)] == [7, 8]
            assert [type(news) for news in second.news] == [troupe.Resumed, troupe.Attached]
            assert list(drive.sessions) == ["guard"]
    # The router's server names the other one, and gets no second call.
    asked = [headers.get("troupe-server") for name, headers in script.calls if name in ("ResumeSessions", "Drive")]
    assert asked == [None, None, "b:2", "b:2"]
    assert [request.sessions[0].frame for request in script.resumes] == [7, 7]
    assert script.resumes[0].sessions[0].pose.root.position.z == pytest.approx(0.28)


def test_a_session_that_moves_leaves_a_stream_that_is_not_opened_again(script: Script) -> None:
    with troupe.Client(script.address, route=ROUTE) as client:
        session = troupe.Session(client._connection, pack_of_one_joint(), guard())
        drive = client.drive([session], troupe.DriveOptions(every_tick=True, reconnect=None))
        assert drive.next(10) is not None
        assert drive.next(10) is None
        assert [(news.session, news.problem.reason) for news in drive.news if isinstance(news, troupe.Left)] == [
            ("guard", "SESSION_MOVED")
        ]
