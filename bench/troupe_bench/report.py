"""Writes docs/benchmarks.md from the figures of all machines."""

import json
from pathlib import Path
from typing import Any

from troupe_bench import report_tables as tables
from troupe_bench.figures import FOLDER, digest, keep, machines, name_of
from troupe_bench.machine import ROOT
from troupe_bench.settings import Settings

INTRO = """# Benchmarks

Written by `make bench` from [bench/figures](../bench/figures), one file for each machine. [How it is measured](../bench/README.md).

- Cells are medians. Brackets hold the least and the most.
- A ratio is the median of the ratios of single turns.
- *Bar* is the goal that we set.
- *f32* is ONNX Runtime's CPU engine. *bf16* is OpenVINO.
- A machine's figures are of the commit and the pack that the first table names, if no note says otherwise.
- A GPU is on [another page](engines.md#a-gpu)."""

SECTIONS = (
    (
        "How many frames a second?",
        "serving",
        """Segments of 64 frames. All targets load the same pack and the same ONNX Runtime library, and take turns.
Each client waits for its answer before it sends its next request. Clients and server share the machine.

The raw loop calls the three networks without a server. No server with the same allocator, the C library's or jemalloc, can be faster.
LitServe and FastAPI run with the fastest [settings](#which-settings-of-the-python-servers-were-tried) of those that were tried. They read and
write raw arrays. They do not check requests, convert frames, pin keyframes or hold feet.""",
        tables.throughput,
    ),
    (
        "How long does a request take?",
        "serving",
        "p50 / p99 in ms of the same runs. Rows of the raw loop are single calls of the networks.",
        tables.latency,
    ),
    ("How does that compare with the raw loop, LitServe and FastAPI?", "serving", "", tables.ratios),
    (
        "Where does the time of a request go?",
        "serving",
        "Mean ms of a request, by the client's clock and the server's metrics. The time of a stage is that of its whole batch.",
        tables.split,
    ),
    (
        "And with segments of different lengths?",
        "mixed",
        "12 to 64 frames, 32 clients: frames/s (p50 / p99 in ms).",
        tables.mixed,
    ),
    (
        "Do live characters keep up?",
        "live",
        """One Drive stream at 30 Hz for five minutes. Each character gets a new command every 2.5 s. The lateness of a tick is counted
from the earliest tick.""",
        tables.live,
    ),
    (
        "What happens in an overload?",
        "overload",
        """Single requests of 64 frames at five times the capacity, for two minutes (Poisson arrivals, open loop). 50 live characters
run beside them. The load is 90 % of the capacity before the overload, and 50 % after it. Server and load tester share the cores, so
refusals take time from answers ([more](loadtest.md#an-overload)).""",
        tables.overload,
    ),
    (
        "How fast is motion of words?",
        "words",
        """`models/vermo` in f32: 25 sentences, 60 to 180 frames each, with the pack's own sampling. Each client waits for its answer before it sends
its next request. Both servers load the same graphs and the same ONNX Runtime library, and have a network thread for each core. Times are
p50 / p99 in ms. CPU seconds are those of the server alone. Troupe's queue has no time limit here, because FastAPI's has none.

[Troupe](words.md) generates all requests together, and sends JSON with rotations of joints and contacts. FastAPI generates each request
alone, with its own key-value cache, in a pool of threads, with the fastest [settings](#which-settings-of-fastapi-were-tried-for-words) of
those that were tried. It sends the decoder's raw arrays. *In parts* it decodes while tokens come, as Troupe does. *At the end* it decodes
once.""",
        tables.words,
    ),
    ("How does that compare with FastAPI?", "words", "", tables.words_ratios),
    (
        "Which settings of FastAPI were tried for words?",
        "words",
        """With 32 requests at once, frames in parts. The fastest by tokens/s was measured above. `cache_unit`: the language model reads the filled
columns of the cache, rounded up to a multiple of this number (16 if not named; 128 is all).""",
        tables.words_tuned,
    ),
    (
        "What is the ceiling?",
        "ceiling",
        """Operations of a segment of 64 frames: two for each multiplication in matrix products and convolutions. The peak is the
machine's best of three shapes of large matrix products through the same engine. The last column is the speed if the networks did nothing
but products at that peak.""",
        tables.ceiling,
    ),
    (
        "Where does the networks' time go?",
        "operators",
        """One thread, 16 segments of 64 frames, from the engines' own counters. *Moves* are reordering, slicing, gathering and padding.
The last column is the rate of the products; the ceiling above is for all cores and large products.""",
        tables.operators,
    ),
    (
        "How fast are networks of the paper's size?",
        "paper",
        """The raw loop on packs with random weights (`troupe-train random-pack`), 64 frames a segment. `paper` has the parameter counts
of the paper's section 7.4. `paper-wide` has the layer widths that the paper states, which give more parameters. *Alone* is one worker with
all cores and one segment a call. The paper reports 15,000 frames/s and 2 ms on an RTX 5090.""",
        tables.paper,
    ),
    (
        "How fast is NVIDIA's own code?",
        "official",
        """NVIDIA's public MotionBricks code in PyTorch on a CPU, beside a server with a pack of the same weights
([how it is made](../training/README.md#nvidias-networks)). Before it is measured, both must give the same answers within 1e-4. Each
plan has four context frames, four targets and one pass of the pose network. Troupe's figures are for whole requests over gRPC; client and
server share the cores.

As published, the code computes in f32 and takes one plan a call. Its answers have 64 frames, of which those that were asked for count. *Changed* is our work: what batches of plans
and bf16 need, and nothing else. Troupe's queue has no time limit here, because NVIDIA's code has none. Its networks have 6 GiB in bf16,
which more than fits all sizes.

With random weights nothing can be said about the accuracy of bf16: the [check](engines.md#the-accuracy-check) is reported and not enforced.
If the published weights do not pass it, a server with `engine = "auto"` takes f32.""",
        tables.official,
    ),
    (
        "How does that compare with Troupe?",
        "official",
        """Ratios within each turn; *frames/s* are those of 32 clients. Troupe in f32 is beside NVIDIA's code in f32, and Troupe in bf16 beside both
precisions.

**Both bars are missed.** On the same two cores both sides compute the same products: 25 times as many frames would need an advantage that
is not there. Alone, a plan reads all of the networks' 182 million weights once: 0.7 GB in f32, and half of that in bf16. Weights of 8 bits would
move it. At saturation the server once had batches of one or two, because it kept them below 66 ms; batches of eight made it 1.4 to 1.9 times as fast
(one run after the other, not in turns). More cores and a GPU would move the rest.""",
        tables.official_ratios,
    ),
    ("What does an idle server take?", "idle", "", tables.idle),
    (
        "What do the server's own parts take?",
        "micro",
        "Criterion, one core. Besides queue and networks, the server's own work is `prepare` and `finish`.",
        tables.micro,
    ),
)

