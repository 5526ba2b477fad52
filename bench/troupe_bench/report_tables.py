"""The tables of docs/benchmarks.md: one for each question, with a column or a row for each machine and engine."""

from collections.abc import Callable
from typing import Any

from troupe_bench.cli import STAGES
from troupe_bench.figures import ENGINES
from troupe_bench.settings import CROWD, CROWD_SIZE, JEMALLOC, OFFICIAL_BATCH, OFFICIAL_LENGTHS, PAUSE_US

NAMES = {"raw": "raw loop", JEMALLOC: "raw loop, jemalloc", "troupe": "**Troupe**", CROWD: "**Troupe**"}
NAMES |= {"litserve": "LitServe", "fastapi": "FastAPI"}
SHORT = {"cpu": "f32", "openvino-bf16": "bf16"}
RATIOS = (
    ("of_raw", "frames/s at saturation, share of the raw loop's best", 0, " %", "≥ 90 %"),
    ("of_raw_many", f"the same, {CROWD_SIZE} characters a request", 0, " %", "≥ 90 %"),
    ("of_raw_jemalloc", "the same, of the raw loop with jemalloc", 0, " %", ""),
    ("of_raw_server_only", "the same, without the processor time of the load tester", 0, " %", ""),
    ("alone_above_raw_ms", "p50 of one client, above one call of the networks", 2, " ms", "≤ 0.5 ms"),
    ("alone_above_paused_ms", f"the same, calls {PAUSE_US / 1000:g} ms apart", 2, " ms", ""),
    ("frames_by_litserve", "frames/s at 32 clients ÷ LitServe's", 2, " ×", "≥ 3 ×"),
    ("p99_by_litserve", "p99 at 32 clients ÷ LitServe's", 2, " ×", "≤ 1 ×"),
    ("frames_by_litserve_f32", "frames/s at 32 clients ÷ LitServe's in f32", 2, " ×", "≥ 3 ×"),
    ("p99_by_litserve_f32", "p99 at 32 clients ÷ LitServe's in f32", 2, " ×", "≤ 1 ×"),
    ("frames_by_fastapi", "frames/s at 32 clients ÷ FastAPI's", 2, " ×", ""),
    ("p99_by_fastapi", "p99 at 32 clients ÷ FastAPI's", 2, " ×", ""),
)
OVERLOAD = (
    ("capacity_per_s", "capacity, requests/s", 1.0, 0),
    ("answered_per_s", "answered in the overload, requests/s", 1.0, 0),
    ("refused_share", "refused, %", 100.0, 1),
    ("failed", "failed", 1.0, 0),
    ("p99_before_ms", "p99 at 90 % of capacity, ms", 1.0, 0),
    ("p99_during_ms", "p99 of admitted requests in the overload, ms", 1.0, 0),
    ("p99_ratio", "the second ÷ the first", 1.0, 2),
    ("recovery_s", "time until latency is as before, s", 1.0, 1),
    ("memory_grown_bytes", "growth of memory, MiB", 2.0**-20, 1),
    ("live_frames_slowed", "frames of live characters slowed", 1.0, 0),
    ("live_frames_missing", "frames of live characters missing", 1.0, 0),
)

WORDS_NAMES = {"troupe": "**Troupe**", "fastapi": "FastAPI, in parts", "fastapi-whole": "FastAPI, at the end"}
WORDS_RATIOS = {
    "frames_per_s": "tokens/s",
    "frames_per_cpu_s": "tokens per CPU second",
    "first_frames_ms": "time to the first frames",
    "answer_ms": "time to all frames",
}
WORDS_OTHERS = {"fastapi": "FastAPI's in parts", "fastapi-whole": "FastAPI's at the end"}
FRAMES_PER_TOKEN = 4

OFFICIAL_NAMES = {
    ("public", "alone"): ("NVIDIA's code", "as published, all cores"),
    ("public", "processes"): ("NVIDIA's code", "as published, a process a core"),
    ("public", "alone-bf16"): ("NVIDIA's code, changed", "autocast, all cores"),
    ("public", "batched"): ("NVIDIA's code, changed", f"{OFFICIAL_BATCH} plans a call"),
    ("public", "batched-bf16"): ("NVIDIA's code, changed", f"{OFFICIAL_BATCH} plans a call, autocast"),
    ("troupe", "alone"): ("**Troupe**", "1 client"),
    ("troupe", "saturated"): ("**Troupe**", "32 clients"),
}
OFFICIAL_RATIOS = {
    "alone": ("p50, one plan at a time", "≥ 4 ×"),
    "alone_changed": ("the same, the fastest way of NVIDIA's code, changed or not", ""),
    "published": ("frames/s, NVIDIA's code as published", "≥ 25 ×"),
    "changed": ("frames/s, the fastest way of NVIDIA's code, changed or not", ""),
}

