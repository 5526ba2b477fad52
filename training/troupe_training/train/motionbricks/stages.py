"""The training stages: tokenizer, root, pose, the root's choice, and the decoder's refinement on what the modules predict."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TypeVar

import torch
from torch import nn

from troupe_training.data.store import ClipStore
from troupe_training.models.motionbricks.config import PRESETS, ModelConfig
from troupe_training.models.motionbricks.served import Networks
from troupe_training.train.checkpoints import Stage, write_checkpoint
from troupe_training.train.motionbricks.choice import CHOICE, choice_loss, fitted_width, widen
from troupe_training.train.motionbricks.pose import POSE, pose_loss
from troupe_training.train.motionbricks.refine import DRAWS, GUIDED_SHARE, Guides, refine_loss
from troupe_training.train.motionbricks.root import ROOT, root_loss
from troupe_training.train.motionbricks.teacher import lend_tokens
from troupe_training.train.motionbricks.tokenizer import ENCODER, REFINE, TOKENIZER, encoder_loss, tokenizer_loss
from troupe_training.train.trainer import Job

M = TypeVar("M", bound=nn.Module)
# The stages that `pack` trains, and all that a run may have.
PACK_STAGES = tuple(stage.name for stage in (TOKENIZER, ROOT, POSE, REFINE))
STAGES = tuple(stage.name for stage in (TOKENIZER, ENCODER, ROOT, POSE, CHOICE, REFINE))


def is_adopted(run: Path) -> bool:
    """Whether a run's tokenizer came out of a pack, and so has no trained encoder."""
    return bool(TOKENIZER.read(run)["meta"].get("adopted", False))


def load_networks(run: Path, store: ClipStore) -> Networks:
    """The networks of a run, its decoder refined if it has been; else with the encoder that an adopted one has got again."""
    tokenizer = next((stage for stage in (REFINE, ENCODER) if stage.path(run).exists()), TOKENIZER)
    choice = CHOICE.load(run, store) if CHOICE.path(run).exists() else None
    return Networks(tokenizer.load(run, store), ROOT.load(run, store), POSE.load(run, store), choice)


def _trained(stage: Stage[ModelConfig, M], run: Path, store: ClipStore, substitute: M | None) -> M:
    """A network of the run, or the teacher's where the run has none yet."""
    if substitute is not None and not stage.path(run).exists():
        return substitute
    return stage.load(run, store)


def train_stage(
    stage: str,
    job: Job,
    preset: str | ModelConfig,
    teacher_run: Path | None = None,
    draws: int = DRAWS,
    curve_frames: int = 4,
) -> bool:
    """Trains one stage, resuming its checkpoint; true when its budget is spent.

    ``preset`` names network sizes, or holds those of a variant. ``teacher_run`` is the run of a large pack to learn from,
    whose root module then stands in where this run has none yet. ``draws`` of tokens are what the refinement chooses from,
    ``curve_frames`` are those of a piece of the choice's curves.
    """
    torch.manual_seed(job.seed)
    store, frames = job.store(), job.frames_per_step
    name, config = ("variant", preset) if isinstance(preset, ModelConfig) else (preset, PRESETS[preset])
    teacher = load_networks(teacher_run, store) if teacher_run else None
    if stage == REFINE.name:
        return _refine(job, store, name, teacher, draws)
    if stage == CHOICE.name:
        return _choose(job, store, name, curve_frames)
    if stage == ENCODER.name:
        return _encode(job, store, name)
    meta = {"model": asdict(config), "preset": name}
    if stage == TOKENIZER.name:
        tokenizer = TOKENIZER.build(config, store).to(job.device)
        if teacher:
            lend_tokens(teacher.tokenizer, tokenizer)
        return job.fit(stage, tokenizer, meta, tokenizer_loss(store, frames, teacher is not None))
    if stage == ROOT.name:
        root = ROOT.build(config, store).to(job.device)
        return job.fit(stage, root, meta, root_loss(store, frames, teacher.root if teacher else None))
    pose = POSE.build(config, store).to(job.device)
    tokens = _trained(TOKENIZER, job.run, store, teacher.tokenizer if teacher else None)
    roots = _trained(ROOT, job.run, store, teacher.root if teacher else None)
    return job.fit(stage, pose, meta, pose_loss(store, frames, tokens, roots, teacher.pose if teacher else None))


def _choose(job: Job, store: ClipStore, preset: str, curve_frames: int) -> bool:
    """Trains the choice of roots beside the run's root module, then fits its width on the clips that were held back."""
    root = ROOT.load(job.run, store)
    config = replace(ROOT.config(**ROOT.read(job.run)["meta"]["model"]), root_curve_frames=curve_frames)
    choice = CHOICE.build(config, store).to(job.device)
    meta = {"model": asdict(config), "preset": preset}
    if not job.fit(CHOICE.name, choice, meta, choice_loss(store, job.frames_per_step, root)):
        return False
    width = fitted_width(CHOICE.load(job.run, store), store, job.frames_per_step, root, job.seed)
    write_checkpoint(CHOICE.path(job.run), widen(CHOICE.read(job.run), width))
    print(f"{CHOICE.name}: {width:.3f} times as wide as on its own clips")
    return True


def _encode(job: Job, store: ClipStore, preset: str) -> bool:
    """Gives the run's adopted tokenizer an encoder: codebooks and decoder stay as they are."""
    if not is_adopted(job.run):
        raise SystemExit(f"{TOKENIZER.path(job.run)} has its own encoder: this stage is for what `adopt` wrote")
    tokenizer = TOKENIZER.load(job.run, store)
    tokenizer.encoder.requires_grad_(True)
    meta = {"model": asdict(tokenizer.config), "preset": preset}
    return job.fit(ENCODER.name, tokenizer, meta, encoder_loss(store, job.frames_per_step))


def _refine(job: Job, store: ClipStore, preset: str, teacher: Networks | None, draws: int) -> bool:
    """Trains the decoder of the run's tokenizer further. One out of a pack has no encoder whose tokens could guide it."""
    tokenizer, adopted = TOKENIZER.load(job.run, store), is_adopted(job.run)
    tokenizer.decoder.requires_grad_(True)
    pose = _trained(POSE, job.run, store, teacher.pose if teacher else None)
    root = _trained(ROOT, job.run, store, teacher.root if teacher else None)
    choice = CHOICE.load(job.run, store) if CHOICE.path(job.run).exists() else None
    guides = Guides(pose, root, 0.0 if adopted else GUIDED_SHARE, draws, choice)
    loss = refine_loss(store, job.frames_per_step, guides)
    meta = {"model": asdict(tokenizer.config), "preset": preset, "draws": draws} | (
        {"adopted": True} if adopted else {}
    )
    return job.fit(REFINE.name, tokenizer, meta, loss)
