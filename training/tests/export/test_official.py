"""The public MotionBricks release as a pack: what is written, and which files are refused."""

import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch
import yaml

from release_support import G1, folder_of, write_release
from troupe_training.cli.main import main
from troupe_training.export.motionbricks.official import pack as official
from troupe_training.export.motionbricks.official.check import random_request
from troupe_training.export.motionbricks.official.checkpoints import Ignored, ReleaseError, read_state, read_tensors
from troupe_training.export.motionbricks.official.pack import skeleton_of
from troupe_training.export.motionbricks.official.release import Configuration, Release
from troupe_training.export.motionbricks.official.styles import MODES
from troupe_training.export.onnx import largest_of
from troupe_training.models.motionbricks.official.weights import WeightsError

STAGES = ("root", "pose", "decoder")


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_release(tmp_path_factory.mktemp("release"))
    out = tmp_path_factory.mktemp("packs") / "g1-official"
    assert main(["import-motionbricks", str(folder), "--out", str(out), "--like", str(G1)]) == 0
    return out


def test_a_pack_has_the_tensors_of_the_contract(pack: Path):
    for stage in STAGES:
        made, own = (
            onnxruntime.InferenceSession(folder / f"{stage}.onnx", providers=["CPUExecutionProvider"])
            for folder in (pack, G1)
        )
        wanted = [i for i in own.get_inputs() if i.name != "root_noise"]
        for ours, theirs in zip(made.get_inputs(), wanted, strict=True):
            shape = [11 if size == 14 else size for size in theirs.shape]
            shape = [*shape[:2], 2] if ours.name == "tokens" else shape
            assert (ours.name, ours.type) == (theirs.name, theirs.type)
            # Open axes may have any names.
            assert [s for s in ours.shape if isinstance(s, int)] == [s for s in shape if isinstance(s, int)]
            assert len(ours.shape) == len(shape)
        assert [o.name for o in made.get_outputs()] == [o.name for o in own.get_outputs()]


