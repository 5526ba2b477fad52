"""Clips of several skeletons in one folder: squats, whose feet stand still."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import troupe_reader
from robot_support import biped as robot_urdf
from robot_support import walk_rows, write_rows
from troupe_training.cli.main import main
from troupe_training.data.joint_source import JointSource
from troupe_training.data.prepare import prepare
from troupe_training.data.retarget import RetargetSource
from troupe_training.data.skeleton import Skeleton

FRAMES = 40
# Part, the part that it hangs on, and its place there in centimetres.
PARTS = [
    ("pelvis", None, (0, 0, 0)),
    ("spine", "pelvis", (0, 20, 0)),
    ("neck", "spine", (0, 30, 0)),
    ("head", "neck", (0, 12, 0)),
    *[
        part
        for side, sign in (("left", 1), ("right", -1))
        for part in (
            (f"{side} arm", "spine", (sign * 18, 25, 0)),
            (f"{side} forearm", f"{side} arm", (sign * 28, 0, 0)),
            (f"{side} hand", f"{side} forearm", (sign * 25, 0, 0)),
            (f"{side} thigh", "pelvis", (sign * 9, 0, 0)),
            (f"{side} shin", f"{side} thigh", (0, -40, 0)),
            (f"{side} foot", f"{side} shin", (0, -40, 0)),
            (f"{side} toe", f"{side} foot", (0, -6, 12)),
        )
    ],
]
MIXAMO = {"pelvis": "Hips", "spine": "Spine", "neck": "Neck", "head": "Head"} | {
    f"{side} {part}": f"{side.title()}{name}"
    for side in ("left", "right")
    for part, name in [
        ("arm", "Arm"),
        ("forearm", "ForeArm"),
        ("hand", "Hand"),
        ("thigh", "UpLeg"),
        ("shin", "Leg"),
        ("foot", "Foot"),
        ("toe", "ToeBase"),
    ]
}
BLENDER = {part: part for part in ("pelvis", "spine", "neck", "head")} | {
    f"{side} {part}": f"{name}.{side[0].upper()}"
    for side in ("left", "right")
    for part, name in [("arm", "upper_arm")] + [(p, p) for p in ("forearm", "hand", "thigh", "shin", "foot", "toe")]
}


def hierarchy(names: dict[str, str], scale: float, part: str = "pelvis") -> str:
    offset = next(place for name, _, place in PARTS if name == part)
    place = " ".join(f"{scale * value:.3f}" for value in offset)
    position = "Xposition Yposition Zposition " if part == "pelvis" else ""
    channels = f"CHANNELS {6 if position else 3} {position}Zrotation Xrotation Yrotation"
    inside = "".join(hierarchy(names, scale, child) for child, above, _ in PARTS if above == part)
    kind = "ROOT" if part == "pelvis" else "JOINT"
    return f"{kind} {names[part]}\n{{\nOFFSET {place}\n{channels}\n{inside or 'End Site { OFFSET 0 0 0 }'}\n}}\n"


def write_squat(path: Path, names: dict[str, str], scale: float = 1.0, lift_cm: float = 0.0) -> None:
    """Bends the knees twice with arms half down; the feet stand still on the ground, or ``lift_cm`` over it."""
    lines = []
    for frame in range(FRAMES):
        bend = 20 * (1 - math.cos(4 * math.pi * frame / FRAMES))
        height = scale * (6 + 80 * math.cos(math.radians(bend))) + lift_cm
        turns = {"left arm": (-50, 0, 0), "right arm": (50, 0, 0)}
        for side in ("left", "right"):
            turns |= {f"{side} thigh": (0, -bend, 0), f"{side} shin": (0, 2 * bend, 0), f"{side} foot": (0, -bend, 0)}
        values = [0.0, height, 0.0]
        order = [part for part, _, _ in PARTS]
        for part in _depth_first(order[0]):
            values += turns.get(part, (0, 0, 0))
        lines.append(" ".join(f"{value:.5f}" for value in values))
    motion = f"MOTION\nFrames: {FRAMES}\nFrame Time: 0.0333333\n" + "\n".join(lines) + "\n"
    path.write_text("HIERARCHY\n" + hierarchy(names, scale) + motion)


def _depth_first(part: str) -> list[str]:
    below = [joint for child, above, _ in PARTS if above == part for joint in _depth_first(child)]
    return [part, *below]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two squats of one skeleton, two of a larger one, and a body without legs."""
    folder = tmp_path / "motion"
    folder.mkdir()
    write_squat(folder / "own_1.bvh", MIXAMO)
    write_squat(folder / "own_2.bvh", MIXAMO)
    write_squat(folder / "large_1.bvh", BLENDER, 1.2)
    write_squat(folder / "large_2.bvh", BLENDER, 1.2, lift_cm=30)
    crate = "ROOT crate\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    lid = "JOINT lid\n{\nOFFSET 0 90 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site { OFFSET 0 9 0 }\n}\n}\n"
    rows = "0 0 0 0 0 0 0 0 0\n" * FRAMES
    (folder / "crate.bvh").write_text(f"HIERARCHY\n{crate}{lid}MOTION\nFrames: {FRAMES}\nFrame Time: 0.0333333\n{rows}")
    return folder


