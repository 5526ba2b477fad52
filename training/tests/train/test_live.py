"""The conditions of live control, and the slide of feet."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from troupe_training.data.kinematics import near_ground
from troupe_training.data.roots import local_root_of
from troupe_training.data.store import ClipStore, Segments
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.train.motionbricks.live import change_speed, keyframe_masks, live_conditions, smooth_heading
from troupe_training.train.motionbricks.losses import Body, energy_loss, foot_losses
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.refine import Guides, refine_loss
from troupe_training.train.motionbricks.root import ROOT
from troupe_training.train.motionbricks.tokenizer import REFINE


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def world_of(segments: Segments) -> torch.Tensor:
    ground = segments.global_root[..., :3] * torch.tensor([1.0, 0.0, 1.0])
    return segments.positions + ground[:, :, None]


def test_true_motion_has_no_foot_loss(store: ClipStore):
    segments = store.batch(512, torch.Generator().manual_seed(1), 32)
    terms = foot_losses(world_of(segments), segments, Body(store.skeleton))
    assert terms["ground"] < 1e-6 and terms["slide"] < 2e-3 and terms["skate"] < 2e-3


def test_standing_feet_that_drift_slide_and_raised_ones_do_not(store: ClipStore):
    body = Body(store.skeleton)
    segments = store.batch(512, torch.Generator().manual_seed(1), 32)
    slow = replace(
        segments, contacts=torch.ones_like(segments.contacts), velocities=torch.zeros_like(segments.velocities)
    )
    drift = torch.arange(32) * (0.3 / 30.0)
    drifting = world_of(segments)[:, :1] + torch.stack([drift, torch.zeros(32), torch.zeros(32)], -1)[None, :, None]
    assert abs(foot_losses(drifting, slow, body)["slide"] - 0.3) < 5e-3
    up = torch.tensor([0.0, 1.0, 0.0])
    raised = replace(slow, contacts=torch.zeros_like(slow.contacts), positions=slow.positions + up)
    terms = foot_losses(drifting + up, raised, body)
    assert all(float(term) == 0.0 for term in terms.values())


def test_a_lowered_pelvis_shows_in_ground_and_skate(store: ClipStore):
    body = Body(store.skeleton)
    segments = store.batch(512, torch.Generator().manual_seed(1), 32)
    low = foot_losses(world_of(segments) - torch.tensor([0.0, 0.02, 0.0]), segments, body)
    assert abs(low["ground"] - 0.02) < 1e-4
    assert low["slide"] < 2e-3, "feet are no faster"
    assert low["skate"] > 0.05


def test_energy_tells_how_fast_joints_move_and_not_when():
    joints, feet, time = 3, [2], torch.arange(60) / 30.0

    def swing(reach_m: float, phase: float) -> torch.Tensor:
        motion = torch.zeros(1, 60, joints, 3)
        motion[0, :, 1, 0] = reach_m * torch.sin(2 * torch.pi * time + phase)
        return motion

    true = swing(0.2, 0.0)
    assert energy_loss(swing(0.2, 1.5), true, feet) < 0.02, "it may come at another time"
    left_out = energy_loss(swing(0.0, 0.0), true, feet)
    assert abs(float(left_out) - 0.2 * 2 * torch.pi / 2**0.5 / 2) < 0.01, "the mean of two joints"
    assert energy_loss(swing(0.1, 0.0), true, feet) < 0.6 * left_out
    assert energy_loss(swing(0.2, 0.0), true, [1, 2]) < 1e-6, "feet are left out"


def test_near_ground_fades_with_height():
    fading = near_ground(torch.tensor([-0.1, 0.0, 0.0125, 0.025, 0.5]))
    assert fading[:2].tolist() == [1.0, 1.0] and fading[3:].tolist() == [0.0, 0.0]
    assert 0.5 < fading[2] < 0.65


def test_changed_speed_keeps_poses_context_and_standing_feet(store: ClipStore):
    segments = store.batch(640, torch.Generator().manual_seed(2), 40)
    feet = store.skeleton.contact_joints
    contacts = torch.zeros_like(segments.contacts)
    contacts[..., 0] = 1.0
    segments = replace(segments, contacts=contacts)
    factor = torch.full((len(contacts),), 0.8)
    factor[0] = 1.0
    slower = change_speed(segments, factor, feet)
    assert torch.equal(slower.pose, segments.pose)
    assert torch.equal(slower.global_root[:, :4], segments.global_root[:, :4])
    assert torch.equal(slower.global_root[..., 3:], segments.global_root[..., 3:])
    assert torch.allclose(slower.local_root, local_root_of(slower.global_root), atol=1e-5)
    late = slice(12, None)
    ratio = torch.tensor([1.0, 0.8])
    for row, expected in enumerate(ratio):
        wanted = segments.local_root[row, late, :2] * expected
        assert torch.allclose(slower.local_root[row, late, :2], wanted, atol=2e-3)
    assert torch.equal(slower.velocities[:, :, feet[0]], segments.velocities[:, :, feet[0]])
    pelvis = slower.local_root[1:, late, :2] - segments.local_root[1:, late, :2]
    moved = (slower.velocities - segments.velocities)[1:, late, 0][..., [0, 2]]
    assert torch.allclose(moved, pelvis, atol=2e-3)


def test_smooth_heading_keeps_the_context_and_straight_paths():
    psi = torch.linspace(0, 1.0, 40) + 0.2 * torch.sin(torch.arange(40.0))
    root = torch.stack([psi, psi, psi, torch.cos(psi), torch.sin(psi)], -1)[None]
    smooth = smooth_heading(root, 9)
    assert torch.equal(smooth[:, :4], root[:, :4])
    assert torch.equal(smooth[..., :3], root[..., :3])
    assert torch.allclose(smooth[..., 3:].norm(dim=-1), torch.ones(1, 40), atol=1e-5)
    bends = [torch.atan2(r[..., 4], r[..., 3]).diff(2).abs()[:, 6:].mean() for r in (smooth, root)]
    assert bends[0] < 0.3 * bends[1]


@pytest.mark.parametrize("frames", [28, 36, 44])
def test_keyframes_are_context_one_target_and_up_to_two_between(frames: int):
    mask, slot = keyframe_masks(600, frames, torch.Generator().manual_seed(3))
    assert mask[:, :4].min() == 1
    target = mask[:, -4:]
    assert (target.sum(-1) == 1).all() and torch.equal(target.argmax(-1), slot)
    between = mask[:, 4:-4].sum(-1)
    assert sorted(between.unique().tolist()) == [0.0, 1.0, 2.0]


def test_live_conditions_keep_the_context_exact(store: ClipStore):
    root = ROOT.build(PRESETS["test"], store).eval()
    live = live_conditions(store, 1024, root, torch.Generator().manual_seed(4))
    assert live.trajectory.shape == live.segments.global_root.shape
    assert torch.equal(live.keyframes[:, :4], live.segments.pose[:, :4])
    assert live.exact[:, :4].min() == 1
    same = (live.keyframes == live.segments.pose).all(-1)
    assert same[live.exact == 1].all()
    wrong = (live.mask == 1) & (live.exact == 0)
    assert wrong.any() and not same[wrong].any()


def test_refinement_takes_both_kinds_of_samples(store: ClipStore):
    config = PRESETS["test"]
    pose, root, tokenizer = (stage.build(config, store).eval() for stage in (POSE, ROOT, REFINE))
    loss = refine_loss(store, 512, Guides(pose, root, 0.25))
    generator = torch.Generator().manual_seed(5)
    for _ in range(6):
        terms = loss(tokenizer, generator, 0.0)
        assert all(torch.isfinite(term) for term in terms.values())
        assert min(terms["slide"], terms["ground"], terms["skate"]) > 0.0
