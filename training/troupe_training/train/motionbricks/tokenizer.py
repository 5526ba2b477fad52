"""The tokenizer's training: encode, quantise, decode."""

import torch
from torch import Generator, Tensor

from troupe_training.data.store import ClipStore, Segments
from troupe_training.models.motionbricks.config import ModelConfig, config_of
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.checkpoints import Stage
from troupe_training.train.motionbricks.losses import Body, reconstruction_losses
from troupe_training.train.motionbricks.masks import random_keyframe_mask
from troupe_training.train.statistics import standardised
from troupe_training.train.trainer import Loss

# Noise on the decoder's root input, the size of r_g3's error, so that the decoder learns to clean
# it (r_g4).
ROOT_NOISE_M = 0.006
ROOT_NOISE_RAD = 0.015
SPOILT_SHARE = 0.2  # of the tokens, at most, and not before `SPOILT_FROM` of the budget is spent
SPOILT_FROM = 0.15
COMMITMENT = 0.25  # weight of the loss that keeps an encoder near its codes


def build_tokenizer(config: ModelConfig, store: ClipStore) -> Tokenizer:
    """A new tokenizer with its standardisation constants set."""
    model = Tokenizer(config, store.skeleton.joint_count, len(store.skeleton.contact_joints))
    scales = {"pose_scale": "pose", "root_scale": "local_root", "velocity_scale": "velocity"}
    return standardised(model, store, **{f"decoder.{name}": feature for name, feature in scales.items()})


TOKENIZER = Stage("tokenizer", config_of, build_tokenizer)
REFINE = Stage("refine", config_of, build_tokenizer)  # the tokenizer again, its decoder trained further
ENCODER = Stage("encoder", config_of, build_tokenizer)  # an adopted tokenizer, which has got an encoder again


def noisy_root(segments: Segments, mask: Tensor, generator: Generator) -> Tensor:
    """The true global root, for half of the samples shaken by what r_g3 typically gets wrong; keyframes stay exact."""
    root = segments.global_root
    batch, frames, _ = root.shape
    used = (torch.rand(batch, 1, 1, generator=generator) < 0.5).float()
    amount = torch.rand(batch, 1, 1, generator=generator) * used * (1.0 - mask.cpu()[..., None])
    shift = (torch.randn(batch, frames, 3, generator=generator) * amount * ROOT_NOISE_M).to(root.device)
    turn = (torch.randn(batch, frames, generator=generator) * amount[..., 0] * ROOT_NOISE_RAD).to(root.device)
    c, s = root[..., 3], root[..., 4]
    turned = torch.stack([c * torch.cos(turn) - s * torch.sin(turn), s * torch.cos(turn) + c * torch.sin(turn)], -1)
    return torch.cat([root[..., :3] + shift, turned], -1)


def spoil_tokens(model: Tokenizer, embedded: Tensor, tokens: Tensor, generator: Generator, most: float) -> Tensor:
    """Replaces up to ``most`` of the tokens of half of the samples at random, so that a mispredicted head does little."""
    if most == 0.0:
        return embedded
    batch = len(tokens)
    share = torch.rand(batch, 1, 1, generator=generator) * most * (torch.rand(batch, 1, 1, generator=generator) < 0.5)
    wrong = (torch.rand(tokens.shape, generator=generator) < share).to(tokens.device)
    other = torch.randint(model.config.codes, tokens.shape, generator=generator).to(tokens.device)
    replaced = model.quantizer.embed(torch.where(wrong, other, tokens))
    keep = (~wrong).float().repeat_interleave(model.config.code_dim, -1)
    return embedded * keep + replaced * (1.0 - keep)


def tokenizer_loss(store: ClipStore, frames_budget: int, taught: bool = False) -> Loss[Tokenizer]:
    """Loss of the tokenizer: encode, quantise (with some tokens spoilt), decode with root and keyframes.

    ``taught``: its tokens are a teacher's, and only the decoder learns.
    """
    body = Body(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: Generator, progress: float) -> dict[str, Tensor]:
        if taught:
            model.quantizer.eval()
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        mask = random_keyframe_mask(batch, frames, generator).to(store.device)
        embedded, tokens, commitment = model.quantizer(model.encode(segments.pose))
        embedded = spoil_tokens(model, embedded, tokens, generator, SPOILT_SHARE if progress > SPOILT_FROM else 0.0)
        out = model.decoder(embedded, noisy_root(segments, mask, generator), segments.pose, mask)
        terms = reconstruction_losses(out, segments, mask, model.decoder, body)
        return terms | {"commitment": COMMITMENT * commitment, "_perplexity": _perplexity(model, tokens)}

    return loss


def encoder_loss(store: ClipStore, frames_budget: int) -> Loss[Tokenizer]:
    """Loss of an encoder that learns alone, by what the fixed decoder makes of its tokens.

    Half of the samples have no keyframe, so that all of the motion has to come through the tokens.
    """
    body = Body(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: Generator, progress: float) -> dict[str, Tensor]:
        model.quantizer.eval()
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        mask = random_keyframe_mask(batch, frames, generator)
        mask = (mask * (torch.rand(batch, 1, generator=generator) < 0.5).float()).to(store.device)
        embedded, tokens, commitment = model.quantizer(model.encode(segments.pose))
        out = model.decoder(embedded, noisy_root(segments, mask, generator), segments.pose, mask)
        terms = reconstruction_losses(out, segments, mask, model.decoder, body)
        return terms | {"commitment": COMMITMENT * commitment, "_perplexity": _perplexity(model, tokens)}

    return loss


def _perplexity(model: Tokenizer, tokens: Tensor) -> Tensor:
    """How many codes a head uses, as the perplexity of a batch ``[B, n, K]``."""
    used = torch.stack([torch.bincount(t, minlength=model.config.codes) for t in tokens.flatten(0, 1).T]).float()
    share = used / used.sum(-1, keepdim=True)
    return torch.exp(-(share * torch.log(share + 1e-9)).sum(-1)).mean()
