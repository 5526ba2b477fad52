"""Pinning as the server does it: generated frames meet the keyframes they were given, without a pop.

The same as `motion/src/segment.rs::pin_targets`, `motion/src/pin.rs` and `service/src/inbetween/finish.rs`, for batches that
all give the same frames. `tests/evaluate/test_evaluation.py` holds both to the same numbers.
"""

import torch
from torch import Tensor

from troupe_training.data.motion import Motion, local_rotations, world_rotations
from troupe_training.data.rotations import matrix_to_quat, quat_to_matrix, wrap_angle, yaw_matrix

PIN_REACH_FRAMES = 8


def smoothstep(t: float) -> float:
    """``3t² - 2t³``."""
    return t * t * (3.0 - 2.0 * t)


def fade(distance: int, reach: int) -> float:
    """How much of what a pin lacks a frame takes at ``distance`` frames from it; 0 from ``reach`` frames on."""
    return 1.0 if distance == 0 else 1.0 - smoothstep(min(distance / max(reach, 1), 1.0))


def part_of_turn(rotations: Tensor, weight: float) -> Tensor:
    """Rotations ``[..., 3, 3]`` by ``weight`` times their angle, the short way (slerp from the identity)."""
    quat = matrix_to_quat(rotations)
    quat = torch.where(quat[..., :1] < 0, -quat, quat)
    sine = quat[..., 1:].norm(dim=-1, keepdim=True)
    half = torch.atan2(sine, quat[..., :1]) * weight
    axis = quat[..., 1:] / sine.clamp_min(1e-12)
    return quat_to_matrix(torch.cat([torch.cos(half), axis * torch.sin(half)], -1))


def pin_roots(motion: Motion, given: Motion, frames: list[int], left_axis: Tensor) -> Motion:
    """Moves roots to those of ``given`` ``[B, K, ...]`` at ``frames``: the residuals are spread over the frames between.

    Where frame 0 is given, it is met outright. Poses turn about their root with the heading's part.
    """
    root, rotations = motion.root.clone(), motion.rotations.clone()
    headings, given_headings = motion.headings(left_axis), given.headings(left_axis)
    if frames[0] == 0:
        root[:, 0] = given.root[:, 0]
    before = 0
    offset, turn = torch.zeros_like(root[:, 0]), torch.zeros_like(headings[:, 0])
    for nth, frame in enumerate(frames):
        if frame == 0:
            continue
        next_offset = given.root[:, nth] - motion.root[:, frame]
        next_turn = wrap_angle(given_headings[:, nth] - headings[:, frame])
        next_turn = turn + wrap_angle(next_turn - turn)
        for now in range(before + 1, frame + 1):
            share = smoothstep((now - before) / (frame - before))
            root[:, now] += offset + (next_offset - offset) * share
            yaw = yaw_matrix(turn + (next_turn - turn) * share)
            rotations[:, now] = yaw[:, None] @ rotations[:, now]
        before, offset, turn = frame, next_offset, next_turn
    if before + 1 < root.shape[1]:
        root[:, before + 1 :] += offset[:, None]
        rotations[:, before + 1 :] = yaw_matrix(turn)[:, None, None] @ rotations[:, before + 1 :]
    return Motion(root, rotations, motion.contacts)


def pin_poses(local: Tensor, given: Tensor, frames: list[int], reach: int = PIN_REACH_FRAMES) -> Tensor:
    """Turns parent-relative rotations ``[B, N, J, 3, 3]`` so that ``frames`` have exactly ``given`` ``[B, K, J, 3, 3]``."""
    total, out = local.shape[1], local.clone()
    lacking = given @ local[:, frames].transpose(-1, -2)
    for nth, frame in enumerate(frames):
        before = frames[nth - 1] + 1 if nth else 0
        after = frames[nth + 1] if nth + 1 < len(frames) else total
        for now in range(max(before, frame - reach), min(after, frame + reach + 1)):
            room = frame + 1 - before if now < frame else after - frame
            weight = fade(abs(now - frame), min(reach, room))
            out[:, now] = part_of_turn(lacking[:, nth], weight) @ out[:, now]
    return out


def pin(motion: Motion, given: Motion, frames: list[int], parents: list[int], left_axis: Tensor) -> Motion:
    """Has ``motion`` meet roots and poses of ``given`` ``[B, K, ...]`` at ``frames``, as the server's answers do."""
    moved = pin_roots(motion, given, frames, left_axis)
    local = pin_poses(local_rotations(moved.rotations, parents), local_rotations(given.rotations, parents), frames)
    return Motion(moved.root, world_rotations(local, parents), motion.contacts)


def carry_on(
    motion: Motion, context: Motion, parents: list[int], left_axis: Tensor, reach: int = PIN_REACH_FRAMES
) -> Motion:
    """Has a plan go on from its context's frames ``[B, 4, ...]``, as live sessions do (`character/src/live/plan.rs`).

    What the last context frame lacks goes to the frames behind it: the place on the ground and the heading as they are,
    height and pose fading. Targets are not met.
    """
    last, total = context.root.shape[1] - 1, motion.root.shape[1]
    lacking = context.root[:, last] - motion.root[:, last]
    height = torch.tensor([fade(max(now - last, 0), reach) for now in range(total)])
    part = torch.ones(total, 3)
    part[:, 1] = height
    root = motion.root + lacking[:, None] * part
    turn = context.headings(left_axis)[:, last] - motion.headings(left_axis)[:, last]
    turned = yaw_matrix(turn)[:, None, None] @ motion.rotations
    given = local_rotations(context.rotations, parents)
    local = pin_poses(local_rotations(turned, parents), given[:, last:], [last], reach)
    rotations = world_rotations(local, parents)
    return Motion(
        torch.cat([context.root, root[:, last + 1 :]], 1),
        torch.cat([context.rotations, rotations[:, last + 1 :]], 1),
        motion.contacts,
    )
