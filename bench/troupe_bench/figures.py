"""Figures of one machine: what docs/benchmarks.md shows of its results, small enough to keep in the repository.

Raw results stay on the machine that measured them, in target/bench/results. ``digest`` reduces them to the rows of the page's
tables, and ``keep`` writes those to bench/figures/MACHINE.json. A part that was not measured again keeps its older figures.
"""

import json
import re
import statistics
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from troupe_bench.cli import STAGES
from troupe_bench.machine import ROOT
from troupe_bench.settings import CROWD, JEMALLOC, OFFICIAL_WAYS, RAW_LOOPS, Settings
from troupe_bench.store import Json, Store, dig

FOLDER = ROOT / "bench" / "figures"
ENGINES = ("cpu", "openvino-bf16")
LONGEST_PAUSE_S = 20 * 60
"""Runs of a part that are further apart than this are separate sittings: the machine may have changed in between."""

FRAMES = ("throughput", "frames_per_s")
LATENCIES = ("p50", "p99")
OVERLOAD = {
    "capacity_per_s": ("capacity_per_s",),
    "answered_per_s": ("during", "right_per_s"),
    "refused_share": ("refused_share",),
    "failed": ("during", "counts", "failed"),
    "p99_before_ms": ("before", "latency_ms", "p99"),
    "p99_during_ms": ("during", "latency_ms", "p99"),
    "p99_ratio": ("p99_ratio",),
    "recovery_s": ("recovery_s",),
    "memory_grown_bytes": ("memory", "grown"),
    "live_frames_slowed": ("beside", "slowed_during"),
    "live_frames_missing": ("beside", "missing"),
}
LIVE = {
    "underruns": ("live", "plans", "underruns"),
    "missing_frames": ("live", "missing_frames"),
    "slowed_frames": ("live", "slowed_frames"),
    "late_ticks": ("live", "late_ticks"),
    "plans_per_s": ("live", "plans_per_s_and_character"),
    "p50_ms": ("latency_ms", "p50"),
    "p99_ms": ("latency_ms", "p99"),
    "memory_bytes": ("server", "rss_peak_bytes"),
}

OFFICIAL_RATIOS = {
    "alone": (("alone", ("alone",), "p50_ms"), ("alone_changed", ("alone", "alone-bf16"), "p50_ms")),
    "saturated": (
        ("published", ("alone", "processes"), "frames_per_s"),
        ("changed", tuple(OFFICIAL_WAYS), "frames_per_s"),
    ),
}
"""What Troupe's ways are compared with: a name, ways of NVIDIA's code of which the fastest counts, and the number."""

WORDS_TIMES = ("first_frames_ms", "answer_ms")

Row = dict[str, Any]


def engines_of(store: Store) -> list[str]:
    """Engines with results, in the order of the page."""
    seen = {key["engine"] for key in store.every_key()}
    return [engine for engine in ENGINES if engine in seen]


def spread(values: list[float]) -> list[float] | None:
    """The least, the median and the most."""
    return [min(values), statistics.median(values), max(values)] if values else None


def serving(store: Store) -> dict[str, Any]:
    """Every target and load, the ratios that they come to, and the parts of a request's time."""
    rows: list[Row] = []
    for key in store.every_key():
        load: Row = {name: key[name] for name in ("engine", "target", "batch", "alone", "clients") if name in key}
        if any(load.items() <= row.items() for row in rows):
            continue
        raw = key["target"] in RAW_LOOPS
        frames = store.median(load, *(("frames_per_s",) if raw else FRAMES))
        times = [store.median(load, *((f"call_ms_{p}",) if raw else ("latency_ms", p))) for p in LATENCIES]
        rows.append(load | {"frames_per_s": frames, "p50_ms": times[0], "p99_ms": times[1]})
    repeats = len({key["repeat"] for key in store.every_key()})
    return {"repeats": repeats, "rows": rows, "ratios": ratios(store, rows), "split": split(store)}


def best_batch(rows: list[Row], engine: str, target: str = "raw") -> int | None:
    """The batch size at which a raw loop is fastest."""
    found = [row for row in rows if (row["engine"], row["target"]) == (engine, target) and "batch" in row]
    return max(found, key=lambda row: row["frames_per_s"] or 0.0)["batch"] if found else None


