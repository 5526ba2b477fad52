"""Sizes of the official networks, and the layout of their features. `published` has those of the public release."""

from dataclasses import dataclass

import torch
from torch import Tensor

ROOT_GLOBAL = 5  # x, y, z, cosine and sine of the heading
ROOT_LOCAL = 4  # angular velocity, velocity x and z, height
FEET = 4  # left ankle and toe, right ankle and toe


@dataclass(frozen=True)
class Transformers:
    """Of one network: width, attention heads, layers, and the width of feed-forward layers, which PyTorch sets."""

    width: int
    heads: int
    layers: int
    feedforward: int = 2048


@dataclass(frozen=True)
class Convolutions:
    """Of one decoder: channels, residual blocks at each frame rate, and by how much their dilation grows."""

    channels: int
    depth: int
    dilation: int


@dataclass(frozen=True)
class PoseSizes:
    """Of the pose module. Features are widths of what is joined before the transformer."""

    transformer: Transformers
    pose_features: int
    root_features: int
    length_features: int
    token_layers: int  # of the perceptron that embeds tokens


@dataclass(frozen=True)
class RootSizes:
    """Of the root module. ``transformer`` has the layers that choose the count; ``later_layers`` follow the choice."""

    transformer: Transformers
    later_layers: int
    pose_features: int
    local_features: int
    global_features: int
    slot_layers: int  # of the perceptron that embeds keyframes
    convolutions: Convolutions


@dataclass(frozen=True)
class Sizes:
    """Of all three networks. A token has ``2 ** halvings`` frames, and a segment as many context frames and targets each."""

    joints: int
    min_tokens: int
    max_tokens: int
    halvings: int
    heads: int
    codes: int  # of each head
    code_width: int  # of all heads together
    pose: PoseSizes
    root: RootSizes
    decoder: Convolutions

    @property
    def frames_per_token(self) -> int:
        """Frames of a token, context frames and targets."""
        return 2**self.halvings

    @property
    def counts(self) -> int:
        """Token counts to choose from."""
        return self.max_tokens - self.min_tokens + 1

    @property
    def pose_width(self) -> int:
        """Pose features: the root's height, positions of the other joints, rotations of all."""
        return 1 + 3 * (self.joints - 1) + 6 * self.joints

    @property
    def body_width(self) -> int:
        """Body features: positions, rotations, velocities, contacts."""
        return 3 * (self.joints - 1) + 6 * self.joints + 3 * self.joints + FEET


class Scale:
    """Mean and deviation of features, as the release uses them: a small number keeps deviations off zero."""

    def __init__(self, mean: Tensor, std: Tensor):
        self.mean = mean
        self.std = torch.sqrt(std**2 + 1e-5)

    def __getitem__(self, index: slice | list[int]) -> "Scale":
        """Of some of the features."""
        part = Scale(self.mean[index], self.std[index])
        part.std = self.std[index]
        return part

    def apply(self, x: Tensor) -> Tensor:
        """Physical to standardised."""
        return (x - self.mean) / self.std

    def invert(self, x: Tensor) -> Tensor:
        """Standardised to physical."""
        return x * self.std + self.mean


@dataclass
class Features:
    """Scales of everything that the networks read and write; one file has all: global root, local root, body."""

    global_root: Scale
    local_root: Scale
    body: Scale
    joints: int

    @staticmethod
    def of(mean: Tensor, std: Tensor, joints: int) -> "Features":
        """From the release's arrays."""
        scale = Scale(mean.float(), std.float())
        first = ROOT_GLOBAL + ROOT_LOCAL
        return Features(scale[:ROOT_GLOBAL], scale[ROOT_GLOBAL:first], scale[first:], joints)

    @property
    def pose(self) -> Scale:
        """Of pose features."""
        height, body = self.local_root[ROOT_LOCAL - 1 :], self.body[: 9 * self.joints - 3]
        joined = Scale(torch.cat([height.mean, body.mean]), torch.cat([height.std, body.std]))
        joined.std = torch.cat([height.std, body.std])
        return joined
