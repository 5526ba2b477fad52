"""Robots' hinges: angles to rotations and back, limits, and what does not fit a hinge."""

import math

import pytest
import torch

from tests_support import random_rotations
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import matrix_to_quat, quat_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.robots.hinges import Hinges, on_hinges

SLANTED = [math.cos(0.2), math.sin(0.2), 0.0, 0.0]  # w x y z, 0.4 rad about X


def robot() -> Skeleton:
    """A floating pelvis, a hip, a slanted knee below it, and a foot without a hinge."""
    skeleton = Skeleton(
        names=["pelvis", "hip", "knee", "foot"],
        parents=[-1, 0, 1, 2],
        offsets=[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, -0.4, 0.0], [0.0, -0.4, 0.0]],
        left_axis=[1.0, 0.0, 0.0],
        contact_joints=[3],
        contact_max_height_m=[0.1],
        contact_clearance_m=[0.05],
    )
    skeleton.robot = {
        "name": "one_leg",
        "hinges": [
            {"joint": "knee", "axis": [0.0, 0.6, 0.8], "rest": SLANTED, "lower_rad": -0.5, "upper_rad": 2.5},
            {"joint": "hip", "axis": [1.0, 0.0, 0.0], "rest": [1.0, 0.0, 0.0, 0.0], "lower_rad": -3.5}
            | {"upper_rad": -1.0},
        ],
    }
    return skeleton


def turned(hinges: Hinges, root: torch.Tensor, angles: torch.Tensor) -> torch.Tensor:
    """World rotations ``[..., J, 3, 3]`` from the root's ``[..., 3, 3]`` and angles ``[..., H]``."""
    world: list[torch.Tensor] = []
    for joint, parent in enumerate(hinges.parents):
        own = root if parent < 0 else world[parent]
        if joint in hinges.hinge_of:
            own = own @ hinges.turn(hinges.hinge_of[joint], angles[..., hinges.hinge_of[joint]])
        world.append(own)
    return torch.stack(world, -3)


def test_angles_come_back():
    hinges = Hinges(robot())
    angles = torch.tensor([[0.0, -1.5], [2.4, -3.4], [-0.4, -1.1]])  # beyond half a turn too
    world = turned(hinges, random_rotations(3), angles)
    made = hinges.project(world)
    assert torch.allclose(made.angles, angles, atol=1e-4)
    assert torch.allclose(made.rotations, world, atol=1e-5)
    assert made.residual_rad.max() < 1e-3 and not made.clamped.any()


def test_kinematics_by_hand():
    """A quarter turn of the hip forward (about X, the left) swings the straight leg from down to behind or ahead."""
    skeleton = robot()
    skeleton.robot["hinges"][0] |= {"rest": [1.0, 0.0, 0.0, 0.0]}
    hinges = Hinges(skeleton)
    world = turned(hinges, torch.eye(3), torch.tensor([0.0, -math.pi / 2]))
    positions = Kinematics(skeleton).positions(hinges.project(world).rotations)
    # R(X, -90°) takes down (0, -1, 0) to (0, 0, 1): ahead.
    assert torch.allclose(positions[3], torch.tensor([0.1, 0.0, 0.8]), atol=1e-5)


def test_angles_beyond_their_limits_are_clamped_and_counted():
    hinges = Hinges(robot())
    world = turned(hinges, torch.eye(3)[None], torch.tensor([[2.9, -1.5]]))
    made = hinges.project(world)
    assert torch.allclose(made.angles, torch.tensor([[2.5, -1.5]]), atol=1e-5)
    assert made.clamped.tolist() == [[True, False]]
    assert made.residual_rad[0].tolist() == pytest.approx([0.4, 0.0], abs=1e-3)
    expected = turned(hinges, torch.eye(3)[None], torch.tensor([[2.5, -1.5]]))
    assert torch.allclose(made.rotations, expected, atol=1e-5)


def test_a_hinge_makes_up_for_what_those_above_it_lack():
    skeleton = robot()
    skeleton.robot["hinges"][0] |= {"axis": [1.0, 0.0, 0.0], "rest": [1.0, 0.0, 0.0, 0.0]}
    hinges = Hinges(skeleton)
    world = turned(hinges, torch.eye(3), torch.tensor([0.3, -0.4]))  # the hip goes no farther than -1
    made = hinges.project(world)
    assert made.angles.tolist() == pytest.approx([0.9, -1.0], abs=1e-5)
    assert torch.allclose(made.rotations[2:], world[2:], atol=1e-5), (
        "knee and foot have the rotations that were asked for"
    )
    assert made.residual_rad.tolist() == pytest.approx([0.0, 0.6], abs=1e-3)


def test_what_a_hinge_cannot_do_is_left_over():
    """A turn about an axis across the hinge's is all residual; the nearest angle of the hinge is none of it."""
    hinges = Hinges(robot())
    world = turned(hinges, torch.eye(3)[None], torch.tensor([[0.3, -1.2]]))
    across = quat_to_matrix(torch.tensor([math.cos(0.1), 0.0, math.sin(0.1), 0.0]))  # 0.2 rad about Y
    world[:, 1:] = world[:, 1:2] @ across @ world[:, 1:2].transpose(-1, -2) @ world[:, 1:]
    made = hinges.project(world)
    assert float(made.residual_rad[0, 1]) == pytest.approx(0.2, abs=1e-4)
    assert float(made.angles[0, 1]) == pytest.approx(-1.2, abs=1e-4)
    fixed = made.rotations[:, 3].transpose(-1, -2) @ made.rotations[:, 2]
    assert float(matrix_to_quat(fixed)[0, 0].abs()) == pytest.approx(1.0, abs=1e-6)


def test_a_motion_on_hinges_keeps_its_root_and_tells_what_it_took():
    hinges = Hinges(robot())
    world = turned(hinges, torch.eye(3).expand(2, 5, 3, 3), torch.tensor([2.9, -1.5]).expand(2, 5, 2))
    made, figures = on_hinges(hinges, Motion(torch.rand(2, 5, 3), world))
    assert made.rotations.shape == world.shape
    assert torch.allclose(figures["hinge_clamped_share"], torch.tensor([0.5, 0.5]))
    assert torch.allclose(figures["hinge_residual_max_deg"], torch.full((2,), math.degrees(0.4)), atol=0.1)


def test_a_human_has_no_hinges():
    skeleton = robot()
    skeleton.robot = None
    with pytest.raises(ValueError, match="no robot"):
        Hinges(skeleton)
