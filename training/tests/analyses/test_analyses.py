"""The paper's analyses on hardly trained networks: that they measure what they say, and write what they promise."""

import json
from pathlib import Path

import pytest
import torch

from troupe_training.analyses import heads_codes, pose_steps, replan
from troupe_training.analyses.common import Setting
from troupe_training.analyses.replan import keys_of, moved, plan, roll_out
from troupe_training.analyses.root_interpolation import drawn_out, override
from troupe_training.cli.main import main
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import yaw_matrix
from troupe_training.data.store import ClipStore
from troupe_training.evaluate.bench import Sampling
from troupe_training.evaluate.metrics import accelerations
from troupe_training.evaluate.motionbricks import Keys, make_plan
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.train.motionbricks.tokenizer import TOKENIZER


@pytest.fixture(scope="module")
def run(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    for stage in ("tokenizer", "root", "pose"):
        argv = ["train", stage, "--run", str(folder), "--cache", str(cache), "--preset", "test"]
        assert main([*argv, "--steps", "40", "--frames-per-step", "512", "--threads", "1"]) == 0
    argv = ["evaluator", "--cache", str(cache), "--out", str(folder / "evaluator.onnx"), "--run", str(folder)]
    assert main([*argv, "--steps", "5", "--frames-per-step", "512", "--threads", "1"]) == 0
    return folder


@pytest.fixture
def setting(cache: Path, run: Path, tmp_path: Path) -> Setting:
    return Setting(cache, tmp_path, run, gap=26, split="train", max_windows=6, threads=1, preset=PRESETS["test"])


def analyse(name: str, run: Path, cache: Path, out: Path, *more: str) -> dict:
    argv = ["analyse", name, "--run", str(run), "--cache", str(cache), "--out", str(out), "--split", "train"]
    argv += ["--max-windows", "8", "--threads", "1", "--preset", "test", "--frames-per-step", "512"]
    assert main([*argv, *more]) == 0
    assert (out / f"{name}.png").stat().st_size > 10_000
    return json.loads((out / f"{name}.json").read_text())


def test_a_root_is_drawn_out_over_the_ground_from_the_context_on():
    root = torch.zeros(1, 8, 5)
    root[0, :, 0] = torch.arange(8.0)
    root[0, :, 1] = 0.9
    root[0, :, 3] = 1.0
    out = drawn_out(root, 1.5)
    assert out[0, :, 0].tolist() == [0, 1, 2, 3, 4.5, 6, 7.5, 9]
    assert torch.equal(out[..., 1:], root[..., 1:])
    assert torch.equal(drawn_out(root, 1.0), root)


def test_an_overridden_plan_keeps_its_tokens(setting: Setting):
    bench = setting.bench()
    segments = bench.store.segments(bench.windows(31)[0], 31)
    made = make_plan(setting.networks(bench), Keys.of(segments, 31), 31, Sampling())
    without = override(made, 1.2, keyframes=False)
    assert torch.equal(without.tokens, made.tokens) and not without.frame_mask.any()
    assert made.frame_mask.sum() == 5 * len(made.tokens)
    assert not torch.equal(without.global_root, made.global_root)


def test_a_plan_goes_on_from_its_context_wherever_it_stands(setting: Setting):
    """The same context and target elsewhere, turned about, gives the same motion there."""
    bench = setting.bench()
    networks = setting.networks(bench)
    truth = Motion.of(bench.store.segments(bench.windows(31)[0], 31))
    context, target = truth.slice(0, CONTEXT_FRAMES), truth.slice(30, 31)
    here = plan(networks, bench, context, target, 31, Sampling())
    assert torch.equal(here.root[:, :CONTEXT_FRAMES], context.root)
    yaw, by = yaw_matrix(torch.full((len(here.root),), 2.0)), torch.tensor([[3.0, 0.0, -5.0]])
    there = plan(networks, bench, *(moved(m, yaw, by, by) for m in (context, target)), 31, Sampling())
    expected = moved(here, yaw, by, by)
    assert torch.allclose(there.root, expected.root, atol=2e-3)
    assert torch.allclose(there.rotations, expected.rotations, atol=2e-3)
    # No jump at the seam beyond what the plan itself has.
    jumps = accelerations(here.world(bench.kinematics))
    assert jumps[:, CONTEXT_FRAMES - 2].mean() < 3 * jumps.mean() + 30


def test_keys_of_a_motion_are_those_of_its_segment(setting: Setting):
    bench = setting.bench()
    segments = bench.store.segments(bench.windows(31)[0], 31)
    truth, wanted = Motion.of(segments), Keys.of(segments, 31)
    given = [*range(CONTEXT_FRAMES), 30]
    found = keys_of(Motion(truth.root[:, given], truth.rotations[:, given]), bench)
    assert torch.allclose(found.global_root, wanted.global_root, atol=1e-3)
    assert torch.allclose(found.local_root, wanted.local_root, atol=3e-2)
    assert torch.allclose(found.pose, wanted.pose, atol=3e-3)


def test_a_roll_out_plans_as_often_as_its_interval_says(setting: Setting, run: Path):
    bench = setting.bench()
    networks = setting.networks(bench)
    asked: list[int] = []
    original = networks.run

    def counted(stage: str, **inputs):
        if stage == "root":
            asked.append(1)
        return original(stage, **inputs)

    networks.run = counted
    segments = bench.store.segments(bench.windows(31)[0], 31)
    for interval, plans in ((None, 1), (8, 3), (5, 4), (1, 20)):
        asked.clear()
        made = roll_out(networks, bench, interval)(segments, 31, Sampling())
        assert made.root.shape[1] == 31
        assert len(asked) == plans, interval


def test_heads_and_codes_have_one_capacity():
    for heads, codes in heads_codes.VARIANTS:
        assert codes**heads == 2**heads_codes.CAPACITY_BITS
        config = heads_codes.variant(PRESETS["default"], heads, codes)
        assert config.heads * config.code_dim == heads_codes.LATENT_WIDTH


def test_unspoilt_tokens_are_the_tokenizers(setting: Setting, run: Path, cache: Path):
    store = ClipStore(cache, "train")
    model = TOKENIZER.load(run, store)
    segments = store.segments(store.sample(4, 36, torch.Generator().manual_seed(1)), 36)
    clean, again, spoilt = (
        heads_codes.spoilt(model, share)(segments, 36, Sampling()).rotations for share in (0.0, 0.0, 1.0)
    )
    assert torch.equal(clean, again) and not torch.allclose(clean, spoilt, atol=1e-3)


@pytest.mark.parametrize("name", ["root-interpolation", "pose-steps", "replan", "captured"])
def test_analyses_without_training(name: str, run: Path, cache: Path, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(pose_steps, "STEPS", (1, 3))
    monkeypatch.setattr(replan, "INTERVALS", (4, 8))
    report = analyse(name, run, cache, tmp_path, "--gap", "26", "--seeds", "1", "2")
    assert report["windows"] == 8 and report["ground_truth"]["fid"]["mean"] >= 0.0
    if name == "root-interpolation":
        assert set(report["ratios"]["with keyframes"]) == {"0.8", "0.9", "1.0", "1.1", "1.2"}
        assert report["ratios"]["without keyframes"]["1.0"]["fid"]["mean"] > 0.0
    elif name == "pose-steps":
        assert [len(runs) for runs in report["runs"].values()] == [1, 2]
        first, second = (r["steps"]["1"]["l2p_m"]["mean"] for r in report["runs"]["temperature 1"])
        assert first != second, "seeds choose other tokens"
    elif name == "captured":
        assert len({case["l2p_m"]["mean"] for case in report["cases"].values()}) == 4
    else:
        assert set(report["intervals"]) == {"4", "8"} and "fid" in report["one_plan"]


@pytest.mark.parametrize(("name", "seeds"), [("heads-codes", [1, 2]), ("fsq-vq", [3])])
def test_analyses_that_train(name: str, seeds: list[int], run: Path, cache: Path, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(heads_codes, "VARIANTS", ((2, 4), (4, 2)))
    monkeypatch.setattr(heads_codes, "LATENT_WIDTH", 16)
    monkeypatch.setattr(heads_codes, "SHARES", (0.0, 0.5))
    for module in ("heads_codes", "fsq_vq"):
        monkeypatch.setattr(f"troupe_training.analyses.{module}.TEST_BATCHES", 1)
    more = ["--steps", "25", "--gap", "26", "--seeds", *map(str, seeds)]
    report = analyse(name, run, cache, tmp_path, *more)
    assert report["budget"] == {"updates": 25, "frames_per_update": 512, "seeds": seeds}
    for rows in report["variants"].values():
        assert [row["seed"] for row in rows] == seeds
        if name == "heads-codes":
            assert rows[0]["perturbed"]["0.5"]["l2p_m"]["mean"] > 0.0
        else:
            assert rows[0]["test_entropy"] > 0.0 and "fid" in rows[0]["in_between"]
    again = analyse(name, run, cache, tmp_path, *more)
    key = "test_loss" if name == "heads-codes" else "test_reconstruction"
    for name_of, rows in report["variants"].items():
        assert again["variants"][name_of][0][key] == pytest.approx(rows[0][key]), "what is trained stays"
