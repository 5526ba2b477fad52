import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import troupe_reader
from troupe_reader.options import FileOptions

ROOT = Path(__file__).parents[3]
BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftLeg
  {
    OFFSET 10 -90 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site { OFFSET 0 -5 0 }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 95 0 0 0 0 0 0 0
0 95 1 0 0 0 0 10 0
0 95 2 0 0 0 0 20 0
"""
# A leg leaves the hips.
SLIDING = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftLeg
  {
    OFFSET 10 0 0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT LeftFoot
    {
      OFFSET 0 -90 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site { OFFSET 0 -5 0 }
    }
  }
  JOINT RightLeg
  {
    OFFSET -10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT RightFoot
    {
      OFFSET 0 -90 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site { OFFSET 0 -5 0 }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 95 0 0 0 0 10 0 0 0 0 0 0 0 0 0 0 0 0 0 0
0 95 1 0 0 0 10 0 80 0 5 0 0 0 0 0 5 0 0 9 0
0 95 2 0 0 0 10 0 160 0 9 0 0 0 0 0 10 0 0 3 0
"""
OPTIONS = {"up": "y", "unit": "cm", "leading_pose": "keep"}


def skeleton() -> troupe_reader.Skeleton:
    return troupe_reader.Skeleton(["pelvis", "foot"], [-1, 0], [[0, 0, 0], [0, -1, 0]])


def test_a_file_and_its_bytes_give_the_same(tmp_path: Path):
    path = tmp_path / "walk.bvh"
    path.write_text(BVH)
    of_path = troupe_reader.read(path, **OPTIONS)
    of_bytes = troupe_reader.read(BVH.encode(), name="walk.bvh", **OPTIONS)
    assert len(of_path) == 3 and of_path.skeleton.names[0] == "Hips"
    np.testing.assert_array_equal(of_path.rotations, of_bytes.rotations)
    np.testing.assert_allclose(of_path.root_positions[:, 2], [0, 0.01, 0.02], atol=1e-6)
    report = of_path.report
    assert report is not None and report["format"]["value"] == "bvh" and report["unit_m"]["basis"] == "given"
    assert of_path.table()[0][0] == "format"


def test_errors_are_the_readers_own(tmp_path: Path):
    with pytest.raises(troupe_reader.ReadError, match=r"walk\.bvh: .*line 3"):
        troupe_reader.read(b"HIERARCHY\nROOT a\n{ OFFSET x 0 0", name="walk.bvh")
    with pytest.raises(FileNotFoundError, match="missing"):
        troupe_reader.read(tmp_path / "missing.bvh")
    with pytest.raises(ValueError, match="need a name"):
        troupe_reader.read(BVH.encode())
    with pytest.raises(TypeError, match='no option "ups"'):
        troupe_reader.read(BVH.encode(), name="walk.bvh", ups="y")
    with pytest.raises(ValueError, match="allowed: x, y, z"):
        troupe_reader.read(BVH.encode(), name="walk.bvh", up="w")


def test_errors_have_the_options_that_decide():
    with pytest.raises(troupe_reader.ReadError, match="--fps decides") as refused:
        troupe_reader.read(BVH.replace("0.0333333", "0").encode(), name="walk.bvh")
    assert refused.value.options == [{"option": "fps", "values": []}]
    assert pickle.loads(pickle.dumps(refused.value)).options == refused.value.options
    prop = BVH.replace("MOTION", "ROOT Prop\n{ OFFSET 0 0 0 CHANNELS 0 End Site { OFFSET 0 1 0 } }\nMOTION")
    with pytest.raises(troupe_reader.ReadError) as refused:
        troupe_reader.read(prop.encode(), name="walk.bvh")
    assert refused.value.options == [{"option": "root", "values": ["Hips", "Prop"]}]
    with pytest.raises(troupe_reader.ReadError) as refused:
        troupe_reader.read(b"HIERARCHY", name="walk.bvh")
    assert len(refused.value.options) == 0


def test_options_have_the_names_of_the_command_line():
    """Of `troupe clip info`, but for those that choose a skeleton or what is printed."""
    snapshot = ROOT / "cli" / "src" / "snapshots" / "troupe_cli__tests__help_of_clip_info.snap"
    section = re.search(r"^Clip files:$(.*?)^\S", snapshot.read_text() + "\nend", re.MULTILINE | re.DOTALL)
    assert section is not None
    flags = {flag.replace("-", "_") for flag in re.findall(r"^\s+--([a-z-]+)", section[1], re.MULTILINE)}
    assert {"max_slide", "unit", "joint_order"} <= flags <= set(FileOptions.__annotations__)


def test_the_advice_of_an_error_can_be_followed():
    with pytest.raises(troupe_reader.ReadError, match="--max-slide") as refused:
        troupe_reader.read(SLIDING.encode(), name="walk.bvh", **OPTIONS)
    assert refused.value.options == [{"option": "max_slide", "values": []}]
    clip = troupe_reader.read(SLIDING.encode(), name="walk.bvh", **OPTIONS, max_slide=2)
    assert clip.skeleton.names == ["Hips", "LeftLeg", "LeftFoot", "RightLeg", "RightFoot"]


def test_a_survey_notes_what_it_cannot_read(tmp_path: Path):
    (tmp_path / "wrong.bvh").write_text("HIERARCHY")
    (tmp_path / "notes.txt").write_text("no motion")
    agreement = troupe_reader.survey(tmp_path)
    assert list(agreement.refused) == [str(tmp_path / "wrong.bvh")]
    assert agreement.up is None and agreement.unit_m is None
    again = pickle.loads(pickle.dumps(agreement))
    assert again.refused == agreement.refused and again.up is None


def test_world_and_resampling_of_arrays():
    half = np.sqrt(0.5)
    rotations = np.zeros((3, 2, 4))
    rotations[..., 0] = 1
    rotations[2, 0] = [half, 0, 0, half]  # a quarter turn about Z: down becomes +X
    clip = troupe_reader.Clip(skeleton(), 60, [[0, 1, 0], [1, 1, 0], [2, 1, 0]], rotations)
    assert clip.report is None and clip.table() == []
    positions, turned = clip.world()
    np.testing.assert_allclose(positions[0, 1], [0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(positions[2, 1], [3, 1, 0], atol=1e-6)
    assert turned.shape == (3, 2, 4)
    halved = clip.resample(30)
    assert len(halved) == 2
    np.testing.assert_allclose(halved.root_positions[1], [2, 1, 0], atol=1e-6)


def test_a_skeleton_comes_back_from_its_tables():
    hinge = {"joint": "foot", "axis": [1, 0, 0], "rest": [1, 0, 0, 0]}
    limits = {"lower_rad": -1, "upper_rad": 1, "max_speed_rad_per_s": 9}
    robot = troupe_reader.Skeleton.of_tables(skeleton().table, {"name": "toy", "hinges": [hinge | limits]})
    assert robot.names == skeleton().names and robot.robot is not None and robot.robot["name"] == "toy"
    half = np.sqrt(0.5)
    pose = robot.pose([[1, 0, 0, 0]], [[np.pi / 2]])
    np.testing.assert_allclose(pose[0], [[1, 0, 0, 0], [half, half, 0, 0]], atol=1e-6)


def test_wrong_arrays_are_refused():
    with pytest.raises(ValueError, match=r"allowed: \[frames, 2, 4\]"):
        troupe_reader.Clip(skeleton(), 30, np.zeros((1, 3)), np.zeros((1, 3, 4)))
    with pytest.raises(ValueError, match="allowed: as many of each"):
        troupe_reader.Skeleton(["a"], [-1, 0], np.zeros((1, 3)))
    with pytest.raises(ValueError, match="no hinges"):
        skeleton().pose([[1, 0, 0, 0]], [[0.0]])


def walker(scale: float = 1.0) -> troupe_reader.Clip:
    """A body on two legs that stands with bent knees, then lifts its left leg."""
    joints = [
        ("Hips", -1, (0, 0, 0)),
        ("Spine", 0, (0, 0.2, 0)),
        ("Head", 1, (0, 0.4, 0)),
        ("LeftArm", 1, (0.18, 0.2, 0)),
        ("LeftForeArm", 3, (0.28, 0, 0)),
        ("LeftHand", 4, (0.25, 0, 0)),
        ("RightArm", 1, (-0.18, 0.2, 0)),
        ("RightForeArm", 6, (-0.28, 0, 0)),
        ("RightHand", 7, (-0.25, 0, 0)),
        ("LeftUpLeg", 0, (0.09, 0, 0)),
        ("LeftLeg", 9, (0, -0.4, 0)),
        ("LeftFoot", 10, (0, -0.4, 0)),
        ("RightUpLeg", 0, (-0.09, 0, 0)),
        ("RightLeg", 12, (0, -0.4, 0)),
        ("RightFoot", 13, (0, -0.4, 0)),
    ]
    names, parents, offsets = zip(*joints, strict=True)
    body = troupe_reader.Skeleton(names, parents, scale * np.array(offsets))
    rotations = np.zeros((3, len(joints), 4))
    rotations[..., 0] = 1
    for frame, lift in enumerate((0.0, 0.2, 0.4)):
        for joint, angle in (("LeftUpLeg", -0.3 - lift), ("LeftLeg", 0.6), ("RightUpLeg", -0.3), ("RightLeg", 0.6)):
            rotations[frame, names.index(joint)] = [np.cos(angle / 2), np.sin(angle / 2), 0, 0]
    return troupe_reader.Clip(body, 30, np.tile([0, 0.8 * scale * np.cos(0.3), 0], (3, 1)), rotations)


def test_a_clip_is_carried_over_to_another_body():
    clip, other = walker(), walker(1.5)
    made, figures = clip.retarget(other)
    assert made.skeleton.names == other.skeleton.names and made.report is None
    np.testing.assert_allclose(made.world()[0], 1.5 * clip.world()[0], atol=1e-3)
    assert figures["faults"] == [] and figures["directions_deg"] < 0.1
    body = troupe_reader.Figure(clip)
    assert body.leg_m == pytest.approx(0.8, abs=1e-3) and body.parts["left_leg"]["end"] == "LeftFoot"
    again, _ = clip.retarget(troupe_reader.Figure(other), body=body)
    np.testing.assert_array_equal(again.rotations, made.rotations)
    at_rest, _ = clip.retarget(other.skeleton)
    assert len(at_rest) == len(clip)


def test_a_clip_is_written_and_read(tmp_path: Path):
    clip = walker()
    clip.write(tmp_path / "walk.bvh")
    again = troupe_reader.read(tmp_path / "walk.bvh", **OPTIONS)
    np.testing.assert_allclose(again.world()[0], clip.world()[0], atol=1e-4)
    with pytest.raises(ValueError, match=r"walk\.fbx: .*allowed: \.bvh, \.glb"):
        clip.write(tmp_path / "walk.fbx")
    with pytest.raises(FileNotFoundError, match="missing"):
        clip.write(tmp_path / "missing" / "walk.bvh")


def test_parts_of_bodies_can_be_corrected(tmp_path: Path):
    clip, other = walker(), walker(1.5)
    parts = troupe_reader.Figure(clip).parts
    made, _ = clip.retarget(other, parts=parts, to_parts=parts)
    path = tmp_path / "parts.toml"
    path.write_text('trunk = ["Hips", "Spine"]\n')
    same, _ = clip.retarget(other, to_parts=path)
    np.testing.assert_allclose(same.rotations, made.rotations, atol=1e-6)
    path.write_text('trunk = ["Hips", "Tail"]\n')
    with pytest.raises(troupe_reader.RetargetError, match='trunk names "Tail"'):
        clip.retarget(other, to_parts=path)
    path.write_text("trunk =")
    with pytest.raises(ValueError, match=r"parts\.toml: "):
        clip.retarget(other, to_parts=path)


def test_bodies_that_do_not_go_together_are_refused(tmp_path: Path):
    with pytest.raises(troupe_reader.RetargetError, match="no body is found"):
        walker().retarget(skeleton())
    with pytest.raises(ValueError, match="body has another skeleton than the clip"):
        walker().retarget(walker(), body=troupe_reader.Figure(walker(1.5)))
    with pytest.raises(FileNotFoundError, match="missing"):
        walker().retarget(tmp_path / "missing.glb")
    (tmp_path / "walk.bvh").write_text(BVH)
    with pytest.raises(troupe_reader.RetargetError, match=r"walk\.bvh: no body is found"):
        walker().retarget(tmp_path / "walk.bvh")
