"""The client for asyncio: methods are those of `troupe.Client`."""

from __future__ import annotations

import asyncio
import copy
import time
from collections.abc import AsyncIterator, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy.typing as npt

from troupe import calls, connection, generate, io
from troupe.aio.connection import Connection
from troupe.aio.live import Crowd, Drive, Session
from troupe.client import POLL_S
from troupe.clip import Clip
from troupe.conventions import Convention
from troupe.drive import DriveOptions
from troupe.errors import UnreachableError
from troupe.generate import FollowPath, Generated, GeneratedPart, Parts
from troupe.inbetween import InBetween, InBetweenAnswer
from troupe.io import Call
from troupe.keyframe import Keyframe
from troupe.options import FrameOptions, SessionOptions
from troupe.pack import Pack
from troupe.route import Route, Way
from troupe.v1 import motion_pb2, scene_pb2, session_pb2, skeleton_pb2
from troupe.words import Audio, Description, Prompt, Sampling, Sound, describe_request


class Client:
    """A connection to a Troupe server, for one event loop. Arguments are those of `troupe.Client`."""

    def __init__(
        self,
        address: str = "127.0.0.1:8080",
        *,
        key: str | None = None,
        ca: str | Path | None = None,
        cert: str | Path | None = None,
        cert_key: str | Path | None = None,
        timeout: float = 60.0,
        route: Route | None = None,
    ) -> None:
        target = connection.target(address, key, ca, cert, cert_key, timeout)
        self._connection = Connection(target, Way(route))

    def routed(self, route: Route) -> Self:
        """A client with another route on the same connection, which either of them closes."""
        client = copy.copy(self)
        client._connection = self._connection.routed(Way(route))
        return client

    @property
    def address(self) -> str:
        """The server's HOST:PORT."""
        return self._connection.target.address

    async def close(self) -> None:
        """Closes the connection. Sessions wait for their time to live."""
        await self._connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    # The server and its packs.

    async def ready(self) -> bool:
        """Whether the server answers, with every pack loaded and warmed up."""
        return await self._connection.is_ready()

    async def wait_ready(self, timeout: float = 60.0) -> None:
        """Waits until the server is ready."""
        until = time.monotonic() + timeout
        while not await self.ready():
            if time.monotonic() > until:
                raise UnreachableError(f"no Troupe server is ready at {self.address} after {timeout:g} s")
            await asyncio.sleep(POLL_S)

    async def packs(self) -> list[Pack]:
        """The packs that the server has loaded, by name. Their bodies come without skeletons: see `pack`."""
        return await self._connection.run(calls.packs())

    async def pack(self, name: str = "") -> Pack:
        """One pack; an empty name stands for the server's default pack."""
        return await self._connection.run(calls.get_pack_itself(name))

    async def load_pack(self, name: str, version: str = "") -> motion_pb2.PackChange:
        """Loads a pack of the server's folder; without a version, the newest. It needs the role admin, as the next two."""
        return await self._connection.run(calls.load_pack(name, version))

    async def unload_pack(self, name: str, version: str = "") -> motion_pb2.PackChange:
        """Unloads a pack. Its live sessions go on with it until they end."""
        return await self._connection.run(calls.unload_pack(name, version))

    async def swap_pack(self, name: str, version: str = "") -> motion_pb2.PackChange:
        """Has another version of a pack serve in its place; without one, the newest. Live sessions go on with it."""
        return await self._connection.run(calls.swap_pack(name, version))

    # Single requests.

    async def in_between(self, gap: InBetween, *, pack: Pack | str = "") -> InBetweenAnswer:
        """Fills one gap."""
        return (await self.in_between_many([gap], pack=pack))[0]

    async def in_between_many(self, gaps: Sequence[InBetween], *, pack: Pack | str = "") -> list[InBetweenAnswer]:
        """Fills many gaps, one for each character, in one request."""
        return await self._connection.run(calls.in_between(gaps, pack))

    async def generate(
        self,
        path: FollowPath | npt.ArrayLike | None = None,
        *,
        prompt: Prompt | str | None = None,
        pack: Pack | str = "",
        body: str = "",
        past: Clip | Sequence[Keyframe] = (),
        seed: int = 0,
        sampling: Sampling | None = None,
        raw: bool = False,
    ) -> Generated:
        """Has a body follow a path, (points, 3) or a `FollowPath`; or acts out words, for packs with the capability `text`.

        Standing feet are held; `raw` gives the network's own frames.
        """
        of = await self._pack(pack, body)
        parts = Parts(of, path)
        call = Call(io.GENERATE, generate.request(of, path, prompt, past, seed, sampling, raw))
        return parts.whole([parts.take(part) async for part in self._connection.parts(call)])

    async def generate_parts(
        self,
        path: FollowPath | npt.ArrayLike | None = None,
        *,
        prompt: Prompt | str | None = None,
        pack: Pack | str = "",
        body: str = "",
        past: Clip | Sequence[Keyframe] = (),
        seed: int = 0,
        sampling: Sampling | None = None,
        raw: bool = False,
    ) -> AsyncIterator[GeneratedPart]:
        """As `generate`, part by part while they are made."""
        of = await self._pack(pack, body)
        parts = Parts(of, path)
        call = Call(io.GENERATE, generate.request(of, path, prompt, past, seed, sampling, raw))
        async for part in self._connection.parts(call):
            yield parts.take(part)
        parts.check_end()

    async def describe(
        self,
        motion: Clip,
        *,
        others: Sequence[Clip] = (),
        pack: Pack | str = "",
        seed: int = 0,
        sampling: Sampling | None = None,
    ) -> str:
        """Puts a motion, and that of other characters beside it, into words: for packs with the capability `describe`."""
        words = self.describe_parts(motion, others=others, pack=pack, seed=seed, sampling=sampling)
        return "".join([part async for part in words])

    async def describe_parts(
        self,
        motion: Clip,
        *,
        others: Sequence[Clip] = (),
        pack: Pack | str = "",
        seed: int = 0,
        sampling: Sampling | None = None,
    ) -> AsyncIterator[str]:
        """As `describe`, part by part while they are found."""
        description = Description()
        request = describe_request(await self._pack(pack, ""), motion, others, None, seed, sampling)
        async for part in self._connection.parts(Call(io.DESCRIBE, request)):
            yield description.words(part)
        description.check_end()

    async def audio_of(
        self,
        motion: Clip,
        sound: Sound,
        *,
        others: Sequence[Clip] = (),
        pack: Pack | str = "",
        seed: int = 0,
        sampling: Sampling | None = None,
    ) -> Audio:
        """Makes audio that goes with a motion, as codes of a pack that declares such a task."""
        description = Description()
        request = describe_request(await self._pack(pack, ""), motion, others, sound, seed, sampling)
        codes = [description.codes(part) async for part in self._connection.parts(Call(io.DESCRIBE, request))]
        description.check_end()
        return Audio(sound, [code for part in codes for code in part])

    async def _pack(self, pack: Pack | str, body: str) -> Pack:
        return await self._connection.run(calls.get_pack(pack, body))

    # Live characters.

    async def session(self, options: SessionOptions | None = None, *, pack: Pack | str = "", body: str = "") -> Session:
        """Opens a session: one character."""
        return (await self.sessions([options or SessionOptions()], pack=pack, body=body))[0]

    async def sessions(
        self, options: Sequence[SessionOptions], *, pack: Pack | str = "", body: str = ""
    ) -> list[Session]:
        """Opens sessions, all or none."""
        return await self._connection.run(calls.open_sessions(options, pack, body, self._made))

    async def resume_session(self, id: str) -> Session:
        """Takes up a session that is open already, such as one of a client that went away."""
        return await self._connection.run(calls.resume_session(id, self._made))

    def _made(self, pack: Pack, of: session_pb2.Session) -> Session:
        return Session(self._connection, pack, of)

    async def list_sessions(self) -> list[session_pb2.Session]:
        """All sessions that are open on the server, by id, whoever opened them."""
        return await self._connection.run(calls.list_sessions())

    async def recording(self, session: str) -> session_pb2.SessionRecording:
        """What a session got and which frames it gave, as lines of JSON: for sessions that are recorded."""
        return await self._connection.run(calls.recording(session))

    async def replay(self, recording: str, *, anyway: bool = False) -> session_pb2.ReplayResponse:
        """Plays the lines of a recording again, and says whether all frames are equal, or the first difference.

        `anyway` plays it on another version, engine or pack as well.
        """
        return calls.last([part async for part in self._connection.parts(calls.replay(recording, anyway))])

    async def close_sessions(self, ids: Iterable[str]) -> int:
        """Closes sessions on whatever servers have them, and says how many were still open."""
        return await self._connection.run(calls.close_sessions(ids))

    async def crowd(
        self,
        characters: int | Sequence[SessionOptions] = (),
        *,
        pack: Pack | str = "",
        body: str = "",
        frames: FrameOptions | None = None,
    ) -> Crowd:
        """Opens many characters that are advanced together. A number of them stands on a grid around the origin, 2 m apart."""
        crowd = Crowd(self._connection, await self._pack(pack, body), frames or FrameOptions())
        await crowd.add(characters)
        return crowd

    async def drive(self, sessions: Iterable[Session] = (), options: DriveOptions | None = None) -> Drive:
        """Opens a stream on which the server advances sessions."""
        drive = Drive(self._connection, options or DriveOptions())
        await drive.open()
        await drive.attach(sessions)
        return drive

    async def styles(self, *, pack: Pack | str = "", body: str = "") -> session_pb2.ListStylesResponse:
        """The styles of a pack, sorted by name and without their keyframes, and which is the default."""
        return await self._connection.run(calls.styles(pack, body))

    async def style(self, name: str, *, pack: Pack | str = "", body: str = "") -> session_pb2.Style:
        """One style with its keyframes."""
        return await self._connection.run(calls.style(name, pack, body))

    async def put_style(self, style: session_pb2.Style, *, pack: Pack | str = "", body: str = "") -> session_pb2.Style:
        """Adds a style to a pack, or replaces one that was added, and gives it as the server keeps it."""
        return await self._connection.run(calls.put_style(style, pack, body))

    # Skeletons of your own.

    async def skeleton(
        self,
        file: str | Path,
        *,
        pack: Pack | str = "",
        body: str = "",
        name: str = "",
        parts: str | Path = "",
        force: bool = False,
    ) -> Pack:
        """Gives the server a character's skeleton, and a pack whose characters wear it.

        The file is a .glb or .vrm with a skin, a .gltf, .bvh or .npz, or a robot's .urdf or .xml. Every call with the pack
        that this returns is on the character: `client.session(pack=hero)`. Its `own` has the certificate. `parts`
        corrects the parts of the body that are found: a TOML text, or such a file.

        Raises:
            InvalidArgumentError: What is no body, or does not fit the pack: with the motion and the joint. `force` takes
                a body whose motion is below the bar.

        """
        return await self._connection.run(calls.put_skeleton(file, pack, body, name, parts, force))

    async def wearing(self, name: str, *, pack: Pack | str = "", body: str = "") -> Pack:
        """A pack whose characters wear a skeleton that the server has."""
        return await self._connection.run(calls.wearing(name, pack, body))

    async def skeletons(self) -> list[skeleton_pb2.SkeletonSummary]:
        """All skeletons of the server, by name."""
        return await self._connection.run(calls.skeletons())

    async def delete_skeleton(self, name: str) -> None:
        """Deletes a skeleton that no session wears."""
        await self._connection.run(calls.delete_skeleton(name))

    # Scenes and objects.

    async def put_scene(self, scene: scene_pb2.Scene | str | Path) -> scene_pb2.SceneSummary:
        """Creates a scene, or replaces the one of its name: a message, a text in TOML or JSON, or such a file."""
        return await self._connection.run(calls.put_scene(scene))

    async def scene(self, name: str, convention: Convention = Convention.NATIVE) -> scene_pb2.Scene:
        """A scene as it is now, in a convention."""
        return await self._connection.run(calls.scene(name, convention))

    async def scenes(self) -> list[scene_pb2.SceneSummary]:
        """All scenes of the server, by name."""
        return await self._connection.run(calls.scenes())

    async def delete_scene(self, name: str) -> None:
        """Deletes a scene in which there are no sessions."""
        await self._connection.run(calls.delete_scene(name))

    async def add_objects(
        self, scene: str, objects: Sequence[scene_pb2.SceneObject], convention: Convention = Convention.NATIVE
    ) -> scene_pb2.ObjectsResponse:
        """Puts objects into a scene. The answer says the result of each."""
        return await self._connection.run(calls.add_objects(scene, objects, convention))

    async def move_objects(
        self, scene: str, moves: Sequence[scene_pb2.ObjectMove], convention: Convention = Convention.NATIVE
    ) -> scene_pb2.ObjectsResponse:
        """Moves objects of a scene. The answer says the result of each."""
        return await self._connection.run(calls.move_objects(scene, moves, convention))

    async def remove_objects(self, scene: str, ids: Iterable[str]) -> scene_pb2.ObjectsResponse:
        """Takes objects out of a scene. The answer says the result of each."""
        return await self._connection.run(calls.remove_objects(scene, ids))

    async def put_object(
        self, definition: str | Path, *, pack: Pack | str = "", check_only: bool = False
    ) -> scene_pb2.PutObjectDefinitionResponse:
        """Adds an object definition for the characters of a pack, or replaces the one of its name; or only checks it."""
        return await self._connection.run(calls.put_object(definition, pack, check_only))

    async def object_definition(self, name: str) -> scene_pb2.GetObjectDefinitionResponse:
        """One object definition with its document, as TOML."""
        return await self._connection.run(calls.object_definition(name))

    async def object_definitions(self) -> list[scene_pb2.ObjectDefinition]:
        """All object definitions of the server, by name."""
        return await self._connection.run(calls.object_definitions())

    async def delete_object(self, name: str) -> None:
        """Deletes an object definition of which no scene has an object."""
        await self._connection.run(calls.delete_object(name))

    async def detect(self, request: scene_pb2.DetectRequest) -> scene_pb2.DetectResponse:
        """The objects that a character, or any box, reaches in its scene."""
        return await self._connection.run(calls.detect(request))
