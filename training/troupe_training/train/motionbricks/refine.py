"""The refinement: the decoder learns on what it will be served, predicted roots and tokens."""

from dataclasses import dataclass

import torch
from torch import Generator, Tensor

from troupe_training.data.store import ClipStore, Segments
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.root_choice import RootChoice
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.motionbricks.choice import chosen_root
from troupe_training.train.motionbricks.draws import LIKELIEST_SHARE, best_tokens
from troupe_training.train.motionbricks.live import live_conditions
from troupe_training.train.motionbricks.losses import Body, reconstruction_losses
from troupe_training.train.motionbricks.masks import random_keyframe_mask
from troupe_training.train.motionbricks.root import mixed_root, predicted_root
from troupe_training.train.trainer import Loss

# Share of predicted, not true, root trajectories. A decoder that sees many true ones learns to copy
# the root's speed instead of taking it from the feet, and then they skate.
PREDICTED_ROOTS = 0.9
# Share of the samples that are decoded from true tokens, so that tokens keep their meaning.
GUIDED_SHARE = 0.25
# Share of the updates under the conditions of live control.
LIVE_SHARE = 0.4
# Of tokens for each sample, of which the nearest are decoded. None: draws did not make answers more
# varied, and cost the likeliest answer a hundredth of its L2P (docs/evaluation.md).
DRAWS = 0


@dataclass
class Guides:
    """The networks that the decoder follows, and how: ``guided_share`` of the samples has the tokens of the true motion.

    Of ``draws`` draws of tokens the nearest are taken (`draws.py`); with 0 tokens are always the likeliest. With a ``choice``
    the roots that go with them are drawn too.
    """

    pose: PoseModule
    root: RootModule
    guided_share: float
    draws: int = DRAWS
    choice: RootChoice | None = None


@dataclass
class Task:
    """What the decoder is given for a batch. ``drawn`` ``[B, 1, 1]`` marks the samples whose root and tokens are drawn."""

    segments: Segments
    trajectory: Tensor  # [B, T, 5]
    keyframes: Tensor  # [B, T, J*9], valid where mask is 1
    mask: Tensor  # [B, T]
    exact: Tensor  # [B, T]: keyframes that are given as they truly are
    drawn: Tensor


def refine_loss(store: ClipStore, frames_budget: int, guides: Guides) -> Loss[Tokenizer]:
    """Loss of the decoder on what it will be served: predicted roots and tokens, true motion as the aim."""
    body = Body(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: Generator, progress: float) -> dict[str, Tensor]:
        model.quantizer.eval()  # the codebooks stay: the pose module speaks their language
        live = float(torch.rand(1, generator=generator)) < LIVE_SHARE
        task = (live_task if live else request_task)(store, frames_budget, guides, generator)
        with torch.no_grad():
            embedded = model.quantizer.embed(tokens_of(model, guides, task, body, generator))
        out = model.decoder(embedded, task.trajectory, task.keyframes, task.mask)
        return reconstruction_losses(out, task.segments, task.exact, model.decoder, body)

    return loss


def which_are_drawn(batch: int, guides: Guides, store: ClipStore, generator: Generator) -> Tensor:
    """``[B, 1, 1]`` booleans: all but `LIKELIEST_SHARE`, and none without draws."""
    drawn = torch.rand(batch, 1, 1, generator=generator) >= (LIKELIEST_SHARE if guides.draws else 1.0)
    return drawn.to(store.device)


def live_task(store: ClipStore, frames_budget: int, guides: Guides, generator: Generator) -> Task:
    """A batch under the conditions of live control, whose root is given."""
    live = live_conditions(store, frames_budget, guides.root, generator)
    drawn = which_are_drawn(len(live.mask), guides, store, generator)
    return Task(live.segments, live.trajectory, live.keyframes, live.mask, live.exact, drawn)


def request_task(store: ClipStore, frames_budget: int, guides: Guides, generator: Generator) -> Task:
    """A batch as requests pose it."""
    segments = store.batch(frames_budget, generator)
    batch, frames = segments.pose.shape[:2]
    mask = random_keyframe_mask(batch, frames, generator).to(store.device)
    drawn = which_are_drawn(batch, guides, store, generator)
    given = predicted_root(guides.root, segments, mask, generator)
    predicted = given.root[:, :frames]
    if guides.choice is not None and guides.draws:
        predicted = torch.where(drawn, chosen_root(guides.choice, given, segments, generator), predicted)
    trajectory = mixed_root(predicted, segments, PREDICTED_ROOTS, generator)
    return Task(segments, trajectory, segments.pose, mask, mask, drawn)


def tokens_of(model: Tokenizer, guides: Guides, task: Task, body: Body, generator: Generator) -> Tensor:
    """Tokens ``[B, n, K]``: the likeliest, the nearest of several draws, or those of the true motion."""
    pose, segments, mask = guides.pose, task.segments, task.mask
    batch, slots = len(segments.pose), segments.frames // FRAMES_PER_TOKEN
    num_tokens = torch.full((batch,), slots, device=mask.device)
    hidden = torch.full((batch, slots, pose.heads), pose.codes, device=mask.device)
    logits = pose(hidden, num_tokens, task.trajectory, task.keyframes * mask[..., None], mask)
    tokens = logits.argmax(-1)
    rows = task.drawn[:, 0, 0].nonzero()[:, 0]
    if len(rows):
        given = (task.trajectory[rows], task.keyframes[rows], mask[rows])
        tokens[rows] = best_tokens(model, logits[rows], guides.draws, given, segments.positions[rows], body, generator)
    if guides.guided_share > 0.0:
        truth = model.quantizer.tokens(model.encode(segments.pose))
        guided = torch.rand(batch, 1, 1, generator=generator) < guides.guided_share
        tokens = torch.where(guided.to(mask.device), truth, tokens)
    return tokens