Machine = dict[str, Any]
Row = dict[str, Any]
Key = tuple[Any, ...]
"""The names of a row of the serving part."""


def table(heads: list[str], rows: list[list[str]], words: int = 1) -> list[str]:
    """A Markdown table; the first ``words`` columns are text, the others numbers."""
    if not rows:
        return []
    rule = ["---"] * words + ["---:"] * (len(heads) - words)
    return ["| " + " | ".join(row) + " |" for row in (heads, rule, *rows)]


def number(value: float | None, decimals: int = 0, unit: str = "") -> str:
    """A number for people, or a dash."""
    return "–" if value is None else f"{value:,.{decimals}f}{unit}"


def median_of(values: list[float] | None, decimals: int = 0, unit: str = "") -> str:
    """A median, with the least and the most in brackets if they differ."""
    if values is None:
        return "–"
    least, middle, most = (number(value, decimals, unit) for value in values)
    return middle if least == most else f"{middle} ({least.removesuffix(unit)} to {most.removesuffix(unit)})"


def rows_of(machine: Machine, part: str, name: str = "rows") -> list[Row]:
    """The rows of a machine's part, or none if it was not measured."""
    return machine["parts"].get(part, {}).get(name, [])


def sides(machines: list[Machine], part: str, name: str = "rows") -> list[tuple[str, list[Row]]]:
    """A column for each engine and machine that has rows of it: its head and the rows."""
    found = []
    for engine in ENGINES:
        for machine in machines:
            if rows := [row for row in rows_of(machine, part, name) if row["engine"] == engine]:
                found.append((f"{SHORT[engine]}, {machine['title']}", rows))
    return found


def each(machines: list[Machine], part: str, name: str = "rows") -> list[tuple[str, Row]]:
    """All rows of a part by engine, each with its machine."""
    found = [(machine["title"], row) for machine in machines for row in rows_of(machine, part, name)]
    return sorted(found, key=lambda pair: ENGINES.index(pair[1]["engine"]))


def _across(
    columns: list[tuple[str, list[Row]]], heads: list[str], lines: dict[Key, list[str]], cell: Callable[[Row], str]
) -> list[str]:
    """A table whose rows are named by keys and whose columns are machines. Keys that no column has are left out."""
    rows = []
    for key, words in lines.items():
        found = [next((row for row in rows if key == _key(row)), None) for _, rows in columns]
        if any(found):
            rows.append([*words, *("–" if row is None else cell(row) for row in found)])
    return table([*heads, *(head for head, _ in columns)], rows, len(heads))


def _key(row: Row) -> Key:
    """The key of a row of the serving part."""
    return tuple(row.get(name) for name in ("target", "batch", "alone", "clients"))


def _loads(machines: list[Machine]) -> dict[Key, list[str]]:
    """Every load that any machine was measured at: the words of its row, in the order of the page."""
    seen = {_key(row): row for machine in machines for row in rows_of(machine, "serving")}
    order = {target: place for place, target in enumerate(NAMES)}

    def place(key: Key) -> tuple[Any, ...]:
        return (order[key[0]], key[2] is not None, key[2] == "paused", key[1] or 0, key[3] or 0)

    return {key: [NAMES[key[0]], _load(seen[key])] for key in sorted(seen, key=place)}


def _load(row: Row) -> str:
    if "batch" in row:
        return f"batch {row['batch']}"
    if "alone" in row:
        return "one worker, batch 1" + f", calls {PAUSE_US / 1000:g} ms apart" * (row["alone"] == "paused")
    many = f", {CROWD_SIZE} characters a request" * (row["target"] == CROWD)
    return f"{row['clients']} client{'s' * (row['clients'] > 1)}{many}"


def throughput(machines: list[Machine]) -> list[str]:
    """Frames a second of every target and load."""
    columns = sides(machines, "serving")
    return _across(columns, ["target", "load"], _loads(machines), lambda row: number(row["frames_per_s"]))