def ratios(store: Store, rows: list[Row]) -> list[Row]:
    """Ratios within each turn: against the raw loop and against the Python servers."""
    found: list[Row] = []

    def note(engine: str, what: str, values: list[float]) -> None:
        if values:
            found.append({"engine": engine, "what": what, "spread": spread(values)})

    for engine in engines_of(store):
        served = [row for row in rows if (row["engine"], row["target"]) == (engine, "troupe")]
        batch, same = best_batch(rows, engine), best_batch(rows, engine, JEMALLOC)
        if batch and served:
            fastest = max(served, key=lambda row: row["frames_per_s"] or 0.0)
            ours = {"engine": engine, "target": "troupe", "clients": fastest["clients"]}
            theirs = {"engine": engine, "target": "raw", "batch": batch}
            note(engine, "of_raw", _shares(store, ours, theirs))
            note(engine, "of_raw_many", _shares(store, {"engine": engine, "target": CROWD}, theirs))
            if same:
                note(engine, "of_raw_jemalloc", _shares(store, ours, theirs | {"target": JEMALLOC, "batch": same}))
            note(engine, "of_raw_server_only", _on_the_rest(store, ours, theirs))
        one = {"engine": engine, "target": "troupe", "clients": 1}
        for alone, what in ((True, "alone_above_raw_ms"), ("paused", "alone_above_paused_ms")):
            raw = {"engine": engine, "target": "raw", "alone": alone}
            pairs = store.turns((one, "latency_ms", "p50"), (raw, "call_ms_p50"))
            note(engine, what, [mine - theirs for mine, theirs in pairs])
        for target in ("litserve", "fastapi"):
            for what, values in _against(store, engine, target, engine):
                note(engine, what, values)
    if set(engines_of(store)) >= set(ENGINES):
        # The engine of `pip install litserve onnxruntime` beside the server's own choice.
        for what, values in _against(store, "openvino-bf16", "litserve", "cpu"):
            note("openvino-bf16", f"{what}_f32", values)
    return found


def _shares(store: Store, ours: Row, theirs: Row) -> list[float]:
    """Percent of the raw loop's frames/s, of each turn."""
    return [100 * mine / raw for mine, raw in store.turns((ours, *FRAMES), (theirs, "frames_per_s"))]


def _on_the_rest(store: Store, ours: Row, theirs: Row) -> list[float]:
    """Percent of the raw loop's frames/s on the processor time that the load tester leaves to the server.

    This is what to expect where clients run on other machines.
    """
    workers = ((theirs, "workers", "count"), (theirs, "workers", "threads"))
    sides = ((ours, *FRAMES), (ours, "client", "cpus_busy"), (theirs, "frames_per_s"), *workers)
    return [
        100 * mine / raw * count * threads / (count * threads - busy)
        for mine, busy, raw, count, threads in store.turns(*sides)
        if busy < count * threads
    ]


def _against(store: Store, engine: str, target: str, their_engine: str) -> list[tuple[str, list[float]]]:
    """Throughput and tail at 32 clients, divided by those of a Python server."""
    ours = {"engine": engine, "target": "troupe", "clients": 32}
    theirs = {"engine": their_engine, "target": target, "clients": 32}
    named = (("frames", FRAMES), ("p99", ("latency_ms", "p99")))
    return [
        (f"{what}_by_{target}", [mine / its for mine, its in store.turns((ours, *path), (theirs, *path)) if its])
        for what, path in named
    ]


def split(store: Store) -> list[Row]:
    """The mean time of a request, part by part."""
    parts = ("client", "transport", "server_other", "queue", "assemble", "inference", "scatter")
    rows = []
    for engine in engines_of(store):
        for clients in (1, 32):
            key = {"engine": engine, "target": "troupe", "clients": clients}
            times = {part: store.median(key, "split_ms", part) for part in parts}
            if not any(times.values()):
                continue
            del times["inference"]
            stages = {stage: store.median(key, "server", "stage_ms", stage) for stage in STAGES}
            mean = store.median(key, "server", "batch_mean")
            rows.append({"engine": engine, "clients": clients, "rows_per_batch": mean, "ms": times | stages})
    return rows


