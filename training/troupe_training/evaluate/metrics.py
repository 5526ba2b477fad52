"""Measures of generated motion against ground truth that have a value for every window.

The definitions are those of `motion/src/metrics` (Rust), which `troupe-eval gaps` uses; `docs/evaluation.md` has them in words.
Everything is measured on joint positions and world rotations from forward kinematics, over the frames of the gap
unless the name says context or target.
"""

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.data.kinematics import Kinematics, near_ground
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import matrix_to_quat, wrap_angle, yaw_matrix
from troupe_training.data.skeleton import Skeleton

PENETRATION_TOLERANCE_M = 0.005
REACH_DISTANCE_M = 0.05
REACH_ANGLE_RAD = float(np.radians(15.0))
CONTACT = 0.5


def foot_skate(positions: Tensor, skeleton: Skeleton) -> Tensor:
    """Horizontal steps near the ground ``[B, N-1, C]``, metres a frame; entry t is the step to frame t + 1."""
    feet = positions[:, :, skeleton.contact_joints]
    step = (feet[:, 1:] - feet[:, :-1])[..., [0, 2]].norm(dim=-1)
    height = feet[:, 1:, :, 1] - torch.tensor(skeleton.contact_clearance_m)
    return step * near_ground(height)


def penetration(positions: Tensor, skeleton: Skeleton) -> Tensor:
    """How deep each contact joint is below its clearance, less 5 mm of grace: ``[B, N, C]``, metres."""
    height = positions[:, :, skeleton.contact_joints, 1]
    return (torch.tensor(skeleton.contact_clearance_m) - PENETRATION_TOLERANCE_M - height).clamp_min(0.0)


def contacts(positions: Tensor, skeleton: Skeleton) -> Tensor:
    """``[B, N, C]`` booleans: lower than the joint's height limit and slower than the speed limit."""
    feet = positions[:, :, skeleton.contact_joints]
    speed = (feet[:, 1:] - feet[:, :-1]).norm(dim=-1) * FPS
    speed = torch.cat([speed[:, :1], speed], 1)
    low = feet[..., 1] < torch.tensor(skeleton.contact_max_height_m)
    return low & (speed < skeleton.contact_max_speed_mps)


def accelerations(positions: Tensor) -> Tensor:
    """``[B, N-2, J]``, m/s²; entry t is that of frame t + 1."""
    return (positions[:, 2:] - 2 * positions[:, 1:-1] + positions[:, :-2]).norm(dim=-1) * FPS**2


def continuous(quat: Tensor) -> Tensor:
    """Quaternions ``[B, T, ..., 4]`` with signs chosen so that each is on the side of the one before it."""
    sign = torch.where((quat[:, 1:] * quat[:, :-1]).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    return torch.cat([quat[:, :1], quat[:, 1:] * torch.cumprod(sign, 1)], 1)


def npss_terms(predicted: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """NPSS of each of ``[B, T, D]`` sequences as numerator and weight ``[B]`` (Gopalakrishnan et al. 2019).

    The squared real part of the Fourier transform, as LaFAN1's code has it. NPSS of a set is the ratio of the two sums.
    """
    power = [torch.fft.fft(x.double(), dim=1).real ** 2 for x in (predicted, truth)]
    total = [p.sum(1) for p in power]
    share = [p / t.clamp_min(1e-12)[:, None] for p, t in zip(power, total, strict=True)]
    distance = (torch.cumsum(share[0], 1) - torch.cumsum(share[1], 1)).abs().sum(1)
    return (distance * total[1]).sum(-1), total[1].sum(-1)


def _precision(motion: Motion, truth: Motion, error: Tensor, left_axis: Tensor) -> dict[str, Tensor]:
    root_error = (motion.root - truth.root).norm(dim=-1)
    turn = wrap_angle(motion.headings(left_axis)[:, -1] - truth.headings(left_axis)[:, -1]).abs()
    return {
        "context_keyframe_error_m": error[:, :CONTEXT_FRAMES].amax((1, 2)),
        "target_keyframe_error_m": error[:, -1].amax(-1),
        "context_root_error_m": root_error[:, :CONTEXT_FRAMES].amax(1),
        "target_root_error_m": root_error[:, -1],
        "reached": ((root_error[:, -1] <= REACH_DISTANCE_M) & (turn <= REACH_ANGLE_RAD)).float(),
    }


def _spectra(motion: Motion, truth: Motion, gap: slice, headings: Tensor | None) -> tuple[Tensor, Tensor]:
    """`npss_terms` of both motions' world quaternions, turned into the clip's world if its headings are given."""
    both = [m.rotations[:, gap] for m in (motion, truth)]
    if headings is not None:
        both = [yaw_matrix(headings)[:, None, None] @ rotations for rotations in both]
    return npss_terms(*(continuous(matrix_to_quat(rotations)).flatten(2) for rotations in both))


def window_figures(
    motion: Motion, truth: Motion, skeleton: Skeleton, kinematics: Kinematics, headings: Tensor | None = None
) -> dict[str, Tensor]:
    """Every measure of B windows by name, ``[B]`` each, and NPSS as ``npss_sum`` and ``npss_weight``.

    Windows are four context frames, the gap, and one target frame, in the segment frame; ``headings`` ``[B]`` are the
    segments' own in the world of their clips. NPSS alone depends on them.
    """
    last = motion.root.shape[1] - 1
    gap = slice(CONTEXT_FRAMES, last)
    world, true_world = motion.world(kinematics), truth.world(kinematics)
    error = (world - true_world).norm(dim=-1)
    quat, true_quat = matrix_to_quat(motion.rotations), matrix_to_quat(truth.rotations)
    nearer = torch.where((quat * true_quat).sum(-1, keepdim=True) < 0, -quat, quat)
    jitter = accelerations(world)[:, CONTEXT_FRAMES - 1 : last - 1]
    true_contacts = contacts(true_world, skeleton)
    spectra = _spectra(motion, truth, gap, headings)
    figures = {
        "l2p_m": (error[:, gap] ** 2).sum(-1).sqrt().mean(1),
        "l2q": ((nearer - true_quat)[:, gap] ** 2).sum((-1, -2)).sqrt().mean(1),
        "foot_skate_m_per_frame": foot_skate(world, skeleton)[:, CONTEXT_FRAMES - 1 : last - 1].mean((1, 2)),
        "penetration_m": penetration(world, skeleton)[:, gap].mean((1, 2)),
        "contact_accuracy": (contacts(world, skeleton) == true_contacts)[:, gap].float().mean((1, 2)),
        "joint_jitter_mps2": jitter.mean((1, 2)),
        "root_jitter_mps2": jitter[..., 0].mean(1),
        "npss_sum": spectra[0],
        "npss_weight": spectra[1],
    }
    if motion.contacts is not None:
        said = (motion.contacts >= CONTACT) == true_contacts
        figures["contact_prediction_accuracy"] = said[:, gap].float().mean((1, 2))
    return figures | _precision(motion, truth, error, torch.tensor(skeleton.left_axis))
