"""``vermo ablate``: the paper's training stages and FSQ beside VQ, one training after another, and tables of them."""

import argparse
from pathlib import Path

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.cli.vermo import CACHE, GROUP
from troupe_training.train.vermo.study import Terms, begun_with, done, keep_terms, planned, train_all

OPTIONS["--tokenizer-run"] = {
    "type": Path,
    "help": "run whose tokenizer, captions, pieces and judge all language models share, and its flow decoder if it has one",
}
OPTIONS["--tokenizer-rate"] = {"type": float, "default": 8e-4, "help": "highest learning rate of tokenizers"}


@command(
    *("--cache", "--tokenizer-run", "--run", "--vermo-preset", "--minutes", "--steps", "--per-step", "--rate"),
    *("--frames-per-step", "--tokenizer-rate", "--balance", "--seeds", "--only", "--measure-only", "--device"),
    *("--threads",),
    group=GROUP,
    required=("--tokenizer-run",),
    cache=CACHE,
    run=Path("runs/vermo-ablations"),
    per_step=1024,
    rate=1e-3,
    frames_per_step=3072,
    balance=1.0,
    seeds=[1, 2, 3],
)
def ablate(args: argparse.Namespace) -> int:
    """Training stages, single tasks, FSQ and VQ: trains one after another, then measures all. The same command goes on."""
    torch.set_num_threads(args.threads)
    runs = planned(args.seeds)
    if args.only:
        unknown = set(args.only) - {run.name for run in runs}
        if unknown:
            raise SystemExit(f"no run {', '.join(sorted(unknown))}; there are {', '.join(run.name for run in runs)}")
        runs = [run for run in runs if run.name in args.only]
    minutes = args.minutes if args.minutes or args.steps else 60.0
    terms = Terms(
        *(args.cache, args.tokenizer_run, args.vermo_preset, minutes, args.steps, args.rate, args.tokenizer_rate),
        *(args.per_step, args.frames_per_step, args.balance, args.device),
    )
    keep_terms(args.run, begun_with(terms))
    if args.measure_only:
        runs = [run for run in runs if done(args.run, run)]
        if not runs:
            raise SystemExit(f"{args.run}: no run is done")
    elif not train_all(args.run, runs, terms):
        print("stopped; the same command goes on from the checkpoint")
        return STOPPED
    return 0
