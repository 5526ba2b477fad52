"""The page of figures."""

from pathlib import Path

from troupe_bench.report import SECTIONS, write_report
from troupe_bench.settings import Settings
from troupe_bench.store import Store


def page_of(folder: Path, only_measured: bool) -> str:
    settings = Settings()
    settings.results = folder
    tried = {"engine": "cpu", "target": "fastapi", "options": {"workers": 2}}
    measured = {"throughput": {"frames_per_s": 1000.0}, "latency_ms": {"p99": 30.0}}
    Store(folder, "tune").add(tried, measured)
    write_report(settings, folder / "page.md", only_measured)
    return (folder / "page.md").read_text()


def test_a_part_that_was_not_measured_says_how_to_or_is_named_in_one_line(tmp_path):
    whole, short = page_of(tmp_path, False), page_of(tmp_path, True)
    titles = [title for title, part, *_ in SECTIONS if part != "tune"]
    assert all(f"## {title}\n" in whole for title in titles)
    assert whole.count("Not measured yet") == len(titles) and "## Settings tried" in short
    assert not any(f"## {title}\n" in short for title in titles)
    assert f"Not measured on this machine: {'; '.join(titles)}." in short.replace("\n", " ")
