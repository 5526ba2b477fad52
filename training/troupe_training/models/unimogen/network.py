"""The denoising U-Net over joint rows (paper, section 3.2).

A batch is a list of rows: for each of B characters one of its root's place, then one a joint. All convolutions and norms see one
row; joint attention alone reads others, by their indices. So characters of any bodies share a call without padding.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.data.bodies import DESCRIPTION, SLOTS
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.precision import full_precision
from troupe_training.models.unimogen.config import DIFFUSION_STEPS, PATH_FEATURES, RATE, ROW_CHANNELS, UniMoGenConfig

TIME_WAVES = 32  # sine and cosine of the diffusion step
PLACE_CHANNELS = 3
MASKED = -1e4


class Convolution(nn.Module):
    """A convolution over time with three taps, ``[R, T, C] -> [R, T, D]``, as one matrix product; zeros beyond both ends."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.linear = nn.Linear(3 * inputs, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """``[R, T, C] -> [R, T, D]``."""
        zeros = torch.zeros_like(x[:, :1])
        before = torch.cat([zeros, x[:, :-1]], 1)
        after = torch.cat([x[:, 1:], zeros], 1)
        return self.linear(torch.cat([before, x, after], -1))


class Block(nn.Module):
    """Two convolutions around a residual; condition enters as scale and shift (FiLM) after the first norm.

    Each frame is normalised over its channels (a group norm of one group that does not look along time), so that a window's
    length does not change what a frame means.
    """

    def __init__(self, inputs: int, channels: int, condition: int):
        super().__init__()
        self.norm = nn.LayerNorm(inputs, elementwise_affine=False)
        self.film = nn.Linear(condition, 2 * inputs)
        self.first = Convolution(inputs, channels)
        self.norm2 = nn.LayerNorm(channels)
        self.second = Convolution(channels, channels)
        self.skip = nn.Identity() if inputs == channels else nn.Linear(inputs, channels)
        nn.init.zeros_(self.second.linear.weight)
        nn.init.zeros_(self.second.linear.bias)
        nn.init.zeros_(self.film.bias)

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """``x`` ``[R, T, C]``, ``condition`` ``[R, E]``."""
        scale, shift = self.film(condition)[:, None].chunk(2, -1)
        h = self.first(F.silu(self.norm(x) * (1 + scale) + shift))
        return self.skip(x) + self.second(F.silu(self.norm2(h)))


def _heads(x: Tensor, heads: int) -> Tensor:
    """``[..., N, D] -> [..., heads, N, D / heads]``."""
    return x.unflatten(-1, (heads, -1)).transpose(-2, -3)


class TimeAttention(nn.Module):
    """Attention of a row's frames to frames of ``[R, N, D]``: its own, or the tokens of its character's path."""

    def __init__(self, channels: int, read: int, inner: int, heads: int):
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(channels)
        self.query = nn.Linear(channels, inner)
        self.key_value = nn.Linear(read, 2 * inner)
        self.out = nn.Linear(inner, channels)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, x: Tensor, read: Tensor | None = None) -> Tensor:
        """``x`` ``[R, T, C]``; ``read`` ``[R, N, D]``, itself if left out."""
        normed = self.norm(x)
        key, value = (
            _heads(part, self.heads) for part in self.key_value(normed if read is None else read).chunk(2, -1)
        )
        query = _heads(self.query(normed), self.heads)
        weights = torch.softmax(query @ key.transpose(-1, -2) * query.shape[-1] ** -0.5, -1)
        return x + self.out((weights @ value).transpose(-2, -3).flatten(-2))


class JointAttention(nn.Module):
    """Attention of a row to its ancestors and itself, frame by frame (paper, section 3.2).

    What a row may read is a list of `SLOTS` rows (`Body.slots`); a slot's bias says how far up it lies, which is the positional
    encoding over joints. The same sum is computed by a gather (`forward`: any mixture of bodies), or as a masked product over all
    rows of one body (`dense`: training, where all windows of a batch have it).
    """

    slot_bias: Tensor

    def __init__(self, channels: int, inner: int, heads: int, positions: bool):
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(channels)
        self.query = nn.Linear(channels, inner)
        self.key_value = nn.Linear(channels, 2 * inner)
        if positions:
            self.slot_bias = nn.Parameter(torch.zeros(SLOTS, heads))
        else:
            self.register_buffer("slot_bias", torch.zeros(SLOTS, heads), persistent=False)
        self.out = nn.Linear(inner, channels)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, x: Tensor, rows: Tensor, reads: Tensor) -> Tensor:
        """``x`` ``[R, T, C]``, ``rows`` ``[R, SLOTS]`` are indices, ``reads`` ``[R, SLOTS]`` is 1 where a slot counts."""
        normed = self.norm(x)
        query = self.query(normed).unflatten(-1, (self.heads, -1))[:, None]  # [R, 1, T, H, D]
        gathered = self.key_value(normed)[rows]  # [R, S, T, 2 HD]
        key, value = (part.unflatten(-1, (self.heads, -1)) for part in gathered.chunk(2, -1))
        scores = (query * key).sum(-1) * query.shape[-1] ** -0.5  # [R, S, T, H]
        scores = scores + self.slot_bias[None, :, None] + ((1.0 - reads) * MASKED)[:, :, None, None]
        weights = torch.softmax(scores, 1)
        return x + self.out((weights[..., None] * value).sum(1).flatten(-2))

    def dense(self, x: Tensor, slot_of: Tensor) -> Tensor:
        """``x`` ``[B (J + 1), T, C]``; ``slot_of`` ``[J + 1, J + 1]`` is the slot in which a row reads another, -1 for none."""
        normed, count = self.norm(x).unflatten(0, (-1, len(slot_of))).transpose(1, 2), len(slot_of)  # [B, T, J + 1, C]
        bias = torch.where(slot_of[..., None] < 0, MASKED, self.slot_bias[slot_of.clamp_min(0)]).permute(
            2, 0, 1
        )  # [H, J + 1, J + 1]
        key, value = (_heads(part, self.heads).flatten(0, 1) for part in self.key_value(normed).chunk(2, -1))
        query = _heads(self.query(normed), self.heads).flatten(0, 1)
        mixed = F.scaled_dot_product_attention(query, key, value, bias.to(query.dtype))
        mixed = mixed.transpose(-2, -3).flatten(-2).unflatten(0, (-1, x.shape[1]))  # [B, T, J + 1, inner]
        return x + self.out(mixed).transpose(1, 2).reshape(-1, count, x.shape[1], x.shape[2]).flatten(0, 1)


class MergedAttention(JointAttention):
    """One attention of a row's frames to all frames of the rows that it may read: time and joints at once (paper, table 6).

    It takes the place of `TimeAttention` and `JointAttention`. With twice their width and heads it has as many weights.
    """

    def forward(self, x: Tensor, rows: Tensor, reads: Tensor) -> Tensor:
        """As `JointAttention.forward`."""
        normed, frames = self.norm(x), x.shape[1]
        query = _heads(self.query(normed), self.heads)  # [R, H, T, D]
        gathered = self.key_value(normed)[rows].flatten(1, 2)  # [R, S T, 2 HD]
        key, value = (_heads(part, self.heads) for part in gathered.chunk(2, -1))
        bias = self.slot_bias[None] + ((1.0 - reads) * MASKED)[..., None]  # [R, S, H]
        scores = query @ key.transpose(-1, -2) * query.shape[-1] ** -0.5
        scores = scores + bias.transpose(1, 2).repeat_interleave(frames, -1)[:, :, None]
        return x + self.out((torch.softmax(scores, -1) @ value).transpose(-2, -3).flatten(-2))

    def dense(self, x: Tensor, slot_of: Tensor) -> Tensor:
        """As `JointAttention.dense`."""
        frames, count = x.shape[1], len(slot_of)
        normed = self.norm(x).reshape(-1, count * frames, x.shape[2])  # [B, (J + 1) T, C]
        bias = torch.where(slot_of[..., None] < 0, MASKED, self.slot_bias[slot_of.clamp_min(0)]).permute(2, 0, 1)
        bias = bias.repeat_interleave(frames, 1).repeat_interleave(frames, 2)  # [H, (J + 1) T, (J + 1) T]
        query = _heads(self.query(normed), self.heads)
        key, value = (_heads(part, self.heads) for part in self.key_value(normed).chunk(2, -1))
        mixed = F.scaled_dot_product_attention(query, key, value, bias.to(query.dtype))
        return x + self.out(mixed.transpose(-2, -3).flatten(-2)).reshape(x.shape)


def slot_matrix(rows: Tensor, reads: Tensor) -> Tensor:
    """`Body.slots` of one body as ``[J + 1, J + 1]`` for `JointAttention.dense`."""
    matrix = torch.full((len(rows), len(rows)), -1, dtype=torch.long)
    for row in range(len(rows)):
        for slot in range(rows.shape[1]):
            if reads[row, slot]:
                matrix[row, rows[row, slot]] = slot
    return matrix


class Deep(nn.Module):
    """A block at quarter rate with its three attentions: along time, along joints (or one along both), to the path."""

    def __init__(self, inputs: int, channels: int, config: UniMoGenConfig):
        super().__init__()
        inner, heads = config.attention, config.heads
        self.block = Block(inputs, channels, config.condition)
        self.time: TimeAttention | None = None
        self.joints: JointAttention
        if config.merged_attention:
            self.joints = MergedAttention(channels, 2 * inner, 2 * heads, config.positions)
        else:
            self.time = TimeAttention(channels, channels, inner, heads)
            self.joints = JointAttention(channels, inner, heads, config.positions)
        self.path = TimeAttention(channels, inner, inner, heads)

    def forward(
        self, x: Tensor, condition: Tensor, path: Tensor, rows: Tensor, reads: Tensor, slot_of: Tensor | None
    ) -> Tensor:
        """``x`` ``[R, T / 4, C]``, ``path`` ``[R, T / 4, D]``; with ``slot_of`` all rows are of one body."""
        x = self.block(x, condition)
        if self.time is not None:
            x = self.time(x)
        x = self.joints(x, rows, reads) if slot_of is None else self.joints.dense(x, slot_of)
        return self.path(x, path)


def waves(values: Tensor, count: int, longest: float) -> Tensor:
    """Sines and cosines ``[..., 2 count]`` of values, with periods from ``2 pi`` to ``2 pi longest``."""
    frequencies = torch.exp(torch.arange(count, device=values.device) * (-math.log(longest) / max(count - 1, 1)))
    phase = values[..., None] * frequencies
    return torch.cat([torch.sin(phase), torch.cos(phase)], -1)


class Carried(nn.Module):
    """What the answer starts from: the given frames' own values, carried on by learnt shares, and what is seen through the noise.

    A narrow network can hardly repeat a pose that it is given, and every seam shows it. So a row's answer is the network's plus
    shares of its last past frame and of its velocity there, of its last frame if that is given (each for every distance in
    frames, apart for joints and the root's place), and of the noisy row itself (for every diffusion step).
    """

    CARRIED_FRAMES = 64

    def __init__(self) -> None:
        super().__init__()
        d = torch.arange(self.CARRIED_FRAMES + 1, dtype=torch.float32)
        shares = torch.stack([torch.exp(-d / 4), d * torch.exp(-d / 2), torch.exp(-d / 4)])
        self.shares = nn.Parameter(shares.repeat(2, 1, 1))  # [joint or place, value, velocity or last, distance]
        # Noise is white and motion smooth, so that nothing of the noisy row is let through to begin
        # with.
        self.seen = nn.Parameter(torch.zeros(DIFFUSION_STEPS))

    def forward(self, x: Tensor, given: Tensor, step: Tensor, place: Tensor) -> Tensor:
        """``x`` ``[R, T, 6]``, ``given`` ``[R, T]``, ``step`` ``[R]``, ``place`` ``[R, 1, 1]`` -> ``[R, T, 6]``."""
        anchor, frames = CONTEXT_FRAMES - 1, x.shape[1]
        time = torch.arange(frames, device=x.device)
        after = (time - anchor).clamp(0, self.CARRIED_FRAMES)
        before = (frames - 1 - time).clamp_max(self.CARRIED_FRAMES)
        share = (1.0 - place[..., None]) * self.shares[0] + place[..., None] * self.shares[1]  # [R, 1, 3, D]
        past, velocity, last = share[:, 0].unbind(1)
        has_past, has_last = given[:, anchor, None, None], given[:, -1, None, None]
        held, moved = x[:, anchor, None], x[:, anchor, None] - x[:, anchor - 1, None]
        carried = has_past * (past[:, after, None] * held + velocity[:, after, None] * moved)
        carried = carried + has_last * last[:, before, None] * x[:, -1, None]
        return carried + self.seen[step.long()][:, None, None] * (1.0 - given[..., None]) * x


class UniMoGen(nn.Module):
    """Noisy rows, path, diffusion step and style to clean rows. ``words`` is the length K of the style vector."""

    path_scale: Tensor

    def __init__(self, config: UniMoGenConfig, words: int):
        super().__init__()
        c, e = config.channels, config.condition
        self.config, self.words = config, words
        self.register_buffer("path_scale", torch.tensor([1.0, 1.0, 1.0]))
        self.joint_in, self.place_in = nn.Linear(ROW_CHANNELS, c), nn.Linear(ROW_CHANNELS, c)
        self.frame_in = nn.Linear(PATH_FEATURES + 1, c)
        self.row_in = nn.Linear(e, c)
        self.step = nn.Sequential(nn.Linear(2 * TIME_WAVES, e), nn.SiLU(), nn.Linear(e, e))
        self.style = nn.Linear(words, e, bias=False)
        nn.init.normal_(self.style.weight, std=0.5)
        self.row = nn.Sequential(nn.Linear(len(DESCRIPTION), e), nn.SiLU(), nn.Linear(e, e))
        token = RATE * (PATH_FEATURES + 1)
        self.tokens = nn.Sequential(
            nn.Linear(token, config.attention), nn.SiLU(), nn.Linear(config.attention, config.attention)
        )
        if config.positions:
            self.position = nn.Linear(2 * TIME_WAVES, 4 * c)
        self.encoder = nn.ModuleList([Block(c, c, e), Block(2 * c, 2 * c, e)])
        self.down = nn.ModuleList([nn.Linear(2 * c, 2 * c), nn.Linear(4 * c, 4 * c)])
        self.deep_in = nn.ModuleList(Deep(4 * c, 4 * c, config) for _ in range(config.deep_blocks))
        self.deep_out = nn.ModuleList(
            Deep(8 * c if i == 0 else 4 * c, 4 * c, config) for i in range(config.deep_blocks)
        )
        self.up = nn.ModuleList([nn.Linear(4 * c, 4 * c), nn.Linear(2 * c, 2 * c)])
        self.decoder = nn.ModuleList([Block(4 * c, 2 * c, e), Block(2 * c, c, e)])
        self.norm = nn.LayerNorm(c)
        self.carried = Carried()
        self.joint_out, self.place_out = nn.Linear(c, ROW_CHANNELS), nn.Linear(c, ROW_CHANNELS)

    def forward(
        self,
        x: Tensor,
        given: Tensor,
        path: Tensor,
        step: Tensor,
        style: Tensor,
        description: Tensor,
        owner: Tensor,
        rows: Tensor,
        reads: Tensor,
        slot_of: Tensor | None = None,
    ) -> Tensor:
        """Clean rows ``[R, T, 6]`` of B characters; T is a multiple of 4.

        ``x`` ``[R, T, 6]``: noisy rows, and clean ones in the frames that are ``given`` ``[B, T]`` (1, else 0). ``path``
        ``[B, T, 3]``: `PATH_FEATURES`. ``step`` ``[B]``: diffusion step, 0 to 49. ``style`` ``[B, K]``: weights, all zero for
        none. ``description`` ``[R, 19]``: `Body.description`. ``owner`` ``[R]``: the row's character. ``rows``, ``reads``
        ``[R, SLOTS]``: what joint attention reads, in rows of this batch. ``slot_of``: see `JointAttention.dense`.
        """
        place = description[:, DESCRIPTION.index("is_place")][:, None, None]
        known = torch.cat([path / self.path_scale, given[..., None]], -1)[owner]  # [R, T, 4]
        described = self.row(description)
        # Gathered before any product, so that every product has one row's numbers in a row.
        condition = F.silu(self.step(waves(step, TIME_WAVES, 100.0)[owner]) + self.style(style[owner]) + described)
        tokens = self.tokens(known.unflatten(1, (-1, RATE)).flatten(2))
        full = (
            (1.0 - place) * self.joint_in(x)
            + place * self.place_in(x)
            + self.frame_in(known)
            + self.row_in(described)[:, None]
        )
        full = self.encoder[0](full, condition)
        half = self.encoder[1](self.down[0](full.unflatten(1, (-1, 2)).flatten(2)), condition)
        deep = self.down[1](half.unflatten(1, (-1, 2)).flatten(2))
        if self.config.positions:
            frames = torch.arange(deep.shape[1], device=x.device, dtype=x.dtype)
            deep = deep + self.position(waves(frames, TIME_WAVES, 100.0))
        for module in self.deep_in:
            deep = module(deep, condition, tokens, rows, reads, slot_of)
        skip = deep
        for i, module in enumerate(self.deep_out):
            deep = module(torch.cat([deep, skip], -1) if i == 0 else deep, condition, tokens, rows, reads, slot_of)
        half = self.decoder[0](torch.cat([self.up[0](deep).unflatten(-1, (2, -1)).flatten(1, 2), half], -1), condition)
        full = self.decoder[1](torch.cat([self.up[1](half).unflatten(-1, (2, -1)).flatten(1, 2), full], -1), condition)
        return self._read_out(full, place) + self._carry(x, given[owner], step[owner], place)

    @full_precision
    def _carry(self, x: Tensor, given: Tensor, step: Tensor, place: Tensor) -> Tensor:
        carried: Tensor = self.carried(x, given, step, place)
        return carried

    @full_precision
    def _read_out(self, full: Tensor, place: Tensor) -> Tensor:
        """Rows of the last level's features: a step of 16 bits is more than a root may be off."""
        out = F.silu(self.norm(full.float()))
        only = torch.arange(ROW_CHANNELS, device=full.device) < PLACE_CHANNELS
        return (1.0 - place) * self.joint_out(out) + place * only.to(out.dtype) * self.place_out(out)
