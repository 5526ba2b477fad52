"""Robots: URDFs, motion files, kinematics, and what is said where they do not fit."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
import torch

import troupe_reader
from robot_support import COLUMNS, ball, biped, coupled, coupled_rows, joint, link, walk_rows, write_rows
from troupe_reader import ReadError
from troupe_training.cli.main import main
from troupe_training.data.bodies import Body, body_of
from troupe_training.data.clips import headings
from troupe_training.data.mirror import MirrorError, mirror_of
from troupe_training.data.neutral import robot_neutral
from troupe_training.data.prepare import Choice, file_name, files_of, load_all, prepare
from troupe_training.data.rotations import matrix_to_quat, six_d_to_matrix
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import ClipStore
from troupe_training.export.manifest import skeleton_lines
from troupe_training.robots.build import build_robot, describe
from troupe_training.robots.hinges import Hinges
from troupe_training.robots.source import RobotSource

STRAIGHT = [0.0] * 9


def robot_of(tmp_path: Path, text: str, end_effectors: list[str] | None = None, contacts: list[str] | None = None):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    return build_robot(describe(path, end_effectors or []), contacts)


def pose_of(tmp_path: Path, row: list[float]) -> tuple[np.ndarray, np.ndarray]:
    motion = RobotSource(tmp_path / "robot.urdf").load(write_rows(tmp_path / "one.csv", [row]))
    return motion.positions[0], motion.rotations[0]


def test_joints_columns_and_end_effectors_come_from_the_urdf(tmp_path: Path):
    robot = robot_of(tmp_path, biped())
    assert robot.names == ["pelvis", *COLUMNS, "left_toe", "right_toe", "left_hand", "right_hand"]
    assert robot.columns[7:] == COLUMNS
    assert robot.contacts == ["left_ankle", "left_toe", "right_ankle", "right_toe"]
    table = robot.table()
    assert table["name"] == "toy"
    knee = table["hinges"][1]
    # Pitch about ROS's +Y is a turn about native +X.
    assert knee["joint"] == "left_knee" and knee["axis"] == [1.0, 0.0, 0.0]
    assert knee["rest"] == pytest.approx([math.cos(0.1), math.sin(0.1), 0, 0])
    assert (knee["lower_rad"], knee["upper_rad"], knee["max_speed_rad_per_s"]) == (-0.2, 2.5, 20.0)


def test_forward_kinematics_by_hand(tmp_path: Path):
    robot = robot_of(tmp_path, biped())
    at = dict(zip(robot.names, pose_of(tmp_path, [1, 2, 3, 0, 0, 0, 1, *STRAIGHT])[0], strict=True))
    # Standing straight: native is (y, z, x) of ROS's axes.
    assert at["left_knee"] == pytest.approx([2.1, 2.6, 1.0])
    assert at["left_ankle"] == pytest.approx([2.1, 2.2, 1.0])
    assert at["left_toe"] == pytest.approx([2.1, 2.15, 1.15])
    assert at["right_hand"] == pytest.approx([1.79, 2.9, 1.0])
    # Turned left by 90 degrees, left hip raised by 90 degrees, knee bent by 90: the thigh points
    # along +Y, the shin down.
    half = math.sqrt(0.5)
    angles = [-math.pi / 2, math.pi / 2, *STRAIGHT[2:]]
    positions, rotations = pose_of(tmp_path, [0, 0, 1, 0, 0, half, half, *angles])
    at = dict(zip(robot.names, positions, strict=True))
    assert at["left_hip"] == pytest.approx([0.0, 1.0, -0.1], abs=1e-6)
    assert at["left_knee"] == pytest.approx([0.4, 1.0, -0.1], abs=1e-6)
    assert at["left_ankle"] == pytest.approx([0.4, 0.6, -0.1], abs=1e-6)
    six_d = np.concatenate([rotations[None, :, :, 0], rotations[None, :, :, 1]], -1)
    assert headings(six_d, np.array([1.0, 0.0, 0.0])) == pytest.approx([math.pi / 2])


@pytest.mark.parametrize(
    ("sole", "toe"),
    [
        (ball("0.1 0.02 -0.03", 0.02) + ball("-0.1 0.02 -0.03", 0.02), (0.1, 0.02, -0.05)),
        (
            '<collision><origin xyz="0.03 0 -0.02"/><geometry><box size="0.2 0.1 0.02"/></geometry></collision>',
            (0.13, 0, -0.03),
        ),
        # A cuboid of 0.2 x 0.1 x 0.04 m and 12 kg, which has no shape but its inertia.
        (
            '<inertial><origin xyz="0.05 0 -0.02"/><mass value="12"/><inertia ixx="0.0116" iyy="0.0416" izz="0.05"/></inertial>',
            (0.15, 0, -0.04),
        ),
    ],
)
def test_toes_are_the_front_of_the_sole(tmp_path: Path, sole: str, toe: tuple[float, float, float]):
    robot = robot_of(tmp_path, biped(sole))
    x, y, z = toe
    assert robot.offsets[robot.names.index("left_toe")] == pytest.approx([y, z, x])


def test_end_effectors_can_be_given(tmp_path: Path):
    robot = robot_of(
        tmp_path,
        biped(sole=""),
        end_effectors=["left_toe=left_ankle:0.2,0,-0.1", "right_toe=right_ankle:0.2,0,-0.1", "head=waist:0,0,0.6"],
    )
    at = {name: robot.offsets[j].tolist() for j, name in enumerate(robot.names)}
    assert at["left_toe"] == [0.0, -0.1, 0.2] and at["head"] == [0.0, 0.6, 0.0]
    assert robot.names[-1] == "head" and "left_hand" in at


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (('type="revolute"', 'type="prismatic"'), {}, 'joint left_hip_joint: type "prismatic"'),
        (('<axis xyz="0 1 0"/>', '<axis xyz="0 one 0"/>'), {}, 'axis left_hip_joint: xyz "0 one 0"'),
        (('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), {}, "joint waist_joint: its axis has no length"),
        (('<child link="torso"/>', '<child link="trunk"/>'), {}, 'joint waist_joint: there is no link "trunk"'),
        (('lower="-0.2" upper="2.5"', 'lower="1" upper="0"'), {}, "joint left_knee_joint: its lower limit"),
        (('velocity="20"/></joint>', 'velocity="20"/><mimic joint="waist"/></joint>'), {}, "cannot follow a hinge"),
        (("<robot", "<model"), {}, "no XML"),
        (("", ""), {"end_effectors": ["beak=head:0,0,0"]}, 'no joint "head"'),
        (("", ""), {"end_effectors": ["beak=waist:0,0"]}, "expected NAME=JOINT:x,y,z"),
        (("", ""), {"contacts": ["left_heel"]}, r"contact joints \['left_heel'\]"),
    ],
)
def test_urdf_errors_name_the_joint(tmp_path: Path, change: tuple[str, str], options: dict, message: str):
    with pytest.raises(ValueError, match=message):
        robot_of(tmp_path, biped().replace(*change, 1) if change[0] else biped(), **options)


def test_joints_that_follow_others_move_with_them_from_the_urdf_to_the_manifest(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(coupled())
    rows = coupled_rows(walk_rows(60, 0.6, 30, 1))
    (tmp_path / "csv").mkdir()
    for number in range(2):
        write_rows(tmp_path / "csv" / f"walk{number}.csv", rows)
    source = RobotSource(tmp_path / "toy.urdf")
    prepare(tmp_path / "csv", tmp_path / "cache", source, choice=Choice(test_name="walk1", mirror=True))
    store = ClipStore(tmp_path / "cache", "train", lengths=[12])
    assert [c.get("mirrored", False) for c in store.clips] == [False, True]
    # A server reads the tables of the manifest.
    tables = tomllib.loads("\n".join(skeleton_lines(store.skeleton)))
    served = troupe_reader.Skeleton.of_tables(tables["skeleton"], tables["robot"])
    assert served.robot is not None and [m["follows"] for m in served.robot["mimics"]] == ["left_knee", "right_knee"]
    ankle, knee = store.skeleton.names.index("left_ankle"), store.skeleton.names.index("left_knee")
    hinges = Hinges(store.skeleton)
    for clip in store.clips:
        frames = slice(clip["start"], clip["start"] + clip["frames"])
        rotations = six_d_to_matrix(store.six_d[frames])
        bent = hinges.nearest(hinges.hinge_of[knee], rotations[:, store.skeleton.parents[knee]].mT @ rotations[:, knee])
        about = matrix_to_quat(rotations[:, knee].mT @ rotations[:, ankle])
        np.testing.assert_allclose(2 * torch.atan2(about[:, 1], about[:, 0]), 0.1 - 0.5 * bent, atol=1e-3)
        made = hinges.project(rotations)
        np.testing.assert_allclose(made.rotations, rotations, atol=1e-4)
        roots = matrix_to_quat(rotations[:, 0])
        pose = served.pose(roots.numpy(), made.angles.numpy())
        shown = troupe_reader.Clip(served, 30.0, store.positions[frames, 0].numpy(), pose)
        np.testing.assert_allclose(shown.world()[0], store.positions[frames], atol=1e-4)
    body = body_of("toy", store.skeleton, robot_neutral(store.skeleton))
    assert np.abs(body.axes[ankle]).max() == pytest.approx(1.0)


def test_joints_that_follow_unlike_each_other_have_no_mirror_image(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(coupled().replace('multiplier="-0.5"', 'multiplier="-0.6"', 1))
    robot = build_robot(describe(tmp_path / "toy.urdf"))
    skeleton = Skeleton(robot.names, robot.parents, robot.offsets.tolist(), [1.0, 0.0, 0.0], robot=robot.table())
    with pytest.raises(MirrorError, match="left_ankle does not follow as the mirror image of right_ankle does"):
        mirror_of(skeleton, [])


def test_every_format_of_robots_is_read(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(biped())
    source = RobotSource(tmp_path / "toy.urdf")
    rows = walk_rows(40, 0.5, 0, 1)
    folder = tmp_path / "data"
    (folder / "sonic" / "walk").mkdir(parents=True)
    write_rows(folder / "a.csv", rows)
    quaternion_first = [[*row[:3], row[6], *row[3:6], *row[7:]] for row in rows]
    np.save(folder / "b.npy", np.array(quaternion_first, np.float32))
    # Breadth first, as Isaac Lab has it: hips and waist, then knees and shoulders, then ankles.
    order = [7, 10, 13, 8, 11, 14, 15, 9, 12]
    write_rows(folder / "sonic" / "walk" / "joint_pos.csv", [[row[column] for column in order] for row in rows])
    write_rows(folder / "sonic" / "walk" / "body_pos.csv", [row[:3] for row in rows])
    write_rows(folder / "sonic" / "walk" / "body_quat.csv", [row[3:7] for row in quaternion_first])
    files = files_of(folder, source, None)
    assert [file_name(file) for file in files] == ["a.csv", "b.npy", "walk.csv"]
    first, second, third = load_all(files, source, 1, "test")
    assert first.dropped is second.dropped is None
    np.testing.assert_allclose(first.clips[0].positions, second.clips[0].positions, atol=1e-5)
    # At 50 Hz.
    assert third.dropped is None and len(third.clips[0].positions) == 24


def test_quadrupeds_stand_on_the_ends_of_their_legs(tmp_path: Path):
    parts = [link("base")]
    for leg, x, y in (("FL", 0.19, 0.05), ("FR", 0.19, -0.05), ("RL", -0.19, 0.05), ("RR", -0.19, -0.05)):
        parts += [link(f"{leg}_{name}", ball("0 0 -0.2")) for name in ("hip", "thigh", "calf", "foot")]
        parts += [
            joint(f"{leg}_hip", "base", f"{leg}_hip", f"{x} {y} 0", "1 0 0"),
            joint(f"{leg}_thigh", f"{leg}_hip", f"{leg}_thigh", f"0 {y} 0", "0 1 0"),
            joint(f"{leg}_calf", f"{leg}_thigh", f"{leg}_calf", "0 0 -0.213", "0 1 0"),
            joint(f"{leg}_foot", f"{leg}_calf", f"{leg}_foot", "0 0 -0.213", "0 1 0", kind="fixed"),
        ]
    robot = robot_of(tmp_path, f'<robot name="go">{"".join(parts)}</robot>')
    assert robot.contacts == [f"{leg}_calf_end" for leg in ("FL", "FR", "RL", "RR")]
    rows = [[0.02 * n, 0, 0.311, 0, 0, 0, 1, *[0.0, 0.8, -1.5] * 4] for n in range(40)]
    (tmp_path / "csv").mkdir()
    write_rows(tmp_path / "csv" / "walk.csv", rows)
    argv = ["unimogen", "prepare", "--source", str(tmp_path / "csv"), "--urdf", str(tmp_path / "robot.urdf")]
    assert main([*argv, "--name", "go", "--cache", str(tmp_path / "cache"), "--workers", "1"]) == 0
    body = Body.load(tmp_path / "cache" / "go" / "body.json")
    assert body.size_m == pytest.approx(0.426, abs=0.01)
    assert [body.sides[body.skeleton.names.index(name)] for name in ("FL_hip", "RR_calf_end", "base")] == [1, -1, 0]
    argv = ["prepare", str(tmp_path / "csv"), "--urdf", str(tmp_path / "robot.urdf"), "--mirror"]
    assert main([*argv, "--cache", str(tmp_path / "mirrored"), "--workers", "1"]) == 0
    store = ClipStore(tmp_path / "mirrored", "train", lengths=[12])
    assert [clip["name"] for clip in store.clips] == ["walk.csv", "walk_M.csv"]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("leg_l{}", "leg_r{}"),
        ("L_leg_{}", "R_leg_{}"),
        ("leg{}_L", "leg{}_R"),
        ("Bip01 L Toe{}", "Bip01 R Toe{}"),
        ("CC_Base_L_Toe{}", "CC_Base_R_Toe{}"),
        ("LThigh{}", "RThigh{}"),
    ],
)
def test_sides_are_found_by_many_makers_names(left: str, right: str):
    names = ["base", *(side.format(number) for side in (left, right) for number in (1, 6)), "level"]
    assert side_pairs(names) == [(1, 3), (2, 4)]


def test_legs_that_no_name_shows_are_an_option(tmp_path: Path):
    text = biped().replace("left_", "one_").replace("right_", "two_")
    with pytest.raises(ReadError, match="--legs LEFT,RIGHT names the last hinge of each leg, of: one_ankle, two_ankle"):
        robot_of(tmp_path, text)
    (tmp_path / "csv").mkdir()
    write_rows(tmp_path / "csv" / "walk.csv", walk_rows(40, 0.5, 0, 1))
    argv = [str(tmp_path / "csv"), "--urdf", str(tmp_path / "robot.urdf"), "--legs", "one_ankle,two_ankle"]
    assert main(["prepare", *argv, "--cache", str(tmp_path / "cache"), "--workers", "1"]) == 0
    skeleton = ClipStore(tmp_path / "cache", "train", lengths=[12]).skeleton
    assert [skeleton.names[j] for j in skeleton.contact_joints] == ["one_ankle", "left_toe", "two_ankle", "right_toe"]


def test_a_foot_without_any_shape_says_what_to_give(tmp_path: Path):
    with pytest.raises(ReadError, match="--end-effector left_toe=left_ankle:x,y,z"):
        robot_of(tmp_path, biped(sole=""))


def test_motion_errors_name_the_column(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(biped())
    source = RobotSource(tmp_path / "toy.urdf")

    def changed(row: int, column: int, value: float) -> list[list[float]]:
        rows = walk_rows(40, 0.5, 0, 1)
        rows[row][column] = value
        return rows

    for rows, message in (
        ([row[:-1] for row in walk_rows(40, 0.5, 0, 1)], "15 columns; robot toy has 16: 7 of the root and 9 angles"),
        (changed(7, 8, math.nan), 'line 8, column 9: "nan" is no finite number'),
        (changed(5, 6, 3.0), "frame 5: the length of the root's quaternion is 3"),
        (changed(3, 13, 40.0), r"\(waist\) is 38.00 rad beyond its limits, -2.00 to 2.00 rad, in frame 3"),
    ):
        with pytest.raises(ReadError, match=message):
            source.load(write_rows(tmp_path / "bad.csv", rows))


def test_a_header_is_no_row(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(biped())
    source = RobotSource(tmp_path / "toy.urdf")
    path = write_rows(tmp_path / "a.csv", walk_rows(20, 0.5, 0, 1))
    plain = source.load(path)
    rows = path.read_text()
    path.write_text(",".join(["x,y,z,qx,qy,qz,qw", *(f"j{nth}" for nth in range(9))]) + "\n" + rows)
    np.testing.assert_array_equal(source.load(path).positions, plain.positions)
    path.write_text("x,y" + ",z" * 14 + "\n" + rows)
    with pytest.raises(ReadError, match='the name of column 4 is "z"; allowed: x y z, qx qy qz qw'):
        source.load(path)


def test_a_quaternion_of_another_order_is_found_and_noted(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(biped())
    source, rows = RobotSource(tmp_path / "toy.urdf"), walk_rows(40, 0.5, 30, 1)
    plain = source.load(write_rows(tmp_path / "plain.csv", rows))
    other = [[*row[:3], row[6], *row[3:6], *row[7:]] for row in rows]
    motion = source.load(write_rows(tmp_path / "other.csv", other))
    np.testing.assert_allclose(motion.positions, plain.positions, atol=1e-6)
    assert motion.report is not None
    assert any("w x y z" in note["text"] for note in motion.report["repairs"])


def test_other_frame_rates_are_brought_to_thirty(tmp_path: Path):
    (tmp_path / "toy.urdf").write_text(biped())
    path = write_rows(tmp_path / "a.csv", walk_rows(61, 0.5, 30, 1))
    slow, fast = (RobotSource(tmp_path / "toy.urdf", fps=fps).load(path) for fps in (30, 60))
    assert (len(slow.positions), len(fast.positions)) == (61, 31)
    np.testing.assert_allclose(fast.positions, slow.positions[::2], atol=1e-9)
