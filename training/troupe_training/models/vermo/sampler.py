"""Sampling of replies: masks, repetition, temperature, top-k, top-p, and a draw that the seed and the place alone decide.

A server samples by the same steps; its numbers are other ones, since each has its own generator.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from troupe_training.models.vermo.config import MAX_TOKENS, MIN_TOKENS
from troupe_training.models.vermo.language import LanguageModel, Served
from troupe_training.models.vermo.messages import EOS, PAD, Message, Rules, Vocabulary

REPEATED = 8  # tokens back that `Sampling.repetition` looks


@dataclass(frozen=True)
class Sampling:
    """How a token is drawn from logits. ``temperature`` 0: the largest; ``top_k`` 0: of all."""

    temperature: float = 1.0
    top_k: int = 0
    top_p: float = 1.0
    repetition: float = 1.0

    def draw(self, logits: Tensor, recent: list[int], seed: int, place: int) -> int:
        """A token from masked logits ``[V]``."""
        if self.repetition != 1.0 and recent:
            seen = torch.tensor(sorted(set(recent[-REPEATED:])))
            values = logits[seen]
            logits = logits.index_put(
                (seen,), torch.where(values > 0, values / self.repetition, values * self.repetition)
            )
        if self.temperature == 0.0:
            return int(logits.argmax())
        values, order = torch.sort(logits / self.temperature, descending=True, stable=True)
        if self.top_k:
            values, order = values[: self.top_k], order[: self.top_k]
        shares = torch.softmax(values.double(), -1)
        kept = shares.cumsum(-1) - shares < self.top_p  # the first is always kept
        shares = shares * kept
        generator = torch.Generator().manual_seed((seed * 0x9E3779B1 + place) % 2**63)
        point = torch.rand((), generator=generator, dtype=torch.float64) * shares.sum()
        return int(order[min(int((shares.cumsum(-1) <= point).sum()), len(order) - 1)])


@dataclass
class Asked:
    """A message to be answered."""

    message: Message
    seed: int
    agents: int = 1


def replies(
    model: LanguageModel, asked: list[Asked], sampling: Sampling, most: int = MAX_TOKENS, least: int = MIN_TOKENS
) -> list[list[int]]:
    """Replies' ids without `<EOS>`, all sequences side by side over one cache."""
    served = Served(model).eval()
    vocabulary, config = model.vocabulary, model.config
    prompts = [one.message.prompt(vocabulary) for one in asked]
    rules = [Rules(a.message.task, least, most, config.positions, a.agents, a.message.length) for a in asked]
    longest = max(map(len, prompts))
    tokens = torch.tensor([prompt + [PAD] * (longest - len(prompt)) for prompt in prompts])
    count = torch.tensor([len(prompt) for prompt in prompts])
    start = torch.zeros(len(asked), dtype=torch.long)
    shape = (len(asked), config.layers, 2, config.key_heads, config.positions, config.head_width)
    cache = torch.zeros(shape)
    made: list[list[int]] = [[] for _ in asked]
    running = list(range(len(asked)))
    with torch.no_grad():
        filled = int((start + count).max())
        logits, columns = served(tokens, count, start, cache[..., :1, :])
        cache[..., :longest, :] = columns
        start = count.clone()
        while running:
            nxt = [
                _next(vocabulary, rules[i], len(prompts[i]), made[i], logits[n], sampling, asked[i].seed)
                for n, i in enumerate(running)
            ]
            alive = [n for n, token in enumerate(nxt) if token != EOS]
            for n in alive:
                made[running[n]].append(nxt[n])
            running = [running[n] for n in alive]
            if not running:
                break
            index = torch.tensor(running)
            step = torch.tensor([[nxt[n]] for n in alive])
            filled = int(start[index].max())
            logits, columns = served(
                step, torch.ones(len(index), dtype=torch.long), start[index], cache[index][..., :filled, :]
            )
            cache[index, :, :, :, start[index]] = columns[..., 0, :]
            start[index] += 1
    return made


def _next(
    vocabulary: Vocabulary, rules: Rules, prompt: int, made: list[int], logits: Tensor, sampling: Sampling, seed: int
) -> int:
    mask = rules.allowed(vocabulary, prompt, made)
    return sampling.draw(logits.masked_fill(~mask, float("-inf")), made, seed, len(made))
