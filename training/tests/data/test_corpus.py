import json
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.bodies_store import SPEED_EDGES, Corpus
from troupe_training.data.corpus import words_of
from troupe_training.data.rotations import wrap_angle


@pytest.mark.parametrize(
    ("clip", "words"),
    [
        ("dataset-2_walk-turn-left_active_041.bvh", ["walk-turn-left", "active"]),
        ("dataset-1_run_masculinity_001.bvh", ["run", "masculine"]),
        ("fallAndGetUp2_subject3_part4.csv", ["fall-and-get-up"]),
        ("Walk RM", ["walk-rm"]),
        ("lay_to_idle", ["lay-to-idle"]),
    ],
)
def test_names_tell_what_a_clip_shows(clip: str, words: list[str]):
    assert words_of(clip) == words


def test_every_clip_is_in_and_comes_back_within_a_millimetre(corpus_cache: Path):
    for name, clips in (("walker", 30), ("toy", 16)):
        index = json.loads((corpus_cache / name / "clips.json").read_text())
        assert len(index["clips"]) == clips
        assert index["round_trip_m"] < 1e-3
    assert list(json.loads((corpus_cache / "walker" / "clips.json").read_text())["dropped"]) == ["broken.bvh"]
    assert "broken.bvh" in (corpus_cache / "report.md").read_text()


def test_a_cached_body_is_not_made_again(bvh_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    argv = [
        "unimogen",
        "prepare",
        "--source",
        str(bvh_folder),
        "--name",
        "own",
        "--cache",
        str(tmp_path),
        "--workers",
        "1",
    ]
    assert main(argv) == 0
    assert "own: up axis: y (30); from feet to head" in capsys.readouterr().out
    assert json.loads((tmp_path / "own" / "clips.json").read_text())["understood"][0][:2] == ["format", "bvh (30)"]
    before = (tmp_path / "own" / "bends.npy").stat().st_mtime_ns
    assert main(argv) == 0
    assert "own: cached" in capsys.readouterr().out
    assert (tmp_path / "own" / "bends.npy").stat().st_mtime_ns == before
    assert main([*argv, "--test-name", "walk_0"]) == 0
    assert (tmp_path / "own" / "bends.npy").stat().st_mtime_ns != before


def test_windows_are_drawn_from_the_split_and_body(corpus_cache: Path):
    corpus = Corpus(corpus_cache, "train", mirror=True)
    assert corpus.names == ["toy", "walker"]
    generator = torch.Generator().manual_seed(0)
    windows = corpus.stores["toy"].draw(6, 36, generator)
    assert windows.bends.shape == (6, 36, 14, 6)
    assert (windows.words.sum(1) == 1).all()
    drawn = {corpus.draw_body(36, generator) for _ in range(30)}
    assert drawn == {"toy", "walker"}
    tested = Corpus(corpus_cache, "test", words=corpus.words)
    assert {c["name"][:6] for c in tested.stores["toy"].clips} <= {f"walk{i:02}" for i in range(0, 16, 4)}


def test_headings_are_those_of_the_walks(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    starts, owners = store.every(40, 1000)
    windows = store.windows(starts, 40, owners)
    ahead = windows.root[:, -1] - windows.root[:, 0]
    off = wrap_angle(windows.heading[:, 0] - torch.atan2(ahead[:, 0], ahead[:, 2]))
    assert float(off.abs().max()) < 0.05


def test_folders_without_motion_are_refused(tmp_path: Path):
    (tmp_path / "walk.csv").write_text("")
    with pytest.raises(SystemExit, match=r"\.csv files need their robot's --urdf"):
        main(["unimogen", "prepare", "--source", str(tmp_path)])


def test_speeds_are_drawn_more_evenly_than_by_their_length(corpus_cache: Path):
    drawn = {}
    for balance in (1.0, 0.0):
        store = Corpus(corpus_cache, "train", speed_balance=balance).stores["walker"]
        starts, _, shares = store._table(20)
        chance = torch.diff(shares, prepend=torch.zeros(1, dtype=torch.double))
        classes = torch.bucketize(store.speeds(starts, 20), torch.tensor(SPEED_EDGES))
        drawn[balance] = torch.zeros(len(SPEED_EDGES) + 1, dtype=torch.double).index_add_(0, classes, chance)
    seen = drawn[0.0] > 0
    assert (seen == (drawn[1.0] > 0)).all() and seen.sum() > 1
    torch.testing.assert_close(drawn[0.0][seen], torch.full_like(drawn[0.0][seen], 1 / int(seen.sum())))


def test_stretched_windows_move_as_much_faster(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    starts, owners, _ = store._table(40)
    starts, owners = starts[:1], owners[:1]
    plain = store.windows(starts, 40, owners)
    same = store.stretched(starts, 40, owners, torch.ones(1))
    torch.testing.assert_close(same.root, plain.root)
    torch.testing.assert_close(same.bends, plain.bends, atol=1e-4, rtol=0)
    slow = store.stretched(starts, 40, owners, torch.full((1,), 0.5))
    torch.testing.assert_close(slow.root[:, ::2], plain.root[:, :20])
    torch.testing.assert_close(slow.root[:, 1], (plain.root[:, 0] + plain.root[:, 1]) / 2)
    assert torch.equal(slow.contacts[:, ::2], plain.contacts[:, :20])


def test_paces_stay_within_the_clip(corpus_cache: Path):
    store = Corpus(corpus_cache, "train").stores["walker"]
    starts, owners, _ = store._table(20)
    pace = store._paces(starts, 20, owners, torch.Generator().manual_seed(0))
    ends = torch.tensor([store.clips[i]["start"] + store.clips[i]["frames"] for i in owners.tolist()])
    assert (starts + 19 * pace <= ends - 1 + 1e-3).all()
    assert float(pace.min()) >= 1 / 1.2 - 1e-6 and float(pace.max()) <= 1.2 + 1e-6 and len(pace.unique()) > 2
