"""Sampling of replies: masks, repetition, temperature, top-k, top-p, and a draw that the seed and the place alone decide.

A server samples by the same steps; its numbers are other ones, since each has its own generator.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import torch
from torch import Tensor

from troupe_training.models.vermo.config import MAX_TOKENS, MIN_TOKENS, LanguageConfig
from troupe_training.models.vermo.messages import EOS, PAD, Message, Rules, Vocabulary

REPEATED = 8  # tokens back that `Sampling.repetition` looks


@dataclass(frozen=True)
class Sampling:
    """How a token is drawn from logits. ``temperature`` 0: the largest; ``top_k`` 0: of all.

    The guidance is how strongly a caption's content and its style count, if it names a style; 1 is as trained.
    """

    temperature: float = 1.0
    top_k: int = 0
    top_p: float = 1.0
    repetition: float = 1.0
    content_guidance: float = 1.0
    style_guidance: float = 1.0

    def guides(self, message: Message, unstyled: list[int]) -> list["Guide"]:
        """What guides the reply to a caption alone: the ``unstyled`` caption, and none.

        With the guidance a of the content and b of the style, logits are those of no caption, plus a times what the content
        adds to them, plus b times what the style adds to that.
        """
        plain = replace(message, instruction=[unstyled])
        nothing = replace(message, task="unconditional", instruction=[])
        content, style = self.content_guidance, self.style_guidance
        guides = [Guide(plain, content - style), Guide(nothing, 1.0 - content)]
        return [guide for guide in guides if guide.weight != 0.0]

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
class Guide:
    """A message beside another; the weight of its logits, of which the other has the rest to 1."""

    message: Message
    weight: float


@dataclass
class Asked:
    """A message to be answered."""

    message: Message
    seed: int
    agents: int = 1
    guides: list[Guide] = field(default_factory=list)


# Tokens [S, L], how many are real [S], filled columns of the cache [S] and the cache, to logits
# and new columns.
Call = Callable[[Tensor, Tensor, Tensor, Tensor], tuple[Tensor, Tensor]]


class Language(Protocol):
    """A language model that answers over a cache, in PyTorch or as a pack's graph."""

    @property
    def vocabulary(self) -> Vocabulary:
        """Its ids."""

    @property
    def config(self) -> LanguageConfig:
        """Its sizes."""

    def served(self) -> Call:
        """Itself as a server runs it."""


def replies(
    model: Language, asked: list[Asked], sampling: Sampling, most: int = MAX_TOKENS, least: int = MIN_TOKENS
) -> list[list[int]]:
    """Replies' ids without `<EOS>`, all sequences side by side over one cache, in which each guide has a row too."""
    served = model.served()
    vocabulary, config = model.vocabulary, model.config
    rules = [Rules(a.message.task, least, most, config.positions, a.agents, a.message.length) for a in asked]
    prompts: list[list[int]] = []
    rows: list[list[int]] = []  # of each sequence: its own, then those of its guides
    for one in asked:
        messages = [one.message, *(guide.message for guide in one.guides)]
        rows.append(list(range(len(prompts), len(prompts) + len(messages))))
        prompts += [message.prompt(vocabulary) for message in messages]
    longest = max(map(len, prompts))
    tokens = torch.tensor([prompt + [PAD] * (longest - len(prompt)) for prompt in prompts])
    start = torch.tensor([len(prompt) for prompt in prompts])
    shape = (len(prompts), config.layers, 2, config.key_heads, config.positions, config.head_width)
    cache = torch.zeros(shape)
    made: list[list[int]] = [[] for _ in asked]
    running = list(range(len(asked)))
    with torch.no_grad():
        logits, columns = served(tokens, start, torch.zeros_like(start), cache[..., :1, :])
        cache[..., :longest, :] = columns
        while True:
            answers = logits.split([len(rows[i]) for i in running])
            for i, answer in zip(running, answers, strict=True):
                mixed = _mixed(answer, asked[i].guides)
                made[i].append(
                    _next(vocabulary, rules[i], len(prompts[rows[i][0]]), made[i], mixed, sampling, asked[i].seed)
                )
            running = [i for i in running if made[i][-1] != EOS]
            if not running:
                return [one[:-1] for one in made]
            index = torch.tensor([row for i in running for row in rows[i]])
            step = torch.tensor([[made[i][-1]] for i in running for _ in rows[i]])
            filled = int(start[index].max())
            logits, columns = served(step, torch.ones_like(index), start[index], cache[index][..., :filled, :])
            cache[index, :, :, :, start[index]] = columns[..., 0, :]
            start[index] += 1


def _mixed(logits: Tensor, guides: list[Guide]) -> Tensor:
    """Logits ``[V]`` of a message's ``[0]`` and its guides'."""
    mixed = logits[0]
    for row, guide in zip(logits[1:], guides, strict=True):
        mixed = mixed + guide.weight * (row - logits[0])
    return mixed


def _next(
    vocabulary: Vocabulary, rules: Rules, prompt: int, made: list[int], logits: Tensor, sampling: Sampling, seed: int
) -> int:
    mask = rules.allowed(vocabulary, prompt, made)
    return sampling.draw(logits.masked_fill(~mask, float("-inf")), made, seed, len(made))
