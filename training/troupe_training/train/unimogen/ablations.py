"""Parts of the paper's method that a training can leave out, for its tables 4 and 6 to 9."""

from collections.abc import Collection
from dataclasses import replace

import torch

from troupe_training.data.bodies_store import BODY_BALANCE, SPEED_BALANCE
from troupe_training.models.unimogen.config import UniMoGenConfig
from troupe_training.models.unimogen.state import Range
from troupe_training.train.unimogen.losses import Weights

ABLATIONS = {
    "min-max": "root offsets go in as shares of the body's size, not scaled to -1..1 (table 4)",
    "separate-attention": "one attention over frames and joints of the same weights instead of two (table 6)",
    "positions": "attention does not know the order of frames and of ancestors (table 7)",
    "balance": "bodies, kinds of motion and speeds are drawn by their length (table 8)",
    "auxiliary-losses": "the loss is that of the clean rows alone (table 9)",
}


def ablated_config(config: UniMoGenConfig, without: Collection[str]) -> UniMoGenConfig:
    """The network's sizes without some of its parts."""
    return replace(
        config,
        merged_attention=config.merged_attention or "separate-attention" in without,
        positions=config.positions and "positions" not in without,
    )


def ablated_range(limits: Range, without: Collection[str]) -> Range:
    """The root's range; without `min-max` the one that leaves offsets as they are."""
    return Range(-torch.ones(3), torch.ones(3)) if "min-max" in without else limits


def ablated_weights(without: Collection[str]) -> Weights:
    """Weights of the losses."""
    if "auxiliary-losses" in without:
        return Weights(angular_velocity=0.0, position=0.0, velocity=0.0, foot=0.0, way=0.0)
    return Weights()


def ablated_balance(balance: float, without: Collection[str]) -> tuple[float, float, float]:
    """Powers of the shares by which kinds of motion, bodies and speeds are drawn."""
    return (1.0, 1.0, 1.0) if "balance" in without else (balance, BODY_BALANCE, SPEED_BALANCE)
