"""The pose module (paper section 5.2): a masked-token transformer over 16 frame slots with K heads.

Each slot embeds four frames of local and global root, four frames of keyframe poses (a learnable embedding where none
is given) and the K tokens, of which those not known yet are masked.
"""

import torch
from torch import Tensor, nn

from troupe_training.data.roots import local_root_of
from troupe_training.models.layers import Standardiser, Transformer, sinusoids, stack_frames, valid_frames
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, MAX_TOKENS, ModelConfig


class PoseModule(nn.Module):
    """Tokens (some masked), root and keyframes to logits ``[B, n, K, C]``."""

    place: Tensor

    def __init__(self, config: ModelConfig, joints: int):
        super().__init__()
        dim = config.pose_dim
        self.heads, self.codes = config.heads, config.codes
        self.pose_scale = Standardiser(joints * 9)
        self.local_scale = Standardiser(4)
        self.global_scale = Standardiser(5)
        self.missing_pose = nn.Parameter(torch.zeros(joints * 9))
        self.embed_root = nn.Linear(FRAMES_PER_TOKEN * 9, dim)
        self.embed_pose = nn.Linear(FRAMES_PER_TOKEN * (joints * 9 + 1), dim)
        self.embed_token = nn.Embedding(config.heads * (config.codes + 1), dim // config.heads)
        self.mix = nn.Sequential(nn.Linear(3 * dim, 2 * dim), nn.GELU(), nn.Linear(2 * dim, dim))
        self.register_buffer("place", sinusoids(MAX_TOKENS, dim))
        self.trunk = Transformer(dim, config.pose_layers, config.attention_head_dim, config.pose_feedforward)
        self.read = nn.ModuleList(nn.Linear(dim // config.heads, config.codes) for _ in range(config.heads))

    def forward(
        self, tokens: Tensor, num_tokens: Tensor, global_root: Tensor, frame_pose: Tensor, frame_mask: Tensor
    ) -> Tensor:
        """Tokens ``[B, n, K]`` with the value C where masked, their number ``[B]``; frames as in `Decoder.forward`."""
        slots = tokens.shape[1]
        mask = frame_mask[..., None]
        pose = self.pose_scale(frame_pose) * mask + self.missing_pose * (1.0 - mask)
        roots = torch.cat([self.local_scale(local_root_of(global_root)), self.global_scale(global_root)], -1)
        offset = torch.arange(self.heads, device=tokens.device) * (self.codes + 1)
        parts = [
            self.embed_root(stack_frames(roots, FRAMES_PER_TOKEN)),
            self.embed_pose(stack_frames(torch.cat([pose, mask], -1), FRAMES_PER_TOKEN)),
            self.embed_token(tokens + offset).flatten(2),
        ]
        x = self.mix(torch.cat(parts, -1)) + self.place[:slots]
        x = self.trunk(x, valid_frames(num_tokens, slots, 1))
        split = x.chunk(self.heads, -1)
        return torch.stack([read(part) for read, part in zip(self.read, split, strict=True)], 2).float()
