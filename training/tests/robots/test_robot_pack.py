"""From a robot's CSV files and its URDF to a pack in one command."""

import json
import tomllib
from pathlib import Path

import onnxruntime
import pytest

from robot_support import COLUMNS, write_robot
from troupe_training.cli.main import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_robot(tmp_path_factory.mktemp("robot") / "toy")


def command(folder: Path) -> list[str]:
    argv = ["pack", str(folder / "csv"), "--urdf", str(folder / "toy.urdf"), "--test-name", "subject5", "--mirror"]
    argv += ["--run", str(folder / "run"), "--out", str(folder / "pack"), "--name", "toy", "--preset", "test"]
    return [*argv, "--steps", "4", "--frames-per-step", "256", "--workers", "1", "--threads", "1"]


@pytest.fixture(scope="module")
def pack(folder: Path) -> Path:
    assert main(command(folder)) == 0
    return folder / "pack"


def test_the_pack_holds_the_robot(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    robot = manifest["robot"]
    assert robot["name"] == "toy"
    assert [hinge["joint"] for hinge in robot["hinges"]] == COLUMNS
    assert set(robot["hinges"][0]) == {"joint", "axis", "rest", "lower_rad", "upper_rad", "max_speed_rad_per_s"}
    joints = [j["name"] for j in manifest["skeleton"]["joints"]]
    assert joints == ["pelvis", *COLUMNS, "left_toe", "right_toe", "left_hand", "right_hand"]
    assert manifest["skeleton"]["left_axis"] == [1.0, 0.0, 0.0]
    assert manifest["training"]["clips"] == 12 and manifest["training"]["mirrored"] is True
    session = onnxruntime.InferenceSession(pack / "decoder.onnx", providers=["CPUExecutionProvider"])
    assert session.get_outputs()[0].shape[2] == len(joints)


def test_the_card_names_the_robot(pack: Path, tmp_path: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    report = {"content_hash": manifest["content_hash"], "clips": 4, "stride_frames": 20, "temperature": 0.0}
    path = tmp_path / "eval.json"
    path.write_text(json.dumps(report | {"pose_steps": 1, "gaps": [], "claims": []}))
    assert main(["card", "--pack", str(pack), "--evaluation", str(path)]) == 0
    card = (pack / "README.md").read_text()
    assert "14 joints of the robot toy, 9 of which are hinges" in card
    assert "12 clips" in card and "each as seen in a mirror" in card
    assert tomllib.loads((pack / "pack.toml").read_text())["robot"] == manifest["robot"]


def test_a_random_pack_like_it_is_of_the_same_robot(pack: Path, tmp_path: Path):
    argv = ["random-pack", "--preset", "test", "--out", str(tmp_path / "random"), "--like", str(pack)]
    assert main(argv) == 0
    random, trained = (tomllib.loads((p / "pack.toml").read_text()) for p in (tmp_path / "random", pack))
    assert random["robot"] == trained["robot"] and random["skeleton"] == trained["skeleton"]


def test_the_cache_is_not_used_for_other_options(pack: Path, folder: Path):
    argv = [a for a in command(folder) if a != "--mirror"]
    with pytest.raises(SystemExit, match="was made with mirror = True, not False"):
        main(argv)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--end-effector", "beak=neck:0,0,0"], 'no joint "neck"'),
        (["--include", "swim"], "has a name that fits 'swim'"),
        (["--scale", "0.01"], "--scale is for BVH files"),
    ],
)
def test_options_that_do_not_fit_are_refused(folder: Path, tmp_path: Path, more: list[str], message: str):
    argv = ["prepare", str(folder / "csv"), "--urdf", str(folder / "toy.urdf"), "--cache", str(tmp_path)]
    with pytest.raises(SystemExit, match=message):
        main(argv + more)


def test_csv_files_need_their_urdf(folder: Path, tmp_path: Path):
    with pytest.raises(SystemExit, match=r"\.csv files need their robot's --urdf"):
        main(["prepare", str(folder / "csv"), "--cache", str(tmp_path)])
