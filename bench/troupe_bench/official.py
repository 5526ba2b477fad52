"""NVIDIA's public MotionBricks code on a CPU, and Troupe with a pack of the same weights, in turns.

One plan at a time, and as many frames a second as each can. The public code is measured as it was published, and with what
batches of plans and bf16 need.
"""

import json
import os
import statistics
import subprocess
from pathlib import Path

from troupe_bench import figures, programs, report_tables
from troupe_bench.machine import ROOT, busy_share, cores, pack_id
from troupe_bench.programs import HOME, Failed, say
from troupe_bench.settings import OFFICIAL_LENGTHS, OFFICIAL_WAYS, Settings
from troupe_bench.store import Json, Store
from troupe_bench.walk import write_walk

IDLE_S, MOST_BUSY = 5.0, 0.05
NETWORK_MEMORY_MIB = 6144
CLIENTS = {"alone": 1, "saturated": 32}
LIKE = ROOT / "models" / "g1"
"""The robot's own pack: a walk of one of its styles is what requests are made of."""
HERE = ROOT / "training" / "troupe_training" / "export" / "motionbricks" / "official"
WORK = HOME / "official"
ENVIRONMENT = HOME / "official-env"


def measure(settings: Settings) -> None:
    """Both sides in turns. Every other turn begins with Troupe, so that none is always behind the other."""
    code = checkout_of(settings)
    prepare(settings, code)
    # Threads of PyTorch wait for each other at every layer: other work on a core slows them more
    # than it slows Troupe.
    busy = busy_share(IDLE_S)
    if busy > MOST_BUSY and not settings.quick:
        raise Failed(
            f"other programs take {busy:.0%} of the cores, at most {MOST_BUSY:.0%} is allowed; --quick measures all the same"
        )
    store = Store(settings.results, "official")
    if store.of_pack(pack_id(WORK / "pack")):
        say("what was measured of other weights is forgotten")
    store.note("remark", "random weights, because the checkout had none" if _random() else "")
    lengths = OFFICIAL_LENGTHS[: 1 if settings.quick else None]
    for repeat in range(settings.repeats):
        for side in ("troupe", "public") if repeat % 2 else ("public", "troupe"):
            if side == "public":
                _public_turn(settings, store, code, repeat, lengths)
            else:
                _troupe_turn(settings, store, repeat, lengths)
    found = [{"title": "this one", "parts": {"official": figures.official(store)}}]
    print("\n".join([*report_tables.official(found), "", *report_tables.official_ratios(found)]))


def _public_turn(settings: Settings, store: Store, code: Path, repeat: int, lengths: tuple[int, ...]) -> None:
    """Every way of the public code at every length."""
    for frames in lengths:
        for way in OFFICIAL_WAYS:
            key: Json = {"target": "public", "way": way, "frames": frames, "repeat": repeat}
            if not store.of(key):
                store.add(key, public(code, way, frames, settings.measured_s))
                say(f"{key}: {_summary(store.of(key)[0])}")


def _troupe_turn(settings: Settings, store: Store, repeat: int, lengths: tuple[int, ...]) -> None:
    """Every engine at every length, alone and at saturation."""
    for engine in settings.engines:
        turn: Json = {"target": "troupe", "engine": engine, "repeat": repeat}
        wanted = [turn | {"frames": frames, "way": way} for frames in lengths for way in CLIENTS]
        wanted = [key for key in wanted if not store.of(key)]
        if not wanted:
            continue
        with programs.troupe(engine, WORK / "pack", *_server_options()) as server:
            for key in wanted:
                store.add(key, troupe(server, CLIENTS[key["way"]], key["frames"], settings))
                say(f"{key}: {_summary(store.of(key)[0])}")


