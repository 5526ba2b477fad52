"""The plain Python server: FastAPI on uvicorn, every request through the three networks on its own, in a thread pool.

Reads its settings from the environment, for uvicorn's worker processes import it by name; `main` sets them.
"""

import argparse
import asyncio
import json
import os
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import FastAPI, HTTPException, Request, Response

from troupe_bench.cli import add_process_options, add_server_options, read_bodies, serve


@asynccontextmanager
async def lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Loads and warms up the networks before the port opens."""
    from troupe_bench.stages import Stages

    settings = argparse.Namespace(**json.loads(os.environ["BENCH_SETTINGS"]))
    stages = Stages(Path(settings.pack), settings.engine, settings.threads, spin=settings.spin)
    stages.warm_up(read_bodies(Path(settings.requests)), 1)
    app.state.stages = stages
    app.state.pool = ThreadPoolExecutor(settings.pool)
    yield
    app.state.pool.shutdown(cancel_futures=True)


app = FastAPI(lifespan=lifespan, openapi_url=None)


@app.get("/health")
async def health() -> Response:
    """Answers once the networks are warm."""
    return Response("ready")


@app.post("/inbetween")
async def inbetween(request: Request) -> Response:
    """Answers one request."""
    body = await request.body()
    loop = asyncio.get_running_loop()
    try:
        answers = await loop.run_in_executor(app.state.pool, app.state.stages.run, [body])
    except ValueError as error:
        raise HTTPException(400, str(error)) from error
    return Response(answers[0], media_type="application/octet-stream")


def main() -> None:
    """Runs the server until it is stopped."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_server_options(parser)
    add_process_options(parser)
    args = parser.parse_args()
    serve("troupe_bench.fastapi_server:app", args)


if __name__ == "__main__":
    main()
