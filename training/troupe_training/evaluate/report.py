"""``evaluate``: every measure of a pack or of a run's checkpoints on the test split, beside ground truth and baselines.

Runs the networks without a server, at temperature 0 with one pose step by default. Answers are what the decoder
gives, or with ``pinned`` what the server would answer, which meets its keyframes. `troupe-eval gaps` measures through a running
server. `docs/evaluation.md` defines every measure.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from troupe_training.data.motion import Motion
from troupe_training.data.store import PIECES, spread
from troupe_training.evaluate.bench import DISTANCE, Bench, Method, check_gap
from troupe_training.evaluate.distribution import Gaussian, Mmd, frechet
from troupe_training.evaluate.intervals import COSTLY_RESAMPLES, RESAMPLES, Bootstrap
from troupe_training.evaluate.nearest import NEAREST, NearestWindows
from troupe_training.evaluate.parts import FEWEST_FOR_DISTANCES, PartOf, masks, part_of
from troupe_training.evaluate.tables import Figure, Methods

TRUTH = "ground truth"
PACK = "pack"
NEARER = "nearer_than_pack"  # share of windows in which a method's L2P is lower than the pack's
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

    def kept(self, mask: np.ndarray, diverse: np.ndarray, distances: bool) -> "Found":
        """The windows in ``mask`` alone, and of those measured for diversity the ones in ``diverse``; latents if asked for."""
        windows = {name: v[mask] for name, v in self.windows.items() if distances or name != "latents"}
        diversity = {name: v[diverse] for name, v in self.diversity.items()} if diverse.any() else {}
        return Found(windows, self.pieces[mask], diversity, self.diversity_pieces[diverse])


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
            if DISTANCE in of.diversity:
                figures["diversity_ratio"] = of_pieces.ratio(of.diversity["joint_diversity_m"], of.diversity[DISTANCE])
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
    figures_of = {name: glue(chunks) for name, chunks in parts.items()}
    for name, figures in figures_of.items():
        if PACK in figures_of and name not in (TRUTH, PACK):
            figures[NEARER] = (figures["l2p_m"] < figures_of[PACK]["l2p_m"]).astype(float)
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

    ``methods`` are measured beside ground truth, interpolation and the nearest training window; those in ``sampled`` choose
    tokens. The nearest training window is left out on the train split, where each window would find itself.
    """
    options = bench.options
    baselines: dict[str, Method] = {"interpolation": bench.interpolation}
    if options.split != "train":
        baselines[NEAREST] = NearestWindows(bench.store.of_split("train"))
    methods = baselines | methods
    every = {gap: measure_gap(bench, methods, sampled, gap) for gap in options.gaps}
    report: dict[str, Any] = {
        "split": options.split,
        "clips": len({int(p) // PIECES for found in every.values() for p in found[TRUTH].pieces}),
        "stride_frames": options.stride,
        "uncut": options.uncut,
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
    blocks: dict[int | None, dict[str, Found]] = dict(every.items())
    if len(every) > 1:
        joined = {name: Found.join([f[name] for f in every.values()]) for name in (TRUTH, *methods)}
        report["all_gaps"] = {"windows": len(joined[TRUTH].pieces), "methods": summarise(joined)}
        blocks[None] = joined
    report["parts"] = {by: _apart(blocks, bench, part_of(by, options.cells)) for by in options.by}
    return report


def _apart(blocks: dict[int | None, dict[str, Found]], bench: Bench, parts: PartOf) -> list[dict[str, Any]]:
    """The figures of each part of the clips: blocks by gap, None of all gaps, as far as the part has windows of it."""
    out: dict[str, list[dict[str, Any]]] = {}
    for gap, found in blocks.items():
        for name, mask in masks(parts, bench.store.clips, found[TRUTH].pieces).items():
            windows, kept = int(mask.sum()), {}
            for method, of in found.items():
                diverse = masks(parts, bench.store.clips, of.diversity_pieces).get(
                    name, np.zeros(len(of.diversity_pieces), bool)
                )
                kept[method] = of.kept(mask, diverse, windows >= FEWEST_FOR_DISTANCES)
            block = {"gap_frames": gap, "windows": windows, "methods": summarise(kept)}
            out.setdefault(name, []).append(block)
    return [{"name": name, "gaps": gaps} for name, gaps in sorted(out.items())]
