"""The decoder's carried keyframes."""

import math

import pytest
import torch

from troupe_training.data.rotations import arc_tangent, yaw_matrix
from troupe_training.data.store import local_root_of
from troupe_training.models.motionbricks.carried import CarriedPose, interpolation, usual_heights
from troupe_training.models.motionbricks.config import MAX_FRAMES


def mask_of(frames: int, *given: int) -> torch.Tensor:
    mask = torch.zeros(1, frames)
    mask[0, list(given)] = 1.0
    return mask


def roots(headings: torch.Tensor) -> torch.Tensor:
    root = torch.zeros(1, len(headings), 5)
    root[0, :, 3], root[0, :, 4] = torch.cos(headings), torch.sin(headings)
    return root


def test_shares_are_those_of_linear_interpolation():
    shares, distance = interpolation(mask_of(12, 2, 3, 8))
    value = torch.zeros(12)
    value[[2, 3, 8]] = torch.tensor([1.0, 5.0, 10.0])
    expected = [1, 1, 1, 5, 6, 7, 8, 9, 10, 10, 10, 10]
    torch.testing.assert_close(shares[0] @ value, torch.tensor(expected, dtype=torch.float32))
    torch.testing.assert_close(distance[0].long(), torch.tensor([2, 1, 0, 0, 1, 2, 2, 1, 0, 1, 2, 3]))
    torch.testing.assert_close(shares.sum(-1), torch.ones(1, 12))


def test_arc_tangent_is_that_of_torch():
    edges = torch.tensor([-1.0, -1e-7, 0.0, 1e-7, 1.0])
    sine, cosine = (grid.flatten() for grid in torch.meshgrid(edges, edges, indexing="ij"))
    assert torch.allclose(arc_tangent(sine, cosine), torch.atan2(sine, cosine), atol=1e-6)
    around = torch.linspace(-3.14, 3.14, 200)
    assert torch.allclose(arc_tangent(around.sin(), around.cos()), around, atol=1e-6)


def test_a_root_that_is_far_off_has_its_speed():
    """Its metres come in two parts, the larger of which is exact in 16 bits: see `local_root_of`."""
    root = roots(torch.zeros(20))
    root[0, :, 0] = 9.3 + torch.arange(20) * 0.04
    assert torch.allclose(local_root_of(root)[0, :, 0], torch.full((20,), 1.2), atol=1e-4)
    assert torch.equal((torch.round(root * 16) / 16).bfloat16().float(), torch.round(root * 16) / 16)


def test_without_keyframes_there_is_nothing():
    shares, distance = interpolation(torch.zeros(1, 12))
    assert float(shares.abs().max()) == 0.0
    assert (distance == MAX_FRAMES).all()


@pytest.mark.parametrize("given", [(0, 1, 2, 3, 11), (5,), tuple(range(12))])
def test_keyframes_stay_as_they_are(given: tuple[int, ...]):
    mask = mask_of(12, *given)
    pose = torch.randn(1, 12, 18, generator=torch.Generator().manual_seed(3))
    heading = torch.linspace(-2.0, 2.5, 12)
    carried, _ = CarriedPose(2)(pose * mask[..., None], mask, roots(heading), torch.zeros(18))
    torch.testing.assert_close(carried[:, list(given)], pose[:, list(given)])


def test_a_carried_pose_turns_with_the_root():
    """From one keyframe on, every vector of the pose is turned by what the heading has turned since."""
    pose = torch.zeros(1, 12, 9)
    pose[0, 3] = torch.randn(9, generator=torch.Generator().manual_seed(4))
    heading = torch.linspace(0.3, 0.3 + math.pi, 12)
    carried, _ = CarriedPose(1)(pose, mask_of(12, 3), roots(heading), torch.zeros(9))
    turn = yaw_matrix(heading - heading[3])
    expected = torch.einsum("tij,kj->tki", turn, pose[0, 3].unflatten(0, (3, 3)))
    torch.testing.assert_close(carried[0].unflatten(-1, (3, 3)), expected, atol=1e-5, rtol=1e-5)


def test_trust_begins_high_near_keyframes():
    carried = CarriedPose(1)
    mask = mask_of(20, 3)
    _, distance = carried(torch.zeros(1, 20, 9), mask, roots(torch.zeros(20)), torch.zeros(9))
    trust = carried.shares(distance)
    assert float(trust[0, 3, 0]) == 1.0
    assert (trust[0, 3:-1] > trust[0, 4:]).all()


@pytest.mark.parametrize("given", [(), (0, 1, 2, 3, 11), (5,)])
def test_heights_are_taken_away_from_what_is_carried(given: tuple[int, ...]):
    """Distances stand for the same poses from any source, and for zeros without a given frame."""
    mask = mask_of(12, *given)
    noise = torch.Generator().manual_seed(5)
    pose, heading = torch.randn(1, 12, 18, generator=noise) * mask[..., None], torch.linspace(-2.0, 2.5, 12)
    heights = usual_heights(torch.randn(18, generator=noise))
    assert heights.unflatten(0, (6, 3))[:, [0, 2]].abs().max() == 0.0
    plain, _ = CarriedPose(2)(pose, mask, roots(heading), torch.zeros(18))
    less, _ = CarriedPose(2)(pose, mask, roots(heading), heights)
    torch.testing.assert_close(less + heights, plain, atol=1e-6, rtol=1e-5)
