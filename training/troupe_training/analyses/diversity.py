"""How much answers to one request differ, beside how far they are from what was captured; and which stage lets them.

For a calibrated generator the mean distance of a joint between two answers is that from an answer to the captured motion:
their ratio is 1. Each stage is sampled alone, and the decoder gets tokens that it would never be given, to see how much it
follows them. Answers are pinned to their keyframes as the server's are.
"""

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor
from tqdm import tqdm

from troupe_training.analyses.common import Setting, write
from troupe_training.analyses.samplers import (
    Requests,
    Sampler,
    any_tokens,
    captured_root,
    certainty,
    context_and_target,
    fitted_tokens,
    hidden,
    likeliest,
    others_tokens,
    roots,
    served,
    similar_windows,
    target,
    tokens_at,
    turned_to_heading,
)
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.evaluate.bench import Bench, Method, Options, Sampling, check_gap
from troupe_training.evaluate.distribution import pairwise_distance
from troupe_training.evaluate.intervals import Bootstrap
from troupe_training.evaluate.metrics import accelerations
from troupe_training.evaluate.motionbricks import StageNetworks
from troupe_training.evaluate.nearest import NearestWindows
from troupe_training.evaluate.report import Arrays, glue, measure_gap, summarise
from troupe_training.models.motionbricks.config import COUNTS, FRAMES_PER_TOKEN, MIN_TOKENS
from troupe_training.train.plots import Line, Panel

GAPS = (15, 30, 45)
SEEDS = 10
BATCH = 40  # windows whose tokens and nearest windows are at hand together
TEMPERATURES = (0.5, 1.0, 1.5, 2.0, 3.0)
STEPS = (1, 5, 10)
MODE = "mode"
WIDER = 1.5  # how much wider than on training windows the root stage's misses are drawn


def grid_name(temperature: float, steps: int, any_order: bool = False) -> str:
    """The name of a case of the grid of temperatures and pose steps."""
    return f"temperature {temperature:g}, {steps} pose steps" + (", any order" if any_order else "")


def grid() -> dict[str, Sampler]:
    """Temperatures and pose steps, committed as the server does and in any order."""
    cases = {
        grid_name(temperature, steps): tokens_at(Sampling(steps, temperature))
        for temperature in TEMPERATURES
        for steps in STEPS
    }
    return cases | {
        grid_name(temperature, max(STEPS), True): tokens_at(Sampling(max(STEPS), temperature, any_order=True))
        for temperature in TEMPERATURES
    }


def stages() -> dict[str, Sampler]:
    """Each stage sampled alone, and what bounds it; those that have no choice give one answer."""
    drawn = Sampling(1, 1.0)
    return {
        "as served": served(drawn),
        "root choice": served(Sampling(1, 0.0, root=1.0)),
        "pose tokens": tokens_at(drawn),
        "tokens of other windows": others_tokens,
        "tokens at random": any_tokens,
        "missed roots": roots(),
        "missed roots and pose tokens": roots(drawn),
        "pose tokens, decoder without target": hidden(drawn, target),
        "pose tokens, decoder without keyframes": hidden(drawn, context_and_target),
        "nearest training windows": similar_windows,
    }


def bounds() -> dict[str, Sampler]:
    """The losses of one answer by its root and by its tokens."""
    return {
        MODE: likeliest,
        "captured root": captured_root,
        "fitted tokens": fitted_tokens(False),
        "captured root, fitted tokens": fitted_tokens(True),
    }


def remedies() -> dict[str, Sampler]:
    """Samplers that need no training. Their single samples are also measured by FID."""
    many = max(STEPS)
    free = Sampling(many, 1.5, any_order=True)
    return {
        "as served": served(Sampling(1, 1.0)),
        "pose tokens": tokens_at(Sampling(1, 1.0)),
        "temperature 2": served(Sampling(1, 2.0)),
        f"any order, {many} pose steps, temperature 1.5": tokens_at(free),
        "missed roots": roots(Sampling(1, 1.0)),
        f"missed roots; any order, {many} pose steps, temperature 1.5": roots(free),
        f"missed roots × {WIDER:g}": roots(Sampling(1, 1.0), WIDER),
        f"missed roots × {WIDER:g}; any order, {many} pose steps, temperature 1.5": roots(free, WIDER),
        "decoder without target": hidden(Sampling(1, 1.0), target),
    }


