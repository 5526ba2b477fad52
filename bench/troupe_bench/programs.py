"""The measured programs: built, started on a free port, waited for, and stopped with all their children."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from troupe_bench.machine import ROOT
from troupe_bench.store import Json

HOME = ROOT / "target" / "bench"
RELEASE = ROOT / "target" / "dist"
READY_WITHIN_S = 180
RAW_LOOP = "troupe-eval"
RAW_LOOP_JEMALLOC = "troupe-eval-jemalloc"
"""The same with the allocator of the server."""
CLIP = ROOT / "examples" / "walk.bvh"
PYTHON_SERVERS = {"litserve": "troupe_bench.litserve_server", "fastapi": "troupe_bench.fastapi_server"}
PYTHON_SERVERS |= {"words": "troupe_bench.words_server"}
RUNTIMES = {"cpu": "ort-cpu", "openvino-bf16": "ort-openvino"}


class Failed(Exception):
    """A program did not do what it should; the text says which and why."""


@dataclass
class Running:
    """A server that answers."""

    name: str
    url: str
    pid: int
    started_in_s: float


def call(*command: str | Path, env: dict[str, str] | None = None, timeout: float | None = None) -> str:
    """Runs a command in the repository and returns what it prints."""
    text = [str(part) for part in command]
    done = subprocess.run(
        text, cwd=ROOT, env=os.environ | (env or {}), stdout=subprocess.PIPE, text=True, timeout=timeout, check=False
    )
    if done.returncode != 0:
        raise Failed(f"{' '.join(text)} ended with {done.returncode}")
    return done.stdout


def build() -> None:
    """Builds every Rust program of the benchmarks."""
    release = ("cargo", "build", "--profile", "dist", "--locked")
    call(*release, "-p", "troupe-server", "-p", "troupe-loadtest", "--features", "troupe-server/jemalloc", "--bins")
    call(*release, "-p", "troupe-eval", "--bins")


def runtime_library(engine: str) -> Path | None:
    """The ONNX Runtime that the Python servers use for ``engine``; the others load the same file."""
    found = sorted((HOME / RUNTIMES[engine] / "onnxruntime" / "capi").glob("libonnxruntime.so.*"))
    return found[0] if found else None


def runtime_of(engine: str) -> dict[str, str]:
    """Environment of Rust programs for ``engine``."""
    library = runtime_library(engine)
    if library is None:
        raise Failed(f"there is no ONNX Runtime for {engine} in {HOME}; bench/setup.sh gets it")
    return {"ORT_DYLIB_PATH": str(library)}


def python_of(engine: str) -> tuple[Path, dict[str, str]]:
    """The Python of the benchmarks, and the environment in which it finds this package and the ONNX Runtime of ``engine``."""
    paths = os.pathsep.join([str(ROOT / "bench"), str(HOME / RUNTIMES[engine])])
    return HOME / "venv" / "bin" / "python", {"PYTHONPATH": paths}


def requests(pack: Path, lengths: str, count: int) -> Path:
    """A set of requests for ``pack``, made if it is not there."""
    folder = HOME / "requests" / f"{pack.name}-{lengths}-{count}"
    if not (folder / "requests.json").exists():
        call(RELEASE / "troupe-eval", "requests", pack, CLIP, folder, lengths, str(count))
    return folder


def free_port() -> int:
    """A port that is free at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def troupe(engine: str, packs: Path, *options: str) -> Iterator[Running]:
    """A Troupe server with its defaults, but for the engine."""
    port = free_port()
    command = [str(RELEASE / "troupe-server"), "--listen", f"127.0.0.1:{port}", "--packs", str(packs)]
    command += ["--engine", engine, *options]
    with _served("troupe", command, runtime_of(engine), port, "/readyz") as running:
        yield running


@contextlib.contextmanager
def python_server(kind: str, engine: str, pack: Path, bodies: Path, settings: Json) -> Iterator[Running]:
    """A Python server with ``settings`` as its options."""
    options = ["--engine", engine, "--pack", str(pack), "--requests", str(bodies)]
    with _python_served(kind, engine, options, settings) as running:
        running.url += "/inbetween"
        yield running


