"""``evaluator``: trains the motion autoencoder on the train split alone, on segments of any length from 12 to 64 frames."""

from pathlib import Path

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.store import ClipStore
from troupe_training.models.evaluator import Evaluator, inputs_of
from troupe_training.train.statistics import BATCHES, FRAMES_PER_BATCH
from troupe_training.train.trainer import Budget, Loss, Trainer

Errors = dict[str, dict[int, dict[str, float]]]  # of reconstructions, by split, frames and measure
KL_WEIGHT = 1e-5  # TMR's
LEARNING_RATE = 6e-4
REPORTED_WINDOWS = 600
REPORTED_FRAMES = (20, 35, 50)  # windows of gaps of 15, 30 and 45 frames
# Smallest deviations by which features are divided: metres, turns, m/s.
FLOORS = {"root": 0.1, "positions": 0.03, "six_d": 0.03, "velocities": 0.1}


def set_scales(model: Evaluator, store: ClipStore) -> None:
    """Mean and deviation of every feature over random training segments."""
    generator = torch.Generator().manual_seed(1234)
    batches = (store.batch_of_any_length(FRAMES_PER_BATCH, generator) for _ in range(BATCHES))
    rows = torch.cat([model.features(**inputs_of(b)).flatten(0, 1) for b in batches])
    for name, part in model.split(rows).items():
        model.scale(name).set(part.mean(0), part.std(0).clamp_min(FLOORS[name]))


@torch.no_grad()
def set_latent_scale(model: Evaluator, store: ClipStore) -> None:
    """Where the latents of random training segments lie and how far apart."""
    generator = torch.Generator().manual_seed(4321)
    batches = (store.batch_of_any_length(FRAMES_PER_BATCH, generator) for _ in range(BATCHES))
    means = torch.cat([model.encode(model.features(**inputs_of(b)))[0] for b in batches])
    model.centre.copy_(means.mean(0))
    model.spread.copy_((means - model.centre).square().sum(-1).mean().sqrt().clamp_min(1e-6))


def loss_of(store: ClipStore, frames_budget: int) -> Loss[Evaluator]:
    """TMR's losses: smooth L1 of the reconstruction, and a little of the divergence to the standard normal."""

    def loss(model: Evaluator, generator: Generator, progress: float) -> dict[str, Tensor]:
        features = model.features(**inputs_of(store.batch_of_any_length(frames_budget, generator)))
        mean, logarithm = (x.float() for x in model.encode(features))
        noise = torch.randn(mean.shape, generator=generator).to(mean.device)
        made = model.decode(mean + noise * torch.exp(0.5 * logarithm), features.shape[1]).float()
        divergence = 0.5 * (mean**2 + logarithm.exp() - 1.0 - logarithm).mean()
        return {"reconstruction": F.smooth_l1_loss(made, features), "kl": KL_WEIGHT * divergence}

    return loss


@torch.no_grad()
def reconstruction_error(model: Evaluator, store: ClipStore, frames: int) -> dict[str, float]:
    """How far the decoder's joints, roots and velocities are off on segments of ``frames`` frames, in the mean."""
    starts, _ = store.windows(frames, frames // 2, REPORTED_WINDOWS)
    sums, count = {"joint_m": 0.0, "root_m": 0.0, "velocity_mps": 0.0}, 0
    for chunk in starts.split(64):
        features = model.features(**inputs_of(store.segments(chunk, frames)))
        made = model.decode(model.encode(features)[0], frames)
        a, b = (
            {name: model.scale(name).invert(part) for name, part in model.split(x).items()} for x in (made, features)
        )
        for name, key in (("joint_m", "positions"), ("velocity_mps", "velocities")):
            distance = (a[key] - b[key]).unflatten(-1, (model.joints, 3)).norm(dim=-1)
            sums[name] += float(distance.mean()) * len(chunk)
        sums["root_m"] += float((a["root"] - b["root"])[..., :3].norm(dim=-1).mean()) * len(chunk)
        count += len(chunk)
    return {name: value / max(count, 1) for name, value in sums.items()}


def train_evaluator(
    cache: Path, run: Path, budget: Budget, frames_budget: int, seed: int, device: str
) -> tuple[Evaluator, int, Errors] | None:
    """Trains, or goes on: the evaluator with its latents scaled, its updates and errors; None if it was stopped."""
    torch.manual_seed(seed)
    store = ClipStore(cache, "train", device)
    model = Evaluator(store.skeleton.joint_count).to(device)
    set_scales(model, store)
    meta = {"seed": seed, "frames_budget": frames_budget, "joints": model.joints}
    trainer = Trainer(run, "evaluator", model, budget, meta, seed, device)
    if trainer.resume():
        print(f"evaluator: going on from step {trainer.step}")
    if not trainer.fit(loss_of(store, frames_budget)):
        return None
    model = trainer.average.to("cpu").eval().requires_grad_(False)
    store, test = ClipStore(cache, "train"), ClipStore(cache, "test")
    set_latent_scale(model, store)
    errors = {
        name: {frames: reconstruction_error(model, split, frames) for frames in REPORTED_FRAMES}
        for name, split in (("train", store), ("test", test))
    }
    return model, trainer.step, errors
