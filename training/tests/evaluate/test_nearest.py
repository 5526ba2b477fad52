"""The nearest training window: that the search finds what is planted, and that the answer meets what was given."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.data.store import ClipStore
from troupe_training.evaluate import nearest
from troupe_training.evaluate.bench import Bench, Options, Sampling
from troupe_training.evaluate.nearest import NEAREST, NearestWindows, given_frames
from troupe_training.evaluate.report import NEARER, TRUTH, measure_all, measure_gap

FRAMES = 31


@pytest.fixture
def planted(cache: Path, tmp_path: Path) -> tuple[ClipStore, torch.Tensor, torch.Tensor]:
    """Test windows, and training windows that are the same ones elsewhere, turned, with all joints 2 mm higher at the target."""
    folder = tmp_path / "cache"
    shutil.copytree(cache, folder)
    arrays = {name: np.load(folder / f"{name}.npy") for name in ("positions", "six_d", "headings")}
    train, test = (ClipStore(cache, split) for split in ("train", "test"))
    asked = test.windows(FRAMES, 20)[0][:2]
    # On the stride of the search, within one training clip each.
    hidden = torch.tensor([train.clips[nth]["start"] + 2 * nearest.STRIDE for nth in range(len(asked))])
    psi = 1.0
    turn = np.array([[np.cos(psi), 0, np.sin(psi)], [0, 1, 0], [-np.sin(psi), 0, np.cos(psi)]], np.float32)
    for source, target in zip(asked.tolist(), hidden.tolist(), strict=True):
        own = slice(source, source + FRAMES)
        there = slice(target, target + FRAMES)
        arrays["positions"][there] = arrays["positions"][own] @ turn.T + np.array([3.0, 0.0, -2.0], np.float32)
        arrays["positions"][target + FRAMES - 1, :, 1] += 0.002
        six = arrays["six_d"][own].reshape(FRAMES, -1, 2, 3) @ turn.T
        arrays["six_d"][there] = six.reshape(arrays["six_d"][own].shape)
        arrays["headings"][there] = arrays["headings"][own] + psi
    for name, values in arrays.items():
        np.save(folder / f"{name}.npy", values)
    return ClipStore(folder, "test"), asked, hidden


def test_a_planted_window_is_found_wherever_it_stands(planted, monkeypatch):
    store, asked, hidden = planted
    monkeypatch.setattr(nearest, "CHUNK", 7)  # many chunks, the planted windows in different ones
    near = NearestWindows(store.of_split("train"))
    segments = store.segments(asked, FRAMES)
    starts, distances = near.find(segments, FRAMES, 3)
    assert torch.equal(starts[:, 0], hidden)
    # All joints of one given frame in five are 2 mm off.
    assert distances[:, 0].tolist() == pytest.approx([0.002 / 5**0.5] * len(asked), rel=0.05)
    assert (distances[:, 1:] > distances[:, :1]).all() and (distances[:, 2] >= distances[:, 1]).all()
    made, truth = near(segments, FRAMES, Sampling()), Motion.of(segments)
    assert torch.allclose(made.root, truth.root, atol=3e-3)
    assert torch.allclose(made.rotations, truth.rotations, atol=1e-3)


def test_the_search_is_exact(cache: Path):
    """Beside the plain search over all windows, at every chunk's end too."""
    store = ClipStore(cache, "test")
    train = store.of_split("train")
    near = NearestWindows(train)
    segments = store.segments(store.windows(FRAMES, 20)[0], FRAMES)
    starts = train.windows(FRAMES, nearest.STRIDE)[0]
    plain = near.positions_of(starts, FRAMES)
    wanted = near.positions_of(store.windows(FRAMES, 20)[0], FRAMES)
    distance = (plain[None].double() - wanted[:, None]).square().mean(-1).mul(3).sqrt()
    found, least = near.find(segments, FRAMES)
    assert torch.allclose(least[:, 0].double(), distance.amin(1), atol=1e-5)
    assert torch.equal(found[:, 0], starts[distance.argmin(1)])


def test_an_answer_meets_what_was_given_and_is_no_interpolation(cache: Path):
    store = ClipStore(cache, "test")
    near = NearestWindows(store.of_split("train"))
    segments = store.segments(store.windows(FRAMES, 20)[0], FRAMES)
    truth, made = Motion.of(segments), near(segments, FRAMES, Sampling())
    index = given_frames(FRAMES)
    assert torch.allclose(made.root[:, index], truth.root[:, index], atol=1e-5)
    assert torch.allclose(made.rotations[:, index], truth.rotations[:, index], atol=1e-3)
    flat = Bench(cache, Options(), None, 1).interpolation(segments, FRAMES, Sampling())
    assert (made.rotations - flat.rotations)[:, CONTEXT_FRAMES:-1].abs().amax((1, 2, 3, 4)).min() > 0.05


def test_reports_have_the_baseline_and_the_share_that_it_wins(cache: Path):
    bench = Bench(cache, Options([26], split="test", diversity_seeds=0), None, 1)
    truth = {"pack": lambda segments, frames, sampling: Motion.of(segments)}
    figures = measure_all(bench, truth, set())["gaps"][0]["methods"]
    assert list(figures) == [TRUTH, "interpolation", NEAREST, "pack"]
    assert figures[NEAREST][NEARER]["mean"] == 0.0, "nothing is nearer to the captured motion than itself"
    near = NearestWindows(bench.store.of_split("train"))
    beaten = {"pack": bench.interpolation, NEAREST: near, "captured": lambda segments, frames, _: Motion.of(segments)}
    found = measure_gap(bench, beaten, set(), 26)
    assert found["captured"].windows[NEARER].mean() == 1.0
    expected = found[NEAREST].windows["l2p_m"] < found["pack"].windows["l2p_m"]
    assert (found[NEAREST].windows[NEARER] == expected).all() and expected.any()
    train = Bench(cache, Options([26], split="train", max_windows=5, diversity_seeds=0), None, 1)
    assert NEAREST not in measure_all(train, truth, set())["gaps"][0]["methods"], "each would find itself"


def test_without_training_clips_of_the_length_the_command_ends(cache: Path):
    store = ClipStore(cache, "train")
    store.clips = []
    segments = ClipStore(cache, "test").segments(torch.tensor([0]), FRAMES)
    with pytest.raises(SystemExit, match="no training clip has 31 frames"):
        NearestWindows(store)(segments, FRAMES, Sampling())
