"""Commands of the family VerMo: a language model over text and motion tokens."""

import argparse
from pathlib import Path

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.export.vermo.random_pack import random_pack as export_random
from troupe_training.export.vermo.random_pack import write_reference
from troupe_training.models.vermo.config import PRESETS
from troupe_training.train.trainer import Budget, Job
from troupe_training.train.vermo.tokenizer import train_tokenizer

GROUP = "vermo"
RUN = Path("runs/vermo")
# Minutes, seed and learning rate of a stage where the command line does not say them.
DEFAULTS = {"tokenizer": (180.0, 41, 5e-4)}
OPTIONS["vermo_stage"] = {"choices": DEFAULTS, "metavar": "STAGE", "help": " or ".join(DEFAULTS)}
OPTIONS["--reference"] = {"type": Path, "help": "also write what PyTorch answers to some messages here, as JSON"}
OPTIONS["--vermo-preset"] = {"choices": PRESETS, "default": "default", "help": "network sizes"}


@command(
    *("vermo_stage", "--cache", "--run", "--vermo-preset", "--balance", "--minutes", "--steps", "--frames-per-step"),
    *("--rate", "--fresh-schedule", "--seed", "--device", "--threads"),
    group=GROUP,
    run=RUN,
)
def train(args: argparse.Namespace) -> int:
    """Trains one stage; stops at any moment (ctrl-c) and resumes from its checkpoint."""
    torch.set_num_threads(args.threads)
    stage: str = args.vermo_stage
    minutes, seed, rate = DEFAULTS[stage]
    minutes = args.minutes if args.minutes or args.steps else minutes
    budget = Budget(minutes=minutes, steps=args.steps, learning_rate=args.rate or rate)
    seed = seed if args.seed is None else args.seed
    job = Job(args.cache, args.run, budget, args.frames_per_step, seed, args.device, args.balance, args.fresh_schedule)
    if train_tokenizer(job, args.vermo_preset):
        return 0
    print(f"{stage}: stopped; the same command goes on from the checkpoint")
    return STOPPED


@command(
    *("--vermo-preset", "--out", "--like", "--seed", "--reference"),
    group=GROUP,
    required=("--out",),
    vermo_preset="tiny",
    seed=1,
)
def random_pack(args: argparse.Namespace) -> int:
    """A small pack with random weights, for tests of a server: its motion and text mean nothing."""
    networks, pieces = export_random(args.out, args.like, args.vermo_preset, args.seed)
    if args.reference:
        write_reference(args.reference, networks, pieces)
    print(f"{args.out}: random weights, {networks.parameters() / 1e6:.2f} M parameters")
    return 0