def latency(machines: list[Machine]) -> list[str]:
    """Latencies of every server, and of single calls of the networks."""
    loads = {key: words for key, words in _loads(machines).items() if key[1] is None}
    columns = sides(machines, "serving")

    def cell(row: Row) -> str:
        return f"{number(row['p50_ms'], 2)} / {number(row['p99_ms'], 2)}"

    return _across(columns, ["target", "load"], loads, cell)


def ratios(machines: list[Machine]) -> list[str]:
    """The ratios, and the bars set for them."""
    columns = sides(machines, "serving", "ratios")
    rows = []
    for what, text, decimals, unit, bar in RATIOS:
        found = [next((row["spread"] for row in rows if row["what"] == what), None) for _, rows in columns]
        if any(found):
            rows.append([text, bar or "–", *(median_of(values, decimals, unit) for values in found)])
    return table(["", "bar", *(head for head, _ in columns)], rows, 1)


def split(machines: list[Machine]) -> list[str]:
    """The mean time of a request, part by part."""
    parts = {"transport": "transport", "server_other": "checks, frames, encoding", "queue": "queue"}
    parts |= {"assemble": "fill tensors"} | dict(zip(STAGES, STAGES, strict=True)) | {"scatter": "read tensors"}
    rows = []
    for title, row in each(machines, "serving", "split"):
        times = [number(row["ms"].get(part), 2) for part in parts]
        rows.append([SHORT[row["engine"]], title, str(row["clients"]), *times, number(row["rows_per_batch"], 1)])
    return table(["engine", "machine", "clients", *parts.values(), "characters a batch"], rows, 2)


def mixed(machines: list[Machine]) -> list[str]:
    """Segments of all lengths."""
    columns = sides(machines, "mixed")
    rows = []
    for target, padded, name in (
        ("troupe", False, NAMES["troupe"]),
        ("litserve", False, "LitServe, rows grouped by length"),
        ("litserve", True, "LitServe, rows padded to the longest"),
    ):
        found = [next((r for r in rows if (r["target"], r["padded"]) == (target, padded)), None) for _, rows in columns]
        if any(found):
            cells = (
                "–"
                if row is None
                else f"{number(row['frames_per_s'])} ({number(row['p50_ms'], 1)} / {number(row['p99_ms'], 1)})"
                for row in found
            )
            rows.append([name, *cells])
    return table(["target", *(head for head, _ in columns)], rows)


def live(machines: list[Machine]) -> list[str]:
    """Live characters."""
    figures = (
        ("underruns", 1.0, 0),
        ("missing_frames", 1.0, 0),
        ("slowed_frames", 1.0, 0),
        ("late_ticks", 1.0, 0),
        ("plans_per_s", 1.0, 2),
        ("p50_ms", 1.0, 1),
        ("p99_ms", 1.0, 1),
        ("memory_bytes", 2.0**-20, 0),
    )
    rows = []
    for title, row in each(machines, "live"):
        cells = [median_of(_scaled(row.get(name), scale), decimals) for name, scale, decimals in figures]
        rows.append([SHORT[row["engine"]], title, number(row["characters"]), str(row["runs"]), *cells])
    heads = ["engine", "machine", "characters", "runs", "underruns", "frames missing", "frames slowed", "late ticks"]
    return table([*heads, "plans/s each", "tick p50 (ms)", "tick p99 (ms)", "memory (MiB)"], rows, 2)


def overload(machines: list[Machine]) -> list[str]:
    """Overload."""
    columns = sides(machines, "overload")
    rows = [["runs", *(str(rows[0]["runs"]) for _, rows in columns)]]
    for name, text, scale, decimals in OVERLOAD:
        found = [_scaled(rows[0].get(name), scale) for _, rows in columns]
        if any(found):
            rows.append([text, *(median_of(values, decimals) for values in found)])
    return table(["", *(head for head, _ in columns)], rows if columns else [])


def _scaled(values: list[float] | None, scale: float) -> list[float] | None:
    return None if values is None else [value * scale for value in values]


def words(machines: list[Machine]) -> list[str]:
    """Motion of words by every target and load."""
    rows = []
    for title, row in sorted(
        each(machines, "words"), key=lambda pair: (pair[1]["clients"], [*WORDS_NAMES].index(pair[1]["target"]))
    ):
        times = [
            f"{number(row[f'{what}_p50'])} / {number(row[f'{what}_p99'])}" for what in ("first_frames_ms", "answer_ms")
        ]
        rows.append(
            [
                WORDS_NAMES[row["target"]],
                title,
                str(row["clients"]),
                *(number((row[what] or 0.0) / FRAMES_PER_TOKEN) for what in ("frames_per_s", "frames_per_cpu_s")),
                *times,
                number(row["client_cpus_busy"], 2),
            ]
        )
    heads = ["target", "machine", "requests at once", "tokens/s", "tokens per CPU second"]
    return table([*heads, "first frames (ms)", "all frames (ms)", "cores of the clients"], rows, 2)


