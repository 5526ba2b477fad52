"""Mean and deviation of features over random training segments: what networks standardise by."""

from typing import TypeVar

import torch
from torch import Tensor, nn

from troupe_training.data.store import ClipStore
from troupe_training.models.layers import Standardiser

M = TypeVar("M", bound=nn.Module)
BATCHES = 40
FRAMES_PER_BATCH = 4096


def feature_statistics(store: ClipStore) -> dict[str, tuple[Tensor, Tensor]]:
    """Mean and deviation of every feature; deviations have a floor."""
    generator = torch.Generator().manual_seed(1234)
    samples = [store.batch(FRAMES_PER_BATCH, generator) for _ in range(BATCHES)]
    features = {
        "pose": (torch.cat([s.pose.flatten(0, 1) for s in samples]), 0.03),
        "velocity": (torch.cat([s.velocities.flatten(2).flatten(0, 1) for s in samples]), 0.1),
        "local_root": (torch.cat([s.local_root.flatten(0, 1) for s in samples]), 0.05),
        "global_root": (torch.cat([s.global_root.flatten(0, 1) for s in samples]), 0.1),
    }
    return {name: (x.mean(0), x.std(0).clamp_min(floor)) for name, (x, floor) in features.items()}


# Of networks that read poses and roots.
POSE_AND_ROOT = {"pose_scale": "pose", "local_scale": "local_root", "global_scale": "global_root"}


def standardised(model: M, store: ClipStore, **scales: str) -> M:
    """Sets a new model's `Standardiser` modules, each by the name of its feature: ``pose_scale="pose"``."""
    statistics = feature_statistics(store)
    for name, feature in scales.items():
        scale = model.get_submodule(name)
        assert isinstance(scale, Standardiser)
        scale.set(*statistics[feature])
    return model
