"""Text to motion and motion to text: whether the judge finds what a caption asked for, and whether motions are named right."""

import random
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.captions import caption, plain_captions, style_phrases, unstyled
from troupe_training.evaluate.distribution import Gaussian, frechet
from troupe_training.evaluate.vermo.answers import Answering, Clip, Model, captured, markdown
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.judge import Judge
from troupe_training.models.vermo.messages import Message
from troupe_training.train.vermo.corpus import Crop, Motions
from troupe_training.train.vermo.judge import NO_STYLE

POOLS = (32, 256)
TOPS = (1, 2, 3)
PAIRS = 300  # for diversity
REPEATS = 20  # draws of pools
Figures = dict[str, float]
Name = tuple[str, str | None]


@dataclass
class Asked:
    """A caption, and the captured clip that it was made for."""

    text: str
    name: Name
    crop: Crop


def asked_of(motions: Motions, crops: list[Crop], seed: int) -> list[Asked]:
    """One caption of each crop, always with its style."""
    rng = random.Random(seed)
    return [Asked(caption(motions.facts(crop), rng.getrandbits(32)), motions.names[crop.clip], crop) for crop in crops]


@torch.no_grad()
def judged(judge: Judge, clips: list[Clip]) -> Tensor:
    """The judge's features of motions, ``[N, width]``."""
    rows = []
    for clip in clips:
        tokens = len(clip.pose) // RATE
        frames = slice(0, tokens * RATE)
        rows.append(judge.read(clip.pose[None, frames], clip.root[None, frames], torch.tensor([tokens]))[0])
    return torch.stack(rows)


@torch.no_grad()
def text_figures(judge: Judge, hidden: Tensor, real: Tensor, asked: list[Asked], pieces: list[list[int]]) -> Figures:
    """Figures of motions (as `judged` reads them) that answer captions, beside the captured ones ``real``."""
    motions, captions = judge.motions(hidden), judge.captions(pieces)
    distance = torch.cdist(captions, motions)
    figures = {"mm_distance": float(distance.diagonal().mean())}
    rng = np.random.default_rng(5)
    for pool in POOLS:
        size = min(pool, len(asked))
        hits = np.zeros(len(TOPS))
        for _ in range(REPEATS):
            chosen = torch.from_numpy(rng.choice(len(asked), size, replace=False))
            rank = (distance[chosen][:, chosen] < distance[chosen, chosen][:, None]).sum(-1)
            hits += [float((rank < top).float().mean()) for top in TOPS]
        figures |= {f"r{top}_{pool}": hit / REPEATS for top, hit in zip(TOPS, hits, strict=True)}
    shown: dict[str, np.ndarray] = {}
    for name, scores, known, wanted in (
        ("content", judge.content(hidden), judge.config.contents, [a.name[0] for a in asked]),
        ("style", judge.style(hidden), judge.config.styles, [a.name[1] or NO_STYLE for a in asked]),
    ):
        found = [known[int(n)] for n in scores.argmax(-1)]
        shown[name] = np.array([a == b for a, b in zip(found, wanted, strict=True)])
        figures[name] = float(shown[name].mean())
    figures["both"] = float((shown["content"] & shown["style"]).mean())
    vectors, true_vectors = motions.numpy(), judge.motions(real).numpy()
    figures["fid"] = frechet(Gaussian(vectors), Gaussian(true_vectors))
    first, second = rng.integers(0, len(asked), (2, PAIRS))
    figures["diversity"] = float(np.linalg.norm(vectors[first] - vectors[second], axis=-1).mean())
    return figures


def generated(model: Answering, asked: list[Asked], seed: int, flow_steps: int = 0) -> list[Clip]:
    """Motions for captions, as long as the captured ones."""
    messages, guides = [], []
    for one in asked:
        message = Message("text_to_motion", [model.pieces.ids(one.text)], length=one.crop.tokens)
        plain = unstyled(one.text, style_phrases())
        messages.append(message)
        guides.append(model.sampling.guides(message, model.pieces.ids(plain)) if plain else [])
    return model.motions(model.replies(messages, seed, guides=guides), flow_steps, seed)


def multimodality(judge: Judge, model: Answering, asked: list[Asked], samples: int, flow_steps: int = 0) -> float:
    """Mean distance between the vectors of several motions for one caption."""
    hidden = [judged(judge, generated(model, asked, 100 + n, flow_steps)) for n in range(samples)]
    with torch.no_grad():
        vectors = torch.stack([judge.motions(rows) for rows in hidden], 1)
    pairs = torch.cdist(vectors, vectors).sum((1, 2)) / (samples * (samples - 1))
    return float(pairs.mean())


@torch.no_grad()
def retrieved(judge: Judge, pieces: list[list[int]], seen: Motions, seen_pieces: list[list[int]]) -> list[Clip]:
    """The captured training clip whose caption is nearest to each text."""
    table = judge.captions(seen_pieces)
    clips = []
    for row in judge.captions(pieces):
        clip = int((table @ row).argmax())
        entry = seen.clips[clip]
        clips.append(captured(seen, Crop(clip, entry["start"], min(64, entry["frames"] // RATE))))
    return clips


def named_by(text: str, names: list[Name]) -> set[Name]:
    """The contents and styles whose plain captions a text is."""
    return {name for name in names if text in plain_captions(*name)}


def description_figures(
    model: Model, motions: Motions, crops: list[Crop], names: list[Name]
) -> tuple[Figures, list[str]]:
    """How often content and style are named right, both, and how often the text is a plain caption at all."""
    messages = [Message("motion_to_text", condition=[[motions.codes(c.start, c.tokens)]]) for c in crops]
    texts = model.texts(messages)
    sums = dict.fromkeys(("content", "style", "both", "well_formed"), 0.0)
    for crop, text in zip(crops, texts, strict=True):
        truth, guesses = motions.names[crop.clip], named_by(text, names)
        sums["well_formed"] += bool(guesses)
        sums["content"] += truth[0] in {content for content, _ in guesses}
        sums["style"] += truth[1] in {style for _, style in guesses}
        sums["both"] += truth in guesses
    return {name: value / len(crops) for name, value in sums.items()}, texts


def text_table(figures: dict[str, Figures]) -> str:
    """Rows by method and split."""
    header = ["", *(f"R@{top}, pool {pool}" for pool in POOLS for top in TOPS)]
    header += ["MM distance", "FID", "diversity", "content (%)", "style (%)", "both (%)", "multimodality"]
    rows = []
    for name, f in figures.items():
        row = [name, *(f"{f[f'r{top}_{pool}']:.3f}" for pool in POOLS for top in TOPS)]
        row += [f"{f['mm_distance']:.3f}", f"{f['fid']:.3f}", f"{f['diversity']:.3f}"]
        row += [f"{100 * f[key]:.1f}" if key in f else "" for key in ("content", "style", "both")]
        rows.append([*row, f"{f['multimodality']:.3f}" if "multimodality" in f else ""])
    return markdown(header, rows)


def description_table(figures: dict[str, Figures]) -> str:
    """Rows by split."""
    header = ["", "content (%)", "style (%)", "both (%)", "a known sentence (%)"]
    keys = ("content", "style", "both", "well_formed")
    return markdown(header, [[name, *(f"{100 * f[key]:.1f}" for key in keys)] for name, f in figures.items()])
