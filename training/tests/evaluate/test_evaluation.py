"""Evaluation: the evaluator's export, pinning, sampling, and the report of a pack and of a run."""

import json
import shutil
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.interpolation import interpolate
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion, local_rotations, pose_features, world_rotations
from troupe_training.data.store import ClipStore
from troupe_training.evaluate.bench import Latents, Sampling
from troupe_training.evaluate.motionbricks import (
    PAPER_G1,
    Keys,
    Plan,
    choose_tokens,
    make_plan,
    masked_after,
    open_networks,
)
from troupe_training.evaluate.pinning import fade, pin
from troupe_training.evaluate.tables import markdown, table
from troupe_training.export.evaluator import OPERATORS
from troupe_training.models.evaluator import Evaluator, inputs_of
from troupe_training.train.evaluator import set_scales


@pytest.fixture(scope="module")
def evaluator(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("evaluator")
    argv = ["evaluator", "--cache", str(cache), "--out", str(folder / "evaluator.onnx"), "--threads", "1"]
    argv += ["--run", str(folder), "--frames-per-step", "512"]
    assert main([*argv, "--steps", "20"]) == 0
    assert main([*argv, "--steps", "100"]) == 0  # goes on from its checkpoint
    return folder


@pytest.fixture(scope="module")
def run(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Checkpoints of all stages, hardly trained."""
    folder = tmp_path_factory.mktemp("run")
    for stage in ("tokenizer", "root", "pose"):
        argv = ["train", stage, "--run", str(folder), "--cache", str(cache), "--preset", "test"]
        assert main([*argv, "--steps", "30", "--frames-per-step", "512", "--threads", "1"]) == 0
    return folder


@pytest.fixture
def store(cache: Path) -> ClipStore:
    return ClipStore(cache, "train")


def walks(store: ClipStore, frames: int):
    starts = store.sample(6, 48, torch.Generator().manual_seed(5))
    return store.segments(starts, frames)


def test_the_evaluator_learns_and_is_exported_in_plain_operators(evaluator: Path):
    history = json.loads((evaluator / "evaluator.json").read_text())["history"]
    assert history[-1]["reconstruction"] < 0.8 * history[0]["reconstruction"]
    path = evaluator / "evaluator.onnx"
    assert path.stat().st_size < 6e6
    model = onnx.load(path)
    assert [(o.domain, o.version) for o in model.opset_import] == [("", 17)]
    assert {node.op_type for node in model.graph.node} <= OPERATORS
    shapes = {i.name: [d.dim_param or d.dim_value for d in i.type.tensor_type.shape.dim] for i in model.graph.input}
    assert list(shapes) == ["root", "positions", "six_d"]
    for name, rest in (("root", [5]), ("positions", [13, 3]), ("six_d", [13, 6])):
        assert all(isinstance(axis, str) for axis in shapes[name][:2]) and shapes[name][2:] == rest


def test_latents_spread_by_one_and_do_not_depend_on_the_batch(evaluator: Path, store: ClipStore):
    latents = Latents(evaluator / "evaluator.onnx", 1)
    generator = torch.Generator().manual_seed(6)
    many = np.concatenate([latents.of(**inputs_of(store.batch_of_any_length(1024, generator))) for _ in range(12)])
    assert np.abs(many.mean(0)).max() < 0.2
    assert np.square(many).sum(1).mean() == pytest.approx(1.0, rel=0.3)
    for frames in (12, 35, 47):
        inputs = inputs_of(walks(store, frames))
        together = latents.of(**inputs)
        assert together.shape == (6, 256)
        alone = latents.of(**{name: value[2:3] for name, value in inputs.items()})
        np.testing.assert_allclose(alone, together[2:3], atol=1e-4)
        assert np.abs(together[0] - together[1]).max() > 1e-2


def test_a_motions_features_are_those_of_its_segment(store: ClipStore):
    """An answer's measured features are the evaluator's training features."""
    segments = walks(store, 30)
    motion = Motion.of(segments)
    positions, six_d = pose_features(motion, Kinematics(store.skeleton))
    assert torch.allclose(six_d, segments.six_d, atol=1e-5)
    assert torch.allclose(positions, segments.positions, atol=2e-3)  # bones of the mean length
    root = motion.global_root(torch.tensor(store.skeleton.left_axis))
    assert torch.allclose(root, segments.global_root, atol=1e-3)


def test_the_evaluator_sees_shaking(store: ClipStore):
    """A shaken motion has other velocities, so that its features differ even if poses hardly do."""
    model = Evaluator(store.skeleton.joint_count)
    set_scales(model, store)
    inputs = inputs_of(walks(store, 30))
    shaken = inputs | {"root": inputs["root"] + 0.01 * torch.tensor([1.0, -1.0]).repeat(15)[:, None]}
    difference = (model.features(**shaken) - model.features(**inputs)).abs()
    assert difference[..., -model.widths["velocities"] :].mean() > 5 * difference[..., 5:-20].min()


def test_rotations_survive_going_through_their_parents(store: ClipStore):
    rotations = Motion.of(walks(store, 20)).rotations
    back = world_rotations(local_rotations(rotations, store.skeleton.parents), store.skeleton.parents)
    assert torch.allclose(back, rotations, atol=1e-5)


@pytest.mark.parametrize("frames", [20, 35, 48])
def test_a_pinned_answer_meets_its_keyframes_without_a_jump(store: ClipStore, frames: int):
    segments = walks(store, frames)
    truth = Motion.of(segments)
    axis, parents = torch.tensor(store.skeleton.left_axis), store.skeleton.parents
    index = [*range(CONTEXT_FRAMES), frames - 1]
    given = Motion(truth.root[:, index], truth.rotations[:, index])
    # An answer that is off by 20 cm and some degrees everywhere.
    turn = torch.linalg.matrix_exp(torch.tensor([[0.0, 0.1, 0.3], [-0.1, 0.0, 0.05], [-0.3, -0.05, 0.0]]))
    made = Motion(truth.root + torch.tensor([0.1, 0.02, -0.2]), turn @ truth.rotations)
    pinned = pin(made, given, index, parents, axis)
    assert torch.allclose(pinned.root[:, index], given.root, atol=1e-5)
    assert torch.allclose(pinned.rotations[:, index], given.rotations, atol=1e-4)
    moved = (pinned.root[:, 1:] - pinned.root[:, :-1]) - (truth.root[:, 1:] - truth.root[:, :-1])
    assert moved.norm(dim=-1).max() < 0.02  # what is lacking is spread over the gap
    same = pin(truth, given, index, parents, axis)
    assert torch.allclose(same.rotations, truth.rotations, atol=1e-4)


def test_what_a_pin_lacks_fades():
    assert fade(0, 8) == 1.0 and fade(8, 8) == 0.0 and fade(4, 8) == pytest.approx(0.5)
    assert fade(1, 0) == 0.0


def test_interpolation_goes_evenly_from_the_context_to_the_target(store: ClipStore):
    truth = Motion.of(walks(store, 30))
    made = interpolate(truth, 30, store.skeleton.parents)
    assert torch.allclose(made.root[:, [0, 3, 29]], truth.root[:, [0, 3, 29]], atol=1e-5)
    assert torch.allclose(made.rotations[:, [0, 3, 29]], truth.rotations[:, [0, 3, 29]], atol=1e-3)
    steps = made.root[:, 4:] - made.root[:, 3:-1]
    assert torch.allclose(steps, steps[:, :1].expand_as(steps), atol=1e-5)


def test_the_schedule_is_the_servers():
    """`masked_after` of `server/src/engine/sampling.rs`."""
    assert [masked_after(64, step, 4) for step in (1, 2, 3, 4)] == [59, 45, 24, 0]
    assert masked_after(36, 1, 1) == 0


class Scripted:
    """A pose stage that is surer of a token the later it stands, and whose favourite code is its place."""

    heads, codes = 2, 8

    def __init__(self):
        self.masked: list[int] = []

    def run(self, stage: str, tokens: torch.Tensor, **_: torch.Tensor) -> dict[str, torch.Tensor]:
        self.masked.append(int((tokens[0] == self.codes).sum()))
        batch, slots, heads = tokens.shape
        place = torch.arange(slots * heads).reshape(slots, heads)
        logits = torch.nn.functional.one_hot(place % self.codes, self.codes).float() * (1.0 + place[..., None])
        return {"logits": logits.expand(batch, slots, heads, self.codes)}


def blank_plan(batch: int, slots: int) -> Plan:
    zeros = torch.zeros(batch, slots * 4, 1)
    return Plan(slots * 4, torch.zeros(batch, slots, 2, dtype=torch.long), zeros, zeros, zeros, zeros)


def test_tokens_are_committed_by_confidence_over_the_passes():
    networks = Scripted()
    tokens = choose_tokens(networks, blank_plan(3, 4), Sampling(steps=3))
    assert torch.equal(tokens[1].flatten(), torch.arange(8))
    assert networks.masked == [8, masked_after(8, 1, 3), masked_after(8, 2, 3)]
    again = Scripted()
    choose_tokens(again, blank_plan(1, 3), Sampling(steps=10))
    assert len(again.masked) == 6, "every pass commits something, and none follows when nothing is left"


def test_seeds_choose_and_temperature_zero_does_not():
    def draw(seed: int) -> torch.Tensor:
        return choose_tokens(Scripted(), blank_plan(40, 4), Sampling(1, 1.0, seed))

    assert torch.equal(draw(1), draw(1)) and not torch.equal(draw(1), draw(2))
    first = draw(3)[:, 0, 0]  # its logits are 1, 0, 0, ...
    share = float((first == 0).float().mean())
    assert 0.05 < share < 0.7
    last = draw(3)[:, 3, 1]  # 8 against 0
    assert float((last == 7).float().mean()) > 0.9


def test_a_run_answers_as_its_pack_would(run: Path, store: ClipStore, cache: Path, tmp_path: Path):
    """Checkpoints and the exported pack differ by the rounding of weights to 16 bits alone."""
    assert main(["export", "--run", str(run), "--cache", str(cache), "--out", str(tmp_path / "pack")]) == 0
    plans = []
    for folder in (run, tmp_path / "pack"):
        networks = open_networks(folder, store, 1)
        plans.append(make_plan(networks, Keys.of(walks(store, 35), 35), 35, Sampling()))
    assert plans[0].tokens.shape == plans[1].tokens.shape == (6, 9, 2)
    assert torch.allclose(plans[0].global_root, plans[1].global_root, atol=2e-2)
    with pytest.raises(SystemExit, match="holds neither"):
        open_networks(tmp_path, store, 1)


def test_evaluate_reports_every_measure_with_its_interval(run: Path, cache: Path, evaluator: Path, tmp_path: Path):
    out = tmp_path / "report.json"
    argv = ["evaluate", "--run", str(run), "--cache", str(cache), "--gaps", "15", "30", "--split", "train"]
    argv += ["--evaluator", str(evaluator / "evaluator.onnx"), "--diversity-seeds", "3", "--threads", "1"]
    argv += ["--diversity-windows", "5", "--max-windows", "40", "--json", str(out)]
    assert main([*argv, "--markdown", str(tmp_path / "card.md")]) == 0
    report = json.loads(out.read_text())
    methods = report["gaps"][0]["methods"]
    names = {"mmd", "fid", "joint_diversity_m", "latent_diversity", "joint_jitter_mps2", "root_jitter_mps2"}
    names |= {"foot_skate_m_per_frame", "penetration_m", "contact_accuracy", "context_keyframe_error_m"}
    names |= {"target_keyframe_error_m", "context_root_error_m", "target_root_error_m", "reached"}
    names |= {"l2p_m", "l2q", "npss"}
    assert names <= set(methods["pack"])
    for figure in methods["pack"].values():
        assert figure["low"] <= figure["high"] and figure["low"] <= figure["mean"] * 1.001 + 1e-6
    assert methods["ground truth"]["l2p_m"]["mean"] < 1e-4
    assert methods["interpolation"]["context_keyframe_error_m"]["mean"] < 1e-4
    assert methods["interpolation"]["joint_diversity_m"]["mean"] == 0.0
    assert methods["pack"]["joint_diversity_m"]["mean"] > 0.0
    assert methods["interpolation"]["fid"]["mean"] > 0.0
    assert report["all_gaps"]["windows"] == 80 and len(report["evaluator"]) == 64
    card = (tmp_path / "card.md").read_text()
    assert "### Gap of 30 frames" in card and "FID ↓" in card and "MotionBricks" not in card

    assert main([*argv, "--pinned"]) == 0
    pinned = json.loads(out.read_text())["gaps"][0]["methods"]["pack"]
    for name in ("context_keyframe_error_m", "target_keyframe_error_m", "target_root_error_m"):
        assert pinned[name]["mean"] < 1e-3 < methods["pack"][name]["mean"]


def test_without_an_evaluator_the_rest_is_measured(run: Path, cache: Path, tmp_path: Path):
    argv = ["evaluate", "--run", str(run), "--cache", str(cache), "--gaps", "30", "--split", "train"]
    argv += ["--max-windows", "10", "--diversity-seeds", "0", "--json", str(tmp_path / "report.json")]
    assert main(argv) == 0
    figures = json.loads((tmp_path / "report.json").read_text())["gaps"][0]["methods"]["pack"]
    assert "l2p_m" in figures and not {"fid", "joint_diversity_m"} & set(figures)
    with pytest.raises(SystemExit, match="12 to 64"):
        main([*argv, "--gaps", "60"])


def test_robots_are_measured_on_their_hinges(run: Path, cache: Path, tmp_path: Path):
    """The walks on legs of hinges, limited so that the networks' knees do not fit."""
    robot_cache = tmp_path / "cache"
    shutil.copytree(cache, robot_cache)
    skeleton = json.loads((cache / "skeleton.json").read_text())
    joints = [n for n in skeleton["names"] if "Leg" in n or "Foot" in n]
    hinge = {"axis": [1.0, 0.0, 0.0], "rest": [1.0, 0.0, 0.0, 0.0], "lower_rad": -1.0, "upper_rad": 0.1}
    robot = {"name": "g1_like", "hinges": [{"joint": joint} | hinge for joint in joints]}
    (robot_cache / "skeleton.json").write_text(json.dumps(skeleton | {"robot": robot}))
    argv = ["evaluate", "--run", str(run), "--cache", str(robot_cache), "--gaps", "30", "--split", "train"]
    argv += ["--max-windows", "10", "--diversity-seeds", "2", "--diversity-windows", "2"]
    argv += ["--json", str(tmp_path / "report.json"), "--markdown", str(tmp_path / "card.md")]
    assert main([*argv, "--pinned"]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    methods = report["gaps"][0]["methods"]
    assert report["robot"] == "g1_like"
    assert methods["ground truth"]["l2p_m"]["mean"] < 1e-6, "truth is put onto the hinges too"
    assert 0.0 < methods["ground truth"]["hinge_clamped_share"]["mean"] < 1.0
    assert methods["pack"]["hinge_residual_max_deg"]["mean"] >= methods["pack"]["hinge_residual_mean_deg"]["mean"]
    assert methods["pack"]["target_keyframe_error_m"]["mean"] < 1e-3
    assert "MotionBricks, table 4" in (tmp_path / "card.md").read_text()


def test_tables_show_the_paper_where_asked():
    figure = {"mean": 0.5, "low": 0.4, "high": 0.6}
    methods = {"ground truth": {"fid": figure, "reached": figure}, "pack": {"fid": figure}}
    text = table(methods, PAPER_G1)
    assert "| FID ↓ | 0.5000 (0.4000–0.6000) | 0.5000 (0.4000–0.6000) | (0.8910) |" in text
    assert "| target reached (%) ↑ | 50.0 (40.0–60.0) | – | 61.1 |" in text
    report = {"split": "test", "clips": 4, "stride_frames": 20, "pinned": False, "temperature": 0.0}
    report |= {"pose_steps": 1, "diversity": {"seeds": 0}, "robot": "g1_29dof_rev_1_0"}
    report |= {"gaps": [{"gap_frames": 30, "windows": 7, "methods": methods}]}
    assert "MotionBricks" in markdown(report, PAPER_G1) and "MotionBricks" not in markdown(report)