def mixed(store: Store) -> dict[str, Any]:
    """Segments of all lengths."""
    rows = []
    for engine in engines_of(store):
        for target, variant in (("troupe", {}), ("litserve", {}), ("litserve", {"no_group": True})):
            key = {"engine": engine, "target": target, "variant": variant}
            times = [store.median(key, "latency_ms", name) for name in LATENCIES]
            figures = {"frames_per_s": store.median(key, *FRAMES), "p50_ms": times[0], "p99_ms": times[1]}
            rows.append({"engine": engine, "target": target, "padded": bool(variant)} | figures)
    return {"rows": rows}


def live(store: Store) -> dict[str, Any]:
    """Live characters: the spread over the runs of a size."""
    rows = []
    sizes = dict.fromkeys((key["engine"], key["characters"]) for key in store.every_key())
    for engine, characters in sizes:
        runs = store.of({"engine": engine, "characters": characters})
        row = {"engine": engine, "characters": characters, "runs": len(runs)}
        rows.append(row | _spreads(runs, LIVE))
    return {"rows": rows}


def overload(store: Store) -> dict[str, Any]:
    """Overload: the spread over the runs."""
    rows = []
    for engine in engines_of(store):
        runs = store.of({"engine": engine})
        rows.append({"engine": engine, "runs": len(runs)} | _spreads(runs, OVERLOAD))
    return {"rows": rows}


def _spreads(runs: list[Json], paths: dict[str, tuple[str, ...]]) -> Row:
    """The spread of each figure that any run has."""
    found = {name: [value for run in runs if (value := dig(run, *path)) is not None] for name, path in paths.items()}
    return {name: spread(values) for name, values in found.items() if values}


def ceiling(store: Store) -> dict[str, Any]:
    """Operations of a segment, and the machine's peak."""
    names = ("segment_mflop", "peak_gflop_per_s", "frames_per_s_at_peak")
    rows = []
    for engine in engines_of(store):
        key = {"engine": engine}
        stages = {stage: store.median(key, "stage_mflop", stage) for stage in STAGES}
        rows.append(key | {"stage_mflop": stages} | {name: store.median(key, name) for name in names})
    return {"rows": rows}


def operators(store: Store) -> dict[str, Any]:
    """Time by stage and kind of operator, and the rate of the products."""
    kinds = ("products", "norms", "moves", "elementwise")
    rows: list[Row] = []
    for engine in engines_of(store):
        for stage in STAGES:
            key = {"engine": engine}
            took = {kind: store.median(key, "stages", stage, "ms", kind) or 0.0 for kind in kinds}
            total = sum(took.values())
            if not total:
                continue
            rate = (store.median(key, "stages", stage, "mflop") or 0.0) / took["products"] if took["products"] else None
            shares = {kind: 100 * ms / total for kind, ms in took.items()}
            rows.append(key | {"stage": stage, "ms": total, "percent": shares, "products_gflop_per_s": rate})
    return {"rows": rows}


def paper(store: Store) -> dict[str, Any]:
    """Packs of the paper's size, at the best batch and alone."""
    rows = []
    for preset in dict.fromkeys(key["preset"] for key in store.every_key()):
        for engine in engines_of(store):
            key = {"preset": preset, "engine": engine}
            sizes = {each["batch"] for each in store.every_key() if key.items() <= each.items() and "batch" in each}
            at = {size: store.median(key | {"batch": size}, "frames_per_s") for size in sizes}
            if not at:
                continue
            size = max(at, key=lambda batch: at[batch] or 0.0)
            figures = {
                "parameters": dig(store.data, preset, "parameters"),
                "frames_per_s": at[size],
                "batch": size,
                "alone_ms": store.median(key | {"alone": True}, "call_ms_p50"),
            }
            rows.append(key | figures)
    return {"rows": rows}


def idle(store: Store) -> dict[str, Any]:
    """Memory and CPU of an idle server."""
    names = ("sessions", "rss_bytes", "rss_with_sessions_bytes", "cpu_share", "cpu_share_with_sessions")
    rows = []
    for engine in engines_of(store):
        figures = {name: store.median({"engine": engine}, name) for name in names}
        if None not in figures.values():
            rows.append({"engine": engine} | figures)
    return {"rows": rows}


def micro(store: Store) -> dict[str, Any]:
    """Criterion's medians."""
    return {"rows": [key | {"median_ns": store.median(key, "median_ns")} for key in store.every_key()]}


