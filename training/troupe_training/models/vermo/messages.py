"""Messages of the language model: one vocabulary, how a message is written, and what a reply may hold next.

``<BOS> TASK [<INSTRUCTION> text] [<CONDITION> items] [<LEN_n>] <REPLY> reply <EOS>``. Several agents are parted by `<AGENT_SEP>`,
in instructions, conditions and replies. A server writes the same messages; this file is their definition.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor

MARKERS = ("<PAD>", "<BOS>", "<EOS>", "<INSTRUCTION>", "<CONDITION>", "<REPLY>", "<GAP>", "<AGENT_SEP>")
TASKS = (
    "text_to_motion",
    "motion_to_text",
    "prediction",
    "inbetween",
    "continuation",
    "unconditional",
    "music_to_dance",
    "dance_to_music",
    "speech_to_gesture",
    "gesture_to_speech",
)
SPECIALS = (*MARKERS, *(f"<{task.upper()}>" for task in TASKS))
PAD, BOS, EOS, INSTRUCTION, CONDITION, REPLY, GAP, AGENT_SEP = range(len(MARKERS))
# Conditions and replies of a task that are not motion.
CONDITION_KINDS = {"music_to_dance": "audio", "speech_to_gesture": "audio"}
REPLY_KINDS = {"motion_to_text": "text", "dance_to_music": "audio", "gesture_to_speech": "audio"}


@dataclass(frozen=True)
class Vocabulary:
    """Ids in this order: special tokens, ``<LEN_1>`` to ``<LEN_max_tokens>``, text pieces, motion codes, audio codes."""

    text_pieces: int
    motion_codes: int
    audio_codes: int
    max_tokens: int

    @property
    def first_text(self) -> int:
        """Id of the first text piece."""
        return len(SPECIALS) + self.max_tokens

    @property
    def first_motion(self) -> int:
        """Id of the first motion code."""
        return self.first_text + self.text_pieces

    @property
    def first_audio(self) -> int:
        """Id of the first audio code."""
        return self.first_motion + self.motion_codes

    @property
    def size(self) -> int:
        """Number of ids, and of the logits' columns."""
        return self.first_audio + self.audio_codes

    def task(self, task: str) -> int:
        """A task's id."""
        return len(MARKERS) + TASKS.index(task)

    def length(self, tokens: int) -> int:
        """``<LEN_n>``."""
        if not 1 <= tokens <= self.max_tokens:
            raise ValueError(f"length: {tokens} is not from 1 to {self.max_tokens}")
        return len(SPECIALS) + tokens - 1

    def span(self, kind: str) -> tuple[int, int]:
        """First id and the id behind the last of ``text``, ``motion`` or ``audio``."""
        if kind == "text":
            return self.first_text, self.first_motion
        return (self.first_motion, self.first_audio) if kind == "motion" else (self.first_audio, self.size)

    def ids(self, kind: str, codes: list[int]) -> list[int]:
        """Ids of text pieces or codes."""
        first, end = self.span(kind)
        if codes and not 0 <= min(codes) <= max(codes) < end - first:
            raise ValueError(f"{kind}: codes must be from 0 to {end - first - 1}")
        return [first + code for code in codes]


@dataclass
class Message:
    """A message in codes and pieces, each counted from 0.

    ``instruction`` and ``reply`` have a list an agent; so has ``condition``, whose lists are runs that gaps part.
    """

    task: str
    instruction: list[list[int]] = field(default_factory=list)
    condition: list[list[list[int]]] = field(default_factory=list)
    length: int | None = None
    reply: list[list[int]] = field(default_factory=list)

    def prompt(self, vocabulary: Vocabulary) -> list[int]:
        """Ids up to `<REPLY>`."""
        ids = [BOS, vocabulary.task(self.task)]
        if self.instruction:
            ids += [INSTRUCTION, *_parted([vocabulary.ids("text", pieces) for pieces in self.instruction], AGENT_SEP)]
        if self.condition:
            kind = CONDITION_KINDS.get(self.task, "motion")
            agents = [_parted([vocabulary.ids(kind, run) for run in runs], GAP) for runs in self.condition]
            ids += [CONDITION, *_parted(agents, AGENT_SEP)]
        if self.length is not None:
            ids.append(vocabulary.length(self.length))
        return [*ids, REPLY]

    def answer(self, vocabulary: Vocabulary) -> list[int]:
        """Ids behind `<REPLY>`, `<EOS>` last."""
        kind = REPLY_KINDS.get(self.task, "motion")
        return [*_parted([vocabulary.ids(kind, codes) for codes in self.reply], AGENT_SEP), EOS]


def _parted(lists: list[list[int]], separator: int) -> list[int]:
    ids = list(lists[0])
    for more in lists[1:]:
        ids += [separator, *more]
    return ids


@dataclass(frozen=True)
class Rules:
    """Bounds of a reply: its kind, tokens of each agent, agents, and how long a message may be."""

    task: str
    min_tokens: int
    max_tokens: int
    positions: int
    agents: int = 1
    length: int | None = None

    @property
    def kind(self) -> str:
        """``motion``, ``text`` or ``audio``."""
        return REPLY_KINDS.get(self.task, "motion")

    def allowed(self, vocabulary: Vocabulary, prompt: int, reply: list[int]) -> Tensor:
        """Which ids may come next, ``[V]`` of bool, after a prompt of that many tokens and the ids of a reply so far."""
        mask = torch.zeros(vocabulary.size, dtype=torch.bool)
        parts = reply.count(AGENT_SEP)
        own = len(reply) - (len(reply) - 1 - reply[::-1].index(AGENT_SEP) + 1 if parts else 0)
        stop = AGENT_SEP if self.kind == "motion" and parts + 1 < self.agents else EOS
        if prompt + len(reply) + 1 >= self.positions:  # the last position is for <EOS>
            mask[EOS] = True
            return mask
        fixed = self.length if self.kind == "motion" else None
        most = (fixed or self.max_tokens) if self.kind == "motion" else self.positions
        least = (fixed or self.min_tokens) if self.kind == "motion" else 1
        mask[stop] = own >= least
        if own < most:
            first, end = vocabulary.span(self.kind)
            mask[first:end] = True
        return mask
