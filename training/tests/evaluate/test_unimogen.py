"""Baselines, blends, chained windows and the card of UniMoGen."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BodyStore, Corpus
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.evaluate.unimogen.encoders import encoder_of
from troupe_training.evaluate.unimogen.measure import chosen, figures, measure, table, toes, why_no_fid
from troupe_training.evaluate.unimogen.methods import (
    Answer,
    Asked,
    Setting,
    captured,
    copied,
    counterparts,
    frozen,
    interpolated,
    style_for,
)
from troupe_training.evaluate.unimogen.networks import load_network, of_pack
from troupe_training.evaluate.unimogen.style import blend, classifier, trained_classifier
from troupe_training.evaluate.unimogen.walk import chained, seams, swinging, walk_figures
from troupe_training.models.unimogen.state import BodyKinematics, Range

FRAMES = 20
LIMITS = Range(torch.full((3,), -0.5), torch.full((3,), 0.5))


@pytest.fixture(scope="module")
def run(corpus_cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unimogen")
    argv = ["unimogen", "train", "--cache", str(corpus_cache), "--run", str(folder), "--unimogen-preset", "tiny"]
    assert main([*argv, "--steps", "26", "--rows-per-step", "1500", "--threads", "1"]) == 0
    return folder


@pytest.fixture(scope="module")
def robot(corpus_cache: Path) -> BodyStore:
    return Corpus(corpus_cache, "train").stores["toy"]


def asked_of(store: BodyStore) -> Asked:
    starts, owners = store.every(FRAMES, 8, 5)
    return Asked.of(store, starts, owners, FRAMES)


def encoder(root: torch.Tensor, positions: torch.Tensor, six_d: torch.Tensor) -> np.ndarray:
    """Stands for the pack evaluator."""
    return 10 * positions[:, -1].flatten(1).double().numpy()


def test_a_frozen_pose_stays_and_an_interpolated_one_reaches_the_last(robot: BodyStore):
    asked = asked_of(robot)
    truth = captured(robot.body)(asked)
    still, between = frozen(robot.body, LIMITS)(asked), interpolated(robot.body, LIMITS)(asked)
    torch.testing.assert_close(still.turned[:, :CONTEXT_FRAMES], truth.turned[:, :CONTEXT_FRAMES], atol=1e-4, rtol=0)
    torch.testing.assert_close(between.turned[:, -1], truth.turned[:, -1], atol=1e-4, rtol=0)
    torch.testing.assert_close(between.root[:, -1], truth.root[:, -1], atol=1e-4, rtol=0)
    assert (still.turned[:, -1] - truth.turned[:, -1]).abs().max() > 0.01


def test_motion_of_the_same_take_is_copied_by_joint_name(robot: BodyStore):
    asked = asked_of(robot)
    truth, copy = captured(robot.body)(asked), copied(robot, robot, LIMITS)(asked)
    torch.testing.assert_close(copy.turned, truth.turned, atol=1e-4, rtol=0)
    torch.testing.assert_close(copy.root, truth.root, atol=1e-4, rtol=0)


def test_joints_of_other_names_stay_neutral(robot: BodyStore, corpus_cache: Path):
    other = Corpus(corpus_cache, "train").stores["toy"]
    arm = other.body.skeleton.names.index("left_shoulder")
    other.body.skeleton.names[arm] = "elsewhere"
    asked = asked_of(robot)
    copy, truth = copied(robot, other, LIMITS)(asked), captured(robot.body)(asked)
    parent = robot.body.skeleton.parents[arm]
    torch.testing.assert_close(copy.turned[:, :, arm], copy.turned[:, :, parent], atol=1e-4, rtol=0)
    assert (truth.turned[:, :, arm] - truth.turned[:, :, parent]).abs().max() > 0.01


def test_windows_that_a_donor_lacks_are_left_out(robot: BodyStore, corpus_cache: Path):
    other = Corpus(corpus_cache, "train").stores["toy"]
    other.clips = other.clips[1:]
    setting = Setting(FRAMES, 8, None)
    starts, owners = chosen(robot, setting, [other])
    assert len(starts) and 0 not in owners.tolist()
    theirs, _ = counterparts(robot, other, starts, owners, FRAMES)
    assert theirs.tolist() == starts.tolist()
    assert len(chosen(robot, Setting(FRAMES, 8, 3))[0]) == 3
    del other.clips[0]["take"]
    with pytest.raises(SystemExit, match="into a new one"):
        counterparts(robot, other, starts, owners, FRAMES)


def test_style_vectors_follow_the_words_of_a_network():
    given = np.array([[1.0, 0.5, 0.25]])
    assert style_for(given, ["a", "b", "c"], ["c", "x", "a"]).tolist() == [[0.25, 0.0, 1.0]]


def test_fid_of_a_copy_is_zero_and_captures_have_one_of_their_halves(robot: BodyStore):
    methods = {"copied": copied(robot, robot, LIMITS), "frozen": frozen(robot.body, LIMITS)}
    found = measure(robot, methods, Setting(FRAMES, 2, 80), encoder)
    assert list(found) == ["captured", "copied", "frozen"] and found["captured"]["windows"] == 80
    assert found["copied"]["fid"] == pytest.approx(0.0, abs=1e-2) and found["frozen"]["fid"] > 0.01
    assert found["captured"]["fid"] > 0
    assert found["copied"]["diversity_between_motions_m2"] == pytest.approx(
        found["captured"]["diversity_between_motions_m2"], rel=1e-3
    )


def test_a_classifier_tells_two_clouds_apart_whatever_their_sizes():
    rng = np.random.default_rng(0)
    made = classifier(rng.standard_normal((400, 6)) - 2, rng.standard_normal((40, 6)) + 2)
    assert made.share(rng.standard_normal((100, 6)) - 2) < 0.02
    assert made.share(rng.standard_normal((100, 6)) + 2) > 0.98


def test_blends_are_measured_by_weight(run: Path, corpus_cache: Path):
    store, network, styles = Corpus(corpus_cache, "train").stores["walker"], load_network(run, 1), ("calm", "brisk")
    setting = Setting(FRAMES, 16, None, 1)
    network.words, store.words = ["brisk"], list(styles)
    store.clip_words = torch.eye(2)[torch.arange(len(store.clips)) % 2]
    found = blend(trained_classifier(store, styles, setting, encoder), store, styles, network, setting, encoder)
    assert list(found) == ["captured calm", "captured brisk", "0", "0.25", "0.5", "0.75", "1"]
    assert found["captured calm"] < found["captured brisk"]


def test_chained_windows_join(run: Path, corpus_cache: Path):
    body, network = Body.load(corpus_cache / "walker" / "body.json"), load_network(run, 1)
    setting, path = Setting(FRAMES, steps=1), swinging(3, FRAMES, 1.0, 30.0)
    answer = chained(body, network, path, np.zeros(len(network.words), np.float32), setting)
    assert answer.root.shape == (1, 52, 3) == (*path.points.shape[:2], 3)
    assert seams(3, FRAMES) == [20, 36]
    one = chained(body, network, swinging(1, FRAMES, 1.0, 30.0), np.zeros(len(network.words), np.float32), setting)
    torch.testing.assert_close(answer.root[:, :FRAMES], one.root, atol=1e-4, rtol=0)
    assert {"path_position_m", "seam_mps2", "foot_skate_m_per_frame"} <= set(walk_figures(body, answer, path, setting))


def exported(run: Path, cache: Path, out: Path) -> Path:
    assert main(["unimogen", "export", "--run", str(run), "--cache", str(cache), "--out", str(out)]) == 0
    return out


def test_a_pack_answers_as_its_run_does(run: Path, corpus_cache: Path, tmp_path: Path):
    pack, written = exported(run, corpus_cache, tmp_path / "pack"), tmp_path / "f.json"
    shared = ["--cache", str(corpus_cache), "--frames", "20", "--max-windows", "3", "--threads", "1", "--parts", "test"]
    measured = ["unimogen", "evaluate", "--pack", str(pack), *shared, "--other-steps", "1", "--other-guidance", "2.5"]
    assert main([*measured, "--beside", f"run={run}", "--json", str(written)]) == 0
    report = json.loads(written.read_text())
    assert report["content_hash"] == of_pack(pack, 1).source["content_hash"] and report["step"] == 26
    assert f"--pack {pack}" in report["command"]
    for methods in report["figures"].values():
        for name, value in methods["run"].items():  # weights of a pack are rounded to 16 bits
            assert methods["unimogen"][name] == pytest.approx(value, rel=0.02, abs=1e-3)
        assert methods["1 steps"]["l2p_m"] != methods["unimogen"]["l2p_m"] != methods["guidance 2.5"]["l2p_m"]
    assert "no evaluator knows the skeleton of toy" in report["notes"]["toy, test"]


def test_a_pack_is_refused_where_file_or_body_is_another(run: Path, corpus_cache: Path, tmp_path: Path):
    pack = exported(run, corpus_cache, tmp_path / "pack")
    body = Body.load(corpus_cache / "toy" / "body.json")
    of_pack(pack, 1).check_body(body)
    body.skeleton.names[3] = "elsewhere"
    with pytest.raises(SystemExit, match="body toy has other joints than the pack's"):
        of_pack(pack, 1).check_body(body)
    with (pack / "denoiser.onnx").open("ab") as file:
        file.write(b"\0")
    with pytest.raises(SystemExit, match="are not what pack"):
        of_pack(pack, 1)
    with pytest.raises(SystemExit, match="is no pack"):
        main(["unimogen", "evaluate", "--pack", str(tmp_path / "none"), "--cache", str(corpus_cache)])


def test_a_table_says_why_it_has_no_fid(robot: BodyStore, tmp_path: Path):
    found = measure(robot, {}, Setting(FRAMES, 8, 5), encoder)
    few = why_no_fid(found, "")
    assert few == "FID is not measured: it needs at least 64 windows, these are 5."
    assert "| toy, test | captured |" in (text := table({"toy, test": found}, {"toy, test": few}))
    assert "| not measured | 5 |" in text and f"- toy, test: {few}" in text
    assert why_no_fid({"captured": {"windows": 64.0}}, "") == ""
    assert encoder_of(tmp_path, robot.body, 1)[0] is None
    (tmp_path / "toy").mkdir()
    (tmp_path / "toy" / "evaluator.onnx").touch()
    (tmp_path / "toy" / "pack.toml").write_text('[[skeleton.joints]]\nname = "Hips"\n')
    assert "knows other joints than toy has" in encoder_of(tmp_path, robot.body, 1)[1]


def test_toes_are_contact_joints_without_others_below_them(robot: BodyStore):
    names = [robot.body.skeleton.names[robot.body.skeleton.contact_joints[place]] for place in toes(robot.body)]
    assert len(robot.body.skeleton.contact_joints) == 4 and sorted(names) == ["left_toe", "right_toe"]


def test_a_toe_in_the_ground_counts_on_its_side(robot: BodyStore):
    asked = asked_of(robot)
    truth = captured(robot.body)(asked)
    kinematics = BodyKinematics(robot.body)
    joints = robot.body.skeleton.contact_joints
    left = [place for place in toes(robot.body) if robot.body.sides[joints[place]] == 1]
    low = kinematics.positions(truth.root, truth.turned)[:, :, [joints[left[0]]], 1].amax()
    sunk = Answer(truth.root - torch.tensor([0.0, float(low) + 1.0, 0.0]), truth.turned)
    found = figures(robot.body, sunk, truth, asked.path)
    assert (found["left_penetration_share"] == 1).all() and (found["foot_penetration_share"] == 1).all()
    raised = Answer(truth.root + torch.tensor([0.0, 5.0, 0.0]), truth.turned)
    found = figures(robot.body, raised, truth, asked.path)
    assert (found["foot_penetration_share"] == 0).all() and (found["foot_sliding_m"] == 0).all()


def test_the_card_tells_bodies_training_and_figures(run: Path, corpus_cache: Path, tmp_path: Path):
    shared, pack, measured_at = (
        ["--run", str(run), "--cache", str(corpus_cache)],
        tmp_path / "pack",
        tmp_path / "f.json",
    )
    few = ["--frames", "20", "--max-windows", "2", "--sampler-steps", "1", "--threads", "1"]
    assert main(["unimogen", "export", *shared, "--out", str(pack)]) == 0
    measured = ["--trained-bodies", "toy", "--copied-from", "toy", "--beside", f"again={run}", "--parts", "test"]
    assert main(["unimogen", "evaluate", *shared, *few, *measured, "--json", str(measured_at)]) == 0
    shown = ["--shown", "walker", "toy", "--windows", "2", "--frames", "20", "--sampler-steps", "1", "--threads", "1"]
    assert main(["unimogen", "film", *shared, *shown, "--out", str(pack / "film.png")]) == 0
    notes = tmp_path / "notes.md"
    notes.write_text("## Data and limits\n\nWalks.\n")
    blend = tmp_path / "b.json"
    blend.write_text(json.dumps({"step": 26, "styles": ["calm", "brisk"], "shares": {"test": {"0": 0.25, "1": 1.0}}}))
    card = ["unimogen", "card", "--pack", str(pack), "--evaluations", str(measured_at), "--notes", str(notes)]
    walked = tmp_path / "w.json"
    row = {"windows": 3.0, "standing_foot_m_per_frame": 0.004}
    found = {"toy, line 1.2 m/s": {"captured": row, "unimogen": row}}
    walked.write_text(json.dumps({"step": 26, "command": "c", "setting": {"frames": 68}, "figures": found}))
    card += ["--sweeps", str(measured_at), "--blend", str(blend), "--user-paths", str(walked)]
    assert main(card) == 0 and main(card) == 0
    text = (pack / "README.md").read_text()
    for part in (
        "Walks.",
        "| toy | 14 | 9 |",
        "unimogen | 26 |",
        "### toy, test, 2 windows",
        "(film.png)",
        "(curves.png)",
        "no evaluator knows the skeleton of toy",
        f"    troupe-train unimogen evaluate --run {run}",
        "goes on for 2.1 seconds",
        "| toy, line 1.2 m/s | this pack | 3 | 4.0 |",
        "## Steps and guidance",
        "| 0 | 25.0 |",
    ):
        assert part in text
    assert "| | ground truth | frozen pose | interpolated | this pack | again |" in text
    manifest = (pack / "pack.toml").read_text()
    assert manifest.count("[evaluation]") == 1 and '"toy_test_unimogen" = {' in manifest and "[unimogen]" in manifest
    written = json.loads(measured_at.read_text())
    measured_at.write_text(json.dumps(written | {"step": 7}))
    with pytest.raises(SystemExit, match="of update 7, the pack is of update 26"):
        main(card)
    measured_at.write_text(json.dumps(written | {"content_hash": "sha256:0"}))
    with pytest.raises(SystemExit, match="its content hash differs"):
        main(card)
