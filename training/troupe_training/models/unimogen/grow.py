"""A wider network that answers nearly as a narrow one does, to train on from its weights.

- New channels of a stream hold the mean of the old ones. Every layer that writes to a stream is linear, so that its new rows are
  the mean of its old ones. A layer norm keeps its mean, and makes its new channels 0: what reads them behind a norm may keep its
  random weights, which is where the new channels begin to differ. The norm's variance shrinks by a known factor.
- New heads, new channels of the condition and of the path's tokens are read with weights of 0 at first.
- New blocks at quarter rate begin as the identity, as all blocks do.

Three norms of the decoder read two joined streams, whose means differ a little. So the answer differs a little too.
"""

import math
from typing import TypeVar

import torch
from torch import Tensor, nn

from troupe_training.models.unimogen.config import UniMoGenConfig
from troupe_training.models.unimogen.network import Block, Deep, JointAttention, TimeAttention, UniMoGen

M = TypeVar("M", bound=nn.Module)


def _as(kind: type[M], module: nn.Module) -> M:
    assert isinstance(module, kind)
    return module


def grown(narrow: UniMoGen, config: UniMoGenConfig) -> UniMoGen:
    """A network of the sizes ``config`` with the weights of ``narrow``; ends the command if it does not fit."""
    _check(narrow.config, config)
    wide = UniMoGen(config, narrow.words)
    with torch.no_grad():
        _grow(wide, narrow)
    return wide


def _check(old: UniMoGenConfig, new: UniMoGenConfig) -> None:
    sizes = ("channels", "condition", "attention", "heads", "deep_blocks")
    smaller = [name for name in sizes if getattr(new, name) < getattr(old, name)]
    if smaller:
        raise SystemExit(f"the network can only grow, but these sizes shrink: {', '.join(smaller)}")
    if old.attention * new.heads != new.attention * old.heads:
        raise SystemExit("a head must keep its width: attention / heads differs")
    if (old.merged_attention, old.positions) != (new.merged_attention, new.positions):
        raise SystemExit("a network cannot change its parts when it grows")


