"""The driver without its programs: results are kept, tables come out of them, counts are compared."""

from pathlib import Path

import pytest

from troupe_bench import instructions
from troupe_bench.__main__ import parse
from troupe_bench.operators import kind_of
from troupe_bench.report import measured_apart, write_report
from troupe_bench.settings import JEMALLOC, Settings, python_settings
from troupe_bench.store import Store, dig


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(results=tmp_path)


def run(frames_per_s: float, p50: float, p99: float) -> dict:
    """What the load tester says of a run, as far as the tables read it."""
    return {
        "throughput": {"frames_per_s": frames_per_s},
        "latency_ms": {"p50": p50, "p99": p99},
        "client": {"cpus_busy": 0.1},
    }


def measured(settings: Settings) -> None:
    """Three repeats of the serving part."""
    store = Store(settings.results, "serving")
    for repeat, drift in enumerate((0.9, 1.0, 1.3)):
        raw = {"engine": "cpu", "target": "raw", "repeat": repeat}
        for batch, frames in ((1, 9_000.0), (16, 20_000.0)):
            result = {
                "frames_per_s": frames * drift,
                "call_ms_p50": 7.0,
                "call_ms_p99": 8.0,
                "lanes": {"count": 2, "threads": 1},
            }
            store.add(raw | {"batch": batch}, result)
        same = {"target": JEMALLOC, "batch": 64}
        store.add(raw | same, {"frames_per_s": 25_000.0 * drift, "call_ms_p50": 7.0, "call_ms_p99": 8.0})
        store.add(raw | {"alone": True}, {"frames_per_s": 10_000.0, "call_ms_p50": 6.0, "call_ms_p99": 7.0})
        for target, frames, p99 in (("troupe", 19_000.0, 120.0), ("litserve", 9_500.0, 240.0)):
            key = {"engine": "cpu", "target": target, "clients": 32, "repeat": repeat}
            store.add(key, run(frames * drift, 100.0, p99))
        store.add({"engine": "cpu", "target": "troupe", "clients": 1, "repeat": repeat}, run(9_000.0, 6.3, 7.5))


def test_results_outlive_the_process_and_medians_are_over_repeats(settings: Settings):
    measured(settings)
    store = Store(settings.results, "serving")
    assert store.median({"engine": "cpu", "target": "raw", "batch": 16}, "frames_per_s") == 20_000.0
    assert len(store.of({"target": "troupe"})) == 6
    assert store.median({"target": "nobody"}, "frames_per_s") is None
    store.clear()
    assert Store(settings.results, "serving").data["runs"] == []


def test_the_page_has_shares_of_operators_and_the_rate_of_products(settings: Settings, tmp_path: Path):
    ms = {kind_of(operator): ms for operator, ms in (("MatMul", 6.0), ("Softmax", 1.0), ("Gather", 1.0), ("Gelu", 2.0))}
    stages = {stage: {"ms": ms, "mflop": 1200.0} for stage in ("root", "pose", "decoder")}
    Store(settings.results, "operators").add({"engine": "cpu"}, {"batch": 16, "stages": stages})
    write_report(settings, page := tmp_path / "page.md")
    assert "| f32 (ONNX Runtime CPU) | pose | 10.0 | 60 % | 10 % | 10 % | 20 % | 200 |" in page.read_text()


def test_the_page_has_ratios_and_says_what_is_missing(settings: Settings, tmp_path: Path):
    measured(settings)
    page = tmp_path / "page.md"
    write_report(settings, page)
    text = page.read_text()
    assert "| **Troupe** | 32 clients | 19,000 | 95 % | 100.00 | 120.00 |" in text
    assert "frames/s at saturation, of the raw loop's best | 95 % | ≥ 90 %" in text
    assert "| raw loop (jemalloc) | batch 64 | 25,000 | 125 % | 7.00 | 8.00 |" in text
    assert "frames/s at saturation, of the raw loop's best with the server's allocator | 76 % |" in text
    assert "frames/s at saturation, of the raw loop's best, on what the load tester leaves | 100 % |" in text
    assert "p50 of one caller above raw batch 1 | 0.30 ms | ≤ 0.5 ms" in text
    assert "throughput at 32 clients against LitServe | 2.00 × | ≥ 3 ×" in text
    assert "p99 at 32 clients against LitServe | 0.50 × | ≤ 1 ×" in text
    assert "make bench PARTS=paper" in text


