"""Best of several draws: of tokens drawn from the pose module those that lie nearest to the captured motion.

A decoder that only sees the likeliest tokens learns that they say nothing of what is to come: two captured motions have the
same ones. Of N draws the nearest one says something. Tokens of one pass are drawn independently, so each slot takes
its own nearest draw: four draws then come as near as the best of sixteen whole ones.
"""

import torch
from torch import Generator, Tensor

from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN
from troupe_training.models.motionbricks.tokenizer import Decoded, Tokenizer
from troupe_training.train.motionbricks.losses import Body

# Share of the samples that keep the likeliest tokens along the likeliest root, so that answers at
# temperature 0 stay good.
LIKELIEST_SHARE = 0.35


def drawn_tokens(logits: Tensor, draws: int, generator: Generator) -> Tensor:
    """``draws`` draws ``[N, B, n, K]`` of tokens from logits ``[B, n, K, C]``, at temperature 1."""
    chances = torch.softmax(logits.float().cpu(), -1)
    drawn = torch.multinomial(chances.flatten(0, -2), draws, replacement=True, generator=generator)
    return drawn.T.reshape(draws, *logits.shape[:-1]).to(logits.device)


def nearest_draws(errors: Tensor, tokens: Tensor) -> Tensor:
    """Of draws ``[N, B, n, K]`` for each slot those with the least of ``errors`` ``[N, B, n]``: ``[B, n, K]``."""
    best = errors.argmin(0)[None, :, :, None].expand(1, -1, -1, tokens.shape[-1])
    return tokens.gather(0, best)[0]


def slot_errors(out: Decoded, captured: Tensor, body: Body) -> Tensor:
    """Mean distance ``[B, n]`` of a joint to its ``captured`` place ``[B, T, J, 3]``, by slot, seen from the root; metres."""
    shown = body.positions(out.rotations)
    captured = captured - captured[:, :, :1] + shown[:, :, :1]
    return (shown - captured).norm(dim=-1).mean(-1).unflatten(1, (-1, FRAMES_PER_TOKEN)).mean(-1)


@torch.no_grad()
def best_tokens(
    model: Tokenizer,
    logits: Tensor,
    draws: int,
    given: tuple[Tensor, Tensor, Tensor],
    captured: Tensor,
    body: Body,
    generator: Generator,
) -> Tensor:
    """The nearest of ``draws`` draws to what was ``captured`` ``[B, T, J, 3]``: ``[B, n, K]``.

    ``given`` are the root, keyframes and mask that the decoder gets.
    """
    tokens = drawn_tokens(logits, draws, generator)
    errors = [slot_errors(model.decoder(model.quantizer.embed(one), *given), captured, body) for one in tokens]
    return nearest_draws(torch.stack(errors), tokens)
