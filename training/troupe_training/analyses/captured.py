"""Where a run loses what it loses: tokens and roots as predicted, or as captured, in the same decoder.

Windows are whole tokens long, so that the encoder gives one token for each that the pose module predicts. Needs a run: a
pack has no encoder.
"""

from dataclasses import replace

from troupe_training.analyses.common import Setting, measure, panels_of, write
from troupe_training.analyses.heads_codes import GAP
from troupe_training.data.motion import Motion
from troupe_training.data.store import Segments
from troupe_training.evaluate.bench import Method, Sampling
from troupe_training.evaluate.motionbricks import Keys, decode, make_plan, run_networks
from troupe_training.evaluate.report import TRUTH
from troupe_training.train.motionbricks.tokenizer import TOKENIZER
from troupe_training.train.plots import Line

# Whether tokens and root are the captured motion's.
CASES = {
    "both predicted": (False, False),
    "tokens captured": (True, False),
    "root captured": (False, True),
    "both captured": (True, True),
}
FIGURES = ("fid", "l2p_m", "npss", "foot_skate_m_per_frame")


def run(setting: Setting) -> bool:
    """Measures the four cases; nothing is trained."""
    if not TOKENIZER.path(setting.source).exists():
        raise SystemExit(f"{setting.source} has no tokenizer.pt: captured takes --run, for its encoder")
    bench = setting.bench()
    networks = run_networks(setting.source, bench.store)
    tokenizer = TOKENIZER.load(setting.source, bench.store)

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

    def lines(figure: str) -> list[Line]:
        return [Line(name, [float(i)], [[figures[name][figure]["mean"]]]) for i, name in enumerate(CASES)]

    panels = panels_of(FIGURES, truth, "what the decoder is given", lines)
    cases = {name: figures[name] for name in CASES}
    report = {"source": setting.source.name, "ground_truth": truth, "cases": cases}
    conditions = replace(setting, gap=GAP).conditions(bench)
    title = f"predicted and captured tokens and roots, gap of {GAP} frames, {setting.source.name}"
    write(setting, "captured", report | conditions, title, panels)
    return True
