"""Shared by the analyses: their setting, training of variants, measuring, and writing of figures and plots."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import torch

from troupe_training.evaluate.bench import Bench, Method, Options, Sampling, check_gap
from troupe_training.evaluate.motionbricks import StageNetworks, open_networks
from troupe_training.evaluate.report import measure_gap, summarise
from troupe_training.evaluate.tables import Figure, Methods
from troupe_training.models.motionbricks.config import ModelConfig
from troupe_training.train.motionbricks.stages import train_stage
from troupe_training.train.plots import Line, Panel, draw
from troupe_training.train.trainer import Budget, Job, Loss

LEARNING_RATE = 5e-4
TITLES = {
    "fid": "FID",
    "l2p_m": "L2P (m)",
    "npss": "NPSS",
    "foot_skate_m_per_frame": "foot skate (m/frame)",
    "joint_jitter_mps2": "joint jitter (m/s²)",
    "reached": "target root reached (share)",
    "target_keyframe_error_m": "target joints, worst (m)",
}
TRUTH_DRAWN = ("foot_skate_m_per_frame", "joint_jitter_mps2")  # where ground truth has a level of its own
M = TypeVar("M", bound=torch.nn.Module)


@dataclass
class Setting:
    """Where an analysis reads and writes, and how much it may spend."""

    cache: Path
    out: Path
    source: Path  # folder of a pack or of a run's checkpoints
    evaluator: Path | None = None
    minutes: float = 4.0  # of training, for each stage of each variant and seed
    steps: int | None = None  # updates instead, for tests
    seeds: list[int] = field(default_factory=lambda: [1])
    preset: ModelConfig = field(default_factory=ModelConfig)
    frames_per_step: int = 4096
    gap: int = 30
    stride: int = 20
    max_windows: int | None = 400
    split: str = "test"
    threads: int = 2
    device: str = "cpu"

    def bench(self) -> Bench:
        """The windows to measure on; no diversity."""
        options = Options([self.gap], self.stride, self.split, diversity_seeds=0, max_windows=self.max_windows)
        return Bench(self.cache, options, self.evaluator, self.threads)

    def networks(self, bench: Bench) -> StageNetworks:
        """The trained networks that are analysed."""
        return open_networks(self.source, bench.store, self.threads)

    def budget(self) -> dict[str, Any]:
        """Its label in figures and plots."""
        spent: dict[str, Any] = {"updates": self.steps} if self.steps else {"minutes": self.minutes}
        return spent | {"frames_per_update": self.frames_per_step, "seeds": self.seeds}

    def conditions(self, bench: Bench) -> dict[str, Any]:
        """The windows' label in figures and plots."""
        frames = check_gap(self.gap)
        return {
            "split": self.split,
            "gap_frames": self.gap,
            "stride_frames": self.stride,
            "windows": len(bench.windows(frames)[0]),
        }


def train_variant(setting: Setting, stage: str, run: Path, config: ModelConfig, seed: int) -> bool:
    """Trains one stage of one variant, or goes on with it; false if it was stopped."""
    torch.set_num_threads(setting.threads)
    minutes = None if setting.steps else setting.minutes
    budget = Budget(minutes=minutes, steps=setting.steps, learning_rate=LEARNING_RATE)
    job = Job(setting.cache, run, budget, setting.frames_per_step, seed, setting.device)
    return train_stage(stage, job, config)


def curve(run: Path, stage: str, term: str) -> tuple[list[int], list[float]]:
    """Steps and values of one term of a stage's history."""
    history = json.loads((run / f"{stage}.json").read_text())["history"]
    return [h["step"] for h in history], [h[term] for h in history]


def measure(bench: Bench, methods: dict[str, Method], gap: int) -> Methods:
    """Every figure of every method, and of ground truth, with its interval."""
    return summarise(measure_gap(bench, methods, set(), gap))


def sampled(method: Method, sampling: Sampling) -> Method:
    """The method with a choice of tokens of its own."""
    return lambda segments, frames, _: method(segments, frames, sampling)


def mean_loss(loss_fn: Loss[M], model: M, batches: int, seed: int = 99) -> dict[str, float]:
    """A training loss on another split, in the mean over random batches."""
    generator = torch.Generator().manual_seed(seed)
    sums: dict[str, float] = {}
    with torch.no_grad():
        for _ in range(batches):
            for name, value in loss_fn(model, generator, 0.0).items():
                sums[name] = sums.get(name, 0.0) + float(value) / batches
    return sums | {"total": sum(v for n, v in sums.items() if not n.startswith("_"))}


def panels_of(
    names: Sequence[str], truth: dict[str, Figure], x_label: str, lines: Callable[[str], list[Line]]
) -> list[Panel]:
    """A panel for each figure of `TITLES` in ``names`` that was measured; ``lines`` draws one by its name."""
    return [
        Panel(TITLES[name], x_label, lines(name), truth=truth[name]["mean"] if name in TRUTH_DRAWN else None)
        for name in names
        if name in truth
    ]


def write(setting: Setting, name: str, report: dict[str, Any], title: str, panels: list[Panel]) -> None:
    """``NAME.json`` and ``NAME.png`` in the output folder."""
    setting.out.mkdir(parents=True, exist_ok=True)
    (setting.out / f"{name}.json").write_text(json.dumps({"analysis": name} | report, indent=1) + "\n")
    draw(setting.out / f"{name}.png", title, panels)
    print(f"{setting.out / name}.json, {setting.out / name}.png")


def budget_text(setting: Setting) -> str:
    """The training budget in a plot's title."""
    spent = f"{setting.steps} updates" if setting.steps else f"{setting.minutes:g} min"
    return f"{spent} a stage and variant on {setting.threads} threads, {len(setting.seeds)} seed(s)"
