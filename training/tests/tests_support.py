"""Helpers for tests."""

from pathlib import Path

import torch

from troupe_training.data.rotations import quat_to_matrix
from troupe_training.train.trainer import Budget, Job


def random_rotations(count: int) -> torch.Tensor:
    """Uniform rotation matrices ``[count, 3, 3]``."""
    quat = torch.randn(count, 4, generator=torch.Generator().manual_seed(0))
    return quat_to_matrix(quat / quat.norm(dim=-1, keepdim=True))


def job(cache: Path, run: Path, steps: int, frames: int = 1024) -> Job:
    """A short training that learns fast."""
    return Job(cache, run, Budget(steps=steps, learning_rate=2e-3, warmup_steps=10), frames, seed=1)
