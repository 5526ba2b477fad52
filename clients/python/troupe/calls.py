"""The client's calls, as steps for a connection of either kind."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from troupe import inbetween, io, pack
from troupe.conventions import Convention
from troupe.errors import AnswerError, TroupeError
from troupe.inbetween import InBetween, InBetweenAnswer
from troupe.io import Call, Steps
from troupe.options import SessionOptions
from troupe.pack import Pack
from troupe.v1 import motion_pb2, scene_pb2, session_pb2, skeleton_pb2

S = TypeVar("S")
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9._-]+")
PAGE = 1000
"""Sessions of a page of a list: the most that the server gives."""
CHUNK = 1000
"""Sessions of a request to create or close some, within the default limits of a server."""


def packs() -> Steps[list[Pack]]:
    """All packs, by name."""
    answer = yield from io.ask(io.LIST_PACKS, motion_pb2.ListPacksRequest())
    return [pack.of_message(message) for message in answer.packs]


def get_pack_itself(name: str) -> Steps[Pack]:
    """A pack by its name."""
    return pack.of_message((yield from io.ask(io.GET_PACK, motion_pb2.GetPackRequest(name=name))))


def get_pack(which: Pack | str, body: str = "") -> Steps[Pack]:
    """A pack by its name, or one that is there already."""
    found = (yield from get_pack_itself(which)) if isinstance(which, str) else which
    # A pack of many bodies has a skeleton of its own too; its sessions have that of the default
    # body.
    return found.of_body(body) if body or (found.bodies and not found.body) else found


def in_between(gaps: Sequence[InBetween], which: Pack | str) -> Steps[list[InBetweenAnswer]]:
    """Fills gaps, one for each character, in one request."""
    of = yield from get_pack(which)
    characters = [gap.to_message(of, f"characters[{nth}]") for nth, gap in enumerate(gaps)]
    request = motion_pb2.InBetweenRequest(pack=of.name, characters=characters, skeleton=of.worn)
    answer = yield from io.ask(io.IN_BETWEEN, request)
    return inbetween.answers(answer, of, len(gaps))


def open_sessions(
    options: Sequence[SessionOptions], which: Pack | str, body: str, make: Callable[[Pack, session_pb2.Session], S]
) -> Steps[list[S]]:
    """Opens sessions, all or none."""
    of = yield from get_pack(which, body)
    opened: list[session_pb2.Session] = []
    for first in range(0, len(options), CHUNK):
        some = [one.to_message(of) for one in options[first : first + CHUNK]]
        request = session_pb2.CreateSessionsRequest(sessions=some)
        try:
            answer = yield from io.ask(io.CREATE_SESSIONS, request)
            if len(answer.sessions) != len(some):
                raise AnswerError("a session is missing", field="sessions")
        except TroupeError as error:
            yield from _close_quietly([session.id for session in opened])
            raise error
        opened.extend(answer.sessions)
    return [make(of, session) for session in opened]


def _close_quietly(ids: Sequence[str]) -> Steps[None]:
    """The first error is the one worth telling."""
    try:
        yield from close_sessions(ids)
    except TroupeError:
        return


def resume_session(name: str, make: Callable[[Pack, session_pb2.Session], S]) -> Steps[S]:
    """Takes up a session that is open already."""
    of = yield from io.ask(io.GET_SESSION, session_pb2.GetSessionRequest(id=name))
    found = yield from get_pack(of.pack, of.body)
    return make((yield from wearing(of.skeleton, found)) if of.skeleton else found, of)


def list_sessions() -> Steps[list[session_pb2.Session]]:
    """All sessions that are open on the server, by id."""
    sessions: list[session_pb2.Session] = []
    token = ""
    while True:
        request = session_pb2.ListSessionsRequest(page_size=PAGE, page_token=token)
        page = yield from io.ask(io.LIST_SESSIONS, request)
        sessions.extend(page.sessions)
        token = page.next_page_token
        if not token:
            return sessions


def close_sessions(ids: Iterable[str]) -> Steps[int]:
    """Closes sessions on whatever servers have them, and says how many were still open.

    A server closes what it has and names the rest. If it has nothing, its error says who has, and the call goes there.
    """
    names, closed = list(ids), 0
    for first in range(0, len(names), CHUNK):
        left = names[first : first + CHUNK]
        while left:
            answer = yield from io.ask(io.CLOSE_SESSIONS, session_pb2.CloseSessionsRequest(ids=left))
            closed += answer.closed
            rest = [of.session_id for of in answer.problems]
            if len(rest) >= len(left):
                raise AnswerError(f"problems: {len(rest)} of {len(left)} sessions; allowed: fewer")
            left = rest
    return closed


def styles(which: Pack | str, body: str) -> Steps[session_pb2.ListStylesResponse]:
    """The styles of a pack."""
    name, of = _pack_and_body(which, body)
    return (yield from io.ask(io.LIST_STYLES, session_pb2.ListStylesRequest(pack=name, body=of)))


def style(name: str, which: Pack | str, body: str) -> Steps[session_pb2.Style]:
    """One style with its keyframes."""
    of_pack, of = _pack_and_body(which, body)
    return (yield from io.ask(io.GET_STYLE, session_pb2.GetStyleRequest(pack=of_pack, style=name, body=of)))


def put_style(new: session_pb2.Style, which: Pack | str, body: str) -> Steps[session_pb2.Style]:
    """Adds or replaces a style."""
    name, of = _pack_and_body(which, body)
    return (yield from io.ask(io.PUT_STYLE, session_pb2.PutStyleRequest(pack=name, style=new, body=of)))


def _pack_and_body(which: Pack | str, body: str) -> tuple[str, str]:
    return (which, body) if isinstance(which, str) else (which.name, body or which.body)


def document(of: str | Path) -> scene_pb2.Document:
    """A text, or the text of a file: JSON where its name or its first sign says so, else TOML."""
    text = of.read_text() if isinstance(of, Path) else of
    is_json = of.suffix == ".json" if isinstance(of, Path) else text.lstrip().startswith("{")
    kind = scene_pb2.DOCUMENT_FORMAT_JSON if is_json else scene_pb2.DOCUMENT_FORMAT_TOML
    return scene_pb2.Document(format=kind, text=text)


def put_skeleton(
    file: str | Path, which: Pack | str, body: str, name: str, parts: str | Path, force: bool
) -> Steps[Pack]:
    """Gives the server a character's skeleton, and makes a pack whose characters wear it."""
    of = yield from get_pack(which, body)
    path = Path(file)
    request = skeleton_pb2.PutSkeletonRequest(
        name=name or _NOT_IN_NAMES.sub("-", path.stem).strip("-.")[:64] or "skeleton",
        file=skeleton_pb2.SkeletonFile(name=path.name, data=path.read_bytes()),
        parts=parts.read_text() if isinstance(parts, Path) else parts,
        pack=of.name,
        body=of.body,
        force=force,
    )
    return of.wearing((yield from io.ask(io.PUT_SKELETON, request)))


