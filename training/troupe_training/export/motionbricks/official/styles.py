"""The release's clips as styles of a pack: target poses of each mode, and the speed that it walks at.

Its modes differ in nothing but their target poses and speeds, so a mode is one gait. Its clips need not be cycles.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from troupe_training.data.rotations import matrix_to_quat, yaw_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError, read_tensors
from troupe_training.models.motionbricks.official.served import Joints
from troupe_training.models.motionbricks.official.sizes import Sizes

CLIPS = "G1-clip.ckpt"
MOST_KEYS = 12
REPLAN_FRAMES = 9


@dataclass(frozen=True)
class Mode:
    """A mode of the release. Clips lie in the file in the order of `MODES`; it does not have their names."""

    style: str
    gait: str
    forward_mps: float = 0.0
    left_mps: float = 0.0
    most_tokens: int = 11


# Speeds are half of what the release's spring is given, which is what a character reaches.
MODES = (
    Mode("normal", "idle"),
    Mode("normal", "slow", 0.3),
    Mode("normal", "walk", 1.0),
    Mode("hand-crawl", "walk", 0.5),
    Mode("boxing", "walk", 1.0, most_tokens=16),
    Mode("elbow-crawl", "walk", 0.8, most_tokens=16),
    Mode("stealth", "walk", 1.0),
    Mode("injured", "walk", 0.5),
    Mode("crouch", "walk", 0.7),
    Mode("happy-dance", "walk", 1.0),
    Mode("zombie", "walk", 0.6),
    Mode("gun", "walk", 0.6),
    Mode("scared", "walk", 0.6),
    Mode("normal", "left", left_mps=0.2),
    Mode("normal", "right", left_mps=-0.2),
)


def write_styles(out: Path, pack: Path, skeleton: Skeleton, joints: Joints, sizes: Sizes) -> list[str]:
    """Writes ``styles/*.json`` of a pack by the clips in the release's folder ``out``; gives the styles' names."""
    clips = read_tensors(out / CLIPS)
    names = ("global_joint_rotations", "global_joint_positions", "num_frames_per_clip")
    if any(not isinstance(clips.get(name), Tensor) or len(clips[name]) != len(MODES) for name in names):
        raise ReleaseError(f"{out / CLIPS} has not {len(MODES)} clips with {', '.join(names)}")
    rotations, positions, lengths = (clips[name] for name in names)
    styles: dict[str, dict[str, Any]] = {}
    for number, mode in enumerate(MODES):
        frames = int(lengths[number])
        gait = _gait(mode, rotations[number, :frames].float(), positions[number, :frames, 0, 1], skeleton, joints)
        style = styles.setdefault(mode.style, _style(mode, sizes))
        style["gaits"].append(gait)
        style["default_speed"] = max(style["default_speed"], mode.forward_mps)
    folder = pack / "styles"
    folder.mkdir(parents=True, exist_ok=True)
    for name, style in styles.items():
        (folder / f"{name}.json").write_text(json.dumps(style, sort_keys=True) + "\n")
    return sorted(styles)


def _style(mode: Mode, sizes: Sizes) -> dict[str, Any]:
    counts = range(sizes.min_tokens, mode.most_tokens + 1)
    return {
        "name": mode.style,
        "default_speed": 0.0,
        "replan_interval_frames": REPLAN_FRAMES,
        "allowed_token_counts": [] if counts.stop > sizes.max_tokens else list(counts),
        "is_static": False,
        "root_ratio": 0.0,
        "gaits": [],
    }


def _gait(mode: Mode, rotations: Tensor, heights: Tensor, skeleton: Skeleton, joints: Joints) -> dict[str, Any]:
    """A gait of frames that are spread evenly over a clip: one, if it stands."""
    moves = mode.forward_mps != 0.0 or mode.left_mps != 0.0
    count = min(MOST_KEYS, len(rotations)) if moves else 1
    picked = [frame * len(rotations) // count for frame in range(count)]
    quaternions = key_rotations(rotations[picked], skeleton, joints)
    velocity = {"forward": mode.forward_mps, "left": mode.left_mps, "turn": 0.0}
    keys = [
        {**velocity, "height": round(float(height), 5), "rotations": [round(float(v), 5) for v in quat.flatten()]}
        for quat, height in zip(quaternions, heights[picked], strict=True)
    ]
    return {
        **velocity,
        "name": mode.gait,
        "period_frames": float(len(rotations)) if count > 1 else 0.0,
        "key_count": count,
        "keys": keys,
    }


def key_rotations(rotations: Tensor, skeleton: Skeleton, joints: Joints) -> Tensor:
    """The release's world rotations ``[F, J, 3, 3]`` as quaternions ``[F, J, 4]`` of a key in the pack's order.

    The root's is without its heading, the others are relative to their parents. Joints without a hinge do not turn.
    """
    world = rotations[:, joints.theirs]
    left = world[:, 0] @ torch.tensor(skeleton.left_axis)
    heading = torch.atan2(-left[:, 2], left[:, 0])
    relative = [yaw_matrix(-heading) @ world[:, 0]]
    for joint in range(1, len(joints.theirs)):
        if joints.theirs[joint] in joints.fixed:
            relative.append(torch.eye(3).expand(len(world), 3, 3))
        else:
            relative.append(world[:, skeleton.parents[joint]].transpose(-1, -2) @ world[:, joint])
    return matrix_to_quat(torch.stack(relative, 1))
