"""The page of figures: one table for each question, with all machines in it."""

import json
from pathlib import Path

import pytest

from troupe_bench import figures
from troupe_bench.figures import FOLDER, digest, machines, name_of, sittings_note
from troupe_bench.machine import ROOT
from troupe_bench.operators import kind_of
from troupe_bench.report import SECTIONS, page, write_report
from troupe_bench.settings import JEMALLOC, Settings
from troupe_bench.store import Store


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(results=tmp_path / "results")


def run(frames_per_s: float, p50: float, p99: float) -> dict:
    """The load tester's report of a run, as far as the tables read it."""
    return {
        "throughput": {"frames_per_s": frames_per_s},
        "latency_ms": {"p50": p50, "p99": p99},
        "client": {"cpus_busy": 0.1},
    }


def measure(settings: Settings) -> None:
    """Three repeats of the serving part."""
    store = Store(settings.results, "serving")
    for repeat, drift in enumerate((0.9, 1.0, 1.3)):
        raw = {"engine": "cpu", "target": "raw", "repeat": repeat}
        for batch, frames in ((1, 9_000.0), (16, 20_000.0)):
            result = {
                "frames_per_s": frames * drift,
                "call_ms_p50": 7.0,
                "call_ms_p99": 8.0,
                "workers": {"count": 2, "threads": 1},
            }
            store.add(raw | {"batch": batch}, result)
        same = {"target": JEMALLOC, "batch": 64}
        store.add(raw | same, {"frames_per_s": 25_000.0 * drift, "call_ms_p50": 7.0, "call_ms_p99": 8.0})
        store.add(raw | {"alone": True}, {"frames_per_s": 10_000.0, "call_ms_p50": 6.0, "call_ms_p99": 7.0})
        for target, frames, p99 in (("troupe", 19_000.0, 120.0), ("litserve", 9_500.0, 240.0)):
            key = {"engine": "cpu", "target": target, "clients": 32, "repeat": repeat}
            store.add(key, run(frames * drift, 100.0, p99))
        store.add({"engine": "cpu", "target": "troupe", "clients": 1, "repeat": repeat}, run(9_000.0, 6.3, 7.5))


def written(settings: Settings, tmp_path: Path) -> str:
    """The page of a machine called box."""
    write_report(settings, out := tmp_path / "page.md", "box", tmp_path / "figures")
    return out.read_text()


def test_the_page_in_docs_is_what_the_figures_say():
    assert (ROOT / "docs" / "benchmarks.md").read_text() == page(machines(FOLDER)), (
        "`make bench PARTS=report` writes it"
    )


def test_a_part_that_no_machine_has_names_its_command(settings: Settings, tmp_path: Path):
    tried = {"engine": "cpu", "target": "fastapi", "options": {"workers": 2}}
    Store(settings.results, "tune").add(tried, run(1000.0, 20.0, 30.0))
    text = written(settings, tmp_path)
    assert all(f"## {title}\n\nNot measured yet: `make bench PARTS={part}`" in text for title, part, *_ in SECTIONS)
    assert "| FastAPI | workers 2 | 1,000 |" in text


def test_the_page_has_throughput_latency_and_ratios(settings: Settings, tmp_path: Path):
    measure(settings)
    text = written(settings, tmp_path)
    for row in (
        "| **Troupe** | 32 clients | 19,000 |",
        "| **Troupe** | 32 clients | 100.00 / 120.00 |",
        "| raw loop, jemalloc | batch 64 | 25,000 |",
        "| raw loop | one worker, batch 1 | 6.00 / 7.00 |",
        "| frames/s at saturation, share of the raw loop's best | ≥ 90 % | 95 % |",
        "| the same, of the raw loop with jemalloc | – | 76 % |",
        "| the same, without the processor time of the load tester | – | 100 % |",
        "| p50 of one client, above one call of the networks | ≤ 0.5 ms | 0.30 ms |",
        "| frames/s at 32 clients ÷ LitServe's | ≥ 3 × | 2.00 × |",
        "| p99 at 32 clients ÷ LitServe's | ≤ 1 × | 0.50 × |",
    ):
        assert row in text
    assert "raw loop | batch 16 | 7.00" not in text, "no client waits for a latency of a large batch"