def test_its_manifest_has_the_release_and_the_robot(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    own = tomllib.loads((G1 / "pack.toml").read_text())
    assert manifest["licence"] == "NVIDIA Open Model License" and manifest["name"] == "g1-official"
    sizes = ("min_tokens", "max_tokens", "heads", "codes", "context_frames", "max_targets")
    assert [manifest[key] for key in sizes] == [6, 16, 2, 3, 4, 4]
    assert manifest["robot"] == own["robot"]
    assert [j["name"] for j in manifest["skeleton"]["joints"]] == [j["name"] for j in own["skeleton"]["joints"]]
    assert "limits" not in manifest  # the release's motion is not public


def test_its_styles_are_the_clips(pack: Path):
    styles = {path.stem: json.loads(path.read_text()) for path in (pack / "styles").glob("*.json")}
    assert set(styles) == {mode.style for mode in MODES}
    normal, zombie = styles["normal"], styles["zombie"]
    assert [gait["name"] for gait in normal["gaits"]] == ["idle", "slow", "walk", "left", "right"]
    assert normal["default_speed"] == 1.0 and normal["gaits"][3]["left"] == 0.2
    assert zombie["allowed_token_counts"] == [6, 7, 8, 9, 10, 11] and styles["boxing"]["allowed_token_counts"] == []
    gait = zombie["gaits"][0]
    assert gait["key_count"] == 12 and gait["period_frames"] == 20.0 and gait["keys"][0]["height"] == 0.6
    # The clips face to the left, and a key is without its heading.
    assert np.allclose(np.abs(gait["keys"][5]["rotations"]), [1, 0, 0, 0] * 34, atol=1e-4)


@pytest.mark.parametrize(("values", "largest"), [([0.5, -2.0], 2.0), ([0.5, float("nan")], float("inf"))])
def test_a_number_that_is_none_is_no_small_difference(values: list[float], largest: float):
    assert largest_of(torch.tensor(values)) == largest


def test_without_clips_it_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(official, "write_pack", lambda *_: {})
    folder = write_release(tmp_path / "release", clips=False)
    assert main(["import-motionbricks", str(folder / "out"), "--out", str(tmp_path / "p"), "--like", str(G1)]) == 0
    said = capsys.readouterr().out
    assert "G1-clip.ckpt is missing" in said
    assert "sets of at least 20 frames" in said


def test_skills_that_are_too_short_are_those_of_the_page(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    least = manifest["min_tokens"] * manifest["frames_per_token"] - manifest["context_frames"]
    skills = {path.stem: tomllib.loads(path.read_text()) for path in (G1 / "skills").glob("*.toml")}
    frames = {name: [s["frames"] for s in skill["sets"] if "frames" in s] for name, skill in skills.items()}
    assert least == 20 and {name for name, sets in frames.items() if min(sets) >= least} == {"lie-down"}


def test_a_pointer_of_git_lfs_names_the_way_on(tmp_path: Path):
    path = tmp_path / "model.ckpt"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    with pytest.raises(ReleaseError, match="git lfs pull"):
        read_state(path)
    path.write_bytes(b"no checkpoint")
    with pytest.raises(ReleaseError, match="is no checkpoint"):
        read_state(path)


class Planted:
    """Runs a command if it is unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> Any:
        return (Path.touch, (self.path,))


def test_nothing_that_a_checkpoint_names_is_run(tmp_path: Path):
    path, touched = tmp_path / "model.ckpt", tmp_path / "touched"
    weights = {"a": torch.arange(3.0), "b": torch.nn.Parameter(torch.ones(2, 2))}
    torch.save({"state_dict": weights, "callbacks": Planted(touched), "optimizer": [np.float64(1)]}, path)
    content = read_tensors(path)
    assert isinstance(content["callbacks"], Ignored) and not touched.exists()
    assert read_state(path)["a"].tolist() == [0.0, 1.0, 2.0] and read_state(path)["b"].shape == (2, 2)
    assert pickle.dumps(Planted(touched))  # it would have


@pytest.mark.parametrize(
    ("model", "key", "value", "message"),
    [
        ("root", "model.args.use_hard_num_token_emb_for_root_prediction", False, "only True is supported"),
        ("pose", "model.args.max_tokens", 20, "only 16 is supported"),
        ("pose", "model.backbone_network.args.n_embd", None, "expected a whole number"),
        ("pose", "data.text_embeddings", "t5", "only None"),
        ("vqvae", "model.pose_vqvae_network.nb_code", 10, "no power of 2 heads"),
        ("vqvae", "skeleton.base_name", "smpl", "only 'g1skel34'"),
    ],
)
def test_other_networks_are_refused(tmp_path: Path, model: str, key: str, value: Any, message: str):
    path = folder_of(write_release(tmp_path), model) / "hparams.yaml"
    configuration = yaml.safe_load(path.read_text())
    *above, last = key.split(".")
    table = configuration
    for part in above:
        table = table[part]
    table[last] = value
    path.write_text(yaml.safe_dump(configuration))
    with pytest.raises(ReleaseError, match=message):
        Release.read(tmp_path)


def test_weights_and_statistics_must_fit(tmp_path: Path):
    folder = write_release(tmp_path)
    own = folder_of(folder, "pose")
    path = own / "checkpoints/model-step=2000000.ckpt"
    state = torch.load(path)["state_dict"]
    name = "backbone_net._proj_input.0.bias"
    for changed, message in (
        ({key: value for key, value in state.items() if key != name}, "has no backbone_net._proj_input.0.bias"),
        (state | {name: torch.zeros(3)}, "has the shape"),
    ):
        torch.save({"state_dict": changed}, path)
        with pytest.raises(WeightsError, match=message):
            Release.read(folder).networks()
    np.save(own / "stats/motion/mean.npy", np.zeros(418))
    with pytest.raises(ReleaseError, match="other statistics"):
        Release.read(folder)
    with pytest.raises(SystemExit, match="expected a checkout"):
        main(["import-motionbricks", str(tmp_path / "nothing"), "--out", str(tmp_path / "p")])


def test_another_robot_is_refused(tmp_path: Path):
    release = Release.read(write_release(tmp_path))
    release.offsets[4][1] += 0.1
    with pytest.raises(ReleaseError, match=r"left_knee is 0\.100 m elsewhere"):
        skeleton_of(release, G1)
    with pytest.raises(ReleaseError, match="is no pack of the G1"):
        skeleton_of(release, G1.with_name("human"))


def test_values_refer_to_others():
    values = {"a": {"b": 3, "c": "${a.b}", "d": "${oc.select:a.x,true}", "e": "${a.c}", "f": "${a.x}"}}
    configuration = Configuration(values, Path("x.yaml"))
    assert [configuration.get(f"a.{key}") for key in "bcdefg"] == [3, 3, True, 3, None, None]


def test_a_request_of_the_check_means_the_same_on_both_sides(tmp_path: Path):
    release = Release.read(write_release(tmp_path))
    skeleton, joints = skeleton_of(release, G1)
    request = random_request(skeleton, release.sizes, 9, torch.Generator().manual_seed(1))
    answered, root = request.released(joints), request.root_inputs()
    assert np.allclose(answered["positions"][:, 0], request.global_root[:, :3])
    assert np.allclose(request.global_root[3, [0, 2, 3, 4]], [0, 0, 1, 0], atol=1e-6)
    toe = joints.theirs.index(7)
    assert (
        np.allclose(answered["positions"][:, 7], request.positions[:, toe])
        and (answered["rotations"][:, 7] == np.eye(3)).all()
    )
    assert not answered["has_local_root"][3] and root["has_local_root"][0, 3] == 1
