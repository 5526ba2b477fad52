"""`vermo ablate`: what it trains, that it goes on after a stop, its tables, and the tokenizer with a codebook."""

import json
import os
import signal
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.cli.options import STOPPED
from troupe_training.evaluate.vermo.study import Trained, rows_of, said_side, stages_table
from troupe_training.models.vermo.config import PRESETS
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.trainer import Trainer
from troupe_training.train.vermo.language import INSTRUCT, PRETRAIN, SPECIALIST
from troupe_training.train.vermo.study import Part, Terms, planned

TINY = ["--vermo-preset", "tiny", "--steps", "10", "--per-step", "256", "--frames-per-step", "256", "--seeds", "1", "2"]
FEW = ["--parts", "train", "--max-windows", "2", "--samples", "1", "--flow-steps", "1", "--threads", "1"]


def ablate(run: Path, cache: Path, folder: Path, *more: str) -> int:
    argv = ["vermo", "ablate", "--tokenizer-run", str(run), "--cache", str(cache), "--run", str(folder)]
    return main([*argv, *TINY, *FEW, *more])


def test_every_training_from_random_weights_gets_the_same_updates():
    terms = Terms(Path(), Path(), "tiny", None, 100, 1e-3, 8e-4, 256, 512, 1.0)
    runs = {run.name: run for run in planned([7, 8])}
    updates = {
        (run.name, part.stage, part.task): terms.job(Path(), run.seed, part).budget.steps
        for run in runs.values()
        for part in run.parts
    }
    for name in ("stages-7", "stages-8"):
        assert updates[name, PRETRAIN, None] + updates[name, INSTRUCT, None] == 100
    for key in (("one-stage", INSTRUCT, None), ("text_to_motion-alone", SPECIALIST, "text_to_motion")):
        assert updates[key] == 100
    assert updates["stages-7", SPECIALIST, "motion_to_text"] == 20
    assert ("stages-8", SPECIALIST, "motion_to_text") not in updates
    assert updates["fsq", "tokenizer", None] == updates["vq", "tokenizer", None] == 120
    assert [run.seed for run in runs.values()] == [7, 8, 7, 7, 7, 7, 7]
    special = terms.job(Path(), 7, Part(SPECIALIST, 0.2, "motion_to_text"))
    assert special.budget.learning_rate == pytest.approx(3e-4) and special.frames_per_step == 256
    tokenizer = terms.job(Path(), 7, Part("tokenizer", 1.2, quantizer="vq"))
    assert tokenizer.budget.learning_rate == 8e-4 and tokenizer.frames_per_step == 512


