"""Sizes of the networks and of training: the default pack's, the paper's for timing, and tiny ones for tests."""

from dataclasses import asdict, dataclass, replace

FPS = 30.0
FRAMES_PER_TOKEN = 4
MIN_TOKENS = 3
MAX_TOKENS = 16
MAX_FRAMES = FRAMES_PER_TOKEN * MAX_TOKENS
COUNTS = MAX_TOKENS - MIN_TOKENS + 1
CONTEXT_FRAMES = 4
MAX_TARGETS = 4
SLOTS = CONTEXT_FRAMES + MAX_TARGETS
# A kind of motion with n possible segments is drawn in proportion to n to this power: 1 is by length, 0 is evenly.
BALANCE = 1.0


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
    pose_dim: int = 256
    pose_layers: int = 5
    pose_feedforward: int = 4  # width of the pose module's feed-forward layers, in multiples of `pose_dim`
    attention_head_dim: int = 32
    # Levels of each dimension of a head where it is quantised by rounding (FSQ); none where it has a codebook. Their
    # product is `codes`, their number `code_dim`.
    fsq_levels: tuple[int, ...] = ()
    # The deterministic baseline, of about as many parameters as all networks of a pack together.
    delta_dim: int = 320
    delta_layers: int = 9

    def to_dict(self) -> dict:
        """Plain values, for checkpoints."""
        return asdict(self)


# A third of the default's work, for crowds on few cores. Taught by a pack of the default's size (`--teacher`).
SMALL = ModelConfig(
    decoder_channels=(224, 144, 80),
    root_dim=128,
    root_layers=2,
    pose_dim=160,
    pose_layers=4,
    delta_dim=224,
    delta_layers=8,
)
# One codebook over the latent width of all heads.
SINGLE_HEAD = {"heads": 1, "codes": 4096, "code_dim": 96}

PRESETS = {
    "default": ModelConfig(),
    "small": SMALL,
    # The ablation of the multi-head tokenizer: one codebook over the same latent width. Matching 4 heads of 256 codes, 2^32
    # combinations, is out of the question; of what fits, 4096 codes are what 94,000 training tokens still fill, and
    # embedding and read-out of the pose module already cost two million parameters more.
    "single-head": replace(ModelConfig(), **SINGLE_HEAD),
    "small-single-head": replace(SMALL, **SINGLE_HEAD),
    # The parameter counts that section 7.4 gives: 150 M for the pose module of 16 layers and 16 heads at width 1024, 50 M
    # for the root module at width 512, 23.5 M for encoder and decoder together. Those counts fix what the text leaves
    # open: feed-forward layers of twice the width, and 512 channels (the text says 1024, which would make it 94 M).
    "paper": ModelConfig(
        encoder_channels=(512, 512, 512),
        decoder_channels=(512, 512, 512),
        root_dim=512,
        root_layers=7,
        pose_dim=1024,
        pose_layers=16,
        pose_feedforward=2,
        attention_head_dim=64,
    ),
    # The widths of the text instead, whatever they count to: 1024 channels, feed-forward layers of four times the width.
    "paper-wide": ModelConfig(
        encoder_channels=(1024, 1024, 1024),
        decoder_channels=(1024, 1024, 1024),
        root_dim=512,
        root_layers=7,
        pose_dim=1024,
        pose_layers=16,
        attention_head_dim=64,
    ),
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
        delta_dim=32,
        delta_layers=1,
    ),
}
# The levels that Mentzer et al. (2023, table 1) advise for about 2^8 codes; their product is 240.
FSQ_LEVELS = (8, 6, 5)
