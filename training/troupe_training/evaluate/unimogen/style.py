"""Blends of two styles: which of them a classifier takes the answers for.

The classifier is linear, over the latents of the pack evaluator, and trained on captured windows of the two styles. Answers
follow the paths of held-out windows with the window's content and a blend of the styles, without a past that would show a style.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from troupe_training.data.bodies_store import BodyStore
from troupe_training.evaluate.unimogen.encoders import Encoder
from troupe_training.evaluate.unimogen.measure import BATCH, latents_of
from troupe_training.evaluate.unimogen.methods import Answer, Asked, Setting, captured, sampled, style_for
from troupe_training.evaluate.unimogen.networks import Network
from troupe_training.models.unimogen.sampler import Character
from troupe_training.models.unimogen.state import BodyKinematics, decode

WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the second style
PENALTY = 1e-2  # on the classifier's squared weights
MOST_FOR_TRAINING = 600  # windows of each style


@dataclass
class Classifier:
    """A linear one of latents: above 0 is the second style."""

    mean: Tensor
    weights: Tensor
    bias: Tensor

    def share(self, latents: np.ndarray) -> float:
        """Share of latents ``[B, D]`` that are taken for the second style."""
        score = (torch.from_numpy(latents).double() - self.mean) @ self.weights + self.bias
        return float((score > 0).double().mean())


def classifier(first: np.ndarray, second: np.ndarray) -> Classifier:
    """Logistic regression; both styles weigh the same, however many windows there are of each."""
    x = torch.from_numpy(np.concatenate([first, second])).double()
    y = torch.cat([torch.zeros(len(first)), torch.ones(len(second))]).double()
    weight = torch.where(y > 0, 0.5 / len(second), 0.5 / len(first))
    mean = (weight[:, None] * x).sum(0)
    weights = torch.zeros(x.shape[1], dtype=torch.double, requires_grad=True)
    bias = torch.zeros((), dtype=torch.double, requires_grad=True)
    optimiser = torch.optim.LBFGS([weights, bias], max_iter=200, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimiser.zero_grad()
        score = (x - mean) @ weights + bias
        loss = F.binary_cross_entropy_with_logits(score, y, weight, reduction="sum") + PENALTY * (weights**2).sum()
        loss.backward()
        return loss

    optimiser.step(closure)
    return Classifier(mean, weights.detach(), bias.detach())


def windows_of(store: BodyStore, style: str, setting: Setting, most: int | None) -> tuple[Tensor, Tensor]:
    """First frames and clips of the windows that show a style, evenly over all."""
    starts, owners = store.every(setting.frames, setting.stride)
    shows = store.clip_words[owners, store.words.index(style)] > 0
    starts, owners = starts[shows], owners[shows]
    if most is not None and len(starts) > most:
        which = torch.arange(most) * len(starts) // most
        starts, owners = starts[which], owners[which]
    return starts, owners


def shows(store: BodyStore, styles: tuple[str, str], frames: int) -> bool:
    """True if clips that are long enough show either style."""
    long = torch.tensor([clip["frames"] >= frames for clip in store.clips])
    return all(bool((store.clip_words[long, store.words.index(style)] > 0).any()) for style in styles)


def captured_latents(
    store: BodyStore, style: str, setting: Setting, encoder: Encoder, most: int | None = None
) -> np.ndarray:
    """Latents of captures in a style."""
    starts, owners = windows_of(store, style, setting, most)
    if not len(starts):
        raise SystemExit(f"{store.body.name}: no window of {setting.frames} frames shows {style!r}")
    truth_of, parts = captured(store.body), []
    for chunk in range(0, len(starts), BATCH):
        some = slice(chunk, chunk + BATCH)
        asked = Asked.of(store, starts[some], owners[some], setting.frames)
        parts.append(latents_of(store.body, encoder, truth_of(asked)))
    return np.concatenate(parts)


def answered_latents(
    store: BodyStore, styles: tuple[str, str], weight: float, network: Network, setting: Setting, encoder: Encoder
) -> np.ndarray:
    """Latents of a network's answers to the windows of both styles, with their contents and a blend of the styles."""
    body, kinematics, denoiser = store.body, BodyKinematics(store.body), network.denoiser(store.body)
    both = [windows_of(store, style, setting, setting.most) for style in styles]
    starts, owners = (torch.cat(parts) for parts in zip(*both, strict=True))
    first, second = (store.words.index(style) for style in styles)
    parts = []
    for chunk in range(0, len(starts), BATCH):
        some = slice(chunk, chunk + BATCH)
        asked = Asked.of(store, starts[some], owners[some], setting.frames)
        words = asked.windows.words.clone().numpy()
        words[:, first], words[:, second] = 1.0 - weight, weight
        features = asked.path.features(body.size_m).numpy()
        characters = [
            Character(body, features[b], style, setting.seed + chunk + b, guidance=setting.guidance)
            for b, style in enumerate(style_for(words, store.words, network.words))
        ]
        root, bends = decode(body, sampled(denoiser, characters, setting.steps), asked.path, network.limits)
        parts.append(latents_of(body, encoder, Answer(root, kinematics.turned(bends))))
    return np.concatenate(parts)


def trained_classifier(train: BodyStore, styles: tuple[str, str], setting: Setting, encoder: Encoder) -> Classifier:
    """A classifier of two styles, trained on captures of both."""
    return classifier(*(captured_latents(train, style, setting, encoder, MOST_FOR_TRAINING) for style in styles))


def blend(
    judge: Classifier,
    held_out: BodyStore,
    styles: tuple[str, str],
    network: Network,
    setting: Setting,
    encoder: Encoder,
) -> dict[str, float]:
    """Shares of the second style: of captures of either style, and of answers by the second style's weight."""
    found = {
        f"captured {style}": judge.share(captured_latents(held_out, style, setting, encoder, setting.most))
        for style in styles
    }
    for weight in WEIGHTS:
        latents = answered_latents(held_out, styles, weight, network, setting, encoder)
        found[f"{weight:g}"] = judge.share(latents)
    return found


def blend_table(styles: tuple[str, str], shares: dict[str, float]) -> str:
    """The shares as Markdown."""
    lines = [f"| {styles[0]} to {styles[1]} | taken for {styles[1]} (%) |", "|---|---:|"]
    return "\n".join([*lines, *(f"| {name} | {100 * share:.1f} |" for name, share in shares.items())]) + "\n"
