"""Tables of the parts of a split: which clip belongs where, and that parts' figures are those of their windows alone."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from troupe_training.data.motion import Motion
from troupe_training.data.store import PIECES, ClipEntry, ClipStore, joined
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
    lafan1 = ("run1_subject5.csv", "run1_subject5_part2.csv", "fallAndGetUp3_subject1_M.csv", "fight1.csv")
    assert [part_of("content", None)(clip(name)) for name in lafan1] == ["run", "run", "fallAndGetUp", OTHER]
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


def test_whole_files_have_windows_over_cuts(cache: Path, tmp_path: Path):
    folder = tmp_path / "cache"
    shutil.copytree(cache, folder)
    about = json.loads((folder / "clips.json").read_text())
    first = next(c for c in about["clips"] if c["test"])
    # The file's first 25 frames, the rest, and a mirrored part, which is of no file.
    cut = [
        first | {"name": "a_part1.bvh", "file": "a.bvh", "first_frame": 0, "mirrored": False, "frames": 25},
        first
        | {"name": "a_part2.bvh", "file": "a.bvh", "first_frame": 25, "mirrored": False, "frames": first["frames"] - 25}
        | {"start": first["start"] + 25},
        first | {"name": "a_M.bvh", "file": "a.bvh", "first_frame": 0, "mirrored": True},
    ]
    (folder / "clips.json").write_text(json.dumps(about | {"clips": cut}))
    store = ClipStore(folder, "test")
    whole = store.uncut()
    assert [(c["name"], c["frames"]) for c in whole.clips] == [("a.bvh", first["frames"]), ("a_M.bvh", first["frames"])]
    starts = [s.windows(20, 10)[0] - first["start"] for s in (store, whole)]
    assert starts[0][:3].tolist() == [0, 25, 35] and starts[1][:3].tolist() == [0, 10, 20]
    assert whole.of_split("test").clips == cut, "the cache itself is as it was"
    gap = joined([cut[0], cut[1] | {"first_frame": 26}])
    assert len(gap) == 2, "a frame was left out between them"


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
