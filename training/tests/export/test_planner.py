"""The planner's file as a pack: what is written, and which files are refused.

``engine/tests/sonic_planner`` holds the pack of a small graph with random weights. `TROUPE_WRITE_FIGURES=1` writes it again.
"""

import hashlib
import os
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import ModelProto, TensorProto, helper

from planner_support import planner, write_planner
from troupe_training.cli.main import main
from troupe_training.data.bodies import Body, body_of
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import read_manifest
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError
from troupe_training.export.motionbricks.official.planner import (
    HINGES,
    MODES,
    body_like,
    read_planner,
    run_planner,
    standing_inputs,
)
from troupe_training.export.onnx import Session

ROOT = Path(__file__).parents[3]
FOLDER, G1 = ROOT / "engine" / "tests" / "sonic_planner", ROOT / "models" / "g1"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_planner(tmp_path_factory.mktemp("release"))


@pytest.fixture(scope="module")
def body() -> Body:
    """The robot with all hinges at 0, which takes no search for the pose that it stands in."""
    skeleton = Skeleton.of_manifest(read_manifest(G1))
    return body_of("g1", skeleton, np.tile(np.eye(3), (len(skeleton.names), 1, 1)))


@pytest.fixture(scope="module")
def pack(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("packs") / "g1-planner"
    (out / "bodies").mkdir(parents=True)
    (out / "bodies" / "old.toml").touch()  # of a pack that is there, and is replaced
    assert main(["import-motionbricks-planner", str(file), "--out", str(out), "--like", str(G1)]) == 0
    if os.environ.get("TROUPE_WRITE_FIGURES"):
        shutil.rmtree(FOLDER, ignore_errors=True)
        shutil.copytree(out, FOLDER)
    return out


def test_the_pack_has_the_file_its_modes_and_the_robot(file: Path, pack: Path):
    manifest, own = (tomllib.loads((folder / "pack.toml").read_text()) for folder in (pack, G1))
    assert (pack / "planner.onnx").read_bytes() == file.read_bytes()
    assert manifest["content_hash"] == f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}"
    assert (manifest["family"], manifest["name"], manifest["capabilities"]) == (
        "sonic_planner",
        "g1-planner",
        {"live": True},
    )
    assert manifest["licence"] == "NVIDIA Open Model License" and manifest["parameters"] > 27 * 29
    sizes = ("frames_per_token", "min_tokens", "max_tokens", "context_frames")
    assert [manifest[key] for key in sizes] == [4, 6, 16, 4]
    assert "onnx_check" not in manifest["training"] and "limits" not in manifest
    table = manifest["sonic_planner"]
    assert len(set(table["modes"])) == 27 and (table["modes"][0], table["modes"][26]) == ("idle", "scared")
    assert table["specific_target"] is False and set(table["walks"]) < set(table["modes"])
    assert [path.name for path in (pack / "bodies").iterdir()] == ["g1.toml"]
    body = tomllib.loads((pack / "bodies" / "g1.toml").read_text())
    assert body["robot"] == manifest["robot"] == own["robot"] and body["words"] == table["modes"]
    assert body["skeleton"] == manifest["skeleton"] and 0.7 < body["height_m"] < 0.85


def test_the_stored_pack_is_the_one_that_is_written(pack: Path, body: Body):
    for name in ("pack.toml", "bodies/g1.toml"):
        stored, made = ((folder / name).read_text().splitlines() for folder in (FOLDER, pack))
        assert [a for a, b in zip(stored, made, strict=True) if a != b and "content_hash" not in a] == []
    inputs = standing_inputs(body, 9)
    stored, made = (Session(folder / "planner.onnx").run(inputs)["mujoco_qpos"] for folder in (FOLDER, pack))
    np.testing.assert_allclose(stored, made, atol=1e-6)


