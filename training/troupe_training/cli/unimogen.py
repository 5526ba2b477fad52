"""Commands of the family UniMoGen: one diffusion model for many bodies."""

import argparse
import tomllib
from pathlib import Path
from typing import Any

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.data.bodies_store import BALANCE
from troupe_training.data.bvh_source import BvhSource
from troupe_training.data.cells import read_cells
from troupe_training.data.clips import MotionSource
from troupe_training.data.corpus import Wanted, make_corpus
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.robots.source import RobotSource
from troupe_training.train.trainer import Budget
from troupe_training.train.unimogen.stage import STAGE, Training
from troupe_training.train.unimogen.stage import train as train_network

GROUP = "unimogen"
CACHE, RUN = Path("runs/unimogen-cache"), Path("runs/unimogen")
MINUTES = 480.0  # of training, where neither minutes nor steps are given
OPTIONS["--bodies"] = {"type": Path, "help": "TOML list of bodies and their motion, as training/bodies.toml is one"}
OPTIONS["--data"] = {"type": Path, "default": Path(), "help": "folder that the list's paths of motion are relative to"}
OPTIONS["--source"] = {"type": Path, "help": "one folder of BVH, CSV (with --urdf) or glb files instead of a list"}
OPTIONS["--trained-bodies"] = {"nargs": "+", "help": "train on these bodies of the cache alone"}
OPTIONS["--unimogen-preset"] = {"choices": PRESETS, "default": "default", "help": "network sizes"}
OPTIONS["--rows-per-step"] = {"type": int, "default": 13000, "help": "rows times frames in one update"}
OPTIONS["--cells"] = {"type": Path, "help": "list of cells CONTENT_STYLE that are held out"}


@command(
    ("--bodies", "--source"),
    *("--data", "--name", "--urdf", "--end-effector", "--contact-joints", "--scale", "--fps", "--test-name", "--cells"),
    *("--licence", "--credit", "--workers", "--cache"),
    group=GROUP,
    cache=CACHE,
    name="mine",
)
def prepare(args: argparse.Namespace) -> int:
    """Motion of any number of bodies -> a cache in terms that mean the same on each. What is cached already is kept."""
    if args.bodies is None and args.source is None:
        raise SystemExit("give --bodies LIST, or --source FOLDER")
    try:
        wanted = _listed(args.bodies, args.data) if args.bodies else [_own(args)]
    except (OSError, ValueError, KeyError) as error:
        raise SystemExit(f"{args.bodies or args.source}: {error}") from error
    make_corpus(wanted, args.cache, args.workers)
    return 0


def _listed(path: Path, data: Path) -> list[Wanted]:
    """The bodies of a list."""
    bodies: list[dict[str, Any]] = tomllib.loads(path.read_text(encoding="utf-8"))["bodies"]
    return [_wanted(told, data, path.parent) for told in bodies]


def _wanted(told: dict[str, Any], data: Path, beside: Path) -> Wanted:
    reader: MotionSource | None
    if told.get("glb"):
        reader = None
    elif "urdf" in told:
        reader = RobotSource(data / told["urdf"])
    else:
        reader = BvhSource(told.get("contact_joints"), told.get("scale"))
    return Wanted(
        told["name"],
        data / told["source"],
        reader,
        told.get("test_name"),
        told.get("tested", True),
        read_cells(beside / told["cells"]) if "cells" in told else frozenset(),
        told.get("licence", "unknown"),
        told.get("credits", []),
    )


def _own(args: argparse.Namespace) -> Wanted:
    """A folder of the user's own motion, by what files it holds."""
    suffixes = {p.suffix.lower() for p in args.source.rglob("*")}
    reader: MotionSource | None = None
    if args.urdf is not None:
        reader = RobotSource(args.urdf, args.end_effector, args.contact_joints, args.fps)
    elif ".bvh" in suffixes:
        reader = BvhSource(args.contact_joints, args.scale)
    elif ".glb" not in suffixes:
        hint = "; CSV files need their robot's --urdf" if ".csv" in suffixes else ""
        raise SystemExit(f"no .bvh or .glb file under {args.source}{hint}")
    cells = read_cells(args.cells) if args.cells else frozenset()
    return Wanted(args.name, args.source, reader, args.test_name, True, cells, args.licence, args.credit)


@command(
    *(
        "--cache",
        "--run",
        "--unimogen-preset",
        "--trained-bodies",
        "--balance",
        "--minutes",
        "--steps",
        "--rows-per-step",
    ),
    *("--rate", "--fresh-schedule", "--seed", "--device", "--threads"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    balance=BALANCE,
    seed=29,
    rate=8e-4,
)
def train(args: argparse.Namespace) -> int:
    """Trains the network on all bodies of a cache; stops at any moment (ctrl-c) and resumes from its checkpoint."""
    torch.set_num_threads(args.threads)
    minutes = args.minutes if args.minutes or args.steps else MINUTES
    training = Training(
        args.cache,
        args.run,
        Budget(minutes=minutes, steps=args.steps, learning_rate=args.rate),
        PRESETS[args.unimogen_preset],
        args.rows_per_step,
        args.seed,
        args.device,
        args.trained_bodies,
        args.balance,
        fresh_schedule=args.fresh_schedule,
    )
    if train_network(training):
        return 0
    print(f"{STAGE}: stopped; the same command goes on from the checkpoint")
    return STOPPED
