"""The card's tables from reports of `troupe eval`, with intervals and without."""

from troupe_training.evaluate.card import METHODS, card_table

PLAIN = ("l2p_m", "l2q", "npss", "foot_skate_m_per_frame", "contact_accuracy", "reaching_success")


def plain_gap() -> dict:
    return {"gap_frames": 30, "windows": 7} | {method: dict.fromkeys(PLAIN, 0.5) for method in METHODS}


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
