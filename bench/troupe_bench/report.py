"""Writes docs/benchmarks.md from the results."""

from datetime import UTC, datetime
from pathlib import Path

from troupe_bench.report_tables import (
    ENGINES,
    NAMES,
    ceiling_table,
    idle_table,
    instruction_table,
    live_table,
    micro_table,
    mixed_table,
    operators_table,
    overload_table,
    paper_table,
    serving_table,
    shares_table,
    summary_table,
    tried_table,
)
from troupe_bench.settings import Settings
from troupe_bench.store import Store

LONGEST_PAUSE_S = 20 * 60
"""Results of one part that are further apart than this were not measured in turns: the machine may be another by then."""

INTRO = """# Benchmarks

Written by `make bench`. Medians where a table names its repeats; of ratios, the median of those of each turn, with the least and the most.
"Bar" is what we set out to reach. [How it is measured](../bench/README.md). Engines of CPUs alone: CUDA and TensorRT are not measured.
"""

SECTIONS = (
    (
        "Serving, side by side",
        "serving",
        """The same pack, the same requests of 64 frames, the same ONNX Runtime library for every row of an engine; the targets take
turns. Closed loop: a client asks again as soon as it has its answer; clients and server share the machine. The raw loop
calls the three networks with no server around them, with the C library's allocator or with the server's (jemalloc, for the
memory of ONNX Runtime and OpenVINO too): the most that a server with that allocator can give. FastAPI and LitServe run with the
fastest settings of those [tried](#settings-tried), read and write raw arrays, and leave out what the server does beside
the networks (checks, segment frames, quaternions, pins to keyframes, feet).""",
        serving_table,
    ),
    ("What it comes to", "serving", "", summary_table),
    (
        "Where the time of a request goes",
        "serving",
        "Means over a request, from the client's clock and the server's metrics. A stage's time is that of its whole batch.",
        shares_table,
    ),
    (
        "Segments of all lengths",
        "mixed",
        "12 to 64 frames at 32 clients. LitServe groups the rows of a batch by length, or pads all of them to the longest.",
        mixed_table,
    ),
    (
        "Live characters",
        "live",
        """On one Drive stream at 30 Hz for five minutes, each with a new command every 2.5 s. A tick is late by what is over the
earliest one's time. One row a run.""",
        live_table,
    ),
    (
        "Overload",
        "overload",
        """Single requests of 64 frames for two minutes at five times what the server can do (Poisson arrivals, an open loop), beside 50
live characters; before it at 90 % of capacity, after it at half.""",
        overload_table,
    ),
    (
        "Why not more: the ceiling",
        "ceiling",
        """Two operations for each multiplication in matrix products and convolutions of a 64-frame segment, and the machine's best at
large matrix products through the same engine (of three shapes the best, as measured). The last column is what the networks would give if all of
their time went into products of that speed.""",
        ceiling_table,
    ),
    (
        "Where the networks' time goes",
        "operators",
        """One thread, 16 segments of 64 frames, by kind of operator, from the engines' own counters: matrix products and convolutions, norms
and softmaxes, what moves numbers about (reordering, slicing, gathering, padding), and what works element by element. The last column is
what the products reach; the table above has what all cores reach in large ones.""",
        operators_table,
    ),
    (
        "The paper's size",
        "paper",
        """Packs with random weights (`troupe-train random-pack`), 64 frames a segment, the raw loop. The paper reports 15,000 frames/s
and 2 ms on an RTX 5090. `paper` has the parameter counts of the paper's section 7.4, `paper-wide` the widths of its text, which
make it larger. Alone: one lane with all cores, one segment a call.""",
        paper_table,
    ),
    ("An idle server", "idle", "", idle_table),
    (
        "Parts",
        "micro",
        "Criterion, one core. The live plan and the request are the whole of what the server does beside queue and networks.",
        micro_table,
    ),
    (
        "Instructions of the hot loop",
        "instructions",
        """Counted under valgrind: the same on every run and on a busy machine, so small changes show. `make bench-instructions` compares
with the table that is checked in.""",
        instruction_table,
    ),
    (
        "Settings tried",
        "tune",
        "32 clients, a few seconds each; the fastest of each server and engine is the one measured above.",
        tried_table,
    ),
)


def machine_lines(machine: dict) -> str:
    """What the figures were measured on, in a sentence or two."""
    changed = " with local changes" if machine.get("changed") else ""
    return (
        f"Measured on {machine['cores']:g} cores of {machine['cpu']} ({', '.join(machine['flags']) or 'no vector extensions'}),\n"
        f"{machine['memory_gib']:g} GiB, {machine['system']}, {machine['rustc']}, Python {machine['python']}; commit "
        f"{machine['commit']}{changed}. Pack {machine.get('pack', 'not noted')}."
    )


def measured_apart(store: Store) -> str:
    """What of a part was measured when, where that was not in one go."""
    sittings = store.sittings(LONGEST_PAUSE_S)
    if len(sittings) < 2:
        return ""
    told = "; ".join(f"{_rows(runs)} {_span(runs)}" for runs in sittings)
    return f"Not measured in one go, so the machine may have changed between: {told} (UTC)."


def measured_at(store: Store, machine: dict | None) -> str:
    """The commits whose code a part was measured with, where that is not the one of the page."""
    commits = list(dict.fromkeys(run["commit"] for run in store.data["runs"] if run.get("commit")))
    if not commits or commits == [(machine or {}).get("commit")]:
        return ""
    return f"Measured with the code of {', '.join(commits)}."


def _rows(runs: list[dict]) -> str:
    """The names of what runs measured, or how many there are where they have none."""
    names = []
    for key in (run["key"] for run in runs):
        name = NAMES.get(key.get("target", "")) or key.get("preset") or ENGINES.get(key.get("engine", ""))
        names.append(name.strip("*") if name else "")
    return ", ".join(dict.fromkeys(names)) if all(names) else f"{len(runs)} run{'s' * (len(runs) > 1)}"


def _span(runs: list[dict]) -> str:
    """When the first and the last of runs had their results, of runs by time."""
    first, last = (datetime.fromtimestamp(run["at"], UTC) for run in (runs[0], runs[-1]))
    end = f"{last:%H:%M}" if last.date() == first.date() else f"{last:%Y-%m-%d %H:%M}"
    return f"{first:%Y-%m-%d %H:%M} to {end}"


def write_report(settings: Settings, out: Path, only_measured: bool = False) -> None:
    """Writes the page; a part that was not measured says which command measures it, or is named in one line."""
    parts = [INTRO]
    machine = Store(settings.results, "machine").data.get("machine")
    if machine:
        parts.append(machine_lines(machine))
    if settings.quick:
        parts.append("**A quick look: one short run each. Not the real figures.**")
    told, missing = set(), []
    for title, part, text, table in SECTIONS:
        store = Store(settings.results, part)
        lines = table(store) if store.data["runs"] else []
        if only_measured and not lines:
            missing.append(title)
            continue
        parts.append(f"## {title}")
        if lines:
            notes = (
                []
                if part in told
                else [measured_apart(store), store.data.get("remark", ""), measured_at(store, machine)]
            )
            parts += [text, *notes, "\n".join(lines)]
            told.add(part)
        else:
            parts.append(f"Not measured yet: `make bench PARTS={part}`.")
    if missing:
        parts.append(f"Not measured on this machine: {'; '.join(missing)}.")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("\n\n".join(part.strip("\n") for part in parts if part) + "\n")
