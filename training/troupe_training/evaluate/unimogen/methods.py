"""Ways to answer windows: captures, baselines, networks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BodyStore, Windows
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.evaluate.unimogen.networks import Network
from troupe_training.models.unimogen.sampler import Character, Denoiser, sample
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode


@dataclass
class Setting:
    """How windows are answered and how many."""

    frames: int = 68
    stride: int = 32
    most: int | None = 128
    steps: int = 4
    guidance: float = 1.0
    seed: int = 0


@dataclass
class Asked:
    """B windows to be answered: where they lie in their store, what was captured, and the path to follow."""

    starts: Tensor  # [B], first frames in the store
    owners: Tensor  # [B], clips of the store
    windows: Windows
    path: Path2D

    @staticmethod
    def of(store: BodyStore, starts: Tensor, owners: Tensor, frames: int) -> "Asked":
        """Windows whose paths are the captured roots' own."""
        windows = store.windows(starts, frames, owners)
        return Asked(starts, owners, windows, Path2D(windows.root[..., [0, 2]], windows.heading))


@dataclass
class Answer:
    """B motions: root positions ``[B, T, 3]`` and turns out of the neutral pose ``[B, T, J, 3, 3]``."""

    root: Tensor
    turned: Tensor


Method = Callable[[Asked], Answer]


def captured(body: Body) -> Method:
    """The captured motion."""
    kinematics = BodyKinematics(body)
    return lambda asked: Answer(asked.windows.root, kinematics.turned(six_d_to_matrix(asked.windows.bends)))


def _of_rows(body: Body, limits: Range, change: Callable[[Tensor], Tensor]) -> Method:
    """The captured rows, changed."""
    kinematics = BodyKinematics(body)

    def answer(asked: Asked) -> Answer:
        rows = encode(body, asked.windows.root, asked.windows.bends, asked.path, limits)
        root, bends = decode(body, change(rows), asked.path, limits)
        return Answer(root, kinematics.turned(bends))

    return answer


def frozen(body: Body, limits: Range) -> Method:
    """The last pose of the past, carried along the path."""

    def change(rows: Tensor) -> Tensor:
        held = rows[:, :, CONTEXT_FRAMES - 1 : CONTEXT_FRAMES].expand(-1, -1, rows.shape[2] - CONTEXT_FRAMES, -1)
        return torch.cat([rows[:, :, :CONTEXT_FRAMES], held], 2)

    return _of_rows(body, limits, change)


def interpolated(body: Body, limits: Range) -> Method:
    """From the last pose of the past to the window's last pose, along the path. No other method knows the last pose."""

    def change(rows: Tensor) -> Tensor:
        first, last = rows[:, :, CONTEXT_FRAMES - 1 : CONTEXT_FRAMES], rows[:, :, -1:]
        share = torch.linspace(0, 1, rows.shape[2] - CONTEXT_FRAMES + 1)[1:, None]
        return torch.cat([rows[:, :, :CONTEXT_FRAMES], first + share * (last - first)], 2)

    return _of_rows(body, limits, change)


def copied(store: BodyStore, other: BodyStore, limits: Range) -> Method:
    """The same frames of the same take on another body: bends by joint name, other joints neutral, roots scaled by size."""
    kinematics = BodyKinematics(store.body)
    names = other.body.skeleton.names
    pairs = [(j + 1, names.index(name) + 1) for j, name in enumerate(store.body.skeleton.names) if name in names]
    pairs = [(0, 0), *pairs] if (1, 1) in pairs else [(0, 0), (1, 1), *pairs]  # roots may be called otherwise
    to, source = (list(side) for side in zip(*pairs, strict=True))

    def answer(asked: Asked) -> Answer:
        frames = asked.path.heading.shape[1]
        starts, owners = counterparts(store, other, asked.starts, asked.owners, frames)
        theirs = Asked.of(other, starts, owners, frames)
        rows = encode(other.body, theirs.windows.root, theirs.windows.bends, theirs.path, limits)
        made = rows.new_zeros(len(rows), store.body.joint_count + 1, *rows.shape[2:])
        made[:, to] = rows[:, source]
        root, bends = decode(store.body, made, asked.path, limits)
        return Answer(root, kinematics.turned(bends))

    return answer


def counterparts(
    store: BodyStore, other: BodyStore, starts: Tensor, owners: Tensor, frames: int
) -> tuple[Tensor, Tensor]:
    """First frames and clips of the same moments of the same takes on another body, -1 if it has none."""
    if any("take" not in clip for clip in (*store.clips, *other.clips)):
        raise SystemExit("this cache does not say of which take its clips are: prepare the bodies into a new one")
    found = []
    for start, owner in zip(starts.tolist(), owners.tolist(), strict=True):
        clip = store.clips[owner]
        moment = clip["first"] + start - clip["start"]
        place = (-1, -1)
        for i, theirs in enumerate(other.clips):
            first = moment - theirs["first"]
            if theirs["take"] == clip["take"] and 0 <= first <= theirs["frames"] - frames:
                place = (theirs["start"] + first, i)
        found.append(place)
    places = torch.tensor(found, dtype=torch.long).reshape(-1, 2)
    return places[:, 0], places[:, 1]


def of_network(body: Body, network: Network, words: list[str], setting: Setting) -> Method:
    """A network's answers to windows whose style vectors are of ``words``; each window has a seed of its own."""
    kinematics, limits, denoiser = BodyKinematics(body), network.limits, network.denoiser(body)
    asked_before = 0

    def answer(asked: Asked) -> Answer:
        nonlocal asked_before
        windows, path = asked.windows, asked.path
        rows = encode(body, windows.root, windows.bends, path, limits).numpy()
        features = path.features(body.size_m).numpy()
        given = (np.arange(rows.shape[2]) < CONTEXT_FRAMES).astype(np.float32)
        styles = style_for(windows.words.numpy(), words, network.words)
        characters = []
        for b in range(len(rows)):
            seed = setting.seed + asked_before + b
            characters.append(Character(body, features[b], styles[b], seed, given, rows[b], setting.guidance))
        asked_before += len(rows)
        root, bends = decode(body, sampled(denoiser, characters, setting.steps), path, limits)
        return Answer(root, kinematics.turned(bends))

    return answer


def sampled(denoiser: Denoiser, characters: list[Character], steps: int) -> Tensor:
    """Rows of characters of one body ``[B, J + 1, T, 6]``."""
    return torch.from_numpy(np.stack(sample(denoiser, characters, steps)))


def style_for(weights: np.ndarray, words: list[str], known: list[str]) -> np.ndarray:
    """Style vectors ``[B, K]`` of ``words`` as vectors of the words that a network knows; others are dropped."""
    out = np.zeros((len(weights), len(known)), np.float32)
    for i, word in enumerate(words):
        if word in known:
            out[:, known.index(word)] = weights[:, i]
    return out
