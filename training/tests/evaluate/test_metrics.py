"""Every measure on motions made by hand; the same cases as `motion/src/metrics/tests.rs` where Rust has the measure."""

import math

import numpy as np
import pytest
import torch

from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import axis_rotation
from troupe_training.data.skeleton import Skeleton
from troupe_training.evaluate.distribution import MMD_SCALE, MMD_SIGMA, Gaussian, Mmd, frechet, pairwise_distance
from troupe_training.evaluate.intervals import Bootstrap
from troupe_training.evaluate.metrics import npss_terms, window_figures

# A pelvis with a head above it and a foot at each side, the feet at their clearance of 5 cm.
SKELETON = Skeleton(
    names=["pelvis", "head", "left", "right"],
    parents=[-1, 0, 0, 0],
    offsets=[[0.0, 0.0, 0.0], [0.0, 0.6, 0.0], [0.1, -0.85, 0.0], [-0.1, -0.85, 0.0]],
    left_axis=[1.0, 0.0, 0.0],
    contact_joints=[2, 3],
    contact_max_height_m=[0.1, 0.1],
    contact_max_speed_mps=0.4,
    contact_clearance_m=[0.05, 0.05],
)
FRAMES = 10  # four of context, a gap of five, one target


def stand() -> Motion:
    root = torch.tensor([0.0, 0.9, 0.0]).expand(1, FRAMES, 3).clone()
    return Motion(root, torch.eye(3).expand(1, FRAMES, 4, 3, 3).clone())


def figures(motion: Motion, truth: Motion) -> dict[str, float]:
    found = window_figures(motion, truth, SKELETON, Kinematics(SKELETON))
    return {name: float(values[0]) for name, values in found.items()}


def test_truth_against_itself():
    found = figures(stand(), stand())
    for name in ("l2p_m", "l2q", "npss_sum", "foot_skate_m_per_frame", "penetration_m", "joint_jitter_mps2"):
        assert found[name] == pytest.approx(0.0, abs=1e-6), name
    assert found["reached"] == 1.0 and found["contact_accuracy"] == 1.0
    assert "contact_prediction_accuracy" not in found


def test_l2p_is_the_norm_of_the_whole_pose():
    moved = stand()
    moved.root[0, 4, 0] += 0.03
    moved.root[0, 5, 2] += 0.06
    moved.root[0, 9, 0] += 1.0  # the target is no part of the gap
    assert figures(moved, stand())["l2p_m"] == pytest.approx(2 * (0.03 + 0.06) / 5, rel=1e-4)


def test_l2q_of_a_turned_joint():
    turned = stand()
    turned.rotations[0, 6, 1] = torch.from_numpy(axis_rotation("X", np.array(60.0)))
    expected = math.sqrt(2 - 2 * math.cos(math.radians(30))) / 5
    assert figures(turned, stand())["l2q"] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("height", "weight"), [(0.0, 1.0), (0.0125, 2 - math.sqrt(2)), (0.025, 0.0), (0.5, 0.0), (-0.1, 1.0)]
)
def test_skate_counts_near_the_ground_only(height: float, weight: float):
    sliding = stand()
    sliding.root[0, :, 0] += 0.03 * torch.arange(FRAMES)
    sliding.root[0, :, 1] += height
    assert figures(sliding, stand())["foot_skate_m_per_frame"] == pytest.approx(0.03 * weight, abs=1e-6)


def test_up_and_down_is_no_skating():
    hop = stand()
    hop.root[0, 5, 1] += 0.01
    assert figures(hop, stand())["foot_skate_m_per_frame"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("down", "depth"), [(0.004, 0.0), (0.025, 0.02)])
def test_penetration_has_five_millimetres_of_grace(down: float, depth: float):
    sunk = stand()
    sunk.root[0, 7, 1] -= down
    assert figures(sunk, stand())["penetration_m"] == pytest.approx(depth / 5, abs=1e-6)


def test_jitter_is_the_acceleration_in_the_gap_and_at_its_seams():
    jump = stand()
    jump.root[0, 6, 1] += 0.01  # accelerations of 9, 18 and 9 m/s² in frames 5, 6, 7
    assert figures(jump, stand())["joint_jitter_mps2"] == pytest.approx(36 / 5, rel=1e-3)
    assert figures(jump, stand())["root_jitter_mps2"] == pytest.approx(36 / 5, rel=1e-3)
    late = stand()
    late.root[0, 9, 1] += 0.01  # frame 8, the last of the gap, feels the target's jump
    assert figures(late, stand())["joint_jitter_mps2"] == pytest.approx(9 / 5, rel=1e-3)
    early = stand()
    early.root[0, 3, 1] += 0.01
    assert figures(early, stand())["joint_jitter_mps2"] == pytest.approx(9 / 5, rel=1e-3)


