import dataclasses

import numpy as np
import pytest

import troupe
from conftest import any_clip, any_rotations
from troupe import rotation


def matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q.astype(np.float64)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_positions_are_those_of_matrices_joint_by_joint(arm: troupe.Skeleton) -> None:
    clip = any_clip(arm)
    positions, rotations = clip.world_positions(), clip.world_rotations()
    for frame in range(len(clip)):
        placed, turned = [clip.root[frame]], [matrix(clip.rotations[frame, 0])]
        for joint in range(1, 4):
            parent = arm.parents[joint]
            placed.append(placed[parent] + turned[parent] @ arm.offsets[joint])
            turned.append(turned[parent] @ matrix(clip.rotations[frame, joint]))
        assert np.abs(positions[frame] - placed).max() < 1e-5
        assert np.abs(matrix(rotations[frame, 3]) - turned[3]).max() < 1e-5


@pytest.mark.parametrize("convention", troupe.Convention)
def test_kinematics_commute_with_conventions(arm: troupe.Skeleton, convention: troupe.Convention) -> None:
    clip = any_clip(arm)
    root, rotations = convention.position_from_native(clip.root), convention.rotation_from_native(clip.rotations)
    positions, _ = arm.world(root, rotations, convention)
    assert np.abs(convention.position_to_native(positions) - clip.world_positions()).max() < 1e-4
    assert np.abs(convention.rotation_to_native(rotations) - clip.rotations).max() < 1e-6


def test_left_up_and_forward_by_hand() -> None:
    left_up_ahead = np.eye(3, dtype=np.float32)
    unreal = troupe.Convention.UNREAL.position_from_native(left_up_ahead)
    assert unreal.tolist() == [[0, -100, 0], [0, 0, 100], [100, 0, 0]]
    ros = troupe.Convention.ROS.position_from_native(left_up_ahead)
    assert ros.tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
    # A quarter turn to the left is one to the right about up for left-handed axes.
    turn = np.array([np.sqrt(0.5), 0, np.sqrt(0.5), 0], np.float32)
    assert np.allclose(troupe.Convention.UNREAL.rotation_from_native(turn), [np.sqrt(0.5), 0, 0, -np.sqrt(0.5)])
    assert np.allclose(troupe.Convention.ROS.rotation_from_native(turn), [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def test_what_is_on_the_hinges_stays(robot: troupe.Skeleton) -> None:
    angles = np.random.default_rng(1).uniform([-1.5, -0.2], [1.5, 2.5], (50, 2)).astype(np.float32)
    root = any_rotations(2, 50)
    pose = robot.pose(root, angles)
    made, fitted = robot.fit(pose)
    assert np.abs(fitted - angles).max() < 1e-5
    assert rotation.angle_between(made, pose).max() < 1e-5


def test_joints_that_follow_a_hinge_turn_with_it(robot: troupe.Skeleton) -> None:
    assert robot.robot is not None
    toe = troupe.Mimic("toe", 3, 1, -0.5, 0.2, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    robot = dataclasses.replace(robot, robot=dataclasses.replace(robot.robot, mimics=(toe,)))
    angles = np.array([[0.3, 1.0], [-0.4, 0.2]], np.float32)
    pose = robot.pose(any_rotations(3, 2), angles)
    expected = rotation.about_axis(np.array(toe.axis, np.float32), np.array([-0.3, 0.1], np.float32))
    assert rotation.angle_between(pose[:, 3], expected).max() < 1e-6
    stiff = pose.copy()
    stiff[:, 3] = (1, 0, 0, 0)
    made, fitted = robot.fit(stiff)
    assert np.abs(fitted - angles).max() < 1e-5 and rotation.angle_between(made, pose).max() < 1e-5
    tables = troupe.formats.reader._tables(robot)[1]
    assert tables is not None and tables["mimics"][0]["follows"] == "knee"


def test_hinges_stay_within_their_limits_and_qpos_comes_back(robot: troupe.Skeleton) -> None:
    clip = any_clip(robot, 40)
    qpos = clip.to_qpos()
    assert qpos.shape == (40, 9)
    assert (qpos[:, 7] >= -1.5).all() and (qpos[:, 7] <= 1.5).all()
    assert (qpos[:, 8] >= np.float32(-0.2)).all() and (qpos[:, 8] <= 2.5).all()
    root, rotations = robot.of_qpos(qpos)
    assert np.abs(root - clip.root).max() < 1e-6
    assert np.abs(robot.to_qpos(root, rotations) - qpos).max() < 1e-5


def test_a_clip_refuses_arrays_that_do_not_fit(arm: troupe.Skeleton) -> None:
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        troupe.Clip(arm, 30.0, np.zeros((3, 3), np.float32), np.zeros((3, 5, 4), np.float32))
    assert (caught.value.field, caught.value.allowed) == ("rotations", "(any, 4, 4)")
    with pytest.raises(troupe.InvalidArgumentError, match="no robot"):
        any_clip(arm).to_qpos()
