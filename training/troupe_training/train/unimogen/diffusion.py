"""One update: windows of a body, noise, dropouts, the five losses."""

from dataclasses import dataclass, field

import torch
from torch import Generator, Tensor

from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BODY_BALANCE, Corpus, Windows
from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.models.unimogen.config import DIFFUSION_STEPS, ROW_CHANNELS
from troupe_training.models.unimogen.diffusion import cosine_signal
from troupe_training.models.unimogen.network import PLACE_CHANNELS, UniMoGen, slot_matrix
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode, root_offsets
from troupe_training.train.trainer import Loss
from troupe_training.train.unimogen.losses import Weights, five_losses
from troupe_training.train.unimogen.paths import wanted_paths

# Frames of a window and how often: four of past and 16, 32 or 64 to come.
LENGTHS = ((20, 0.15), (36, 0.5), (68, 0.35))
STYLE_DROP, WORD_DROP, PAST_DROP = 0.1, 0.1, 0.5  # all words (paper), each word alone, the past (paper)
TARGET_SHARE = 0.25  # of the windows whose last frames are given as well
RANGE_SAMPLES, RANGE_TAIL = 24, 0.001  # batches of each body; share of the offsets beyond -1 and 1
MIN_RANGE = 0.1  # body sizes


@dataclass
class Rows:
    """What the network is told of one body, for a batch of one length."""

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


def offset_range(corpus: Corpus, frames: int = 36, seed: int = 99) -> Range:
    """Min-max range of root offsets over training windows of all bodies (paper, section 4.1), without the outermost."""
    generator = Generator().manual_seed(seed)
    found = []
    for _ in range(RANGE_SAMPLES * len(corpus.names)):
        store = corpus.stores[corpus.draw_body(frames, generator)]
        windows = store.draw(16, frames, generator)
        given = given_frames(16, frames, generator)
        path = wanted_paths(windows.root, windows.heading, given, generator)
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
    """What of the training can be switched off, see `ablations.py`."""

    weights: Weights = field(default_factory=Weights)
    body_balance: float = BODY_BALANCE


def diffusion_loss(corpus: Corpus, limits: Range, rows_per_step: int, recipe: Recipe) -> Loss[UniMoGen]:
    """The loss of random windows of one body; ``rows_per_step`` are frames times rows, about."""
    told = {name: Rows.of(store.body) for name, store in corpus.stores.items()}
    signal = torch.from_numpy(cosine_signal()).float()
    shares = torch.tensor([share for _, share in LENGTHS])

    def loss(model: UniMoGen, generator: Generator, progress: float) -> dict[str, Tensor]:
        frames = LENGTHS[int(torch.multinomial(shares, 1, generator=generator))][0]
        name = corpus.draw_body(frames, generator, recipe.body_balance)
        store, body = corpus.stores[name], told[name]
        batch = max(2, round(rows_per_step / (frames * len(body.description))))
        windows = store.draw(batch, frames, generator)
        given = given_frames(batch, frames, generator)
        path = wanted_paths(windows.root, windows.heading, given, generator)
        step = torch.randint(DIFFUSION_STEPS, (batch,), generator=generator)
        return step_loss(model, body, store.body, windows, given, path, step, signal[step], limits, recipe, generator)

    return loss


def step_loss(
    model: UniMoGen,
    told: Rows,
    body: Body,
    windows: Windows,
    given: Tensor,
    path: Path2D,
    step: Tensor,
    signal: Tensor,
    limits: Range,
    recipe: Recipe,
    generator: Generator,
) -> dict[str, Tensor]:
    """The five losses of windows at diffusion steps ``step`` ``[B]``."""
    batch, frames = given.shape
    truth = encode(body, windows.root, windows.bends, path, limits)
    x = noised(truth, given, signal, generator)
    style = dropped_words(windows.words, generator)
    made = model(
        x.flatten(0, 1),
        given,
        path.features(body.size_m),
        step.float(),
        style,
        slot_of=told.slot_of,
        **told.repeated(batch),
    ).reshape(batch, -1, frames, ROW_CHANNELS)
    made = torch.where(given[:, None, :, None] > 0, truth, made)
    motion = decode(body, made, path, limits), (windows.root, six_d_to_matrix(windows.bends))
    feet = body.skeleton.contact_joints
    return five_losses(
        told.kinematics, body.size_m, (made, truth), motion, windows.contacts, feet, 1 - given, recipe.weights
    )
