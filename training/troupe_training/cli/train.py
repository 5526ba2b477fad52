"""Commands that read motion and write checkpoints and packs."""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

import torch

from troupe_training.cli.options import OPTIONS, READING, READING_FLAGS, STOPPED, command, reading, robot_of
from troupe_training.data.cells import read_cells
from troupe_training.data.clips import MotionSource
from troupe_training.data.joint_source import JointSource
from troupe_training.data.limits import measure as measure_limits
from troupe_training.data.prepare import Choice
from troupe_training.data.prepare import prepare as prepare_cache
from troupe_training.data.retarget import RetargetSource
from troupe_training.data.store import ClipStore
from troupe_training.export.evaluator import export_evaluator
from troupe_training.export.manifest import About, write_limits
from troupe_training.export.motionbricks.adopt import adopt as adopt_pack
from troupe_training.export.motionbricks.pack import export_run
from troupe_training.export.motionbricks.random_pack import random_pack as export_random
from troupe_training.models.motionbricks.config import PRESETS, ModelConfig
from troupe_training.train.delta import DELTA, train_delta
from troupe_training.train.evaluator import LEARNING_RATE, train_evaluator
from troupe_training.train.motionbricks.refine import DRAWS
from troupe_training.train.motionbricks.stages import PACK_STAGES, train_stage
from troupe_training.train.trainer import Budget, Job

ROBOT_READING = ("fps", "quaternion", "degrees", "joint_order")  # options of reading that are for robots' files
DESCRIPTIONS = (".urdf", ".xml")  # endings of robots' descriptions
CURVE_FRAMES = ModelConfig.root_curve_frames
# Minutes, seed and learning rate of a stage if the command line does not say them.
DEFAULTS = {
    "tokenizer": (45.0, 10, 5e-4),
    "encoder": (25.0, 21, 5e-4),
    "root": (97.0, 11, 5e-4),
    "pose": (41.0, 12, 5e-4),
    "choice": (12.0, 15, 1e-3),
    "refine": (24.0, 13, 4e-4),
    DELTA.name: (120.0, 14, 5e-4),  # as long as a pack's modules together
}
OPTIONS["--draws"] = {
    "type": int,
    "default": DRAWS,
    "help": "refine: of so many draws of tokens the decoder learns from the nearest; 0: from the likeliest tokens alone",
}
OPTIONS["--curve-frames"] = {
    "type": int,
    "default": CURVE_FRAMES,
    "help": "choice: frames of a piece of the curves that move roots; longer ones are smoother",
}
OPTIONS["stage"] = {"choices": DEFAULTS}
OPTIONS["--into-body"] = {
    "metavar": "NAME",
    "help": "write into the file of this body of the pack, not into its manifest",
}
FILES = (
    "source",
    "--contact-joints",
    "--scale",
    "--urdf",
    "--end-effector",
    "--legs",
    *READING_FLAGS,
    "--include",
    "--test-name",
)
DATA = (
    *FILES,
    "--retarget",
    "--force",
    "--fit-ground",
    "--carried",
    "--split-list",
    "--cells",
    "--mirror",
    "--workers",
    "--cache",
)
COMPUTING = ("--minutes", "--steps", "--frames-per-step", "--seed", "--device", "--threads")
TRAINING = ("--run", "--preset", "--balance", *COMPUTING)
ABOUT = ("--out", "--name", "--version", "--licence", "--credit")


@command(*DATA)
def prepare(args: argparse.Namespace) -> int:
    """A folder of motion, of a character or with --urdf of a robot -> cached features."""
    prepare_cache(args.source, args.cache, _source(args), args.workers, args.split_list, _choice(args))
    return 0


def _choice(args: argparse.Namespace) -> Choice:
    try:
        cells = sorted(read_cells(args.cells)) if args.cells else []
    except (OSError, ValueError) as error:
        raise SystemExit(f"--cells {args.cells}: {error}") from error
    return Choice(args.include, args.test_name, args.mirror, cells)


def _source(args: argparse.Namespace) -> MotionSource:
    """The reader of the data: of a robot's files if a URDF is given, else of files of joints, onto one skeleton if wanted."""
    if args.retarget is None:
        if args.force or args.fit_ground or args.carried:
            raise SystemExit(
                "--force, --fit-ground and --carried are for clips of other skeletons: they need --retarget"
            )
        return robot_of(args) or JointSource(args.contact_joints, args.scale, reading(args))
    if args.urdf is not None:
        raise SystemExit(
            "--retarget takes the place of --urdf: give it the URDF of the robot that clips are brought onto"
        )
    joints, robots = args, None
    if Path(args.retarget).suffix.lower() in DESCRIPTIONS:
        joints, own = _apart(args)
        robots = robot_of(own)
    inner = JointSource(joints.contact_joints, joints.scale, reading(joints))
    return RetargetSource(inner, args.retarget, args.force, args.fit_ground, robots, args.carried)


def _apart(args: argparse.Namespace) -> tuple[argparse.Namespace, argparse.Namespace]:
    """Options for the files of joints that are brought onto a robot, and those for the robot's own files."""
    given = vars(args)
    for_robots = dict.fromkeys(ROBOT_READING)
    for_joints = dict.fromkeys(name for name in READING if name not in ROBOT_READING)
    joints = argparse.Namespace(**given | for_robots | {"contact_joints": None})
    robots = argparse.Namespace(**given | for_joints | {"scale": None, "urdf": Path(args.retarget)})
    return joints, robots


