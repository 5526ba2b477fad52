"""Where a run loses what it loses: tokens and roots as predicted, or as captured, in the same decoder.

Windows are whole tokens long, so that the encoder gives one token for each that the pose module predicts. Needs a run: a
pack has no encoder.
"""

from dataclasses import replace
from pathlib import Path

from troupe_training.analyses.common import Line, Panel, Setting, measure, write
from troupe_training.analyses.heads_codes import GAP
from troupe_training.evaluate import TRUTH, Method
from troupe_training.features import Segments
from troupe_training.inbetween import Keys, RunNetworks, Sampling, decode, make_plan
from troupe_training.motion import Motion
from troupe_training.stages import load

# Whether tokens and root are the captured motion's.
CASES = {
    "both predicted": (False, False),
    "tokens captured": (True, False),
    "root captured": (False, True),
    "both captured": (True, True),
}
FIGURES = (
    ("fid", "FID"),
    ("l2p_m", "L2P (m)"),
    ("npss", "NPSS"),
    ("foot_skate_m_per_frame", "foot skate (m/frame)"),
)


def run(setting: Setting) -> bool:
    """Measures the four cases; nothing is trained."""
    if not (Path(setting.source) / "tokenizer.pt").exists():
        raise SystemExit(f"{setting.source} has no tokenizer.pt: captured takes --run, for its encoder")
    bench = setting.bench()
    networks = RunNetworks(setting.source, bench.store)
    tokenizer = load(setting.source, "tokenizer", bench.store)

    def with_captured(tokens: bool, root: bool) -> Method:
        def method(segments: Segments, frames: int, sampling: Sampling) -> Motion:
            plan = make_plan(networks, Keys.of(segments, frames), frames, sampling)
            if tokens:
                plan = replace(plan, tokens=tokenizer.quantizer.tokens(tokenizer.encode(segments.pose)))
            if root:
                plan = replace(plan, global_root=segments.global_root)
            return decode(networks, plan)

        return method

    figures = measure(bench, {name: with_captured(*case) for name, case in CASES.items()}, GAP)
    truth = figures[TRUTH]
    panels = [
        Panel(
            title,
            "what the decoder is given",
            [Line(name, [float(i)], [[figures[name][figure]["mean"]]]) for i, name in enumerate(CASES)],
            truth=truth[figure]["mean"] if figure == "foot_skate_m_per_frame" else None,
        )
        for figure, title in FIGURES
        if figure in truth
    ]
    cases = {name: figures[name] for name in CASES}
    report = {"source": setting.source.name, "ground_truth": truth, "cases": cases}
    conditions = replace(setting, gap=GAP).conditions(bench)
    title = f"predicted and captured tokens and roots, gap of {GAP} frames, {setting.source.name}"
    write(setting, "captured", report | conditions, title, panels)
    return True
