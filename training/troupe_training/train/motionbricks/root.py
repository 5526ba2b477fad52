"""The root module's training: how many tokens, and the root trajectory."""

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.store import ClipStore, Segments
from troupe_training.models.motionbricks.config import COUNTS, FRAMES_PER_TOKEN, MIN_TOKENS, ModelConfig, config_of
from troupe_training.models.motionbricks.root_choice import envelope
from troupe_training.models.motionbricks.root_module import RootModule, RootPass, baseline_trajectory
from troupe_training.train.checkpoints import Stage
from troupe_training.train.motionbricks.masks import random_slot_masks, slot_frames
from troupe_training.train.motionbricks.teacher import ROOT_SHARE, soft_target
from troupe_training.train.statistics import POSE_AND_ROOT, standardised
from troupe_training.train.trainer import Loss

# The pelvis height decides whether feet meet the ground, so it weighs more than the way.
HEIGHT_WEIGHT = 3.0


def build_root(config: ModelConfig, store: ClipStore) -> RootModule:
    """A new root module with its standardisation constants set."""
    return standardised(RootModule(config, store.skeleton.joint_count), store, **POSE_AND_ROOT)


ROOT = Stage("root", config_of, build_root)


def root_pass(
    model: RootModule, segments: Segments, masks: dict[str, Tensor], timing_known: Tensor
) -> tuple[Tensor, RootPass]:
    """Count logits ``[B, 14]`` and what step 2 gives for segments of known length."""
    batch, tokens = len(segments.pose), segments.frames // FRAMES_PER_TOKEN
    device = segments.pose.device
    masks = {name: mask.to(device) for name, mask in masks.items()}
    index = slot_frames(segments.frames)
    slots = {"local_root": segments.local_root, "global_root": segments.global_root, "pose": segments.pose}
    values = {name: value[:, index] * masks[name][..., None] for name, value in slots.items()}
    f = model.constraints(values, masks)
    count = torch.full((batch,), tokens - MIN_TOKENS, device=device)
    one_hot = F.one_hot(count, COUNTS).float()
    known = timing_known.to(device)[:, None]
    hidden, logits = model.count_logits(f, one_hot * known, known)
    num_tokens = count + MIN_TOKENS
    base = baseline_trajectory(values["local_root"], values["global_root"], masks["global_root"], num_tokens)
    refined, valid = model.refined(hidden, f, one_hot, num_tokens)
    free = envelope(masks["global_root"], num_tokens)
    return logits, RootPass(model.read_out(refined, base), refined, valid, free)


def run_root(
    model: RootModule, segments: Segments, masks: dict[str, Tensor], timing_known: Tensor
) -> tuple[Tensor, Tensor]:
    """Count logits ``[B, 14]`` and r_g3 ``[B, T, 5]`` for segments of known length."""
    logits, given = root_pass(model, segments, masks, timing_known)
    return logits, given.root[:, : segments.frames]


def root_loss(store: ClipStore, frames_budget: int, teacher: RootModule | None = None) -> Loss[RootModule]:
    """Loss of the root module: cross-entropy of the count, and the trajectory in metres."""

    def loss(model: RootModule, generator: Generator, progress: float) -> dict[str, Tensor]:
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        masks = random_slot_masks(batch, generator)
        known = (torch.rand(batch, generator=generator) < 0.5).float()
        logits, root = run_root(model, segments, masks, known)
        unknown = (1.0 - known).to(store.device)
        target = torch.full((batch,), frames // FRAMES_PER_TOKEN - MIN_TOKENS, device=store.device)
        wrong = F.cross_entropy(logits.float(), target, reduction="none") * unknown
        weight = torch.ones(batch, frames, device=store.device)
        weight[:, :4] = 3.0
        weight[:, -4:] += 3.0 * masks["global_root"][:, 4:].to(store.device)
        aim = segments.global_root
        if teacher is not None:
            with torch.no_grad():
                taught = run_root(teacher, segments, masks, known)[1]
            aim = soft_target(aim, taught, ROOT_SHARE)
        error = (root - aim).abs() * (weight / weight.mean())[..., None]
        error[..., 1] = error[..., 1] * HEIGHT_WEIGHT
        step = ((root[:, 1:] - root[:, :-1]) - (aim[:, 1:] - aim[:, :-1])).abs() * 30.0
        return {
            "count": 0.05 * (wrong.sum() / unknown.sum().clamp_min(1.0)),
            "position": 2.0 * error[..., :3].mean(),
            "heading": error[..., 3:].mean(),
            "speed": 0.5 * step.mean(),
        }

    return loss


def predicted_root(root: RootModule, segments: Segments, mask: Tensor, generator: Generator) -> RootPass:
    """The root module's prediction from the keyframes in ``mask`` ``[B, T]``.

    As in most requests a target keyframe with a pose usually has a root too; the rest is drawn at random.
    """
    batch = len(segments.pose)
    masks = random_slot_masks(batch, generator)
    target_poses = mask[:, -MAX_TARGETS:].cpu()
    with_root = torch.rand(batch, 1, generator=generator) < 0.8
    masks["pose"][:, CONTEXT_FRAMES:] = target_poses
    masks["global_root"][:, CONTEXT_FRAMES:] = torch.where(
        with_root & (target_poses.sum(-1, keepdim=True) > 0), target_poses, masks["global_root"][:, CONTEXT_FRAMES:]
    )
    with torch.no_grad():
        return root_pass(root, segments, masks, torch.ones(batch))[1]


def mixed_root(predicted: Tensor, segments: Segments, share: float, generator: Generator) -> Tensor:
    """For a ``share`` of the samples the ``predicted`` roots ``[B, T, 5]``, else the true ones."""
    use = (torch.rand(len(predicted), 1, 1, generator=generator) < share).to(predicted.device)
    return torch.where(use, predicted, segments.global_root)
