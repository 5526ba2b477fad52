"""The card's tables from reports of `troupe-eval gaps`, with intervals and without."""

import pytest

from troupe_training.evaluate.card import METHODS, add_nearest, card_table, part_tables
from troupe_training.evaluate.nearest import NEAREST

PLAIN = ("l2p_m", "l2q", "npss", "foot_skate_m_per_frame", "contact_accuracy", "reaching_success")


SERVED = [method for method in METHODS if method != "nearest"]  # what a server's report has


def plain_gap() -> dict:
    return {"gap_frames": 30, "windows": 7} | {method: dict.fromkeys(PLAIN, 0.5) for method in SERVED}


def header(gap: dict) -> list[str]:
    return card_table(gap).splitlines()[0].strip("| ").split(" | ")[1:]


def rows(gap: dict) -> dict[str, list[str]]:
    lines = [line.strip("| ").split(" | ") for line in card_table(gap).splitlines()[2:]]
    return {cells[0]: cells[1:] for cells in lines}


def test_reports_without_intervals_give_means():
    found = rows(plain_gap())
    assert len(found) == len(PLAIN)
    assert found["target reached (%) ↑"] == ["50.0"] * 3


def test_reports_with_intervals_give_them_and_what_else_was_measured():
    fid = {"mean": 0.25, "low": 0.2, "high": 0.5}
    metrics = {
        "ground_truth": {"fid": fid, "reached": {"mean": 1.0, "low": 1.0, "high": 1.0}},
        "interpolation": {"joint_diversity_m": {"mean": 0.0, "low": None, "high": None}},
        "pack": {"fid": fid, "npss": {"mean": None, "low": None, "high": None}},
    }
    found = rows(plain_gap() | {"metrics": metrics})
    assert found["FID ↓"] == ["0.2500 (0.2000–0.5000)", "–", "0.2500 (0.2000–0.5000)"]
    assert found["joint diversity (mm)"] == ["–", "0.0", "–"]
    assert found["target reached (%) ↑"] == ["100.0", "50.0", "50.0"]
    assert found["NPSS ↓"] == ["0.5000", "0.5000", "–"]
    assert "MMD ↓" not in found


def test_old_reports_have_no_nearest_window():
    assert header(plain_gap()) == ["ground truth", "linear/slerp", "this pack"]


def test_the_nearest_window_comes_from_a_report_of_the_same_windows():
    figure = {"mean": 0.25, "low": 0.2, "high": 0.3}
    nearest = {"l2p_m": figure, "reached": figure, "nearer_than_pack": figure, "hinge_clamped_share": figure}
    other = {"gap_frames": 30, "windows": 7, "methods": {NEAREST: nearest}}
    baselines = {"stride_frames": 30, "evaluator": "a", "gaps": [{"gap_frames": 15}, other]}
    report = {"stride_frames": 30, "gaps": [plain_gap()]}
    add_nearest(report, baselines)
    assert header(report["gaps"][0]) == ["ground truth", "linear/slerp", NEAREST, "this pack"]
    found = rows(report["gaps"][0])
    assert found["target reached (%) ↑"] == ["50.0", "50.0", "25.0 (20.0–30.0)", "50.0"]
    assert found["windows with a lower L2P than the pack (%)"] == ["–", "–", "25.0 (20.0–30.0)", "–"]
    assert "angles at their limits (%) ↓" not in found
    with pytest.raises(ValueError, match="windows"):
        add_nearest({"stride_frames": 20, "gaps": [plain_gap()]}, baselines)
    with pytest.raises(ValueError, match="windows"):
        add_nearest({"stride_frames": 30, "gaps": [plain_gap() | {"windows": 8}]}, baselines)
    with pytest.raises(ValueError, match="evaluators"):
        add_nearest(report | {"evaluator": {"file": "evaluator.onnx", "sha256": "b"}}, baselines)
    with pytest.raises(ValueError, match="has no nearest"):
        add_nearest(report, baselines | {"gaps": [other | {"methods": {}}]})


def evaluated(source: str, l2p: float, windows: int = 70) -> dict:
    """A report of ``evaluate --by content`` with one part."""

    def block(gap: int | None, count: int) -> dict:
        methods = {
            name: {"l2p_m": {"mean": l2p}, "l2q": {"mean": 1.0}} for name in ("ground truth", "interpolation", "pack")
        }
        return {"gap_frames": gap, "windows": count, "methods": methods}

    parts = {"content": [{"name": "walk", "gaps": [block(15, windows), block(None, 2 * windows)]}]}
    return {"source": source, "stride_frames": 30, "uncut": True, "pinned": True, "evaluator": "a", "parts": parts}


def test_parts_have_a_table_of_all_gaps_beside_the_pack_before():
    heading, text = part_tables(evaluated("new", 0.25), evaluated("0.1.0", 0.5))
    assert heading == "#### Content `walk`, 140 windows of all gaps"
    head, _, *rows = text.splitlines()
    assert head == "| measure | ground truth | linear/slerp | this pack | 0.1.0 |"
    assert rows == ["| L2P (m) ↓ | 0.250 | 0.250 | 0.250 | 0.500 |"], "only what a part's table has"
    assert part_tables({"gaps": []}) == []


def test_parts_of_other_windows_are_not_put_beside():
    with pytest.raises(ValueError, match="walk: the windows"):
        part_tables(evaluated("new", 0.25), evaluated("0.1.0", 0.5, windows=71))
    with pytest.raises(ValueError, match="uncut is True in one report and False"):
        part_tables(evaluated("new", 0.25), evaluated("0.1.0", 0.5) | {"uncut": False})
    with pytest.raises(ValueError, match="walk: the windows"):
        part_tables(evaluated("new", 0.25), evaluated("0.1.0", 0.5) | {"parts": {}})
