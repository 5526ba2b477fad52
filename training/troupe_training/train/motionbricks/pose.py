"""The pose module's training: masked tokens."""

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.store import ClipStore
from troupe_training.models.motionbricks.config import ModelConfig, config_of
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.checkpoints import Stage
from troupe_training.train.motionbricks.masks import cosine_token_mask, random_keyframe_mask
from troupe_training.train.motionbricks.root import mixed_root, predicted_root
from troupe_training.train.motionbricks.teacher import POSE_SHARE, soft_target, taught_entropy
from troupe_training.train.statistics import POSE_AND_ROOT, standardised
from troupe_training.train.trainer import Loss

# Share of predicted, not true, root trajectories. What is served is always predicted.
PREDICTED_ROOTS = 0.5


def build_pose(config: ModelConfig, store: ClipStore) -> PoseModule:
    """A new pose module with its standardisation constants set."""
    return standardised(PoseModule(config, store.skeleton.joint_count), store, **POSE_AND_ROOT)


POSE = Stage("pose", config_of, build_pose)


def pose_loss(
    store: ClipStore, frames_budget: int, tokenizer: Tokenizer, root: RootModule, teacher: PoseModule | None = None
) -> Loss[PoseModule]:
    """Loss of the pose module: cross-entropy of the masked tokens."""

    def loss(model: PoseModule, generator: Generator, progress: float) -> dict[str, Tensor]:
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        with torch.no_grad():
            truth = tokenizer.quantizer.tokens(tokenizer.encode(segments.pose))
        mask = random_keyframe_mask(batch, frames, generator).to(store.device)
        slots, heads = truth.shape[1:]
        hidden = cosine_token_mask(batch, slots, heads, generator).to(store.device)
        tokens = torch.where(hidden, model.codes, truth)
        num_tokens = torch.full((batch,), slots, device=store.device)
        predicted = predicted_root(root, segments, mask, generator).root[:, :frames]
        trajectory = mixed_root(predicted, segments, PREDICTED_ROOTS, generator)
        given = (tokens, num_tokens, trajectory, segments.pose * mask[..., None], mask)
        logits = model(*given)
        entropy = F.cross_entropy(logits.flatten(0, 2), truth.flatten(), reduction="none").reshape(truth.shape)
        if teacher is not None:
            with torch.no_grad():
                taught = teacher(*given)
            entropy = soft_target(entropy, taught_entropy(logits, taught), POSE_SHARE)
        hits = ((logits.argmax(-1) == truth) & hidden).sum() / hidden.sum().clamp_min(1)
        return {"entropy": (entropy * hidden).sum() / hidden.sum().clamp_min(1), "_accuracy": hits}

    return loss
