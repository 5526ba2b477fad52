"""Frames as VerMo's networks read and write them: in the frame of each own heading, the root by its steps.

Place and heading of a motion are thereby out of its tokens, and the same step has the same token wherever it is taken.
A frame's state is ``D = 6 J + 4`` numbers: world rotations in 6D, turned back by the heading, and the local root. The local
root is what the root does until the next frame: velocity to the side and ahead (m/s) and turn (rad/s), and its height (m).
"""

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import FPS
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.precision import full_precision
from troupe_training.data.rotations import arc_tangent, matrix_to_six_d, six_d_to_matrix
from troupe_training.data.skeleton import Skeleton

LOCAL_ROOT = 4


def turned(vectors: Tensor, cosine: Tensor, sine: Tensor) -> Tensor:
    """Vectors ``[..., 3]`` turned about +Y by an angle of that cosine and sine ``[...]``."""
    x, y, z = vectors.unbind(-1)
    return torch.stack([cosine * x + sine * z, y, cosine * z - sine * x], -1)


@full_precision
def local_root(root: Tensor) -> Tensor:
    """Local roots ``[B, F, 4]`` of roots ``[B, F, 5]`` (x, y, z, cosine and sine of the heading).

    The last frame, which none follows, goes on as the one before it.
    """
    cosine, sine = root[..., 3], root[..., 4]
    step = (root[:, 1:, :3] - root[:, :-1, :3]) * FPS
    step = turned(step, cosine[:, :-1], -sine[:, :-1])
    turn_sine = sine[:, 1:] * cosine[:, :-1] - cosine[:, 1:] * sine[:, :-1]
    turn_cosine = cosine[:, 1:] * cosine[:, :-1] + sine[:, 1:] * sine[:, :-1]
    moves = torch.stack([step[..., 0], step[..., 2], arc_tangent(turn_sine, turn_cosine) * FPS], -1)
    return torch.cat([torch.cat([moves, moves[:, -1:]], 1), root[..., 1:2]], -1)


@full_precision
def integrated(local: Tensor) -> Tensor:
    """Roots ``[B, F, 5]`` of local roots ``[B, F, 4]``, from x = z = 0 and heading 0 on."""
    before = torch.zeros_like(local[:, :1, 0])
    heading = torch.cat([before, torch.cumsum(local[:, :-1, 2], 1) / FPS], 1)
    cosine, sine = torch.cos(heading), torch.sin(heading)
    x = cosine * local[..., 0] + sine * local[..., 1]
    z = cosine * local[..., 1] - sine * local[..., 0]
    place = [torch.cat([before, torch.cumsum(v[:, :-1], 1) / FPS], 1) for v in (x, z)]
    return torch.stack([place[0], local[..., 3], place[1], cosine, sine], -1)


@full_precision
def features(pose: Tensor, root: Tensor) -> Tensor:
    """The encoder's input ``[B, F, 9 J + 4]``: pose features in the frame of each own heading, and the local root.

    ``pose`` ``[B, F, 9 J]`` holds for each joint its position over the projected root and its world rotation in 6D.
    """
    vectors = pose.unflatten(-1, (-1, 3))
    own = turned(vectors, root[..., 3, None], -root[..., 4, None]).flatten(2)
    return torch.cat([own, local_root(root)], -1)


def state_of(read: Tensor) -> Tensor:
    """The state ``[..., D]`` of the output of `features`."""
    pose, local = read[..., :-LOCAL_ROOT], read[..., -LOCAL_ROOT:]
    return torch.cat([pose.unflatten(-1, (-1, 9))[..., 3:].flatten(-2), local], -1)


class Body(nn.Module):
    """A skeleton's kinematics, which become constants of a graph."""

    parents: Tensor
    offsets: Tensor
    ancestors: Tensor

    def __init__(self, skeleton: Skeleton):
        super().__init__()
        self.joints = skeleton.joint_count
        kinematics = Kinematics(skeleton)
        self.register_buffer("parents", kinematics.parents, persistent=False)
        self.register_buffer("offsets", kinematics.offsets, persistent=False)
        self.register_buffer("ancestors", kinematics.ancestors, persistent=False)

    @property
    def state_width(self) -> int:
        """D."""
        return 6 * self.joints + LOCAL_ROOT

    @full_precision
    def split(self, state: Tensor) -> tuple[Tensor, Tensor]:
        """Rotations ``[B, F, J, 3, 3]`` in the frame of each own heading, and local roots ``[B, F, 4]`` of states."""
        six_d, local = state[..., :-LOCAL_ROOT], state[..., -LOCAL_ROOT:]
        return six_d_to_matrix(six_d.unflatten(-1, (self.joints, 6))), local

    @full_precision
    def positions(self, rotations: Tensor, height: Tensor) -> Tensor:
        """Joints ``[B, F, J, 3]`` over the projected root, in the frame of the rotations."""
        # The sum over bones is written as a product of matrices, which ONNX Runtime multiplies
        # faster than an Einsum.
        bones = (rotations[:, :, self.parents] * self.offsets[:, None, :]).sum(-1)
        joints = torch.matmul(self.ancestors, bones)
        level = torch.zeros_like(height)
        return joints + torch.stack([level, height, level], -1)[:, :, None]

    @full_precision
    def frames(self, state: Tensor) -> tuple[Tensor, Tensor]:
        """Pose features ``[B, F, 9 J]`` and roots ``[B, F, 5]`` of states, in the frame of the first root."""
        rotations, local = self.split(state)
        root = integrated(local)
        cosine, sine = root[..., 3, None], root[..., 4, None]
        positions = turned(self.positions(rotations, local[..., 3]), cosine, sine)
        six_d = matrix_to_six_d(rotations).unflatten(-1, (2, 3))
        world = turned(six_d, cosine[..., None], sine[..., None])
        return torch.cat([positions[..., None, :], world], -2).flatten(2), root


def world_joints(pose: Tensor, root: Tensor) -> Tensor:
    """World joint positions ``[B, F, J, 3]`` of pose features and roots."""
    ground = torch.stack([root[..., 0], torch.zeros_like(root[..., 0]), root[..., 2]], -1)
    return pose.unflatten(-1, (-1, 9))[..., :3] + ground[:, :, None]


def from_first(root: Tensor) -> Tensor:
    """Roots ``[B, F, 5]`` in the frame of their first: x = z = 0, heading 0 there."""
    cosine, sine = root[:, :1, 3], root[:, :1, 4]
    offset = root[..., :3] - root[:, :1, :3] * torch.tensor([1.0, 0.0, 1.0], device=root.device)
    place = turned(offset, cosine, -sine)
    turn_cosine = root[..., 3] * cosine + root[..., 4] * sine
    turn_sine = root[..., 4] * cosine - root[..., 3] * sine
    return torch.cat([place, turn_cosine[..., None], turn_sine[..., None]], -1)


def seen_from_first(pose: Tensor, root: Tensor) -> Tensor:
    """World joints ``[B, F, J, 3]`` in the frame of the first root."""
    cosine, sine = root[:, :1, 3, None], root[:, :1, 4, None]
    own = turned(pose.unflatten(-1, (-1, 9))[..., :3], cosine, -sine)
    ground = from_first(root)[..., :3] * torch.tensor([1.0, 0.0, 1.0], device=root.device)
    return own + ground[:, :, None]
