"""The sampler as a server runs it, in NumPy: ragged batches of any bodies, guidance rows, DDIM, noise by seed and joint.

It is the reference of the server's: what it computes outside the network is in 32 bits, in this order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from troupe_training.data.bodies import SLOTS, Body
from troupe_training.models.unimogen.config import PATH_FEATURES, RATE, SAMPLER_STEPS
from troupe_training.models.unimogen.diffusion import body_noise, cosine_signal, ddim, sampler_steps

Arrays = dict[str, np.ndarray]
# The network: named inputs of `INPUTS` to clean rows ``[R, T, 6]``.
Denoiser = Callable[[Arrays], np.ndarray]
INPUTS = ("x", "given", "path", "step", "style", "description", "owner", "rows", "reads")


@dataclass
class Character:
    """The request of one character: rows are those of `state.encode`, T is a multiple of 4."""

    body: Body
    path: np.ndarray  # [T, 3]: `Path2D.features`
    style: np.ndarray  # [K], weights; all zero for none
    seed: int = 0
    given: np.ndarray | None = None  # [T] of 0/1: frames that are known, none if left out
    known: np.ndarray | None = None  # [J + 1, T, 6]: their rows, anything elsewhere
    guidance: float = 1.0  # 1: the style as trained; more exaggerates it
    rows: int = field(init=False)

    def __post_init__(self) -> None:
        self.rows = self.body.joint_count + 1
        if len(self.path) % RATE or self.path.shape[1] != PATH_FEATURES:
            raise ValueError(f"path is {self.path.shape}, frames must be a multiple of {RATE}")


class Batch:
    """Characters of one length as one call: constant inputs, and the state that is denoised.

    After the characters' own rows come those of a second copy, without style, of every character whose guidance is not 1.
    """

    def __init__(self, characters: Sequence[Character]):
        self.characters = list(characters)
        frames = {len(c.path) for c in characters}
        if len(frames) != 1:
            raise ValueError(f"characters of {sorted(frames)} frames cannot share a call")
        (self.frames,) = frames
        self.guided = [i for i, c in enumerate(characters) if c.guidance != 1.0]
        self.order = [*range(len(characters)), *self.guided]
        self.first = np.cumsum([0, *(characters[i].rows for i in self.order)])
        self.state = [body_noise(c.seed, c.body.joint_count, self.frames) for c in characters]
        self.constant = self._constant()

    def _constant(self) -> Arrays:
        shown = [self.characters[i] for i in self.order]
        rows, reads = zip(*(c.body.slots() for c in shown), strict=True)
        none = np.zeros(self.frames, np.float32)
        style = [c.style if n < len(self.characters) else np.zeros_like(c.style) for n, c in enumerate(shown)]
        return {
            "given": np.stack([none if c.given is None else c.given for c in shown]).astype(np.float32),
            "path": np.stack([c.path for c in shown]).astype(np.float32),
            "style": np.stack(style).astype(np.float32),
            "description": np.concatenate([c.body.description() for c in shown]),
            "owner": np.repeat(np.arange(len(shown)), [c.rows for c in shown]),
            "rows": np.concatenate([r + first for r, first in zip(rows, self.first[:-1], strict=True)]).reshape(
                -1, SLOTS
            ),
            "reads": np.concatenate(reads).astype(np.float32),
        }

    def clean(self, denoiser: Denoiser, step: int) -> list[np.ndarray]:
        """The network's clean rows of each character at a diffusion step, with guidance."""
        for character, state in zip(self.characters, self.state, strict=True):
            if character.given is not None and character.known is not None:
                known = character.given > 0
                state[:, known] = character.known[:, known]
        x = np.concatenate([self.state[i] for i in self.order])
        steps = np.full(len(self.order), step, np.float32)
        made = denoiser(self.constant | {"x": x, "step": steps})
        parts = [made[a:b] for a, b in zip(self.first[:-1], self.first[1:], strict=True)]
        clean = parts[: len(self.characters)]
        for place, i in enumerate(self.guided):
            plain = parts[len(self.characters) + place]
            clean[i] = plain + np.float32(self.characters[i].guidance) * (clean[i] - plain)
        return clean


def sample(denoiser: Denoiser, characters: Sequence[Character], steps: int = SAMPLER_STEPS) -> list[np.ndarray]:
    """Rows ``[J + 1, T, 6]`` of each character after ``steps`` calls; given frames come out as they went in."""
    batch, signal = Batch(characters), cosine_signal()
    visited = sampler_steps(steps)
    for step, then in zip(visited, [*visited[1:], None], strict=True):
        clean = batch.clean(denoiser, step)
        batch.state = [ddim(x, c, step, then, signal) for x, c in zip(batch.state, clean, strict=True)]
    for character, state in zip(characters, batch.state, strict=True):
        if character.given is not None and character.known is not None:
            known = character.given > 0
            state[:, known] = character.known[:, known]
    return batch.state
