"""Sizes of the networks and of training. One preset is what the default pack uses, one is for tests."""

from dataclasses import asdict, dataclass

FPS = 30.0
FRAMES_PER_TOKEN = 4
MIN_TOKENS = 3
MAX_TOKENS = 16
MAX_FRAMES = FRAMES_PER_TOKEN * MAX_TOKENS
COUNTS = MAX_TOKENS - MIN_TOKENS + 1
CONTEXT_FRAMES = 4
MAX_TARGETS = 4
SLOTS = CONTEXT_FRAMES + MAX_TARGETS


@dataclass
class ModelConfig:
    """Widths and depths; the paper's sizes are ten times these (section 7.4)."""

    heads: int = 4
    codes: int = 256
    code_dim: int = 24
    # Convolution channels at a quarter, half and full frame rate.
    encoder_channels: tuple[int, int, int] = (256, 192, 128)
    decoder_channels: tuple[int, int, int] = (320, 224, 128)
    kernels: tuple[int, int, int] = (3, 5, 7)
    root_dim: int = 192
    root_layers: int = 3
    pose_dim: int = 256
    pose_layers: int = 5
    attention_head_dim: int = 32

    def to_dict(self) -> dict:
        """Plain values, for checkpoints."""
        return asdict(self)


PRESETS = {
    "default": ModelConfig(),
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