def test_the_page_says_by_itself_what_was_measured_at_another_time(settings: Settings, tmp_path: Path):
    measured(settings)
    store, page = Store(settings.results, "serving"), tmp_path / "page.md"
    began = 1_700_000_000  # 2023-11-14 22:13:20
    for turn, run in enumerate(store.data["runs"]):
        run["at"] = began + 19 * 60 * turn
    store.note("remark", "Its scheduler had changed.")
    write_report(settings, page)
    assert "Not measured in one go" not in page.read_text()

    for run in store.data["runs"]:
        run["at"] = began + (31 * 60 + 60 * run["key"]["repeat"] if run["key"]["target"] == "troupe" else 0)
    store.note("repeats", 3)
    write_report(settings, page)
    told = "raw loop, raw loop (jemalloc), LitServe 2023-11-14 22:13 to 22:13; Troupe 2023-11-14 22:44 to 22:46 (UTC)."
    assert page.read_text().count(told) == page.read_text().count("Its scheduler had changed.") == 1


def test_ratios_are_of_runs_of_one_turn(settings: Settings, tmp_path: Path):
    store = Store(settings.results, "serving")
    for repeat, (ours, theirs) in enumerate(((30.0, 10.0), (10.0, 10.0), (40.0, 20.0))):
        for target, frames in (("troupe", ours), ("litserve", theirs)):
            key = {"engine": "cpu", "target": target, "clients": 32, "repeat": repeat}
            store.add(key, run(frames, 100.0, 100.0))
    write_report(settings, page := tmp_path / "page.md")
    assert "throughput at 32 clients against LitServe | 2.00 × (1.00 to 3.00) | ≥ 3 × |" in page.read_text()


def test_what_was_measured_of_another_pack_is_forgotten(settings: Settings):
    store = Store(settings.results, "live")
    assert not store.of_pack("human 1")
    store.add({"engine": "cpu"}, {})
    assert not Store(settings.results, "live").of_pack("human 1")
    assert Store(settings.results, "live").of_pack("human 2") and store.of({}) != Store(settings.results, "live").of({})


def test_runs_without_names_are_counted_and_days_are_told(settings: Settings):
    store = Store(settings.results, "micro")
    for name, at in (("a", 1_700_000_000), ("b", 1_700_005_800), ("c", 1_700_006_700)):
        store.add({"bench": name}, {"median_ns": 1.0})
        store.data["runs"][-1]["at"] = at
    assert "1 run 2023-11-14 22:13 to 22:13; 2 runs 2023-11-14 23:50 to 2023-11-15 00:05" in measured_apart(store)


def test_more_instructions_than_allowed_are_told(capsys: pytest.CaptureFixture):
    worse = instructions.compare({"a": 104, "b": 102, "new": 1}, {"a": 100, "b": 100, "old": 1}, 0.03)
    assert worse == ["a"]
    printed = capsys.readouterr().out
    assert "gone" in printed and "new" in printed


def test_every_setting_is_tried_once():
    for kind in ("litserve", "fastapi"):
        tried = python_settings(kind, quick=False)
        assert all(tried.count(options) == 1 for options in tried) and len(tried) > 3


def test_an_unknown_part_is_refused():
    with pytest.raises(SystemExit):
        parse(["raw"])
    assert parse(["serving", "--quick"]).parts == ["serving"]


def test_digging_ends_where_nothing_is():
    assert dig({"a": {"b": 1}}, "a", "b") == 1
    assert dig({"a": 1}, "a", "b") is None and dig({}, "a") is None


def test_every_live_run_has_a_row_and_overload_its_extremes(settings: Settings, tmp_path: Path):
    live = Store(settings.results, "live")
    for repeat, underruns in enumerate((0, 7)):
        figures = {"plans": {"underruns": underruns}, "missing_frames": 0, "slowed_frames": 2, "late_ticks": 1}
        key = {"engine": "cpu", "characters": 400, "repeat": repeat}
        result = {"live": figures | {"plans_per_s_and_character": 2.4}, "latency_ms": {"p50": 4.0, "p99": 9.5}}
        live.add(key, result | {"server": {"rss_peak_bytes": 512 * 2**20}})
    overload = Store(settings.results, "overload")
    for repeat, ratio in enumerate((1.5, 1.9, 1.7)):
        overload.add({"engine": "cpu", "repeat": repeat}, {"p99_ratio": ratio, "memory": {"grown": 3 * 2**20}})
    page = tmp_path / "page.md"
    write_report(settings, page)
    text = page.read_text()
    assert "| f32 (ONNX Runtime CPU) | 400 | 7 | 0 | 2 | 1 | 2.40 | 4.0 | 9.5 | 512 |" in text
    assert "3 runs:" in text
    assert "| the second over the first | 1.50 | 1.70 | 1.90 |" in text
    assert "| memory at its most over that at the beginning, MiB | 3.0 | 3.0 | 3.0 |" in text
    assert "failed |" not in text, "what no run has is left out"
