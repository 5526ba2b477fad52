"""The tokenizer's training: what it gives is compared as a viewer sees it, over crops of up to 256 frames.

Most of a reconstruction's error is drift: small errors of velocity and turn that add up. The place is therefore compared after
it has been integrated, over several horizons and over the whole crop.
"""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.conventions import FPS
from troupe_training.data.precision import full_precision
from troupe_training.data.store import ClipStore
from troupe_training.models.layers import Standardiser
from troupe_training.models.vermo.config import MAX_TOKENS, PRESETS, RATE, TokenizerConfig
from troupe_training.models.vermo.frames import (
    LOCAL_ROOT,
    features,
    from_first,
    seen_from_first,
    state_of,
    turned,
    world_joints,
)
from troupe_training.models.vermo.tokenizer import Tokenizer
from troupe_training.train.checkpoints import Stage
from troupe_training.train.statistics import BATCHES, FRAMES_PER_BATCH
from troupe_training.train.trainer import Job, Loss

CROPS = tuple(range(8 * RATE, MAX_TOKENS * RATE + 1, 8 * RATE))  # frames
HORIZONS = (4, 16, 64)  # frames over which steps are added up
# Smallest deviations by which features are divided: metres and parts of unit vectors, then of the
# local root.
POSE_FLOOR, ROOT_FLOOR = 0.03, (0.1, 0.1, 0.1, 0.03)
WEIGHTS = {"rotation": 1.0, "position": 8.0, "root": 0.5, "speed": 0.4, "horizon": 4.0, "heading": 1.0, "world": 3.0}
COMMITMENT = 0.25  # weight of the distance from latents to a codebook's codes
BEND = 0.02  # metres below which an error counts by its square


def set_scale(scale: Standardiser, store: ClipStore, of_state: bool = False) -> None:
    """Standardises features, or states, by random training segments."""
    generator = torch.Generator().manual_seed(1234)
    batches = (store.batch(FRAMES_PER_BATCH, generator) for _ in range(BATCHES))
    rows = torch.cat([features(b.pose, b.global_root).flatten(0, 1) for b in batches])
    rows = state_of(rows) if of_state else rows
    floor = torch.full((rows.shape[-1],), POSE_FLOOR, device=rows.device)
    floor[-LOCAL_ROOT:] = torch.tensor(ROOT_FLOOR, device=rows.device)
    scale.set(rows.mean(0), torch.maximum(rows.std(0), floor))


def build_tokenizer(config: TokenizerConfig, store: ClipStore) -> Tokenizer:
    """A new tokenizer, whose standardisation constants are not set."""
    return Tokenizer(config, store.skeleton).to(store.device)


def config_of(levels: list[int], **sizes: Any) -> TokenizerConfig:
    """Sizes as a checkpoint notes them."""
    return TokenizerConfig(levels=tuple(levels), **sizes)


STAGE = Stage("tokenizer", config_of, build_tokenizer)
REFINE = Stage("refine", config_of, build_tokenizer)  # the tokenizer again, its decoder alone trained further


def load_tokenizer(run: Path, store: ClipStore) -> Tokenizer:
    """The tokenizer of a run, its decoder refined if it has been. The codes of a motion are the same.

    Ends the command if it has a codebook: language models and packs build on the grid of levels.
    """
    stage = REFINE if REFINE.path(run).exists() else STAGE
    tokenizer = stage.load(run, store)
    if tokenizer.config.quantizer != "fsq":
        raise SystemExit(f"{stage.path(run)} has a codebook: all but the tokenizer's training needs --quantizer fsq")
    return tokenizer


def travelled(root: Tensor, frames: int) -> Tensor:
    """Where the root is after some frames, seen from each frame: ``[B, F - frames, 2]``, m to the side and ahead."""
    step = root[:, frames:, :3] - root[:, :-frames, :3]
    return turned(step, root[:, :-frames, 3], -root[:, :-frames, 4])[..., [0, 2]]


