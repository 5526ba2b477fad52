"""Messages out of clips: what the language model is trained on, drawn at random, each task with its own share.

A crop is encoded as a server would encode it: conditions by themselves, without the frames that they are to lead to; replies
within the whole crop. Captions are made for the crop, so what they say of speed and time is true of it.
"""

import hashlib
import random
from dataclasses import dataclass, field

import numpy as np
import torch

from troupe_training.data.captions import caption, plain_captions
from troupe_training.data.facts import Facts, hands, measured, named
from troupe_training.data.store import ClipEntry, ClipStore
from troupe_training.models.vermo.config import MAX_TOKENS, RATE
from troupe_training.models.vermo.messages import Message
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.models.vermo.tokenizer import Tokenizer

# Of messages, for a model that is to do all.
SHARES = {
    "text_to_motion": 0.34,
    "motion_to_text": 0.16,
    "prediction": 0.12,
    "inbetween": 0.14,
    "continuation": 0.12,
    "unconditional": 0.12,
}
BALANCE = 0.5  # cells are drawn by their number of clips to this power
LENGTH_SHARE = 0.5  # of messages tell the reply's length
CAPTIONED = 0.5  # of predictions, continuations and gaps
STATED = 0.9  # of captions name the style
AGENTS_SHARE = 0.12  # of messages have two agents, where their task can
MOST_AGENTS = 2
PHASE = RATE // 2  # crops begin at multiples of it
LEAST_TOKENS = 5  # of a crop: one past, three to make, one behind
VALIDATION = 33  # one clip in so many is kept for validation


