import json
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.bodies_store import Corpus
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.models.unimogen.state import BodyKinematics
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.unimogen.diffusion import dropped_words, given_frames, offset_range
from troupe_training.train.unimogen.filters import knots, smoothing
from troupe_training.train.unimogen.losses import Weights, all_losses
from troupe_training.train.unimogen.paths import wanted_paths


def command(cache: Path, run: Path, steps: int) -> list[str]:
    argv = ["unimogen", "train", "--cache", str(cache), "--run", str(run), "--unimogen-preset", "tiny"]
    return [*argv, "--steps", str(steps), "--rows-per-step", "1500", "--threads", "1", "--rate", "3e-3"]


@pytest.fixture(scope="module")
def run(corpus_cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unimogen")
    assert main(command(corpus_cache, folder, 30)) == 0
    return folder


def test_the_loss_falls_and_a_run_goes_on(run: Path, corpus_cache: Path, capsys: pytest.CaptureFixture[str]):
    assert main(command(corpus_cache, run, 150)) == 0
    assert "going on from step 30" in capsys.readouterr().out
    curve = json.loads((run / "unimogen.json").read_text())
    first, last = curve["history"][0], curve["history"][-1]
    assert curve["step"] == 150 and last["total"] < 0.5 * first["total"]


def test_a_run_goes_on_with_some_of_its_bodies(corpus_cache: Path, tmp_path: Path):
    assert main(command(corpus_cache, tmp_path, 2)) == 0
    every = read_checkpoint(tmp_path / "unimogen.pt")["meta"]["bodies"]
    assert len(every) > 1
    assert main([*command(corpus_cache, tmp_path, 4), "--trained-bodies", every[0]]) == 0
    assert read_checkpoint(tmp_path / "unimogen.pt")["meta"]["bodies"] == every[:1]
    with pytest.raises(SystemExit, match=f"--trained-bodies {every[1]}: .* begun with {every[0]}: name some"):
        main([*command(corpus_cache, tmp_path, 6), "--trained-bodies", *every])


def test_one_motion_is_sampled_and_measured(run: Path, corpus_cache: Path, tmp_path: Path):
    out, figures = tmp_path / "motion.npz", tmp_path / "figures.json"
    shared = ["--run", str(run), "--cache", str(corpus_cache), "--threads", "1"]
    sampling = ["--frames", "20", "--words", "walk=0.5", "--body", "toy", "--sampler-steps", "2", "--guidance", "2"]
    assert main(["unimogen", "sample", *shared, *sampling, "--out", str(out)]) == 0
    evaluation = [
        "--frames",
        "20",
        "--max-windows",
        "3",
        "--parts",
        "test",
        "--sampler-steps",
        "1",
        "--json",
        str(figures),
    ]
    assert main(["unimogen", "evaluate", *shared, *evaluation]) == 0
    report = json.loads(figures.read_text())["figures"]
    captured, frozen = report["toy, test"]["captured"], report["toy, test"]["frozen pose"]
    assert captured["path_position_m"] < 1e-6 and captured["l2p_m"] < 1e-6 < frozen["l2p_m"]
    with pytest.raises(SystemExit, match="no motion shows 'fly'"):
        main(["unimogen", "sample", *shared, "--words", "fly", "--body", "toy"])


def test_paths_pass_given_frames():
    generator = torch.Generator().manual_seed(0)
    root = torch.randn(40, 36, 3, generator=generator).cumsum(1) * 0.05
    heading = torch.randn(40, 36, generator=generator).cumsum(1) * 0.1
    given = given_frames(40, 36, generator)
    path = wanted_paths(root, heading, given, 0.1, generator)  # a body so small that no drawn path fits
    on = given > 0
    torch.testing.assert_close(path.points[on], root[..., [0, 2]][on], atol=1e-4, rtol=0)
    away = (path.points - root[..., [0, 2]]).norm(dim=-1).amax(1)
    assert (away < 1e-4).any() and (away > 0.02).any()


def test_filters_keep_straight_lines():
    line = torch.arange(36.0)[:, None]
    torch.testing.assert_close(knots(36, 10, 3) @ line, line, atol=1e-3, rtol=0)
    inner = smoothing(36, 2.0) @ line
    torch.testing.assert_close(inner[8:-8], line[8:-8], atol=1e-3, rtol=0)


def test_dropouts_have_their_shares():
    generator = torch.Generator().manual_seed(0)
    given = given_frames(4000, 36, generator)
    assert float(given[:, 0].mean()) == pytest.approx(0.5, abs=0.03)
    assert float(given[:, -1].mean()) == pytest.approx(0.25, abs=0.03)
    words = dropped_words(torch.ones(4000, 2), generator)
    assert float((words.sum(1) == 0).float().mean()) == pytest.approx(0.1 + 0.9 * 0.01, abs=0.02)


def test_losses_are_zero_for_the_truth_and_stance_feet_that_slide_cost(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    windows = store.draw(2, 20, torch.Generator().manual_seed(0))
    bends, kinematics, free = six_d_to_matrix(windows.bends), BodyKinematics(store.body), torch.ones(2, 20)
    rows, feet = torch.zeros(2, 14, 20, 6), store.body.skeleton.contact_joints
    truth = windows.root, bends
    still = torch.zeros_like(windows.contacts)
    same = all_losses(kinematics, 1.0, (rows, rows), (truth, truth), still, feet, free, Weights())
    assert sum(same.values()) == pytest.approx(0.0, abs=1e-6) and len(same) == 7
    stands = torch.ones_like(windows.contacts)
    slides = all_losses(kinematics, 1.0, (rows, rows), (truth, truth), stands, feet, free, Weights())
    assert slides["foot"] > 0.001 and slides["way"] > 0.001


def test_the_range_holds_nearly_all_offsets(corpus_cache: Path):
    limits = offset_range(Corpus(corpus_cache, "train"), frames=20)
    assert (limits.low < limits.high).all() and float(limits.low[0]) == -float(limits.high[0])
