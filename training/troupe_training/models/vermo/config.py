"""Sizes of VerMo's networks: the default pack's, and tiny ones for tests."""

from dataclasses import dataclass
from math import prod

RATE = 4  # frames of a token
DECODER_REACH = 2  # tokens on either side that a frame of the stage-1 decoder depends on
MAX_TOKENS = 64  # of motion, for each body: 256 frames, the longest crop of the tokenizer's training
MIN_TOKENS = 2
QUANTIZERS = ("fsq", "vq")  # fixed levels, or a learned codebook
FLOW_STEPS = 28  # Euler steps of the flow decoder (paper, section 4.2)


@dataclass(frozen=True)
class TokenizerConfig:
    """Widths of the tokenizer's convolutions and levels of its codes (paper: width 512, the same levels).

    ``quantizer`` "vq" is a learned codebook of as many codes, for comparison: nothing but the tokenizer works with it.
    """

    width: int = 256
    token_blocks: int = 3  # residual blocks of the encoder at a quarter of the frame rate
    levels: tuple[int, ...] = (7, 5, 5, 5, 5)
    quantizer: str = "fsq"  # of `QUANTIZERS`
    book_dim: int = 32  # dimensions of a codebook's codes

    @property
    def codes(self) -> int:
        """Number of motion codes."""
        return prod(self.levels)

    @property
    def code_dim(self) -> int:
        """Dimensions of a token between encoder and decoder."""
        return len(self.levels) if self.quantizer == "fsq" else self.book_dim


@dataclass(frozen=True)
class FlowConfig:
    """Sizes of the flow decoder's transformer."""

    width: int = 256
    layers: int = 4
    heads: int = 8
    feedforward: int = 2  # times the width


@dataclass(frozen=True)
class LanguageConfig:
    """Sizes of the language model, a decoder like LLaMA's."""

    width: int = 256
    layers: int = 6
    heads: int = 8
    key_heads: int = 2
    feedforward: int = 640
    positions: int = 128  # the longest message, in tokens

    @property
    def head_width(self) -> int:
        """Width of a head's queries, keys and values."""
        return self.width // self.heads


@dataclass(frozen=True)
class Preset:
    """Sizes of all networks of a pack."""

    tokenizer: TokenizerConfig = TokenizerConfig()
    flow: FlowConfig = FlowConfig()
    language: LanguageConfig = LanguageConfig()


PRESETS = {
    "default": Preset(),
    "tiny": Preset(
        TokenizerConfig(width=32, token_blocks=1),
        FlowConfig(width=32, layers=1, heads=2),
        LanguageConfig(width=32, layers=2, heads=4, key_heads=2, feedforward=64),
    ),
}
