"""Plots as PNG: panels of lines side by side, and a run's loss curves."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure


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
    figure = Figure(figsize=(4.6 * len(panels), 4.0))
    axes = figure.subplots(1, len(panels), squeeze=False)
    for axis, panel in zip(axes[0], panels, strict=True):
        for line in panel.lines:
            rows = np.array(line.values, dtype=float)
            (drawn,) = axis.plot(line.x, rows.mean(0), marker="o" if len(line.x) < 20 else None, label=line.label)
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


def plot_curves(run: Path, stages: Sequence[str], out: Path) -> bool:
    """Draws every term of those ``stages`` that have a history in ``run``; false, and no file, if none has."""
    panels = []
    for path in (run / f"{stage}.json" for stage in stages):
        curve = json.loads(path.read_text()) if path.exists() else {"history": []}
        if history := curve["history"]:
            steps = [entry["step"] for entry in history]
            names = [name for name in history[-1] if name != "step" and not name.startswith("_")]
            lines = [Line(name, steps, [[entry.get(name, np.nan) for entry in history]]) for name in names]
            title = f"{path.stem}: {curve['step']} steps, {curve['seconds'] / 60:.0f} min"
            panels.append(Panel(title, "step", lines, log=True))
    if panels:
        draw(out, run.name, panels)
    return bool(panels)
