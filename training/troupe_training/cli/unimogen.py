"""Commands of the family UniMoGen: one diffusion model for many bodies."""

import argparse
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BALANCE, Corpus
from troupe_training.data.bvh_source import BvhSource
from troupe_training.data.cells import read_cells
from troupe_training.data.clips import MotionSource
from troupe_training.data.conventions import FPS
from troupe_training.data.corpus import Wanted, make_corpus
from troupe_training.evaluate.unimogen import Setting, captured, frozen, measure, of_network, table
from troupe_training.export.manifest import About
from troupe_training.export.unimogen.pack import export_run, network_of
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.models.unimogen.sampler import Character
from troupe_training.models.unimogen.sampler import sample as sample_rows
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, decode
from troupe_training.robots.source import RobotSource
from troupe_training.train.trainer import Budget
from troupe_training.train.unimogen.ablations import ABLATIONS
from troupe_training.train.unimogen.stage import STAGE, Training, load
from troupe_training.train.unimogen.stage import train as train_network

GROUP = "unimogen"
ABOUT = ("--out", "--name", "--version", "--licence", "--credit")
CACHE, RUN = Path("runs/unimogen-cache"), Path("runs/unimogen")
MINUTES = 480.0  # of training, where neither minutes nor steps are given
OPTIONS["--bodies"] = {"type": Path, "help": "TOML list of bodies and their motion, as training/bodies.toml is one"}
OPTIONS["--data"] = {"type": Path, "default": Path(), "help": "folder that the list's paths of motion are relative to"}
OPTIONS["--source"] = {"type": Path, "help": "one folder of BVH, CSV (with --urdf) or glb files instead of a list"}
OPTIONS["--trained-bodies"] = {"nargs": "+", "help": "train on these bodies of the cache alone"}
OPTIONS["--unimogen-preset"] = {"choices": PRESETS, "default": "default", "help": "network sizes"}
OPTIONS["--without"] = {
    "nargs": "+",
    "choices": ABLATIONS,
    "default": [],
    "help": "parts of the method to leave out: " + "; ".join(f"{name}: {what}" for name, what in ABLATIONS.items()),
}
OPTIONS["--rows-per-step"] = {"type": int, "default": 13000, "help": "rows times frames in one update"}
OPTIONS["--body"] = {"default": "human", "help": "body of the cache"}
OPTIONS["--words"] = {
    "nargs": "*",
    "default": [],
    "metavar": "WORD[=WEIGHT]",
    "help": "style: words with weights, e.g. walk old=0.5",
}
OPTIONS["--speed"] = {"type": float, "default": 1.2, "help": "metres a second ahead"}
OPTIONS["--turn"] = {"type": float, "default": 0.0, "help": "degrees a second to the left"}
OPTIONS["--frames"] = {"type": int, "default": 68, "help": "frames of a window, a multiple of 4"}
OPTIONS["--sampler-steps"] = {"type": int, "default": 4, "help": "calls of the network for a motion, 1 to 50"}
OPTIONS["--guidance"] = {"type": float, "default": 1.0, "help": "weight of the style: 1 as trained, more exaggerates"}
OPTIONS["--parts"] = {"nargs": "+", "default": ["test", "cell"], "help": "splits of the cache to measure"}
OPTIONS["--packs"] = {"type": Path, "help": "folder of packs whose evaluator.onnx measures FID, by the body's name"}


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
        "--without",
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
        without=args.without,
        fresh_schedule=args.fresh_schedule,
    )
    if train_network(training):
        return 0
    print(f"{STAGE}: stopped; the same command goes on from the checkpoint")
    return STOPPED


@command("--run", "--cache", *ABOUT, group=GROUP, cache=CACHE, run=RUN, out=Path("models/unimogen"), name="unimogen")
def export(args: argparse.Namespace) -> int:
    """A checkpoint -> a pack: one ONNX file with ragged rows, checked against PyTorch, and a file a body."""
    export_run(args.run, args.cache, args.out, About(args.name, args.version, args.licence, args.credit))
    return 0


SAMPLING = ("--sampler-steps", "--guidance", "--seed", "--threads")


@command(
    *("--run", "--cache", "--body", "--words", "--speed", "--turn", "--frames", *SAMPLING, "--out"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    out=Path("motion.npz"),
    seed=1,
)
def sample(args: argparse.Namespace) -> int:
    """One motion from nothing along a straight path or an arc, as NumPy arrays: joint positions, rotations, the path."""
    torch.set_num_threads(args.threads)
    trained, body = load(args.run), Body.load(args.cache / args.body / "body.json")
    style = style_vector(args.words, trained.words)
    time = torch.arange(args.frames) / FPS
    heading = torch.deg2rad(torch.tensor(args.turn)) * time
    step = args.speed / FPS * torch.stack([torch.sin(heading), torch.cos(heading)], -1)
    path = Path2D(step.cumsum(0)[None], heading[None])
    character = Character(body, path.features(body.size_m)[0].numpy(), style, args.seed, guidance=args.guidance)
    rows = torch.from_numpy(sample_rows(network_of(trained.model), [character], args.sampler_steps)[0])
    root, bends = decode(body, rows[None], path, trained.limits)
    kinematics = BodyKinematics(body)
    turned = kinematics.turned(bends)
    positions = kinematics.positions(root, turned)[0].numpy()
    np.savez(
        args.out, positions=positions, rotations=kinematics.rotations(turned)[0].numpy(), path=path.points[0].numpy()
    )
    off = np.linalg.norm(positions[:, 0, [0, 2]] - path.points[0].numpy(), axis=-1)
    print(f"{args.out}: {args.frames} frames of {body.name}, root {off.mean():.3f} m off the path in the mean")
    return 0


def style_vector(words: list[str], known: list[str]) -> np.ndarray:
    """``walk old=0.5`` as weights ``[K]``; ends the command at a word that the network does not know."""
    style = np.zeros(len(known), np.float32)
    for text in words:
        word, _, weight = text.partition("=")
        if word not in known:
            raise SystemExit(f"no motion shows {word!r}; known: {', '.join(known)}")
        style[known.index(word)] = float(weight or 1.0)
    return style


@command(
    *("--run", "--cache", "--trained-bodies", "--parts", "--frames", "--stride", "--max-windows", *SAMPLING),
    *("--packs", "--json", "--markdown"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    seed=1,
    stride=32,
    max_windows=128,
)
def evaluate(args: argparse.Namespace) -> int:
    """Path, feet and distance to captures of a network on test clips and held-out cells, beside captures and a frozen pose."""
    torch.set_num_threads(args.threads)
    trained = load(args.run)
    setting = Setting(args.frames, args.stride, args.max_windows, args.sampler_steps, args.guidance, args.seed)
    report: dict[str, dict[str, dict[str, float]]] = {}
    for part in args.parts:
        corpus = Corpus(args.cache, part, args.trained_bodies, trained.words)
        for name, store in corpus.stores.items():
            methods = {
                "captured": captured(store.body),
                "frozen pose": frozen(store.body, trained.limits),
                "unimogen": of_network(store.body, network_of(trained.model), trained.limits, setting),
            }
            report[f"{name}, {part}"] = measure(store, methods, setting, _evaluator_of(args.packs, name))
    text = table(report)
    print(text)
    if args.markdown:
        args.markdown.write_text(text)
    if args.json:
        args.json.write_text(json.dumps({"step": trained.state["step"], "figures": report}, indent=1) + "\n")
    return 0


def _evaluator_of(packs: Path | None, body: str) -> Path | None:
    path = packs / body / "evaluator.onnx" if packs else None
    return path if path and path.exists() else None
