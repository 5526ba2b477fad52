"""The raw loop, the server and the Python servers side by side: one after the other, again and again."""

from pathlib import Path

from troupe_bench import programs
from troupe_bench.programs import Failed, say
from troupe_bench.settings import CROWD, CROWD_CLIENTS, CROWD_SIZE, JEMALLOC, PAUSE_US, Settings, python_settings
from troupe_bench.store import Json, Store, dig

TARGETS = ("raw", "troupe", "litserve", "fastapi")
RAW_BATCHES = (1, 8, 16, 32, 64)
JEMALLOC_BATCHES = (8, 16, 32, 64)
"""Those of the raw loop with the server's allocator."""
LONGEST = "64"
MIXED = "12-64"


def estimate_s(settings: Settings, targets: tuple[str, ...]) -> float:
    """Seconds that the serving part takes, starts of servers included."""
    one = settings.warmup_s + settings.measured_s + 1
    loads = {"raw": 0, "troupe": len(settings.clients) + 1, "litserve": 2, "fastapi": 2}
    starts = {
        "raw": 18 + (2 + len(RAW_BATCHES + JEMALLOC_BATCHES)) * settings.raw_s,
        "troupe": 6,
        "litserve": 12,
        "fastapi": 8,
    }
    return settings.repeats * len(settings.engines) * sum(loads[t] * one + starts[t] for t in targets)


def tune(settings: Settings, kinds: tuple[str, ...] = ("litserve", "fastapi")) -> None:
    """Tries settings of the Python servers at 32 clients and keeps what each one reached."""
    store = Store(settings.results, "tune")
    bodies = programs.requests(settings.pack, LONGEST, settings.request_count)
    for engine in settings.engines:
        for kind in kinds:
            for options in python_settings(kind, settings.quick):
                key = {"engine": engine, "target": kind, "options": options}
                if store.of(key):
                    continue
                try:
                    with programs.python_server(kind, engine, settings.pack, bodies, options) as server:
                        run = _http_load(server, bodies, 32, 1.5, settings.tune_s)
                except Failed as error:
                    say(f"{kind} {options}: {error}")
                    continue
                store.add(key, run)
                say(f"{engine} {kind} {options}: {_summary(run)}")


def best_options(settings: Settings, engine: str, kind: str) -> Json:
    """The options of a Python server that were the fastest in `tune`, which runs first if needed."""
    store = Store(settings.results, "tune")
    if not store.of({"engine": engine, "target": kind}):
        tune(settings, (kind,))
        store = Store(settings.results, "tune")
    tried = [key for key in store.every_key() if (key["engine"], key["target"]) == (engine, kind)]
    if not tried:
        raise Failed(f"no settings of {kind} on {engine} ran")
    return max(tried, key=lambda key: store.median(key, "throughput", "frames_per_s") or 0.0)["options"]


def serving(settings: Settings, targets: tuple[str, ...] = TARGETS) -> None:
    """Every target of every engine at the longest segments, in turns."""
    store = Store(settings.results, "serving")
    bodies = programs.requests(settings.pack, LONGEST, settings.request_count)
    for repeat in range(settings.repeats):
        for engine in settings.engines:
            for target in targets:
                _measure(settings, store, bodies, {"engine": engine, "target": target, "repeat": repeat})


def mixed(settings: Settings) -> None:
    """The server and LitServe with segments of all lengths at 32 clients."""
    store = Store(settings.results, "mixed")
    bodies = programs.requests(settings.pack, MIXED, settings.request_count)
    for repeat in range(settings.repeats):
        for engine in settings.engines:
            for target, variant in (("troupe", {}), ("litserve", {}), ("litserve", {"no_group": True})):
                key = {"engine": engine, "target": target, "clients": 32, "repeat": repeat, "variant": variant}
                if store.of(key):
                    continue
                if target == "troupe":
                    with programs.troupe(engine, settings.pack) as server:
                        run = _grpc_load(server, ("--requests", bodies), 32, settings)
                else:
                    options = best_options(settings, engine, target) | variant
                    with programs.python_server(target, engine, settings.pack, bodies, options) as server:
                        run = _http_load(server, bodies, 32, settings.warmup_s, settings.measured_s)
                store.add(key, run)
                say(f"{key}: {_summary(run)}")