def validation_files(clips: list[ClipEntry]) -> set[str]:
    """Files of the train split whose clips stop the training, at least one; a mirrored clip goes with its original."""
    files = sorted({_file(c) for c in clips}, key=lambda name: hashlib.sha256(b"validation" + name.encode()).digest())
    return set(files[: max(1, len(files) // VALIDATION)])


def split_validation(clips: list[ClipEntry]) -> tuple[list[ClipEntry], list[ClipEntry]]:
    """Clips for training, and clips for validation."""
    files = validation_files(clips)
    return [c for c in clips if _file(c) not in files], [c for c in clips if _file(c) in files]


def _file(clip: ClipEntry) -> str:
    return clip.get("file", clip["name"])


@dataclass
class Crop:
    """Frames of a clip: a whole number of tokens."""

    clip: int
    start: int  # in the cache
    tokens: int


@dataclass
class Motions:
    """Clips with their contents and styles, and the codes of any crop, which are kept once computed."""

    store: ClipStore
    tokenizer: Tokenizer | None  # none if only captions are wanted
    clips: list[ClipEntry]
    names: list[tuple[str, str | None]] = field(init=False)
    _codes: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clips = [c for c in self.clips if c["frames"] >= LEAST_TOKENS * RATE + PHASE]
        self.names = [named(c["name"], c.get("mirrored", False)) for c in self.clips]
        self.hands = hands(self.store.skeleton)

    @torch.no_grad()
    def codes(self, start: int, tokens: int) -> list[int]:
        """Codes of frames that begin at ``start``."""
        key = (start, tokens)
        if key not in self._codes:
            assert self.tokenizer is not None
            crop = self.store.segments(torch.tensor([start]), tokens * RATE)
            found: list[int] = self.tokenizer.encode(crop.pose, crop.global_root)[0].tolist()
            self._codes[key] = found
        return self._codes[key]

    def facts(self, crop: Crop) -> Facts:
        """The facts of a crop."""
        frames = slice(crop.start, crop.start + crop.tokens * RATE)
        content, style = self.names[crop.clip]
        positions, headings = self.store.positions[frames].numpy(), self.store.headings[frames].numpy()
        return measured(content, style, positions, headings, self.hands)

    def crop(self, clip: int, rng: random.Random, most: int = MAX_TOKENS) -> Crop:
        """The whole clip from its first frame or its third, or part of a longer one.

        Few places to begin at are codes that are soon all known.
        """
        entry = self.clips[clip]
        tokens = min(most, (entry["frames"] - PHASE) // RATE)
        spare = entry["frames"] - tokens * RATE
        return Crop(clip, entry["start"] + rng.randrange(0, spare + 1, PHASE), tokens)


class MessageSource:
    """Random messages of the tasks of ``shares``."""

    def __init__(self, motions: Motions, pieces: Pieces, shares: dict[str, float], agents: float = AGENTS_SHARE):
        self.motions, self.pieces, self.agents = motions, pieces, agents
        self.tasks, self.shares = list(shares), list(shares.values())
        cells: dict[tuple[str, str | None], list[int]] = {}
        for clip, name in enumerate(motions.names):
            cells.setdefault(name, []).append(clip)
        self.cells = list(cells.values())
        self.weights = [len(clips) ** BALANCE for clips in self.cells]

    def clip(self, rng: random.Random) -> int:
        """A clip of a random cell."""
        return rng.choice(rng.choices(self.cells, self.weights)[0])

    def message(self, rng: random.Random) -> Message:
        """One message."""
        task = rng.choices(self.tasks, self.shares)[0]
        agents = MOST_AGENTS if rng.random() < self.agents else 1
        if agents == 1:
            crops = [self.motions.crop(self.clip(rng), rng)]
        else:
            crops = [self.motions.crop(self.clip(rng), rng, MAX_TOKENS // 3) for _ in range(agents)]
            least = min(crop.tokens for crop in crops)
            crops = [Crop(crop.clip, crop.start, least) for crop in crops]
        tokens = crops[0].tokens
        if task == "motion_to_text":
            conditions = [[self.motions.codes(crop.start, crop.tokens)] for crop in crops]
            return Message(task, condition=conditions, reply=[self._described(crops, rng)])
        before, behind = self._given(task, tokens, rng)
        captioned = task == "text_to_motion" or (task != "unconditional" and rng.random() < CAPTIONED)
        reply = tokens - before - behind
        return Message(
            task,
            instruction=[self._asked(crop, rng) for crop in crops] if captioned else [],
            condition=[self._condition(crop, before, behind) for crop in crops] if before else [],
            length=reply if task == "inbetween" or rng.random() < LENGTH_SHARE else None,
            reply=[self.motions.codes(c.start, tokens)[before : tokens - behind] for c in crops],
        )

    def _given(self, task: str, tokens: int, rng: random.Random) -> tuple[int, int]:
        """Tokens before and behind the reply that the condition has."""
        if task == "prediction":
            return max(1, round(0.4 * tokens)), 0
        if task == "inbetween":
            end = max(1, round(0.2 * tokens))
            return end, end
        if task == "continuation" or (task == "text_to_motion" and rng.random() < 0.15):
            return rng.randint(1, max(1, min(16, tokens - 3))), 0
        return 0, 0

    def _condition(self, crop: Crop, before: int, behind: int) -> list[list[int]]:
        runs = [self.motions.codes(crop.start, before)]
        if behind:
            runs.append(self.motions.codes(crop.start + (crop.tokens - behind) * RATE, behind))
        return runs

    def _asked(self, crop: Crop, rng: random.Random) -> list[int]:
        return self.pieces.ids(caption(self.motions.facts(crop), rng.getrandbits(32), STATED))

    def _described(self, crops: list[Crop], rng: random.Random) -> list[int]:
        """A plain sentence for each agent."""
        said = [rng.choice(plain_captions(*self.motions.names[crop.clip])) for crop in crops]
        return self.pieces.ids(" and ".join(said))


def captions_of(motions: Motions, each: int, seed: int) -> list[list[str]]:
    """``each`` captions of every clip's first crop, the same for the same seed."""
    found = []
    for clip in range(len(motions.clips)):
        rng = random.Random(f"{seed} {motions.clips[clip]['name']}")
        facts = motions.facts(motions.crop(clip, rng))
        found.append([caption(facts, rng.getrandbits(32), STATED) for _ in range(each)])
    return found


def message_batches(messages: list[Message], lengths: list[int], tokens: int) -> list[list[int]]:
    """Indices of messages in groups of similar length, each of about so many tokens with the padding."""
    order = np.argsort(lengths, kind="stable")
    groups: list[list[int]] = [[]]
    for index in order:
        if groups[-1] and (len(groups[-1]) + 1) * lengths[index] > tokens:
            groups.append([])
        groups[-1].append(int(index))
    return groups
