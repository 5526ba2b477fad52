"""The client's requests to a connection of either kind.

The logic is written once, as generators: each yields what it needs done and gets the outcome sent back. The clients of
`troupe` and `troupe.aio` drive the same generators, one by blocking and one by awaiting.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

from google.protobuf.message import Message

from troupe.errors import TroupeError
from troupe.v1 import motion_pb2, scene_pb2, session_pb2, skeleton_pb2

A = TypeVar("A", bound=Message)
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Method(Generic[A]):
    """A method of the API with one answer, or a stream of them."""

    path: str
    answer: type[A]


@dataclass(frozen=True, slots=True)
class Call(Generic[A]):
    """To make a call. Its outcome is the answer, or the error raised."""

    method: Method[A]
    request: Message


@dataclass(frozen=True, slots=True)
class Calls(Generic[A]):
    """To make calls at the same time. Their outcome is a list of answers and errors."""

    calls: Sequence[Call[A]]


@dataclass(frozen=True, slots=True)
class Pause:
    """To wait."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Open:
    """To open a stream in place of the one that is open, if any, with a first message."""

    first: session_pb2.DriveRequest


@dataclass(frozen=True, slots=True)
class Send:
    """To send on the stream. The outcome: whether there was room."""

    message: session_pb2.DriveRequest


@dataclass(frozen=True, slots=True)
class Receive:
    """To wait for the next message of the stream. The outcome is that, None at its end, or the error it broke with."""

    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class Poll:
    """To look whether a message has come. The outcome is as of `Receive`, and `NOTHING` if none has."""


@dataclass(frozen=True, slots=True)
class HangUp:
    """To say that no more will be sent on the stream."""


class Nothing:
    """No message has come."""


NOTHING = Nothing()
Received: TypeAlias = session_pb2.DriveResponse | TroupeError | None
Effect: TypeAlias = Call[Any] | Calls[Any] | Pause | Open | Send | Receive | Poll | HangUp
Steps: TypeAlias = Generator[Effect, Any, T]


def ask(method: Method[A], request: Message) -> Steps[A]:
    """Makes a call and gives its answer."""
    answer: A = yield Call(method, request)
    return answer


def ask_all(calls: Sequence[Call[A]]) -> Steps[list[A | TroupeError]]:
    """Makes calls at the same time and gives their answers and errors."""
    outcomes: list[A | TroupeError] = yield Calls(calls)
    return outcomes


IN_BETWEEN = Method("/troupe.v1.Motion/InBetween", motion_pb2.InBetweenResponse)
GENERATE = Method("/troupe.v1.Motion/Generate", motion_pb2.GenerateResponse)
DESCRIBE = Method("/troupe.v1.Motion/Describe", motion_pb2.DescribeResponse)
LIST_PACKS = Method("/troupe.v1.Motion/ListPacks", motion_pb2.ListPacksResponse)
GET_PACK = Method("/troupe.v1.Motion/GetPack", motion_pb2.Pack)
LOAD_PACK = Method("/troupe.v1.Motion/LoadPack", motion_pb2.PackChange)
UNLOAD_PACK = Method("/troupe.v1.Motion/UnloadPack", motion_pb2.PackChange)
SWAP_PACK = Method("/troupe.v1.Motion/SwapPack", motion_pb2.PackChange)

CREATE_SESSIONS = Method("/troupe.v1.Sessions/CreateSessions", session_pb2.CreateSessionsResponse)
RESUME_SESSIONS = Method("/troupe.v1.Sessions/ResumeSessions", session_pb2.ResumeSessionsResponse)
GET_SESSION = Method("/troupe.v1.Sessions/GetSession", session_pb2.Session)
LIST_SESSIONS = Method("/troupe.v1.Sessions/ListSessions", session_pb2.ListSessionsResponse)
CLOSE_SESSIONS = Method("/troupe.v1.Sessions/CloseSessions", session_pb2.CloseSessionsResponse)
COMMAND = Method("/troupe.v1.Sessions/Command", session_pb2.CommandResponse)
STEP = Method("/troupe.v1.Sessions/Step", session_pb2.StepResponse)
DRIVE = Method("/troupe.v1.Sessions/Drive", session_pb2.DriveResponse)
PEEK = Method("/troupe.v1.Sessions/Peek", session_pb2.PeekResponse)
GET_RECORDING = Method("/troupe.v1.Sessions/GetRecording", session_pb2.SessionRecording)
REPLAY = Method("/troupe.v1.Sessions/Replay", session_pb2.ReplayResponse)
LIST_STYLES = Method("/troupe.v1.Sessions/ListStyles", session_pb2.ListStylesResponse)
GET_STYLE = Method("/troupe.v1.Sessions/GetStyle", session_pb2.Style)
PUT_STYLE = Method("/troupe.v1.Sessions/PutStyle", session_pb2.Style)

PUT_SKELETON = Method("/troupe.v1.Skeletons/PutSkeleton", skeleton_pb2.OwnSkeleton)
GET_SKELETON = Method("/troupe.v1.Skeletons/GetSkeleton", skeleton_pb2.OwnSkeleton)
LIST_SKELETONS = Method("/troupe.v1.Skeletons/ListSkeletons", skeleton_pb2.ListSkeletonsResponse)
DELETE_SKELETON = Method("/troupe.v1.Skeletons/DeleteSkeleton", skeleton_pb2.DeleteSkeletonResponse)
PUT_SCENE = Method("/troupe.v1.Scenes/PutScene", scene_pb2.SceneSummary)
GET_SCENE = Method("/troupe.v1.Scenes/GetScene", scene_pb2.Scene)
LIST_SCENES = Method("/troupe.v1.Scenes/ListScenes", scene_pb2.ListScenesResponse)
DELETE_SCENE = Method("/troupe.v1.Scenes/DeleteScene", scene_pb2.DeleteSceneResponse)
ADD_OBJECTS = Method("/troupe.v1.Scenes/AddObjects", scene_pb2.ObjectsResponse)
MOVE_OBJECTS = Method("/troupe.v1.Scenes/MoveObjects", scene_pb2.ObjectsResponse)
REMOVE_OBJECTS = Method("/troupe.v1.Scenes/RemoveObjects", scene_pb2.ObjectsResponse)
PUT_OBJECT = Method("/troupe.v1.Scenes/PutObjectDefinition", scene_pb2.PutObjectDefinitionResponse)
GET_OBJECT = Method("/troupe.v1.Scenes/GetObjectDefinition", scene_pb2.GetObjectDefinitionResponse)
LIST_OBJECTS = Method("/troupe.v1.Scenes/ListObjectDefinitions", scene_pb2.ListObjectDefinitionsResponse)
DELETE_OBJECT = Method("/troupe.v1.Scenes/DeleteObjectDefinition", scene_pb2.DeleteObjectDefinitionResponse)
DETECT = Method("/troupe.v1.Scenes/Detect", scene_pb2.DetectResponse)