def _measure(settings: Settings, store: Store, bodies: Path, key: Json) -> None:
    """All loads of one target in one turn that are not there yet."""
    engine, target = key["engine"], key["target"]
    if target == "raw":
        _measure_raw(settings, store, key)
        return
    if target == "troupe":
        _measure_troupe(settings, store, bodies, key)
        return
    wanted = [count for count in (1, 32) if not store.of(key | {"clients": count})]
    if not wanted:
        return
    options = best_options(settings, engine, target)
    with programs.python_server(target, engine, settings.pack, bodies, options) as server:
        for count in wanted:
            run = _http_load(server, bodies, count, settings.warmup_s, settings.measured_s)
            store.add(key | {"clients": count, "options": options}, run)
            say(f"{key} {count} clients: {_summary(run)}")


def _measure_troupe(settings: Settings, store: Store, bodies: Path, key: Json) -> None:
    """The server with requests of one character from several numbers of clients, and with requests of many."""
    one_each: tuple[str | Path, ...] = ("--requests", bodies)
    many: tuple[str | Path, ...] = ("--clip", programs.CLIP, "--frames", LONGEST, "--per-request", str(CROWD_SIZE))
    loads = [(key | {"clients": count}, one_each) for count in settings.clients]
    loads.append((key | {"target": CROWD, "clients": CROWD_CLIENTS}, many))
    wanted = [load for load in loads if not store.of(load[0])]
    if not wanted:
        return
    with programs.troupe(key["engine"], settings.pack) as server:
        for load, requests in wanted:
            run = _grpc_load(server, requests, load["clients"], settings)
            store.add(load, run | {"ready_s": server.started_in_s})
            say(f"{load}: {_summary(run)}")


def _measure_raw(settings: Settings, store: Store, key: Json) -> None:
    """The raw loop with the server's workers at several batch sizes, and alone: one worker, one row a call.

    Alone it is measured at once and after a pause, the least that a request's way to the client and back takes.
    """
    if store.of(key):
        return
    common = ("--pack", settings.pack, "--frames", LONGEST, "--seconds", str(settings.raw_s))
    rows = programs.raw_loop(key["engine"], *common, "--batch", ",".join(map(str, RAW_BATCHES)))
    one = ("--batch", "1", "--workers", "1", "--threads", "1")
    alone = programs.raw_loop(key["engine"], *common, *one)
    paused = programs.raw_loop(key["engine"], *common, *one, "--pause-us", str(PAUSE_US))
    for row in rows:
        store.add(key | {"batch": row["batch"]}, row)
    batches = ",".join(map(str, JEMALLOC_BATCHES))
    for row in programs.raw_loop(key["engine"], *common, "--batch", batches, name=programs.RAW_LOOP_JEMALLOC):
        store.add(key | {"target": JEMALLOC, "batch": row["batch"]}, row)
    store.add(key | {"alone": True}, alone[0])
    store.add(key | {"alone": "paused"}, paused[0])
    best = max(row["frames_per_s"] for row in rows)
    say(f"{key}: {best:,.0f} frames/s at the best batch, {alone[0]['call_ms_p50']:.2f} ms alone")


def _grpc_load(server: programs.Running, requests: tuple[str | Path, ...], clients: int, settings: Settings) -> Json:
    times = _times(clients, settings.warmup_s, settings.measured_s)
    return _checked(programs.load("inbetween", server.url, *requests, *times), server.name)


def _http_load(server: programs.Running, bodies: Path, clients: int, warmup_s: float, measured_s: float) -> Json:
    times = _times(clients, warmup_s, measured_s)
    return _checked(programs.load("http", server.url, "--requests", bodies, *times), server.name)


def _times(clients: int, warmup_s: float, measured_s: float) -> list[str]:
    return ["--clients", str(clients), "--warmup", f"{warmup_s}s", "--duration", f"{measured_s}s"]


def _checked(run: Json, name: str) -> Json:
    """A run in which nothing failed: wrong answers would be fast."""
    failed = dig(run, "counts", "failed")
    if failed:
        raise Failed(f"{failed} requests to {name} failed; see {programs.HOME / 'logs'}")
    return run


def _summary(run: Json) -> str:
    frames, latency = dig(run, "throughput", "frames_per_s") or 0.0, run.get("latency_ms", {})
    return f"{frames:,.0f} frames/s, p50 {latency.get('p50')} ms, p99 {latency.get('p99')} ms"
