"""The client for asyncio, against a real server."""

import asyncio
import gc
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

import grpc
import grpc.aio
import numpy as np
import pytest

import troupe
import troupe.aio
from conftest import ROOT
from troupe import client as blocking
from troupe import io
from troupe.aio import client as awaiting
from troupe.v1 import session_pb2


def run(address: str, test: Callable[[troupe.aio.Client], Coroutine[Any, Any, None]]) -> None:
    async def main() -> None:
        async with troupe.aio.Client(address) as client:
            await test(client)

    asyncio.run(main())


def test_both_clients_have_the_same_methods() -> None:
    def public(kind: type) -> set[str]:
        return {name for name in vars(kind) if not name.startswith("_")}

    assert public(blocking.Client) == public(awaiting.Client)
    assert public(troupe.Session) == public(troupe.aio.Session)
    assert public(troupe.Crowd) == public(troupe.aio.Crowd)
    assert public(troupe.aio.Drive) - public(troupe.Drive) == {"open"}


def test_gaps_paths_and_refusals(address: str) -> None:
    async def test(client: troupe.aio.Client) -> None:
        await client.wait_ready()
        pack = await client.pack()
        clip = troupe.Clip.from_bvh(ROOT / "examples" / "walk.bvh").on(pack.skeleton)
        gap = troupe.InBetween.from_clip(clip, 30, 65, seed=7)
        first, second = await asyncio.gather(client.in_between(gap, pack=pack), client.in_between(gap))
        assert np.array_equal(first.clip.rotations, second.clip.rotations)
        with troupe.Client(address) as other:
            assert np.array_equal(other.in_between(gap).clip.rotations, first.clip.rotations)
        made = await client.generate([[0, 0, 0], [0, 0, 1]], pack="unimogen", body="fox")
        parts = [part async for part in client.generate_parts([[0, 0, 0], [0, 0, 1]], pack="unimogen", body="fox")]
        assert sum(len(part.clip) for part in parts) == len(made.clip)
        with pytest.raises(troupe.NotFoundError):
            await client.pack("absent")

    run(address, test)


async def breaks_off(asked: AsyncIterator[Any], context: Any) -> AsyncIterator[Any]:
    """A server's end of a stream, which breaks after the first message."""
    async for _ in asked:
        yield session_pb2.DriveResponse()
        await context.abort(grpc.StatusCode.UNAVAILABLE, "it breaks off")


def test_a_stream_that_breaks_leaves_nothing_behind() -> None:
    async def main() -> None:
        said: list[str] = []
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: said.append(context["message"]))
        drives = grpc.stream_stream_rpc_method_handler(
            breaks_off, session_pb2.DriveRequest.FromString, session_pb2.DriveResponse.SerializeToString
        )
        service, method = io.DRIVE.path.strip("/").split("/")
        server = grpc.aio.server()
        server.add_generic_rpc_handlers([grpc.method_handlers_generic_handler(service, {method: drives})])
        port = server.add_insecure_port("127.0.0.1:0")
        await server.start()
        async with troupe.aio.Client(f"127.0.0.1:{port}") as client:
            stream = client._connection.stream()
            for _ in range(5):
                await stream.do(io.Open(session_pb2.DriveRequest()))
                assert isinstance(await stream.do(io.Receive(10.0)), session_pb2.DriveResponse)
                broken = await stream.do(io.Receive(10.0))
                assert isinstance(broken, troupe.UnavailableError), broken
            del stream
        for _ in range(3):
            await asyncio.sleep(0.02)
            gc.collect()
        # Tasks of the server are not meant.
        names = [repr(task.get_coro()) for task in asyncio.all_tasks()]
        assert said == [] and not [name for name in names if "_Opened" in name or "_StreamRequest" in name]
        await server.stop(None)

    asyncio.run(main())


def test_a_crowd_and_a_drive(address: str) -> None:
    async def test(client: troupe.aio.Client) -> None:
        async with await client.crowd(5) as crowd:
            crowd.walk(np.tile([0, 0, 1.2], (5, 1)))
            step = await crowd.step(30)
            assert step.frames.root.shape == (30, 5, 3) and not step.faults
        sessions = await client.sessions([troupe.SessionOptions(position=(n, 0, 0)) for n in range(2)])
        options = troupe.DriveOptions(close_sessions=True)
        async with await client.drive(sessions, options) as drive:
            sessions[0].walk((0, 0, 1.2))
            ticks = []
            async for tick in drive:
                ticks.append(tick)
                if len(ticks) == 30:
                    break
            assert sorted(ticks[-1].frames.ids) == sorted(of.id for of in sessions)
            with pytest.raises(troupe.DeadlineExceededError):
                await drive.next(0.0001)
            assert await drive.next(5) is not None, "the stream goes on"
        with pytest.raises(troupe.SessionError):
            await sessions[0].step()

    run(address, test)


def test_a_stream_without_a_server_says_so() -> None:
    async def test(client: troupe.aio.Client) -> None:
        assert not await client.ready()
        with pytest.raises(troupe.UnreachableError):
            await client.session()

    run("127.0.0.1:9", test)