def wearing(name: str, which: Pack | str, body: str = "") -> Steps[Pack]:
    """A pack whose characters wear a skeleton that the server has."""
    of = yield from get_pack(which, body)
    request = skeleton_pb2.GetSkeletonRequest(name=name, pack=of.name, body=of.body)
    return of.wearing((yield from io.ask(io.GET_SKELETON, request)))


def skeletons() -> Steps[list[skeleton_pb2.SkeletonSummary]]:
    """All skeletons, by name."""
    return list((yield from io.ask(io.LIST_SKELETONS, skeleton_pb2.ListSkeletonsRequest())).skeletons)


def delete_skeleton(name: str) -> Steps[None]:
    """Deletes a skeleton that no session wears."""
    yield from io.ask(io.DELETE_SKELETON, skeleton_pb2.DeleteSkeletonRequest(name=name))


def load_pack(name: str, version: str) -> Steps[motion_pb2.PackChange]:
    """Loads a pack of the server's folder."""
    return (yield from io.ask(io.LOAD_PACK, motion_pb2.LoadPackRequest(name=name, version=version)))


def unload_pack(name: str, version: str) -> Steps[motion_pb2.PackChange]:
    """Unloads a pack."""
    return (yield from io.ask(io.UNLOAD_PACK, motion_pb2.UnloadPackRequest(name=name, version=version)))


def swap_pack(name: str, version: str) -> Steps[motion_pb2.PackChange]:
    """Puts another version of a pack in its place."""
    return (yield from io.ask(io.SWAP_PACK, motion_pb2.SwapPackRequest(name=name, version=version)))