def test_a_stopped_study_goes_on_and_ends_in_tables(
    vermo_run: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    update = Trainer._update

    def stopped(self: Trainer, *args: object) -> dict[str, float]:
        if self.run.name == "one-stage" and self.step == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return update(self, *args)

    monkeypatch.setattr(Trainer, "_update", stopped)
    assert ablate(vermo_run, cache, tmp_path) == STOPPED
    monkeypatch.undo()
    assert read_checkpoint(tmp_path / "one-stage" / "language-instruct.pt")["step"] == 4
    assert not (tmp_path / "text_to_motion-alone").exists() and not (tmp_path / "figures.md").exists()
    first = (tmp_path / "stages-1" / "language-instruct.pt").stat().st_mtime_ns

    with pytest.raises(SystemExit, match="the cache has 0 clips of the part 'cell'"):
        ablate(vermo_run, cache, tmp_path, "--measure-only", "--parts", "cell")
    assert ablate(vermo_run, cache, tmp_path, "--measure-only", "--only", "stages-2", "one-stage") == 0
    models = json.loads((tmp_path / "figures.json").read_text())["models"]
    assert list(models) == ["stages-2/language-pretrain", "stages-2/language-instruct"]
    capsys.readouterr()
    assert ablate(vermo_run, cache, tmp_path) == 0
    printed = capsys.readouterr().out
    assert "stages-1 (1 of 7): language-instruct: done before" in printed and "going on from step 4" in printed
    assert (tmp_path / "stages-1" / "language-instruct.pt").stat().st_mtime_ns == first

    report = json.loads((tmp_path / "figures.json").read_text())
    assert report["models"]["stages-1/language-specialist-motion_to_text"]["updates"] == 12
    assert report["models"]["one-stage/language-instruct"]["updates"] == 10
    stages = report["stages"]["train"]
    assert "said_content" not in stages["text_to_motion-alone/language-specialist-text_to_motion"]
    assert stages["captured"]["fid"] == pytest.approx(0.0, abs=1e-6)
    assert {"mpjpe", "fid"} <= set(report["decoders"]["train"]["flow of 1 steps"])
    assert set(report["tokenizers"]["train"]) == set(report["codes"]) == {"fsq", "vq"}
    assert report["codes"]["vq"]["count"] == report["codes"]["fsq"]["count"] == 4375
    text = (tmp_path / "figures.md").read_text()
    assert "| + instruction | 2 | 10 |" in text and "| single task | 1 | 10 |" in text and "| vq, train |" in text
    with pytest.raises(SystemExit, match="was begun with steps 10"):
        ablate(vermo_run, cache, tmp_path, "--steps", "20")
    with pytest.raises(SystemExit, match="no run nothing; there are stages-1"):
        ablate(vermo_run, cache, tmp_path, "--only", "nothing")


def test_one_stage_begins_with_random_weights_and_instruction_with_the_pretrained_ones(
    vermo_run: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    begun: dict[str, torch.Tensor] = {}
    update = Trainer._update

    def noted(self: Trainer, *args: object) -> dict[str, float]:
        if self.stage.startswith("language"):
            begun.setdefault(f"{self.run.name}/{self.stage}", self.model.own.detach().clone())
        return update(self, *args)

    monkeypatch.setattr(Trainer, "_update", noted)
    assert ablate(vermo_run, cache, tmp_path, "--only", "stages-1", "one-stage") == 0
    pretrained = read_checkpoint(tmp_path / "stages-1" / "language-pretrain-best.pt")["average"]["own"]
    assert torch.equal(begun["stages-1/language-instruct"], pretrained)
    assert torch.equal(begun["one-stage/language-instruct"], begun["stages-1/language-pretrain"])  # of the same seed


def test_a_run_without_a_tokenizer_is_refused(cache: Path, tmp_path: Path):
    with pytest.raises(SystemExit, match=r"has no tokenizer.pt, judge.pt, captions.json, pieces.json, words.txt"):
        ablate(tmp_path / "none", cache, tmp_path / "study", "--only", "one-stage")


def test_seeds_are_one_row_and_specialists_of_two_tasks_share_one():
    general, special = Part(INSTRUCT, 0.8), [Part(SPECIALIST, 0.2, t) for t in ("text_to_motion", "motion_to_text")]
    trained = [Trained("stages-1", general, 10, 10, 1), Trained("stages-2", general, 10, 8, 2)]
    trained += [Trained("stages-1", part, 12, 2, 1) for part in special]
    figures = {
        "captured": {"fid": 0.0},
        "stages-1/language-instruct": {"fid": 0.1, "said_style": 0.5},
        "stages-2/language-instruct": {"fid": 0.3, "said_style": 0.5},
        "stages-1/language-specialist-text_to_motion": {"fid": 0.25},
        "stages-1/language-specialist-motion_to_text": {"said_style": 0.75},
    }
    rows = rows_of(figures, trained)
    assert rows["+ instruction"]["fid"] == {"mean": pytest.approx(0.2), "low": 0.1, "high": 0.3}
    assert {key: f["mean"] for key, f in rows["+ specialist"].items()} == {"fid": 0.25, "said_style": 0.75}
    table = stages_table(figures, trained).splitlines()
    assert table[2].startswith("| captured |  |  | –")
    assert table[3].startswith("| + instruction | 2 | 10 |") and "| 0.200 (0.100–0.300) |" in table[3]
    assert table[4].startswith("| + specialist | 1 | 12 |") and "| 75.0 |" in table[4]


def test_a_side_counts_where_the_content_has_one():
    contents = ["wave-left-hand", "walk-turn-right", "raise-up-both-hands", "run"]
    texts = ["a person waves the left hand", "a person turns left while walking", "a person lifts the right hand", ""]
    assert said_side(texts, contents) == {"said_side": 0.5}
    assert said_side(["a person waves left and right"], ["wave-left-hand"]) == {"said_side": 0.0}
    assert said_side(["a person runs"], ["run"]) == {}


def train_codebook(cache: Path, run: Path, *more: str, stage: str = "tokenizer") -> int:
    size = ["--vermo-preset", "tiny", "--steps", "4", "--per-step", "256", "--threads", "1"]
    return main(["vermo", "train", stage, "--cache", str(cache), "--run", str(run), *size, *more])


def test_only_the_tokenizer_works_with_a_codebook(cache: Path, vermo_run: Path, tmp_path: Path):
    assert train_codebook(cache, tmp_path, "--quantizer", "vq") == 0
    state = read_checkpoint(tmp_path / "tokenizer.pt")
    dims = PRESETS["tiny"].tokenizer.book_dim
    assert state["average"]["quantizer.book"].shape == (1, 4375, dims)
    for name in ("captions.json", "pieces.json", "words.txt"):
        (tmp_path / name).write_bytes((vermo_run / name).read_bytes())
    for stage in ("refine", "flow", "pretrain"):
        with pytest.raises(SystemExit, match="has a codebook"):
            train_codebook(cache, tmp_path, stage=stage)
    (tmp_path / "language-pretrain.pt").write_bytes((vermo_run / "language-pretrain.pt").read_bytes())
    with pytest.raises(SystemExit, match="has a codebook"):
        main(["vermo", "export", "--run", str(tmp_path), "--cache", str(cache), "--out", str(tmp_path / "pack")])
    with pytest.raises(SystemExit, match="was begun with --quantizer vq"):
        train_codebook(cache, tmp_path, "--quantizer", "fsq")
    with pytest.raises(SystemExit, match="--quantizer is for the stage tokenizer"):
        train_codebook(cache, tmp_path, "--quantizer", "vq", stage="pretrain")
