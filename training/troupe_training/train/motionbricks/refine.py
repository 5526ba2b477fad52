"""The refinement: the decoder learns on what it will be served, predicted roots and tokens."""

import torch
from torch import Generator, Tensor

from troupe_training.data.store import ClipStore
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.motionbricks.live import live_conditions
from troupe_training.train.motionbricks.losses import Body, reconstruction_losses
from troupe_training.train.motionbricks.masks import random_keyframe_mask
from troupe_training.train.motionbricks.root import mixed_root
from troupe_training.train.trainer import Loss

# Share of predicted, not true, root trajectories. A decoder that sees many true ones learns to copy the root's speed
# instead of taking it from the feet, and then they skate.
PREDICTED_ROOTS = 0.9
# Share of the samples that are decoded from true tokens, so that tokens keep their meaning.
GUIDED_SHARE = 0.25
# Share of the updates under the conditions of live control.
LIVE_SHARE = 0.4


def refine_loss(
    store: ClipStore, frames_budget: int, pose: PoseModule, root: RootModule, guided_share: float
) -> Loss[Tokenizer]:
    """Loss of the decoder on what it will be served: predicted roots and tokens, true motion as the aim.

    A ``guided_share`` of the samples has the tokens of the true motion.
    """
    body = Body(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: Generator, progress: float) -> dict[str, Tensor]:
        model.quantizer.eval()  # the codebooks stay: the pose module speaks their language
        if float(torch.rand(1, generator=generator)) < LIVE_SHARE:
            live = live_conditions(store, frames_budget, root, generator)
            segments, trajectory = live.segments, live.trajectory
            given, mask, exact = live.keyframes, live.mask, live.exact
        else:
            segments = store.batch(frames_budget, generator)
            batch, frames = segments.pose.shape[:2]
            mask = random_keyframe_mask(batch, frames, generator).to(store.device)
            trajectory = mixed_root(root, segments, mask, PREDICTED_ROOTS, generator)
            given, exact = segments.pose, mask
        with torch.no_grad():
            batch, slots = len(segments.pose), segments.frames // FRAMES_PER_TOKEN
            num_tokens = torch.full((batch,), slots, device=store.device)
            tokens = torch.full((batch, slots, pose.heads), pose.codes, device=store.device)
            tokens = pose(tokens, num_tokens, trajectory, given * mask[..., None], mask).argmax(-1)
            if guided_share > 0.0:
                truth = model.quantizer.tokens(model.encode(segments.pose))
                guided = torch.rand(batch, 1, 1, generator=generator) < guided_share
                tokens = torch.where(guided.to(store.device), truth, tokens)
            embedded = model.quantizer.embed(tokens)
        out = model.decoder(embedded, trajectory, given, mask)
        return reconstruction_losses(out, segments, exact, model.decoder, body)

    return loss
