"""The flow decoder's training: the velocity between noise and motion, with the tokenizer as it is."""

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
from troupe_training.train.trainer import Job, Loss
from troupe_training.train.vermo.tokenizer import CROPS, load_tokenizer

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


def flow_loss(store: ClipStore, tokenizer: Tokenizer, frames_budget: int) -> Loss[FlowDecoder]:
    """Mean square of the velocity's error, and of what it makes of the place."""

    def loss(model: FlowDecoder, generator: Generator, progress: float) -> dict[str, Tensor]:
        batch = store.batch(frames_budget, generator)
        pose, root = batch.pose, batch.global_root
        with torch.no_grad():
            levels = tokenizer.embed(tokenizer.encode(pose, root))
            drafted = tokenizer.decoder(levels).float()
            truth = tokenizer.state_scale(state_of(features(pose, root)))
        noise = torch.randn(truth.shape, generator=generator).to(truth.device)
        time = torch.rand(len(truth), generator=generator).to(truth.device)
        share = time[:, None, None]
        velocity = model((1.0 - share) * noise + share * truth, drafted, levels, time).float()
        pointed = (1.0 - share) * noise + share * truth + (1.0 - share) * velocity
        return {
            "velocity": F.mse_loss(velocity, truth - noise),
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
    return job.fit(STAGE.name, build_flow(config, store), meta, flow_loss(store, tokenizer, job.frames_per_step))
