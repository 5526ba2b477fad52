"""Sizes of the network and of the diffusion."""

from dataclasses import dataclass

ROW_CHANNELS = 6  # of a joint's row: two columns of its bend; the root's place has three and zeros
PATH_FEATURES = 3  # velocity to the left and ahead (body sizes a second), turn rate (radians a second)
RATE = 4  # frames of the deepest level's step: a window has a multiple of it
DIFFUSION_STEPS = 50  # in training (paper, section 3.3)
SAMPLER_STEPS = 4  # by default (paper, section 3.3)


@dataclass(frozen=True)
class UniMoGenConfig:
    """Widths of the U-Net's three levels, and what attention and conditions have."""

    channels: int = 32  # at full rate; twice that at half, four times at quarter rate
    condition: int = 128
    attention: int = 64  # queries, keys and values of all heads together
    heads: int = 4
    deep_blocks: int = 1  # blocks with attention in the last encoder level, and as many in the first decoder level
    merged_attention: bool = False  # one attention over frames and joints instead of two (paper, table 6)
    positions: bool = True  # attention knows the order of frames and of ancestors (paper, table 7)


PRESETS = {
    "default": UniMoGenConfig(),
    "medium": UniMoGenConfig(channels=48, condition=192, attention=96, heads=6),
    "wide": UniMoGenConfig(channels=64, condition=256, attention=128, heads=8, deep_blocks=2),
    "tiny": UniMoGenConfig(channels=8, condition=16, attention=8, heads=2),
}
