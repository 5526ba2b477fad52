"""The decoder's carried keyframes: given poses turned with the root and interpolated, and how far to trust them.

A decoder that has to press every pose through its narrow layers misses even those it is given, by centimetres, and with them
whatever of a character's bearing does not change on the way. So it starts from the keyframes as the Δ-interpolator does
(Oreshkin et al. 2024): the frames between two keyframes hold their interpolation, those before the first and behind the last hold
that one, each turned to the heading that the root has there. What is served is a mixture of this and of what the network
gives, by shares that are learnt for each number and each distance to a keyframe.
"""

import torch
from torch import Tensor, nn

from troupe_training.data.conventions import MAX_FRAMES
from troupe_training.data.precision import full_precision

# Distance in frames at which the shares begin to learn from 37 %.
FIRST_REACH_FRAMES = 6.0


def neighbours(mask: Tensor) -> tuple[Tensor, Tensor]:
    """For each frame 1 at the last keyframe up to it, and 1 at the first from it on: ``[B, T, T]`` of 0/1, from ``[B, T]``.

    A keyframe is its own neighbour on both sides. The number of keyframes up to a frame identifies its gap.
    """
    count = mask.cumsum(-1)
    before = (count[:, :, None] == count[:, None, :]).float() * mask[:, None]
    after = ((count - mask)[:, :, None] + 1.0 == count[:, None, :]).float() * mask[:, None]
    return before, after


def interpolation(mask: Tensor) -> tuple[Tensor, Tensor]:
    """Shares ``[B, T, T]`` of each frame (last axis) in every other's interpolation, and the distance to the nearest keyframe.

    Rows are zero, and distances `MAX_FRAMES`, where ``mask`` ``[B, T]`` has no keyframe.
    """
    before, after = neighbours(mask)
    place = torch.arange(mask.shape[1], device=mask.device, dtype=torch.float32)
    # Not `place - (before * place).sum(-1)`, shorter as it is: OpenVINO fuses that into something
    # wrong (docs/engines.md).
    lag = place[:, None] - place
    has_before, has_after = before.sum(-1), after.sum(-1)
    behind, ahead = (before * lag).sum(-1), -(after * lag).sum(-1)
    between = has_before * has_after
    way = between * behind / (behind + ahead).clamp_min(1.0)
    shares = (has_before - way)[..., None] * before + (way + has_after - between)[..., None] * after
    far = float(MAX_FRAMES)
    behind, ahead = far + has_before * (behind - far), far + has_after * (ahead - far)
    # A keyframe counts as behind and ahead of itself, with shares of 1 and 0.
    return shares, torch.minimum(behind, ahead)


def usual_heights(mean: Tensor) -> Tensor:
    """Of the means ``[J*9]`` of poses those of vertical components, zeros for the others."""
    return mean * torch.tensor([0.0, 1.0, 0.0], device=mean.device).repeat(len(mean) // 3)


class CarriedPose(nn.Module):
    """Keyframe poses ``[B, T, J*9]`` at every frame."""

    def __init__(self, joints: int):
        super().__init__()
        width = joints * 9
        distance = torch.arange(MAX_FRAMES + 1)[:, None]
        self.trust = nn.Parameter(torch.exp(-distance / FIRST_REACH_FRAMES).expand(-1, width).clone())

    @full_precision
    def forward(self, pose: Tensor, mask: Tensor, global_root: Tensor, heights: Tensor) -> tuple[Tensor, Tensor]:
        """Poses less ``heights``, zero without a keyframe before that, and distances ``[B, T]`` to the nearest keyframe.

        ``pose`` ``[B, T, J*9]`` in physical units is zero if ``mask`` ``[B, T]`` is 0; ``global_root`` ``[B, T, 5]``.
        ``heights`` ``[J*9]`` are usual values of what no turn changes (`usual_heights`). A head is never far from 1.6 m up:
        where an engine computes in 16 bits, the centimetres by which it is would be lost beside them.
        """
        shares, distance = interpolation(mask)
        cosine, sine = global_root[..., 3:4], global_root[..., 4:5]
        # Subtracted in given frames, and from zeros in all others.
        pose = pose - heights * mask[..., None]
        nothing = (1.0 - mask.amax(-1, keepdim=True))[..., None]
        x, y, z = pose.unflatten(-1, (-1, 3)).permute(0, 3, 1, 2).unbind(1)
        # Interpolated as seen from their own headings, then turned to those of the frames they come
        # to.
        right, forward = shares @ (x * cosine - z * sine), shares @ (z * cosine + x * sine)
        x, z = right * cosine + forward * sine, forward * cosine - right * sine
        # Not stacked on the last axis, which takes OpenVINO seven times as long (docs/engines.md).
        vectors = torch.stack([x, shares @ y, z], 1).permute(0, 2, 3, 1)
        return vectors.flatten(2) - heights * nothing, distance.long()

    def shares(self, distance: Tensor) -> Tensor:
        """How far to trust carried poses ``[B, T, J*9]`` at distances ``[B, T]``."""
        return self.trust.index_select(0, distance.flatten()).unflatten(0, distance.shape)