def test_only_the_head_jitters_in_joint_jitter():
    nod = stand()
    nod.rotations[0, 6, 0] = torch.from_numpy(axis_rotation("Y", np.array(10.0)))  # moves the feet, not the head
    chord = 2 * 0.1 * math.sin(math.radians(5)) * 900
    found = figures(nod, stand())
    assert found["joint_jitter_mps2"] == pytest.approx((chord + 2 * chord + chord) * 2 / 4 / 5, rel=1e-3)
    assert found["root_jitter_mps2"] == pytest.approx(0.0, abs=1e-3)


def test_contacts_are_lost_by_height_and_by_speed():
    lifted = stand()
    lifted.root[0, 6:, 1] += 0.06  # from frame 6 on 11 cm high; frames 6, 7, 8 of the gap differ
    assert figures(lifted, stand())["contact_accuracy"] == pytest.approx(2 / 5)
    pushed = stand()
    pushed.root[0, 5:, 0] += 0.02  # 0.6 m/s in frame 5 alone
    assert figures(pushed, stand())["contact_accuracy"] == pytest.approx(4 / 5)


def test_predicted_contacts_are_counted_against_the_truths():
    said = stand()
    said.contacts = torch.full((1, FRAMES, 2), 0.9)
    said.contacts[0, 4:6, 0] = 0.2
    assert figures(said, stand())["contact_prediction_accuracy"] == pytest.approx(8 / 10)


def test_keyframe_errors_are_of_the_worst_joint():
    off = stand()
    off.root[0, 1, 0] += 0.02
    off.rotations[0, 9, 0] = torch.from_numpy(axis_rotation("X", np.array(180.0)))
    found = figures(off, stand())
    assert found["context_keyframe_error_m"] == pytest.approx(0.02, rel=1e-4)
    assert found["context_root_error_m"] == pytest.approx(0.02, rel=1e-4)
    assert found["target_keyframe_error_m"] == pytest.approx(1.7, rel=1e-4)  # the feet, 85 cm below the pelvis
    assert found["target_root_error_m"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("metres", "degrees", "reached"),
    [(0.049, 0.0, 1.0), (0.051, 0.0, 0.0), (0.0, 14.9, 1.0), (0.0, -15.1, 0.0), (0.03, 14.0, 1.0)],
)
def test_a_target_is_reached_within_5_cm_and_15_degrees(metres: float, degrees: float, reached: float):
    near = stand()
    near.root[0, 9, 2] += metres
    near.rotations[0, 9] = torch.from_numpy(axis_rotation("Y", np.array(degrees))).float()
    assert figures(near, stand())["reached"] == reached


def test_npss_by_hand():
    """A constant has all its power at frequency 0, alternating signs at frequency 2: two apart of four frames."""
    truth = torch.tensor([[[1.0, 0.5]] * 4])
    motion = torch.tensor([[[1.0, 0.5], [1.0, -0.5]] * 2])
    above, weight = npss_terms(motion, truth)
    assert float(weight) == pytest.approx(20.0)  # (4 · 1)² and (4 · 0.5)²
    assert float(above / weight) == pytest.approx(2.0 * 4.0 / 20.0)


def test_fid_of_equal_sets_is_zero():
    latents = np.random.default_rng(1).standard_normal((300, 16))
    assert frechet(Gaussian(latents), Gaussian(latents)) == pytest.approx(0.0, abs=1e-9)


def test_fid_of_a_shifted_set_is_the_squared_shift():
    latents = np.random.default_rng(1).standard_normal((300, 16))
    shift = np.linspace(-1, 1, 16)
    assert frechet(Gaussian(latents), Gaussian(latents + shift)) == pytest.approx((shift**2).sum(), rel=1e-9)


def test_fid_of_scaled_gaussians():
    """With covariances s² and t² in each dimension the distance is (s - t)² a dimension, along any axes."""
    turn, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((5, 5)))
    a, b = Gaussian(np.zeros((2, 5))), Gaussian(np.zeros((2, 5)))
    a.covariance = torch.from_numpy(turn @ np.diag([1.0, 4.0, 9.0, 0.0, 1.0]) @ turn.T)
    b.covariance = torch.from_numpy(turn @ np.diag([4.0, 4.0, 1.0, 1.0, 0.0]) @ turn.T)
    assert frechet(a, b) == pytest.approx(1 + 0 + 4 + 1 + 1, rel=1e-6)
    assert frechet(b, a) == pytest.approx(1 + 0 + 4 + 1 + 1, rel=1e-6)


