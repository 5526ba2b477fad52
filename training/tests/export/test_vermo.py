"""VerMo's packs: the contract of files, hash and graphs, and the reference that a server is compared with."""

import hashlib
import json
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from troupe_training.cli.main import main
from troupe_training.models.vermo.pieces import Pieces

DEFAULT_PACK = Path(__file__).parents[3] / "models" / "human"


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("packs") / "random"
    reference = str(out.with_suffix(".json"))
    assert main(["vermo", "random-pack", "--out", str(out), "--like", str(DEFAULT_PACK), "--reference", reference]) == 0
    return out


def session(pack: Path, name: str) -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(pack / f"{name}.onnx", providers=["CPUExecutionProvider"])


def test_the_manifest_says_what_a_server_goes_by(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    assert manifest["family"] == "vermo" and manifest["format"] == 2
    assert manifest["capabilities"] == {"text": True, "describe": True, "agents": True}
    assert (manifest["frames_per_token"], manifest["context_frames"], manifest["max_tokens"]) == (4, 16, 64)
    digest = hashlib.sha256()
    for name in ("language.onnx", "encoder.onnx", "decoder.onnx", "flow.onnx", "tokenizer.json"):
        digest.update((pack / name).read_bytes())
    assert manifest["content_hash"] == f"sha256:{digest.hexdigest()}"
    assert sum(file.stat().st_size for file in pack.iterdir()) < 1_000_000
    expected = manifest["vermo"]
    assert expected["text_pieces"] == Pieces.read(pack / "tokenizer.json").count
    width = session(pack, "language").get_outputs()[0].shape[1]
    assert width == 18 + 64 + expected["text_pieces"] + expected["motion_codes"] + expected["audio_codes"]
    assert "walks" in (pack / "words.txt").read_text().split()
    # Its replies are compared with unguided ones.
    assert "style_guidance" not in expected and not (pack / "styles.txt").exists()


def test_a_cache_of_any_size_answers_as_pytorch_without_one(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())["vermo"]
    model, compared = session(pack, "language"), 0
    for expected in json.loads(pack.with_suffix(".json").read_text())["messages"]:
        prompt, reply = expected["prompt"], expected["reply"]
        shape = (1, manifest["layers"], 2, manifest["key_heads"], manifest["positions"], manifest["head_width"])
        cache = np.zeros(shape, np.float32)
        inputs = {
            "tokens": np.array([[*prompt, 0, 0]]),
            "count": np.array([len(prompt)]),
            "start": np.array([0]),
            "cache": cache[..., :1, :],
        }
        logits, columns = model.run(None, inputs)
        if "logits" in expected:
            compared += 1
            assert np.abs(logits[0] - expected["logits"]).max() < 1e-3
        cache[..., : len(prompt), :] = columns[..., : len(prompt), :]
        place = len(prompt)
        for token, following in pairwise(reply):
            inputs = {"tokens": np.array([[token]]), "count": np.array([1]), "start": np.array([place]), "cache": cache}
            logits, columns = model.run(None, inputs)
            cache[..., place : place + 1, :] = columns
            place += 1
            kind = logits[0, _span_of(following, manifest)]
            assert following < 18 or logits[0, following] > kind.max() - 1e-3
    assert compared == 2


def _span_of(token: int, expected: dict[str, int]) -> slice:
    first = 18 + 64
    for count in (expected["text_pieces"], expected["motion_codes"], expected["audio_codes"]):
        if token < first + count:
            return slice(first, first + count)
        first += count
    raise ValueError(token)


def test_frames_and_tokens_are_those_of_the_reference(pack: Path):
    expected = json.loads(pack.with_suffix(".json").read_text())
    motion = {name: np.array(expected["encoder"][name], np.float32) for name in ("pose", "root")}
    tokens = session(pack, "encoder").run(None, motion)[0]
    assert tokens.tolist() == expected["encoder"]["tokens"] and len(set(tokens[0].tolist())) > 1
    pose, root = session(pack, "decoder").run(None, {"tokens": tokens})
    assert np.abs(pose - expected["decoder"]["pose"]).max() < 1e-3
    assert np.abs(root - expected["decoder"]["root"]).max() < 1e-3
    assert root[0, 0, [0, 2, 4]].tolist() == [0.0, 0.0, 0.0]


def test_a_flow_step_is_the_state_and_a_share_of_a_velocity(pack: Path):
    rng = np.random.default_rng(1)
    inputs = {
        "tokens": np.array([[5, 9]]),
        "state": rng.standard_normal((1, 8, 130), np.float32),
        "time": np.float32([0.5]),
        "delta": np.float32([0.1]),
    }
    flow = session(pack, "flow")
    inputs["state"] = rng.standard_normal((1, 8, flow.get_inputs()[1].shape[2]), np.float32)
    once = flow.run(None, inputs)[0] - inputs["state"]
    twice = flow.run(None, inputs | {"delta": np.float32([0.2])})[0] - inputs["state"]
    assert np.abs(once).max() > 1e-3 and np.allclose(twice, 2 * once, atol=1e-5)
