import numpy as np
import pytest
import torch

from robot_support import biped as biped_urdf
from troupe_training.data.bodies import (
    DESCRIPTION,
    Body,
    bends,
    body_of,
    is_symmetric,
    mirror_pairs,
    pack_bends,
    positions_of,
    unbend,
    unpack_bends,
)
from troupe_training.data.bodies_store import Windows
from troupe_training.data.neutral import robot_neutral
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.models.unimogen.state import BodyKinematics
from troupe_training.robots.build import build_robot, describe
from unimogen_support import biped, random_rotations


@pytest.mark.parametrize("seed", [None, 3])
def test_positions_come_back_from_bends(seed):
    body, rng = biped(seed), np.random.default_rng(1)
    rotations, root = random_rotations(rng, 5, 8), rng.standard_normal((5, 3))
    again = unpack_bends(pack_bends(bends(body, rotations)))
    expected = body.skeleton.forward_kinematics(root, rotations)
    assert np.abs(positions_of(body, root, unbend(body, again)) - expected).max() < 1e-3


def test_the_same_bend_is_the_same_number_on_joints_with_other_axes():
    plain, turned, rng = biped(), biped(3), np.random.default_rng(2)
    local = random_rotations(rng, 4, 8)
    motions = [(body, unbend(body, local) @ body.rotations) for body in (plain, turned)]
    first, second = (bends(body, rotations) for body, rotations in motions)
    np.testing.assert_allclose(first, second, atol=1e-9)
    places = [body.skeleton.forward_kinematics(np.zeros((4, 3)), rotations) for body, rotations in motions]
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    np.testing.assert_allclose(plain.description(), turned.description(), atol=1e-6)


def test_the_left_is_that_of_the_neutral_pose():
    plain = biped()
    half = np.diag([-1.0, 1.0, -1.0])
    rest = np.concatenate([half[None], np.tile(np.eye(3), (len(plain.skeleton.names) - 1, 1, 1))])
    # A root bone that points the other way, as the spider's does.
    turned = body_of("turned", plain.skeleton, rest)
    np.testing.assert_allclose(half @ np.array(turned.skeleton.left_axis), [1.0, 0.0, 0.0], atol=1e-6)
    assert biped().skeleton.left_axis == plain.skeleton.left_axis


def robot_body(tmp_path) -> tuple[Body, object]:
    (tmp_path / "toy.urdf").write_text(biped_urdf())
    robot = build_robot(describe(tmp_path / "toy.urdf"))
    skeleton = Skeleton(robot.names, robot.parents, robot.offsets.tolist(), [1.0, 0.0, 0.0], robot=robot.table())
    return body_of("toy", skeleton, robot_neutral(skeleton)), robot


def test_hinges_turn_about_their_axis_alone(tmp_path):
    body, robot = robot_body(tmp_path)
    angles = np.random.default_rng(0).uniform(-0.5, 0.5, (6, len(robot.hinges)))
    _, rotations = robot.world(np.zeros((6, 3)), np.tile(np.eye(3), (6, 1, 1)), angles)
    local = bends(body, rotations)
    for hinge in robot.hinges:
        axis = body.axes[hinge.joint]
        np.testing.assert_allclose(local[:, hinge.joint] @ axis, np.tile(axis, (6, 1)), atol=1e-6)


def test_a_robots_arms_hang_in_its_neutral_pose(tmp_path):
    body, _ = robot_body(tmp_path)
    places, names = body.places(), body.skeleton.names
    shoulder, hand = (places[names.index(name)] for name in ("left_shoulder", "left_hand"))
    assert hand[1] < shoulder[1] - 0.45
    assert is_symmetric(body)


def test_slots_are_the_row_the_root_and_its_ancestors():
    body = biped()
    rows, reads = body.slots()
    toes = 5  # joint 4
    assert [r for r, read in zip(rows[toes], reads[toes], strict=True) if read] == [toes, 0, 1, 4, 3]
    assert [r for r, read in zip(rows[1], reads[1], strict=True) if read] == [1, 0]
    ends = [r for r, read in zip(rows[0], reads[0], strict=True) if read]
    assert ends[:2] == [0, 1] and set(ends[2:]) == {4, 5, 7, 8, 2}


def test_rows_are_described():
    rows = biped().description()
    place, contact = DESCRIPTION.index("is_place"), DESCRIPTION.index("is_contact")
    assert rows[:, place].tolist() == [1.0] + [0.0] * 8
    assert np.flatnonzero(rows[:, contact]).tolist() == [4, 5, 7, 8]
    assert rows[3, DESCRIPTION.index("left")] == 1.0 and rows[6, DESCRIPTION.index("left")] == -1.0


def test_mirrored_windows_show_mirrored_positions():
    body, rng = biped(), np.random.default_rng(4)
    local = random_rotations(rng, 1, 3, 8)
    six = torch.from_numpy(np.concatenate([local[..., 0], local[..., 1]], -1)).float()
    root = torch.from_numpy(rng.standard_normal((1, 3, 3))).float()
    left = local[:, :, 0, :, 0]
    heading = torch.from_numpy(np.arctan2(-left[..., 2], left[..., 0])).float()
    windows = Windows(root, heading, six, torch.rand(1, 3, 4), torch.eye(2)[:1])
    pairs, words = mirror_pairs(body), torch.tensor([1, 0])
    there = windows.mirrored(pairs, [2, 3, 0, 1], words, torch.tensor([True]))
    kinematics = BodyKinematics(body)

    def places(w: Windows) -> torch.Tensor:
        return kinematics.positions(w.root, kinematics.turned(six_d_to_matrix(w.bends)))

    flip = torch.tensor([-1.0, 1.0, 1.0])
    torch.testing.assert_close(places(there), (places(windows) * flip)[:, :, pairs], atol=1e-5, rtol=0)
    turned = six_d_to_matrix(there.bends[:, :, 0])[..., 0]
    torch.testing.assert_close(there.heading, torch.atan2(-turned[..., 2], turned[..., 0]), atol=1e-5, rtol=0)
    assert there.words.tolist() == [[0.0, 1.0]]
    back = there.mirrored(pairs, [2, 3, 0, 1], words, torch.tensor([True]))
    torch.testing.assert_close(back.bends, windows.bends)
