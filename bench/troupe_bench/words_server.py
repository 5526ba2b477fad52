"""The plain Python server of words: FastAPI on uvicorn, every request token by token on its own, in a thread pool.

Frames leave in parts while tokens come, or as a whole. Reads its settings from the environment, because uvicorn's worker
processes import it by name; `main` sets them.
"""

import argparse
import asyncio
import json
import os
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import FastAPI, HTTPException, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel

from troupe_bench.body import write_frames
from troupe_bench.cli import add_process_options, serve

if TYPE_CHECKING:
    from troupe_bench.vermo import Asked, Part


class Words(BaseModel):
    """A request."""

    text: str
    frame_count: int
    seed: int = 0
    temperature: float | None = None


@asynccontextmanager
async def lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Loads and warms up the networks before the port opens."""
    from troupe_bench.vermo import VerMo

    settings = argparse.Namespace(**json.loads(os.environ["BENCH_SETTINGS"]))
    app.state.model = VerMo(Path(settings.pack), settings.threads, settings.spin, settings.cache_unit)
    app.state.model.warm_up()
    app.state.is_whole = settings.whole
    app.state.pool = ThreadPoolExecutor(settings.pool)
    with Path(settings.ready).open("a") as ready:
        ready.write(f"{os.getpid()}\n")
    yield
    app.state.pool.shutdown(cancel_futures=True)


app = FastAPI(lifespan=lifespan, openapi_url=None)


@app.get("/health")
async def health() -> Response:
    """Answers once the networks are warm."""
    return Response("ready")


@app.post("/generate")
async def generate(words: Words) -> StreamingResponse:
    """Answers one request: parts of frames, an empty one last."""
    from troupe_bench.vermo import Asked

    model = app.state.model
    sampling = model.sampling
    if words.temperature is not None:
        sampling = replace(sampling, temperature=words.temperature)
    try:
        model.prompt(words.text, -(-words.frame_count // model.per_token))
    except ValueError as error:
        raise HTTPException(400, str(error)) from error
    asked = Asked(words.text, words.frame_count, words.seed, sampling)
    return StreamingResponse(in_pool(asked), media_type="application/octet-stream")


async def in_pool(asked: "Asked") -> AsyncIterator[bytes]:
    """Parts as a thread of the pool makes them."""
    loop, parts = asyncio.get_running_loop(), asyncio.Queue[bytes | None]()

    def work() -> None:
        try:
            for part in made(asked):
                loop.call_soon_threadsafe(parts.put_nowait, write_frames(part.root, part.rotations))
        finally:
            loop.call_soon_threadsafe(parts.put_nowait, None)

    worker = loop.run_in_executor(app.state.pool, work)
    while (part := await parts.get()) is not None:
        yield part
    await worker  # raises what went wrong, so that the answer breaks off without its end
    yield write_frames(None, None)


def made(asked: "Asked") -> "Iterator[Part]":
    """The parts of a motion; one where the server gives it as a whole."""
    model = app.state.model
    return iter([model.whole(asked)]) if app.state.is_whole else model.parts(asked)


def main() -> None:
    """Runs the server until it is stopped."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--pack", type=Path, default=Path("models/vermo"))
    parser.add_argument("--ready", type=Path, required=True, help="file that gets a line of each process that is ready")
    parser.add_argument("--threads", type=int, default=1, help="threads of each network")
    parser.add_argument("--no-spin", dest="spin", action="store_false", help="idle threads sleep at once")
    add_process_options(parser)
    parser.add_argument("--cache-unit", type=int, default=16, help="columns of the cache are read in multiples of this")
    parser.add_argument("--whole", action="store_true", help="decode a motion once, when all its tokens are there")
    args = parser.parse_args()
    serve("troupe_bench.words_server:app", args)


if __name__ == "__main__":
    main()