def tune(store: Store) -> dict[str, Any]:
    """Every setting of the Python servers that was tried."""
    return {"rows": [key | {"frames_per_s": store.median(key, *FRAMES)} for key in store.every_key()]}


def words(store: Store) -> dict[str, Any]:
    """Motion of words: every target and load, ratios to FastAPI within each turn, and the settings of FastAPI that were tried."""
    rows: list[Row] = []
    shares: list[Row] = []
    loads = dict.fromkeys((key["target"], key["clients"]) for key in store.every_key() if "clients" in key)
    for target, clients in loads:
        key = {"target": target, "clients": clients}
        row: Row = {"engine": "cpu"} | key | {"frames_per_s": store.median(key, "frames_per_s")}
        for what in WORDS_TIMES:
            row |= {f"{what}_{part}": store.median(key, what, part) for part in LATENCIES}
        rows.append(row | {what: store.median(key, what) for what in ("frames_per_cpu_s", "client_cpus_busy")})
        if target == "troupe":
            continue
        ours = key | {"target": "troupe"}
        for what in ("frames_per_s", "frames_per_cpu_s", *WORDS_TIMES):
            path = (what, "p50") if what in WORDS_TIMES else (what,)
            found = [mine / its for mine, its in store.turns((ours, *path), (key, *path)) if its]
            if found:
                shares.append({"engine": "cpu"} | key | {"what": what, "spread": spread(found)})
    tuned: list[Row] = []
    for key in (key for key in store.every_key() if "options" in key):
        times = {what: store.median(key, what, "p50") for what in WORDS_TIMES}
        speeds = {what: store.median(key, what) for what in ("frames_per_s", "frames_per_cpu_s")}
        tuned.append({"engine": "cpu", "options": key["options"]} | speeds | times)
    checks = [key | store.of(key)[0] for key in store.every_key() if "check" in key]
    repeats = len({key["repeat"] for key in store.every_key() if "repeat" in key})
    return {"repeats": repeats, "checks": checks, "rows": rows, "ratios": shares, "tuned": tuned}


def official(store: Store) -> dict[str, Any]:
    """NVIDIA's public code and Troupe: every way of both, and the ratios within each turn."""
    rows: list[Row] = []
    for key in store.every_key():
        row: Row = {name: key[name] for name in ("target", "way", "frames")}
        row |= {"engine": key.get("engine") or _precision(key["way"])}
        if row not in rows:
            rows.append(row)
    shares: list[Row] = []
    ours = [row for row in rows if row["target"] == "troupe"]
    for row in ours:
        for what, ways, number in OFFICIAL_RATIOS[row["way"]]:
            # Batches in bf16 are beside bf16 alone.
            fair = (way for way in ways if row["engine"] != "cpu" or _precision(way) == "cpu")
            theirs = [{"target": "public", "way": way, "frames": row["frames"]} for way in fair]
            found = [_times(number, *turn) for turn in store.turns((row, number), *((key, number) for key in theirs))]
            if found:
                shares.append({"engine": row["engine"], "frames": row["frames"], "what": what, "spread": spread(found)})
    measured = []
    for row in rows:
        key = {name: value for name, value in row.items() if name != "engine" or row["target"] == "troupe"}
        measured.append(row | {what: store.median(key, what) for what in ("frames_per_s", "p50_ms")})
    repeats = len({key["repeat"] for key in store.every_key()})
    return {"repeats": repeats, "rows": measured, "ratios": shares}


def _precision(way: str) -> str:
    """The engine that computes as a way of the public code does."""
    return "openvino-bf16" if way.endswith("bf16") else "cpu"


def _times(number: str, mine: float, *others: float) -> float:
    """How many times faster than the fastest of others."""
    return min(others) / mine if number == "p50_ms" else mine / max(others)


PARTS = {
    "serving": serving,
    "mixed": mixed,
    "live": live,
    "overload": overload,
    "words": words,
    "ceiling": ceiling,
    "operators": operators,
    "paper": paper,
    "official": official,
    "idle": idle,
    "micro": micro,
    "tune": tune,
}


def sittings_note(store: Store) -> str:
    """When a part was measured, if it took several sittings; otherwise an empty text."""
    sittings = store.sittings(LONGEST_PAUSE_S)
    if len(sittings) < 2:
        return ""
    spans = "; ".join(f"{_named(runs)} {_span(runs)}" for runs in sittings)
    return f"measured in {len(sittings)} sittings, so the machine may have changed in between: {spans} (UTC)"


