"""Files of many dialects, with what the reader of the server makes of each: `motion/tests/shared_files.json`.

This package gives the same frames, or refuses the file and names what reads it. There is no third outcome.
"""

import base64
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import troupe
from conftest import ROOT
from troupe import rotation

SHARED = json.loads((ROOT / "motion" / "tests" / "shared_files.json").read_text())
FILES = {file["name"]: file for file in SHARED["files"]}
# What Troupe itself writes, and what people change in it without another meaning.
READ = {
    "plain.bvh",
    "byte_order_mark.bvh",
    "line_ends_of_windows.bvh",
    "rotations_x_y_z.bvh",
    "capital_position.bvh",
    "rate_24.bvh",
    "hips_without_length.bvh",
    "namespaces.bvh",
    "faces_back.bvh",
    "plain.csv",
    "byte_order_mark.csv",
    "blank_lines.csv",
}
WAY_ON = "`Clip.read` and `troupe clip convert`"


def written(name: str, folder: Path) -> Path:
    content = FILES[name]["content"]
    data = content["text"].encode() if "text" in content else base64.b64decode(content["base64"])
    (folder / name).write_bytes(data)
    return folder / name


def robot() -> troupe.Skeleton:
    tables = SHARED["robot"]
    joints = tables["skeleton"]["joints"]
    names = [joint["name"] for joint in joints]
    hinges = tuple(
        troupe.Hinge(
            hinge["joint"],
            names.index(hinge["joint"]),
            tuple(hinge["axis"]),
            tuple(hinge["rest"]),
            hinge["lower_rad"],
            hinge["upper_rad"],
            hinge["max_speed_rad_per_s"],
        )
        for hinge in tables["robot"]["hinges"]
    )
    return troupe.Skeleton(
        tuple(names),
        tuple(names.index(joint["parent"]) if joint["parent"] else -1 for joint in joints),
        np.array([joint["offset_m"] for joint in joints], np.float32),
        robot=troupe.Robot(tables["robot"]["name"], hinges),
    )


def clip_of(path: Path) -> troupe.Clip:
    return troupe.Clip.from_csv(path, robot()) if path.suffix == ".csv" else troupe.Clip.from_bvh(path)


def check(clip: troupe.Clip, name: str) -> None:
    """The clip is the reader's."""
    motion = SHARED["motions"][FILES[name]["reader"]["motion"]]
    frames, joints = len(clip), clip.skeleton.joint_count
    assert list(clip.skeleton.names) == motion["joints"] and list(clip.skeleton.parents) == motion["parents"]
    np.testing.assert_allclose(clip.skeleton.left_axis, motion["left_axis"], atol=1e-4)
    assert clip.fps == pytest.approx(motion["fps"], rel=5e-4)
    np.testing.assert_allclose(clip.root, np.reshape(motion["roots_m"], (frames, 3)), atol=1e-4)
    np.testing.assert_allclose(clip.skeleton.offsets[1:], np.reshape(motion["offsets_m"], (joints, 3))[1:], atol=1e-4)
    wanted = np.reshape(motion["rotations_wxyz"], (frames, joints, 4))
    assert np.degrees(rotation.angle_between(clip.rotations, wanted)).max() < 0.01


@pytest.mark.parametrize("name", FILES)
def test_each_file_is_read_as_the_reader_does_or_refused(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    if name in READ:
        check(clip_of(path), name)
        return
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        clip_of(path)
    assert str(caught.value).startswith(f"{name}: ") and WAY_ON in str(caught.value)


@pytest.mark.parametrize("name", FILES)
def test_the_reader_reads_each_file_if_it_is_installed(name: str, tmp_path: Path) -> None:
    pytest.importorskip("troupe_reader")
    path = written(name, tmp_path)
    skeleton = robot() if path.suffix == ".csv" else None
    if "motion" in FILES[name]["reader"]:
        clip = troupe.Clip.read(path, skeleton)
        check(clip, name)
        assert clip.info is not None and clip.info["file"].endswith(name)
        return
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        troupe.Clip.read(path, skeleton)
    assert str(caught.value).endswith(FILES[name]["reader"]["error"])


def test_what_a_file_leaves_open_may_be_given(tmp_path: Path) -> None:
    lies = troupe.Clip.from_bvh(written("lies.bvh", tmp_path), up="y")
    assert lies.world_positions()[:, :, 1].max() < 0.5
    metres = troupe.Clip.from_bvh(written("metres.bvh", tmp_path), units_per_metre=1)
    check(metres, "metres.bvh")
    z_up = written("z_up_with_targets_of_feet.bvh", tmp_path)
    assert troupe.Clip.from_bvh(z_up, up="y", units_per_metre=100).world_positions()[0, :, 1].max() < 1
    for options in ({"up": "y"}, {"units_per_metre": 100}):
        with pytest.raises(troupe.InvalidArgumentError, match="two feet and its head is not clear"):
            troupe.Clip.from_bvh(z_up, **options)


def test_without_the_reader_the_error_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "troupe_reader", None)
    with pytest.raises(troupe.FailedPreconditionError, match=r"pip install \./bindings/python"):
        troupe.Clip.read(written("plain.bvh", tmp_path))