def _prepare_once(args: argparse.Namespace) -> None:
    """Prepares, unless the cache is there already; refuses a cache that was made from another folder or otherwise."""
    index = args.cache / "clips.json"
    if not index.exists():
        prepare(args)
        return
    made = json.loads(index.read_text())
    advice = "choose another --name, or --run and --cache"
    if Path(made["source"]) != args.source.resolve():
        raise SystemExit(f"{args.cache} was made from {made['source']}; {advice}")
    wanted = _source(args).options() | asdict(_choice(args))
    options = made.get("options", wanted)
    # Options of the reader and of other skeletons are there only if they were given.
    optional = [*READING, "legs", "retarget", "force", "fit_ground"]
    for option in [*options, *(key for key in optional if key in wanted and key not in options)]:
        value = options.get(option)
        if value != wanted.get(option):
            raise SystemExit(f"{args.cache} was made with {option} = {value}, not {wanted.get(option)}; {advice}")


@command("stage", "--cache", *TRAINING, "--rate", "--fresh-schedule", "--teacher", "--draws", "--curve-frames")
def train(args: argparse.Namespace) -> int:
    """Trains one stage; stops at any moment (ctrl-c) and resumes from its checkpoint."""
    torch.set_num_threads(args.threads)
    stage: str = args.stage
    minutes, seed, rate = DEFAULTS[stage]
    minutes = args.minutes if args.minutes or args.steps else minutes
    budget = Budget(minutes=minutes, steps=args.steps, learning_rate=args.rate or rate)
    seed = seed if args.seed is None else args.seed
    job = Job(args.cache, args.run, budget, args.frames_per_step, seed, args.device, args.balance, args.fresh_schedule)
    if stage == DELTA.name:
        done = train_delta(job, args.preset)
    else:
        done = train_stage(stage, job, args.preset, args.teacher, args.draws, args.curve_frames)
    if not done:
        print(f"{stage}: stopped; the same command goes on from the checkpoint")
    return 0 if done else STOPPED


@command("--pack", "--run", "--cache", "--preset", required=("--pack", "--run"), preset="small")
def adopt(args: argparse.Namespace) -> int:
    """A pack's networks -> checkpoints, to refine it further where its own are gone, or on other motion."""
    for stage, names in adopt_pack(args.pack, args.cache, args.run, args.preset).items():
        new = f", new: {', '.join(names)}" if names else ""
        print(f"{args.run / stage}.pt from {args.pack}{new}")
    print(f"next: troupe-train train refine --run {args.run} --preset {args.preset}")
    return 0


@command(
    "--cache", "--out", "--run", *COMPUTING, required=("--out",), run=None, minutes=12, frames_per_step=2048, seed=17
)
def evaluator(args: argparse.Namespace) -> int:
    """Trains the motion autoencoder that FID and MMD are measured with; its checkpoint lies beside the cache."""
    torch.set_num_threads(args.threads)
    cache = args.cache.resolve()
    run = args.run or cache.with_name(cache.name + "-evaluator")
    budget = Budget(minutes=None if args.steps else args.minutes, steps=args.steps, learning_rate=LEARNING_RATE)
    trained = train_evaluator(args.cache, run, budget, args.frames_per_step, args.seed, args.device)
    if trained is None:
        print("evaluator: stopped; the same command goes on from the checkpoint")
        return STOPPED
    model, steps, measured = trained
    difference = export_evaluator(model, ClipStore(args.cache, "train"), args.out)
    size = args.out.stat().st_size / 1e6
    print(f"{args.out}: {size:.1f} MB, {steps} updates, differs from PyTorch by {difference:.1e}")
    for split, errors in measured.items():
        for frames, error in errors.items():
            print(
                f"{split}, {frames} frames: joints off by {1e3 * error['joint_m']:.1f} mm, root by "
                f"{1e3 * error['root_m']:.1f} mm, joint velocities by {error['velocity_mps']:.3f} m/s"
            )
    return 0


@command("--run", "--cache", *ABOUT)
def export(args: argparse.Namespace) -> int:
    """Checkpoints -> a pack of ONNX files, checked against PyTorch."""
    export_run(args.run, args.cache, args.out, About(args.name, args.version, args.licence, args.credit))
    return 0


@command("--pack", "--into-body", "--cache")
def limits(args: argparse.Namespace) -> int:
    """A cache -> the limits in a pack's manifest, or in the file of one of its bodies: what its training clips do at most."""
    manifest = args.pack / "bodies" / f"{args.into_body}.toml" if args.into_body else args.pack / "pack.toml"
    measured = measure_limits(args.cache)
    try:
        write_limits(manifest, measured)
    except (OSError, KeyError, ValueError) as error:
        raise SystemExit(f"{manifest}: {error}") from error
    print(f"{manifest}: limits of {measured.windows} windows")
    return 0


@command("--preset", "--out", "--like", "--seed", required=("--out",), preset="paper", seed=1)
def random_pack(args: argparse.Namespace) -> int:
    """A pack with random weights, for timing: its motion means nothing."""
    counts = export_random(args.out, args.like, PRESETS[args.preset], args.preset, args.seed)
    for network, parameters in counts.items():
        print(f"{network:>8} {parameters / 1e6:8.1f} M parameters")
    print(f"{args.out}: random weights of preset {args.preset}")
    return 0


@command(*DATA, *TRAINING, *ABOUT, run=None, cache=None)
def pack(args: argparse.Namespace) -> int:
    """A folder of motion -> a trained pack in runs/NAME: prepare, all stages, export, in one command."""
    args.run = args.run or Path("runs") / args.name
    args.cache = args.cache or args.run / "cache"
    args.rate, args.fresh_schedule, args.teacher = None, False, None
    args.draws, args.curve_frames = DRAWS, CURVE_FRAMES
    _prepare_once(args)
    for stage in PACK_STAGES:
        args.stage = stage
        if train(args) == STOPPED:
            return STOPPED
    return export(args)