@full_precision
def reconstruction_losses(model: Tokenizer, state: Tensor, pose: Tensor, root: Tensor) -> dict[str, Tensor]:
    """Named, weighted terms of states ``[B, F, D]`` against captured frames, and ``_mpjpe`` in metres."""
    truth = features(pose, root)
    true_state = state_of(truth)
    rotations, local = model.body.split(state)
    scale = model.state_scale
    rotation = F.smooth_l1_loss(
        scale(state)[..., :-LOCAL_ROOT], scale(true_state)[..., :-LOCAL_ROOT], beta=0.2, reduction="mean"
    )
    joints = model.body.positions(rotations, local[..., 3])
    true_joints = truth[..., :-LOCAL_ROOT].unflatten(-1, (-1, 9))[..., :3]
    shown_pose, shown_root = model.body.frames(state)
    true_root = from_first(root)
    world, true_world = world_joints(shown_pose, shown_root), seen_from_first(pose, root)
    error = (world - true_world).norm(dim=-1)
    speed = (world[:, 1:] - world[:, :-1] - true_world[:, 1:] + true_world[:, :-1]) * FPS
    spans = [h for h in HORIZONS if h < root.shape[1]]
    horizon = [F.smooth_l1_loss(travelled(shown_root, h), travelled(true_root, h), beta=BEND) for h in spans]
    terms = {
        "rotation": rotation,
        "position": F.smooth_l1_loss(joints, true_joints, beta=BEND),
        "root": F.smooth_l1_loss(scale(state)[..., -LOCAL_ROOT:], scale(true_state)[..., -LOCAL_ROOT:]),
        "speed": speed.abs().mean(),
        "horizon": torch.stack(horizon).mean(),
        "heading": (shown_root[..., 3:] - true_root[..., 3:]).abs().mean(),
        "world": F.smooth_l1_loss(world, true_world, beta=BEND),
    }
    return {name: WEIGHTS[name] * term for name, term in terms.items()} | {"_mpjpe": error.mean()}


def tokenizer_loss(store: ClipStore, frames_budget: int, refine: bool = False) -> Loss[Tokenizer]:
    """Encode, round to levels, decode, compare. ``refine``: only the decoder learns."""

    def loss(model: Tokenizer, generator: Generator, progress: float) -> dict[str, Tensor]:
        batch = store.batch(frames_budget, generator)
        pose, root = batch.pose, batch.global_root
        with torch.set_grad_enabled(not refine):
            embedded, tokens, commitment = model.quantizer(model.latent(pose, root))
        terms = reconstruction_losses(model, model.state(embedded), pose, root)
        if model.config.quantizer == "vq":
            terms["commitment"] = COMMITMENT * commitment
        used = torch.unique(tokens).numel() / tokens.numel()
        return terms | {"_different": torch.tensor(used)}

    return loss


def train_tokenizer(job: Job, preset: str, quantizer: str = "fsq") -> bool:
    """Trains the tokenizer, resuming its checkpoint; true when the budget is spent.

    What the checkpoint was begun with, it goes on with: another quantizer ends the command.
    """
    torch.manual_seed(job.seed)
    if STAGE.path(job.run).exists():
        begun = config_of(**STAGE.read(job.run)["meta"]["model"]).quantizer
        if begun != quantizer:
            raise SystemExit(
                f"{STAGE.path(job.run)} was begun with --quantizer {begun}: give the same, or another --run"
            )
    store = ClipStore(job.cache, "train", job.device, job.balance, CROPS)
    config = replace(PRESETS[preset].tokenizer, quantizer=quantizer)
    model = build_tokenizer(config, store)
    set_scale(model.feature_scale, store)
    set_scale(model.state_scale, store, of_state=True)
    meta = {"model": asdict(config) | {"levels": list(config.levels)}, "preset": preset}
    return job.fit(STAGE.name, model, meta, tokenizer_loss(store, job.frames_per_step))


def refine_tokenizer(job: Job) -> bool:
    """Trains the decoder of the run's tokenizer further, while its codes stay; true when the budget is spent."""
    torch.manual_seed(job.seed)
    store = ClipStore(job.cache, "train", job.device, job.balance, CROPS)
    if config_of(**STAGE.read(job.run)["meta"]["model"]).quantizer != "fsq":
        raise SystemExit(f"{STAGE.path(job.run)} has a codebook: the stage 'refine' needs --quantizer fsq")
    model = STAGE.load(job.run, store)
    model.decoder.requires_grad_(True)
    return job.fit(REFINE.name, model, STAGE.read(job.run)["meta"], tokenizer_loss(store, job.frames_per_step, True))
