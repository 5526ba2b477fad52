"""Motions as an evaluation sees them: root positions and world rotations, and what follows from them."""

from dataclasses import dataclass

import torch

from troupe_training.features import Segments
from troupe_training.losses import Kinematics
from troupe_training.rotations import matrix_to_six_d, six_d_to_matrix


@dataclass
class Motion:
    """B motions of N frames in the segment frame, metres."""

    root: torch.Tensor  # [B, N, 3], the root joint's position
    rotations: torch.Tensor  # [B, N, J, 3, 3], world
    contacts: torch.Tensor | None = None  # [B, N, C], 0 to 1, where a network gave them

    @staticmethod
    def of(segments: Segments) -> "Motion":
        """What was captured."""
        return Motion(segments.global_root[..., :3], six_d_to_matrix(segments.six_d), segments.contacts)

    def slice(self, start: int, end: int) -> "Motion":
        """The frames ``start..end``."""
        contacts = None if self.contacts is None else self.contacts[:, start:end]
        return Motion(self.root[:, start:end], self.rotations[:, start:end], contacts)

    def world(self, kinematics: Kinematics) -> torch.Tensor:
        """Joint positions ``[B, N, J, 3]`` by forward kinematics."""
        return kinematics.positions(self.rotations) + self.root[:, :, None]

    def headings(self, left_axis: torch.Tensor) -> torch.Tensor:
        """Headings ``[B, N]`` of the pelvis, radians: its left, turned a quarter about +Y, on the ground."""
        left = self.rotations[:, :, 0] @ left_axis
        return torch.atan2(-left[..., 2], left[..., 0])


def concatenate(parts: list[Motion]) -> Motion:
    """Motions one after the other in time."""
    with_contacts = all(p.contacts is not None for p in parts)
    return Motion(
        torch.cat([p.root for p in parts], 1),
        torch.cat([p.rotations for p in parts], 1),
        torch.cat([p.contacts for p in parts], 1) if with_contacts else None,
    )


def global_root_of(motion: Motion, left_axis: torch.Tensor) -> torch.Tensor:
    """``[B, N, 5]``: x, y, z, cos and sin of the pelvis's heading."""
    psi = motion.headings(left_axis)
    return torch.cat([motion.root, torch.cos(psi)[..., None], torch.sin(psi)[..., None]], -1)


def pose_features(motion: Motion, kinematics: Kinematics) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions ``[B, N, J, 3]`` relative to the projected root, and 6D world rotations ``[B, N, J, 6]``."""
    height = motion.root * torch.tensor([0.0, 1.0, 0.0], device=motion.root.device)
    return kinematics.positions(motion.rotations) + height[:, :, None], matrix_to_six_d(motion.rotations)


def local_rotations(rotations: torch.Tensor, parents: list[int]) -> torch.Tensor:
    """World rotations ``[..., J, 3, 3]`` to parent-relative ones; those of the root stay."""
    above = [max(p, 0) for p in parents]
    local = rotations[..., above, :, :].transpose(-1, -2) @ rotations
    roots = torch.tensor([p < 0 for p in parents], device=rotations.device)[:, None, None]
    return torch.where(roots, rotations, local)


def world_rotations(local: torch.Tensor, parents: list[int]) -> torch.Tensor:
    """Parent-relative rotations ``[..., J, 3, 3]`` to world ones."""
    world: list[torch.Tensor] = []
    for j, parent in enumerate(parents):
        own = local[..., j, :, :]
        world.append(own if parent < 0 else world[parent] @ own)
    return torch.stack(world, -3)
