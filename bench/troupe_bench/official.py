"""NVIDIA's public MotionBricks code on a CPU, and Troupe with a pack of the same weights, in turns.

One plan of 40 frames at a time, and as many frames a second as each can.
"""

import json
import os
import statistics
import subprocess
from pathlib import Path

from troupe_bench import programs
from troupe_bench.machine import ROOT, cores
from troupe_bench.programs import HOME, Failed, say
from troupe_bench.settings import Settings
from troupe_bench.store import Json, Store

FRAMES = 40
CLIENTS = 32
HERE = ROOT / "training" / "troupe_training" / "export" / "motionbricks" / "official"
WORK = HOME / "official"
ENVIRONMENT = HOME / "official-env"


def measure(settings: Settings) -> None:
    """Alone and at saturation, in turns. The public code takes one request a call: it saturates by threads or by processes."""
    code = checkout_of(settings)
    store = Store(settings.results, "official")
    prepare(settings, code)
    many = max(1, int(cores()))
    ways = {"alone": (1, many), "processes": (many, 1)}
    for repeat in range(settings.repeats):
        for way, (processes, threads) in ways.items():
            key: Json = {"target": "public", "way": way, "repeat": repeat}
            if not store.of(key):
                store.add(key, public(code, processes, threads, settings.measured_s))
                say(f"{key}: {_summary(store.of(key)[0])}")
        wanted = [
            (way, clients)
            for way, clients in (("alone", 1), ("saturated", CLIENTS))
            if not store.of({"target": "troupe", "way": way, "repeat": repeat})
        ]
        if not wanted:
            continue
        with programs.troupe(settings.engines[-1], WORK / "pack", "--store", "") as server:
            for way, clients in wanted:
                key = {"target": "troupe", "way": way, "repeat": repeat, "engine": settings.engines[-1]}
                store.add(key, troupe(server, clients, settings))
                say(f"{key}: {_summary(store.of(key)[0])}")
    print("\n".join(table(store)))


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
    """A pack of the checkout's weights, or of random ones, once the stages of both agree."""
    if (WORK / "pack" / "pack.toml").exists():
        return
    command = (settings.train_python, "-m", "troupe_training", "check-motionbricks", code, "--env", ENVIRONMENT)
    programs.call(*command, "--keep", WORK, env={"PYTHONPATH": str(ROOT / "training")})


def public(code: Path, processes: int, threads: int, seconds: float) -> Json:
    """Plans of the public code, in that many processes at once.

    Raises Failed if one of them fails.
    """
    command = [ENVIRONMENT / "bin" / "python", HERE / "speed.py", code, WORK / "release", FRAMES, threads, seconds]
    environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
    running = [
        subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(processes)
    ]
    printed = [process.communicate()[0] for process in running]
    if any(process.returncode for process in running):
        raise Failed(f"the public code failed: {' '.join(map(str, command))}")
    answers = [json.loads(text.splitlines()[-1]) for text in printed]
    if any(answer["made_frames"] < FRAMES for answer in answers):
        raise Failed(f"the public code made fewer than {FRAMES} frames")
    plans = [ms for answer in answers for ms in answer["plan_ms"]]
    speeds = [1000 * FRAMES / statistics.mean(answer["plan_ms"]) for answer in answers]
    return {"p50_ms": statistics.median(plans), "frames_per_s": sum(speeds), "plans": len(plans)}


def troupe(server: programs.Running, clients: int, settings: Settings) -> Json:
    """The same through the server, over gRPC.

    Raises Failed if a request fails: wrong answers would be fast.
    """
    times = ("--clients", str(clients), "--warmup", f"{settings.warmup_s}s", "--duration", f"{settings.measured_s}s")
    run = programs.load("inbetween", server.url, "--frames", str(FRAMES), *times)
    if run["counts"]["failed"]:
        raise Failed(f"{run['counts']['failed']} requests failed: {run['examples']}")
    return {"p50_ms": run["latency_ms"]["p50"], "frames_per_s": run["throughput"]["frames_per_s"]}


def _summary(run: Json) -> str:
    return f"{run['p50_ms']:.1f} ms a plan, {run['frames_per_s']:,.0f} frames/s"


def table(store: Store) -> list[str]:
    """Lines of Markdown: medians of the turns, and the ratios of each turn."""
    sides = {
        "alone": ({"target": "public", "way": "alone"}, {"target": "troupe", "way": "alone"}, "p50_ms"),
        "as many as it can": ({"target": "public"}, {"target": "troupe", "way": "saturated"}, "frames_per_s"),
    }
    lines = ["| | public code | Troupe | ratio of each turn |", "|---|---:|---:|---|"]
    for name, (theirs, ours, number) in sides.items():
        turns = _turns(store, theirs, ours, number)
        if not turns:
            continue
        ratios = [a / b if number == "p50_ms" else b / a for a, b in turns]
        unit = "ms" if number == "p50_ms" else "frames/s"
        a, b = (statistics.median(side) for side in zip(*turns, strict=True))
        lines.append(f"| {name} | {a:,.0f} {unit} | {b:,.0f} {unit} | {', '.join(f'{r:.1f}' for r in ratios)} |")
    return lines


def _turns(store: Store, theirs: Json, ours: Json, number: str) -> list[tuple[float, float]]:
    """Both numbers of each turn. Of several ways of the public code the fastest counts."""
    found = []
    for repeat in sorted({key["repeat"] for key in store.every_key()}):
        public_runs, runs = store.of(theirs | {"repeat": repeat}), store.of(ours | {"repeat": repeat})
        if public_runs and runs:
            found.append((max(public_runs, key=lambda run: run["frames_per_s"])[number], runs[0][number]))
    return found