def clips_of(cache: Path) -> dict[str, np.ndarray]:
    """World places by the names of clips."""
    positions = np.load(cache / "positions.npy")
    index = json.loads((cache / "clips.json").read_text())["clips"]
    return {clip["name"]: positions[clip["start"] : clip["start"] + clip["frames"]] for clip in index}


def test_clips_of_other_skeletons_are_brought_onto_one(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    arguments = ["prepare", str(folder), "--cache", str(tmp_path / "cache"), "--unit", "cm", "--up", "y"]
    carried = tmp_path / "carried"
    assert main([*arguments, "--retarget", "own_1.bvh", "--fit-ground", "--carried", str(carried)]) == 0
    printed = capsys.readouterr().out
    assert "carried over large_1.bvh (18 joints, as in large_1.bvh" in printed
    assert "dropped crate.bvh: no body is found among the joints" in printed
    about = json.loads((tmp_path / "cache" / "clips.json").read_text())
    assert set(about["carried"]) == {"large_1.bvh", "large_2.bvh"}
    figures = about["carried"]["large_2.bvh"]
    assert figures["faults"] == [] and figures["directions_deg"] < 2 and figures["skate_mps"] < 0.02
    assert figures["lift_m"] - about["carried"]["large_1.bvh"]["lift_m"] == pytest.approx(-0.3, abs=0.01)

    # Clips that have the skeleton are as they are without the others.
    for path in folder.glob("[lc]*.bvh"):
        path.unlink()
    prepare(folder, tmp_path / "own", JointSource(given={"unit": "cm", "up": "y"}))
    mixed, own = clips_of(tmp_path / "cache"), clips_of(tmp_path / "own")
    names = Skeleton.load(tmp_path / "cache" / "skeleton.json").names
    assert names == [MIXAMO[part] for part in _depth_first("pelvis")]
    for name in ("own_1.bvh", "own_2.bvh"):
        np.testing.assert_array_equal(mixed[name], own[name])
    assert sorted(path.name for path in carried.iterdir()) == ["large_1.bvh", "large_2.bvh"]
    written = troupe_reader.read(carried / "large_2.bvh", unit="cm", up="y").world()[0]
    np.testing.assert_allclose(written, mixed["large_2.bvh"], atol=1e-4)
    # The squat is the same, at the smaller body's size.
    np.testing.assert_allclose(mixed["large_2.bvh"][:, 0, 1], own["own_1.bvh"][:, 0, 1], atol=0.02)


def test_a_pack_gives_the_skeleton(folder: Path, tmp_path: Path):
    prepare(folder, tmp_path / "cache", RetargetSource(JointSource(given={"unit": "cm"}), "own_1.bvh"))
    skeleton = Skeleton.load(tmp_path / "cache" / "skeleton.json")
    pack = tmp_path / "pack.toml"

    def write(offsets: list[list[float]]) -> None:
        joints = "".join(
            f'[[skeleton.joints]]\nname = "{name}"\nparent = "{skeleton.names[parent] if parent >= 0 else ""}"\n'
            f"offset_m = {offset}\n"
            for name, parent, offset in zip(skeleton.names, skeleton.parents, offsets, strict=True)
        )
        pack.write_text(f"[skeleton]\nleft_axis = {skeleton.left_axis}\nground_y_m = 0.0\n{joints}")

    write(skeleton.offsets)
    for path in folder.glob("own_*.bvh"):
        path.unlink()
    prepare(folder, tmp_path / "other", RetargetSource(JointSource(given={"unit": "cm"}), str(pack)))
    assert Skeleton.load(tmp_path / "other" / "skeleton.json").names == skeleton.names
    # Bones along other axes stand by the rotations of their motion alone.
    write([[y, x, z] for x, y, z in skeleton.offsets])
    with pytest.raises(SystemExit, match=r"pack\.toml: .*no stance.*name a file of motion of the same skeleton"):
        prepare(folder, tmp_path / "other", RetargetSource(JointSource(given={"unit": "cm"}), str(pack)))
    pack.write_text("[skeleton]\n[robot]\n")
    with pytest.raises(SystemExit, match="needs its URDF"):
        prepare(folder, tmp_path / "other", RetargetSource(JointSource(), str(pack)))


def test_clips_beyond_the_bar_need_force(folder: Path, tmp_path: Path):
    (folder / "large_2.bvh").unlink()
    odd = (folder / "own_1.bvh").read_text()
    # Legs of 72 and 8 cm cannot fold as far as those of 40 and 40 cm do.
    for side in ("Left", "Right"):
        thigh, shin = f"JOINT {side}Leg\n{{\nOFFSET ", f"JOINT {side}Foot\n{{\nOFFSET "
        odd = odd.replace(f"{thigh}0.000 -40", f"{thigh}0.000 -72").replace(f"{shin}0.000 -40", f"{shin}0.000 -8")
    (folder / "odd.bvh").write_text(odd)
    (folder / "own_1.bvh").unlink()
    (folder / "own_2.bvh").unlink()
    to, reading = str(folder / "odd.bvh"), JointSource(given={"unit": "cm", "up": "y"})
    prepare(folder, tmp_path / "cache", RetargetSource(reading, to))
    about = json.loads((tmp_path / "cache" / "clips.json").read_text())
    assert about["dropped"]["large_1.bvh"].startswith("beyond the bar: ")
    assert about["dropped"]["large_1.bvh"].endswith("--force takes it all the same")
    prepare(folder, tmp_path / "forced", RetargetSource(reading, to, force=True))
    assert "large_1.bvh" in clips_of(tmp_path / "forced")


def test_clips_are_brought_onto_a_robot_beside_its_own(folder: Path, tmp_path: Path):
    robot = tmp_path / "toy.urdf"
    robot.write_text(robot_urdf())
    write_rows(folder / "walk.csv", walk_rows(60, 0.5, 0.0, 1.0))
    arguments = ["prepare", str(folder), "--cache", str(tmp_path / "cache"), "--workers", "1", "--unit", "cm"]
    assert main([*arguments, "--retarget", str(robot), "--force"]) == 0
    skeleton = Skeleton.load(tmp_path / "cache" / "skeleton.json")
    assert skeleton.robot is not None and len(skeleton.robot["hinges"]) == 9
    assert {"walk.csv", "own_1.bvh", "large_1.bvh"} <= set(clips_of(tmp_path / "cache"))


def test_options_that_need_a_skeleton_say_so(folder: Path, tmp_path: Path):
    with pytest.raises(SystemExit, match="they need --retarget"):
        main(["prepare", str(folder), "--cache", str(tmp_path / "cache"), "--fit-ground"])
    with pytest.raises(SystemExit, match="takes the place of --urdf"):
        main(["prepare", str(folder), "--cache", str(tmp_path / "cache"), "--urdf", "a.urdf", "--retarget", "a.urdf"])
    with pytest.raises(SystemExit, match=r"missing\.bvh"):
        main(["prepare", str(folder), "--cache", str(tmp_path / "cache"), "--retarget", "missing.bvh"])
