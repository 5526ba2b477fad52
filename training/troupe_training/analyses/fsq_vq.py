"""FSQ against VQ with the same heads and as many codes (paper appendix B, figure 17).

Both train a tokenizer and a pose module of the same sizes for the same time, with the root module of one run, which knows
no tokens. Neither decoder is refined.
"""

from collections.abc import Callable
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

from troupe_training.analyses.common import Setting, budget_text, curve, mean_loss, measure, train_variant, write
from troupe_training.evaluate.bench import Method
from troupe_training.evaluate.motionbricks import of_networks, run_networks
from troupe_training.evaluate.report import TRUTH
from troupe_training.models.motionbricks.config import FSQ_LEVELS, ModelConfig
from troupe_training.train.motionbricks.pose import POSE, pose_loss
from troupe_training.train.motionbricks.root import ROOT
from troupe_training.train.motionbricks.tokenizer import TOKENIZER, tokenizer_loss
from troupe_training.train.plots import Line, Panel

TEST_BATCHES = 20


def variants(preset: ModelConfig) -> dict[str, ModelConfig]:
    """Codebooks and levels with the same number of codes a head."""
    codes = prod(FSQ_LEVELS)
    return {
        "VQ": replace(preset, codes=codes, fsq_levels=()),
        "FSQ": replace(preset, codes=codes, code_dim=len(FSQ_LEVELS), fsq_levels=FSQ_LEVELS),
    }


def _with_root(folder: Path, source: Path) -> None:
    """Puts the run's root module into a variant's folder."""
    root = ROOT.path(source).resolve()
    if not root.exists():
        raise SystemExit(f"{root} is missing: fsq-vq takes --run, whose root module both variants use")
    folder.mkdir(parents=True, exist_ok=True)
    if not ROOT.path(folder).exists():
        ROOT.path(folder).symlink_to(root)


def run(setting: Setting) -> bool:
    """Trains and measures both; false if it was stopped."""
    bench = setting.bench()
    store = bench.store
    found: dict[str, list[dict[str, Any]]] = {}
    methods: dict[str, Method] = {}
    for name, config in variants(setting.preset).items():
        for seed in setting.seeds:
            folder = setting.out / "fsq-vq" / f"{name}-seed{seed}"
            _with_root(folder, setting.source)
            for stage in ("tokenizer", "pose"):
                if not train_variant(setting, stage, folder, config, seed):
                    return False
            tokenizer, root = TOKENIZER.load(folder, store), ROOT.load(folder, store)
            pose = POSE.load(folder, store)
            kept = mean_loss(tokenizer_loss(store, setting.frames_per_step), tokenizer, TEST_BATCHES)
            test_loss = pose_loss(store, setting.frames_per_step, tokenizer, root)
            found.setdefault(name, []).append(
                {
                    "seed": seed,
                    "test_reconstruction": kept["total"] - kept["commitment"],
                    "test_joint_loss": kept["fk"],
                    "codes_used": kept["_perplexity"],
                    "test_entropy": mean_loss(test_loss, pose, TEST_BATCHES)["entropy"],
                    "curves": {
                        "reconstruction": curve(folder, "tokenizer", "fk"),
                        "entropy": curve(folder, "pose", "entropy"),
                    },
                }
            )
            methods[f"{name}, seed {seed}"] = of_networks(run_networks(folder, store))
    figures = measure(bench, methods, setting.gap)
    for name, rows in found.items():
        for row in rows:
            row["in_between"] = figures[f"{name}, seed {row['seed']}"]
    _write(setting, found, {"ground_truth": figures[TRUTH]} | setting.conditions(bench))
    return True


def _write(setting: Setting, found: dict[str, list[dict[str, Any]]], about: dict[str, Any]) -> None:
    def curves(name: str) -> list[Line]:
        return [Line(k, rows[0]["curves"][name][0], [rows[0]["curves"][name][1]]) for k, rows in found.items()]

    def bars(value: Callable[[dict[str, Any]], float]) -> list[Line]:
        return [Line(k, [float(i)], [[value(r)] for r in rows]) for i, (k, rows) in enumerate(found.items())]

    panels = [
        Panel("joint loss in training (m x 6)", "update", curves("reconstruction"), log=True),
        Panel("cross-entropy of tokens in training", "update", curves("entropy")),
        Panel("cross-entropy on the test split", "variant", bars(lambda r: r["test_entropy"])),
    ]
    if setting.evaluator:
        fid = bars(lambda r: r["in_between"]["fid"]["mean"])
        panels.append(Panel(f"FID, gap of {setting.gap}", "variant", fid))
    report = {
        "levels": FSQ_LEVELS,
        "codes": prod(FSQ_LEVELS),
        "heads": setting.preset.heads,
        "budget": setting.budget(),
        "variants": found,
    } | about
    write(setting, "fsq-vq", report, f"FSQ and VQ of {prod(FSQ_LEVELS)} codes: {budget_text(setting)}", panels)