@dataclass
class Study:
    """The windows of one gap and what answers them."""

    bench: Bench
    networks: StageNetworks
    near: NearestWindows
    gap: int

    def requests(self) -> list[Requests]:
        """All windows in batches."""
        frames = check_gap(self.gap)
        starts, _ = self.bench.windows(frames)
        return [
            Requests(self.bench, self.networks, self.near, self.bench.store.segments(chunk, frames), frames)
            for chunk in starts.split(BATCH)
        ]

    def bootstrap(self) -> Bootstrap:
        """Draws of the windows' clips."""
        return Bootstrap(self.bench.windows(check_gap(self.gap))[1].numpy())

    def positions(self, requests: Requests, sampler: Sampler, seed: int) -> Tensor:
        """Joint positions ``[B, N, J, 3]`` of one answer each, pinned, and put onto hinges if there are any."""
        bench = self.bench
        answer = bench.answer(lambda *_: sampler(requests, seed), requests.segments, requests.frames, Sampling())
        return bench.shown(answer)[0].world(bench.kinematics)

    def captured(self, requests: Requests) -> Tensor:
        """The captured windows' joint positions."""
        return self.bench.shown(Motion.of(requests.segments))[0].world(self.bench.kinematics)


def spread_of(answers: Tensor, captured: Tensor) -> Arrays:
    """Figures ``[B]`` of S answers ``[S, B, N, J, 3]`` to whole windows, beside the captured ``[B, N, J, 3]``, over the gap.

    `between_m` is the mean distance of a joint between two answers, `off_m` that from an answer to the captured motion. `l2p_m`
    and `best_l2p_m` are the mean and the smallest L2P of the answers, `jitter_mps2` is the first answer's.
    """
    last = answers.shape[2] - 1
    gap = slice(CONTEXT_FRAMES, last)
    error = (answers - captured)[:, :, gap].norm(dim=-1)  # [S, B, N, J]
    l2p = error.square().sum(-1).sqrt().mean(-1)
    figures = {
        "between_m": pairwise_distance(answers[:, :, gap]),
        "off_m": error.mean((0, 2, 3)),
        "l2p_m": l2p.mean(0),
        "best_l2p_m": l2p.amin(0),
        "jitter_mps2": accelerations(answers[0])[:, CONTEXT_FRAMES - 1 : last - 1].mean((1, 2)),
    }
    return {name: values.double().numpy() for name, values in figures.items()}


def summary(found: Arrays, bootstrap: Bootstrap, mode: Arrays | None = None) -> dict[str, dict[str, float]]:
    """Means with intervals, the ratio, and how often the best answer lies nearer than the mode does."""
    figures = {name: bootstrap.ratio(values) for name, values in found.items()}
    figures["ratio"] = bootstrap.ratio(found["between_m"], found["off_m"])
    if mode is not None:
        figures["best_beats_mode"] = bootstrap.ratio((found["best_l2p_m"] < mode["l2p_m"]).astype(float))
    return figures


def measure_spread(study: Study, samplers: dict[str, Sampler], seeds: int) -> dict[str, Arrays]:
    """`spread_of` of each sampler's answers to all windows."""
    parts: dict[str, list[Arrays]] = {name: [] for name in samplers}
    for nth, requests in enumerate(study.requests()):
        captured = study.captured(requests)
        for name, sampler in tqdm(samplers.items(), desc=f"gap {study.gap}", leave=False):
            # Seeds differ between batches, and begin with a multiple of `SEEDS`, so that all
            # similar windows have a turn.
            own = range(1_000_000 * nth, 1_000_000 * nth + seeds)
            answers = torch.stack([study.positions(requests, sampler, seed) for seed in own])
            parts[name].append(spread_of(answers, captured))
    return {name: glue(chunks) for name, chunks in parts.items()}


def timing(study: Study) -> dict[str, float]:
    """Durations as the root stage would choose them, if the gap's length were not given; frames."""
    between, off, likely = [], [], []
    for requests in study.requests():
        probabilities = count_probabilities(requests)
        frames = (torch.arange(COUNTS) + MIN_TOKENS) * float(FRAMES_PER_TOKEN)
        own = float(requests.mode.tokens.shape[1] * FRAMES_PER_TOKEN)
        apart = (frames[:, None] - frames).abs()
        between.append((probabilities[:, :, None] * probabilities[:, None] * apart).sum((1, 2)))
        off.append((probabilities * (frames - own).abs()).sum(1))
        likely.append((frames[probabilities.argmax(1)] - own).abs())
    means = [float(torch.cat(parts).mean()) for parts in (between, off, likely)]
    return {
        "between_frames": means[0],
        "off_frames": means[1],
        "mode_off_frames": means[2],
        "ratio": means[0] / means[1],
    }


def count_probabilities(requests: Requests) -> Tensor:
    """Chances ``[B, 14]`` of 3 to 16 tokens where all are allowed."""
    asked: dict[str, Tensor] = {}

    def recorded(stage: str, **inputs: Tensor) -> dict[str, Tensor]:
        if stage == "root":
            asked.update(inputs)
        return requests.networks.run(stage, **inputs)

    networks = replace(requests.networks, run=recorded)
    Requests(requests.bench, networks, requests.near, requests.segments, requests.frames).mode  # noqa: B018 - asks the root stage
    free = asked | {"allowed_counts": torch.ones_like(asked["allowed_counts"])}
    return requests.networks.run("root", **free)["count_probs"]


