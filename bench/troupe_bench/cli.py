"""Shared by the Python programs: engines, stages, and the command line of the servers."""

import argparse
import json
import os
from pathlib import Path

ENGINES = ("cpu", "openvino-bf16")
STAGES = ("root", "pose", "decoder")


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """Options of both servers."""
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--pack", type=Path, default=Path("models/human"))
    parser.add_argument("--engine", choices=ENGINES, default="cpu")
    parser.add_argument("--threads", type=int, default=1, help="threads of each network")
    parser.add_argument("--no-spin", dest="spin", action="store_false", help="idle threads sleep at once")
    parser.add_argument("--requests", type=Path, required=True, help="folder of requests, to warm up with")


def add_process_options(parser: argparse.ArgumentParser) -> None:
    """Options of a server on uvicorn."""
    parser.add_argument("--workers", type=int, default=1, help="uvicorn processes, each with its own networks")
    parser.add_argument("--pool", type=int, default=2, help="requests in the networks at once, in each process")


def serve(app: str, args: argparse.Namespace) -> None:
    """Runs an app of uvicorn until it is stopped. Its processes find the options in the environment."""
    import uvicorn

    os.environ["BENCH_SETTINGS"] = json.dumps(vars(args), default=str)
    uvicorn.run(
        app,
        host="127.0.0.1",
        port=args.port,
        workers=args.workers,
        loop="uvloop",
        http="httptools",
        log_level="warning",
        access_log=False,
        backlog=1024,
    )


def read_bodies(folder: Path) -> list[bytes]:
    """The binary bodies of a request set."""
    listed = json.loads((folder / "requests.json").read_text())["requests"]
    return [(folder / entry["body"]).read_bytes() for entry in listed]
