"""FlowVQ's first stage (paper, section 4.2): residual convolutions over time, and codes of fixed levels or of a codebook.

Four frames are a token. There are no normalisation layers, and nothing is causal. A frame of the decoder depends on
`DECODER_REACH` tokens on either side, exactly, so a stream can decode the end of its tokens again and again.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from troupe_training.data.precision import full_precision
from troupe_training.data.skeleton import Skeleton
from troupe_training.models.layers import FrameConv, Standardiser, stack_frames, unstack_frames
from troupe_training.models.motionbricks.config import ModelConfig
from troupe_training.models.motionbricks.quantizers import quantizer_of
from troupe_training.models.vermo.config import TokenizerConfig
from troupe_training.models.vermo.frames import Body, features

RESIDUAL_GAIN = 0.3  # without normalisation, a deep stack must start near the identity


class Block(nn.Module):
    """``x + point(relu(conv(relu(x))))``."""

    def __init__(self, width: int):
        super().__init__()
        self.conv = FrameConv(width, 3)
        self.point = nn.Linear(width, width)
        with torch.no_grad():
            self.point.weight.mul_(RESIDUAL_GAIN)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, T, C]`` to the same; each step sees one on either side."""
        return x + self.point(F.relu(self.conv(F.relu(x))))


class WideBlock(Block):
    """A `Block`, then ``x + down(relu(up(relu(x))))`` within each step: for low rates, where width costs little."""

    def __init__(self, width: int):
        super().__init__(width)
        self.up, self.down = nn.Linear(width, 2 * width), nn.Linear(2 * width, width)
        with torch.no_grad():
            self.down.weight.mul_(RESIDUAL_GAIN)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, T, C]`` to the same."""
        x = super().forward(x)
        return x + self.down(F.relu(self.up(F.relu(x))))


class Encoder(nn.Module):
    """Standardised features ``[B, F, 9 J + 4]`` to latents ``[B, T, C]``."""

    def __init__(self, config: TokenizerConfig, inputs: int):
        super().__init__()
        width = config.width
        self.enter = nn.Linear(inputs, width)
        self.single = Block(width)
        self.down_half = nn.Linear(2 * width, width)
        self.pairs = WideBlock(width)
        self.down_token = nn.Linear(2 * width, width)
        self.quads = nn.Sequential(*(WideBlock(width) for _ in range(config.token_blocks)))
        self.leave = nn.Linear(width, config.code_dim)

    def forward(self, x: Tensor) -> Tensor:
        """Latents, of a whole number of tokens."""
        x = self.single(self.enter(x))
        x = self.pairs(self.down_half(stack_frames(x, 2)))
        return self.leave(self.quads(self.down_token(stack_frames(x, 2))))


class Decoder(nn.Module):
    """Levels ``[B, T, C]`` to standardised states ``[B, F, D]``."""

    def __init__(self, config: TokenizerConfig, outputs: int):
        super().__init__()
        width = config.width
        self.enter = nn.Linear(config.code_dim, width)
        self.quads = WideBlock(width)
        self.up_half = nn.Linear(width, 2 * width)
        self.pairs = WideBlock(width)
        self.up_full = nn.Linear(width, 2 * width)
        self.single = nn.Sequential(Block(width), Block(width))
        self.leave = nn.Linear(width, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Standardised states."""
        x = self.quads(self.enter(x))
        x = self.pairs(unstack_frames(self.up_half(x), 2))
        return self.leave(self.single(unstack_frames(self.up_full(x), 2)))


class Tokenizer(nn.Module):
    """Encoder, codes and decoder, with the constants of a skeleton."""

    def __init__(self, config: TokenizerConfig, skeleton: Skeleton):
        super().__init__()
        self.config = config
        self.body = Body(skeleton)
        self.feature_scale = Standardiser(9 * self.body.joints + 4)
        self.state_scale = Standardiser(self.body.state_width)
        self.encoder = Encoder(config, 9 * self.body.joints + 4)
        levels = config.levels if config.quantizer == "fsq" else ()
        self.quantizer = quantizer_of(
            ModelConfig(heads=1, codes=config.codes, code_dim=config.code_dim, fsq_levels=levels)
        )
        self.decoder = Decoder(config, self.body.state_width)

    def latent(self, pose: Tensor, root: Tensor) -> Tensor:
        """Latents ``[B, T, C]`` of pose features ``[B, F, 9 J]`` and roots ``[B, F, 5]``."""
        return self.encoder(self.feature_scale(features(pose, root)))

    def encode(self, pose: Tensor, root: Tensor) -> Tensor:
        """Codes ``[B, T]`` of pose features and roots of 4 T frames."""
        return self.quantizer.tokens(self.latent(pose, root))[..., 0]

    def embed(self, tokens: Tensor) -> Tensor:
        """The decoder's input ``[B, T, C]`` of codes ``[B, T]``; levels are -1 to 1."""
        return self.quantizer.embed(tokens[..., None])

    @full_precision
    def state(self, levels: Tensor) -> Tensor:
        """States ``[B, F, D]`` in physical units."""
        return self.state_scale.invert(self.decoder(levels).float())

    def decode(self, tokens: Tensor) -> tuple[Tensor, Tensor]:
        """Pose features ``[B, F, 9 J]`` and roots ``[B, F, 5]`` of codes, in the frame of the first root."""
        return self.body.frames(self.state(self.embed(tokens)))
