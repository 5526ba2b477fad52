"""`unimogen ablate`: what it trains, that it goes on after a stop, and its table."""

import json
import os
import signal
from pathlib import Path

import pytest

from troupe_training.cli.main import main
from troupe_training.cli.options import STOPPED
from troupe_training.data.bodies_store import Corpus
from troupe_training.evaluate.unimogen.study import donors_of, study_table, with_seeds_as_one
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.trainer import Budget, Trainer
from troupe_training.train.unimogen.ablations import ABLATIONS
from troupe_training.train.unimogen.study import done, planned

TINY = ["--unimogen-preset", "tiny", "--rows-per-step", "1000", "--steps", "3", "--seeds", "1", "2"]
FEW = ["--frames", "20", "--max-windows", "2", "--sampler-steps", "1", "--threads", "1"]


def ablate(cache: Path, folder: Path, *more: str) -> int:
    argv = ["unimogen", "ablate", "--cache", str(cache), "--run", str(folder), *TINY, *FEW]
    return main([*argv, "--alone", "toy", "--unseen", "toy", *more])


def test_a_study_has_seeds_single_and_unseen_bodies_and_every_ablation():
    runs = {run.name: run for run in planned(["a", "b", "c"], [7, 8], ["b"], ["c"])}
    assert list(runs)[:4] == ["whole-7", "whole-8", "unseen-c", "b-alone"]
    assert {name for name in runs if name.startswith("without-")} == {f"without-{part}" for part in ABLATIONS}
    assert runs["unseen-c"].bodies == ("a", "b") and runs["unseen-c"].shown_on("c") and runs["unseen-c"].seed == 7
    assert runs["b-alone"].shown_on("b") and not runs["b-alone"].shown_on("a")
    with pytest.raises(SystemExit, match="no body d"):
        planned(["a"], [1], ["d"], [])


def test_a_stopped_study_goes_on_and_ends_in_a_table(
    corpus_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    budget, update = Budget(steps=3), Trainer._update

    def stopped(self: Trainer, *args: object) -> dict[str, float]:
        if self.run.name == "whole-2" and self.step == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return update(self, *args)

    monkeypatch.setattr(Trainer, "_update", stopped)
    assert ablate(corpus_cache, tmp_path) == STOPPED
    monkeypatch.undo()
    first = (tmp_path / "whole-1" / "unimogen.pt").stat().st_mtime_ns
    assert done(tmp_path / "whole-1", budget) and not done(tmp_path / "whole-2", budget)
    assert read_checkpoint(tmp_path / "whole-2" / "unimogen.pt")["step"] == 2
    assert not (tmp_path / "figures.md").exists()

    assert ablate(corpus_cache, tmp_path, "--measure-only") == 0
    assert list(json.loads((tmp_path / "figures.json").read_text())["runs"]) == ["whole-1"]
    capsys.readouterr()
    assert ablate(corpus_cache, tmp_path) == 0
    printed = capsys.readouterr().out
    assert "whole-1 (1 of 9): done before" in printed and "going on from step 2" in printed
    assert (tmp_path / "whole-1" / "unimogen.pt").stat().st_mtime_ns == first
    assert read_checkpoint(tmp_path / "unseen-toy" / "unimogen.pt")["meta"]["bodies"] == ["walker"]

    figures = json.loads((tmp_path / "figures.json").read_text())
    assert {run["step"] for run in figures["runs"].values()} == {3}
    toy = figures["figures"]["test"]["toy"]
    assert {"frozen pose", "interpolated", "whole-1", "whole-2", "toy-alone", "unseen-toy", "without-balance"} <= set(
        toy
    )
    assert toy["unseen-toy"]["l2p_m"] != toy["whole-1"]["l2p_m"]
    table = (tmp_path / "figures.md").read_text()
    assert table.count("whole, 2 seeds | 3 |") == len(figures["figures"]["test"])
    assert "| toy | unseen-toy | 3 |" in table and "no evaluator knows the skeleton of toy" in table
    with pytest.raises(SystemExit, match="was begun with steps 3"):
        ablate(corpus_cache, tmp_path, "--steps", "4")


def test_seeds_of_the_whole_method_are_one_row_with_their_range():
    methods = {
        name: {"l2p_m": value, "windows": 5.0}
        for name, value in (("whole-1", 0.1), ("whole-2", 0.3), ("g1-alone", 0.5))
    }
    assert with_seeds_as_one(methods)["whole, 2 seeds"]["l2p_m"] == {
        "mean": pytest.approx(0.2),
        "low": 0.1,
        "high": 0.3,
    }
    text = study_table({"g1": methods}, {"g1": "no"}, {"whole-1": 9, "whole-2": 8, "g1-alone": 7})
    assert (
        "| g1 | whole, 2 seeds | 8 | 0.200 (0.100–0.300) | 5 |" in text and "| g1 | g1-alone | 7 | 0.500 | 5 |" in text
    )


def test_donors_are_bodies_of_the_same_takes(corpus_cache: Path):
    corpus = Corpus(corpus_cache, "train")
    toy, walker = corpus.stores["toy"], corpus.stores["walker"]
    assert donors_of(toy, corpus) == {}
    walker.clips[0]["take"] = toy.clips[0]["take"]
    assert list(donors_of(toy, corpus)) == ["walker"]
