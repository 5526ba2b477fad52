"""How long and how often everything is measured, and which settings of the Python servers are tried."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from troupe_bench.machine import ROOT, cores
from troupe_bench.programs import HOME
from troupe_bench.store import Json

PAUSE_US = 600
"""How long the raw loop pauses between calls in one of its measurements: what a request's way to the client and back takes
at least."""

JEMALLOC = "raw-jemalloc"
"""The raw loop with the allocator of the server."""
RAW_LOOPS = ("raw", JEMALLOC)

CROWD = "troupe-crowd"
"""The server with requests of several characters, as game servers send them."""
CROWD_SIZE = 16
CROWD_CLIENTS = 8

OFFICIAL_LENGTHS = (40, 64)
"""Frames of a plan. The public code computes 64 for each."""
OFFICIAL_BATCH = 16
OFFICIAL_WAYS: dict[str, tuple[str, ...]] = {
    "alone": (),
    "processes": (),
    "alone-bf16": ("--bf16",),
    "batched": ("--batch", str(OFFICIAL_BATCH)),
    "batched-bf16": ("--batch", str(OFFICIAL_BATCH), "--bf16"),
}
"""Ways of the public code with their options. `processes` has a process a core, the others one process with all cores. Options
change the code."""


@dataclass
class Settings:
    """One run of the benchmarks."""

    quick: bool = False
    repeats: int = 5
    warmup_s: float = 2.0
    measured_s: float = 8.0
    raw_s: float = 3.0
    tune_s: float = 5.0
    idle_s: float = 30.0
    idle_sessions: int = 10_000
    live_characters: int = 400
    live_s: float = 300.0
    overload_s: float = 120.0
    clients: tuple[int, ...] = (1, 32, 128)
    request_count: int = 64
    engines: tuple[str, ...] = ("cpu", "openvino-bf16")
    pack: Path = ROOT / "models" / "human"
    words_clients: tuple[int, ...] = (1, 8, 32)
    words_pack: Path = ROOT / "models" / "vermo"
    official: Path | None = None
    official_warmup_s: float = 15.0  # OpenVINO takes seconds to open networks so large for another size of batch
    results: Path = field(default=HOME / "results")
    train_python: Path = ROOT / ".venv" / "bin" / "python"

    def shorten(self) -> None:
        """A look in a few minutes: figures are rough, and kept apart from the full ones."""
        self.quick, self.repeats, self.results = True, 1, HOME / "results-quick"
        self.warmup_s, self.measured_s, self.raw_s, self.tune_s = 1.0, 3.0, 0.5, 2.0
        self.idle_s, self.idle_sessions, self.clients = 5.0, 500, (1, 32)
        self.live_characters, self.live_s, self.overload_s = 100, 10.0, 10.0
        self.words_clients, self.official_warmup_s = (1, 8), 5.0


def python_settings(kind: str, quick: bool) -> list[Json]:
    """Settings to try for a Python server. The fastest at 32 clients is measured."""
    many = max(1, math.floor(cores()))
    if kind == "words":
        tried = [
            {"workers": many, "threads": 1, "pool": 1},
            {"workers": 1, "threads": 1, "pool": many},
            {"workers": many, "threads": 1, "pool": 2},
            {"workers": 1, "threads": 1, "pool": 32},
            {"workers": many, "threads": 1, "pool": 16},
            {"workers": 1, "threads": many, "pool": 1},
            {"workers": 1, "threads": many, "pool": 1, "no_spin": True},
            {"workers": many, "threads": 1, "pool": 1, "cache_unit": 128},
            {"workers": many, "threads": 1, "pool": 1, "cache_unit": 1},
        ]
    elif kind == "fastapi":
        tried = [
            {"workers": 1, "threads": 1, "pool": many},
            {"workers": 1, "threads": 1, "pool": 2 * many},
            {"workers": many, "threads": 1, "pool": 1},
            {"workers": many, "threads": 1, "pool": 2},
            {"workers": 1, "threads": many, "pool": 1},
            {"workers": 1, "threads": many, "pool": 1, "no_spin": True},
            {"workers": 1, "threads": many, "pool": 2, "no_spin": True},
        ]
    else:
        workers: Json = {"workers": many, "threads": 1, "max_batch": 64}
        tried = [
            workers | {"batch_timeout": 0.002, "fast_queue": True},
            workers | {"batch_timeout": 0.002},
            workers | {"batch_timeout": 0.0005, "fast_queue": True},
            workers | {"batch_timeout": 0.01, "fast_queue": True},
            workers | {"batch_timeout": 0.03, "fast_queue": True},
            workers | {"batch_timeout": 0.002, "fast_queue": True, "api_servers": many},
            workers | {"batch_timeout": 0.01, "fast_queue": True, "max_batch": 16},
            workers | {"workers": 1, "threads": many, "batch_timeout": 0.002, "fast_queue": True},
            workers | {"workers": 1, "threads": many, "batch_timeout": 0.01, "fast_queue": True},
        ]
    unique = [settings for index, settings in enumerate(tried) if settings not in tried[:index]]
    return unique[:2] if quick else unique
