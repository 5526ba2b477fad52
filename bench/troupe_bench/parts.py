"""The parts beside serving: the paper's size, the ceiling, operators, an idle server, micro-benchmarks."""

import contextlib
import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from troupe_bench import programs
from troupe_bench.machine import ROOT, cpu_seconds, resident_bytes
from troupe_bench.programs import HOME, RELEASE, Failed, say
from troupe_bench.settings import Settings
from troupe_bench.store import Json, Store

PAPER_PRESETS = ("paper", "paper-wide")
PAPER_BATCHES = (1, 4, 16, 32, 64)


def ceiling(settings: Settings) -> None:
    """Operations of a segment and the machine's peak, for each engine."""
    seconds, repeats = ("0.3", "1") if settings.quick else ("2", "5")
    for engine, result in _each_engine(settings, "ceiling", "--seconds", seconds, "--repeats", repeats):
        say(
            f"{engine}: {result['segment_mflop']:.0f} MFLOP a segment, {result['peak_gflop_per_s']:.0f} GFLOP/s at peak"
        )


def operators(settings: Settings) -> None:
    """Time of the networks by kind of operator, for each engine."""
    for engine, result in _each_engine(settings, "operators", "--runs", "3" if settings.quick else "50"):
        took = [sum(stage["ms"].values()) for stage in result["stages"].values()]
        say(f"{engine}: {sum(took):.1f} ms for {result['batch']} segments in one thread")


def _each_engine(settings: Settings, part: str, *arguments: str) -> Iterator[tuple[str, Json]]:
    """Runs a module of a part's name for each engine that it has not run for, and keeps the JSON that it prints."""
    store = Store(settings.results, part)
    for engine in settings.engines:
        key = {"engine": engine}
        if store.of(key):
            continue
        python, environment = programs.python_of(engine)
        options = ("--pack", settings.pack, "--engine", engine)
        printed = programs.call(python, "-m", f"troupe_bench.{part}", *options, *arguments, env=environment)
        result = json.loads(printed.splitlines()[-1])
        store.add(key, result)
        yield engine, result


def paper(settings: Settings) -> None:
    """The raw loop on packs of the paper's size with random weights."""
    store = Store(settings.results, "paper")
    for preset in PAPER_PRESETS[: 1 if settings.quick else None]:
        pack = HOME / "packs" / preset
        if not (pack / "pack.toml").exists():
            _make_random_pack(settings, preset, pack)
        for line in (pack / "pack.toml").read_text().splitlines():
            if line.startswith("parameters"):
                store.note(preset, {"parameters": int(line.split("=")[1])})
        for repeat in range(settings.repeats):
            for engine in settings.engines:
                key = {"preset": preset, "engine": engine, "repeat": repeat}
                if store.of(key):
                    continue
                common = ("--pack", pack, "--frames", "64", "--seconds", str(settings.raw_s))
                batches = ",".join(map(str, PAPER_BATCHES[: 2 if settings.quick else None]))
                for row in programs.raw_loop(engine, *common, "--batch", batches):
                    store.add(key | {"batch": row["batch"]}, row)
                for row in programs.raw_loop(engine, *common, "--batch", "1", "--workers", "1"):
                    store.add(key | {"alone": True}, row)
                    say(f"{key}: {row['call_ms_p50']:.1f} ms alone")


def _make_random_pack(settings: Settings, preset: str, pack: Path) -> None:
    if not settings.train_python.exists():
        raise Failed(f"there is no {settings.train_python}: `make python-env` makes it, --train-python names another")
    command = (settings.train_python, "-m", "troupe_training", "random-pack", "--preset", preset, "--out", pack)
    programs.call(*command, "--like", settings.pack, env={"PYTHONPATH": str(ROOT / "training")})


def idle(settings: Settings) -> None:
    """CPU and memory of a server without requests, without sessions and with many."""
    store = Store(settings.results, "idle")
    for engine in settings.engines:
        for repeat in range(settings.repeats):
            key = {"engine": engine, "repeat": repeat}
            if store.of(key):
                continue
            with programs.troupe(engine, settings.pack, "--max-sessions", str(settings.idle_sessions)) as server:
                time.sleep(2.0)
                before = resident_bytes(server.pid)
                share = _cpu_share(server.pid, settings.idle_s)
                with _idle_sessions(server.url, settings) as created:
                    after, share_with = resident_bytes(server.pid), _cpu_share(server.pid, settings.idle_s)
                result = {
                    "sessions": settings.idle_sessions,
                    "rss_bytes": before,
                    "cpu_share": share,
                    "rss_with_sessions_bytes": after,
                    "cpu_share_with_sessions": share_with,
                    "created_in_s": created,
                }
            store.add(key, result)
            grown = (after - before) / 2**20
            say(
                f"{key}: {share:.2%} of a core idle; {settings.idle_sessions} sessions: {grown:.0f} MiB, {share_with:.2%}"
            )


def _cpu_share(pid: int, seconds: float) -> float:
    """Share of one core that a process uses over ``seconds``."""
    before, started = cpu_seconds(pid), time.monotonic()
    time.sleep(seconds)
    return (cpu_seconds(pid) - before) / (time.monotonic() - started)


@contextlib.contextmanager
def _idle_sessions(url: str, settings: Settings) -> Iterator[float]:
    """Holds sessions open through the load tester; gives the seconds until all were there."""
    hold = settings.idle_s + 60
    command = [str(RELEASE / "troupe-loadtest"), "run", "--quiet", "--workload", "idle", "--url", url]
    command += ["--characters", str(settings.idle_sessions), "--warmup", "1s", "--duration", f"{hold}s"]
    log = HOME / "logs" / "idle-loadtest.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    with log.open("w") as sink, subprocess.Popen(command, cwd=ROOT, stdout=sink, stderr=subprocess.STDOUT) as tester:
        try:
            while programs.active_sessions(url) < settings.idle_sessions:
                if tester.poll() is not None or time.monotonic() - started > 120:
                    raise Failed(f"the sessions were not made: {log.read_text()[-1000:]}")
                time.sleep(0.2)
            took = time.monotonic() - started
            time.sleep(2.0)
            yield took
        finally:
            tester.terminate()


def micro(settings: Settings) -> None:
    """Criterion benches of the pure parts."""
    store = Store(settings.results, "micro")
    store.clear()
    options = ["--warm-up-time", "0.3", "--measurement-time", "0.5"] if settings.quick else []
    started = time.time()
    for package, bench in (("troupe-motion", "motion"), ("troupe-server", "server")):
        programs.call("cargo", "bench", "--locked", "-p", package, "--bench", bench, "--", "--noplot", *options)
    for path in sorted((ROOT / "target" / "criterion").glob("**/new/benchmark.json")):
        if path.stat().st_mtime < started:
            continue
        name = json.loads(path.read_text())["full_id"]
        estimates = json.loads((path.parent / "estimates.json").read_text())
        store.add({"bench": name}, {"median_ns": estimates["median"]["point_estimate"]})
