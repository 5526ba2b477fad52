"""``evaluate``: every measure of a pack or of a run's checkpoints on the test split, beside ground truth and baselines.

Runs the networks without a server, at temperature 0 with one pose step unless told otherwise. Answers are what the decoder
gives, or with ``pinned`` what the server would answer, which meets its keyframes. `troupe eval` measures through a running
server. `docs/evaluation.md` defines every measure.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from troupe_training.data.motion import Motion
from troupe_training.data.store import PIECES, spread
from troupe_training.evaluate.bench import Bench, Method, check_gap
from troupe_training.evaluate.distribution import Gaussian, Mmd, frechet
from troupe_training.evaluate.intervals import COSTLY_RESAMPLES, RESAMPLES, Bootstrap
from troupe_training.evaluate.tables import Figure, Methods

TRUTH = "ground truth"
Arrays = dict[str, np.ndarray]  # by measure, an entry for each window


def glue(parts: list[Arrays]) -> Arrays:
    """Figures of several batches of windows as those of one."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@dataclass
class Found:
    """The figures of one method on one gap (or all gaps): an entry for each window, diversity for some windows."""

    windows: Arrays
    pieces: np.ndarray
    diversity: Arrays = field(default_factory=dict)
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

    def of(self, found: Found) -> dict[str, Figure]:
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

    def _own(self) -> dict[str, Figure]:
        latents, bootstrap = self.truth.windows["latents"], self.bootstrap
        even, odd = slice(0, None, 2), slice(1, None, 2)
        if len(latents) < 4:
            return {}
        discrepancy = Mmd(latents[even], latents[odd])

        def usable(most: int) -> list[np.ndarray]:
            """A draw of few clips may leave one half with nothing."""
            return [t for t in bootstrap.draws(most) if min(t[even].sum(), t[odd].sum()) > 1]

        def distance(t: np.ndarray) -> float:
            return frechet(Gaussian(latents[even], t[even]), Gaussian(latents[odd], t[odd]))

        return {
            "mmd": bootstrap.statistic([discrepancy.value(t[even], t[odd]) for t in usable(RESAMPLES)]),
            "fid": bootstrap.statistic([distance(t) for t in usable(COSTLY_RESAMPLES)]),
        }


def summarise(found: dict[str, Found]) -> Methods:
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
    parts: dict[str, list[Arrays]] = {name: [] for name in (TRUTH, *methods)}
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


def measure_all(bench: Bench, methods: dict[str, Method], sampled: set[str]) -> dict[str, Any]:
    """The report: for each gap and for all gaps together every method's figures with their intervals.

    ``methods`` are measured beside ground truth and interpolation; those in ``sampled`` choose tokens.
    """
    options = bench.options
    methods = {"interpolation": bench.interpolation} | methods
    every = {gap: measure_gap(bench, methods, sampled, gap) for gap in options.gaps}
    report: dict[str, Any] = {
        "split": options.split,
        "clips": len({int(p) // PIECES for found in every.values() for p in found[TRUTH].pieces}),
        "stride_frames": options.stride,
        "pinned": options.pinned,
        "temperature": options.sampling.temperature,
        "pose_steps": options.sampling.steps,
        "seed": options.sampling.seed,
        "diversity": {"seeds": options.diversity_seeds, "windows": options.diversity_windows, "temperature": 1.0},
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
