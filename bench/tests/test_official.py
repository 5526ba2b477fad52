"""The table of the public code beside Troupe: medians and ratios of turns, the fastest way of the public code."""

from pathlib import Path

import pytest

from troupe_bench import official
from troupe_bench.programs import Failed
from troupe_bench.settings import Settings
from troupe_bench.store import Store


def test_the_fastest_way_of_the_public_code_counts_and_turns_stay_together(tmp_path: Path) -> None:
    store = Store(tmp_path, "official")
    for repeat, slow in enumerate((1, 2)):
        store.add({"target": "public", "way": "alone", "repeat": repeat}, {"p50_ms": 100 * slow, "frames_per_s": 400})
        store.add({"target": "public", "way": "processes", "repeat": repeat}, {"p50_ms": 150, "frames_per_s": 500})
        store.add({"target": "troupe", "way": "alone", "repeat": repeat}, {"p50_ms": 50, "frames_per_s": 700})
        store.add({"target": "troupe", "way": "saturated", "repeat": repeat}, {"p50_ms": 900, "frames_per_s": 1000})
    store.add({"target": "public", "way": "alone", "repeat": 2}, {"p50_ms": 1, "frames_per_s": 1})
    assert official.table(store)[2:] == [
        "| alone | 150 ms | 50 ms | 2.0, 4.0 |",
        "| as many as it can | 500 frames/s | 1,000 frames/s | 2.0, 2.0 |",
    ]


def test_a_folder_that_is_no_checkout_is_refused_with_what_is_expected(tmp_path: Path) -> None:
    settings = Settings()
    with pytest.raises(Failed, match="--official names a checkout"):
        official.checkout_of(settings)
    settings.official = tmp_path
    with pytest.raises(Failed, match="a checkout is expected"):
        official.checkout_of(settings)
    (tmp_path / "motionbricks" / "out" / "motionbricks_pose").mkdir(parents=True)
    assert official.checkout_of(settings) == tmp_path / "motionbricks"
