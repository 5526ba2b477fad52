"""Sizes of the networks: the default pack's, the paper's for timing, and tiny ones for tests."""

from dataclasses import dataclass, replace
from typing import Any

from troupe_training.data.conventions import CONTEXT_FRAMES, LENGTH_STEP, MAX_FRAMES, MAX_TARGETS, MIN_FRAMES

FRAMES_PER_TOKEN = LENGTH_STEP
MIN_TOKENS, MAX_TOKENS = MIN_FRAMES // FRAMES_PER_TOKEN, MAX_FRAMES // FRAMES_PER_TOKEN
COUNTS = MAX_TOKENS - MIN_TOKENS + 1
SLOTS = CONTEXT_FRAMES + MAX_TARGETS


@dataclass
class ModelConfig:
    """Widths and depths; the paper's sizes are twenty times these (section 7.4, the preset ``paper``)."""

    heads: int = 4
    codes: int = 256
    code_dim: int = 24
    # Convolution channels at a quarter, half and full frame rate.
    encoder_channels: tuple[int, int, int] = (256, 192, 128)
    decoder_channels: tuple[int, int, int] = (320, 224, 128)
    kernels: tuple[int, int, int] = (3, 5, 7)
    root_dim: int = 192
    root_layers: int = 3  # in each of its two steps
    root_choices: int = 16  # curves of the root's choice, in packs that have one
    root_curve_frames: int = 4  # of a spline's piece of those curves: the longer, the smoother
    pose_dim: int = 256
    pose_layers: int = 5
    pose_feedforward: int = 4  # width of the pose module's feed-forward layers, in multiples of `pose_dim`
    attention_head_dim: int = 32
    # Levels of each dimension of a head that is quantised by rounding (FSQ); none with a
    # codebook. Their product is `codes`, their number `code_dim`.
    fsq_levels: tuple[int, ...] = ()


def config_of(**sizes: Any) -> ModelConfig:
    """Sizes as a checkpoint notes them. Those of 0.1 note the sizes of the deterministic baseline too."""
    return ModelConfig(**{name: size for name, size in sizes.items() if not name.startswith("delta_")})


# A third of the default's work, for crowds on few cores. Taught by a pack of the default's size
# (`--teacher`).
SMALL = ModelConfig(decoder_channels=(224, 144, 80), root_dim=128, root_layers=2, pose_dim=160, pose_layers=4)


def single_head(config: ModelConfig) -> ModelConfig:
    """The ablation of the multi-head tokenizer: one codebook over the latent width of all heads.

    Matching 4 heads of 256 codes, 2^32 combinations, is out of the question; of what fits, 4096 codes are what 94,000
    training tokens still fill, and embedding and read-out of the pose module already cost two million parameters more.
    """
    return replace(config, heads=1, codes=4096, code_dim=96)


# The parameter counts that section 7.4 gives: 150 M for the pose module of 16 layers and 16 heads
# at width 1024, 50 M for the root module at width 512, 23.5 M for encoder and decoder together.
# Those counts fix what the text leaves open: feed-forward layers of twice the width, and 512
# channels (the text says 1024, which would make it 94 M).
PAPER = ModelConfig(
    encoder_channels=(512, 512, 512),
    decoder_channels=(512, 512, 512),
    root_dim=512,
    root_layers=7,
    pose_dim=1024,
    pose_layers=16,
    pose_feedforward=2,
    attention_head_dim=64,
)

PRESETS = {
    "default": ModelConfig(),
    "small": SMALL,
    "single-head": single_head(ModelConfig()),
    "small-single-head": single_head(SMALL),
    "paper": PAPER,
    # The widths of the text instead, whatever they count to: 1024 channels, feed-forward layers of
    # four times the width.
    "paper-wide": replace(PAPER, encoder_channels=(1024,) * 3, decoder_channels=(1024,) * 3, pose_feedforward=4),
    "test": ModelConfig(
        heads=2,
        codes=16,
        code_dim=8,
        encoder_channels=(32, 32, 32),
        decoder_channels=(32, 32, 32),
        root_dim=32,
        root_layers=1,
        pose_dim=32,
        pose_layers=1,
        attention_head_dim=16,
    ),
}
# The levels that Mentzer et al. (2023, table 1) advise for about 2^8 codes; their product is 240.
FSQ_LEVELS = (8, 6, 5)
