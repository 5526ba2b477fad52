"""Distillation: a small pack learns from the trained networks of a large one, and speaks its tokens.

The small tokenizer keeps the teacher's encoder and codebooks, which are not served; its decoder, root and pose modules are
new. The root module takes the teacher's trajectory as part of its aim, for that has no noise of single takes; the pose module
takes the teacher's probabilities of all codes beside the true one.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch.nn import functional as F

from troupe_training.pose_module import PoseModule
from troupe_training.root_module import RootModule
from troupe_training.tokenizer import Tokenizer

# Shares of the aim that are the teacher's; the rest is the truth.
ROOT_SHARE = 0.6
POSE_SHARE = 0.7


@dataclass
class Teacher:
    """The trained networks of a large pack, whose weights stay as they are."""

    tokenizer: Tokenizer
    root: RootModule
    pose: PoseModule

    def lend_tokens(self, student: Tokenizer) -> None:
        """Gives a new tokenizer the teacher's encoder and codebooks, and fixes them.

        Raises `SystemExit` where the sizes differ, for tokens would mean something else.
        """
        for name in ("encoder", "quantizer"):
            mine, theirs = getattr(student, name), getattr(self.tokenizer, name)
            try:
                mine.load_state_dict(theirs.state_dict())
            except RuntimeError as error:
                raise SystemExit(
                    f"the teacher's {name} has other sizes than the preset's: {error}"
                ) from error
            mine.requires_grad_(False)


def soft_target(truth: torch.Tensor, taught: torch.Tensor, share: float) -> torch.Tensor:
    """The truth, moved to what the teacher says by ``share``."""
    return truth + share * (taught - truth)


def taught_entropy(logits: torch.Tensor, taught: torch.Tensor) -> torch.Tensor:
    """Cross-entropy ``[...]`` of logits ``[..., C]`` against the teacher's probabilities."""
    return -(F.softmax(taught, -1) * F.log_softmax(logits, -1)).sum(-1)


def load_teacher(run: Path, load, store) -> Teacher:
    """The networks of a finished run; ``load`` is `stages.load`."""
    tokenizer, root, pose = (load(run, stage, store) for stage in ("refine", "root", "pose"))
    return Teacher(tokenizer, root, pose)
