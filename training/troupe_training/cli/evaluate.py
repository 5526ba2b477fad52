"""Commands that measure and show."""

import argparse
import json
from pathlib import Path

import torch

from troupe_training.analyses import ANALYSES
from troupe_training.analyses.common import Setting
from troupe_training.cli.options import OPTIONS, STOPPED, command, filled
from troupe_training.evaluate.bench import Bench, Method, Options, Sampling
from troupe_training.evaluate.card import write_card
from troupe_training.evaluate.motionbricks import PAPER_G1, of_networks, open_networks
from troupe_training.evaluate.parts import parts_markdown
from troupe_training.evaluate.report import measure_all
from troupe_training.evaluate.tables import markdown, print_report
from troupe_training.models.delta import DeltaMethod
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.train.delta import DELTA
from troupe_training.train.motionbricks.stages import STAGES
from troupe_training.train.plots import plot_curves

OPTIONS["analysis"] = {"choices": ANALYSES}
MEASURED = (("--pack", "--run"), "--cache", "--evaluator", "--stride", "--max-windows", "--split", "--threads")
DIVERSITY = ("--diversity-seeds", "--diversity-windows")
CHOICE = ("--temperature", "--pose-steps", "--seed", *DIVERSITY)
VARIANTS = ("--minutes", "--steps", "--seeds", "--preset", "--frames-per-step", "--device")


def _evaluator_of(args: argparse.Namespace, folder: Path) -> Path | None:
    """The evaluator that was asked for, or the folder's, or none."""
    path: Path = args.evaluator or folder / "evaluator.onnx"
    if path.exists():
        return path
    if args.evaluator:
        raise SystemExit(f"{path} is missing: `troupe-train evaluator` makes it")
    print(f"{path} is missing: no FID, MMD and latent diversity")
    return None


@command(
    *MEASURED,
    "--gaps",
    "--uncut",
    "--pinned",
    "--delta",
    "--single-head",
    *CHOICE,
    "--by",
    "--cells",
    "--json",
    "--markdown",
    run=None,
    seed=0,
)
def evaluate(args: argparse.Namespace) -> int:
    """Every measure of a pack or of checkpoints on the test split, without a server."""
    torch.set_num_threads(args.threads)
    folder = args.run or args.pack
    options = filled(Options, args, sampling=Sampling(args.pose_steps, args.temperature, args.seed))
    bench = Bench(args.cache, options, _evaluator_of(args, folder), args.threads)
    methods: dict[str, Method] = {"pack": of_networks(open_networks(folder, bench.store, args.threads))}
    sampled = {"pack"}
    if args.single_head:
        methods["single head"] = of_networks(open_networks(args.single_head, bench.store, args.threads))
        sampled.add("single head")
    if args.delta:
        methods["transformer"] = DeltaMethod(DELTA.load(args.delta, bench.store), bench.skeleton)
    report = {"source": folder.name} | measure_all(bench, methods, sampled)
    print_report(report)
    if args.json:
        args.json.write_text(json.dumps(report, indent=1) + "\n")
    if args.markdown:
        is_g1 = (report["robot"] or "").lower().startswith("g1")
        text = markdown(report, PAPER_G1 if is_g1 else None)
        args.markdown.write_text("\n\n".join([text.rstrip(), *parts_markdown(report)]) + "\n")
    return 0


@command(
    "analysis",
    *MEASURED,
    "--gap",
    "--out",
    *VARIANTS,
    run=None,
    out=Path("runs/analyses"),
    minutes=4.0,
    max_windows=400,
)
def analyse(args: argparse.Namespace) -> int:
    """One of the paper's analyses: figures as JSON, a plot as PNG. fsq-vq takes a run's root module."""
    torch.set_num_threads(args.threads)
    folder = args.run or args.pack
    found = {"source": folder, "evaluator": _evaluator_of(args, folder), "preset": PRESETS[args.preset]}
    setting = filled(Setting, args, **found)
    if ANALYSES[args.analysis](setting):
        return 0
    print(f"{args.analysis}: stopped; the same command goes on from its checkpoints")
    return STOPPED


@command("--run", "--out", out=Path("curves.png"))
def curves(args: argparse.Namespace) -> int:
    """Loss curves as PNG."""
    if not plot_curves(args.run, (*STAGES, DELTA.name), args.out):
        raise SystemExit(f"no training history under {args.run}")
    return 0


@command("--pack", "--evaluation", "--baselines", "--before", "--notes", required=("--evaluation",))
def card(args: argparse.Namespace) -> int:
    """Writes a pack's README from its manifest and the JSON of `troupe-eval gaps`."""
    write_card(args.pack, args.evaluation, args.notes, args.baselines, args.before)
    return 0
