"""Our implementation of the public MotionBricks networks beside PyTorch's own layers, and the graphs of its pack."""

import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from release_support import G1, write_release
from troupe_training.export.motionbricks.examples import example_inputs
from troupe_training.export.motionbricks.official.pack import skeleton_of
from troupe_training.export.motionbricks.official.release import NAMES, Release
from troupe_training.export.motionbricks.random_pack import RandomStore
from troupe_training.models.motionbricks.official.layers import PostNormTransformer, Window
from troupe_training.models.motionbricks.official.served import Joints, forward_velocity
from troupe_training.models.motionbricks.official.sizes import Transformers
from troupe_training.models.motionbricks.official.weights import Weights

Stages = dict[str, nn.Module]


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Release:
    return Release.read(write_release(tmp_path_factory.mktemp("release")))


@pytest.fixture(scope="module")
def joints(release: Release) -> Joints:
    return skeleton_of(release, G1)[1]


@pytest.fixture(scope="module")
def stages(release: Release, joints: Joints) -> Stages:
    return {name: stage.eval().requires_grad_(False) for name, stage in release.networks().stages(joints).items()}


@pytest.fixture(scope="module")
def inputs(release: Release) -> dict[str, dict[str, Tensor]]:
    return example_inputs(RandomStore(skeleton_of(release, G1)[0]), release.sizes, 4, 16, 5, min_tokens=6)


def test_a_transformer_is_that_of_pytorch():
    theirs = nn.TransformerEncoder(nn.TransformerEncoderLayer(16, 4, 32, batch_first=True), 2).eval()
    for parameter in theirs.parameters():
        parameter.data += 0.1 * torch.randn_like(parameter)
    ours = PostNormTransformer(Transformers(16, 4, 2, 32))
    Weights({f"t.{name}": value for name, value in theirs.state_dict().items()}, "").transformer(ours, "t")
    x, valid = torch.randn(3, 7, 16), (torch.arange(7) < torch.tensor([[7], [4], [1]])).float()
    with torch.no_grad():
        expected = theirs(x, src_key_padding_mask=valid < 0.5)
        assert torch.allclose(ours(x, valid)[0], expected[0], atol=1e-5)
        assert torch.allclose(ours(x, valid)[1, :4], expected[1, :4], atol=1e-5)


@pytest.mark.parametrize("dilation", [1, 3, 9, 27])
def test_a_window_is_a_convolution_of_pytorch(dilation: int):
    theirs = nn.Conv1d(5, 6, 3, padding=dilation, dilation=dilation)
    ours = Window(5, 6, 16, dilation)
    assert ours.taps == (3 if dilation < 16 else 1)
    Weights({f"c.{name}": value for name, value in theirs.state_dict().items()}, "").window(ours, "c")
    for length in (1, 9, 16):
        x = torch.randn(2, length, 5)
        assert torch.allclose(ours(x), theirs(x.transpose(1, 2)).transpose(1, 2), atol=1e-5)


def test_the_last_velocity_repeats_the_one_before():
    root = torch.zeros(2, 8, 5)
    root[..., 0] = torch.tensor([0.0, 0.1, 0.3, 0.6, 1.0, 9.0, 9.0, 9.0])
    velocity = forward_velocity(root, torch.tensor([5, 8]))[..., 0] / 30
    assert torch.allclose(velocity[0, :5], torch.tensor([0.1, 0.2, 0.3, 0.4, 0.4]), atol=1e-5)
    assert torch.allclose(velocity[1, 3:], torch.tensor([0.4, 8.0, 0.0, 0.0, 0.0]), atol=1e-5)


def test_a_row_does_not_depend_on_padding_or_on_other_rows(stages: Stages, inputs: dict[str, dict[str, Tensor]]):
    for name in ("pose", "decoder"):
        row = int(inputs[name]["num_tokens"].argmin())
        tokens = int(inputs[name]["num_tokens"][row])
        assert tokens < 16
        alone = {k: v[row : row + 1] for k, v in inputs[name].items()}
        alone = {k: v[:, : tokens * (4 if v.shape[1] == 64 else 1)] if v.dim() > 1 else v for k, v in alone.items()}
        many, one = stages[name](*inputs[name].values()), stages[name](*alone.values())
        for a, b in zip(many if name == "decoder" else [many], one if name == "decoder" else [one], strict=True):
            assert torch.allclose(a[row, : b.shape[1]], b[0], atol=1e-5)


