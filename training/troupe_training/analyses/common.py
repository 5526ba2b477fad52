"""What the analyses share: their setting, training of variants, measuring, and writing of figures and plots."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch

from troupe_training.config import ModelConfig
from troupe_training.evaluate import Bench, Method, Options, check_gap, measure_gap, summarise
from troupe_training.features import ClipStore
from troupe_training.inbetween import Sampling, open_networks
from troupe_training.stages import train_stage
from troupe_training.trainer import Budget

LEARNING_RATE = 5e-4


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
        options = Options(
            [self.gap], self.stride, self.split, diversity_seeds=0, max_windows=self.max_windows
        )
        return Bench(self.cache, options, self.evaluator, self.threads)

    def networks(self, bench: Bench):
        """The trained networks that are analysed."""
        return open_networks(self.source, bench.store, self.threads)

    def budget(self) -> dict:
        """What figures and plots say of it."""
        spent = {"updates": self.steps} if self.steps else {"minutes": self.minutes}
        return spent | {"frames_per_update": self.frames_per_step, "seeds": self.seeds}

    def conditions(self, bench: Bench) -> dict:
        """What figures and plots say of the windows."""
        frames = check_gap(self.gap)
        return {
            "split": self.split,
            "gap_frames": self.gap,
            "stride_frames": self.stride,
            "windows": len(bench.windows(frames)[0]),
        }


def train_variant(setting: Setting, stage: str, run: Path, config: ModelConfig, seed: int) -> bool:
    """Trains one stage of one variant, or goes on with it; false where it was stopped."""
    torch.set_num_threads(setting.threads)
    minutes = None if setting.steps else setting.minutes
    budget = Budget(minutes=minutes, steps=setting.steps, learning_rate=LEARNING_RATE)
    return train_stage(
        stage, setting.cache, run, config, budget, setting.frames_per_step, seed, setting.device
    )


def curve(run: Path, stage: str, term: str) -> tuple[list[int], list[float]]:
    """Steps and values of one term of a stage's history."""
    history = json.loads((run / f"{stage}.json").read_text())["history"]
    return [h["step"] for h in history], [h[term] for h in history]


def measure(bench: Bench, methods: dict[str, Method], gap: int) -> dict[str, dict[str, dict]]:
    """Every figure of every method, and of ground truth, with its interval."""
    return summarise(measure_gap(bench, methods, set(), gap))


def sampled(method: Method, sampling: Sampling) -> Method:
    """The method with a choice of tokens of its own."""
    return lambda segments, frames, _: method(segments, frames, sampling)


def mean_loss(loss_fn: Callable, model: torch.nn.Module, batches: int, seed: int = 99) -> dict[str, float]:
    """A training loss on another split, in the mean over random batches."""
    generator = torch.Generator().manual_seed(seed)
    sums: dict[str, float] = {}
    with torch.no_grad():
        for _ in range(batches):
            for name, value in loss_fn(model, generator, 0.0).items():
                sums[name] = sums.get(name, 0.0) + float(value) / batches
    return sums | {"total": sum(v for n, v in sums.items() if not n.startswith("_"))}


def test_store(setting: Setting) -> ClipStore:
    """The clips that are measured on."""
    return ClipStore(setting.cache, setting.split)


@dataclass
class Line:
    """One line of a panel; with several seeds ``values`` holds a row for each, and their range is shaded."""

    label: str
    x: list[float]
    values: list[list[float]]


@dataclass
class Panel:
    """One plot of a figure."""

    title: str
    x_label: str
    lines: list[Line]
    log: bool = False
    truth: float | None = None  # ground truth's value, as a dashed line


def draw(out: Path, title: str, panels: list[Panel]) -> None:
    """Panels side by side under a title."""
    figure, axes = plt.subplots(1, len(panels), figsize=(4.6 * len(panels), 4.0), squeeze=False)
    for axis, panel in zip(axes[0], panels, strict=True):
        for line in panel.lines:
            rows = np.array(line.values, dtype=float)
            (drawn,) = axis.plot(
                line.x, rows.mean(0), marker="o" if len(line.x) < 20 else None, label=line.label
            )
            if len(rows) > 1:
                axis.fill_between(line.x, rows.min(0), rows.max(0), alpha=0.2, color=drawn.get_color(), lw=0)
        if panel.truth is not None:
            axis.axhline(panel.truth, color="grey", ls="--", lw=1.0, label="ground truth")
        if panel.log:
            axis.set_yscale("log")
        axis.set_title(panel.title, fontsize=10)
        axis.set_xlabel(panel.x_label)
        axis.grid(alpha=0.25)
        axis.legend(fontsize=7)
    figure.suptitle(title, fontsize=10)
    figure.tight_layout()
    figure.savefig(out, dpi=110)
    plt.close(figure)


def write(setting: Setting, name: str, report: dict, title: str, panels: list[Panel]) -> None:
    """``NAME.json`` and ``NAME.png`` in the output folder."""
    setting.out.mkdir(parents=True, exist_ok=True)
    (setting.out / f"{name}.json").write_text(json.dumps({"analysis": name} | report, indent=1) + "\n")
    draw(setting.out / f"{name}.png", title, panels)
    print(f"{setting.out / name}.json, {setting.out / name}.png")


def budget_text(setting: Setting) -> str:
    """The training budget in a plot's title."""
    spent = f"{setting.steps} updates" if setting.steps else f"{setting.minutes:g} min"
    return f"{spent} a stage and variant on {setting.threads} threads, {len(setting.seeds)} seed(s)"
