"""The tables of docs/benchmarks.md, each from the results of one part."""

import statistics

from troupe_bench.cli import STAGES
from troupe_bench.settings import CROWD, CROWD_SIZE, JEMALLOC, PAUSE_US, RAW_LOOPS
from troupe_bench.store import Store, dig

NAMES = {
    "raw": "raw loop",
    JEMALLOC: "raw loop (jemalloc)",
    "troupe": "**Troupe**",
    CROWD: "**Troupe**",
    "litserve": "LitServe",
    "fastapi": "FastAPI",
}
ENGINES = {"cpu": "f32 (ONNX Runtime CPU)", "openvino-bf16": "bf16 (OpenVINO)"}
FRAMES = ("throughput", "frames_per_s")
PAUSE = f"{PAUSE_US / 1000:g} ms"


def table(heads: list[str], rows: list[list[str]], words: int = 1) -> list[str]:
    """A Markdown table; the first ``words`` columns are text, the others numbers."""
    if not rows:
        return []
    rule = ["---"] * words + ["---:"] * (len(heads) - words)
    return ["| " + " | ".join(row) + " |" for row in (heads, rule, *rows)]


def number(value: float | None, decimals: int = 0, unit: str = "") -> str:
    """A number for people, or a dash."""
    return "–" if value is None else f"{value:,.{decimals}f}{unit}"


def engines_of(store: Store) -> list[str]:
    """Engines with results, in the order of the page."""
    seen = {key["engine"] for key in store.every_key()}
    return [engine for engine in ENGINES if engine in seen]


def frames_of(store: Store, **key: object) -> float | None:
    """Median frames a second of a target."""
    path = ("frames_per_s",) if key.get("target") in RAW_LOOPS else FRAMES
    return store.median(key, *path)


def batches_of(store: Store, engine: str, target: str) -> list[int]:
    """The batch sizes that a raw loop was measured at."""
    keys = [key for key in store.every_key() if (key["engine"], key["target"]) == (engine, target)]
    return sorted({key["batch"] for key in keys if "batch" in key})


def best_batch(store: Store, engine: str, target: str = "raw") -> tuple[int, float] | None:
    """The batch size at which the raw loop is fastest, and its frames a second."""
    sizes = batches_of(store, engine, target)
    found = [(size, frames_of(store, engine=engine, target=target, batch=size)) for size in sizes]
    return max(found, key=lambda pair: pair[1] or 0.0, default=None)


def serving_table(store: Store) -> list[str]:
    """Every target of every engine."""
    lines: list[str] = []
    for engine in engines_of(store):
        best = best_batch(store, engine)
        rows = []
        for target in RAW_LOOPS:
            for size in batches_of(store, engine, target):
                key = {"engine": engine, "target": target, "batch": size}
                calls = [store.median(key, name) for name in ("call_ms_p50", "call_ms_p99")]
                rows.append(_row(store, key, f"batch {size}", calls, best))
        for pause, load in ((True, "one lane, batch 1"), ("paused", f"the same, {PAUSE} after the last")):
            alone = {"engine": engine, "target": "raw", "alone": pause}
            if store.of(alone):
                calls = [store.median(alone, name) for name in ("call_ms_p50", "call_ms_p99")]
                rows.append(_row(store, alone, load, calls, best))
        for target in ("troupe", CROWD, "litserve", "fastapi"):
            found = [key for key in store.every_key() if (key["engine"], key["target"]) == (engine, target)]
            for clients in sorted({key["clients"] for key in found}):
                key = {"engine": engine, "target": target, "clients": clients}
                latency = [store.median(key, "latency_ms", name) for name in ("p50", "p99")]
                load = f"{clients} client{'s' * (clients > 1)}"
                load += f", {CROWD_SIZE} characters a request" * (target == CROWD)
                rows.append(_row(store, key, load, latency, best))
        repeats = len({key["repeat"] for key in store.every_key() if key["engine"] == engine})
        heads = ["target", "load", "frames/s", "of the raw loop's best", "p50 (ms)", "p99 (ms)"]
        lines += [f"### {ENGINES[engine]}: medians of {repeats}", "", *table(heads, rows, 2), ""]
    return lines


def _row(store: Store, key: dict, load: str, latency: list, best: tuple[int, float] | None) -> list[str]:
    frames = frames_of(store, **key)
    share = 100 * frames / best[1] if frames and best and best[1] else None
    return [
        NAMES[key["target"]],
        load,
        number(frames),
        number(share, 0, " %"),
        *(number(value, 2) for value in latency),
    ]


