"""Motions as root positions and world rotations, as networks answer and measures read them."""

from dataclasses import dataclass

import torch
from torch import Tensor

from troupe_training.data.kinematics import Kinematics
from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix
from troupe_training.data.store import Segments


@dataclass
class Motion:
    """B motions of N frames in the segment frame, metres."""

    root: Tensor  # [B, N, 3], the root joint's position
    rotations: Tensor  # [B, N, J, 3, 3], world
    contacts: Tensor | None = None  # [B, N, C], 0 to 1, where a network gave them

    @staticmethod
    def of(segments: Segments) -> "Motion":
        """The captured motion."""
        return Motion(segments.global_root[..., :3], six_d_to_matrix(segments.six_d), segments.contacts)

    def slice(self, start: int, end: int) -> "Motion":
        """The frames ``start..end``."""
        contacts = None if self.contacts is None else self.contacts[:, start:end]
        return Motion(self.root[:, start:end], self.rotations[:, start:end], contacts)

    def world(self, kinematics: Kinematics) -> Tensor:
        """Joint positions ``[B, N, J, 3]`` by forward kinematics."""
        return kinematics.positions(self.rotations) + self.root[:, :, None]

    def headings(self, left_axis: Tensor) -> Tensor:
        """Headings ``[B, N]`` of the pelvis, radians: its left, turned a quarter about +Y, on the ground."""
        left = self.rotations[:, :, 0] @ left_axis
        return torch.atan2(-left[..., 2], left[..., 0])

    def global_root(self, left_axis: Tensor) -> Tensor:
        """``[B, N, 5]``: x, y, z, cos and sin of the pelvis's heading."""
        psi = self.headings(left_axis)
        return torch.cat([self.root, torch.cos(psi)[..., None], torch.sin(psi)[..., None]], -1)


def concatenate(parts: list[Motion]) -> Motion:
    """Motions one after the other in time, without contacts."""
    return Motion(torch.cat([p.root for p in parts], 1), torch.cat([p.rotations for p in parts], 1))


def pose_features(motion: Motion, kinematics: Kinematics) -> tuple[Tensor, Tensor]:
    """Positions ``[B, N, J, 3]`` relative to the projected root, and 6D world rotations ``[B, N, J, 6]``."""
    height = motion.root * torch.tensor([0.0, 1.0, 0.0], device=motion.root.device)
    return kinematics.positions(motion.rotations) + height[:, :, None], matrix_to_six_d(motion.rotations)


def local_rotations(rotations: Tensor, parents: list[int]) -> Tensor:
    """World rotations ``[..., J, 3, 3]`` to parent-relative ones; those of the root stay."""
    above = [max(p, 0) for p in parents]
    local = rotations[..., above, :, :].transpose(-1, -2) @ rotations
    roots = torch.tensor([p < 0 for p in parents], device=rotations.device)[:, None, None]
    return torch.where(roots, rotations, local)


def world_rotations(local: Tensor, parents: list[int]) -> Tensor:
    """Parent-relative rotations ``[..., J, 3, 3]`` to world ones."""
    world: list[Tensor] = []
    for j, parent in enumerate(parents):
        own = local[..., j, :, :]
        world.append(own if parent < 0 else world[parent] @ own)
    return torch.stack(world, -3)
