"""``vermo ablate``: the paper's training stages and FSQ beside VQ, one training after another, and tables of them."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.cli.vermo import CACHE, GROUP, SAMPLED
from troupe_training.evaluate.vermo.measure import Setting
from troupe_training.evaluate.vermo.study import measure_study
from troupe_training.export.vermo.pack import SAMPLING
from troupe_training.models.vermo.config import FLOW_STEPS
from troupe_training.models.vermo.sampler import Sampling
from troupe_training.train.study import keep_terms, picked
from troupe_training.train.vermo.study import Terms, begun_with, done, planned, train_all

OPTIONS["--tokenizer-run"] = {
    "type": Path,
    "help": "run whose tokenizer, captions, pieces and judge all language models share, and its flow decoder if it has one",
}
OPTIONS["--tokenizer-rate"] = {"type": float, "default": 8e-4, "help": "highest learning rate of tokenizers"}


@command(
    *("--cache", "--tokenizer-run", "--run", "--vermo-preset", "--minutes", "--steps", "--per-step", "--rate"),
    *("--frames-per-step", "--tokenizer-rate", "--balance", "--seeds", "--only", "--measure-only", "--device"),
    *("--parts", "--max-windows", "--samples", "--flow-steps", *SAMPLED, "--seed", "--threads"),
    group=GROUP,
    required=("--tokenizer-run",),
    cache=CACHE,
    run=Path("runs/vermo-ablations"),
    per_step=1024,
    rate=1e-3,
    frames_per_step=3072,
    balance=1.0,
    seeds=[1, 2, 3],
    samples=2,
    flow_steps=FLOW_STEPS,
    temperature=SAMPLING.temperature,
    seed=1,
)
def ablate(args: argparse.Namespace) -> int:
    """Training stages, single tasks, FSQ and VQ: trains one after another, then measures all. The same command goes on."""
    torch.set_num_threads(args.threads)
    runs = picked(planned(args.seeds), args.only)
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
    sampling = Sampling(args.temperature, args.top_k, args.top_p, args.repetition)
    setting = Setting(
        *(args.tokenizer_run, args.cache, args.parts, sampling, args.max_windows, args.samples, args.flow_steps),
        args.seed,
    )
    figures, tables = measure_study(args.run, runs, setting)
    text = f"    {args.command_line}\n{tables}"
    print(tables)
    (args.run / "figures.md").write_text(text)
    written = {"command": args.command_line, "terms": asdict(terms), "setting": asdict(setting)} | figures
    (args.run / "figures.json").write_text(json.dumps(written, indent=1, default=str) + "\n")
    return 0
