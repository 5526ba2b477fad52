"""Heads and codes at a fixed capacity (paper figure 11): what the tokenizer keeps, and how it bears wrong tokens.

All variants have 2^24 combinations of codes a token and the same latent width. A share of the tokens is replaced at
random before decoding, as a pose module's mistakes would; root and keyframes are true.
"""

from dataclasses import replace
from typing import Any

import torch

from troupe_training.analyses.common import (
    Setting,
    budget_text,
    curve,
    mean_loss,
    measure,
    panels_of,
    train_variant,
    write,
)
from troupe_training.data.conventions import CONTEXT_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.data.store import Segments
from troupe_training.evaluate.bench import Method, Sampling
from troupe_training.evaluate.report import TRUTH
from troupe_training.evaluate.tables import Figure
from troupe_training.models.motionbricks.config import ModelConfig
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.motionbricks.tokenizer import TOKENIZER, tokenizer_loss
from troupe_training.train.plots import Line, Panel

CAPACITY_BITS = 24
VARIANTS = ((2, 4096), (3, 256), (4, 64), (6, 16), (8, 8), (12, 4))
LATENT_WIDTH = 96
SHARES = (0.0, 0.1, 0.2, 0.4)
GAP = 31  # a window of 36 frames is nine whole tokens
TEST_BATCHES = 20
FIGURES = ("fid", "npss", "target_keyframe_error_m", "l2p_m")


def variant(preset: ModelConfig, heads: int, codes: int) -> ModelConfig:
    """The preset with other heads and codes."""
    return replace(preset, heads=heads, codes=codes, code_dim=LATENT_WIDTH // heads)


def spoilt(model: Tokenizer, share: float) -> Method:
    """Encodes windows, replaces a share of the tokens, and decodes with the true root, context and target."""

    def method(segments: Segments, frames: int, sampling: Sampling) -> Motion:
        generator = torch.Generator().manual_seed(sampling.seed)
        with torch.no_grad():
            tokens = model.quantizer.tokens(model.encode(segments.pose))
            wrong = torch.rand(tokens.shape, generator=generator) < share
            other = torch.randint(model.config.codes, tokens.shape, generator=generator)
            embedded = model.quantizer.embed(torch.where(wrong, other, tokens))
            mask = torch.zeros(segments.pose.shape[:2])
            mask[:, [*range(CONTEXT_FRAMES), frames - 1]] = 1.0
            out = model.decoder(embedded, segments.global_root, segments.pose, mask)
        return Motion(out.global_root[..., :3], out.rotations)

    return method


def run(setting: Setting) -> bool:
    """Trains and measures all variants; false if it was stopped."""
    bench = setting.bench()
    store = bench.store
    found: dict[str, list[dict[str, Any]]] = {}
    methods: dict[str, Method] = {}
    for heads, codes in VARIANTS:
        config = variant(setting.preset, heads, codes)
        for seed in setting.seeds:
            folder = setting.out / "heads-codes" / f"{heads}x{codes}-seed{seed}"
            if not train_variant(setting, "tokenizer", folder, config, seed):
                return False
            model = TOKENIZER.load(folder, store)
            loss = mean_loss(tokenizer_loss(store, setting.frames_per_step), model, TEST_BATCHES)
            row: dict[str, Any] = {"seed": seed, "test_loss": loss["total"] - loss["commitment"]}
            found.setdefault(f"{heads} x {codes}", []).append(row | {"curve": curve(folder, "tokenizer", "fk")})
            methods |= {_key(f"{heads} x {codes}", seed, share): spoilt(model, share) for share in SHARES}
    figures = measure(bench, methods, GAP)
    for name, rows in found.items():
        for row in rows:
            row["perturbed"] = {str(share): figures[_key(name, row["seed"], share)] for share in SHARES}
    _write(setting, found, figures[TRUTH])
    return True


def _key(name: str, seed: int, share: float) -> str:
    return f"{name}, seed {seed}, {share} wrong"


def _write(setting: Setting, found: dict[str, list[dict[str, Any]]], truth: dict[str, Figure]) -> None:
    def lines(figure: str) -> list[Line]:
        return [
            Line(name, list(SHARES), [[r["perturbed"][str(s)][figure]["mean"] for s in SHARES] for r in rows])
            for name, rows in found.items()
        ]

    curves = [Line(name, rows[0]["curve"][0], [rows[0]["curve"][1]]) for name, rows in found.items()]
    panels = [Panel("joint loss in training (m x 6)", "update", curves, log=True)]
    panels += panels_of(FIGURES, truth, "share of wrong tokens", lines)
    report = {
        "capacity_bits": CAPACITY_BITS,
        "latent_width": LATENT_WIDTH,
        "gap_frames": GAP,
        "budget": setting.budget(),
        "ground_truth": truth,
        "variants": found,
    }
    title = f"heads x codes at 2^{CAPACITY_BITS} combinations: {budget_text(setting)}"
    write(setting, "heads-codes", report, title, panels)
