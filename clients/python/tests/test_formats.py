import json
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pygltflib
import pytest

import troupe
from conftest import ROOT, any_clip
from troupe import rotation


def same(a: troupe.Clip, b: troupe.Clip, angle: float = 1e-5, distance: float = 1e-5) -> None:
    assert a.skeleton.names == b.skeleton.names
    assert abs(a.fps - b.fps) < 1e-4
    assert np.abs(a.root - b.root).max() < distance
    assert rotation.angle_between(a.rotations, b.rotations).max() < angle


def test_bvh_comes_back(arm: troupe.Skeleton, tmp_path: Path) -> None:
    clip = any_clip(arm, 30)
    # Straight at the gimbal lock of Z X Y, too.
    clip.rotations[3, 1] = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    clip.to_bvh(tmp_path / "a.bvh")
    back = troupe.Clip.from_bvh(tmp_path / "a.bvh")
    assert back.skeleton.names == ("hips", "left", "hand", "right"), "depth first"
    same(back.on(arm), clip)
    assert np.abs(back.on(arm).world_positions() - clip.world_positions()).max() < 1e-4


def test_bvh_is_what_the_servers_own_tools_write(tmp_path: Path) -> None:
    walk = ROOT / "examples" / "walk.bvh"
    clip = troupe.Clip.from_bvh(walk)
    ours, theirs = clip.to_bvh(), walk.read_text()
    head, tail = ours.split("MOTION")
    assert head == theirs.split("MOTION")[0]
    numbers = np.array(tail.split()[5:], float)
    expected = np.array(theirs.split("MOTION")[1].split()[5:], float)
    # Angles of a rotation near its lock may differ by more than what they turn.
    assert np.median(np.abs(numbers - expected)) < 1e-4
    (tmp_path / "again.bvh").write_text(ours)
    same(troupe.Clip.from_bvh(tmp_path / "again.bvh"), clip)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "HIERARCHY"),
        ("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Wrotation } MOTION", "Wrotation"),
        ("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Zrotation }", "ends in the middle"),
        (
            "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Zrotation } MOTION Frames: 2 Frame Time: 1 5",
            "2 frames are declared",
        ),
        (
            "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Zrotation } MOTION Frames: 1 Frame Time: 0 5",
            "Frame Time is 0 s",
        ),
        ("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Zrotation } MOTION Frames: 1 Frame Time: 1 nan", "not finite"),
        (
            "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 0 } MOTION Frames: 999999999 Frame Time: 1",
            "no joint has channels",
        ),
        ("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 2 Zrotation zrotation }", "a channel of joint a stands twice"),
        ("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS " + 5000 * "9", "is no count"),
    ],
)
def test_errors_name_what_is_no_bvh(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.bvh").write_text(text)
    with pytest.raises(troupe.InvalidArgumentError, match=re.escape(message)) as caught:
        troupe.Clip.from_bvh(tmp_path / "a.bvh")
    assert caught.value.field == "bvh"


def test_a_clip_of_other_bones_is_refused(arm: troupe.Skeleton, robot: troupe.Skeleton) -> None:
    with pytest.raises(troupe.InvalidArgumentError, match="lacks joints of the skeleton: pelvis, hip"):
        any_clip(arm).on(robot)


def test_npz_has_named_arrays_and_comes_back(arm: troupe.Skeleton, tmp_path: Path) -> None:
    clip = any_clip(arm)
    clip.to_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive:
        assert archive["positions"].shape == (7, 4, 3)
        assert archive["quaternions"].shape == (7, 4, 4)
        assert archive["root"].shape == (7, 3)
        assert archive["fps"] == 30
        assert archive["joint_names"].tolist() == list(arm.names)
        assert np.array_equal(archive["positions"], clip.world_positions())
    back = troupe.Clip.from_npz(tmp_path / "a.npz")
    assert np.array_equal(back.rotations, clip.rotations) and np.array_equal(back.root, clip.root)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parents": [0, 0, 1, 1]}, "`parents` has 0 for hips; allowed: -1"),
        ({"parents": [3, -1, 1, 1]}, "`parents` has 3 for hips; allowed: -1"),
        ({"parents": [-1, 2, 1, 1]}, "`parents` has 2 for left; allowed: 0 to 0: parents come before"),
        ({"parents": [-1, -1, 1, 1]}, "`parents` has -1 for left"),
        ({"parents": [-1, 0, 0]}, "`parents` has the shape (3,); allowed: (4)"),
        ({"quaternions": np.zeros((7, 4, 4))}, "`quaternions` has one of length 0 in frame 0 for hips; allowed: 1"),
        ({"quaternions": np.ones((7, 3, 4))}, "`quaternions` has the shape (7, 3, 4); allowed: (7, 4, 4)"),
        ({"offsets": np.full((4, 3), 90.0)}, "`offsets` may not be in metres"),
        ({"offsets": np.full((4, 3), np.nan)}, "`offsets` has numbers that are not finite"),
        ({"root": np.full((7, 3), 1e9)}, "`root` is 1e+09 m from the origin"),
        ({"root": np.zeros((7, 2, 3))}, "`root` of many characters has the shape (7, 2, 3); allowed: (frames, 3)"),
        ({"root": np.zeros((0, 3))}, "`root` has the shape (0, 3)"),
        ({"fps": np.float32(0)}, "`fps` is 0; allowed: above 0"),
        ({"fps": np.array("30")}, "`fps` must have numbers"),
        ({"joint_names": ["hips", "left", "right", "left"]}, "two joints of `joint_names` have one name"),
        ({"joint_names": np.array([b"hips", b"a", b"b", b"c"])}, "`joint_names` must be a list of texts"),
        ({"joint_names": np.array(["hips", None, "b", "c"], object)}, "its arrays cannot be read"),
        ({"contacts": np.zeros((7, 1)), "contact_joints": ["no"]}, "`contact_joints` has names"),
        ({"fps": None, "parents": None}, "it lacks fps, parents"),
    ],
)
def test_npz_of_another_kind_is_refused(
    arm: troupe.Skeleton, tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    any_clip(arm).to_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive:
        arrays = dict(archive)
    arrays = {key: value for key, value in (arrays | changes).items() if value is not None}
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(troupe.InvalidArgumentError, match=re.escape(message)) as caught:
        troupe.Clip.from_npz(tmp_path / "b.npz")
    assert caught.value.field == "npz" and str(caught.value).startswith("b.npz: ")
    assert "`Clip.read` and `troupe clip convert`" in str(caught.value)


def test_what_is_no_whole_archive_is_refused(arm: troupe.Skeleton, tmp_path: Path) -> None:
    any_clip(arm).to_npz(tmp_path / "a.npz")
    whole = (tmp_path / "a.npz").read_bytes()
    broken = bytearray(whole)
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        inside = archive.getinfo("quaternions.npy").header_offset + 100
    broken[inside : inside + 60] = bytes(60)
    np.save(tmp_path / "one.npy", np.zeros(3))
    for data in (b"", b"HIERARCHY", whole[:1000], bytes(broken), (tmp_path / "one.npy").read_bytes()):
        (tmp_path / "b.npz").write_bytes(data)
        with pytest.raises(troupe.InvalidArgumentError, match=r"b\.npz: .*`troupe clip convert`"):
            troupe.Clip.from_npz(tmp_path / "b.npz")
    with pytest.raises(FileNotFoundError):
        troupe.Clip.from_npz(tmp_path / "missing.npz")


def test_csv_comes_back(robot: troupe.Skeleton, tmp_path: Path) -> None:
    root, rotations = robot.of_qpos(any_clip(robot, 20).to_qpos())
    clip = troupe.Clip(robot, 30.0, root, rotations)
    text = clip.to_csv(tmp_path / "a.csv")
    assert len(text.splitlines()) == 20 and all(line.count(",") == 8 for line in text.splitlines())
    same(troupe.Clip.from_csv(tmp_path / "a.csv", robot), clip, angle=1e-4)
    (tmp_path / "b.csv").write_text("1,2,3\n")
    with pytest.raises(troupe.InvalidArgumentError, match="3 columns; allowed: 9"):
        troupe.Clip.from_csv(tmp_path / "b.csv", robot)


def test_glb_is_read_by_another_library(arm: troupe.Skeleton, tmp_path: Path) -> None:
    clip = any_clip(arm)
    clip.to_glb(tmp_path / "a.glb")
    file = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    data = file.binary_blob()

    def values(index: int) -> np.ndarray:
        accessor = file.accessors[index]
        view = file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        return np.frombuffer(data, "<f4", accessor.count * width, view.byteOffset).reshape(-1, width)

    assert [node.name for node in file.nodes] == list(arm.names)
    assert file.nodes[0].children == [1, 2] and file.nodes[1].children == [3]
    animation = file.animations[0]
    tracks = {(c.target.node, c.target.path): animation.samplers[c.sampler] for c in animation.channels}
    assert len(tracks) == 5
    assert np.allclose(values(tracks[0, "translation"].output), clip.root)
    assert np.allclose(values(tracks[0, "translation"].input)[:, 0], np.arange(7) / 30)
    for joint in range(4):
        turns = values(tracks[joint, "rotation"].output)[:, [3, 0, 1, 2]]
        assert rotation.angle_between(turns, clip.rotations[:, joint]).max() < 1e-5
        assert (np.sum(turns[1:] * turns[:-1], axis=1) >= 0).all(), "no jump to the other sign"


def test_glb_chunks_fit(arm: troupe.Skeleton) -> None:
    data = any_clip(arm).to_glb()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    text = json.loads(data[20 : 20 + size])
    assert text["buffers"][0]["byteLength"] == len(data) - 28 - size


def test_a_page_needs_nothing_else_and_holds_the_motion(arm: troupe.Skeleton) -> None:
    import base64

    clip = any_clip(arm)
    page = clip.to_html("</script><b>")
    assert "http" not in page and "src=" not in page and "</script><b>" not in page
    found = re.search(r'id="motion">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    motion = json.loads(found[1])
    assert (motion["title"], motion["frames"], motion["fps"]) == ("</script><b>", 7, 30)
    held = np.frombuffer(base64.b64decode(motion["positions"]), "<f4").reshape(7, 1, 4, 3)
    assert np.array_equal(held[:, 0], clip.world_positions())
    assert clip._repr_html_().startswith("<iframe")


def test_joined_clips_are_one(arm: troupe.Skeleton) -> None:
    clip = any_clip(arm, 10)
    same(troupe.join_clips([clip[:4], clip[4:]]), clip)
