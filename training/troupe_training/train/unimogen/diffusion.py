"""One update: windows of a body, noise or the sampler's own steps, dropouts, losses."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import torch
from torch import Generator, Tensor

from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BODY_BALANCE, Corpus, Windows
from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.models.unimogen.config import DIFFUSION_STEPS, SAMPLER_STEPS
from troupe_training.models.unimogen.diffusion import cosine_signal, sampler_steps
from troupe_training.models.unimogen.network import PLACE_CHANNELS, UniMoGen, slot_matrix
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode, root_offsets
from troupe_training.train.trainer import Loss
from troupe_training.train.unimogen.losses import Weights, all_losses
from troupe_training.train.unimogen.paths import wanted_paths

# Frames of a window and how often: four of past and 16, 32 or 64 to come.
LENGTHS = ((20, 0.15), (36, 0.5), (68, 0.35))
STYLE_DROP, WORD_DROP, PAST_DROP = 0.1, 0.1, 0.5  # all words (paper), each word alone, the past (paper)
TARGET_SHARE = 0.25  # of the windows whose last frames are given as well
RANGE_SAMPLES, RANGE_TAIL = 24, 0.001  # batches of each body; share of the offsets beyond -1 and 1
MIN_RANGE = 0.1  # body sizes
VISITED_SHARE = 0.5  # of the windows are noised at a step that the sampler visits
UNROLLED_SHARE = 0.5  # of the updates, see `unrolled`
# Steps of the sampler that an unrolled update walks through; the network learns at the last. None
# begins at the noisiest step: its answers there have no single truth to be compared with.
VISITED = sampler_steps(SAMPLER_STEPS)
CHAINS = (VISITED[1:3], VISITED[1:4], VISITED[2:4])


@dataclass
class Rows:
    """The network's inputs that describe one body."""

    description: Tensor  # [J + 1, D]
    rows: Tensor  # [J + 1, SLOTS]
    reads: Tensor  # [J + 1, SLOTS]
    slot_of: Tensor  # [J + 1, J + 1]
    kinematics: BodyKinematics

    @staticmethod
    def of(body: Body) -> "Rows":
        """From the body's description and slots."""
        rows, reads = (torch.from_numpy(part) for part in body.slots())
        description = torch.from_numpy(body.description())
        return Rows(description, rows, reads.float(), slot_matrix(rows, reads), BodyKinematics(body))

    def repeated(self, batch: int) -> dict[str, Tensor]:
        """The network's arguments for ``batch`` characters of this body."""
        count = len(self.description)
        first = (torch.arange(batch) * count)[:, None, None]
        return {
            "description": self.description.repeat(batch, 1),
            "owner": torch.arange(batch).repeat_interleave(count),
            "rows": (self.rows + first).flatten(0, 1),
            "reads": self.reads.repeat(batch, 1),
        }


def given_frames(batch: int, frames: int, generator: Generator) -> Tensor:
    """Which frames are given ``[B, T]``: the past in half of the windows, last frames in a quarter."""
    given = torch.zeros(batch, frames)
    past = torch.rand(batch, generator=generator) >= PAST_DROP
    target = torch.rand(batch, generator=generator) < TARGET_SHARE
    count = torch.randint(1, MAX_TARGETS + 1, (batch,), generator=generator)
    time = torch.arange(frames)
    given[past[:, None] & (time < CONTEXT_FRAMES)] = 1.0
    given[target[:, None] & (time >= frames - count[:, None])] = 1.0
    return given


def dropped_words(words: Tensor, generator: Generator) -> Tensor:
    """Style vectors ``[B, K]`` of which some are emptied, and some lose a word."""
    kept = torch.rand(words.shape, generator=generator) >= WORD_DROP
    some = torch.rand(len(words), 1, generator=generator) >= STYLE_DROP
    return words * kept * some


def noised(rows: Tensor, given: Tensor, signal: Tensor, generator: Generator) -> Tensor:
    """Rows ``[B, J + 1, T, 6]`` with noise where frames are not given; ``signal`` ``[B]`` is the share of power that is left."""
    noise = torch.randn(rows.shape, generator=generator)
    noise[:, 0, :, PLACE_CHANNELS:] = 0.0
    share = signal[:, None, None, None]
    return torch.where(given[:, None, :, None] > 0, rows, share.sqrt() * rows + (1 - share).sqrt() * noise)


def drawn_steps(batch: int, generator: Generator) -> Tensor:
    """Diffusion steps ``[B]``: half of them any, the rest those that the sampler visits by default."""
    visited = torch.tensor(VISITED)
    which = torch.randint(len(visited), (batch,), generator=generator)
    any_step = torch.randint(DIFFUSION_STEPS, (batch,), generator=generator)
    return torch.where(torch.rand(batch, generator=generator) < VISITED_SHARE, visited[which], any_step)


