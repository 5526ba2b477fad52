"""Tables of the parts of a split: which clip belongs where, and that parts' figures are those of their windows alone."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from troupe_training.data.motion import Motion
from troupe_training.data.store import PIECES, ClipEntry
from troupe_training.evaluate.bench import Bench, Options
from troupe_training.evaluate.parts import HELD_OUT, OTHER, masks, part_of, parts_markdown
from troupe_training.evaluate.report import measure_all


def clip(name: str, **more: bool) -> ClipEntry:
    return {"name": name, "start": 0, "frames": 90, "test": True} | more  # type: ignore[return-value]


def test_names_say_the_part(tmp_path: Path):
    walk, bow = clip("dataset-2_walk_old_003.bvh"), clip("dataset-1_bow_masculinity_001.bvh", held_out=True)
    assert [part_of("dataset", None)(c) for c in (walk, bow)] == ["dataset-2", "dataset-1"]
    assert [part_of("content", None)(c) for c in (walk, bow)] == ["walk", "bow"]
    assert part_of("style", None)(walk) == "old"
    assert part_of("style", None)(clip("run1_subject5.csv")) == OTHER
    assert [part_of("cell", None)(c) for c in (walk, bow)] == [OTHER, HELD_OUT]
    listed = tmp_path / "cells.txt"
    listed.write_text("# cells\nwalk_old\n")
    assert [part_of("cell", listed)(c) for c in (walk, bow)] == [HELD_OUT, OTHER]


def test_windows_go_to_the_part_of_their_clip():
    clips = [clip("dataset-1_bow_old_1.bvh"), clip("dataset-2_bow_old_1.bvh")]
    found = masks(part_of("dataset", None), clips, np.array([0, PIECES, 1, PIECES + 2]))
    assert {name: mask.tolist() for name, mask in found.items()} == {
        "dataset-1": [True, False, True, False],
        "dataset-2": [False, True, False, True],
    }


@pytest.fixture
def named(cache: Path, tmp_path: Path) -> Path:
    """The walks, of which every other clip is of the first data set."""
    folder = tmp_path / "cache"
    shutil.copytree(cache, folder)
    about = json.loads((folder / "clips.json").read_text())
    for nth, entry in enumerate(about["clips"]):
        entry["name"] = f"dataset-{1 + nth % 2}_walk_old_{nth:03}.bvh"
        entry["test"] = nth < 6
    (folder / "clips.json").write_text(json.dumps(about))
    return folder


def test_a_parts_figures_are_those_of_its_windows(named: Path):
    bench = Bench(named, Options([15, 26], diversity_seeds=2, diversity_windows=4, by=["dataset"]), None, 1)
    captured = {"pack": lambda segments, frames, sampling: Motion.of(segments)}
    report = measure_all(bench, captured, {"pack"})
    parts = report["parts"]["dataset"]
    assert [part["name"] for part in parts] == ["dataset-1", "dataset-2"]
    blocks = [*report["gaps"], report["all_gaps"]]
    for nth, block in enumerate(blocks):
        apart = [part["gaps"][nth] for part in parts]
        assert sum(a["windows"] for a in apart) == block["windows"]
        name, measure = "interpolation", "l2p_m"
        sums = [a["windows"] * a["methods"][name][measure]["mean"] for a in apart]
        assert sum(sums) / block["windows"] == pytest.approx(block["methods"][name][measure]["mean"])
        assert apart[0]["methods"][name][measure] != apart[1]["methods"][name][measure]
    assert [gap["gap_frames"] for gap in parts[0]["gaps"]] == [15, 26, None]
    text = "\n".join(parts_markdown(report))
    assert "### By dataset" in text and "| dataset-2 | all |" in text and "L2P (m) ↓" in text