def kept(old: int, new: int, groups: int = 1) -> Tensor:
    """Places of the old numbers in a layout of ``groups`` equal parts, each of which has grown at its end."""
    part = torch.arange(old // groups)
    return torch.cat([part + group * (new // groups) for group in range(groups)])


def _linear(
    new: nn.Linear, old: nn.Linear, *, ins: int = 1, outs: int = 1, writes_stream: bool, reads_random: bool = False
) -> None:
    """Copies a layer. ``ins`` and ``outs`` are the groups of its inputs and outputs, see `kept`.

    ``writes_stream``: new rows are the mean of the old ones of their group, otherwise they stay random. ``reads_random``: new
    columns stay random, because what they read is 0 at first; otherwise old rows do not read them.
    """
    rows = kept(old.out_features, new.out_features, outs)
    columns = kept(old.in_features, new.in_features, ins)
    weight = new.weight.clone()
    if not reads_random:
        others = torch.ones(new.in_features, dtype=torch.bool)
        others[columns] = False
        weight[rows[:, None], others.nonzero()[:, 0]] = 0.0
    weight[rows[:, None], columns] = old.weight
    if writes_stream:
        _mean_rows(weight, rows, outs)
    new.weight.copy_(weight)
    if old.bias is not None:
        bias = new.bias.clone()
        bias[rows] = old.bias
        if writes_stream:
            _mean_rows(bias, rows, outs)
        new.bias.copy_(bias)


def _mean_rows(values: Tensor, rows: Tensor, groups: int) -> None:
    """Sets the rows that are not among ``rows`` to the mean of the old rows of their group."""
    size = len(values) // groups
    for group, old in enumerate(rows.chunk(groups)):
        mean = values[old].mean(0)
        fresh = torch.ones(len(values), dtype=torch.bool)
        fresh[rows] = False
        fresh[: group * size] = False
        fresh[(group + 1) * size :] = False
        values[fresh] = mean


def _norm(new: nn.LayerNorm, old: nn.LayerNorm) -> None:
    """An affine norm over one stream: its weights make up for the variance, which shrinks by the share of old channels."""
    rows = kept(len(old.weight), len(new.weight))
    new.weight.fill_(1.0)
    new.bias.zero_()
    new.weight[rows] = old.weight / math.sqrt(len(new.weight) / len(old.weight))
    new.bias[rows] = old.bias


def _block(new: Block, old: Block, streams: int = 1) -> None:
    """A block whose input is as many streams, joined."""
    inputs = old.film.out_features // 2
    widened = new.film.out_features // 2
    growth = math.sqrt(widened / inputs)
    _linear(new.film, old.film, outs=2 * streams, writes_stream=False)
    rows = kept(2 * inputs, 2 * widened, 2 * streams)
    fresh = torch.ones(2 * widened, dtype=torch.bool)
    fresh[rows] = False
    new.film.weight[fresh] = 0.0
    new.film.bias[fresh] = 0.0
    scale = rows[: len(rows) // 2]  # 1 + scale takes the growth back
    new.film.weight[scale] /= growth
    new.film.bias[scale] = new.film.bias[scale] / growth + (1.0 / growth - 1.0)
    # Behind a joined norm new channels are only nearly 0, and not read.
    _linear(new.first.linear, old.first.linear, ins=3 * streams, writes_stream=True, reads_random=streams == 1)
    _norm(new.norm2, old.norm2)
    _linear(new.second.linear, old.second.linear, ins=3, writes_stream=True, reads_random=True)
    if isinstance(old.skip, nn.Linear) and isinstance(new.skip, nn.Linear):
        _linear(new.skip, old.skip, ins=streams, writes_stream=True)


def _attention(new: TimeAttention | JointAttention, old: TimeAttention | JointAttention, reads_stream: bool) -> None:
    """An attention of a stream to itself, or to the path's tokens."""
    _norm(new.norm, old.norm)
    _linear(new.query, old.query, writes_stream=False, reads_random=True)
    _linear(new.key_value, old.key_value, outs=2, writes_stream=False, reads_random=reads_stream)
    _linear(new.out, old.out, writes_stream=True)
    if isinstance(new, JointAttention) and isinstance(old, JointAttention):
        new.slot_bias.zero_()
        new.slot_bias[:, : old.heads] = old.slot_bias


def _deep(new: Deep, old: Deep, streams: int) -> None:
    _block(new.block, old.block, streams)
    if new.time is not None and old.time is not None:
        _attention(new.time, old.time, reads_stream=True)
    _attention(new.joints, old.joints, reads_stream=True)
    _attention(new.path, old.path, reads_stream=False)


def _hidden(new: nn.Sequential, old: nn.Sequential) -> None:
    """Two linear layers around a SiLU; what reads them does not read their new outputs."""
    for index in (0, 2):
        wide, narrow = new[index], old[index]
        assert isinstance(wide, nn.Linear) and isinstance(narrow, nn.Linear)
        _linear(wide, narrow, writes_stream=False)


def _grow(wide: UniMoGen, narrow: UniMoGen) -> None:
    wide.path_scale.copy_(narrow.path_scale)
    for name in ("joint_in", "place_in", "frame_in", "row_in"):
        _linear(getattr(wide, name), getattr(narrow, name), writes_stream=True)
    for name in ("step", "row", "tokens"):
        _hidden(getattr(wide, name), getattr(narrow, name))
    _linear(wide.style, narrow.style, writes_stream=False)
    if narrow.config.positions:
        _linear(wide.position, narrow.position, writes_stream=True)
    for i in range(2):
        _block(_as(Block, wide.encoder[i]), _as(Block, narrow.encoder[i]))
        _linear(_as(nn.Linear, wide.down[i]), _as(nn.Linear, narrow.down[i]), ins=2, writes_stream=True)
        _linear(_as(nn.Linear, wide.up[i]), _as(nn.Linear, narrow.up[i]), outs=2, writes_stream=True)
        _block(_as(Block, wide.decoder[i]), _as(Block, narrow.decoder[i]), streams=2)
    for i, (old_in, old_out) in enumerate(zip(narrow.deep_in, narrow.deep_out, strict=True)):
        _deep(_as(Deep, wide.deep_in[i]), _as(Deep, old_in), 1)
        _deep(_as(Deep, wide.deep_out[i]), _as(Deep, old_out), 2 if i == 0 else 1)
    _norm(wide.norm, narrow.norm)
    for name in ("joint_out", "place_out"):
        _linear(getattr(wide, name), getattr(narrow, name), writes_stream=False, reads_random=True)
    wide.carried.load_state_dict(narrow.carried.state_dict())
