"""The official networks as a pack ships them: the contract's tensors in and out, the release's features between.

A segment lies as the contract says. The release has its first frame above the origin instead, velocities forward in time, and
joints in another order; the joints without a hinge never turned in what it learnt from, save with the whole scene.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import FPS
from troupe_training.data.roots import integrate_root
from troupe_training.models.motionbricks.official.networks import PoseDecoder, PoseNetwork, RootNetwork
from troupe_training.models.motionbricks.official.sizes import FEET, ROOT_LOCAL, Features, Scale, Sizes

UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # two columns of the identity
ON_GROUND = (1.0, 0.0, 1.0, 0.0, 0.0)  # x and z of a global root


@dataclass
class Joints:
    """The pack's joints and the release's: each in its own order, parents first."""

    theirs: list[int]  # of each joint of the pack, its index in the release
    fixed: list[int]  # the release's joints without a hinge
    parents: list[int]  # of the release's joints


class PoseFeatures(nn.Module):
    """The contract's pose features ``[..., 9 J]`` to the release's: height, positions, rotations; standardised."""

    columns: Tensor
    scale: Tensor
    shift: Tensor

    def __init__(self, joints: Joints, scale: Scale):
        super().__init__()
        count = len(joints.theirs)
        ours = [joints.theirs.index(joint) for joint in range(count)]
        positions = [9 * ours[joint] + axis for joint in range(1, count) for axis in range(3)]
        rotations = [9 * ours[joint] + 3 + number for joint in range(count) for number in range(6)]
        constant = torch.full((len(scale.mean),), torch.nan)
        constant[1 + len(positions) :].unflatten(0, (count, 6))[joints.fixed] = torch.tensor(UPRIGHT)
        free = constant.isnan()
        self.register_buffer("columns", torch.tensor([9 * ours[0] + 1, *positions, *rotations]), persistent=False)
        self.register_buffer("scale", free / scale.std, persistent=False)
        shift = (torch.where(free, 0.0, constant) - scale.mean) / scale.std
        self.register_buffer("shift", shift, persistent=False)

    def forward(self, pose: Tensor) -> Tensor:
        """``[..., 9 J] -> [..., features]``."""
        return pose.index_select(-1, self.columns) * self.scale + self.shift


class Standardised(nn.Module):
    """A `Scale` whose numbers are the graph's."""

    mean: Tensor
    std: Tensor

    def __init__(self, scale: Scale):
        super().__init__()
        self.register_buffer("mean", scale.mean, persistent=False)
        self.register_buffer("std", scale.std, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """Physical to standardised."""
        return (x - self.mean) / self.std


def first_place(root: Tensor) -> Tensor:
    """Where the first of global roots ``[B, T, 5]`` stands, ``[B, 1, 5]``: what the release has at the origin."""
    return root[:, :1] * torch.tensor(ON_GROUND, device=root.device)


class OfficialRoot(nn.Module):
    """``root.onnx``."""

    def __init__(self, network: RootNetwork, features: Features, joints: Joints):
        super().__init__()
        self.network = network
        self.pose = PoseFeatures(joints, features.pose)
        self.local_scale, self.global_scale = Standardised(features.local_root), Standardised(features.global_root)
        # A slot's velocity forward is the next slot's backward. The last context frame has none;
        # the last target goes on as it came.
        half = network.sizes.frames_per_token
        self.following = [*range(1, half), half - 1, *range(half + 1, 2 * half), 2 * half - 1]
        self.known = [float(slot != half - 1) for slot in range(2 * half)]

    def forward(
        self,
        key_local_root: Tensor,
        key_global_root: Tensor,
        key_pose: Tensor,
        has_local_root: Tensor,
        has_global_root: Tensor,
        has_pose: Tensor,
        allowed_counts: Tensor,
        count_noise: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """The contract's root stage."""
        following = torch.tensor(self.following, device=key_local_root.device)
        velocity = key_local_root.index_select(1, following)
        local = torch.stack([velocity[..., 2], velocity[..., 0], velocity[..., 1], key_local_root[..., 3]], -1)
        known = torch.tensor(self.known, device=key_local_root.device)
        place = first_place(key_global_root)
        values = {
            "local_root": self.local_scale(local),
            "global_root": self.global_scale(key_global_root - place),
            "pose": self.pose(key_pose),
        }
        given = {
            "local_root": has_local_root * has_local_root.index_select(1, following) * known,
            "global_root": has_global_root,
            "pose": has_pose,
        }
        num_tokens, probabilities, root = self.network(values, given, allowed_counts, count_noise)
        return num_tokens, probabilities, root * self.global_scale.std + self.global_scale.mean + place


class OfficialPose(nn.Module):
    """``pose.onnx``."""

    def __init__(self, network: PoseNetwork, features: Features, joints: Joints):
        super().__init__()
        self.network = network
        self.pose = PoseFeatures(joints, features.pose)
        self.scale = Standardised(features.global_root[[0, 2, 3, 4]])

    def forward(
        self, tokens: Tensor, num_tokens: Tensor, global_root: Tensor, frame_pose: Tensor, frame_mask: Tensor
    ) -> Tensor:
        """The contract's pose stage."""
        root = global_root - first_place(global_root)
        root = torch.cat([root[..., :1], root[..., 2:]], -1)
        return self.network(tokens, num_tokens, self.scale(root), self.pose(frame_pose), frame_mask)


class OfficialDecoder(nn.Module):
    """``decoder.onnx``. It has only those rows of the last layer that a server reads, and those in physical units."""

    def __init__(self, network: PoseDecoder, features: Features, joints: Joints):
        super().__init__()
        self.network = network
        self.pose = PoseFeatures(joints, features.pose)
        self.scale = Standardised(features.local_root[1:3])
        count, last = len(joints.theirs), network.decoder.leave
        rotations = ROOT_LOCAL + 3 * (count - 1)
        turns = [_turning(joint, joints) for joint in joints.theirs]
        rows = [
            *range(ROOT_LOCAL),
            *(rotations + 6 * joint + number for joint in turns for number in range(6)),
            *range(last.weight.shape[1] - FEET, last.weight.shape[1]),
        ]
        mean = torch.cat([features.local_root.mean, features.body.mean])[rows]
        std = torch.cat([features.local_root.std, features.body.std])[rows]
        last.weight = nn.Parameter(last.weight.detach()[:, rows] * std)
        last.bias = nn.Parameter(last.bias.detach()[rows] * std + mean)
        self.widths = [ROOT_LOCAL, 6 * count, FEET]

    def forward(
        self, tokens: Tensor, num_tokens: Tensor, global_root: Tensor, frame_pose: Tensor, frame_mask: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """The contract's decoder."""
        velocity = self.scale(forward_velocity(global_root, num_tokens * self.network.sizes.frames_per_token))
        made = self.network(tokens, num_tokens, velocity, self.pose(frame_pose), frame_mask)
        root, rotations, contacts = made.split(self.widths, -1)
        # The root arrives at a frame by the velocity of the frame before.
        by = torch.cat([root[:, :1], root[:, :-1]], 1)
        arrived = torch.stack([by[..., 1], by[..., 2], by[..., 0], root[..., 3]], -1)
        return rotations.unflatten(-1, (-1, 6)), integrate_root(global_root[:, 0], arrived), contacts.clamp(0.0, 1.0)


def _turning(joint: int, joints: Joints) -> int:
    """The joint whose rotation a joint has: its own, or that of what it is fixed to."""
    while joint in joints.fixed:
        joint = joints.parents[joint]
    return joint


def forward_velocity(global_root: Tensor, frames: Tensor) -> Tensor:
    """Velocities x and z ``[B, T, 2]`` from each frame to the next; the last of ``frames`` ``[B]`` repeats the one before.

    Of places in two parts, for the reason that `data.roots.local_root_of` gives.
    """
    place = torch.stack([global_root[..., 0], global_root[..., 2]], -1)
    coarse = torch.round(place * 16) / 16
    fine = place - coarse
    step = (coarse[:, 1:] - coarse[:, :-1]) + (fine[:, 1:] - fine[:, :-1])
    batch, steps, _ = step.shape
    index = torch.minimum(torch.arange(steps + 1, device=step.device)[None], frames[:, None] - 2)
    start = torch.arange(batch, device=step.device)[:, None] * steps
    return step.reshape(batch * steps, 2).index_select(0, (start + index).flatten()).reshape(batch, -1, 2) * FPS


@dataclass
class OfficialNetworks:
    """The networks of the release with what their features mean."""

    sizes: Sizes
    features: Features
    root: RootNetwork
    pose: PoseNetwork
    decoder: PoseDecoder

    @staticmethod
    def of(sizes: Sizes, features: Features) -> "OfficialNetworks":
        """With random weights."""
        return OfficialNetworks(sizes, features, RootNetwork(sizes), PoseNetwork(sizes), PoseDecoder(sizes))

    def stages(self, joints: Joints) -> dict[str, nn.Module]:
        """The shipped modules by the names of their ONNX files. The decoder's last layer is changed in place."""
        return {
            "root": OfficialRoot(self.root, self.features, joints),
            "pose": OfficialPose(self.pose, self.features, joints),
            "decoder": OfficialDecoder(self.decoder, self.features, joints),
        }

    def parameters(self) -> dict[str, int]:
        """Numbers that each stage has."""
        networks: dict[str, nn.Module] = {"root": self.root, "pose": self.pose, "decoder": self.decoder}
        return {name: sum(p.numel() for p in network.parameters()) for name, network in networks.items()}
