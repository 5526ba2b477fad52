"""One to ten passes of the pose module: all tokens at once, or by confidence over a cosine schedule.

At temperature 0, and at temperature 1 with several seeds.
"""

from typing import Any

from troupe_training.analyses.common import Setting, measure, panels_of, sampled, write
from troupe_training.evaluate.bench import Sampling
from troupe_training.evaluate.motionbricks import of_networks
from troupe_training.evaluate.report import TRUTH
from troupe_training.train.plots import Line

STEPS = tuple(range(1, 11))
FIGURES = ("fid", "foot_skate_m_per_frame", "joint_jitter_mps2", "l2p_m")


def run(setting: Setting) -> bool:
    """Measures all step counts; nothing is trained."""
    bench = setting.bench()
    method = of_networks(setting.networks(bench))
    cases = [("temperature 0", 0.0, 0)] + [("temperature 1", 1.0, seed) for seed in setting.seeds]
    methods = {
        f"{name}, seed {seed}, {steps}": sampled(method, Sampling(steps, temperature, seed))
        for name, temperature, seed in cases
        for steps in STEPS
    }
    figures = measure(bench, methods, setting.gap)
    truth = figures[TRUTH]
    found: dict[str, list[dict[str, Any]]] = {"temperature 0": [], "temperature 1": []}
    for name, _, seed in cases:
        rows = {str(steps): figures[f"{name}, seed {seed}, {steps}"] for steps in STEPS}
        found[name].append({"seed": seed, "steps": rows})

    def lines(figure: str) -> list[Line]:
        return [
            Line(name, list(STEPS), [[run["steps"][str(s)][figure]["mean"] for s in STEPS] for run in runs])
            for name, runs in found.items()
        ]

    panels = panels_of(FIGURES, truth, "pose steps", lines)
    report = {"source": setting.source.name, "seeds": setting.seeds, "ground_truth": truth, "runs": found}
    title = f"pose refinement steps, gap of {setting.gap} frames, {setting.source.name}"
    write(setting, "pose-steps", report | setting.conditions(bench), title, panels)
    return True
