"""``random-pack``: a pack of any size with random weights, for timing. Its motion means nothing.

It is exported and checked like a trained pack, and has the skeleton of the pack that it is made like, so that requests for
that pack are requests for this one.
"""

from pathlib import Path

import torch
from torch import Generator

from troupe_training.data.conventions import FPS, LENGTH_STEP, MAX_FRAMES, MIN_FRAMES
from troupe_training.data.roots import local_root_of
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import Segments
from troupe_training.export.manifest import About, read_manifest
from troupe_training.export.motionbricks.pack import export_pack
from troupe_training.models.motionbricks.config import ModelConfig
from troupe_training.models.motionbricks.pose_module import PoseModule
from troupe_training.models.motionbricks.root_module import RootModule
from troupe_training.models.motionbricks.served import Networks
from troupe_training.models.motionbricks.tokenizer import Tokenizer

WALK_MPS = 1.2
HIP_HEIGHT_M = 0.9
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # the identity as a 6D rotation
SPREAD = 0.1  # deviation of pose features


class RandomStore:
    """Stands in for the cache of a data set: a skeleton, and segments of random poses along straight walks."""

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton

    def lengths(self) -> list[int]:
        """Every length."""
        return list(range(MIN_FRAMES, MAX_FRAMES + 1, LENGTH_STEP))

    def batch(self, frames_budget: int, generator: Generator, frames: int | None = None) -> Segments:
        """About ``frames_budget`` frames in segments of ``frames``, as `ClipStore.batch` gives them."""
        frames, joints = frames or MAX_FRAMES, self.skeleton.joint_count
        size = max(2, frames_budget // frames)
        offset = torch.randn(size, 1, joints, 3, generator=generator) * 0.3
        sway = torch.randn(size, frames, joints, 3, generator=generator) * 0.02
        heading = torch.randn(size, 1, generator=generator) * 0.3
        travelled = torch.arange(frames)[None] * (WALK_MPS / FPS)
        height = torch.full_like(travelled, HIP_HEIGHT_M).expand(size, -1)
        turn = heading.expand(-1, frames)
        root = [travelled * torch.sin(turn), height, travelled * torch.cos(turn), torch.cos(turn), torch.sin(turn)]
        global_root = torch.stack(root, -1)
        return Segments(
            positions=offset + sway,
            six_d=torch.tensor(UPRIGHT) + torch.randn(size, frames, joints, 6, generator=generator) * SPREAD,
            velocities=torch.zeros(size, frames, joints, 3),
            contacts=torch.zeros(size, frames, len(self.skeleton.contact_joints)),
            global_root=global_root,
            local_root=local_root_of(global_root),
        )


def random_networks(config: ModelConfig, joints: int, contacts: int) -> Networks:
    """Untrained networks. Rotations come out near the identity: those of arbitrary numbers would hang on their last digits."""
    networks = Networks(Tokenizer(config, joints, contacts), RootModule(config, joints), PoseModule(config, joints))
    mean = torch.tensor([0.0, 0, 0, *UPRIGHT]).repeat(joints)
    for module in (networks.tokenizer.decoder, networks.root, networks.pose):
        module.pose_scale.set(mean, torch.full_like(mean, SPREAD))
    return networks


def random_pack(out: Path, like: Path, config: ModelConfig, preset: str, seed: int) -> dict[str, int]:
    """Writes the pack folder and returns the parameters of its networks."""
    torch.manual_seed(seed)
    store = RandomStore(Skeleton.of_manifest(read_manifest(like)))
    networks = random_networks(config, store.skeleton.joint_count, len(store.skeleton.contact_joints))
    counts = networks.parameters()
    about = About(
        out.resolve().name,
        "0.0.0",
        "Apache-2.0",
        ["random weights, for timing only: the motion means nothing"],
        {"preset": preset, "random_weights_seed": seed},
    )
    export_pack(out, about, store, networks)
    return counts
