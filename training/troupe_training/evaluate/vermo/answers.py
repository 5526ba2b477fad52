"""A run's networks at work: messages to motions and texts, and motions to what figures are made of."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from troupe_training.data.store import ClipStore
from troupe_training.export.vermo.run import load_networks
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.flow import FlowDecoder, flow_sample
from troupe_training.models.vermo.frames import seen_from_first, world_joints
from troupe_training.models.vermo.messages import AGENT_SEP, Message
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.models.vermo.sampler import Asked, Guide, Language, Sampling, replies
from troupe_training.models.vermo.tokenizer import Tokenizer
from troupe_training.train.vermo.corpus import Crop, Motions
from troupe_training.train.vermo.language import PIECES

BATCH = 32


@dataclass
class Clip:
    """Frames of one motion: pose features ``[F, 9 J]`` and roots ``[F, 5]``."""

    pose: Tensor
    root: Tensor

    @property
    def joints(self) -> Tensor:
        """Joint positions ``[F, J, 3]`` in the frame of the first root."""
        return seen_from_first(self.pose[None], self.root[None])[0]

    def part(self, start: int, end: int) -> "Clip":
        """Frames ``start..end``."""
        return Clip(self.pose[start:end], self.root[start:end])


class Answering(ABC):
    """A language model with its pieces, how it is sampled, and a decoder of its codes."""

    def __init__(self, language: Language, pieces: Pieces, sampling: Sampling):
        self.language, self.pieces, self.sampling = language, pieces, sampling

    @abstractmethod
    def motions(self, codes: list[list[int]], flow_steps: int, seed: int) -> list[Clip]:
        """Motions of codes."""

    def replies(
        self, messages: list[Message], seed: int, greedy: bool = False, guides: Sequence[list[Guide]] = ()
    ) -> list[list[int]]:
        """Codes or pieces of replies, counted from 0; agents one after the other. ``guides`` are those of each message."""
        made: list[list[int]] = []
        sampling = Sampling(0.0) if greedy else self.sampling
        vocabulary = self.language.vocabulary
        asked = [Asked(message, seed * 100_003 + n) for n, message in enumerate(messages)]
        for one, own in zip(asked, guides, strict=False):
            one.guides = own
        for first in range(0, len(asked), BATCH):
            some = asked[first : first + BATCH]
            for one, ids in zip(some, replies(self.language, some, sampling), strict=True):
                start = vocabulary.first_text if one.message.task == "motion_to_text" else vocabulary.first_motion
                made.append([token - start for token in ids if token != AGENT_SEP])
        return made

    def texts(self, messages: list[Message]) -> list[str]:
        """Replies of `motion_to_text`, by the largest logit."""
        return [self.pieces.text(pieces) for pieces in self.replies(messages, 0, greedy=True)]


class Model(Answering):
    """Networks of a run."""

    def __init__(
        self, run: Path, store: ClipStore, sampling: Sampling, task: str | None = None, stage: str | None = None
    ):
        self.networks, self.stage = load_networks(run, store, task, stage)
        super().__init__(self.networks.language, Pieces.read(run / PIECES), sampling)

    def motions(self, codes: list[list[int]], flow_steps: int, seed: int) -> list[Clip]:
        """Motions of codes."""
        return decoded(self.networks.tokenizer, self.networks.flow, codes, flow_steps, seed)


@torch.no_grad()
def decoded(
    tokenizer: Tokenizer, flow: FlowDecoder | None, codes: list[list[int]], flow_steps: int = 0, seed: int = 1
) -> list[Clip]:
    """Motions of codes, by the flow decoder if it has steps."""
    clips = []
    for row, one in enumerate(codes):
        tokens = torch.tensor([one])
        if flow_steps:
            if flow is None:
                raise SystemExit("the run has no flow decoder: train the stage 'flow' first")
            shape = (1, len(one) * RATE, tokenizer.body.state_width)
            noise = torch.randn(shape, generator=torch.Generator().manual_seed(seed + row))
            state = flow_sample(flow, tokenizer, tokens, noise, flow_steps)
        else:
            state = tokenizer.state(tokenizer.embed(tokens))
        pose, root = tokenizer.body.frames(state)
        clips.append(Clip(pose[0], root[0]))
    return clips


def captured(motions: Motions, crop: Crop) -> Clip:
    """The captured motion."""
    one = motions.store.segments(torch.tensor([crop.start]), crop.tokens * RATE)
    return Clip(one.pose[0], one.global_root[0])


def world(clip: Clip) -> Tensor:
    """World joints ``[F, J, 3]``, where the clip has them."""
    return world_joints(clip.pose[None], clip.root[None])[0]


def markdown(header: list[str], rows: list[list[str]]) -> str:
    """A table; the first column is text."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"