def summary_table(store: Store) -> list[str]:
    """The ratios that the figures come to, and the bars set for them."""
    rows = []
    for engine in engines_of(store):
        best = best_batch(store, engine)
        served = {
            clients: frames_of(store, engine=engine, target="troupe", clients=clients) or 0.0
            for clients in {key["clients"] for key in store.every_key() if key["target"] == "troupe"}
        }
        if best and served:
            ours = {"engine": engine, "target": "troupe", "clients": max(served, key=served.__getitem__)}
            theirs = {"engine": engine, "target": "raw", "batch": best[0]}
            what = "frames/s at saturation, of the raw loop's best"
            rows += _measured(engine, what, _shares(store, ours, theirs), 0, " %", "≥ 90 %")
            crowd = _shares(store, {"engine": engine, "target": CROWD}, theirs)
            rows += _measured(engine, f"{what}, {CROWD_SIZE} characters a request", crowd, 0, " %", "≥ 90 %")
            if same := best_batch(store, engine, JEMALLOC):
                theirs_too = theirs | {"target": JEMALLOC, "batch": same[0]}
                shares = _shares(store, ours, theirs_too)
                rows += _measured(engine, f"{what} with the server's allocator", shares, 0, " %", "")
            rows += _measured(
                engine, f"{what}, on what the load tester leaves", _on_the_rest(store, ours, theirs), 0, " %", ""
            )
        one = {"engine": engine, "target": "troupe", "clients": 1}
        for alone, what, bar in (
            (True, "p50 of one caller above raw batch 1", "≤ 0.5 ms"),
            ("paused", f"p50 of one caller above raw batch 1 on a core that slept {PAUSE}", ""),
        ):
            raw = {"engine": engine, "target": "raw", "alone": alone}
            pairs = store.turns((one, "latency_ms", "p50"), (raw, "call_ms_p50"))
            rows += _measured(engine, what, [mine - theirs for mine, theirs in pairs], 2, " ms", bar)
        for target in ("litserve", "fastapi"):
            rows += _against(store, engine, target)
    if {"cpu", "openvino-bf16"} <= set(engines_of(store)):
        # What `pip install litserve onnxruntime` gives, against what the server chooses by itself.
        rows += _against(store, "openvino-bf16", "litserve", "cpu")
    return table(["engine", "what", "measured", "bar"], rows, 2)


def _shares(store: Store, ours: dict, theirs: dict) -> list[float]:
    """Percent of the raw loop's frames/s, of each turn."""
    return [100 * mine / raw for mine, raw in store.turns((ours, *FRAMES), (theirs, "frames_per_s"))]


def _on_the_rest(store: Store, ours: dict, theirs: dict) -> list[float]:
    """Shares of the raw loop's frames/s, on the processor time that the load tester leaves to the server: what is to be
    expected where clients have machines of their own."""
    lanes = ((theirs, "lanes", "count"), (theirs, "lanes", "threads"))
    sides = ((ours, *FRAMES), (ours, "client", "cpus_busy"), (theirs, "frames_per_s"), *lanes)
    return [
        100 * mine / raw * lanes * threads / (lanes * threads - busy)
        for mine, busy, raw, lanes, threads in store.turns(*sides)
        if busy < lanes * threads
    ]


def _against(store: Store, engine: str, target: str, their_engine: str = "") -> list[list[str]]:
    """Throughput and tail beside a Python server, on the same engine if no other is named."""
    ours = {"engine": engine, "target": "troupe", "clients": 32}
    theirs = {"engine": their_engine or engine, "target": target, "clients": 32}
    bars = ("≥ 3 ×", "≤ 1 ×") if target == "litserve" else ("", "")
    beside = f"{NAMES[target]}{f' on {ENGINES[their_engine]}' if their_engine else ''}"
    rows = []
    for what, path, bar in zip(("throughput", "p99"), (FRAMES, ("latency_ms", "p99")), bars, strict=True):
        ratios = [mine / other for mine, other in store.turns((ours, *path), (theirs, *path)) if other]
        rows += _measured(engine, f"{what} at 32 clients against {beside}", ratios, 2, " ×", bar)
    return rows


def _measured(engine: str, what: str, values: list[float], decimals: int, unit: str, bar: str) -> list[list[str]]:
    """A row with the median of what each turn gave, and the extremes where they differ; none where nothing was measured."""
    if not values:
        return []
    least, middle, most = (number(f(values), decimals, unit) for f in (min, statistics.median, max))
    spread = "" if least == most else f" ({least.removesuffix(unit)} to {most.removesuffix(unit)})"
    return [[ENGINES[engine], what, middle + spread, bar]]