def decoder_follows(study: Study) -> dict[str, float]:
    """How far two windows' poses lie apart, and two answers to one request that have those windows' tokens; metres."""
    clips, answers = [], []
    for requests in study.requests():
        gap = slice(CONTEXT_FRAMES, requests.frames - 1)
        seen = turned_to_heading(requests.segments)[:, gap]
        clips.append((seen - seen.roll(1, 0)).norm(dim=-1).mean((1, 2)))
        own, others = (study.positions(requests, s, 0) for s in (likeliest, others_tokens))
        answers.append((own - others)[:, gap].norm(dim=-1).mean((1, 2)))
    apart, moved = (float(torch.cat(parts).mean()) for parts in (clips, answers))
    return {"clips_m": apart, "answers_m": moved, "share": moved / apart}


def token_certainty(study: Study) -> dict[str, float]:
    """The pose stage's choice in its first pass, in the mean over tokens."""
    codes, share = zip(*(certainty(requests) for requests in study.requests()), strict=True)
    return {"codes_in_play": float(torch.cat(codes).mean()), "likeliest_share": float(torch.cat(share).mean())}


def single_samples(study: Study) -> dict[str, Any]:
    """One sample of each remedy as any other answer is measured: FID, jitter and the rest, beside the mode."""

    def method(sampler: Sampler) -> Method:
        def answer(segments: Any, frames: int, sampling: Sampling) -> Motion:
            requests = Requests(study.bench, study.networks, study.near, segments, frames)
            # Another seed for each batch; the first window's place tells them apart.
            return sampler(requests, int(segments.global_root[0, 0, 0].abs() * 1e6) % 1_000_003)

        return answer

    methods = {MODE: method(likeliest)} | {name: method(sampler) for name, sampler in remedies().items()}
    return summarise(measure_gap(study.bench, methods, set(), study.gap))


def run(setting: Setting) -> bool:
    """Measures all gaps; nothing is trained."""
    options = Options(
        list(GAPS), setting.stride, setting.split, True, diversity_seeds=0, max_windows=setting.max_windows
    )
    bench = Bench(setting.cache, options, setting.evaluator, setting.threads)
    # Ten answers to each of some windows, or one to each of ten times as many: FID needs windows.
    most = None if setting.max_windows is None else SEEDS * setting.max_windows
    wide = copy(bench)
    wide.options = replace(options, max_windows=most)
    networks, near = setting.networks(bench), NearestWindows(bench.store.of_split("train"))
    report: dict[str, Any] = {
        "source": setting.source.name,
        "seeds": SEEDS,
        "stride_frames": setting.stride,
        "gaps": [],
    }
    for gap in GAPS:
        study = Study(bench, networks, near, gap)
        bootstrap = study.bootstrap()
        only = measure_spread(study, bounds(), 1)
        mode = only[MODE]
        sections: dict[str, Any] = {"bounds": {name: summary(found, bootstrap) for name, found in only.items()}}
        for section, samplers in (("grid", grid()), ("stages", stages()), ("remedies", remedies())):
            found = measure_spread(study, samplers, SEEDS)
            sections[section] = {name: summary(values, bootstrap, mode) for name, values in found.items()}
        report["gaps"].append(
            {
                "gap_frames": gap,
                "windows": len(mode["l2p_m"]),
                "timing": timing(study),
                "tokens": token_certainty(study),
                "decoder": decoder_follows(study),
                "single_samples": single_samples(replace(study, bench=wide)),
                **sections,
            }
        )
    title = f"distance between {SEEDS} answers ÷ their distance to the captured motion, {setting.source.name}"
    write(setting, "diversity", report | {"split": setting.split}, title, panels(report))
    return True


def panels(report: dict[str, Any]) -> list[Panel]:
    """The ratio by temperature and pose steps for each gap, and by stage."""
    drawn = []
    for block in report["gaps"]:
        curves = [(f"{steps} pose steps", steps, False) for steps in STEPS]
        curves.append((f"{max(STEPS)}, any order", max(STEPS), True))
        lines = [
            Line(
                label,
                list(TEMPERATURES),
                [[block["grid"][grid_name(t, n, free)]["ratio"]["mean"] for t in TEMPERATURES]],
            )
            for label, n, free in curves
        ]
        drawn.append(Panel(f"ratio, gap of {block['gap_frames']} frames", "temperature", lines))
    names = list(report["gaps"][0]["stages"])
    gaps = [float(block["gap_frames"]) for block in report["gaps"]]
    lines = [Line(n, gaps, [[b["stages"][n]["ratio"]["mean"] for b in report["gaps"]]]) for n in names]
    return [*drawn, Panel("ratio by what is sampled", "gap (frames)", lines)]
