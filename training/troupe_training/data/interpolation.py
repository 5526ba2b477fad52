"""Linear interpolation between the context and a target: a baseline, and what the deterministic transformer corrects."""

import torch
from torch import Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion, local_rotations, world_rotations
from troupe_training.data.rotations import matrix_to_quat, quat_to_matrix


def slerp(a: Tensor, b: Tensor, share: Tensor) -> Tensor:
    """Quaternions between ``a`` and ``b``, the short way; all broadcast, ``share`` has a last axis of one."""
    dot = (a * b).sum(-1, keepdim=True)
    b = torch.where(dot < 0, -b, b)
    angle = torch.arccos(dot.abs().clamp(max=1 - 1e-7))
    mixed = (torch.sin((1 - share) * angle) * a + torch.sin(share * angle) * b) / torch.sin(angle)
    return mixed / mixed.norm(dim=-1, keepdim=True)


def interpolate(truth: Motion, frames: int, parents: list[int]) -> Motion:
    """Linear root and slerped parent-relative rotations between the last context frame and the target."""
    first, last = CONTEXT_FRAMES - 1, frames - 1
    share = ((torch.arange(frames, device=truth.root.device) - first) / (last - first)).clamp(0, 1)
    local = local_rotations(truth.rotations[:, [*range(CONTEXT_FRAMES), last]], parents)
    ends = matrix_to_quat(local[:, [first, -1]])
    quat = slerp(ends[:, :1], ends[:, 1:], share[None, :, None, None])
    between = torch.cat([local[:, :CONTEXT_FRAMES], quat_to_matrix(quat[:, CONTEXT_FRAMES:])], 1)
    t = share[None, :, None]
    root = truth.root[:, first : first + 1] * (1 - t) + truth.root[:, last : last + 1] * t
    root = torch.cat([truth.root[:, :CONTEXT_FRAMES], root[:, CONTEXT_FRAMES:]], 1)
    return Motion(root, world_rotations(between, parents))