def test_a_ratio_is_of_runs_of_one_turn(settings: Settings, tmp_path: Path):
    store = Store(settings.results, "serving")
    for repeat, (ours, theirs) in enumerate(((30.0, 10.0), (10.0, 10.0), (40.0, 20.0))):
        for target, frames in (("troupe", ours), ("litserve", theirs)):
            key = {"engine": "cpu", "target": target, "clients": 32, "repeat": repeat}
            store.add(key, run(frames, 100.0, 100.0))
    text = written(settings, tmp_path)
    assert "| frames/s at 32 clients ÷ LitServe's | ≥ 3 × | 2.00 × (1.00 to 3.00) |" in text


def test_machines_are_columns_of_one_table(settings: Settings, tmp_path: Path):
    measure(settings)
    written(settings, tmp_path)
    other = tmp_path / "figures" / "aaa.json"
    kept = json.loads((tmp_path / "figures" / "box.json").read_text())
    rows = [row for row in kept["parts"]["serving"]["rows"] if row["target"] != "litserve"]
    other.write_text(json.dumps(kept | {"title": "AAA", "parts": {"serving": {"rows": rows}}}))
    text = written(settings, tmp_path)
    assert "| target | load | f32, AAA | f32, box |" in text
    assert "| **Troupe** | 32 clients | 19,000 | 19,000 |" in text
    assert "| LitServe | 32 clients | – | 9,500 |" in text


def test_what_was_not_measured_again_keeps_its_figures_and_says_so(settings: Settings, tmp_path: Path):
    measure(settings)
    Store(settings.results, "machine").note("machine", {"cpu": "A CPU", "commit": "1111111", "changed": False})
    written(settings, tmp_path)
    again = Settings(results=tmp_path / "again")
    Store(again.results, "machine").note("machine", {"cpu": "A CPU", "commit": "2222222", "changed": True})
    Store(again.results, "micro").add({"bench": "a bench"}, {"median_ns": 1500.0})
    text = written(again, tmp_path)
    assert "| **Troupe** | 32 clients | 19,000 |" in text
    assert "| `a bench` | 1.50 µs |" in text and "- box: measured with 2222222 with local changes on 20" in text


def test_a_quick_look_keeps_nothing(settings: Settings, tmp_path: Path):
    measure(settings)
    settings.quick = True
    assert "Not the real figures" in written(settings, tmp_path)
    assert not (tmp_path / "figures").exists()


def test_the_page_says_what_was_measured_in_another_sitting(settings: Settings, tmp_path: Path):
    measure(settings)
    store = Store(settings.results, "serving")
    began = 1_700_000_000  # 2023-11-14 22:13:20
    for turn, each in enumerate(store.data["runs"]):
        each["at"] = began + 19 * 60 * turn
    store.note("remark", "its scheduler had changed")
    assert "sittings" not in written(settings, tmp_path)

    for each in store.data["runs"]:
        each["at"] = began + (31 * 60 + 60 * each["key"]["repeat"] if each["key"]["target"] == "troupe" else 0)
    store.note("repeats", 3)
    text = written(settings, tmp_path)
    sitting = "raw, raw-jemalloc, litserve 2023-11-14 22:13 to 22:13; troupe 2023-11-14 22:44 to 22:46 (UTC)."
    assert text.count(sitting) == text.count("- box: its scheduler had changed.") == 1


def test_runs_without_names_are_counted_and_days_are_given(settings: Settings):
    store = Store(settings.results, "micro")
    for name, at in (("a", 1_700_000_000), ("b", 1_700_005_800), ("c", 1_700_006_700)):
        store.add({"bench": name}, {"median_ns": 1.0})
        store.data["runs"][-1]["at"] = at
    assert "1 run 2023-11-14 22:13 to 22:13; 2 runs 2023-11-14 23:50 to 2023-11-15 00:05" in sittings_note(store)


