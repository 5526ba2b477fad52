"""Which server gets a client's calls about sessions, where several servers share them (docs/cluster.md)."""

from __future__ import annotations

import secrets
import threading
from dataclasses import dataclass

from google.protobuf.message import Message

from troupe.errors import InvalidArgumentError, SessionError
from troupe.v1 import scene_pb2

SERVER = "troupe-server"
MOVES = 2
"""Most servers that a call is sent to after the first: one that says that the session has moved, one that knows its server,
and that one."""
_ROUTED = ("/troupe.v1.Sessions/", "/troupe.v1.Scenes/")


@dataclass(frozen=True)
class Route:
    """What a client's calls about sessions are routed by: one of both.

    All sessions of a client are on one server, because they share steps and streams.
    """

    session: str = ""
    """A name, such as the id of the client's only session."""
    scene: str = ""
    """The scene of the client's sessions. All sessions in a scene must be routed by it."""

    def __post_init__(self) -> None:
        name = self.session or self.scene
        if bool(self.session) == bool(self.scene) or not all("!" <= sign <= "~" for sign in name):
            allowed = "visible ASCII characters, for one of session and scene"
            message = f"route: {self.session!r} and {self.scene!r}; allowed: {allowed}"
            raise InvalidArgumentError(message, field="route", allowed=allowed)

    @property
    def header(self) -> tuple[str, str]:
        """Name and value of the header."""
        return ("troupe-scene", self.scene) if self.scene else ("troupe-session", self.session)


def scene_of(request: Message) -> str:
    """The scene that a call is about; empty for all other calls."""
    if isinstance(request, scene_pb2.GetSceneRequest | scene_pb2.DeleteSceneRequest):
        return request.name
    if isinstance(request, scene_pb2.AddObjectsRequest | scene_pb2.MoveObjectsRequest | scene_pb2.RemoveObjectsRequest):
        return request.scene
    if isinstance(request, scene_pb2.PutSceneRequest):
        return request.scene.name
    # A session is where this client's sessions are.
    return request.box.scene if isinstance(request, scene_pb2.DetectRequest) else ""


class Way:
    """The route of a client, and the server that has its sessions, if another one said so. Threads may share it."""

    def __init__(self, route: Route | None) -> None:
        self._key = (route or Route(session=f"client-{secrets.token_hex(8)}")).header
        self._server: str | None = None
        self._lock = threading.Lock()

    def of(self, request: Message) -> Way:
        """The way of a call: a scene may be on another server than the client's sessions."""
        scene = scene_of(request)
        if not scene or self._key == ("troupe-scene", scene):
            return self
        try:
            return Way(Route(scene=scene))
        except InvalidArgumentError:
            # Any server refuses a name that no header can have.
            return self

    def marks(self, path: str) -> tuple[tuple[str, str], ...]:
        """Headers of a call of a method."""
        if not path.startswith(_ROUTED):
            return ()
        with self._lock:
            return (self._key,) if self._server is None else (self._key, (SERVER, self._server))

    def follow(self, error: Exception) -> bool:
        """Sends calls to the server that an error names, from now on. Says whether that is another one than before."""
        if not isinstance(error, SessionError):
            return False
        if error.reason == "SESSION_ELSEWHERE":
            owner = error.allowed
        elif error.reason == "SESSION_MOVED":
            # Any server knows which one has it.
            owner = None
        else:
            return False
        with self._lock:
            is_new = owner is None or owner != self._server
            self._server = owner
        return is_new

    def forget(self) -> None:
        """The server is lost: the router decides again."""
        with self._lock:
            self._server = None