def test_the_graph_that_stands_in_answers_to_each_input(file: Path, body: Body):
    session, inputs = Session(file), standing_inputs(body, 9)

    def qpos(**changed: object) -> np.ndarray:
        arrays = {name: changed.get(name, tensor.numpy()) for name, tensor in inputs.items()}
        made, frames = session.session.run(None, arrays)
        return np.asarray(made[0, : int(frames)])

    def floats(*values: float) -> np.ndarray:
        return np.array(values, np.float32)

    plain = qpos()
    assert plain.shape == (36, 36)
    np.testing.assert_allclose(plain[-1, :2], [32 / 30, 0.0], atol=1e-5)
    np.testing.assert_allclose(plain[:4], inputs["context_mujoco_qpos"][0], atol=1e-6)
    assert abs(qpos(target_vel=floats(0.5))[-1, 0] - 16 / 30) < 1e-5
    assert abs(qpos(target_vel=floats(-1.0))[-1, 0] - 0.1 * 32 / 30) < 1e-5  # the mode's own speed
    assert abs(qpos(movement_direction=floats(0, 1, 0)[None])[-1, 1] - 32 / 30) < 1e-5
    half = np.sqrt(0.5)
    np.testing.assert_allclose(qpos(facing_direction=floats(0, -2, 0)[None])[-1, 3:7], [half, 0, 0, -half], atol=1e-5)
    assert np.abs(qpos(mode=np.array([24]))[-1, 7:] - plain[-1, 7:]).max() > 0.01
    assert np.abs(qpos(random_seed=np.array([99]))[-1, 7:] - plain[-1, 7:]).max() > 0.01
    assert abs(qpos(height=floats(0.5))[-1, 2] - 0.5) < 1e-6
    allowed = np.eye(11, dtype=np.int64)[10:]
    assert qpos(allowed_pred_num_tokens=allowed).shape == (64, 36)
    targets = {
        "specific_target_positions": np.full((1, 4, 3), 2.0, np.float32),
        "specific_target_headings": np.full((1, 4), np.pi / 2, np.float32),
    }
    np.testing.assert_array_equal(qpos(**targets), plain)
    there = qpos(**targets, has_specific_target=np.array([[1]]))
    np.testing.assert_allclose(there[-1, :2], [2.0, 2.0], atol=1e-5)
    np.testing.assert_allclose(there[-1, 3:7], [half, 0, 0, half], atol=1e-5)


def without(kind: str, name: str) -> Callable[[ModelProto], None]:
    def change(model: ModelProto) -> None:
        values = getattr(model.graph, kind)
        values.remove(next(value for value in values if value.name == name))

    return change


def other(kind: str, name: str, element: int, shape: list[int | str] | None) -> Callable[[ModelProto], None]:
    def change(model: ModelProto) -> None:
        value = next(value for value in getattr(model.graph, kind) if value.name == name)
        value.CopyFrom(helper.make_tensor_value_info(name, element, shape))

    return change


def one_more(model: ModelProto) -> None:
    model.graph.input.append(helper.make_tensor_value_info("terrain", TensorProto.FLOAT, [1, 8]))