def shares_table(store: Store) -> list[str]:
    """The way of a request at 32 clients, part by part."""
    parts = ("client", "transport", "server_other", "queue", "assemble", "inference", "scatter")
    rows = []
    for engine in engines_of(store):
        for clients in (1, 32):
            key = {"engine": engine, "target": "troupe", "clients": clients}
            split = {part: store.median(key, "split_ms", part) for part in parts}
            stages = [store.median(key, "server", "stage_ms", stage) for stage in STAGES]
            if any(split.values()):
                values = [*(split[part] for part in parts[:5]), *stages, split["scatter"]]
                mean = store.median(key, "server", "batch_mean")
                rows.append([ENGINES[engine], str(clients), *(number(value, 3) for value in values), number(mean, 1)])
    heads = [
        "engine",
        "clients",
        "client",
        "transport",
        "checks, frames, encoding",
        "queue",
        "assemble",
        *STAGES,
        "scatter",
        "rows a batch",
    ]
    return table([f"{head} (ms)" if 1 < index < len(heads) - 1 else head for index, head in enumerate(heads)], rows)


def mixed_table(store: Store) -> list[str]:
    """Troupe and LitServe with segments of all lengths."""
    rows = []
    for engine in engines_of(store):
        for target, variant in (("troupe", {}), ("litserve", {}), ("litserve", {"no_group": True})):
            key = {"engine": engine, "target": target, "variant": variant}
            how = "" if target == "troupe" else ", padded" if variant else ", grouped"
            latency = [store.median(key, "latency_ms", name) for name in ("p50", "p99")]
            row = [NAMES[target] + how, number(frames_of(store, **key)), *(number(value, 1) for value in latency)]
            rows.append([ENGINES[engine], *row])
    return table(["engine", "target", "frames/s", "p50 (ms)", "p99 (ms)"], rows, 2)


def tried_table(store: Store) -> list[str]:
    """Every setting of the Python servers that was tried."""
    rows = []
    for key in store.every_key():
        options = ", ".join(f"{name} {value}" for name, value in key["options"].items())
        figures = [store.median(key, "throughput", "frames_per_s"), store.median(key, "latency_ms", "p99")]
        rows.append([ENGINES[key["engine"]], NAMES[key["target"]], options, number(figures[0]), number(figures[1], 1)])
    return table(["engine", "target", "settings", "frames/s", "p99 (ms)"], rows, 3)


def ceiling_table(store: Store) -> list[str]:
    """Operations and peaks."""
    rows = []
    for engine in engines_of(store):
        key = {"engine": engine}
        stages = [store.median(key, "stage_mflop", stage) for stage in STAGES]
        figures = [store.median(key, name) for name in ("segment_mflop", "peak_gflop_per_s", "frames_per_s_at_peak")]
        rows.append([ENGINES[engine], *(number(value) for value in stages + figures)])
    heads = [f"{stage} (MFLOP)" for stage in STAGES]
    return table(["engine", *heads, "segment (MFLOP)", "peak (GFLOP/s)", "frames/s at peak"], rows)


def operators_table(store: Store) -> list[str]:
    """Time by stage and kind of operator."""
    kinds = ("products", "norms", "moves", "elementwise")
    rows = []
    for engine in engines_of(store):
        for stage in STAGES:
            key = {"engine": engine}
            took = [store.median(key, "stages", stage, "ms", kind) or 0.0 for kind in kinds]
            rate = (store.median(key, "stages", stage, "mflop") or 0.0) / took[0] if took[0] else None
            shares = [number(100 * ms / sum(took), 0, " %") for ms in took] if sum(took) else []
            rows.append([ENGINES[engine], stage, number(sum(took), 1), *shares, number(rate)])
    heads = ["engine", "stage", "a batch (ms)", "products", "norms, softmax", "moves", "element by element"]
    return table([*heads, "products (GFLOP/s)"], rows, 2)


def paper_table(store: Store) -> list[str]:
    """The paper's size by preset and engine, at the best batch and alone."""
    rows = []
    for preset in dict.fromkeys(key["preset"] for key in store.every_key()):
        millions = (dig(store.data, preset, "parameters") or 0) / 1e6
        for engine in engines_of(store):
            found = [key for key in store.every_key() if (key["preset"], key["engine"]) == (preset, engine)]
            sizes = {key["batch"] for key in found if "alone" not in key}
            at = {
                size: store.median({"preset": preset, "engine": engine, "batch": size}, "frames_per_s")
                for size in sizes
            }
            if not at:
                continue
            size = max(at, key=lambda batch: at[batch] or 0.0)
            alone = store.median({"preset": preset, "engine": engine, "alone": True}, "call_ms_p50")
            row = [preset, ENGINES[engine], number(millions, 0, " M"), number(at[size]), str(size), number(alone, 1)]
            rows.append(row)
    rows.append(["the paper", "RTX 5090", "≈ 212 M", "15,000", "", "2"])
    return table(["pack", "engine", "parameters", "frames/s", "at batch", "alone (ms)"], rows, 2)