def test_answers_move_with_their_segment(stages: Stages, inputs: dict[str, dict[str, Tensor]]):
    """The release puts the first frame on the origin, the pack's segments have another there."""
    move = torch.tensor([3.0, 0.0, -2.0, 0.0, 0.0])
    root = dict(inputs["root"])
    root["key_global_root"] = root["key_global_root"] + move * root["has_global_root"][..., None]
    count, _, trajectory = stages["root"](*inputs["root"].values())
    moved_count, _, moved = stages["root"](*root.values())
    assert torch.equal(count, moved_count) and torch.allclose(trajectory + move, moved, atol=1e-4)
    later = inputs["pose"] | {"global_root": inputs["pose"]["global_root"] + move}
    assert torch.allclose(stages["pose"](*inputs["pose"].values()), stages["pose"](*later.values()), atol=1e-4)
    decoded = inputs["decoder"] | {"global_root": later["global_root"]}
    before, after = (stages["decoder"](*values.values()) for values in (inputs["decoder"], decoded))
    valid = torch.arange(64)[None] < 4 * inputs["pose"]["num_tokens"][:, None]
    assert torch.allclose(before[0][valid], after[0][valid], atol=1e-3)
    assert torch.allclose((before[1] + move)[valid], after[1][valid], atol=1e-4)


def test_joints_without_a_hinge_turn_with_their_parents(
    stages: Stages, inputs: dict[str, dict[str, Tensor]], joints: Joints
):
    assert [NAMES[joint] for joint in joints.fixed] == ["left_toe", "right_toe", "left_hand", "right_hand"]
    ours = [joints.theirs.index(joint) for joint in joints.fixed]
    changed = dict(inputs["decoder"])
    poses = changed["frame_pose"].clone().unflatten(-1, (-1, 9))
    poses[..., ours, 3:] = 0.3
    changed["frame_pose"] = poses.flatten(2)
    made, same = (stages["decoder"](*values.values())[0] for values in (inputs["decoder"], changed))
    assert torch.equal(made, same)  # the release never saw them turn
    for joint, index in zip(joints.fixed, ours, strict=True):
        parent = joints.theirs.index(joints.parents[joint])
        assert torch.equal(made[:, :, index], made[:, :, parent])


def test_velocities_are_read_from_the_next_slot(stages: Stages, inputs: dict[str, dict[str, Tensor]]):
    root = {name: value.clone() for name, value in inputs["root"].items()}
    for name in ("has_local_root", "has_global_root", "has_pose"):
        root[name][:] = 1.0
    answer = stages["root"](*root.values())[2]

    def changed(slot: int, number: int) -> bool:
        other = root | {"key_local_root": root["key_local_root"].clone()}
        other["key_local_root"][:, slot, number] += 1.0
        return not torch.equal(stages["root"](*other.values())[2], answer)

    # The first slot's velocity is that of the frame before the segment. The first target's leads to
    # it from a frame that is no slot. Heights are the slots' own, but for the last context frame.
    assert [changed(slot, 0) for slot in range(8)] == [False, True, True, True, False, True, True, True]
    assert [changed(slot, 3) for slot in range(8)] == [True, True, True, False, True, True, True, True]


def test_counts_are_drawn_among_those_allowed(stages: Stages, inputs: dict[str, dict[str, Tensor]]):
    root = dict(inputs["root"])
    count, probabilities, _ = stages["root"](*root.values())
    allowed = root["allowed_counts"]
    assert (allowed.gather(1, (count - 6)[:, None]) == 1).all()
    assert torch.allclose(probabilities.sum(-1), torch.ones(4)) and (probabilities[allowed == 0] == 0).all()
    root["count_noise"] = F.one_hot(torch.tensor([3, 3, 3, 3]), 11) * 50.0
    root["allowed_counts"] = torch.ones_like(allowed)
    assert (stages["root"](*root.values())[0] == 9).all()
