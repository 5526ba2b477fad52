"""Commands and their options: each option is written once, and commands name those that they have."""

import argparse
import os
import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import torch

from troupe_reader.options import FileOptions
from troupe_training.data.conventions import FPS
from troupe_training.data.store import BALANCE
from troupe_training.models.motionbricks.config import PRESETS
from troupe_training.robots.source import RobotSource

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
Run = Callable[[argparse.Namespace], int]
STOPPED = 130  # exit status if training was stopped before its budget was spent


def filled(kind: type[T], args: argparse.Namespace, **more: Any) -> T:
    """An instance of a dataclass: ``more``, and for other fields the options of the same names."""
    names = {field.name for field in fields(kind)} & set(vars(args)) - set(more)
    return kind(**{name: getattr(args, name) for name in names}, **more)


def expression(text: str) -> str:
    """A regular expression, as argparse reads one."""
    try:
        re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no regular expression: {error}") from error
    return text


def unit(text: str) -> float | str:
    """Metres a unit, or the unit's name, which the reader checks."""
    try:
        return float(text)
    except ValueError:
        return text


# Options that go to the reader as they are, with the same names.
READING = (
    "fps",
    "up",
    "unit",
    "root",
    "rest_pose",
    "leading_pose",
    "max_slide",
    "quaternion",
    "degrees",
    "joint_order",
)
READING_FLAGS = tuple(f"--{name.replace('_', '-')}" for name in READING)


def reading(args: argparse.Namespace) -> FileOptions:
    """The options for the reader that were given."""
    given = {name: getattr(args, name) for name in READING}
    return cast(FileOptions, {key: value for key, value in given.items() if value is not None and value is not False})


def robot_of(args: argparse.Namespace) -> RobotSource | None:
    """The reader of the robot's files that ``--urdf`` asks for."""
    if args.urdf is None and (args.end_effector or args.legs):
        raise SystemExit("--end-effector and --legs are for robots: they need --urdf")
    if args.urdf is None:
        return None
    if args.scale is not None:
        raise SystemExit("--scale is for BVH files: a robot's are in metres")
    legs = [name for text in args.legs or () for name in text.split(",")]
    try:
        return RobotSource(args.urdf, args.end_effector, args.contact_joints, args.fps, reading(args), legs)
    except (OSError, ValueError) as error:
        raise SystemExit(str(error)) from error