def checkout_of(settings: Settings) -> Path:
    """The folder of the public code.

    Raises Failed if none was named, or if it is none.
    """
    if settings.official is None:
        raise Failed("--official names a checkout of NVlabs/GR00T-WholeBodyControl")
    for folder in (settings.official, settings.official / "motionbricks"):
        if (folder / "out" / "motionbricks_pose").is_dir():
            return folder
    raise Failed(f"--official: {settings.official} has no motionbricks/out/motionbricks_pose: a checkout is expected")


def prepare(settings: Settings, code: Path) -> None:
    """A pack of the checkout's weights, or of random ones, once the stages of both agree; and a walk of its robot."""
    write_walk(LIKE, WORK / "walk.bvh")
    if (WORK / "pack" / "pack.toml").exists():
        return
    if not settings.train_python.exists():
        raise Failed(f"there is no {settings.train_python}: `make python-env` makes it, --train-python names another")
    command = (settings.train_python, "-m", "troupe_training", "check-motionbricks", code, "--env", ENVIRONMENT)
    programs.call(*command, "--keep", WORK, env={"PYTHONPATH": str(ROOT / "training")})


def _server_options() -> list[str]:
    """What differs from the server's defaults."""
    # The public code lets plans wait as long as they have to.
    options = ["--store", "", "--max-queue-ms", "0"]
    # The default is for packs that are a thirtieth of this one's size.
    options += ["--network-memory-mib", str(NETWORK_MEMORY_MIB)]
    # Random weights need not pass.
    return options + (["--accuracy-check", "report"] if _random() else [])


def _random() -> bool:
    """Whether the weights were drawn. A checkout with weights is linked, not copied."""
    return not (WORK / "release").is_symlink()


def public(code: Path, way: str, frames: int, seconds: float) -> Json:
    """Plans of the public code. If it takes several processes, they begin together.

    Raises Failed if one of them fails.
    """
    many = max(1, int(cores()))
    processes, threads = (many, 1) if way == "processes" else (1, many)
    command = [str(ENVIRONMENT / "bin" / "python"), str(HERE / "speed.py"), str(code), str(WORK / "release")]
    command += ["--frames", str(frames), "--threads", str(threads), "--seconds", str(seconds), *OFFICIAL_WAYS[way]]
    environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
    running = [
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(processes)
    ]
    try:
        answers = [json.loads(text.splitlines()[-1]) for text in _together(running)]
    finally:
        for process in running:
            process.kill()
            process.wait()
    calls = [ms for answer in answers for ms in answer["call_ms"]]
    speeds = [1000 * frames * answer["batch"] / statistics.mean(answer["call_ms"]) for answer in answers]
    return {"p50_ms": statistics.median(calls), "frames_per_s": sum(speeds), "calls": len(calls)}


def _together(running: list[subprocess.Popen[str]]) -> list[str]:
    """What processes print that begin when all are ready."""
    for process in running:
        assert process.stdout is not None
        if not any(line == "ready\n" for line in process.stdout):
            raise Failed("the public code ended before it was ready")
    for process in running:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    printed = [process.stdout.read() for process in running if process.stdout is not None]
    if any(process.wait() for process in running):
        raise Failed("the public code failed")
    return printed


def troupe(server: programs.Running, clients: int, frames: int, settings: Settings) -> Json:
    """The same through the server, over gRPC.

    Raises Failed if a request fails or is refused: such answers would be fast.
    """
    times = ("--warmup", f"{settings.official_warmup_s}s", "--duration", f"{settings.measured_s}s")
    what = ("--clip", WORK / "walk.bvh", "--frames", str(frames), "--clients", str(clients))
    run = programs.load("inbetween", server.url, *what, *times)
    counts = run["counts"]
    if counts["failed"] or counts["refused"]:
        raise Failed(f"{counts['failed']} requests failed, {counts['refused']} were refused: {run['examples']}")
    return {
        "p50_ms": run["latency_ms"]["p50"],
        "frames_per_s": run["throughput"]["frames_per_s"],
        "plans": counts["right"],
    }


def _summary(run: Json) -> str:
    return f"{run['p50_ms']:.1f} ms a call, {run['frames_per_s']:,.0f} frames/s"
