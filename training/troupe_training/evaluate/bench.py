"""The windows of a split, and what every method that fills them is measured with."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_FRAMES, MIN_FRAMES
from troupe_training.data.interpolation import interpolate
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion, pose_features
from troupe_training.data.store import ClipStore, Segments
from troupe_training.evaluate.distribution import pairwise_distance
from troupe_training.evaluate.metrics import window_figures
from troupe_training.evaluate.pinning import pin
from troupe_training.export.onnx import Session
from troupe_training.models.evaluator import INPUTS
from troupe_training.robots.hinges import Hinges, on_hinges

BATCH = 64
# Mean distance of a joint from sampled answers to the captured motion: what diversity is divided
# by.
DISTANCE = "sampled_distance_m"


@dataclass(frozen=True)
class Sampling:
    """How a network with a choice takes it: passes, and the temperature and seed of the choice (0: the likeliest).

    A pass keeps the tokens that it is surest of, as the server does, or in ``any_order`` tokens at random. ``root`` is the
    temperature of roots if it is not that of tokens.
    """

    steps: int = 1
    temperature: float = 0.0
    seed: int = 0
    any_order: bool = False
    root: float | None = None

    @property
    def root_temperature(self) -> float:
        """The temperature that roots are drawn at."""
        return self.temperature if self.root is None else self.root


# Fills the windows of captured segments of so many frames, with a choice of tokens where the method
# has one.
Method = Callable[[Segments, int, Sampling], Motion]


@dataclass
class Options:
    """The setting of a measurement."""

    gaps: list[int] = field(default_factory=lambda: [15, 30, 45])
    stride: int = 20
    split: str = "test"
    pinned: bool = False
    sampling: Sampling = field(default_factory=Sampling)
    diversity_seeds: int = 20
    diversity_windows: int = 100
    max_windows: int | None = None
    uncut: bool = False  # windows of whole files, over the cuts of `prepare` too
    by: list[str] = field(default_factory=list)  # groupings of clips that are also measured apart (`parts.py`)
    cells: Path | None = None  # the list that the grouping "cell" is made with; the cache's own if left out


def check_gap(gap: int) -> int:
    """Frames of a window of this gap; ends the command if networks cannot fill it."""
    frames = CONTEXT_FRAMES + gap + 1
    if not MIN_FRAMES <= frames <= MAX_FRAMES:
        raise SystemExit(
            f"a gap of {gap} frames makes a segment of {frames}; {MIN_FRAMES} to {MAX_FRAMES} frames are allowed"
        )
    return frames


class Latents:
    """``evaluator.onnx`` at work: the latent space of one evaluator."""

    def __init__(self, path: Path, threads: int):
        self.session = Session(path, threads)
        self.sha256 = hashlib.sha256(path.read_bytes()).hexdigest()  # latents of another file do not compare

    def of(self, root: Tensor, positions: Tensor, six_d: Tensor) -> np.ndarray:
        """Latents ``[B, 256]`` of roots ``[B, T, 5]``, positions ``[B, T, J, 3]`` and rotations ``[B, T, J, 6]``."""
        latents: np.ndarray = self.session.run(dict(zip(INPUTS, (root, positions, six_d), strict=True)))[
            "latent"
        ].numpy()
        return latents


class Bench:
    """A split's windows, and what all methods are measured with."""

    def __init__(self, cache: Path, options: Options, evaluator: Path | None, threads: int):
        self.options = options
        store = ClipStore(cache, options.split)
        self.store = store.uncut() if options.uncut else store
        self.skeleton = self.store.skeleton
        self.kinematics = Kinematics(self.skeleton)
        self.left_axis = torch.tensor(self.skeleton.left_axis)
        self.latents = Latents(evaluator, threads) if evaluator else None
        self.hinges = Hinges(self.skeleton) if self.skeleton.robot else None

    def windows(self, frames: int) -> tuple[Tensor, Tensor]:
        """Start frames of the windows of so many frames, and the pieces of clips that they are of."""
        starts, pieces = self.store.windows(frames, self.options.stride, self.options.max_windows)
        if not len(starts):
            raise SystemExit(f"no clip of the {self.options.split} split has {frames} frames")
        return starts, pieces

    def segments(self, starts: Tensor, frames: int, title: str) -> Iterator[tuple[Segments, Tensor]]:
        """The windows' frames and the segments' headings in the world, some windows at a time."""
        for chunk in tqdm(starts.split(BATCH), desc=title, leave=False):
            yield self.store.segments(chunk, frames), self.store.headings[chunk + CONTEXT_FRAMES - 1]

    def interpolation(self, segments: Segments, frames: int, sampling: Sampling) -> Motion:
        """The method without a network."""
        return interpolate(Motion.of(segments), frames, self.skeleton.parents)

    def answer(self, method: Method, segments: Segments, frames: int, sampling: Sampling) -> Motion:
        """A method's answer, pinned if answers are."""
        motion = method(segments, frames, sampling)
        if not self.options.pinned:
            return motion
        index = [*range(CONTEXT_FRAMES), frames - 1]
        truth = Motion.of(segments)
        given = Motion(truth.root[:, index], truth.rotations[:, index])
        return pin(motion, given, index, self.skeleton.parents, self.left_axis)

    def shown(self, motion: Motion) -> tuple[Motion, dict[str, Tensor]]:
        """For robots what its hinges make of the motion, and what that took."""
        return on_hinges(self.hinges, motion) if self.hinges else (motion, {})

    def encode(self, motion: Motion) -> np.ndarray | None:
        """Latents ``[B, 256]`` of whole windows, if there is an evaluator."""
        if self.latents is None:
            return None
        positions, six_d = pose_features(motion, self.kinematics)
        return self.latents.of(motion.global_root(self.left_axis), positions, six_d)

    def measure(self, motion: Motion, truth: Motion, headings: Tensor) -> dict[str, np.ndarray]:
        """Every figure of B windows by name, ``[B]`` each, and ``latents`` ``[B, 256]`` if there is an evaluator."""
        motion, figures = self.shown(motion)
        figures |= window_figures(motion, truth, self.skeleton, self.kinematics, headings)
        arrays = {name: values.double().numpy() for name, values in figures.items()}
        latents = self.encode(motion)
        return arrays if latents is None else arrays | {"latents": latents}

    def diversity(self, method: Method, starts: Tensor, frames: int, name: str) -> dict[str, np.ndarray]:
        """Mean distances between answers of other seeds at temperature 1, and from them to the captured motion: ``[W]`` each."""
        steps, seeds = self.options.sampling.steps, self.options.diversity_seeds
        gap = slice(CONTEXT_FRAMES, frames - 1)
        found: dict[str, list[Tensor]] = {"joint_diversity_m": [], DISTANCE: [], "latent_diversity": []}
        for nth, (segments, _) in enumerate(self.segments(starts, frames, f"{name}: {seeds} seeds")):
            positions, latents = [], []
            captured = self.shown(Motion.of(segments))[0].world(self.kinematics)[:, gap]
            for seed in range(seeds):
                sampling = Sampling(steps, 1.0, self.options.sampling.seed + 1_000_003 * nth + seed + 1)
                motion, _ = self.shown(self.answer(method, segments, frames, sampling))
                positions.append(motion.world(self.kinematics)[:, gap])
                encoded = self.encode(motion)
                if encoded is not None:
                    latents.append(torch.from_numpy(encoded))
            found["joint_diversity_m"].append(pairwise_distance(torch.stack(positions)))
            found[DISTANCE].append((torch.stack(positions) - captured).norm(dim=-1).mean((0, 2, 3)))
            if latents:
                found["latent_diversity"].append(pairwise_distance(torch.stack(latents)))
        return {name: torch.cat(parts).double().numpy() for name, parts in found.items() if parts}
