"""The three official networks, of standardised features in and out, in the order that the release has them in."""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.models.layers import sinusoids, valid_frames
from troupe_training.models.motionbricks.official.layers import ConditionedDecoder, Perceptron, PostNormTransformer
from troupe_training.models.motionbricks.official.sizes import ROOT_GLOBAL, ROOT_LOCAL, Sizes

NEVER = -1e9  # the logit of a token count that is not allowed


def chosen(x: Tensor, index: Tensor) -> Tensor:
    """Rows ``[B, T, D]`` of ``x`` ``[B, S, D]`` at ``index`` ``[B, T]``."""
    batch, slots, width = x.shape
    start = torch.arange(batch, device=x.device)[:, None] * slots
    return x.reshape(batch * slots, width).index_select(0, (start + index).flatten()).reshape(batch, -1, width)


class RootNetwork(nn.Module):
    """Keyframes to a token count and the trajectory of the root."""

    def __init__(self, sizes: Sizes):
        super().__init__()
        own, width = sizes.root, sizes.root.transformer.width
        self.sizes = sizes
        joined = own.pose_features + own.local_features + own.global_features
        self.pose = nn.Linear(sizes.pose_width, own.pose_features)
        self.local_root = nn.Linear(ROOT_LOCAL, own.local_features)
        self.global_root = nn.Linear(ROOT_GLOBAL, own.global_features)
        self.no_pose = nn.Parameter(torch.randn(own.pose_features))
        self.no_local_root = nn.Parameter(torch.randn(own.local_features))
        self.no_global_root = nn.Parameter(torch.randn(own.global_features))
        self.no_frame = nn.Parameter(torch.randn(width))
        self.start = Perceptron(joined, width, width, own.slot_layers)
        self.end = Perceptron(joined, width, width, own.slot_layers)
        self.slots = nn.Parameter(torch.randn(2 * sizes.frames_per_token, width))
        # The release has an embedding for each count that may be given. This one stands for none.
        self.any_count = nn.Parameter(torch.randn(width))
        self.first = PostNormTransformer(own.transformer)
        self.count_logits = nn.Linear(width, sizes.counts)
        self.count = nn.Parameter(torch.randn(sizes.counts, width))
        self.later = PostNormTransformer(own.transformer, own.later_layers)
        self.positions = nn.Parameter(sinusoids(sizes.max_tokens, width))
        self.decoder = ConditionedDecoder(
            own.convolutions, sizes.halvings, sizes.max_tokens, width, ROOT_GLOBAL, target=ROOT_GLOBAL, along=width
        )

    def forward(
        self, values: dict[str, Tensor], given: dict[str, Tensor], allowed: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Slots ``local_root``, ``global_root``, ``pose``: values ``[B, S, .]`` and 0/1 ``[B, S]``; counts ``[B, C]``.

        Gives the token count ``[B]``, the counts' probabilities ``[B, C]`` and the trajectory ``[B, F, 5]``.
        """
        batch, per_token = allowed.shape[0], self.sizes.frames_per_token
        slots = self._slots(values, given)
        placed = slots + self.slots
        asked = self.any_count.expand(batch, 1, -1)
        logits = self.count_logits(self.first(torch.cat([asked, placed], 1))[:, 0])
        logits = torch.where(allowed > 0.5, logits, NEVER)
        index = (logits + noise).argmax(-1)
        num_tokens = index + self.sizes.min_tokens
        valid = valid_frames(num_tokens, self.sizes.max_tokens, 1)
        known = torch.cat([self.count.index_select(0, index)[:, None], placed], 1)
        hidden = torch.cat([known, self.positions.expand(batch, -1, -1)], 1)
        hidden = self.later(hidden, torch.cat([torch.ones_like(known[..., 0]), valid], 1))[:, known.shape[1] :]
        # Slots at their frames; frames between read one more slot, which has nothing.
        frame = torch.arange(self.sizes.max_tokens * per_token, device=allowed.device)[None]
        behind = frame - (num_tokens[:, None] - 1) * per_token
        at_end = (behind >= 0) & (behind < per_token)
        slot = torch.where(frame < per_token, frame, torch.where(at_end, behind + per_token, 2 * per_token))
        some = torch.maximum(torch.maximum(given["local_root"], given["global_root"]), given["pose"])
        frames = torch.where(some[..., None] > 0.5, slots, self.no_frame)
        along = chosen(torch.cat([frames, self.no_frame.expand(batch, 1, -1)], 1), slot)
        targets = torch.cat([values["global_root"], given["global_root"][..., None]], -1)
        targets = chosen(F.pad(targets, (0, 0, 0, 1)), slot)
        trajectory = self.decoder(
            hidden, along, targets[..., :ROOT_GLOBAL], targets[..., ROOT_GLOBAL:], valid[..., None]
        )
        return num_tokens, torch.softmax(logits, -1), trajectory

    def _slots(self, values: dict[str, Tensor], given: dict[str, Tensor]) -> Tensor:
        """Embedded keyframes ``[B, S, width]``: context, then targets."""
        parts = []
        for name, embed, absent in (
            ("pose", self.pose, self.no_pose),
            ("local_root", self.local_root, self.no_local_root),
            ("global_root", self.global_root, self.no_global_root),
        ):
            has = given[name][..., None]
            parts.append(embed(values[name]) * has + absent * (1 - has))
        joined, half = torch.cat(parts, -1), self.sizes.frames_per_token
        return torch.cat([self.start(joined[:, :half]), self.end(joined[:, half:])], 1)


class PoseNetwork(nn.Module):
    """Tokens, some of them masked, to the logits of every code."""

    def __init__(self, sizes: Sizes):
        super().__init__()
        own, width, per_token = sizes.pose, sizes.pose.transformer.width, sizes.frames_per_token
        self.sizes = sizes
        self.codes = nn.Parameter(torch.randn(sizes.heads * (sizes.codes + 1), sizes.code_width // sizes.heads))
        self.token = Perceptron(sizes.code_width, own.pose_features, own.pose_features, own.token_layers)
        self.root = nn.Linear(4 * per_token, own.root_features)
        self.pose = nn.Linear(sizes.pose_width, own.pose_features // per_token)
        self.length = nn.Parameter(torch.randn(sizes.counts, own.length_features))
        self.join = nn.Linear(own.pose_features + own.root_features + own.length_features, width)
        self.positions = nn.Parameter(sinusoids(sizes.max_tokens, width))
        self.transformer = PostNormTransformer(own.transformer)
        self.logits = nn.Linear(width, sizes.heads * sizes.codes)

    def forward(self, tokens: Tensor, num_tokens: Tensor, root: Tensor, pose: Tensor, given: Tensor) -> Tensor:
        """Tokens ``[B, N, H]``; by frames root (x, z, cosine, sine), poses and 0/1 ``[B, F]``; out ``[B, N, H, codes]``."""
        sizes, (batch, length, heads) = self.sizes, tokens.shape
        offset = torch.arange(heads, device=tokens.device) * (sizes.codes + 1)
        embedded = self.codes.index_select(0, (tokens + offset).flatten()).reshape(batch, length, -1)
        has = given[..., None]
        by_frame = self.token(embedded).reshape(batch, length * sizes.frames_per_token, -1)
        by_frame = self.pose(pose) * has + by_frame * (1 - has)
        count = self.length.index_select(0, num_tokens - sizes.min_tokens)
        joined = torch.cat(
            [
                by_frame.reshape(batch, length, -1),
                self.root(root.reshape(batch, length, -1)),
                count[:, None].expand(-1, length, -1),
            ],
            -1,
        )
        hidden = F.relu(self.join(joined)) + self.positions[:length]
        hidden = self.transformer(hidden, valid_frames(num_tokens, length, 1))
        return self.logits(hidden).reshape(batch, length, heads, sizes.codes)


class PoseDecoder(nn.Module):
    """Tokens to local root and body features, by way of the codebooks."""

    def __init__(self, sizes: Sizes):
        super().__init__()
        self.sizes = sizes
        self.book = nn.Parameter(torch.randn(sizes.heads, sizes.codes, sizes.code_width // sizes.heads))
        self.decoder = ConditionedDecoder(
            sizes.decoder,
            sizes.halvings,
            sizes.max_tokens,
            sizes.code_width,
            ROOT_LOCAL + sizes.body_width,
            target=sizes.pose_width,
            along=2,
        )

    def forward(self, tokens: Tensor, num_tokens: Tensor, velocity: Tensor, pose: Tensor, given: Tensor) -> Tensor:
        """As `PoseNetwork.forward`, with the root's velocity x and z; out ``[B, F, 4 + body]``. No token may be masked."""
        heads, codes, width = self.book.shape
        offset = torch.arange(heads, device=tokens.device) * codes
        index = (tokens.clamp(max=codes - 1) + offset).flatten()
        code = self.book.reshape(heads * codes, width).index_select(0, index).reshape(*tokens.shape[:2], -1)
        valid = valid_frames(num_tokens, tokens.shape[1], 1)[..., None]
        return self.decoder(code, velocity, pose, given[..., None], valid)
