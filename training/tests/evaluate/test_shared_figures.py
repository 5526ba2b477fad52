"""Python's measures and pinning against Rust's: one small motion with its figures, which both test suites compute.

`motion/tests/shared_figures.rs` reads the same file. `TROUPE_WRITE_FIGURES=1` writes it again from Python.
"""

import json
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.limits import FIGURES, Frames, frame_figures, limits_of, reach
from troupe_training.data.motion import Motion, local_rotations, world_rotations
from troupe_training.data.rotations import matrix_to_quat, quat_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.evaluate.metrics import window_figures
from troupe_training.evaluate.pinning import pin

SHARED = Path(__file__).parents[3] / "motion" / "tests" / "shared_figures.json"
FRAMES = 20
REACHES = ("root_reach_m", "turn_reach_rad", "pose_reach_m")
SKELETON = Skeleton(
    names=["Hips", "Spine", "Leg_L", "Foot_L", "Toes_L", "Leg_R", "Foot_R", "Toes_R"],
    parents=[-1, 0, 0, 2, 3, 0, 5, 6],
    offsets=[
        [0.0, 0.0, 0.0],
        [0.0, 0.4, 0.0],
        [0.1, 0.0, 0.0],
        [0.0, -0.9, 0.0],
        [0.0, -0.05, 0.12],
        [-0.1, 0.0, 0.0],
        [0.0, -0.9, 0.0],
        [0.0, -0.05, 0.12],
    ],
    left_axis=[1.0, 0.0, 0.0],
    contact_joints=[3, 4, 6, 7],
    contact_max_height_m=[0.12, 0.06, 0.12, 0.06],
    contact_max_speed_mps=0.4,
    contact_clearance_m=[0.07, 0.02, 0.07, 0.02],
)


def turn(axis: int, angle: torch.Tensor) -> torch.Tensor:
    quat = torch.zeros(*angle.shape, 4)
    quat[..., 0], quat[..., 1 + axis] = torch.cos(angle / 2), torch.sin(angle / 2)
    return quat_to_matrix(quat)


def walk(phase: float, off: float) -> Motion:
    """A walk on a curve; ``off`` shakes it, slides it and turns it."""
    t = torch.arange(FRAMES) / 30.0
    shake = off * torch.sin(9.0 * torch.arange(FRAMES))
    root = torch.stack([0.3 * t.sin() + 0.3 * off * t, 0.96 + 0.02 * (12 * t).sin() + 0.1 * shake, 1.2 * t + off], -1)
    local = torch.eye(3).repeat(FRAMES, 8, 1, 1)
    local[:, 0] = turn(1, 0.8 * t + 0.9 * off) @ turn(0, 0.05 + shake)
    local[:, 1] = turn(2, 0.1 * (6 * t + phase).sin())
    local[:, 2] = turn(0, 0.4 * (6 * t + phase).sin())
    local[:, 5] = turn(0, -0.4 * (6 * t + phase).sin())
    return Motion(root[None], world_rotations(local[None], SKELETON.parents))


def written(motion: Motion) -> dict:
    """Root positions and parent-relative quaternions (w x y z), as the file has them."""
    quat = matrix_to_quat(local_rotations(motion.rotations, SKELETON.parents))[0]
    values = {"root_positions": motion.root, "rotations_wxyz": quat}
    return {name: [round(float(v), 6) for v in value.flatten()] for name, value in values.items()}


def read(data: dict) -> Motion:
    quat = torch.tensor(data["rotations_wxyz"]).reshape(1, FRAMES, 8, 4)
    local = quat_to_matrix(quat / quat.norm(dim=-1, keepdim=True))
    root = torch.tensor(data["root_positions"]).reshape(1, FRAMES, 3)
    return Motion(root, world_rotations(local, SKELETON.parents))


def figures(motion: Motion, truth: Motion) -> dict[str, float]:
    found = window_figures(motion, truth, SKELETON, Kinematics(SKELETON))
    found["npss"] = found.pop("npss_sum") / found.pop("npss_weight")
    return {name: float(values[0]) for name, values in found.items()}


def pinned(motion: Motion, truth: Motion) -> Motion:
    index = [*range(CONTEXT_FRAMES), FRAMES - 1]
    given = Motion(truth.root[:, index], truth.rotations[:, index])
    return pin(motion, given, index, SKELETON.parents, torch.tensor(SKELETON.left_axis))


def compute(data: dict) -> dict:
    """All that the file says of its two motions."""
    motion, truth = read(data["motion"]), read(data["truth"])
    met = pinned(motion, truth)
    return {
        "figures": figures(motion, truth),
        "pinned": written(met),
        "pinned_figures": figures(met, truth),
        "feasibility": feasibility(motion, truth),
    }


def feasibility(motion: Motion, truth: Motion) -> dict:
    """The limits of one motion, and the peaks of the other's figures; its reach is from the context to the last frame."""
    seen, judged = (
        Frames.of(m.world(Kinematics(SKELETON))[0].numpy(), m.rotations[0].numpy(), SKELETON) for m in (truth, motion)
    )
    limits = limits_of(SKELETON, [seen])
    peaks = frame_figures(judged, np.array(limits.upright), limits.bends).max(0)
    found = dict(zip(FIGURES, peaks.tolist(), strict=True))
    last = reach([judged], FRAMES - CONTEXT_FRAMES)
    return {"limits": asdict(limits), "figures": found | dict(zip(REACHES, last, strict=True))}


@pytest.fixture
def shared() -> dict:
    if os.environ.get("TROUPE_WRITE_FIGURES"):
        data = {"motion": written(walk(0.3, 0.08)), "truth": written(walk(0.0, 0.0))}
        SHARED.write_text(json.dumps(data | compute(data)) + "\n")
    return json.loads(SHARED.read_text())


def test_figures_are_the_shared_ones(shared: dict):
    found = compute(shared)
    for name in ("figures", "pinned_figures"):
        assert found[name] == pytest.approx(shared[name], rel=1e-3, abs=2e-5)
    assert all(value > 0 for name, value in shared["figures"].items() if name != "reached")
    assert found["feasibility"]["figures"] == pytest.approx(shared["feasibility"]["figures"], rel=1e-3, abs=1e-4)
    root = found["pinned"]["root_positions"]
    assert root == pytest.approx(shared["pinned"]["root_positions"], abs=1e-4)


def test_the_shared_pinned_motion_meets_its_keyframes(shared: dict):
    assert shared["pinned_figures"]["reached"] == 1.0
    for name in ("context_keyframe_error_m", "target_keyframe_error_m"):
        assert shared["pinned_figures"][name] < 1e-4 < shared["figures"][name]
