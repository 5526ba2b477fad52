"""Forward kinematics in PyTorch, and how near feet are to the ground."""

import torch
from torch import Tensor

from troupe_training.data.precision import full_precision
from troupe_training.data.skeleton import Skeleton

# A joint lower than this above its resting height counts as near the ground, as in the foot-skate
# figure.
SKATE_HEIGHT_M = 0.025


class Kinematics:
    """Forward kinematics with constant offsets: world rotations to joint positions."""

    def __init__(self, skeleton: Skeleton, device: str = "cpu"):
        self.parents = torch.tensor([max(p, 0) for p in skeleton.parents], device=device)
        self.offsets = torch.tensor(skeleton.offsets, dtype=torch.float32, device=device)
        self.ancestors = torch.from_numpy(skeleton.ancestor_matrix()).to(device)

    @full_precision
    def positions(self, rotations: Tensor) -> Tensor:
        """Joint positions relative to the root joint ``[..., J, 3]`` from world rotations ``[..., J, 3, 3]``."""
        bones = torch.einsum("...jik,jk->...ji", rotations[..., self.parents, :, :], self.offsets)
        return torch.einsum("lj,...ji->...li", self.ancestors, bones)


def near_ground(height: Tensor) -> Tensor:
    """1 at or below the resting height, 0 from `SKATE_HEIGHT_M` above it, for heights (m) above the resting height."""
    return (2.0 - 2.0 ** (height / SKATE_HEIGHT_M)).clamp(0.0, 1.0)
