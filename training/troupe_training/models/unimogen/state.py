"""From motion to what the network denoises, and back.

Every frame is seen from its path: the path's point ``p`` on the ground and heading ``psi``. With lengths as shares of
the body's size and ``Y(psi)`` the rotation about +Y:

- row 0: ``Y(-psi) (root - p)`` for x and z, and ``(root height - neutral height)``, min-max normalised to -1..1;
- row 1 (the root joint): the columns of ``Y(-psi) D[root]``, others: the columns of the bend ``L``; less those of the identity,
  times `BEND_GAIN`.
- the network sees the path's velocity in its own frame, and its turn rate.

So a motion that starts elsewhere or heads elsewhere is the same to the network, exactly.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from troupe_training.data.bodies import Body
from troupe_training.data.conventions import FPS
from troupe_training.data.precision import full_precision
from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix, wrap_angle, yaw_matrix

BEND_GAIN = 2.0
MAX_TURN = 15.0  # radians a second, of the path's features
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass
class Path2D:
    """Where B characters should go: ``points`` ``[B, T, 2]`` (x and z, metres) and ``heading`` ``[B, T]`` (radians)."""

    points: Tensor
    heading: Tensor

    def features(self, size_m: float) -> Tensor:
        """The network's view of the path ``[B, T, 3]``: velocity to the left and ahead in sizes a second, turn rate in radians.

        Frame 0 has that of frame 1.
        """
        step = (self.points[:, 1:] - self.points[:, :-1]) * (FPS / size_m)
        c, s = torch.cos(self.heading[:, 1:]), torch.sin(self.heading[:, 1:])
        left = c * step[..., 0] - s * step[..., 1]
        ahead = s * step[..., 0] + c * step[..., 1]
        turn = wrap_angle(self.heading[:, 1:] - self.heading[:, :-1]) * FPS
        # Headings of one who lies on the side are ill-defined and flip.
        features = torch.stack([left, ahead, turn.clamp(-MAX_TURN, MAX_TURN)], -1)
        return torch.cat([features[:, :1], features], 1)


@dataclass
class Range:
    """Lowest and highest offset of the root from its path, left, up and ahead, in sizes: what is -1 and 1 to the network."""

    low: Tensor  # [3]
    high: Tensor  # [3]

    def normalise(self, offset: Tensor) -> Tensor:
        """``[..., 3]`` to about -1..1."""
        return (offset - self.low) / (self.high - self.low) * 2 - 1

    def restore(self, value: Tensor) -> Tensor:
        """Inverse of `normalise`."""
        return (value + 1) / 2 * (self.high - self.low) + self.low


@full_precision
def root_offsets(body: Body, root: Tensor, path: Path2D) -> Tensor:
    """Offsets ``[B, T, 3]`` of root positions ``[B, T, 3]`` from the path, in sizes: left, up, ahead."""
    gap = root - torch.stack(
        [path.points[..., 0], torch.full_like(path.heading, body.height_m), path.points[..., 1]], -1
    )
    return (yaw_matrix(-path.heading) @ gap[..., None])[..., 0] / body.size_m


@full_precision
def encode(body: Body, root: Tensor, bends: Tensor, path: Path2D, limits: Range) -> Tensor:
    """Rows ``[B, J + 1, T, 6]`` of motion: root positions ``[B, T, 3]`` (m), columns of bends ``[B, T, J, 6]``."""
    place = limits.normalise(root_offsets(body, root, path))
    first = yaw_matrix(-path.heading) @ six_d_to_matrix(bends[:, :, 0])
    columns = torch.cat([matrix_to_six_d(first)[:, :, None], bends[:, :, 1:]], 2)
    joints = (columns - bends.new_tensor(IDENTITY)) * BEND_GAIN
    place = torch.cat([place, torch.zeros_like(place)], -1)
    return torch.cat([place[:, None], joints.transpose(1, 2)], 1)


@full_precision
def decode(body: Body, rows: Tensor, path: Path2D, limits: Range) -> tuple[Tensor, Tensor]:
    """Root positions ``[B, T, 3]`` (m) and bends ``[B, T, J, 3, 3]`` of rows ``[B, J + 1, T, 6]``."""
    offset = limits.restore(rows[:, 0, :, :3]) * body.size_m
    ground = (yaw_matrix(path.heading) @ offset[..., None])[..., 0]
    root = torch.stack(
        [ground[..., 0] + path.points[..., 0], offset[..., 1] + body.height_m, ground[..., 2] + path.points[..., 1]], -1
    )
    bends = six_d_to_matrix(rows[:, 1:].transpose(1, 2) / BEND_GAIN + rows.new_tensor(IDENTITY))
    first = yaw_matrix(path.heading) @ bends[:, :, 0]
    return root, torch.cat([first[:, :, None], bends[:, :, 1:]], 2)


class BodyKinematics:
    """A body's forward kinematics over bends, level by level of its tree."""

    def __init__(self, body: Body):
        parents = body.skeleton.parents
        depth = [len(body.ancestors(j)) for j in range(body.joint_count)]
        self.levels = [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]
        order = [j for level in self.levels for j in level]
        self.back = torch.tensor([order.index(j) for j in range(body.joint_count)])
        above = [
            [self.levels[max(i - 1, 0)].index(parents[j]) if parents[j] >= 0 else 0 for j in level]
            for i, level in enumerate(self.levels)
        ]
        self.above = [torch.tensor(a) for a in above]
        self.parents = torch.tensor([max(p, 0) for p in parents])
        self.bones = torch.tensor(body.bones, dtype=torch.float32)
        self.ancestors = torch.from_numpy(body.skeleton.ancestor_matrix())
        self.neutral = torch.tensor(body.rotations, dtype=torch.float32)

    def turned(self, bends: Tensor) -> Tensor:
        """Bends ``L`` ``[..., J, 3, 3]`` to turns out of the neutral pose ``D``."""
        made = [bends[..., self.levels[0], :, :]]
        for level, above in zip(self.levels[1:], self.above[1:], strict=True):
            made.append(made[-1][..., above, :, :] @ bends[..., level, :, :])
        return torch.cat(made, -3)[..., self.back, :, :]

    def positions(self, root: Tensor, turned: Tensor) -> Tensor:
        """Joint positions ``[..., J, 3]`` from root positions ``[..., 3]`` and ``D`` ``[..., J, 3, 3]``."""
        bones = (turned[..., self.parents, :, :] @ self.bones[..., None])[..., 0]
        return torch.einsum("lj,...ji->...li", self.ancestors, bones) + root[..., None, :]

    def rotations(self, turned: Tensor) -> Tensor:
        """World rotations ``[..., J, 3, 3]`` of the skeleton's own joints from ``D``."""
        return turned @ self.neutral
