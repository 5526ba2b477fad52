"""Helpers for tests."""

import torch


def random_rotations(count: int) -> torch.Tensor:
    """Uniform rotation matrices ``[count, 3, 3]``."""
    quat = torch.randn(count, 4, generator=torch.Generator().manual_seed(0))
    from troupe_training.rotations import quat_to_matrix

    return quat_to_matrix(quat / quat.norm(dim=-1, keepdim=True))