def _named(runs: list[Json]) -> str:
    """The names of what runs measured, or their count if they have none."""
    keys = [run["key"] for run in runs]
    names = [key.get("target") or key.get("preset") or key.get("engine") for key in keys]
    return ", ".join(dict.fromkeys(names)) if all(names) else f"{len(runs)} run{'s' * (len(runs) > 1)}"


def _span(runs: list[Json]) -> str:
    """When the first and the last of runs ended, of runs by time."""
    first, last = (datetime.fromtimestamp(run["at"], UTC) for run in (runs[0], runs[-1]))
    end = f"{last:%H:%M}" if last.date() == first.date() else f"{last:%Y-%m-%d %H:%M}"
    return f"{first:%Y-%m-%d %H:%M} to {end}"


def digest(settings: Settings) -> dict[str, Any]:
    """The figures of this machine, of every part that was measured."""
    facts = Store(settings.results, "machine").data.get("machine", {})
    commit = f"{facts.get('commit', '')}{' with local changes' if facts.get('changed') else ''}"
    parts = {}
    for part, figures in PARTS.items():
        store = Store(settings.results, part)
        if not store.data["runs"]:
            continue
        last = datetime.fromtimestamp(max(run["at"] for run in store.data["runs"]), UTC)
        commits = dict.fromkeys(run["commit"] for run in store.data["runs"] if run.get("commit"))
        old = bool(commits) and list(commits) != [facts.get("commit")]
        parts[part] = {
            "measured": f"{last:%Y-%m-%d}",
            "code": ", ".join(commits) if old else commit,
            "pack": store.data.get("pack", ""),
            "notes": [note for note in (sittings_note(store), store.data.get("remark", "")) if note],
        } | figures(store)
    return {"machine": {name: value for name, value in facts.items() if name in MACHINE_FACTS}, "parts": parts}


MACHINE_FACTS = ("cpu", "flags", "cores", "memory_gib", "system", "rustc", "python")


def name_of(cpu: str) -> str:
    """A file name for a machine, from its processor's: `Intel(R) Xeon(R) Processor` is intel-xeon."""
    short = re.sub(r"\(r\)|\(tm\)|\bprocessor\b|\bcpu\b", " ", cpu.lower())
    return re.sub(r"[^a-z0-9]+", "-", short).strip("-") or "machine"


def keep(figures: dict[str, Any], name: str, folder: Path) -> None:
    """Writes a machine's figures. Parts that were not measured again stay as they are, and so do title and remark."""
    path = folder / f"{name}.json"
    old: Json = json.loads(path.read_text()) if path.exists() else {"title": name, "remark": "", "parts": {}}
    kept = old | {"machine": figures["machine"] or old.get("machine", {})}
    kept["parts"] = {part: new for part in PARTS if (new := figures["parts"].get(part) or old["parts"].get(part))}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(as_text(kept))


def as_text(figures: dict[str, Any]) -> str:
    """JSON with one line for each row, so that a change of figures reads well."""

    def shown(value: Any, depth: int) -> str:
        inner, outer = " " * (depth + 1), " " * depth
        if isinstance(value, dict) and depth < 3:
            lines = [f"{inner}{json.dumps(name)}: {shown(item, depth + 1)}" for name, item in value.items()]
            return "{\n" + ",\n".join(lines) + f"\n{outer}}}" if lines else "{}"
        if isinstance(value, list) and value and isinstance(value[0], dict):
            lines = [inner + json.dumps(_short(row), ensure_ascii=False) for row in value]
            return "[\n" + ",\n".join(lines) + f"\n{outer}]"
        return json.dumps(_short(value), ensure_ascii=False)

    return shown(figures, 0) + "\n"


def _short(value: Any) -> Any:
    """A value whose numbers have six significant digits."""
    if isinstance(value, dict):
        return {name: _short(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_short(item) for item in value]
    if isinstance(value, float):
        return int(value) if value.is_integer() else float(f"{value:.6g}")
    return value


def machines(folder: Path) -> list[dict[str, Any]]:
    """The figures of every machine, by the names of their files."""
    return [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"), key=lambda path: path.stem)]
