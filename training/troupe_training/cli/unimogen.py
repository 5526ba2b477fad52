"""Commands of the family UniMoGen: one diffusion model for many bodies."""

import argparse
import tomllib
from pathlib import Path
from typing import Any

from troupe_training.cli.options import OPTIONS, command
from troupe_training.data.bvh_source import BvhSource
from troupe_training.data.cells import read_cells
from troupe_training.data.clips import MotionSource
from troupe_training.data.corpus import Wanted, make_corpus
from troupe_training.robots.source import RobotSource

GROUP = "unimogen"
CACHE = Path("runs/unimogen-cache")
OPTIONS["--bodies"] = {"type": Path, "help": "TOML list of bodies and their motion, as training/bodies.toml is one"}
OPTIONS["--data"] = {"type": Path, "default": Path(), "help": "folder that the list's paths of motion are relative to"}
OPTIONS["--source"] = {"type": Path, "help": "one folder of BVH, CSV (with --urdf) or glb files instead of a list"}
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