def recording(session: str) -> Steps[session_pb2.SessionRecording]:
    """What a session got and gave so far."""
    return (yield from io.ask(io.GET_RECORDING, session_pb2.GetRecordingRequest(session_id=session)))


def replay(recording: str, anyway: bool) -> Call[session_pb2.ReplayResponse]:
    """A call that plays a recording."""
    return Call(io.REPLAY, session_pb2.ReplayRequest(recording=recording, anyway=anyway))


def last(parts: Sequence[session_pb2.ReplayResponse]) -> session_pb2.ReplayResponse:
    """The last part of a replay, which has the result."""
    if not parts or not parts[-1].is_last:
        raise AnswerError("the answer to Replay ended before its last part", field="is_last")
    return parts[-1]


def put_scene(scene: scene_pb2.Scene | str | Path) -> Steps[scene_pb2.SceneSummary]:
    """Creates or replaces a scene."""
    if isinstance(scene, scene_pb2.Scene):
        request = scene_pb2.PutSceneRequest(scene=scene)
    else:
        request = scene_pb2.PutSceneRequest(document=document(scene))
    return (yield from io.ask(io.PUT_SCENE, request))


def scene(name: str, convention: Convention) -> Steps[scene_pb2.Scene]:
    """A scene as it is now."""
    request = scene_pb2.GetSceneRequest(name=name, convention=int(convention))  # type: ignore[arg-type]
    return (yield from io.ask(io.GET_SCENE, request))


def scenes() -> Steps[list[scene_pb2.SceneSummary]]:
    """All scenes, by name."""
    return list((yield from io.ask(io.LIST_SCENES, scene_pb2.ListScenesRequest())).scenes)


def delete_scene(name: str) -> Steps[None]:
    """Deletes a scene in which there are no sessions."""
    yield from io.ask(io.DELETE_SCENE, scene_pb2.DeleteSceneRequest(name=name))


def add_objects(
    name: str, objects: Sequence[scene_pb2.SceneObject], convention: Convention
) -> Steps[scene_pb2.ObjectsResponse]:
    """Puts objects into a scene."""
    request = scene_pb2.AddObjectsRequest(
        scene=name,
        objects=objects,
        convention=int(convention),  # type: ignore[arg-type]
    )
    return (yield from io.ask(io.ADD_OBJECTS, request))


def move_objects(
    name: str, moves: Sequence[scene_pb2.ObjectMove], convention: Convention
) -> Steps[scene_pb2.ObjectsResponse]:
    """Moves objects of a scene."""
    request = scene_pb2.MoveObjectsRequest(
        scene=name,
        moves=moves,
        convention=int(convention),  # type: ignore[arg-type]
    )
    return (yield from io.ask(io.MOVE_OBJECTS, request))


def remove_objects(name: str, ids: Iterable[str]) -> Steps[scene_pb2.ObjectsResponse]:
    """Takes objects out of a scene."""
    return (yield from io.ask(io.REMOVE_OBJECTS, scene_pb2.RemoveObjectsRequest(scene=name, ids=ids)))


def put_object(
    definition: str | Path, which: Pack | str, check_only: bool
) -> Steps[scene_pb2.PutObjectDefinitionResponse]:
    """Adds or replaces an object definition, or only checks it."""
    request = scene_pb2.PutObjectDefinitionRequest(
        pack=_pack_and_body(which, "")[0], document=document(definition), check_only=check_only
    )
    return (yield from io.ask(io.PUT_OBJECT, request))


def object_definition(name: str) -> Steps[scene_pb2.GetObjectDefinitionResponse]:
    """One object definition with its document, as TOML."""
    return (yield from io.ask(io.GET_OBJECT, scene_pb2.GetObjectDefinitionRequest(name=name)))


def object_definitions() -> Steps[list[scene_pb2.ObjectDefinition]]:
    """All object definitions, by name."""
    return list((yield from io.ask(io.LIST_OBJECTS, scene_pb2.ListObjectDefinitionsRequest())).definitions)


def delete_object(name: str) -> Steps[None]:
    """Deletes an object definition of which no scene has an object."""
    yield from io.ask(io.DELETE_OBJECT, scene_pb2.DeleteObjectDefinitionRequest(name=name))


def detect(request: scene_pb2.DetectRequest) -> Steps[scene_pb2.DetectResponse]:
    """The objects that a character, or any box, reaches in its scene."""
    return (yield from io.ask(io.DETECT, request))