def words_ratios(machines: list[Machine]) -> list[str]:
    """Troupe's figures of words by those of FastAPI, and how alike the motions are."""
    found = each(machines, "words", "ratios")
    loads = sorted({row["clients"] for _, row in found})
    rows = []
    for target, other in WORDS_OTHERS.items():
        for what, text in WORDS_RATIOS.items():
            for title in dict.fromkeys(title for title, _ in found):
                at = {
                    row["clients"]: row["spread"]
                    for name, row in found
                    if (name, row["target"], row["what"]) == (title, target, what)
                }
                if at:
                    cells = (median_of(at.get(clients), 2, " ×") for clients in loads)
                    rows.append([f"{text} ÷ {other}", title, *cells])
    lines = table(["", "machine", *(f"{clients} at once" for clients in loads)], rows, 2)
    for machine in machines:
        for row in rows_of(machine, "words", "checks") if lines else []:
            same = f"{row['same']} of {row['compared']} {row['check']} motions are the same in both"
            far = f"{number(row['largest_m'] * 1e6, 1)} µm"
            lines += ["", f"{machine['title']}: {same}; their joints are {far} apart at most."]
    return lines


def words_tuned(machines: list[Machine]) -> list[str]:
    """Settings of the FastAPI server of words that were tried."""
    rows = []
    for title, row in each(machines, "words", "tuned"):
        text = ", ".join(f"{name} {value}" for name, value in row["options"].items())
        speeds = (number((row[what] or 0.0) / FRAMES_PER_TOKEN) for what in ("frames_per_s", "frames_per_cpu_s"))
        rows.append([text, title, *speeds, number(row["first_frames_ms"]), number(row["answer_ms"])])
    heads = ["settings", "machine", "tokens/s", "tokens per CPU second"]
    return table([*heads, "first frames, p50 (ms)", "all frames, p50 (ms)"], rows, 2)


def ceiling(machines: list[Machine]) -> list[str]:
    """Operations and peaks."""
    rows = []
    for title, row in each(machines, "ceiling"):
        stages = [row["stage_mflop"].get(stage) for stage in STAGES]
        figures = [*stages, row["segment_mflop"], row["peak_gflop_per_s"], row["frames_per_s_at_peak"]]
        rows.append([SHORT[row["engine"]], title, *(number(value) for value in figures)])
    heads = [f"{stage} (MFLOP)" for stage in STAGES]
    return table(["engine", "machine", *heads, "segment (MFLOP)", "peak (GFLOP/s)", "frames/s at peak"], rows, 2)


def operators(machines: list[Machine]) -> list[str]:
    """Time by stage and kind of operator."""
    kinds = {"products": "products", "norms": "norms, softmax", "moves": "moves", "elementwise": "elementwise"}
    rows = []
    for title, row in each(machines, "operators"):
        shares = [number(row["percent"][kind], 0, " %") for kind in kinds]
        rate = number(row["products_gflop_per_s"])
        rows.append([SHORT[row["engine"]], title, row["stage"], number(row["ms"], 1), *shares, rate])
    return table(["engine", "machine", "stage", "a batch (ms)", *kinds.values(), "products (GFLOP/s)"], rows, 3)


def paper(machines: list[Machine]) -> list[str]:
    """Packs of the paper's size."""
    rows = []
    for title, row in each(machines, "paper"):
        millions = (row["parameters"] or 0) / 1e6
        cells = [number(millions, 0, " M"), number(row["frames_per_s"]), str(row["batch"]), number(row["alone_ms"], 1)]
        rows.append([row["preset"], SHORT[row["engine"]], title, *cells])
    rows.sort(key=lambda row: row[0])
    if rows:
        rows.append(["the paper", "–", "RTX 5090", "≈ 212 M", "15,000", "–", "2"])
    return table(["pack", "engine", "machine", "parameters", "frames/s", "at batch", "alone (ms)"], rows, 3)


