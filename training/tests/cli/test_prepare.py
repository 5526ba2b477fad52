"""What `prepare` and `unimogen prepare` say of a folder that they cannot use: a sentence each, and no traceback."""

from pathlib import Path

import numpy as np
import pytest

from data.test_gltf import write_rig
from troupe_training.cli.main import main

COMMANDS = (["prepare"], ["unimogen", "prepare", "--source"])
BVH = """HIERARCHY
ROOT {root}
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT {middle}
  {{
    OFFSET 0 90 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT {left}
    {{
      OFFSET 10 {length} 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site {{ OFFSET 0 -90 0 }}
    }}
    JOINT {right}
    {{
      OFFSET -10 {length} 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site {{ OFFSET 0 -90 0 }}
    }}
  }}
}}
MOTION
Frames: {frames}
Frame Time: 0.0333333
"""
NAMES = {"root": "Reference", "middle": "Hips", "left": "LeftFoot", "right": "RightFoot"}
READING = ["--unit", "cm", "--up", "y", "--root", "Reference"]


def write_bvh(path: Path, frames: int = 40, length: float = 0.0, **names: str) -> None:
    head = BVH.format(**NAMES | names, frames=frames, length=length)
    path.write_text(head + "".join(f"{nth} 0 0 0 0 0 0 0 0 {nth} 0 0 0 0 0\n" for nth in range(frames)))


def refused(command: list[str], folder: Path, *more: str) -> str:
    with pytest.raises(SystemExit) as caught:
        main([*command, str(folder), "--cache", str(folder.parent / "cache"), "--workers", "1", *more])
    assert isinstance(caught.value.code, str)
    return caught.value.code


@pytest.mark.parametrize("command", COMMANDS)
def test_folders_without_motion_are_refused(command: list[str], tmp_path: Path):
    folder = tmp_path / "motion"
    assert refused(command, folder).startswith(f"{folder} is no folder; give the folder of the .bvh, ")
    folder.mkdir()
    assert refused(command, folder).endswith(f" file under {folder}")
    np.save(folder / "walk.npy", np.zeros((30, 36)))
    assert refused(command, folder).endswith("; .npy files need their robot's --urdf")
    (folder / "walk.csv").write_text("1,2,3")
    assert refused(command, folder).endswith("; .csv and .npy files need their robot's --urdf")


@pytest.mark.parametrize("command", COMMANDS)
def test_files_that_are_no_motion_are_named(command: list[str], tmp_path: Path):
    folder = tmp_path / "motion"
    folder.mkdir()
    for name in ("a.bvh", "b.npz", "c.fbx"):
        (folder / name).write_text("no motion")
    assert "none of 3 files can be used, e.g. a.bvh: line 1" in refused(command, folder)
    assert "unit is" in refused(command, folder, "--unit", "mile")
    for path in folder.iterdir():
        path.unlink()
    (folder / "a.glb").write_text("no motion")
    assert "a.glb: no glTF" in refused(command, folder)


@pytest.mark.parametrize("command", COMMANDS)
def test_clips_of_one_frame_are_named(command: list[str], tmp_path: Path):
    folder = tmp_path / "motion"
    folder.mkdir()
    write_bvh(folder / "a.bvh", frames=1)
    assert "e.g. a.bvh: only 1 frames, at least 16 are needed" in refused(command, folder, *READING)


def test_a_rig_without_a_clip_is_named(tmp_path: Path):
    folder = tmp_path / "rigs"
    folder.mkdir()
    write_rig(folder / "toy.glb", ("Rest Pose",))
    error = refused(COMMANDS[1], folder)
    assert error.startswith(f"{folder / 'toy.glb'}: none of its 1 animations can be used: Rest Pose: the rest pose")
    assert "Its root is hips: --root decides" in error


@pytest.mark.parametrize("command", COMMANDS)
def test_hips_without_a_side_name_the_file_and_the_option(command: list[str], tmp_path: Path):
    folder = tmp_path / "motion"
    folder.mkdir()
    write_bvh(folder / "a.bvh")
    error = refused(command, folder, *READING)
    assert error.startswith(f"{folder}, skeleton of a.bvh: cannot tell the left from the right hip")
    assert error.endswith("--root decides; joints with a left and a right child: Hips")
    write_bvh(folder / "a.bvh", left="a", right="b")
    assert "rename the hips" in refused(command, folder, *READING)


@pytest.mark.parametrize("command", COMMANDS)
def test_files_of_different_bodies_are_refused(command: list[str], tmp_path: Path):
    folder = tmp_path / "motion"
    folder.mkdir()
    write_bvh(folder / "a.bvh")
    write_bvh(folder / "b.bvh", length=20.0)
    error = refused(command, folder, *READING)
    assert "e.g. a.bvh: a bone is 0.100 m off" in error and "a folder for each body" in error


def test_files_that_options_name_must_be_there(tmp_path: Path):
    assert "missing" in refused(["prepare"], tmp_path, "--cells", str(tmp_path / "missing"))
    assert "missing" in refused(["prepare"], tmp_path, "--urdf", str(tmp_path / "missing"))
    (tmp_path / "bodies.toml").write_text("body = 1")
    assert refused(["unimogen", "prepare", "--bodies"], tmp_path / "bodies.toml").endswith("'bodies' is missing")
