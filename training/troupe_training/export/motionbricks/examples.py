"""Inputs of the exported stages, made of segments as the server pads them."""

from typing import Protocol

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.store import SegmentSource
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, MAX_TOKENS, MIN_TOKENS, SLOTS
from troupe_training.train.motionbricks.masks import random_keyframe_mask, slot_frames

Inputs = dict[str, Tensor]  # of one stage, in the order of its arguments


class Codebooks(Protocol):
    """Heads of a token, and the codes of each."""

    @property
    def heads(self) -> int:
        """Codebooks of a token."""

    @property
    def codes(self) -> int:
        """Codes of each."""


def example_inputs(
    store: SegmentSource,
    pose: Codebooks,
    batch: int,
    slots: int,
    seed: int,
    root_choices: int = 0,
    min_tokens: int = MIN_TOKENS,
) -> dict[str, Inputs]:
    """Inputs of each stage: ``batch`` segments of ``min_tokens`` to ``slots`` tokens, padded to ``slots``.

    If roots have ``root_choices``, every other row has noise for them.
    """
    generator = Generator().manual_seed(seed)
    joints, padded_frames = store.skeleton.joint_count, slots * FRAMES_PER_TOKEN
    fitting = [length for length in store.lengths() if min_tokens * FRAMES_PER_TOKEN <= length <= padded_frames]
    lengths = [fitting[int(i)] for i in torch.randint(len(fitting), (batch,), generator=generator)]
    frame_pose, roots = torch.zeros(batch, padded_frames, joints * 9), torch.zeros(batch, padded_frames, 5)
    mask = torch.zeros(batch, padded_frames)
    keys = {
        "local_root": torch.zeros(batch, SLOTS, 4),
        "global_root": torch.zeros(batch, SLOTS, 5),
        "pose": torch.zeros(batch, SLOTS, joints * 9),
    }
    for row, frames in enumerate(lengths):
        segment = store.batch(1, generator, frames)
        mask[row, :frames] = random_keyframe_mask(2, frames, generator)[0]
        frame_pose[row, :frames] = segment.pose[0] * mask[row, :frames, None]
        roots[row, :frames] = segment.global_root[0]
        index = slot_frames(frames)
        keys["local_root"][row] = segment.local_root[0, index]
        keys["global_root"][row] = segment.global_root[0, index]
        keys["pose"][row] = segment.pose[0, index]
    num_tokens = torch.tensor(lengths) // FRAMES_PER_TOKEN
    choices = MAX_TOKENS - min_tokens + 1
    root = _root_inputs(keys, num_tokens - min_tokens, choices, generator)
    tokens = torch.randint(pose.codes, (batch, slots, pose.heads), generator=generator)
    noise = {"count_noise": torch.randn(batch, choices, generator=generator)}
    if root_choices:
        noise["root_noise"] = torch.randn(batch, root_choices, generator=generator)
        noise["root_noise"][1::2] = 0.0
    shared = {"num_tokens": num_tokens, "global_root": roots, "frame_pose": frame_pose, "frame_mask": mask}
    return {
        "root": root | noise,
        "pose": {"tokens": torch.full_like(tokens, pose.codes)} | shared,
        "decoder": {"tokens": tokens} | shared,
    }


def _root_inputs(keys: Inputs, counts: Tensor, choices: int, generator: Generator) -> Inputs:
    """Slot values ``[B, 8, .]``, some of the targets left out, and ``choices`` counts: some just the true one."""
    batch = len(counts)
    given = {}
    for name in keys:
        given[name] = torch.ones(batch, SLOTS)
        given[name][:, CONTEXT_FRAMES:] = (torch.rand(batch, MAX_TARGETS, generator=generator) < 0.5).float()
    allowed = (torch.rand(batch, choices, generator=generator) < 0.5).float()
    allowed[torch.arange(batch), counts] = 1.0
    allowed[: batch // 3] = F.one_hot(counts[: batch // 3], choices).float()
    values = {f"key_{name}": value * given[name][..., None] for name, value in keys.items()}
    return values | {f"has_{name}": mask for name, mask in given.items()} | {"allowed_counts": allowed}
