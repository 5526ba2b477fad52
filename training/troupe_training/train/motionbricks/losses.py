"""Reconstruction losses of the tokenizer and of the refined decoder, on motion as a viewer sees it."""

import torch
from torch import Tensor
from torch.nn import functional as F

from troupe_training.data.conventions import FPS
from troupe_training.data.kinematics import Kinematics, near_ground
from troupe_training.data.precision import full_precision
from troupe_training.data.rotations import matrix_to_six_d
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import Segments
from troupe_training.models.motionbricks.tokenizer import Decoded, Decoder

KEYFRAME_WEIGHT = 4.0
# Of where the root is at given keyframes, in the mean over them. Without it a decoder that is
# refined for long learns the paths of its clips by heart, corrects others by them, and misses
# targets.
KEYFRAME_ROOT_WEIGHT = 6.0
# Of columns that are shorter or longer than 1. A column of a hundredth has a direction all the
# same, and loses it in 16 bits.
LENGTH_WEIGHT = 0.5
POSE_WEIGHT = 0.6
# Standardised errors below it count by their square. The aim is the median of what may come,
# because a mean of several motions is none of them: with a bend of 1 the pack for people moved less
# than its clips.
POSE_BEND = 0.1
LOW_FOOT_M = 0.1
# Of accelerations. Motors are to be spared more than eyes.
SMOOTHNESS, ROBOT_SMOOTHNESS = 0.006, 0.02
FOOT_WEIGHTS = {"slide": 0.6, "ground": 8.0, "skate": 0.5}
# Of how fast joints move about the root over a whole segment. Errors frame by frame have their
# least where a swing that may come early or late is left out; this one does not ask when.
ENERGY_WEIGHT = 0.6


class Body(Kinematics):
    """Kinematics, and what the losses know of a body besides."""

    def __init__(self, skeleton: Skeleton, device: str = "cpu"):
        super().__init__(skeleton, device)
        self.feet = skeleton.contact_joints
        self.clearance = torch.tensor(skeleton.contact_clearance_m, device=device)
        self.smoothness = ROBOT_SMOOTHNESS if skeleton.robot else SMOOTHNESS


def foot_losses(world: Tensor, truth: Segments, body: Body) -> dict[str, Tensor]:
    """How wrongly feet meet the ground, unweighted.

    ``world`` ``[B, T, J, 3]`` are the positions that the server shows: forward kinematics carried by the refined root.

    - ``slide``: by how much feet that stand, or are near the ground, slip over it faster than they truly do, m/s.
    - ``ground``: error of the height of feet below `LOW_FOOT_M`, m. A pelvis a centimetre too low drags the swinging feet through
      the ground, which looks like skating and is most of the foot-skate figure.
    - ``skate``: error of the foot-skate figure itself, m/s.
    """
    feet = world[:, 1:, body.feet]
    speed = _difference(world[:, :, body.feet])[..., [0, 2]]
    speed = torch.sqrt((speed * speed).sum(-1) + 1e-6)
    height = feet[..., 1] - body.clearance
    true_speed = truth.velocities[:, 1:, body.feet][..., [0, 2]].norm(dim=-1)
    true_height = truth.positions[:, 1:, body.feet, 1] - body.clearance
    true_low = near_ground(true_height)
    stands = torch.maximum(truth.contacts[:, 1:] * truth.contacts[:, :-1], true_low)
    slip = F.relu(speed - true_speed)
    low = (1.0 - true_height / LOW_FOOT_M).clamp(0.0, 1.0)
    return {
        "slide": (slip * stands).sum() / stands.sum().clamp_min(1.0),
        "ground": ((height - true_height).abs() * low).sum() / low.sum().clamp_min(1.0),
        "skate": (near_ground(height) * speed - true_low * true_speed).abs().mean(),
    }


def energy_loss(shown: Tensor, truth: Tensor, feet: list[int]) -> Tensor:
    """How far joints are from moving about the root as fast as they truly do, m/s: roots of mean squares over a segment.

    Positions ``[B, T, J, 3]`` about the root. Feet are left out: they have `foot_losses`.
    """
    others = [joint for joint in range(shown.shape[2]) if joint not in feet]
    speeds = [_difference(motion[:, :, others]).square().sum(-1).mean(1) for motion in (shown, truth)]
    found, true = (torch.sqrt(squares + 1e-6) for squares in speeds)
    return (found - true).abs().mean()


def _difference(x: Tensor) -> Tensor:
    return (x[:, 1:] - x[:, :-1]) * FPS


@full_precision
def reconstruction_losses(
    out: Decoded, truth: Segments, mask: Tensor, decoder: Decoder, body: Body
) -> dict[str, Tensor]:
    """Named, weighted terms; their sum is minimised. ``mask`` ``[B, T]`` marks given keyframes, which weigh more."""
    weight = (1.0 + (KEYFRAME_WEIGHT - 1.0) * mask)[..., None]
    weight = weight / weight.mean()
    pose = torch.cat([out.positions, matrix_to_six_d(out.rotations)], -1).flatten(2)
    pose_error = F.smooth_l1_loss(
        decoder.pose_scale(pose), decoder.pose_scale(truth.pose), reduction="none", beta=POSE_BEND
    )

    # The served motion: rotations through forward kinematics, carried by the refined root.
    height = torch.zeros_like(out.global_root[..., :3])
    height[..., 1] = out.global_root[..., 1]
    shown = body.positions(out.rotations) + height[:, :, None]
    ground = torch.stack([out.global_root[..., 0], torch.zeros_like(height[..., 0]), out.global_root[..., 2]], -1)
    true_ground = truth.global_root[..., :3] * torch.tensor([1.0, 0.0, 1.0], device=height.device)
    world = shown + ground[:, :, None]
    true_world = truth.positions + true_ground[:, :, None]
    speed, true_speed = _difference(world), _difference(true_world)
    root_error = (out.global_root - truth.global_root).abs()
    given = mask[..., None].expand_as(root_error)
    foot_terms = foot_losses(world, truth, body)
    return {name: FOOT_WEIGHTS[name] * term for name, term in foot_terms.items()} | {
        "pose": POSE_WEIGHT * (pose_error * weight).mean(),
        "fk": 6.0 * ((shown - truth.positions).abs() * weight[..., None]).mean(),
        "speed": 0.4 * (speed - true_speed).abs().mean(),
        "acceleration": body.smoothness * (_difference(speed) - _difference(true_speed)).abs().mean(),
        "energy": ENERGY_WEIGHT * energy_loss(shown, truth.positions, body.feet),
        "velocity": 0.2
        * F.smooth_l1_loss(
            decoder.velocity_scale(out.velocities.flatten(2)), decoder.velocity_scale(truth.velocities.flatten(2))
        ),
        "contact": 0.3 * F.binary_cross_entropy_with_logits(out.contact_logits, truth.contacts),
        "local_root": 0.5 * F.smooth_l1_loss(decoder.root_scale(out.local_root), decoder.root_scale(truth.local_root)),
        "global_root": 1.5 * root_error.mean(),
        "length": LENGTH_WEIGHT * (out.lengths - 1.0).square().mean(),
        "keyframe_root": KEYFRAME_ROOT_WEIGHT * (root_error * given).sum() / given.sum().clamp_min(1.0),
    }
