"""The table of docs/planning.md is what scripts/plan.py computes from the figures of other pages."""

import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts/plan.py"


@pytest.fixture
def plan(monkeypatch: pytest.MonkeyPatch):
    spec = importlib.util.spec_from_file_location("plan", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr("sys.argv", ["plan.py", "--check"])
    return module


def test_the_page_has_the_table(plan):
    plan.main()


def test_a_row_that_is_old_is_found(plan, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    page = tmp_path / "planning.md"
    page.write_text(plan.PAGE.read_text().replace("| 7,512 |", "| 7,513 |"))
    monkeypatch.setattr(plan, "PAGE", page)
    with pytest.raises(SystemExit, match=r"lacks these rows.*\n.*939 × 8"):
        plan.main()


def test_a_new_measurement_changes_the_plan(plan):
    measured = plan.Measured()
    before = {what: value for what, _, value in plan.rows(measured, 1_000_000, 8)}
    assert before["servers"] == "939" and before["cores of all stores, 60 % busy"] == "455"
    measured.characters_of_two_cores = 800
    after = {what: value for what, _, value in plan.rows(measured, 1_000_000, 8)}
    # 1,000,000 ÷ floor(400 × 8 × 2/3)
    assert after["servers"] == "469"


def test_a_figure_that_is_gone_is_named(plan):
    with pytest.raises(SystemExit, match=r"loadtest\.md: 'no such row' is there 0 times"):
        plan.figure("loadtest.md", "no such row")
