"""Distillation: a small pack learns from the trained networks of a large one, and speaks its tokens.

The small tokenizer keeps the teacher's encoder and codebooks, which are not served; its decoder, root and pose modules are
new. The root module takes the teacher's trajectory as part of its aim, because that has no noise of single takes; the pose
module takes the teacher's probabilities of all codes beside the true one.
"""

from torch import Tensor
from torch.nn import functional as F

from troupe_training.models.motionbricks.tokenizer import Tokenizer

# Shares of the aim that are the teacher's; the rest is the truth.
ROOT_SHARE = 0.6
POSE_SHARE = 0.7


def lend_tokens(teacher: Tokenizer, student: Tokenizer) -> None:
    """Gives a new tokenizer the teacher's encoder and codebooks, and fixes them.

    Raises `SystemExit` if the sizes differ, because tokens would mean something else.
    """
    parts = {"encoder": (student.encoder, teacher.encoder), "quantizer": (student.quantizer, teacher.quantizer)}
    for name, (mine, theirs) in parts.items():
        try:
            mine.load_state_dict(theirs.state_dict())
        except RuntimeError as error:
            raise SystemExit(f"the teacher's {name} has other sizes than the preset's: {error}") from error
        mine.requires_grad_(False)


def soft_target(truth: Tensor, taught: Tensor, share: float) -> Tensor:
    """The truth, moved to what the teacher says by ``share``."""
    return truth + share * (taught - truth)


def taught_entropy(logits: Tensor, taught: Tensor) -> Tensor:
    """Cross-entropy ``[...]`` of logits ``[..., C]`` against the teacher's probabilities."""
    return -(F.softmax(taught, -1) * F.log_softmax(logits, -1)).sum(-1)
