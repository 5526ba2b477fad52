"""Loss curves of a run as PNG, one panel a stage."""

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from troupe_training.stages import BASELINES, STAGES


def histories_of(run: Path) -> dict[str, dict]:
    """Steps, seconds and history of every stage of ``run`` that has a history."""
    paths = {stage: Path(run) / f"{stage}.json" for stage in STAGES + BASELINES}
    found = {stage: json.loads(path.read_text()) for stage, path in paths.items() if path.exists()}
    return {stage: data for stage, data in found.items() if data["history"]}


def plot_curves(run: Path, out: Path) -> None:
    """Draws every term of every stage that has a history in ``run``."""
    histories = histories_of(run)
    if not histories:
        raise SystemExit(f"no training history under {run}")
    figure, axes = plt.subplots(1, len(histories), figsize=(5.2 * len(histories), 4), squeeze=False)
    for axis, (stage, data) in zip(axes[0], histories.items(), strict=True):
        history = data["history"]
        steps = [h["step"] for h in history]
        for name in [k for k in history[-1] if k != "step" and not k.startswith("_")]:
            values = [h.get(name, float("nan")) for h in history]
            axis.plot(steps, values, lw=2.0 if name == "total" else 0.9, label=name)
        axis.set_yscale("log")
        axis.set_title(f"{stage}: {data['step']} steps, {data['seconds'] / 60:.0f} min")
        axis.set_xlabel("step")
        axis.grid(alpha=0.25)
        axis.legend(fontsize=7, ncol=2)
    figure.tight_layout()
    figure.savefig(out, dpi=110)
    plt.close(figure)
