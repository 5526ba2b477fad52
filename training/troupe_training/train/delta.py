"""Trains the deterministic baseline."""

from dataclasses import asdict

import torch
from torch import Generator, Tensor

from troupe_training.data.kinematics import Kinematics
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.data.store import ClipStore
from troupe_training.models.delta import PRESETS, DeltaConfig, DeltaInterpolator, DeltaMethod
from troupe_training.train.checkpoints import Stage
from troupe_training.train.statistics import standardised
from troupe_training.train.trainer import Job, Loss


def build_delta(config: DeltaConfig, store: ClipStore) -> DeltaInterpolator:
    """A new network with its standardisation constants set."""
    model = DeltaInterpolator(config, store.skeleton.joint_count)
    return standardised(model, store, pose_scale="pose", global_scale="global_root")


DELTA = Stage("delta", DeltaConfig, build_delta)


def delta_loss(store: ClipStore, frames_budget: int) -> Loss[DeltaInterpolator]:
    """L1 of rotations, root and joint positions over the frames that were not given; segments of all lengths."""
    kinematics = Kinematics(store.skeleton, store.device)

    def loss(model: DeltaInterpolator, generator: Generator, progress: float) -> dict[str, Tensor]:
        segments = store.batch_of_any_length(frames_budget, generator)
        six_d, root, given = DeltaMethod(model, store.skeleton, store.device).fill(segments)
        free = given == 0
        made = kinematics.positions(six_d_to_matrix(six_d))[:, free] + root[:, free, None]
        truth = segments.positions + segments.global_root[:, :, None, :3] * torch.tensor(
            [1.0, 0.0, 1.0], device=root.device
        )
        return {
            "rotation": (six_d - segments.six_d)[:, free].abs().mean(),
            "root": 2.0 * (root - segments.global_root[..., :3])[:, free].abs().mean(),
            "fk": 6.0 * (made - truth[:, free]).abs().mean(),
        }

    return loss


def train_delta(job: Job, preset: str) -> bool:
    """Trains it, resuming its checkpoint; true when the budget is spent."""
    if preset not in PRESETS:
        raise SystemExit(f"the deterministic baseline has the presets {', '.join(PRESETS)}, not {preset}")
    torch.manual_seed(job.seed)
    store, config = job.store(), PRESETS[preset]
    model = DELTA.build(config, store).to(job.device)
    meta = {"model": asdict(config), "preset": preset}
    return job.fit(DELTA.name, model, meta, delta_loss(store, job.frames_per_step))