def idle_table(store: Store) -> list[str]:
    """Memory and CPU of an idle server."""
    rows = []
    for engine in engines_of(store):
        key = {"engine": engine}
        sessions = store.median(key, "sessions") or 0
        memory = [store.median(key, name) for name in ("rss_bytes", "rss_with_sessions_bytes")]
        shares = [store.median(key, name) for name in ("cpu_share", "cpu_share_with_sessions")]
        if None in memory or None in shares:
            continue
        grown = memory[1] - memory[0]
        rows.append(
            [ENGINES[engine], "nobody connected", number(memory[0] / 2**20), "–", number(100 * shares[0], 2, " %")]
        )
        each = number(grown / sessions, 0) if sessions else "–"
        rows.append(
            [
                ENGINES[engine],
                f"{sessions:,.0f} idle sessions",
                number(memory[1] / 2**20),
                each,
                number(100 * shares[1], 2, " %"),
            ]
        )
    return table(["engine", "state", "memory (MiB)", "bytes a session", "CPU of a core"], rows, 2)


def live_table(store: Store) -> list[str]:
    """Every run of live characters: what went wrong in it, and what it took."""
    rows = []
    for run in store.data["runs"]:
        key, result = run["key"], run["result"]
        counts = [dig(result, "live", "plans", "underruns"), dig(result, "live", "missing_frames")]
        counts += [dig(result, "live", "slowed_frames"), dig(result, "live", "late_ticks")]
        figures = [number(value) for value in counts]
        figures.append(number(dig(result, "live", "plans_per_s_and_character"), 2))
        figures += [number(dig(result, "latency_ms", name), 1) for name in ("p50", "p99")]
        memory = dig(result, "server", "rss_peak_bytes")
        figures.append(number(memory / 2**20 if memory else None))
        rows.append([ENGINES[key["engine"]], number(key["characters"]), *figures])
    heads = ["engine", "characters", "underruns", "frames missing", "frames slowed", "late ticks"]
    return table([*heads, "plans a second each", "tick p50 (ms)", "tick p99 (ms)", "memory (MiB)"], rows)


def overload_table(store: Store) -> list[str]:
    """Overload, the medians and the extremes of the runs."""
    lines: list[str] = []
    figures = (
        ("capacity found, requests a second", ("capacity_per_s",), 1.0, 0),
        ("answered a second in the overload", ("during", "right_per_s"), 1.0, 0),
        ("refused, %", ("refused_share",), 100.0, 1),
        ("failed", ("during", "counts", "failed"), 1.0, 0),
        ("p99 of the admitted at 90 % of capacity, ms", ("before", "latency_ms", "p99"), 1.0, 0),
        ("p99 of the admitted in the overload, ms", ("during", "latency_ms", "p99"), 1.0, 0),
        ("the second over the first", ("p99_ratio",), 1.0, 2),
        ("as before again after, s", ("recovery_s",), 1.0, 1),
        ("memory at its most over that at the beginning, MiB", ("memory", "grown"), 2.0**-20, 1),
        ("frames of live characters slowed in it", ("beside", "slowed_during"), 1.0, 0),
        ("frames of live characters missing", ("beside", "missing"), 1.0, 0),
    )
    for engine in engines_of(store):
        runs = store.of({"engine": engine})
        rows = []
        for text, path, scale, digits in figures:
            values = sorted(scale * value for result in runs if (value := dig(result, *path)) is not None)
            if values:
                shown = (values[0], statistics.median(values), values[-1])
                rows.append([text, *(number(value, digits) for value in shown)])
        lines += [f"{ENGINES[engine]}, {len(runs)} runs:", "", *table(["", "least", "median", "most"], rows), ""]
    return lines


def micro_table(store: Store) -> list[str]:
    """Criterion's medians."""
    rows = [[f"`{key['bench']}`", duration(store.median(key, "median_ns"))] for key in store.every_key()]
    return table(["bench", "median"], rows)


def duration(nanoseconds: float | None) -> str:
    """A time with the unit that suits it."""
    if nanoseconds is None:
        return "–"
    for unit, size in (("ns", 1.0), ("µs", 1e3), ("ms", 1e6)):
        if nanoseconds < 1000 * size or unit == "ms":
            return f"{nanoseconds / size:,.{2 if nanoseconds < 100 * size else 0}f} {unit}"
    return "–"


def instruction_table(store: Store) -> list[str]:
    """Instructions of each bench."""
    rows = [[f"`{key['bench']}`", number(store.median(key, "instructions"))] for key in store.every_key()]
    return table(["bench", "instructions"], rows)
