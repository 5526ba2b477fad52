import re
from pathlib import Path

import pytest

from conftest import write_walk
from troupe_training.data.cells import cell_of, choose_cells, mirrored_cell, read_cells
from troupe_training.data.prepare import Choice, prepare
from troupe_training.data.store import ClipStore

SPLITS = Path(__file__).parents[2] / "splits"
CONTENTS = [
    *(f"raise-up-{which}" for which in ("both-hands", "left-hand", "right-hand")),
    *("run", "walk", "walk-turn-left", "walk-turn-right"),
    *(f"wave-{which}" for which in ("both-hands", "left-hand", "right-hand")),
]
STYLES = ["active", "elderly", "exhausted", "feminine", "masculine", "normal", "youthful"]


def test_the_committed_list_is_what_the_rule_chooses():
    clips = [f"dataset-2_{content}_{style}_001.bvh" for content in CONTENTS for style in STYLES]
    clips.append("dataset-1_bow_proud_001.bvh")
    assert read_cells(SPLITS / "bandai-namco-cells.txt") == set(choose_cells(clips))


def test_every_style_is_held_out_once_and_every_content_stays():
    cells = [cell.rsplit("_", 1) for cell in read_cells(SPLITS / "bandai-namco-cells.txt")]
    assert sorted(style for _, style in cells) == STYLES
    contents = [content for content, _ in cells]
    assert len(set(contents)) == 7 and set(contents) <= set(CONTENTS)


@pytest.mark.parametrize(
    ("clip", "cell"),
    [
        ("dataset-2_walk-turn-left_active_041.bvh", "walk-turn-left_active"),
        ("dataset-1_run_masculinity_001.bvh", "run_masculine"),
        ("dataset-2_run_masculine_042_M.bvh", "run_masculine"),
        ("walk1_subject5.csv", None),
    ],
)
def test_cells_are_read_from_names(clip: str, cell: str | None):
    assert cell_of(clip) == cell


def test_mirrored_cells_swap_sides():
    assert mirrored_cell("walk-turn-left_active") == "walk-turn-right_active"
    assert mirrored_cell("raise-up-right-hand_elderly") == "raise-up-left-hand_elderly"
    assert mirrored_cell("run_masculine") == "run_masculine"
    assert not re.search("left", mirrored_cell("wave-left-hand_feminine"))


def test_prepare_holds_cells_out_of_training(tmp_path: Path):
    for i, cell in enumerate(["run_old", "run_happy", "walk_old", "walk_happy"]):
        write_walk(tmp_path / f"dataset-2_{cell}_00{i}.bvh", 40, 1.0, 0.0, 1.0)
    prepare(tmp_path, tmp_path / "cache", choice=Choice(test_name="run_happy", cells=["walk_old", "run_happy"]))
    names = {
        split: [c["name"] for c in ClipStore(tmp_path / "cache", split).clips] for split in ("train", "test", "cell")
    }
    assert names["train"] == ["dataset-2_run_old_000.bvh", "dataset-2_walk_happy_003.bvh"]
    assert names["test"] == ["dataset-2_run_happy_001.bvh"]
    assert names["cell"] == ["dataset-2_run_happy_001.bvh", "dataset-2_walk_old_002.bvh"]