TUNED = (
    "Which settings of the Python servers were tried?",
    "tune",
    "Frames/s with 32 clients over a few seconds. The fastest of each server, engine and machine was measured above.",
    tables.tune,
)

INSTRUCTIONS = """## How many instructions does the hot loop take?

Counted under valgrind, so they are the same on every run and on a busy machine. The table is
[bench/instructions.json](../bench/instructions.json); `make bench-instructions` compares with it."""


def machine_table(found: list[dict[str, Any]]) -> list[str]:
    """The machines and their parts, with the code and pack of each."""
    rows = []
    for machine in found:
        facts, main = machine["machine"], main_part(machine)
        rustc = " ".join(facts.get("rustc", "rustc –").split()[:2])
        rows.append(
            [
                machine["title"],
                f"{facts.get('cores', 0):g} cores of {facts.get('cpu', 'an unknown processor')}",
                ", ".join(facts.get("flags", [])) or "–",
                f"{facts.get('memory_gib', 0):g} GiB",
                f"{facts.get('system', '–')}, {rustc}, Python {facts.get('python', '–')}",
                main.get("code") or "–",
                main.get("pack") or "–",
                main.get("measured", "–"),
            ]
        )
    return tables.table(["machine", "processor", "extensions", "memory", "software", "commit", "pack", "date"], rows, 8)


def main_part(machine: dict[str, Any]) -> dict[str, Any]:
    """The part whose commit and pack are in the table of machines."""
    parts = machine["parts"]
    return parts.get("serving") or next(iter(parts.values()), {})


def notes(found: list[dict[str, Any]], part: str) -> list[str]:
    """Remarks on one part, for each machine that has any."""
    lines = []
    for machine in found:
        figures, main = machine["parts"].get(part), main_part(machine)
        if not figures:
            continue
        remarks = list(figures.get("notes", []))
        differs = [name for name in ("code", "pack") if figures.get(name) and figures[name] != main.get(name)]
        if differs:
            remarks.append(f"measured with {' and '.join(figures[name] for name in differs)} on {figures['measured']}")
        lines += [f"- {machine['title']}: {note}." for note in remarks]
    return lines


def page(found: list[dict[str, Any]], quick: bool = False) -> str:
    """The text of the page. A part that no machine has names the command that measures it."""
    blocks = [INTRO, "\n".join(machine_table(found))]
    blocks += [f"{machine['title']}: {machine['remark']}" for machine in found if machine.get("remark")]
    if quick:
        blocks.append("**A quick look: one short run each. Not the real figures.**")
    noted = set()
    for title, part, text, table in (*SECTIONS, TUNED):
        if part == "tune":
            blocks += [INSTRUCTIONS, "\n".join(instruction_table())]
        lines = table(found)
        body = [text, "\n".join(lines)] if lines else [f"Not measured yet: `make bench PARTS={part}`."]
        if lines and part not in noted:
            body.append("\n".join(notes(found, part)))
            noted.add(part)
        blocks += [f"## {title}", *body]
    return "\n\n".join(block.strip("\n") for block in blocks if block) + "\n"


def instruction_table() -> list[str]:
    """The counts that are checked in."""
    counts = json.loads((ROOT / "bench" / "instructions.json").read_text())
    return tables.table(["bench", "instructions"], [[f"`{name}`", tables.number(n)] for name, n in counts.items()])


def write_report(settings: Settings, out: Path, name: str = "", folder: Path = FOLDER) -> None:
    """Keeps the figures of this machine and writes the page of all. A quick look has a page of its own."""
    figures = digest(settings)
    name = name or name_of(figures["machine"].get("cpu", ""))
    if settings.quick:
        found = [{"title": name} | figures]
    else:
        if figures["parts"]:
            keep(figures, name, folder)
        found = machines(folder)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page(found, settings.quick))
