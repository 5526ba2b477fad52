"""Reconstruction: captured motion to tokens and back, by the first stage's decoder and by the flow decoder."""

import torch

from troupe_training.evaluate.vermo.answers import captured, decoded, markdown
from troupe_training.models.vermo.config import MAX_TOKENS, RATE
from troupe_training.models.vermo.flow import FlowDecoder
from troupe_training.models.vermo.tokenizer import Tokenizer
from troupe_training.train.vermo.corpus import Crop, Motions

Figures = dict[str, float]


def whole_crops(motions: Motions, most: int | None = None, tokens: int = MAX_TOKENS) -> list[Crop]:
    """One crop of each clip, from its first frame: all of it, or as much as fits; of more clips every n-th."""
    count = len(motions.clips)
    chosen = range(count) if most is None or most >= count else [n * count // most for n in range(most)]
    clips = [(n, motions.clips[n]) for n in chosen]
    return [Crop(n, clip["start"], min(tokens, clip["frames"] // RATE)) for n, clip in clips]


def reconstruction(
    tokenizer: Tokenizer, flow: FlowDecoder | None, motions: Motions, crops: list[Crop], flow_steps: int
) -> Figures:
    """Means over crops, metres.

    ``mpjpe``: joints in the world, both from the same first root. ``local``: joints about the root. ``ade``, ``fde``: the root,
    in the mean and in the last frame.
    """
    sums: dict[str, float] = {}
    codes = [motions.codes(crop.start, crop.tokens) for crop in crops]
    for crop, made in zip(crops, decoded(tokenizer, flow, codes, flow_steps), strict=True):
        truth = captured(motions, crop)
        error = (made.joints - truth.joints).norm(dim=-1)
        place = error[:, 0]
        local = [clip.joints - clip.joints[:, :1] for clip in (made, truth)]
        terms = {
            "mpjpe": float(error.mean()),
            "local": float((local[0] - local[1]).norm(dim=-1).mean()),
            "ade": float(place.mean()),
            "fde": float(place[-1]),
        }
        for name, value in terms.items():
            sums[name] = sums.get(name, 0.0) + value / len(crops)
    return sums | codes_used(codes, tokenizer.config.codes)


def codes_used(codes: list[list[int]], count: int) -> Figures:
    """The share of ``count`` codes that occur, and the exponential of the entropy of all that are said."""
    used = torch.bincount(torch.tensor([code for row in codes for code in row]), minlength=count)
    share = used / used.sum()
    return {
        "codes": float((used > 0).float().mean()),
        "perplexity": float(torch.exp(-(share * torch.log(share + 1e-12)).sum())),
    }


def reconstruction_table(figures: dict[str, Figures]) -> str:
    """Rows by decoder and split."""
    header = ["", "MPJPE (mm)", "about the root (mm)", "root ADE (mm)", "root FDE (mm)", "codes used (%)", "perplexity"]
    rows = [
        [name]
        + [f"{1e3 * f[key]:.1f}" for key in ("mpjpe", "local", "ade", "fde")]
        + [f"{100 * f['codes']:.1f}", f"{f['perplexity']:.0f}"]
        for name, f in figures.items()
    ]
    return markdown(header, rows)
