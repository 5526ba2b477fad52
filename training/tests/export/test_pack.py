"""From a folder of BVH files to a pack in one command, and its evaluation."""

import json
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.store import ClipStore
from troupe_training.evaluate.card import METHODS
from troupe_training.evaluate.nearest import NEAREST
from troupe_training.export.manifest import read_manifest
from troupe_training.export.motionbricks.adopt import adopt_decoder, weights_of
from troupe_training.export.motionbricks.examples import example_inputs
from troupe_training.export.motionbricks.pack import largest_difference
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.motionbricks.stages import load_networks
from troupe_training.train.motionbricks.tokenizer import TOKENIZER

SHIPPED = Path(__file__).parents[3] / "models"


@pytest.fixture(scope="module")
def pack(bvh_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pack")
    argv = ["pack", str(bvh_folder), "--run", str(folder / "run"), "--cache", str(folder / "cache"), "--steps", "30"]
    argv += ["--preset", "test", "--out", str(folder / "human"), "--frames-per-step", "512", "--workers", "1"]
    assert main([*argv, "--credit", "synthetic walks"]) == 0
    return folder


def test_pack_is_complete(pack: Path):
    manifest = read_manifest(pack / "human")
    assert (manifest["format"], manifest["family"]) == (2, "motionbricks")
    assert manifest["capabilities"] == {"inbetween": True, "live": True}
    assert manifest["credits"] == ["synthetic walks"]
    assert [j["name"] for j in manifest["skeleton"]["joints"]][:2] == ["Hips", "Spine"]
    assert manifest["content_hash"].startswith("sha256:")
    assert max(manifest["training"]["onnx_check"].values()) < 1e-3
    assert (pack / "human" / "curves.png").stat().st_size > 10_000
    for stage in ("root", "pose", "decoder"):
        session = onnxruntime.InferenceSession(pack / "human" / f"{stage}.onnx", providers=["CPUExecutionProvider"])
        assert all(isinstance(i.shape[0], str) for i in session.get_inputs()), "the batch axis is dynamic"


def test_openvino_takes_graphs_whole(pack: Path):
    """Each operator that it does not take cuts a network into parts, with calls and copies for each."""
    for folder in (pack / "human", SHIPPED / "human", SHIPPED / "g1"):
        for stage in ("root", "pose", "decoder"):
            graph = onnx.load(folder / f"{stage}.onnx").graph
            assert not [node.name for node in graph.node if node.op_type == "IsNaN"], f"{folder} {stage}"


def test_pose_and_decoder_take_any_number_of_tokens(pack: Path):
    """Padding a call to more tokens than its segment has does not change the segment."""
    for stage, output, per_token in (("pose", "logits", 1), ("decoder", "refined_root", 4)):
        session = onnxruntime.InferenceSession(pack / "human" / f"{stage}.onnx", providers=["CPUExecutionProvider"])
        tokens, _, _, frame_pose, _ = (i.shape for i in session.get_inputs())
        assert isinstance(tokens[1], str) and isinstance(frame_pose[1], str), "the time axis is dynamic"
        rng = np.random.default_rng(1)
        full = {
            "tokens": rng.integers(0, 16, (2, 16, tokens[2])),
            "global_root": rng.standard_normal((2, 64, 5), np.float32),
            "frame_pose": rng.standard_normal((2, 64, frame_pose[2]), np.float32),
            "frame_mask": np.ones((2, 64), np.float32),
        }
        for count in (3, 9, 15):
            answers = []
            for slots in (count, 16):
                steps = {n: v[:, : slots if n == "tokens" else 4 * slots] for n, v in full.items()}
                answers.append(session.run([output], steps | {"num_tokens": np.full(2, count)})[0])
            short, long = (answer[:, : per_token * count] for answer in answers)
            assert answers[0].shape[1] == per_token * count
            np.testing.assert_allclose(short, long, atol=1e-4)


def test_evaluate_measures_a_pack(pack: Path):
    out = pack / "report.json"
    argv = ["evaluate", "--pack", str(pack / "human"), "--cache", str(pack / "cache"), "--gaps", "15", "30"]
    assert main([*argv, "--split", "train", "--diversity-seeds", "0", "--json", str(out)]) == 0
    for gap in json.loads(out.read_text())["gaps"]:
        assert gap["windows"] > 20
        truth, slerp = gap["methods"]["ground truth"], gap["methods"]["interpolation"]
        assert truth["l2p_m"]["mean"] < 1e-4 and truth["npss"]["mean"] < 1e-6
        assert slerp["context_keyframe_error_m"]["mean"] < 1e-4


def test_card_takes_the_figures_of_this_pack_only(pack: Path):
    content_hash = read_manifest(pack / "human")["content_hash"]
    figures = {"l2p_m": 0.5, "reaching_success": 0.5}
    gap = {"gap_frames": 30, "windows": 7} | dict.fromkeys(METHODS, figures)
    report = {"content_hash": content_hash, "clips": 3, "stride_frames": 20, "temperature": 0.0, "pose_steps": 1}
    report |= {"gaps": [gap], "claims": [{"claim": "it walks", "holds": True}]}
    path = pack / "eval.json"
    path.write_text(json.dumps(report))
    argv = ["card", "--pack", str(pack / "human"), "--evaluation", str(path)]
    assert main(argv) == 0 and main(argv) == 0  # the second time replaces the table
    assert "it walks: holds" in (pack / "human" / "README.md").read_text()
    manifest = read_manifest(pack / "human")
    assert manifest["evaluation"]["gap_30_pack"]["l2p_m"] == 0.5
    figure = {"mean": 0.25, "low": 0.2, "high": 0.3}
    other = {"gap_frames": 30, "windows": 7, "methods": {NEAREST: {"l2p_m": figure}}}
    beside = pack / "baselines.json"
    beside.write_text(json.dumps({"evaluator": None, "stride_frames": 20, "gaps": [other]}))
    assert main([*argv, "--baselines", str(beside)]) == 0
    assert read_manifest(pack / "human")["evaluation"]["gap_30_nearest"]["l2p_m"] == 0.25
    beside.write_text(json.dumps({"evaluator": None, "stride_frames": 30, "gaps": [other]}))
    with pytest.raises(SystemExit, match="not those of the other report"):
        main([*argv, "--baselines", str(beside)])
    path.write_text(json.dumps(report | {"content_hash": "sha256:0"}))
    with pytest.raises(SystemExit, match="content hash"):
        main(argv)


def test_a_second_data_set_does_not_reuse_the_first_ones_cache(pack: Path, tmp_path: Path):
    argv = ["pack", str(tmp_path), "--run", str(pack / "run"), "--cache", str(pack / "cache"), "--steps", "1"]
    with pytest.raises(SystemExit, match="was made from"):
        main(argv)


def test_a_pack_can_be_adopted_and_refined(pack: Path):
    """Checkpoints out of a pack answer as the pack does, and its decoder trains on and is exported again."""
    run, again = pack / "adopted", pack / "again"
    common = ["--run", str(run), "--cache", str(pack / "cache")]
    assert main(["adopt", "--pack", str(pack / "human"), "--preset", "test", *common]) == 0
    store = ClipStore(pack / "cache", "train")
    networks = load_networks(run, store)
    inputs = example_inputs(store, networks.pose, 5, 9, 3)
    lengths = inputs["pose"]["num_tokens"]
    for stage, module in networks.stages().items():
        counts = module(**inputs["root"])[0] if stage == "root" else lengths
        path = pack / "human" / f"{stage}.onnx"
        assert largest_difference(path, module, inputs[stage], counts) < 1e-3
    # Poses are standardised as in the pack, not as in the cache.
    tokenizer = TOKENIZER.build(PRESETS["test"], store)
    mean = tokenizer.decoder.pose_scale.mean.clone()
    tokenizer.decoder.pose_scale.mean.zero_()
    assert "decoder.pose_scale.mean" not in adopt_decoder(tokenizer, weights_of(pack / "human" / "decoder.onnx"))
    torch.testing.assert_close(tokenizer.decoder.pose_scale.mean, mean, atol=1e-3, rtol=1e-3)
    before = read_checkpoint(run / "tokenizer.pt")["average"]
    assert main(["train", "refine", "--preset", "test", "--steps", "3", "--frames-per-step", "512", *common]) == 0
    after = read_checkpoint(run / "refine.pt")["model"]
    name = "decoder.level_full.blocks.0.conv.weight"
    assert not torch.equal(before[name], after[name])
    assert torch.equal(before["quantizer.book"], after["quantizer.book"])
    assert main(["export", "--out", str(again), "--name", "again", *common]) == 0
    trained = [read_manifest(f)["training"] for f in (pack / "human", again)]
    assert trained[0]["root_steps"] == trained[1]["root_steps"] and trained[1]["refine_steps"] == 3


def test_an_adopted_decoder_gets_an_encoder_again_and_teaches_another(pack: Path):
    """The encoder learns alone; a new decoder then learns from its tokens."""
    run, taught = pack / "encoded", pack / "taught"
    common = ["--cache", str(pack / "cache"), "--preset", "test"]
    short = ["--steps", "3", "--frames-per-step", "512", *common]
    assert main(["adopt", "--pack", str(pack / "human"), "--run", str(run), *common]) == 0
    assert main(["train", "encoder", "--run", str(run), *short]) == 0
    before, after = (read_checkpoint(run / f"{stage}.pt")["model"] for stage in ("tokenizer", "encoder"))
    moved = {name.split(".")[0] for name, value in after.items() if not torch.equal(value, before[name])}
    assert moved == {"encoder"}
    assert main(["train", "tokenizer", "--run", str(taught), "--teacher", str(run), *short]) == 0
    student, averaged = (
        read_checkpoint(taught / "tokenizer.pt")["model"],
        read_checkpoint(run / "encoder.pt")["average"],
    )
    parts = [name for name in student if name.split(".")[0] in ("encoder", "quantizer")]
    assert parts and all(torch.equal(student[name], averaged[name]) for name in parts)
    with pytest.raises(SystemExit, match="has its own encoder"):
        main(["train", "encoder", "--run", str(taught), *short])
