"""Root trajectories drawn out or together under the same tokens, with and without keyframes (paper figure 14).

The predicted tokens stay; from the last context frame on the predicted root's way over the ground is multiplied by a
ratio, and with it the place of the target. Precision is measured against the moved target, FID against the windows as they
were captured.
"""

from dataclasses import replace

import torch
from torch import Tensor

from troupe_training.analyses.common import Setting, panels_of, write
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.evaluate.bench import Bench, Sampling, check_gap
from troupe_training.evaluate.motionbricks import Keys, Plan, StageNetworks, decode, make_plan
from troupe_training.evaluate.report import TRUTH, Arrays, Found, glue, summarise
from troupe_training.evaluate.tables import Methods
from troupe_training.train.plots import Line

RATIOS = (0.8, 0.9, 1.0, 1.1, 1.2)
FIGURES = ("fid", "reached", "foot_skate_m_per_frame", "target_keyframe_error_m")


def drawn_out(root: Tensor, ratio: float) -> Tensor:
    """Roots ``[B, N, 3 or 5]`` whose way over the ground since the last context frame is ``ratio`` times as long."""
    last = CONTEXT_FRAMES - 1
    ground = torch.zeros(root.shape[-1])
    ground[[0, 2]] = 1.0
    way = (root - root[:, last : last + 1]) * ground
    out = root + (ratio - 1.0) * way
    return torch.cat([root[:, :CONTEXT_FRAMES], out[:, CONTEXT_FRAMES:]], 1)


def override(plan: Plan, ratio: float, keyframes: bool) -> Plan:
    """The plan with another root, and without pose keyframes for the decoder if so asked."""
    mask = plan.frame_mask if keyframes else torch.zeros_like(plan.frame_mask)
    pose = plan.frame_pose * mask[..., None]
    return replace(plan, global_root=drawn_out(plan.global_root, ratio), frame_pose=pose, frame_mask=mask)


def measure(bench: Bench, networks: StageNetworks, gap: int) -> Methods:
    """Figures of ground truth and for each ratio, with and without keyframes."""
    frames = check_gap(gap)
    starts, pieces = bench.windows(frames)
    cases = [(ratio, keyframes) for keyframes in (True, False) for ratio in RATIOS]
    parts: dict[tuple[float, bool], list[Arrays]] = {case: [] for case in cases}
    truths: list[Arrays] = []
    for segments, headings in bench.segments(starts, frames, "root interpolation"):
        truth = Motion.of(segments)
        truths.append(bench.measure(truth, truth, headings))
        plan = make_plan(networks, Keys.of(segments, frames), frames, Sampling())
        for ratio, keyframes in cases:
            made = decode(networks, override(plan, ratio, keyframes))
            goal = Motion(drawn_out(truth.root, ratio), truth.rotations)
            parts[ratio, keyframes].append(bench.measure(made, goal, headings))
    found = {TRUTH: Found(glue(truths), pieces.numpy())}
    for (ratio, keyframes), chunks in parts.items():
        found[_key(ratio, keyframes)] = Found(glue(chunks), pieces.numpy())
    return summarise(found)


def _key(ratio: float, keyframes: bool) -> str:
    return f"{ratio} {'with' if keyframes else 'without'} keyframes"


def run(setting: Setting) -> bool:
    """Measures all ratios; nothing is trained."""
    bench = setting.bench()
    figures = measure(bench, setting.networks(bench), setting.gap)
    truth = figures[TRUTH]
    found = {
        "with keyframes" if keyframes else "without keyframes": {
            str(ratio): figures[_key(ratio, keyframes)] for ratio in RATIOS
        }
        for keyframes in (True, False)
    }

    def lines(figure: str) -> list[Line]:
        return [
            Line(name, list(RATIOS), [[rows[str(r)][figure]["mean"] for r in RATIOS]]) for name, rows in found.items()
        ]

    panels = panels_of(FIGURES, truth, "root interpolation ratio", lines)
    report = {"source": setting.source.name, "ground_truth": truth, "ratios": found}
    title = f"root interpolation, gap of {setting.gap} frames, {setting.source.name}"
    write(setting, "root-interpolation", report | setting.conditions(bench), title, panels)
    return True
