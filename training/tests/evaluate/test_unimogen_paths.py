"""Users' paths and what is measured on them."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.bodies_store import BodyStore, Corpus
from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.data.rotations import wrap_angle
from troupe_training.evaluate.unimogen.card import paths_table
from troupe_training.evaluate.unimogen.methods import Asked, Setting, captured
from troupe_training.evaluate.unimogen.user_paths import CASES, Case, alike, begins, gait_of, measure_paths, path_of

FRAMES = 36
SETTING = Setting(FRAMES, 4, 6)


@pytest.fixture(scope="module")
def walker(corpus_cache: Path) -> BodyStore:
    return Corpus(corpus_cache, "train").stores["walker"]


def asked_of(store: BodyStore) -> Asked:
    starts, owners = begins(store, SETTING)
    assert len(starts) == 6
    return Asked.of(store, starts, owners, FRAMES)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_path_goes_on_from_the_last_pose_at_an_even_speed(walker: BodyStore, case: Case):
    asked = asked_of(walker)
    path, last = path_of(asked, case, 0), CONTEXT_FRAMES - 1
    torch.testing.assert_close(path.points[:, : last + 1], asked.path.points[:, : last + 1])
    step = (path.points[:, last + 1 :] - path.points[:, last:-1]).norm(dim=-1)
    torch.testing.assert_close(step, torch.full_like(step, case.speed_mps / FPS), atol=1e-5, rtol=0)
    assert float((path.heading[:, 1:] - path.heading[:, :-1]).abs().max()) < 0.2


def test_arcs_turn_to_both_sides_and_an_s_ends_as_it_began(walker: BodyStore):
    asked = asked_of(walker)
    line, arc, s = (path_of(asked, Case(shape, 1.2), 0).heading for shape in ("line", "arc", "S"))
    turned = wrap_angle(arc[:, -1] - line[:, -1])
    seconds = (FRAMES - CONTEXT_FRAMES - 1) / FPS
    assert turned[::2].tolist() == pytest.approx([math.radians(30) * seconds] * 3, abs=0.04)
    assert turned[1::2].tolist() == pytest.approx([-math.radians(30) * seconds] * 3, abs=0.04)
    torch.testing.assert_close(wrap_angle(s[:, -1] - line[:, -1]), torch.zeros(6), atol=0.04, rtol=0)
    assert float(wrap_angle(s - line).abs().max()) > 0.2


def test_walks_are_found_by_their_speed_and_turn(walker: BodyStore):
    starts, _ = begins(walker, SETTING)
    gait = gait_of(walker, starts, FRAMES)
    assert float(gait.turn_deg_per_s.abs().max()) < 10 and float(gait.speed_mps.min()) > 0.3 * walker.body.size_m
    speed = float(gait.speed_mps[0])
    same, _ = alike(walker, Case("line", speed), SETTING)
    assert len(same) and float((gait_of(walker, same, FRAMES).speed_mps - speed).abs().max()) < 0.15


def test_captures_are_measured_beside_answers(walker: BodyStore):
    found = measure_paths(walker, [walker], {"held": captured(walker.body)}, SETTING, None)
    assert list(found) == [case.name for case in CASES]
    first = found["line 1.2 m/s"]["held"]
    assert first["windows"] == 6 and first["standing_foot_m_per_frame"] >= 0 and "l2p_m" not in first
    lines = paths_table(found).splitlines()
    assert len(lines) == 2 + 2 * len(CASES) and lines[2].startswith("| line 0.6 m/s | ground truth |")


def test_captured_walks_are_written_with_their_figures(corpus_cache: Path, tmp_path: Path):
    shared = ["unimogen", "roots", "--cache", str(corpus_cache), "--shown", "walker"]
    assert main([*shared, "--frames", str(FRAMES), "--max-windows", "6", "--json", str(tmp_path / "roots.json")]) == 0
    written = json.loads((tmp_path / "roots.json").read_text())["walker"]
    store = Corpus(corpus_cache, "test").stores["walker"]
    path = Asked.of(store, *begins(store, replace(SETTING, stride=1)), FRAMES).path
    roots = torch.tensor(written["roots"])
    torch.testing.assert_close(roots[..., :2], path.points, atol=1e-4, rtol=0)
    torch.testing.assert_close(roots[..., 2], path.heading, atol=1e-4, rtol=0)
    assert written["standing_foot_mm"] > 0 and 0 <= written["sunk_share"] <= 1
    with pytest.raises(SystemExit, match="walks straight on for 4000 frames"):
        main([*shared, "--frames", "4000"])


def test_the_command_measures_a_run(corpus_cache: Path, tmp_path: Path):
    shared = ["--cache", str(corpus_cache), "--run", str(tmp_path / "run"), "--threads", "1"]
    training = ["--unimogen-preset", "tiny", "--steps", "2", "--rows-per-step", "800"]
    assert main(["unimogen", "train", *shared, *training]) == 0
    out = tmp_path / "paths.json"
    argv = ["--shown", "walker", "--frames", str(FRAMES), "--max-windows", "2", "--sampler-steps", "1"]
    assert main(["unimogen", "paths", *shared, *argv, "--json", str(out)]) == 0
    report = json.loads(out.read_text())
    assert report["figures"]["walker, S 1.8 m/s"]["unimogen"]["path_position_m"] > 0 and report["step"] == 2
    with pytest.raises(SystemExit, match="has no body"):
        main(["unimogen", "paths", *shared, "--shown", "cat"])
