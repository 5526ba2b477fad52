"""Packs with random weights: they have the contract of trained ones, and the paper's sizes."""

import tomllib
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from troupe_training.cli.main import main
from troupe_training.export.motionbricks.random_pack import random_networks
from troupe_training.models.motionbricks.config import PRESETS

DEFAULT_PACK = Path(__file__).parents[3] / "models" / "human"


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("packs") / "random"
    assert main(["random-pack", "--preset", "test", "--out", str(out), "--like", str(DEFAULT_PACK)]) == 0
    return out


def test_it_has_the_tensors_of_the_pack_it_is_made_like(pack: Path):
    heads = PRESETS["test"].heads
    for stage in ("root", "pose", "decoder"):
        random, trained = (
            onnxruntime.InferenceSession(folder / f"{stage}.onnx", providers=["CPUExecutionProvider"])
            for folder in (pack, DEFAULT_PACK)
        )
        # The trained pack's roots have a choice; random ones have none.
        wanted = [i for i in trained.get_inputs() if i.name != "root_noise"]
        for ours, theirs in zip(random.get_inputs(), wanted, strict=True):
            assert (ours.name, ours.type) == (theirs.name, theirs.type)
            assert ours.shape == ([*theirs.shape[:2], heads] if ours.name == "tokens" else theirs.shape)
        assert [o.name for o in random.get_outputs()] == [o.name for o in trained.get_outputs()]


def test_its_manifest_says_what_it_is(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    trained = tomllib.loads((DEFAULT_PACK / "pack.toml").read_text())
    assert manifest["skeleton"] == trained["skeleton"]
    assert manifest["name"] == "random" and "random weights" in manifest["credits"][0]
    assert manifest["training"]["preset"] == "test"


def test_its_rotations_are_usable(pack: Path):
    session = onnxruntime.InferenceSession(pack / "decoder.onnx", providers=["CPUExecutionProvider"])
    rng = np.random.default_rng(3)
    inputs = {
        "tokens": rng.integers(0, 16, (2, 5, 2)),
        "num_tokens": np.array([5, 3]),
        "global_root": np.tile(np.float32([0, 0.9, 0, 1, 0]), (2, 20, 1)),
        "frame_pose": np.zeros((2, 20, 189), np.float32),
        "frame_mask": np.zeros((2, 20), np.float32),
    }
    columns = session.run(["rotations"], inputs)[0].reshape(-1, 2, 3)
    # The reader orthonormalises them, which is only sound where neither is short and they are well
    # apart.
    lengths = np.linalg.norm(columns, axis=-1)
    cosines = (columns[:, 0] * columns[:, 1]).sum(-1) / lengths.prod(-1)
    assert lengths.min() > 0.5 and np.abs(cosines).max() < 0.5


def test_the_paper_preset_has_the_papers_parameters():
    """Section 7.4: 150 M for the pose module, 50 M for the root module, 23.5 M for encoder and decoder together."""
    counts = random_networks(PRESETS["paper"], 21, 4).parameters()
    assert counts["pose"] == pytest.approx(150e6, rel=0.06)
    assert counts["root"] == pytest.approx(50e6, rel=0.06)
    assert counts["encoder"] + counts["decoder"] == pytest.approx(23.5e6, rel=0.08)
