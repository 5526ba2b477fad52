"""``random-pack``: a pack of any size with random weights, for timing. Its motion means nothing.

It is exported and checked like a trained pack, and has the skeleton of the pack that it is made like, so that requests for
that pack are requests for this one.
"""

from pathlib import Path

import tomllib
import torch

from troupe_training.config import FPS, FRAMES_PER_TOKEN, MAX_TOKENS, MIN_TOKENS, ModelConfig
from troupe_training.export import export_pack
from troupe_training.features import Segments, local_root_of
from troupe_training.pose_module import PoseModule
from troupe_training.root_module import RootModule
from troupe_training.skeleton import Skeleton
from troupe_training.tokenizer import Tokenizer

WALK_MPS = 1.2
HIP_HEIGHT_M = 0.9
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # the identity as a 6D rotation
SPREAD = 0.1  # deviation of pose features


class RandomStore:
    """Stands in for the cache of a data set: a skeleton, and segments of random poses along straight walks."""

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton

    def lengths(self) -> list[int]:
        """Every token count."""
        return list(range(MIN_TOKENS, MAX_TOKENS + 1))

    def batch(self, frames_budget: int, generator: torch.Generator, tokens: int) -> Segments:
        """About ``frames_budget`` frames in segments of ``tokens`` tokens, as `ClipStore.batch` gives them."""
        frames, joints = tokens * FRAMES_PER_TOKEN, self.skeleton.joint_count
        size = max(2, frames_budget // frames)
        offset = torch.randn(size, 1, joints, 3, generator=generator) * 0.3
        sway = torch.randn(size, frames, joints, 3, generator=generator) * 0.02
        heading = torch.randn(size, 1, generator=generator) * 0.3
        travelled = torch.arange(frames)[None] * (WALK_MPS / FPS)
        height = torch.full_like(travelled, HIP_HEIGHT_M).expand(size, -1)
        turn = heading.expand(-1, frames)
        root = [
            travelled * torch.sin(turn),
            height,
            travelled * torch.cos(turn),
            torch.cos(turn),
            torch.sin(turn),
        ]
        global_root = torch.stack(root, -1)
        return Segments(
            positions=offset + sway,
            six_d=torch.tensor(UPRIGHT) + torch.randn(size, frames, joints, 6, generator=generator) * SPREAD,
            velocities=torch.zeros(size, frames, joints, 3),
            contacts=torch.zeros(size, frames, len(self.skeleton.contact_joints)),
            global_root=global_root,
            local_root=local_root_of(global_root),
        )


def skeleton_of(pack: Path) -> Skeleton:
    """The skeleton in a pack's manifest."""
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    table = manifest["skeleton"]
    names = [joint["name"] for joint in table["joints"]]
    contacts = table["contacts"]
    return Skeleton(
        names=names,
        parents=[names.index(joint["parent"]) if joint["parent"] else -1 for joint in table["joints"]],
        offsets=[joint["offset_m"] for joint in table["joints"]],
        left_axis=table["left_axis"],
        contact_joints=[names.index(joint) for joint in contacts["joints"]],
        contact_max_height_m=contacts["max_height_m"],
        contact_max_speed_mps=contacts["max_speed_mps"],
        contact_clearance_m=contacts["clearance_m"],
        robot=manifest.get("robot"),
    )


def parameter_counts(tokenizer: Tokenizer, root: RootModule, pose: PoseModule) -> dict[str, int]:
    """Parameters of each network; the encoder is counted though packs do not hold it."""
    count = lambda module: sum(tensor.numel() for tensor in module.parameters())
    return {
        "encoder": count(tokenizer.encoder),
        "decoder": count(tokenizer.decoder),
        "root": count(root),
        "pose": count(pose),
    }


def random_pack(out: Path, like: Path, config: ModelConfig, preset: str, seed: int) -> dict[str, int]:
    """Writes the pack folder and returns the parameters of its networks."""
    torch.manual_seed(seed)
    store = RandomStore(skeleton_of(like))
    joints, contacts = store.skeleton.joint_count, len(store.skeleton.contact_joints)
    tokenizer, root, pose = (
        Tokenizer(config, joints, contacts),
        RootModule(config, joints),
        PoseModule(config, joints),
    )
    # Rotations come out near the identity: those of arbitrary numbers would hang on their last digits.
    mean = torch.tensor([0.0, 0, 0, *UPRIGHT]).repeat(joints)
    for module in (tokenizer.decoder, root, pose):
        module.pose_scale.set(mean, torch.full_like(mean, SPREAD))
    about = {
        "licence": "Apache-2.0",
        "credits": ["random weights, for timing only: the motion means nothing"],
        "training": {"preset": preset, "random_weights_seed": seed},
    }
    counts = parameter_counts(tokenizer, root, pose)
    name = out.resolve().name
    export_pack(out, name, "0.0.0", config, store, tokenizer, root, pose, about)
    return counts
