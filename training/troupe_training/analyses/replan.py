"""Planning again every 1 to 8 frames (paper appendix C, figure 15): roll-outs over test clips to a target keyframe.

From the four context frames a plan is made to the target, its next k frames are played, the last four frames played are
the context of the next plan to the same target, and so on; a plan goes on from its context as in live sessions. When less
than the shortest segment (12 frames) is left, the last plan is played to its end.
"""

import torch
from torch import Tensor

from troupe_training.analyses.common import Setting, measure, panels_of, write
from troupe_training.data.conventions import CONTEXT_FRAMES, MIN_FRAMES
from troupe_training.data.motion import Motion, concatenate, pose_features
from troupe_training.data.roots import local_root_of
from troupe_training.data.rotations import yaw_matrix
from troupe_training.data.store import Segments
from troupe_training.evaluate.bench import Bench, Method, Sampling
from troupe_training.evaluate.motionbricks import Keys, StageNetworks, in_between
from troupe_training.evaluate.pinning import carry_on
from troupe_training.evaluate.report import TRUTH
from troupe_training.train.plots import Line

INTERVALS = tuple(range(1, 9))
FIGURES = ("fid", "target_keyframe_error_m", "joint_jitter_mps2", "foot_skate_m_per_frame")


def moved(motion: Motion, yaw: Tensor, before: Tensor, after: Tensor) -> Motion:
    """Shifted by ``before``, turned by ``yaw`` and shifted by ``after`` (``[B, 3, 3]``, ``[B, 3]`` each)."""
    root = torch.einsum("bij,bnj->bni", yaw, motion.root + before[:, None]) + after[:, None]
    return Motion(root, yaw[:, None, None] @ motion.rotations, motion.contacts)


def keys_of(given: Motion, bench: Bench) -> Keys:
    """The constraints that four context frames and a target, already in their segment frame, make."""
    positions, six_d = pose_features(given, bench.kinematics)
    root = given.global_root(bench.left_axis)
    pose = torch.cat([positions, six_d], -1).flatten(2)
    return Keys(pose, root, local_root_of(root[:, :CONTEXT_FRAMES]))


def plan(
    networks: StageNetworks, bench: Bench, context: Motion, target: Motion, frames: int, sampling: Sampling
) -> Motion:
    """``frames`` frames that go on from the context, of which the first four are it."""
    last = CONTEXT_FRAMES - 1
    heading = context.headings(bench.left_axis)[:, last]
    origin = context.root[:, last] * torch.tensor([1.0, 0.0, 1.0])
    zero = torch.zeros_like(origin)
    given = moved(concatenate([context, target]), yaw_matrix(-heading), -origin, zero)
    made = in_between(networks, keys_of(given, bench), frames, sampling)
    made = moved(made, yaw_matrix(heading), zero, origin)
    return carry_on(made, context, bench.skeleton.parents, bench.left_axis)


def roll_out(networks: StageNetworks, bench: Bench, interval: int | None) -> Method:
    """Plays ``interval`` frames of each plan; None: the first plan to its end."""

    def method(segments: Segments, frames: int, sampling: Sampling) -> Motion:
        truth = Motion.of(segments)
        target = Motion(truth.root[:, -1:], truth.rotations[:, -1:])
        played = Motion(truth.root[:, :CONTEXT_FRAMES], truth.rotations[:, :CONTEXT_FRAMES])
        while played.root.shape[1] < frames:
            done = played.root.shape[1]
            left = frames - done
            context = played.slice(done - CONTEXT_FRAMES, done)
            made = plan(networks, bench, context, target, CONTEXT_FRAMES + left, sampling)
            step = left
            if interval is not None and CONTEXT_FRAMES + left - interval >= MIN_FRAMES:
                step = interval
            played = concatenate([played, made.slice(CONTEXT_FRAMES, CONTEXT_FRAMES + step)])
        return played

    return method


def run(setting: Setting) -> bool:
    """Measures all intervals; nothing is trained."""
    bench = setting.bench()
    networks = setting.networks(bench)
    methods = {str(k): roll_out(networks, bench, k) for k in INTERVALS}
    figures = measure(bench, methods | {"one plan": roll_out(networks, bench, None)}, setting.gap)
    found = {str(k): figures[str(k)] for k in INTERVALS}
    once, truth = figures["one plan"], figures[TRUTH]

    def lines(figure: str) -> list[Line]:
        return [
            Line("replanned", list(INTERVALS), [[found[str(k)][figure]["mean"] for k in INTERVALS]]),
            Line("one plan", list(INTERVALS), [[once[figure]["mean"]] * len(INTERVALS)]),
        ]

    panels = panels_of(FIGURES, truth, "frames between plans", lines)
    report = {"source": setting.source.name, "ground_truth": truth, "intervals": found, "one_plan": once}
    title = f"replan interval, gap of {setting.gap} frames, {setting.source.name}"
    write(setting, "replan", report | setting.conditions(bench), title, panels)
    return True
