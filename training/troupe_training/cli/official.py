"""Commands for NVIDIA's public MotionBricks release."""

import argparse
import tempfile
from pathlib import Path

from troupe_training.cli.options import OPTIONS, command
from troupe_training.export.motionbricks.official.check import TOLERANCE, check_release, environment
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError
from troupe_training.export.motionbricks.official.pack import import_release
from troupe_training.export.motionbricks.official.planner import import_planner
from troupe_training.models.motionbricks.official.weights import WeightsError

G1 = Path("models/g1")

OPTIONS["folder"] = {"type": Path, "help": "checkout of the release with its checkpoints, or its folder out"}
OPTIONS["checkout"] = {"type": Path, "help": "checkout of the release; weights are drawn if it has none"}
OPTIONS["file"] = {"type": Path, "help": "the planner's ONNX file of the release, planner_sonic.onnx"}
OPTIONS["--env"] = {
    "type": Path,
    "default": Path("runs/motionbricks-env"),
    "help": "environment for the public code, made if it is not there",
}
OPTIONS["--keep"] = {"type": Path, "help": "folder for the release that was compared, and for its pack"}


@command("folder", "--out", "--like", "--version", out=Path("models/g1-official"), like=G1)
def import_motionbricks(args: argparse.Namespace) -> int:
    """NVIDIA's public MotionBricks release -> a pack, with the styles of its clips."""
    try:
        counts = import_release(args.folder, args.out, args.like, args.version)
    except (ReleaseError, WeightsError) as error:
        raise SystemExit(str(error)) from error
    for network, parameters in counts.items():
        print(f"{network:>8} {parameters / 1e6:8.1f} M parameters")
    return 0


@command("file", "--out", "--like", "--version", out=Path("models/g1-planner"), like=G1)
def import_motionbricks_planner(args: argparse.Namespace) -> int:
    """The planner's ONNX file of NVIDIA's release -> a pack for live characters."""
    try:
        parameters = import_planner(args.file, args.out, args.like, args.version)
    except ReleaseError as error:
        raise SystemExit(str(error)) from error
    print(f"{parameters / 1e6:.1f} M weights")
    return 0


@command("checkout", "--env", "--like", "--keep", like=G1)
def check_motionbricks(args: argparse.Namespace) -> int:
    """The public MotionBricks code and a pack of the same weights, stage by stage, on the same requests."""
    try:
        with tempfile.TemporaryDirectory() as temporary:
            work = args.keep or Path(temporary)
            work.mkdir(parents=True, exist_ok=True)
            worst = check_release(args.checkout.resolve(), work.resolve(), environment(args.env.resolve()), args.like)
    except (ReleaseError, WeightsError) as error:
        raise SystemExit(str(error)) from error
    for name, difference in worst.items():
        print(f"{name:32} {difference:.1e}")
    passed = max(worst.values()) <= TOLERANCE
    print(f"largest differences; at most {TOLERANCE} is allowed: {'passed' if passed else 'failed'}")
    return 0 if passed else 1