OPTIONS: dict[str, dict[str, Any]] = {
    # motion
    "source": {"type": Path, "help": "folder of motion of one skeleton, searched recursively"},
    "--contact-joints": {"nargs": "+", "help": "joints that touch the ground; found by name if left out"},
    "--scale": {"type": float, "help": "metres per unit of the files, as --unit; found by the body if left out"},
    "--urdf": {"type": Path, "help": "the robot whose motion the files hold; its maker's URDF or MJCF"},
    "--end-effector": {
        "action": "append",
        "default": [],
        "metavar": "NAME=JOINT:x,y,z",
        "help": "a point fixed to a robot's joint, metres in its URDF frame; adds to or replaces toes and hands",
    },
    "--legs": {
        "nargs": "+",
        "metavar": "LEFT,RIGHT",
        "help": "the last joints of a robot's legs, left before right; found by name if left out",
    },
    # what a file may leave open; the reader's errors name them
    "--up": {"choices": ["x", "y", "z", "-x", "-y", "-z"], "help": "the axis that points up in BVH files: --up=-z"},
    "--unit": {"type": unit, "help": "metres a unit of BVH files, or m, ft, dm, cmu, in, cm, mm"},
    "--root": {"help": "the joint that is the character's root in BVH files"},
    "--rest-pose": {"choices": ["t", "a", "standing", "none"], "help": "rest pose of BVH files"},
    "--leading-pose": {"choices": ["find", "keep", "drop"], "help": "a pose before the motion; left out if found"},
    "--max-slide": {"type": float, "help": "farthest that a joint may move in its parent and be held there, metres"},
    "--quaternion": {"choices": ["xyzw", "wxyz"], "help": "order of the root's quaternion in CSV files"},
    "--degrees": {"action": "store_true", "help": "angles of CSV files are in degrees"},
    "--joint-order": {"help": "order of the hinges in CSV files: tree, isaaclab, or names between commas"},
    "--fps": {"type": float, "help": f"frames a second of the files: CSV does not say it ({FPS:.0f} if left out)"},
    "--include": {"type": expression, "help": "regular expression: only files whose name it finds"},
    "--test-name": {
        "type": expression,
        "help": "regular expression: the test split is the files whose name it finds, not 5 %% by a hash",
    },
    "--split-list": {"type": Path, "help": "also write the names of the test files here, one a line"},
    "--cells": {
        "type": Path,
        "help": "list of cells CONTENT_STYLE to hold out, or to show apart; splits/bandai-namco-cells.txt is one",
    },
    "--mirror": {"action": "store_true", "help": "also train on every clip with left and right swapped"},
    "--retarget": {
        "metavar": "SKELETON",
        "help": "bring clips of other skeletons onto this one: the name of a file in the folder, or a file of motion, a "
        "character, a robot's URDF or MJCF, or a pack.toml",
    },
    "--carried": {
        "type": Path,
        "metavar": "FOLDER",
        "help": "with --retarget: also write the clips that were carried over here, as BVH at 30 frames a second",
    },
    "--force": {"action": "store_true", "help": "take clips whose figures are beyond the bar of --retarget"},
    "--fit-ground": {
        "action": "store_true",
        "help": "with --retarget: put clips of other skeletons on the ground, as far as their feet stand",
    },
    "--workers": {"type": int, "default": os.cpu_count(), "help": "parsing processes"},
    # folders
    "--cache": {"type": Path, "default": Path("runs/cache"), "help": "folder of cached features, `prepare` writes it"},
    "--run": {"type": Path, "default": Path("runs/human"), "help": "folder of checkpoints and curves"},
    "--pack": {"type": Path, "default": Path("models/human"), "help": "pack folder"},
    "--out": {"type": Path, "default": Path("models/human"), "help": "what to write"},
    "--evaluator": {
        "type": Path,
        "help": "evaluator.onnx; the pack's or run's if left out. Without one no FID and MMD",
    },
    # training
    "--preset": {"choices": PRESETS, "default": "default", "help": "network sizes"},
    "--minutes": {"type": float, "help": "time for each stage; the default pack's if neither is given"},
    "--steps": {"type": int, "help": "updates for each stage, instead of minutes"},
    "--frames-per-step": {"type": int, "default": 4096, "help": "frames in one update"},
    "--balance": {
        "type": float,
        "default": BALANCE,
        "help": "kinds of motion are drawn by their length to this power: 1 by length, 0 evenly",
    },
    "--rate": {"type": float, "help": "highest learning rate; the stage's own if left out"},
    "--fresh-schedule": {
        "action": "store_true",
        "help": "train a finished stage further: a new budget and learning-rate schedule from its checkpoint "
        "(leave it out to go on after a stop)",
    },
    "--teacher": {"type": Path, "help": "run of a pack of a larger preset to learn from, for a small one"},
    "--seed": {"type": int, "help": "random seed; the default pack's if left out"},
    "--seeds": {"type": int, "nargs": "+", "default": [1], "help": "of training, or of the answers"},
    "--device": {"default": "cuda" if torch.cuda.is_available() else "cpu", "help": "cpu or cuda"},
    "--threads": {"type": int, "default": os.cpu_count(), "help": "CPU threads"},
    # what a manifest says
    "--name": {"default": "human", "help": "pack name"},
    "--version": {"default": "0.1.0", "help": "pack version"},
    "--licence": {"default": "unknown", "help": "licence of the weights, as the data demands"},
    "--credit": {"action": "append", "default": [], "help": "whom to credit; may be repeated"},
    "--like": {"type": Path, "default": Path("models/human"), "help": "pack whose skeleton to take"},
    # measuring
    "--gap": {"type": int, "default": 30, "help": "frames to fill"},
    "--gaps": {"type": int, "nargs": "+", "default": [15, 30, 45], "help": "frames to fill"},
    "--stride": {"type": int, "default": 20, "help": "frames between windows"},
    "--uncut": {
        "action": "store_true",
        "help": "windows of whole files, as `troupe-eval gaps` has them; without it none that `prepare` has cut in two",
    },
    "--max-windows": {"type": int, "help": "most windows for each gap, spread evenly"},
    "--split": {"choices": ("test", "train", "cell"), "default": "test"},
    "--pinned": {"action": "store_true", "help": "pin answers to their keyframes as the server does"},
    "--delta": {"type": Path, "help": "run folder of a trained deterministic transformer"},
    "--single-head": {"type": Path, "help": "run or pack folder of the single-head tokenizer ablation"},
    "--temperature": {"type": float, "default": 0.0},
    "--pose-steps": {"type": int, "default": 1},
    "--diversity-seeds": {"type": int, "default": 20, "help": "0: no diversity"},
    "--diversity-windows": {"type": int, "default": 100, "help": "windows a gap for diversity"},
    "--json": {"type": Path, "help": "also write the figures here"},
    "--markdown": {"type": Path, "help": "also write tables for a model card here"},
    "--evaluation": {"type": Path, "help": "what `troupe-eval gaps --json FILE` wrote"},
    "--baselines": {
        "type": Path,
        "help": "what `evaluate --json FILE` wrote of the same windows: adds the nearest training window to the card, and "
        "with --by tables of the clips' parts",
    },
    "--before": {
        "type": Path,
        "help": "what `evaluate --json FILE` wrote of another pack, for a column beside it in the tables of the clips' parts",
    },
    "--by": {
        "choices": ("dataset", "content", "style", "cell"),
        "nargs": "+",
        "default": [],
        "help": "also tables of the clips' parts, as their names say: cell is held-out cells against all other clips",
    },
    "--notes": {"type": Path, "help": "Markdown about data and limits, put into the card"},
}
COMMANDS: dict[str, tuple[Run, Callable[[argparse.ArgumentParser], None]]] = {}


def command(
    *names: str | tuple[str, ...], required: tuple[str, ...] = (), group: str | None = None, **defaults: Any
) -> Callable[[Run], Run]:
    """Makes a function a command of its name, or of ``GROUP NAME``; its docstring is the help.

    ``names`` are of `OPTIONS`, those in a tuple exclude each other; ``defaults`` replace theirs.
    """

    def add(parser: Any, name: str) -> None:
        option = OPTIONS[name] | ({"required": True, "default": None} if name in required else {})
        key = name.lstrip("-").replace("-", "_")
        parser.add_argument(name, **option | ({"default": defaults[key]} if key in defaults else {}))

    def add_all(parser: argparse.ArgumentParser) -> None:
        for name in names:
            group = parser.add_mutually_exclusive_group() if isinstance(name, tuple) else parser
            for one in name if isinstance(name, tuple) else (name,):
                add(group, one)

    def register(run: Run) -> Run:
        name = run.__name__.replace("_", "-")
        COMMANDS[f"{group} {name}" if group else name] = run, add_all
        return run

    return register
