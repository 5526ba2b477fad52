"""The flow decoder's training: the velocity between noise and what the draft leaves out, with the tokenizer as it is."""

from dataclasses import asdict

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.precision import full_precision
from troupe_training.data.store import ClipStore
from troupe_training.models.vermo.config import PRESETS, FlowConfig
from troupe_training.models.vermo.flow import FlowDecoder
from troupe_training.models.vermo.frames import features, from_first, state_of
from troupe_training.models.vermo.tokenizer import Tokenizer
from troupe_training.train.checkpoints import Stage
from troupe_training.train.statistics import BATCHES, FRAMES_PER_BATCH
from troupe_training.train.trainer import Job, Loss
from troupe_training.train.vermo.tokenizer import CROPS, load_tokenizer

SMALLEST_SPREAD = 0.02  # of a remainder, in units of standardised states
PLACE_WEIGHT = 1.0  # of where the root ends up, in metres, of the motion that a velocity points to


def build_flow(config: FlowConfig, store: ClipStore, levels: int = 5) -> FlowDecoder:
    """A new flow decoder."""
    return FlowDecoder(config, levels, 6 * store.skeleton.joint_count + 4).to(store.device)


STAGE = Stage("flow", FlowConfig, build_flow)


@full_precision
def place_error(tokenizer: Tokenizer, state: Tensor, root: Tensor, time: Tensor) -> Tensor:
    """How far off the root of standardised states ``[B, F, D]`` is, metres; later times count more."""
    _, shown = tokenizer.body.frames(tokenizer.state_scale.invert(state.float()))
    error = (shown[..., :3] - from_first(root)[..., :3]).abs().mean((1, 2))
    return (error * time).mean()


@torch.no_grad()
def drafts(tokenizer: Tokenizer, pose: Tensor, root: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Levels ``[B, T, L]``, draft and captured standardised state ``[B, F, D]`` of captured frames."""
    levels = tokenizer.embed(tokenizer.encode(pose, root))
    return levels, tokenizer.decoder(levels).float(), tokenizer.state_scale(state_of(features(pose, root)))


def set_spread(flow: FlowDecoder, tokenizer: Tokenizer, store: ClipStore) -> None:
    """Measures what the draft leaves of random training segments."""
    generator = torch.Generator().manual_seed(1234)
    left: list[Tensor] = []
    for _ in range(BATCHES):
        batch = store.batch(FRAMES_PER_BATCH, generator)
        _, drafted, truth = drafts(tokenizer, batch.pose, batch.global_root)
        left.append((truth - drafted).flatten(0, 1))
    flow.spread.copy_(torch.cat(left).square().mean(0).sqrt().clamp_min(SMALLEST_SPREAD))


def flow_loss(store: ClipStore, tokenizer: Tokenizer, frames_budget: int) -> Loss[FlowDecoder]:
    """Mean square of the velocity's error, and of the error of place that follows from it."""

    def loss(model: FlowDecoder, generator: Generator, progress: float) -> dict[str, Tensor]:
        batch = store.batch(frames_budget, generator)
        pose, root = batch.pose, batch.global_root
        levels, drafted, truth = drafts(tokenizer, pose, root)
        remainder = (truth - drafted) / model.spread
        noise = torch.randn(truth.shape, generator=generator).to(truth.device)
        time = torch.rand(len(truth), generator=generator).to(truth.device)
        share = time[:, None, None]
        reached = (1.0 - share) * noise + share * remainder
        velocity = model(reached, drafted, levels, time).float()
        pointed = model.finished(reached + (1.0 - share) * velocity, drafted)
        return {
            "velocity": F.mse_loss(velocity, remainder - noise),
            "place": PLACE_WEIGHT * place_error(tokenizer, pointed, root, time),
        }

    return loss


def train_flow(job: Job, preset: str) -> bool:
    """Trains the flow decoder, resuming its checkpoint; true when the budget is spent."""
    torch.manual_seed(job.seed)
    store = ClipStore(job.cache, "train", job.device, job.balance, CROPS)
    tokenizer = load_tokenizer(job.run, store)
    config = PRESETS[preset].flow
    meta = {"model": asdict(config), "preset": preset}
    model = build_flow(config, store)
    set_spread(model, tokenizer, store)
    return job.fit(STAGE.name, model, meta, flow_loss(store, tokenizer, job.frames_per_step))
