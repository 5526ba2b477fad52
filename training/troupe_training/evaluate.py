"""``evaluate``: every measure of a pack or of a run's checkpoints on the test split, beside ground truth and baselines.

Runs the networks without a server, at temperature 0 with one pose step unless told otherwise. Answers are what the decoder
gives, or with ``pinned`` what the server would answer, which meets its keyframes. `troupe eval` measures through a running
server. `docs/evaluation.md` defines every measure.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from troupe_training.baselines import interpolate
from troupe_training.config import CONTEXT_FRAMES, FRAMES_PER_TOKEN, MAX_FRAMES, MIN_TOKENS
from troupe_training.cut import PIECES, spread, windows
from troupe_training.distribution import Gaussian, Mmd, frechet, pairwise_distance
from troupe_training.evaluator import Latents
from troupe_training.features import ClipStore, Segments
from troupe_training.hinges import Hinges, on_hinges
from troupe_training.inbetween import Keys, Sampling, in_between
from troupe_training.intervals import COSTLY_RESAMPLES, RESAMPLES, Bootstrap
from troupe_training.losses import Kinematics
from troupe_training.metrics import window_figures
from troupe_training.motion import Motion, global_root_of, pose_features
from troupe_training.pinning import pin

TRUTH = "ground truth"
BATCH = 64

# Fills the windows of captured segments of so many frames, with a choice of tokens where the method has one.
Method = Callable[[Segments, int, Sampling], Motion]


@dataclass
class Options:
    """What is measured, and how."""

    gaps: list[int] = field(default_factory=lambda: [15, 30, 45])
    stride: int = 20
    split: str = "test"
    pinned: bool = False
    sampling: Sampling = field(default_factory=Sampling)
    diversity_seeds: int = 20
    diversity_windows: int = 100
    max_windows: int | None = None


def check_gap(gap: int) -> int:
    """Frames of a window of this gap; ends the command where networks cannot fill it."""
    frames = CONTEXT_FRAMES + gap + 1
    if not MIN_TOKENS * FRAMES_PER_TOKEN <= frames <= MAX_FRAMES:
        raise SystemExit(
            f"a gap of {gap} frames makes a segment of {frames}; 12 to {MAX_FRAMES} frames are allowed"
        )
    return frames


def of_networks(networks) -> Method:
    """The method that runs the three stages of a pack or run."""
    return lambda segments, frames, sampling: in_between(
        networks, Keys.of(segments, frames), frames, sampling
    )


class Bench:
    """A split's windows, and what all methods are measured with."""

    def __init__(self, cache: Path, options: Options, evaluator: Path | None, threads: int):
        self.options = options
        self.store = ClipStore(cache, options.split)
        self.skeleton = self.store.skeleton
        self.kinematics = Kinematics(self.skeleton)
        self.left_axis = torch.tensor(self.skeleton.left_axis)
        self.latents = Latents(evaluator, threads) if evaluator else None
        self.hinges = Hinges(self.skeleton) if self.skeleton.robot else None

    def windows(self, frames: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Start frames of the windows of so many frames, and the pieces of clips that they are of."""
        starts, pieces = windows(self.store, frames, self.options.stride)
        if not len(starts):
            raise SystemExit(f"no clip of the {self.options.split} split has {frames} frames")
        kept = spread(len(starts), self.options.max_windows)
        return starts[kept], pieces[kept]

    def segments(
        self, starts: torch.Tensor, frames: int, title: str
    ) -> Iterator[tuple[Segments, torch.Tensor]]:
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

    def shown(self, motion: Motion) -> tuple[Motion, dict[str, torch.Tensor]]:
        """For robots what its hinges make of the motion, and what that took."""
        return on_hinges(self.hinges, motion) if self.hinges else (motion, {})

    def encode(self, motion: Motion) -> np.ndarray:
        """Latents of whole windows."""
        positions, six_d = pose_features(motion, self.kinematics)
        return self.latents.of(global_root_of(motion, self.left_axis), positions, six_d)

    def measure(self, motion: Motion, truth: Motion, headings: torch.Tensor) -> dict[str, np.ndarray]:
        """Every figure of B windows by name, ``[B]`` each, and ``latents`` ``[B, 256]`` where there is an evaluator."""
        motion, figures = self.shown(motion)
        figures |= window_figures(motion, truth, self.skeleton, self.kinematics, headings)
        arrays = {name: values.double().numpy() for name, values in figures.items()}
        return arrays | ({"latents": self.encode(motion)} if self.latents else {})

    def diversity(
        self, method: Method, starts: torch.Tensor, frames: int, name: str
    ) -> dict[str, np.ndarray]:
        """Mean distances between answers to the same request with other seeds at temperature 1, for each window."""
        steps, seeds = self.options.sampling.steps, self.options.diversity_seeds
        gap = slice(CONTEXT_FRAMES, frames - 1)
        found: dict[str, list] = {"joint_diversity_m": [], "latent_diversity": []}
        for nth, (segments, _) in enumerate(self.segments(starts, frames, f"{name}: {seeds} seeds")):
            positions, latents = [], []
            for seed in range(seeds):
                sampling = Sampling(steps, 1.0, self.options.sampling.seed + 1_000_003 * nth + seed + 1)
                motion, _ = self.shown(self.answer(method, segments, frames, sampling))
                positions.append(motion.world(self.kinematics)[:, gap])
                if self.latents:
                    latents.append(torch.from_numpy(self.encode(motion)))
            found["joint_diversity_m"].append(pairwise_distance(torch.stack(positions)))
            if latents:
                found["latent_diversity"].append(pairwise_distance(torch.stack(latents)))
        return {name: torch.cat(parts).double().numpy() for name, parts in found.items() if parts}


def glue(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Figures of several batches of windows as those of one."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@dataclass
class Found:
    """The figures of one method on one gap (or all gaps): an entry for each window, diversity for some windows."""

    windows: dict[str, np.ndarray]
    pieces: np.ndarray
    diversity: dict[str, np.ndarray] = field(default_factory=dict)
    diversity_pieces: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    @staticmethod
    def join(parts: list["Found"]) -> "Found":
        """Several gaps as one set of windows."""
        return Found(
            glue([p.windows for p in parts]),
            np.concatenate([p.pieces for p in parts]),
            glue([p.diversity for p in parts]),
            np.concatenate([p.diversity_pieces for p in parts]),
        )


class Distances:
    """FID and MMD of methods to ground truth, whose Gaussians are computed once for all draws of clips."""

    def __init__(self, truth: Found):
        self.truth = truth
        self.bootstrap = Bootstrap(truth.pieces)
        latents = truth.windows["latents"]
        self.gaussians = [Gaussian(latents, times) for times in self.bootstrap.draws(COSTLY_RESAMPLES)]

    def of(self, found: Found) -> dict[str, dict]:
        """A method's distances; ground truth's own between the windows with even and those with odd numbers."""
        if found is self.truth:
            return self._own()
        latents, bootstrap = found.windows["latents"], self.bootstrap
        discrepancy = Mmd(latents, self.truth.windows["latents"])
        draws = zip(bootstrap.draws(COSTLY_RESAMPLES), self.gaussians, strict=True)
        return {
            "mmd": bootstrap.statistic([discrepancy.value(t, t) for t in bootstrap.draws(RESAMPLES)]),
            "fid": bootstrap.statistic([frechet(Gaussian(latents, times), truth) for times, truth in draws]),
        }

    def _own(self) -> dict[str, dict]:
        latents, bootstrap = self.truth.windows["latents"], self.bootstrap
        even, odd = slice(0, None, 2), slice(1, None, 2)
        if len(latents) < 4:
            return {}
        discrepancy = Mmd(latents[even], latents[odd])
        # A draw of few clips may leave one half with nothing.
        usable = lambda most: [t for t in bootstrap.draws(most) if min(t[even].sum(), t[odd].sum()) > 1]
        gaussians = lambda t: (Gaussian(latents[half], t[half]) for half in (even, odd))
        return {
            "mmd": bootstrap.statistic([discrepancy.value(t[even], t[odd]) for t in usable(RESAMPLES)]),
            "fid": bootstrap.statistic([frechet(*gaussians(t)) for t in usable(COSTLY_RESAMPLES)]),
        }


def summarise(found: dict[str, Found]) -> dict[str, dict]:
    """``{method: {measure: {mean, low, high}}}`` of one set of windows."""
    truth = found[TRUTH]
    bootstrap = Bootstrap(truth.pieces)
    distances = Distances(truth) if "latents" in truth.windows else None
    out = {}
    for name, of in found.items():
        figures = distances.of(of) if distances else {}
        if of.diversity:
            of_pieces = Bootstrap(of.diversity_pieces)
            figures |= {figure: of_pieces.ratio(values) for figure, values in of.diversity.items()}
        for figure, values in of.windows.items():
            if figure not in ("latents", "npss_sum", "npss_weight"):
                figures[figure] = bootstrap.ratio(values)
        figures["npss"] = bootstrap.ratio(of.windows["npss_sum"], of.windows["npss_weight"])
        out[name] = figures
    return out


def measure_gap(bench: Bench, methods: dict[str, Method], sampled: set[str], gap: int) -> dict[str, Found]:
    """All methods on the windows of one gap; those in ``sampled`` can answer in more than one way."""
    options, frames = bench.options, check_gap(gap)
    starts, pieces = bench.windows(frames)
    parts: dict[str, list[dict]] = {name: [] for name in (TRUTH, *methods)}
    for segments, headings in bench.segments(starts, frames, f"gap {gap}"):
        truth = bench.shown(Motion.of(segments))[0]
        parts[TRUTH].append(bench.measure(Motion.of(segments), truth, headings))
        for name, method in methods.items():
            motion = bench.answer(method, segments, frames, options.sampling)
            parts[name].append(bench.measure(motion, truth, headings))
    found = {}
    few = spread(len(starts), options.diversity_windows)
    for name, chunks in parts.items():
        figures = glue(chunks)
        found[name] = Found(figures, pieces.numpy())
        if options.diversity_seeds < 2 or name == TRUTH:
            continue
        if name in sampled:
            found[name].diversity = bench.diversity(methods[name], starts[few], frames, name)
        else:
            zeros = ("joint_diversity_m", *(["latent_diversity"] if bench.latents else []))
            found[name].diversity = {figure: np.zeros(len(few)) for figure in zeros}
        found[name].diversity_pieces = pieces[few].numpy()
    return found


def evaluate(bench: Bench, methods: dict[str, Method], sampled: set[str]) -> dict:
    """The report: for each gap and for all gaps together every method's figures with their intervals.

    ``methods`` are measured beside ground truth and interpolation; those in ``sampled`` choose tokens.
    """
    options = bench.options
    methods = {"interpolation": bench.interpolation} | methods
    every = {gap: measure_gap(bench, methods, sampled, gap) for gap in options.gaps}
    report = {
        "split": options.split,
        "clips": len({int(p) // PIECES for found in every.values() for p in found[TRUTH].pieces}),
        "stride_frames": options.stride,
        "pinned": options.pinned,
        "temperature": options.sampling.temperature,
        "pose_steps": options.sampling.steps,
        "seed": options.sampling.seed,
        "diversity": {
            "seeds": options.diversity_seeds,
            "windows": options.diversity_windows,
            "temperature": 1.0,
        },
        "evaluator": bench.latents.sha256 if bench.latents else None,
        "robot": bench.skeleton.robot["name"] if bench.skeleton.robot else None,
        "gaps": [
            {"gap_frames": gap, "windows": len(found[TRUTH].pieces), "methods": summarise(found)}
            for gap, found in every.items()
        ],
    }
    if len(every) > 1:
        joined = {name: Found.join([f[name] for f in every.values()]) for name in (TRUTH, *methods)}
        report["all_gaps"] = {"windows": len(joined[TRUTH].pieces), "methods": summarise(joined)}
    return report