def test_the_page_has_shares_of_operators_and_the_rate_of_products(settings: Settings, tmp_path: Path):
    ms = {kind_of(operator): ms for operator, ms in (("MatMul", 6.0), ("Softmax", 1.0), ("Gather", 1.0), ("Gelu", 2.0))}
    stages = {stage: {"ms": ms, "mflop": 1200.0} for stage in ("root", "pose", "decoder")}
    Store(settings.results, "operators").add({"engine": "cpu"}, {"batch": 16, "stages": stages})
    assert "| f32 | box | pose | 10.0 | 60 % | 10 % | 10 % | 20 % | 200 |" in written(settings, tmp_path)


def test_live_and_overload_have_the_spread_of_their_runs(settings: Settings, tmp_path: Path):
    live = Store(settings.results, "live")
    for repeat, underruns in enumerate((0, 7, 1)):
        counts = {"plans": {"underruns": underruns}, "missing_frames": 0, "slowed_frames": 2, "late_ticks": 1}
        key = {"engine": "cpu", "characters": 400, "repeat": repeat}
        result = {"live": counts | {"plans_per_s_and_character": 2.4}, "latency_ms": {"p50": 4.0, "p99": 9.5}}
        live.add(key, result | {"server": {"rss_peak_bytes": 512 * 2**20}})
    overload = Store(settings.results, "overload")
    for repeat, ratio in enumerate((1.5, 1.9, 1.7)):
        overload.add({"engine": "cpu", "repeat": repeat}, {"p99_ratio": ratio, "memory": {"grown": 3 * 2**20}})
    text = written(settings, tmp_path)
    assert "| f32 | box | 400 | 3 | 1 (0 to 7) | 0 | 2 | 1 | 2.40 | 4.0 | 9.5 | 512 |" in text
    assert "| runs | 3 |" in text and "| the second ÷ the first | 1.70 (1.50 to 1.90) |" in text
    assert "| growth of memory, MiB | 3.0 |" in text
    assert "| failed |" not in text, "what no run has is left out"


def test_words_are_beside_fastapi_and_ratios_are_of_one_turn(settings: Settings, tmp_path: Path):
    store = Store(settings.results, "words")
    store.add({"check": "greedy"}, {"compared": 100, "same": 99, "largest_m": 2e-6})
    times = {"p50": 100.0, "p99": 200.0}
    store.add(
        {"target": "fastapi", "options": {"workers": 2}},
        {"frames_per_s": 1600.0, "frames_per_cpu_s": 1200.0, "first_frames_ms": times, "answer_ms": times},
    )
    for repeat, (ours, theirs) in enumerate(((4000.0, 2000.0), (800.0, 800.0), (6000.0, 2000.0))):
        for target, frames, wait in (("troupe", ours, 0.5), ("fastapi", theirs, 1.0)):
            result = {
                "frames_per_s": frames,
                "frames_per_cpu_s": frames / 2,
                "client_cpus_busy": 0.05,
                "first_frames_ms": {name: wait * time for name, time in times.items()},
                "answer_ms": times,
            }
            store.add({"target": target, "clients": 8, "repeat": repeat}, result)
    text = written(settings, tmp_path)
    for row in (
        "| **Troupe** | box | 8 | 1,000 | 500 | 50 / 100 | 100 / 200 | 0.05 |",
        "| FastAPI, in parts | box | 8 | 500 | 250 | 100 / 200 | 100 / 200 | 0.05 |",
        "| tokens/s ÷ FastAPI's in parts | box | 2.00 × (1.00 to 3.00) |",
        "| time to the first frames ÷ FastAPI's in parts | box | 0.50 × |",
        "| workers 2 | box | 400 | 300 | 100 | 100 |",
        "box: 99 of 100 greedy motions are the same in both; their joints are 2.0 µm apart at most.",
    ):
        assert row in text


def test_figures_are_short_and_read_back_as_they_were(settings: Settings):
    measure(settings)
    found = digest(settings)
    text = figures.as_text(found)
    assert json.loads(text)["parts"]["serving"]["rows"] == found["parts"]["serving"]["rows"]
    assert '"frames_per_s": 19000, "p50_ms": 100' in text


def test_a_machine_is_named_for_its_processor():
    assert name_of("Intel(R) Xeon(R) Processor") == "intel-xeon"
    assert name_of("AMD EPYC") == "amd-epyc"
    assert name_of("") == "machine"
