"""``unimogen ablate``: the paper's ablations, single and unseen bodies, one training after another, and one table of them."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.cli.unimogen import CACHE, GROUP, SAMPLING, setting_of
from troupe_training.data.bodies_store import Corpus
from troupe_training.evaluate.unimogen.networks import load_network
from troupe_training.evaluate.unimogen.study import about_runs, measure_study, study_table
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.train.study import keep_terms, picked
from troupe_training.train.trainer import Budget
from troupe_training.train.unimogen.stage import Training
from troupe_training.train.unimogen.study import done, planned, train_all

OPTIONS["--alone"] = {"nargs": "*", "default": ["human", "g1", "h1_2"], "help": "bodies to train one network each on"}
OPTIONS["--unseen"] = {"nargs": "*", "default": ["h1_2", "g1"], "help": "bodies to leave out of one training each"}
OPTIONS["--only"] = {"nargs": "+", "help": "these runs of the study alone"}
OPTIONS["--measure-only"] = {"action": "store_true", "help": "train nothing: measure the runs that are done"}


@command(
    *("--cache", "--run", "--unimogen-preset", "--minutes", "--steps", "--rows-per-step", "--rate", "--seeds"),
    *("--alone", "--unseen", "--only", "--measure-only", "--device"),
    *("--parts", "--frames", "--stride", "--max-windows", *SAMPLING, "--packs"),
    group=GROUP,
    cache=CACHE,
    run=Path("runs/unimogen-ablations"),
    rate=8e-4,
    seeds=[1, 2, 3],
    parts=["test"],
    seed=1,
    stride=32,
    max_windows=256,
)
def ablate(args: argparse.Namespace) -> int:
    """Ablations, single and unseen bodies: trains one after another, then measures all. The same command goes on."""
    torch.set_num_threads(args.threads)
    corpus = Corpus(args.cache, "train")
    runs = picked(planned(corpus.names, args.seeds, args.alone, args.unseen), args.only)
    minutes = args.minutes if args.minutes or args.steps else 60.0
    budget = Budget(minutes=minutes, steps=args.steps, learning_rate=args.rate)
    terms: dict[str, Any] = {
        "preset": args.unimogen_preset or "default",
        "rows_per_step": args.rows_per_step,
        "bodies": corpus.names,
        **asdict(budget),
    }
    keep_terms(args.run, terms)
    if args.measure_only:
        runs = [run for run in runs if done(args.run / run.name, budget)]
        if not runs:
            raise SystemExit(f"{args.run}: no run is done")
    else:
        preset = PRESETS[args.unimogen_preset or "default"]
        training = Training(args.cache, args.run, budget, preset, args.rows_per_step, args.seeds[0], args.device)
        if not train_all(args.run, runs, training):
            print("stopped; the same command goes on from the checkpoint")
            return STOPPED
    networks = {run.name: load_network(args.run / run.name, args.threads) for run in runs}
    written: dict[str, Any] = {
        "command": args.command_line,
        "budget": asdict(budget),
        "setting": asdict(setting_of(args)),
    }
    written |= {"runs": about_runs(runs, networks), "figures": {}, "notes": {}}
    text = f"    {args.command_line}\n"
    for part in args.parts:
        tested = Corpus(args.cache, part, words=corpus.words)
        report, notes = measure_study(tested, runs, networks, setting_of(args), args.packs, args.threads)
        written["figures"][part], written["notes"][part] = report, notes
        text += f"\n## {part}\n\n" + study_table(report, notes, {n: one.source["step"] for n, one in networks.items()})
    print(text)
    (args.run / "figures.md").write_text(text)
    (args.run / "figures.json").write_text(json.dumps(written, indent=1) + "\n")
    return 0
