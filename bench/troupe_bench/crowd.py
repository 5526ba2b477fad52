"""Live characters over minutes, and overload, on the last engine of the list: bf16 where that runs."""

from troupe_bench import programs
from troupe_bench.programs import say
from troupe_bench.settings import Settings
from troupe_bench.store import Store, dig

RUN_PARTS = ("measured_s", "counts", "latency_ms", "live", "server", "client")
"""The part of a report that is kept: all but its series and histograms."""


def live(settings: Settings) -> None:
    """Characters that wander about on the server's clock, with a new command every few seconds each."""
    store, engine = Store(settings.results, "live"), settings.engines[-1]
    for repeat in range(settings.repeats):
        key = {"engine": engine, "characters": settings.live_characters, "repeat": repeat}
        if store.of(key):
            continue
        with programs.troupe(engine, settings.pack) as server:
            options = ("--characters", str(settings.live_characters), "--warmup", "10s")
            run = programs.load("drive", server.url, *options, "--duration", f"{settings.live_s:g}s")
        store.add(key, {name: run.get(name) for name in RUN_PARTS})
        say(
            f"{key}: {dig(run, 'live', 'plans', 'underruns')} underruns, ticks p99 {run['latency_ms']['p99']:.1f} ms late"
        )


def overload(settings: Settings) -> None:
    """Single requests at five times what the server can do, beside live characters."""
    store, engine = Store(settings.results, "overload"), settings.engines[-1]
    for repeat in range(settings.repeats):
        key = {"engine": engine, "repeat": repeat}
        if store.of(key):
            continue
        with programs.troupe(engine, settings.pack) as server:
            times = ("--before", "10s", "--seconds", f"{settings.overload_s:g}s", "--after", "15s")
            report = programs.load_report("overload", server.url, *times, "--beside-characters", "50")
        found = report["overload"]
        # Failures by code, and a few of the messages. There should be none.
        found |= {name: report["runs"][0][name] for name in ("codes", "examples")}
        found["memory"]["grown"] = found["memory"]["peak"] - found["memory"]["begin"]
        store.add(key, found)
        say(f"{key}: p99 {found['p99_ratio']:.2f} times that before, as before after {found['recovery_s']:.1f} s")
