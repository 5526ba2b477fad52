"""The driver without its programs: results are kept, settings are tried once, counts are compared."""

from pathlib import Path

import pytest

from troupe_bench import instructions
from troupe_bench.__main__ import parse
from troupe_bench.settings import Settings, python_settings
from troupe_bench.store import Store, dig


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(results=tmp_path)


def test_results_outlive_the_process_and_medians_are_over_repeats(settings: Settings):
    store = Store(settings.results, "serving")
    for repeat, frames in enumerate((9_000.0, 26_000.0, 20_000.0)):
        store.add({"target": "raw", "batch": 16, "repeat": repeat}, {"frames_per_s": frames})
    store = Store(settings.results, "serving")
    assert store.median({"target": "raw", "batch": 16}, "frames_per_s") == 20_000.0
    assert len(store.of({"target": "raw"})) == 3
    assert store.median({"target": "absent"}, "frames_per_s") is None
    store.clear()
    assert Store(settings.results, "serving").data["runs"] == []


def test_results_of_another_pack_are_forgotten(settings: Settings):
    store = Store(settings.results, "live")
    assert not store.of_pack("human 1")
    store.add({"engine": "cpu"}, {})
    assert not Store(settings.results, "live").of_pack("human 1")
    assert Store(settings.results, "live").of_pack("human 2") and store.of({}) != Store(settings.results, "live").of({})


def test_more_instructions_than_allowed_are_reported(capsys: pytest.CaptureFixture):
    worse = instructions.compare({"a": 104, "b": 102, "new": 1}, {"a": 100, "b": 100, "old": 1}, 0.03)
    assert worse == ["a"]
    printed = capsys.readouterr().out
    assert "gone" in printed and "new" in printed


def test_every_setting_is_tried_once():
    for kind in ("litserve", "fastapi", "words"):
        tried = python_settings(kind, quick=False)
        assert all(tried.count(options) == 1 for options in tried) and len(tried) > 3


def test_an_unknown_part_is_refused():
    with pytest.raises(SystemExit):
        parse(["raw"])
    assert parse(["serving", "--quick"]).parts == ["serving"]


def test_digging_ends_where_nothing_is():
    assert dig({"a": {"b": 1}}, "a", "b") == 1
    assert dig({"a": 1}, "a", "b") is None and dig({}, "a") is None