def test_a_gaussian_counts_windows_by_their_weights():
    latents = np.random.default_rng(4).standard_normal((6, 3))
    times = np.array([2.0, 0.0, 1.0, 3.0, 1.0, 0.0])
    weighted, written = Gaussian(latents, times), Gaussian(np.repeat(latents, times.astype(int), axis=0))
    assert torch.allclose(weighted.mean, written.mean) and torch.allclose(weighted.covariance, written.covariance)
    repeated = np.cov(np.repeat(latents, times.astype(int), axis=0), rowvar=False)
    assert np.allclose(written.covariance, repeated)


def test_mmd_by_hand():
    """Two points against two others: k(0) = 1, and k(d) = exp(-d² / 2σ²)."""
    a, b = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([[0.0, 4.0], [3.0, 4.0]])
    k9, k16, k25 = (math.exp(-squared / (2 * MMD_SIGMA**2)) for squared in (9, 16, 25))
    within, across = (2 + 2 * k9) / 4, (2 * k16 + 2 * k25) / 4
    assert Mmd(a, b).value() == pytest.approx(MMD_SCALE * (2 * within - 2 * across), rel=1e-9)
    assert Mmd(a, a).value() == pytest.approx(0.0, abs=1e-9)


def test_diversity_is_the_mean_over_pairs():
    answers = torch.tensor([0.0, 1.0, 3.0])[:, None, None, None] * torch.tensor([1.0, 0.0, 0.0])
    assert pairwise_distance(answers)[0] == pytest.approx((1 + 3 + 2) / 3)
    answers = torch.tensor([[0.0, 0.0], [3.0, 4.0]])[:, None]
    assert pairwise_distance(answers)[0] == pytest.approx(5.0)


def test_intervals_come_from_clips_not_from_windows():
    """Windows of a clip with equal figures count as one of them."""
    rng = np.random.default_rng(3)
    per_clip = rng.standard_normal(40)
    clips = np.repeat(np.arange(40), 25)
    figure = Bootstrap(clips).ratio(per_clip[clips])
    expected = 1.96 * per_clip.std() / math.sqrt(40)
    assert figure["mean"] == pytest.approx(per_clip.mean())
    assert (figure["high"] - figure["low"]) / 2 == pytest.approx(expected, rel=0.15)
    naive = Bootstrap(np.arange(1000)).ratio(per_clip[clips])
    assert naive["high"] - naive["low"] < (figure["high"] - figure["low"]) / 3


def test_a_ratio_weighs_windows_by_what_is_below():
    figure = Bootstrap(np.array([0, 0, 1])).ratio(np.array([1.0, 2.0, 0.0]), np.array([1.0, 1.0, 8.0]))
    assert figure["mean"] == pytest.approx(0.3)
    assert figure["low"] == 0.0 and figure["high"] == pytest.approx(1.5)


def test_intervals_of_distances_do_not_move_with_what_draws_lack():
    values = [2.0, *np.linspace(2.9, 3.1, 101)]  # draws lie 1.0 off
    figure = Bootstrap.statistic([*values, math.nan])
    assert figure["mean"] == 2.0
    assert figure["low"] == pytest.approx(1.905) and figure["high"] == pytest.approx(2.095)


def test_npss_is_of_the_clips_world():
    """Telling the heading is the same as turning both motions; and it is no other measure's business."""

    def nodding(pace: float) -> Motion:
        motion = stand()
        angles = 70 * np.sin(pace * np.arange(FRAMES))
        turns = [axis_rotation("X", a) @ axis_rotation("Z", 0.5 * a + 30) for a in angles]
        motion.rotations[0, :, 1] = torch.from_numpy(np.stack(turns)).float()
        return motion

    fast, slow = nodding(1.4), nodding(0.5)
    heading = torch.tensor([2.1])
    yaw = torch.from_numpy(axis_rotation("Y", np.degrees(2.1))).float()
    turned = [Motion(m.root, yaw @ m.rotations) for m in (fast, slow)]
    weighted = window_figures(fast, slow, SKELETON, Kinematics(SKELETON), heading)
    made = window_figures(*turned, SKELETON, Kinematics(SKELETON))
    plain = window_figures(fast, slow, SKELETON, Kinematics(SKELETON))
    npss = [float(found["npss_sum"] / found["npss_weight"]) for found in (weighted, made, plain)]
    assert npss[0] == pytest.approx(npss[1], rel=1e-4)
    assert npss[0] != pytest.approx(npss[2], rel=1e-2)
    assert float(weighted["l2q"]) == pytest.approx(float(plain["l2q"]))
