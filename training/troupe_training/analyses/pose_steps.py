"""One to ten passes of the pose module: all tokens at once, or by confidence over a cosine schedule.

At temperature 0, and at temperature 1 with several seeds.
"""

from troupe_training.analyses.common import Line, Panel, Setting, measure, sampled, write
from troupe_training.evaluate import TRUTH, of_networks
from troupe_training.inbetween import Sampling

STEPS = tuple(range(1, 11))
FIGURES = (
    ("fid", "FID"),
    ("foot_skate_m_per_frame", "foot skate (m/frame)"),
    ("joint_jitter_mps2", "joint jitter (m/s²)"),
    ("l2p_m", "L2P (m)"),
)


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
    found: dict[str, list[dict]] = {"temperature 0": [], "temperature 1": []}
    for name, _, seed in cases:
        rows = {str(steps): figures[f"{name}, seed {seed}, {steps}"] for steps in STEPS}
        found[name].append({"seed": seed, "steps": rows})
    panels = []
    for figure, title in FIGURES:
        if figure not in truth:
            continue
        lines = [
            Line(name, list(STEPS), [[run["steps"][str(s)][figure]["mean"] for s in STEPS] for run in runs])
            for name, runs in found.items()
        ]
        level = truth[figure]["mean"] if figure in ("foot_skate_m_per_frame", "joint_jitter_mps2") else None
        panels.append(Panel(title, "pose steps", lines, truth=level))
    report = {"source": setting.source.name, "seeds": setting.seeds, "ground_truth": truth, "runs": found}
    title = f"pose refinement steps, gap of {setting.gap} frames, {setting.source.name}"
    write(setting, "pose-steps", report | setting.conditions(bench), title, panels)
    return True