@contextlib.contextmanager
def words_server(pack: Path, settings: Json) -> Iterator[Running]:
    """The Python server of words with ``settings`` as its options, once all its processes are ready."""
    ready = HOME / "logs" / "words.ready"
    ready.unlink(missing_ok=True)
    with _python_served("words", "cpu", ["--pack", str(pack), "--ready", str(ready)], settings) as running:
        end = time.monotonic() + READY_WITHIN_S
        while len(ready.read_text().split()) < settings.get("workers", 1):
            if time.monotonic() > end:
                raise Failed(f"not all processes of the server were ready within {READY_WITHIN_S} s")
            time.sleep(0.1)
        yield running


@contextlib.contextmanager
def _python_served(kind: str, engine: str, options: list[str], settings: Json) -> Iterator[Running]:
    port = free_port()
    python, environment = python_of(engine)
    command = [str(python), "-m", PYTHON_SERVERS[kind], "--port", str(port), *options]
    for name, value in settings.items():
        flag = "--" + name.replace("_", "-")
        if value is True:
            command.append(flag)
        elif value is not False:
            command += [flag, str(value)]
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with _served(kind, command, environment, port, "/health") as running:
        yield running


@contextlib.contextmanager
def _served(name: str, command: list[str], env: dict[str, str], port: int, path: str) -> Iterator[Running]:
    """Starts a server in a process group of its own, and always ends the group."""
    log = HOME / "logs" / f"{name}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    with log.open("w") as sink:
        process = subprocess.Popen(
            command, cwd=ROOT, env=os.environ | env, stdout=sink, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            url = f"http://127.0.0.1:{port}"
            _wait_until_ready(process, url + path, log)
            yield Running(name, url, process.pid, time.monotonic() - started)
        finally:
            _end_group(process)


def _wait_until_ready(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    end = time.monotonic() + READY_WITHIN_S
    while time.monotonic() < end:
        if process.poll() is not None:
            raise Failed(f"the server ended before it was ready:\n{log.read_text()[-2000:]}")
        try:
            with urllib.request.urlopen(url, timeout=2) as answer:
                if answer.status == 200:
                    return
        except (urllib.error.URLError, OSError):
            pass
        time.sleep(0.2)
    raise Failed(f"the server was not ready within {READY_WITHIN_S} s:\n{log.read_text()[-2000:]}")


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """Asks the group to stop, then makes it."""
    for sign, patience in ((signal.SIGINT, 5), (signal.SIGTERM, 3), (signal.SIGKILL, 5)):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, sign)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
        if not _group_lives(process.pid):
            return


def _group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except (ProcessLookupError, PermissionError):
        return False
    return True


def load(workload: str, url: str, *options: str | Path) -> Json:
    """Runs the load tester once and returns the run from its report."""
    return load_report("run", url, "--workload", workload, *options)["runs"][0]


def load_report(command: str, url: str, *options: str | Path) -> Json:
    """The whole report of a command of the load tester."""
    report = HOME / "logs" / "loadtest.json"
    report.parent.mkdir(parents=True, exist_ok=True)
    report.unlink(missing_ok=True)
    call(RELEASE / "troupe-loadtest", command, "--quiet", "--url", url, "--json", report, *options)
    return json.loads(report.read_text())


def raw_loop(engine: str, *options: str | Path, name: str = RAW_LOOP) -> list[Json]:
    """Rows of the raw ONNX Runtime loop."""
    return json.loads(call(RELEASE / name, "raw-loop", "--json", "--engine", engine, *options, env=runtime_of(engine)))[
        "rows"
    ]


def say(*words: object) -> None:
    """Tells the user how it goes."""
    print(*words, file=sys.stderr, flush=True)


def active_sessions(url: str) -> float:
    """Sessions that a server has at the moment, from its metrics."""
    with urllib.request.urlopen(url + "/metrics", timeout=10) as answer:
        text = answer.read().decode()
    values = [line.split()[-1] for line in text.splitlines() if line.startswith("troupe_sessions_active")]
    return sum(map(float, values))