F32, I32, I64 = TensorProto.FLOAT, TensorProto.INT32, TensorProto.INT64


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("input", "height"), r"the input height is missing; allowed: float32 \[1\]"),
        (
            without("output", "num_pred_frames"),
            r"output num_pred_frames is missing; allowed: int64 or int32 \[\] or \[1\]",
        ),
        (other("input", "mode", I32, [1]), r"the input mode is int32 \[1\]; allowed: int64 \[1\]"),
        (
            other("input", "context_mujoco_qpos", F32, [1, 4, 30]),
            r"the input context_mujoco_qpos is float32 \[1, 4, 30\]; allowed: float32 \[1, 4, 36\]",
        ),
        (other("input", "target_vel", F32, ["batch"]), r"target_vel is float32 \[any\]; allowed: float32 \[1\]"),
        (
            other("input", "has_specific_target", I64, [1]),
            r"has_specific_target is int64 \[1\]; allowed: int64 \[1, 1\]",
        ),
        (other("input", "allowed_pred_num_tokens", I64, [1, 14]), r"allowed_pred_num_tokens is int64 \[1, 14\]"),
        (
            other("output", "mujoco_qpos", F32, [1, 32, 36]),
            r"mujoco_qpos is float32 \[1, 32, 36\]; allowed: .* \[1, any, 36\]",
        ),
        (other("output", "mujoco_qpos", F32, None), r"mujoco_qpos is float32 of any rank"),
        (other("output", "num_pred_frames", F32, []), r"num_pred_frames is float32 \[\]; allowed: int64 or int32"),
        (one_more, r"the input terrain is unknown; allowed: context_mujoco_qpos, target_vel"),
    ],
)
def test_another_signature_is_refused_by_name(tmp_path: Path, change: Callable[[ModelProto], None], message: str):
    model = planner()
    change(model)
    onnx.save(model, tmp_path / "planner_sonic.onnx")
    with pytest.raises(ReleaseError, match=message):
        read_planner(tmp_path / "planner_sonic.onnx")
    with pytest.raises(SystemExit, match=message):
        main(["import-motionbricks-planner", str(tmp_path / "planner_sonic.onnx"), "--out", str(tmp_path / "p")])
    assert not (tmp_path / "p").exists()


def test_frames_may_be_counted_in_32_bits_and_their_axis_open(tmp_path: Path, body: Body):
    model = planner()
    other("output", "mujoco_qpos", F32, [1, "frames", 36])(model)
    nodes = model.graph.node
    counted = next(node for node in nodes if node.output[0] == "num_pred_frames")
    counted.output[0] = "counted"
    nodes.append(helper.make_node("Cast", ["counted"], ["num_pred_frames"], to=I32))
    other("output", "num_pred_frames", I32, [])(model)
    onnx.save(model, tmp_path / "p.onnx")
    assert read_planner(tmp_path / "p.onnx") > 27 * 29
    assert run_planner(tmp_path / "p.onnx", body) == [24, 36, 64]


def test_files_that_are_no_planner_name_the_way_on(tmp_path: Path):
    path = tmp_path / "planner_sonic.onnx"
    with pytest.raises(ReleaseError, match="is no file"):
        read_planner(path)
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    with pytest.raises(ReleaseError, match="git lfs pull"):
        read_planner(path)
    path.write_bytes(b"\xff" * 64)
    with pytest.raises(ReleaseError, match="is no ONNX file"):
        read_planner(path)
    onnx.save(planner(), path, save_as_external_data=True, location="weights", size_threshold=0)
    with pytest.raises(ReleaseError, match="lie in another file"):
        read_planner(path)


def test_a_graph_that_answers_otherwise_is_refused(tmp_path: Path, body: Body):
    model = planner()
    for weights in model.graph.initializer:
        if list(onnx.numpy_helper.to_array(weights).flatten()) == [4]:  # frames of a token
            weights.CopyFrom(onnx.numpy_helper.from_array(np.array([5]), weights.name))
            break
    onnx.save(model, tmp_path / "p.onnx")
    with pytest.raises(ReleaseError, match=r"num_pred_frames is 30.* for 6 tokens; allowed: 24"):
        run_planner(tmp_path / "p.onnx", body)


def test_another_robot_is_refused(tmp_path: Path):
    assert len(HINGES) == 29 and len(MODES) == 27
    with pytest.raises(ReleaseError, match="has no robot; allowed: a pack of the G1"):
        body_like(G1.with_name("human"))
    text = (G1 / "pack.toml").read_text()
    (tmp_path / "pack.toml").write_text(text.replace('joint = "left_knee"', 'joint = "left_toe"'))
    with pytest.raises(ReleaseError, match="hinge 3 is left_toe; allowed: left_knee"):
        body_like(tmp_path)