def official(machines: list[Machine]) -> list[str]:
    """NVIDIA's code and Troupe: every way of both, with a column for each length."""
    found = each(machines, "official")
    names: dict[Key, None] = dict.fromkeys((r["target"], r["way"], r["engine"], title) for title, r in found)
    lines = []
    for target, way, engine, title in sorted(names, key=lambda name: list(OFFICIAL_NAMES).index(name[:2])):
        same = [r for t, r in found if (r["target"], r["way"], r["engine"], t) == (target, way, engine, title)]
        at = {row["frames"]: row for row in same}
        cells = [number(at.get(frames, {}).get("frames_per_s")) for frames in OFFICIAL_LENGTHS]
        cells += [number(at.get(frames, {}).get("p50_ms"), 1) for frames in OFFICIAL_LENGTHS]
        lines.append([*OFFICIAL_NAMES[target, way], SHORT[engine], title, *cells])
    heads = [f"frames/s, {frames} a plan" for frames in OFFICIAL_LENGTHS]
    heads += [f"p50 of a call, {frames} (ms)" for frames in OFFICIAL_LENGTHS]
    return table(["target", "way", "precision", "machine", *heads], lines, 4)


def official_ratios(machines: list[Machine]) -> list[str]:
    """How many times faster than NVIDIA's code Troupe is, of runs of one turn."""
    found = each(machines, "official", "ratios")
    lines = []
    for what, (words, bar) in OFFICIAL_RATIOS.items():
        for title, row in (pair for pair in found if pair[1]["what"] == what):
            # The goals are those of 40 frames with the engine that the server chooses here.
            goal = bar if (row["frames"], row["engine"]) == (OFFICIAL_LENGTHS[0], ENGINES[-1]) else ""
            times = median_of(row["spread"], 1, " ×")
            lines.append([words, str(row["frames"]), SHORT[row["engine"]], title, times, goal])
    return table(["", "frames a plan", "Troupe's precision", "machine", "Troupe is faster by", "bar"], lines, 4)


def idle(machines: list[Machine]) -> list[str]:
    """Memory and CPU of an idle server."""
    rows = []
    for title, row in each(machines, "idle"):
        memory = [row["rss_bytes"], row["rss_with_sessions_bytes"]]
        grown = (memory[1] - memory[0]) / row["sessions"] if row["sessions"] else None
        shares = [number(100 * row[name], 2, " %") for name in ("cpu_share", "cpu_share_with_sessions")]
        sizes = [number(value / 2**20) for value in memory]
        cells = [*sizes, number(grown), *shares]
        rows.append([SHORT[row["engine"]], title, number(row["sessions"]), *cells])
    heads = ["engine", "machine", "sessions", "memory without (MiB)", "memory with (MiB)", "bytes a session"]
    return table([*heads, "CPU without (of a core)", "CPU with (of a core)"], rows, 2)


def micro(machines: list[Machine]) -> list[str]:
    """Criterion's medians."""
    columns = [(machine["title"], rows) for machine in machines if (rows := rows_of(machine, "micro"))]
    lines = []
    for bench in dict.fromkeys(row["bench"] for _, rows in columns for row in rows):
        found = [next((row["median_ns"] for row in rows if row["bench"] == bench), None) for _, rows in columns]
        lines.append([f"`{bench}`", *(duration(value) for value in found)])
    return table(["bench", *(head for head, _ in columns)], lines)


def duration(nanoseconds: float | None) -> str:
    """A time with the unit that suits it."""
    if nanoseconds is None:
        return "–"
    for unit, size in (("ns", 1.0), ("µs", 1e3), ("ms", 1e6)):
        if nanoseconds < 1000 * size or unit == "ms":
            return f"{nanoseconds / size:,.{2 if nanoseconds < 100 * size else 0}f} {unit}"
    return "–"


def tune(machines: list[Machine]) -> list[str]:
    """Every setting of the Python servers that was tried."""
    columns = sides(machines, "tune")
    tried = [(row["target"], row["options"]) for _, rows in columns for row in rows]
    lines = []
    for target in ("litserve", "fastapi"):
        options = [options for name, options in tried if name == target]
        for setting in (setting for place, setting in enumerate(options) if setting not in options[:place]):
            key = (target, setting)
            found = [next((r for r in rows if (r["target"], r["options"]) == key), None) for _, rows in columns]
            text = ", ".join(f"{name} {value}" for name, value in setting.items())
            lines.append([NAMES[target], text, *("–" if row is None else number(row["frames_per_s"]) for row in found)])
    return table(["target", "settings", *(head for head, _ in columns)], lines, 2)
