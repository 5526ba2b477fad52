"""Distances between answers and to the captured motion, and the ways to draw answers."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from troupe_training.analyses import diversity
from troupe_training.analyses.diversity import MODE, Study, decoder_follows, measure_spread, spread_of, summary, timing
from troupe_training.analyses.samplers import (
    Requests,
    any_tokens,
    fitted_tokens,
    hidden,
    likeliest,
    others_tokens,
    roots,
    similar_windows,
    target,
    tokens_at,
)
from troupe_training.cli.main import main
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.evaluate.bench import Bench, Options, Sampling
from troupe_training.evaluate.intervals import Bootstrap
from troupe_training.evaluate.motionbricks import open_networks
from troupe_training.evaluate.nearest import NearestWindows


@pytest.fixture(scope="module")
def run(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    for stage in ("tokenizer", "root", "pose"):
        argv = ["train", stage, "--run", str(folder), "--cache", str(cache), "--preset", "test"]
        assert main([*argv, "--steps", "40", "--frames-per-step", "512", "--threads", "1"]) == 0
    return folder


@pytest.fixture(scope="module")
def study(cache: Path, run: Path) -> Study:
    bench = Bench(cache, Options(pinned=True, max_windows=6), None, 1)
    return Study(bench, open_networks(run, bench.store, 1), NearestWindows(bench.store.of_split("train")), 26)


@pytest.fixture
def requests(study: Study) -> Requests:
    return study.requests()[0]


def test_a_calibrated_generator_has_a_ratio_of_one():
    """Answers and captured motion drawn from one distribution; and from a narrower one, answers that are half as varied."""
    generator = torch.Generator().manual_seed(1)
    captured, answers = (torch.randn(*shape, 6, 20, 4, 3, generator=generator) for shape in ((), (8,)))
    bootstrap = Bootstrap(np.arange(6))
    assert summary(spread_of(answers, captured), bootstrap)["ratio"]["mean"] == pytest.approx(1.0, abs=0.03)
    narrow = summary(spread_of(0.5 * answers, captured), bootstrap)["ratio"]["mean"]
    assert narrow == pytest.approx(1.0 / np.sqrt(2 * (1 + 0.25) / 1), rel=0.1)
    same = spread_of(answers[:1].expand(8, -1, -1, -1, -1), captured)
    assert summary(same, bootstrap)["ratio"]["mean"] == 0.0
    assert np.allclose(same["best_l2p_m"], same["l2p_m"])


def test_the_best_answer_is_the_one_that_was_captured():
    captured = torch.randn(3, 20, 4, 3, generator=torch.Generator().manual_seed(2))
    off = captured + 0.1
    found = spread_of(torch.stack([off, captured]), captured)
    mode = spread_of(off[None], captured)
    assert np.allclose(found["best_l2p_m"], 0.0) and (found["l2p_m"] > 0.0).all()
    assert summary(found, Bootstrap(np.arange(3)), mode)["best_beats_mode"]["mean"] == 1.0


def test_frames_that_are_given_do_not_count():
    captured = torch.zeros(2, 20, 4, 3)
    answers = torch.zeros(3, 2, 20, 4, 3)
    answers[:, :, [*range(CONTEXT_FRAMES), 19]] = torch.randn(3, 2, 5, 4, 3)
    assert spread_of(answers, captured)["between_m"].max() == 0.0 == spread_of(answers, captured)["off_m"].max()


def test_each_sampler_varies_what_it_says(requests: Requests):
    mode = likeliest(requests, 0)
    assert torch.equal(mode.root, likeliest(requests, 1).root)
    for sampler in (
        tokens_at(Sampling(1, 2.0)),
        tokens_at(Sampling(3, 2.0, any_order=True)),
        any_tokens,
        others_tokens,
    ):
        first, second, again = (sampler(requests, seed) for seed in (1, 2, 1))
        assert torch.equal(first.rotations, again.rotations)
        assert not torch.allclose(first.rotations, second.rotations, atol=1e-4)
    drawn = [roots()(requests, seed) for seed in (1, 2)]
    assert (drawn[0].root - drawn[1].root).norm(dim=-1).amax() > 1e-3
    found = [similar_windows(requests, seed).rotations for seed in (0, 1)]
    assert not torch.allclose(*found, atol=1e-3)


def test_a_missed_root_takes_a_training_windows_prediction_to_its_capture(requests: Requests):
    place, turn = requests.missed_roots(0)
    windows = len(requests.segments.global_root)
    assert place.shape == (windows, 31, 3) and turn.shape == (windows, 31)
    # A hardly trained stage misses its way by something, and never by more than the walk is long.
    assert 1e-3 < place.norm(dim=-1).max() < 3.0 and turn.abs().max() <= np.pi


def test_what_is_hidden_does_not_reach_the_decoder(requests: Requests):
    sampling = Sampling(1, 0.0)
    shown, kept = tokens_at(sampling)(requests, 1), hidden(sampling, target)(requests, 1)
    assert not torch.allclose(shown.rotations, kept.rotations, atol=1e-4)
    none = hidden(sampling, lambda frames: [])(requests, 1)
    assert torch.equal(none.rotations, shown.rotations)


def test_fitted_tokens_lie_nearer_than_the_likeliest(study: Study, requests: Requests):
    truth = Motion.of(requests.segments).world(study.bench.kinematics)
    off = [
        (sampler(requests, 0).world(study.bench.kinematics) - truth).norm(dim=-1).mean((1, 2))
        for sampler in (likeliest, fitted_tokens(False))
    ]
    assert (off[1] <= off[0] + 1e-6).all() and off[1].sum() < off[0].sum()


def test_a_study_measures_all_windows(study: Study):
    found = measure_spread(study, {"drawn": tokens_at(Sampling(1, 1.0)), MODE: likeliest}, 3)
    assert len(found["drawn"]["l2p_m"]) == sum(len(r.segments.global_root) for r in study.requests())
    assert found["drawn"]["between_m"].min() > 0.0 == found[MODE]["between_m"].max()
    assert (found["drawn"]["best_l2p_m"] < found["drawn"]["l2p_m"]).all()
    durations = timing(study)
    assert durations["between_frames"] > 0.0 and durations["ratio"] == pytest.approx(
        durations["between_frames"] / durations["off_frames"]
    )
    assert decoder_follows(study)["clips_m"] > 0.0


def test_the_command_writes_all_of_it(run: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(diversity, "GAPS", (15, 26))
    monkeypatch.setattr(diversity, "SEEDS", 2)
    monkeypatch.setattr(diversity, "TEMPERATURES", (1.0, 2.0))
    monkeypatch.setattr(diversity, "STEPS", (1, 2))
    argv = ["analyse", "diversity", "--run", str(run), "--cache", str(cache), "--out", str(tmp_path)]
    assert main([*argv, "--max-windows", "4", "--threads", "1"]) == 0
    assert (tmp_path / "diversity.png").stat().st_size > 10_000
    report = json.loads((tmp_path / "diversity.json").read_text())
    assert [block["gap_frames"] for block in report["gaps"]] == [15, 26]
    block = report["gaps"][0]
    assert len(block["grid"]) == 6 and block["stages"]["pose tokens"]["ratio"]["mean"] > 0.0
    assert "l2p_m" in block["single_samples"]["as served"] and MODE in block["single_samples"]
    assert block["bounds"]["captured root"]["off_m"]["mean"] != block["bounds"][MODE]["off_m"]["mean"]