def offset_range(corpus: Corpus, frames: int = 36, seed: int = 99) -> Range:
    """Min-max range of root offsets over training windows of all bodies (paper, section 4.1), without the outermost."""
    generator = Generator().manual_seed(seed)
    found = []
    for _ in range(RANGE_SAMPLES * len(corpus.names)):
        store = corpus.stores[corpus.draw_body(frames, generator)]
        windows = store.draw(16, frames, generator)
        given = given_frames(16, frames, generator)
        path = wanted_paths(windows.root, windows.heading, given, store.body.size_m, generator)
        found.append(root_offsets(store.body, windows.root, path).flatten(0, 1))
    offsets = torch.cat(found)
    low = torch.quantile(offsets[:: 1 + len(offsets) // 1_000_000], RANGE_TAIL, 0)
    high = torch.quantile(offsets[:: 1 + len(offsets) // 1_000_000], 1 - RANGE_TAIL, 0)
    side = torch.maximum(-low[0], high[0])
    low, high = torch.stack([-side, low[1], low[2]]), torch.stack([side, high[1], high[2]])
    spare = (MIN_RANGE - (high - low)).clamp_min(0) / 2  # roots that never leave their path
    return Range(low - spare, high + spare)


@dataclass
class Recipe:
    """The parts of the training that an ablation switches off, see `ablations.py`."""

    weights: Weights = field(default_factory=Weights)
    body_balance: float = BODY_BALANCE


@dataclass
class Task:
    """B windows of one body for the network to restore: what it sees beside the noisy rows, and the truth."""

    rows: Rows
    body: Body
    windows: Windows
    given: Tensor  # [B, T]: 1 in frames that the network is given
    path: Path2D
    style: Tensor  # [B, K]
    limits: Range

    @cached_property
    def truth(self) -> Tensor:
        """Clean rows ``[B, J + 1, T, 6]``."""
        return encode(self.body, self.windows.root, self.windows.bends, self.path, self.limits)

    @cached_property
    def inputs(self) -> dict[str, Tensor]:
        """The network's inputs except noisy rows and diffusion step."""
        batch = len(self.given)
        features = self.path.features(self.body.size_m)
        own = {"given": self.given, "path": features, "style": self.style, "slot_of": self.rows.slot_of}
        return own | self.rows.repeated(batch)

    def answer(self, model: UniMoGen, x: Tensor, step: Tensor) -> Tensor:
        """The network's clean rows for noisy rows ``x`` at diffusion steps ``[B]``; given frames are the truth."""
        made = model(x=x.flatten(0, 1), step=step.float(), **self.inputs)
        made = made.reshape(x.shape)
        return torch.where(self.given[:, None, :, None] > 0, self.truth, made)

    def losses(self, made: Tensor, weights: Weights) -> dict[str, Tensor]:
        """The losses of an answer."""
        windows = self.windows
        motion = decode(self.body, made, self.path, self.limits), (windows.root, six_d_to_matrix(windows.bends))
        feet = self.body.skeleton.contact_joints
        rows, size = (made, self.truth), self.body.size_m
        return all_losses(self.rows.kinematics, size, rows, motion, windows.contacts, feet, 1 - self.given, weights)


@torch.no_grad()
def unrolled(model: UniMoGen, task: Task, chain: list[int], signal: Tensor, generator: Generator) -> Tensor:
    """Noisy rows at the last step of ``chain``, as the sampler makes them: it begins at the truth, noised at the first step.

    So they carry the network's own errors, which it learns to mend.
    """
    batch = len(task.given)
    x = noised(task.truth, task.given, signal[chain[0]].expand(batch), generator)
    for step, then in pairwise(chain):
        clean = task.answer(model, x, torch.full((batch,), step))
        noise = (x - signal[step].sqrt() * clean) / (1 - signal[step]).sqrt()
        x = signal[then].sqrt() * clean + (1 - signal[then]).sqrt() * noise
        x = torch.where(task.given[:, None, :, None] > 0, task.truth, x)
    return x


def diffusion_loss(corpus: Corpus, limits: Range, rows_per_step: int, recipe: Recipe) -> Loss[UniMoGen]:
    """The loss of random windows of one body; ``rows_per_step`` are frames times rows, about."""
    rows_of = {name: Rows.of(store.body) for name, store in corpus.stores.items()}
    signal = torch.from_numpy(cosine_signal()).float()
    shares = torch.tensor([share for _, share in LENGTHS])

    def draw_task(generator: Generator) -> Task:
        frames = LENGTHS[int(torch.multinomial(shares, 1, generator=generator))][0]
        name = corpus.draw_body(frames, generator, recipe.body_balance)
        store, rows = corpus.stores[name], rows_of[name]
        batch = max(2, round(rows_per_step / (frames * len(rows.description))))
        windows = store.draw(batch, frames, generator)
        given = given_frames(batch, frames, generator)
        path = wanted_paths(windows.root, windows.heading, given, store.body.size_m, generator)
        style = dropped_words(windows.words, generator)
        return Task(rows, store.body, windows, given, path, style, limits)

    def loss(model: UniMoGen, generator: Generator, progress: float) -> dict[str, Tensor]:
        task = draw_task(generator)
        batch = len(task.given)
        if float(torch.rand((), generator=generator)) < UNROLLED_SHARE:
            chain = CHAINS[int(torch.randint(len(CHAINS), (), generator=generator))]
            step = torch.full((batch,), chain[-1])
            x = unrolled(model, task, chain, signal, generator)
        else:
            step = drawn_steps(batch, generator)
            x = noised(task.truth, task.given, signal[step], generator)
        return task.losses(task.answer(model, x, step), recipe.weights)

    return loss
