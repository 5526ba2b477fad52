"""The command line: prepare, train, export, evaluator, evaluate, analyse, curves, card, random-pack, and `pack`, which does all in one go."""

import argparse
import json
import os
import re
from dataclasses import asdict
from pathlib import Path

import torch

from troupe_training.config import BALANCE, FPS, PRESETS

# Of the stages of a pack; the deterministic baseline has as long as a pack's modules together.
DEFAULT_MINUTES = {"tokenizer": 45.0, "root": 97.0, "pose": 41.0, "refine": 24.0}
BASELINE_MINUTES = {"delta": 120.0}
DEFAULT_SEEDS = {"tokenizer": 10, "root": 11, "pose": 12, "refine": 13, "delta": 14}
DEFAULT_RATES = {"tokenizer": 5e-4, "root": 5e-4, "pose": 5e-4, "refine": 4e-4, "delta": 5e-4}


def _expression(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no regular expression: {error}") from error
    return text


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="troupe-train", description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return commands.add_parser(
            name, help=text, description=text, formatter_class=argparse.ArgumentDefaultsHelpFormatter
        )

    def data_options(command: argparse.ArgumentParser) -> None:
        command.add_argument(
            "--contact-joints",
            nargs="+",
            help="names of the joints that touch the ground; found by name if left out",
        )
        command.add_argument(
            "--scale",
            type=float,
            help="metres per unit of the files; told from the pelvis height if left out",
        )
        command.add_argument(
            "--urdf",
            type=Path,
            help="the robot whose motion the CSV files hold; without it BVH files are read",
        )
        command.add_argument(
            "--end-effector",
            action="append",
            default=[],
            metavar="NAME=JOINT:x,y,z",
            help="a point fixed to a robot's joint, metres in its URDF frame; adds to or replaces toes and hands",
        )
        command.add_argument("--fps", type=float, default=FPS, help="frames a second of the CSV files")
        command.add_argument(
            "--include", type=_expression, help="regular expression: only files whose name it finds"
        )
        command.add_argument(
            "--test-name",
            type=_expression,
            help="regular expression: the test split is the files whose name it finds, not 5 %% by a hash",
        )
        command.add_argument(
            "--split-list", type=Path, help="also write the names of the test files here, one a line"
        )
        command.add_argument(
            "--mirror",
            action="store_true",
            help="also train on every clip as seen in a mirror, left and right swapped",
        )
        command.add_argument("--workers", type=int, default=os.cpu_count(), help="parsing processes")

    def training_options(command: argparse.ArgumentParser) -> None:
        command.add_argument(
            "--run", type=Path, default=Path("runs/human"), help="folder of checkpoints and curves"
        )
        command.add_argument(
            "--cache", type=Path, default=Path("runs/cache"), help="folder that `prepare` wrote"
        )
        command.add_argument("--preset", choices=PRESETS, default="default", help="network sizes")
        command.add_argument(
            "--minutes", type=float, help="time for each stage; the default pack's times if neither is given"
        )
        command.add_argument("--steps", type=int, help="updates for each stage")
        command.add_argument("--frames-per-step", type=int, default=4096, help="frames in one update")
        command.add_argument(
            "--balance",
            type=float,
            default=BALANCE,
            help="kinds of motion are drawn by their length to this power: 1 by length, 0 evenly",
        )
        command.add_argument("--seed", type=int, help="random seed; the default pack's if left out")
        command.add_argument(
            "--device", default="cuda" if torch.cuda.is_available() else "cpu", help="cpu or cuda"
        )
        command.add_argument("--threads", type=int, default=os.cpu_count(), help="CPU threads")

    def export_options(command: argparse.ArgumentParser) -> None:
        command.add_argument("--out", type=Path, default=Path("models/human"), help="pack folder to write")
        command.add_argument("--name", default="human", help="pack name")
        command.add_argument("--version", default="0.1.0", help="pack version")
        command.add_argument(
            "--licence", default="unknown", help="licence of the weights, as the data demands"
        )
        command.add_argument("--credit", action="append", default=[], help="whom to credit; may be repeated")

    prepare = add("prepare", "A folder of BVH files, or of a robot's CSV files -> cached features.")
    prepare.add_argument("source", type=Path, help="folder of BVH or CSV files, searched recursively")
    prepare.add_argument("--cache", type=Path, default=Path("runs/cache"), help="folder to write")
    data_options(prepare)

    train = add("train", "Trains one stage; stops at any moment (ctrl-c) and resumes from its checkpoint.")
    train.add_argument("stage", choices=(*DEFAULT_MINUTES, *BASELINE_MINUTES))
    training_options(train)
    train.add_argument("--rate", type=float, help="highest learning rate; the stage's own if left out")
    train.add_argument(
        "--fresh-schedule",
        action="store_true",
        help="train a finished stage further: a new budget and learning-rate schedule from its checkpoint "
        "(leave it out to go on after a stop)",
    )

    train.add_argument(
        "--teacher", type=Path, help="run of a trained pack of a larger preset to learn from, for a small one"
    )

    adopt = add(
        "adopt",
        "A pack's networks -> checkpoints, to refine it further where its own are gone, or on other motion.",
    )
    adopt.add_argument("--pack", type=Path, required=True, help="pack folder")
    adopt.add_argument("--run", type=Path, required=True, help="folder of checkpoints to write")
    adopt.add_argument("--cache", type=Path, default=Path("runs/cache"))
    adopt.add_argument("--preset", choices=PRESETS, default="small", help="the pack's network sizes")

    export = add("export", "Checkpoints -> a pack of ONNX files, checked against PyTorch.")
    export.add_argument("--run", type=Path, default=Path("runs/human"))
    export.add_argument("--cache", type=Path, default=Path("runs/cache"))
    export_options(export)

    evaluator = add("evaluator", "Trains the motion autoencoder that FID and MMD are measured with.")
    evaluator.add_argument("--cache", type=Path, default=Path("runs/cache"))
    evaluator.add_argument("--out", type=Path, required=True, help="evaluator.onnx to write")
    evaluator.add_argument(
        "--run", type=Path, help="folder of the checkpoint; CACHE-evaluator beside the cache if left out"
    )
    evaluator.add_argument("--minutes", type=float, default=12.0)
    evaluator.add_argument("--steps", type=int, help="updates, instead of minutes")
    evaluator.add_argument("--frames-per-step", type=int, default=2048)
    evaluator.add_argument("--seed", type=int, default=17)
    evaluator.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    evaluator.add_argument("--threads", type=int, default=os.cpu_count())

    evaluate = add(
        "evaluate", "Every measure of a pack or of checkpoints on the test split, without a server."
    )
    which = evaluate.add_mutually_exclusive_group()
    which.add_argument("--pack", type=Path, default=Path("models/human"), help="pack folder")
    which.add_argument("--run", type=Path, help="folder of checkpoints, instead of a pack")
    evaluate.add_argument("--cache", type=Path, default=Path("runs/cache"))
    evaluate.add_argument(
        "--evaluator",
        type=Path,
        help="evaluator.onnx; that of the pack or run if left out, and no FID, MMD and latent diversity without one",
    )
    evaluate.add_argument(
        "--pinned", action="store_true", help="pin answers to their keyframes as the server does"
    )
    evaluate.add_argument("--delta", type=Path, help="run folder of a trained deterministic transformer")
    evaluate.add_argument(
        "--single-head", type=Path, help="run or pack folder of the single-head tokenizer ablation"
    )
    evaluate.add_argument("--gaps", type=int, nargs="+", default=[15, 30, 45])
    evaluate.add_argument("--stride", type=int, default=20, help="frames between evaluation windows")
    evaluate.add_argument("--max-windows", type=int, help="at most so many windows a gap, spread evenly")
    evaluate.add_argument("--split", choices=("test", "train"), default="test")
    evaluate.add_argument("--temperature", type=float, default=0.0)
    evaluate.add_argument("--pose-steps", type=int, default=1)
    evaluate.add_argument("--seed", type=int, default=0)
    evaluate.add_argument("--diversity-seeds", type=int, default=20, help="0: no diversity")
    evaluate.add_argument("--diversity-windows", type=int, default=100, help="windows a gap for diversity")
    evaluate.add_argument("--threads", type=int, default=os.cpu_count())
    evaluate.add_argument("--json", type=Path, help="also write the figures here")
    evaluate.add_argument("--markdown", type=Path, help="also write tables for a model card here")

    analyse = add("analyse", "One of the paper's analyses: figures as JSON, a plot as PNG.")
    analyse.add_argument(
        "name",
        choices=("heads-codes", "fsq-vq", "root-interpolation", "replan", "pose-steps", "captured"),
    )
    source = analyse.add_mutually_exclusive_group()
    source.add_argument("--pack", type=Path, default=Path("models/human"), help="pack to analyse")
    source.add_argument("--run", type=Path, help="checkpoints to analyse instead; fsq-vq takes a root module")
    analyse.add_argument("--cache", type=Path, default=Path("runs/cache"))
    analyse.add_argument("--evaluator", type=Path, help="evaluator.onnx; that of the pack or run if left out")
    analyse.add_argument("--out", type=Path, default=Path("runs/analyses"), help="folder to write")
    analyse.add_argument(
        "--minutes", type=float, default=4.0, help="training of each stage of each variant and seed"
    )
    analyse.add_argument("--steps", type=int, help="updates, instead of minutes")
    analyse.add_argument("--seeds", type=int, nargs="+", default=[1], help="of training, or of the answers")
    analyse.add_argument("--preset", choices=PRESETS, default="default", help="network sizes of variants")
    analyse.add_argument("--frames-per-step", type=int, default=4096)
    analyse.add_argument("--gap", type=int, default=30, help="frames to fill")
    analyse.add_argument("--stride", type=int, default=20, help="frames between windows")
    analyse.add_argument("--max-windows", type=int, default=400, help="at most so many, spread evenly")
    analyse.add_argument("--split", choices=("test", "train"), default="test")
    analyse.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    analyse.add_argument("--threads", type=int, default=os.cpu_count())

    curves = add("curves", "Loss curves as PNG.")
    curves.add_argument("--run", type=Path, default=Path("runs/human"))
    curves.add_argument("--out", type=Path, default=Path("curves.png"))

    card = add("card", "Writes a pack's README from its manifest and the JSON of `troupe eval`.")
    card.add_argument("--pack", type=Path, default=Path("models/human"))
    card.add_argument("--evaluation", type=Path, required=True, help="what `troupe eval --json FILE` wrote")
    card.add_argument("--notes", type=Path, help="Markdown about data and limits, put into the card")

    random = add("random-pack", "A pack with random weights, for timing: its motion means nothing.")
    random.add_argument("--preset", choices=PRESETS, default="paper", help="network sizes")
    random.add_argument(
        "--out", type=Path, required=True, help="pack folder to write; its name is the pack's"
    )
    random.add_argument("--like", type=Path, default=Path("models/human"), help="pack whose skeleton to take")
    random.add_argument("--seed", type=int, default=1, help="random seed")

    pack = add(
        "pack",
        "A folder of BVH files, or of a robot's CSV files and its URDF -> a trained pack: prepare, all stages, export, in "
        "one command.",
    )
    pack.add_argument("source", type=Path, help="folder of BVH or CSV files, searched recursively")
    data_options(pack)
    training_options(pack)
    export_options(pack)
    pack.set_defaults(run=None, cache=None)  # runs/NAME and runs/NAME/cache
    return parser


def _prepare(args: argparse.Namespace) -> None:
    from troupe_training.prepare import prepare

    prepare(args.source, args.cache, _source(args), args.workers, args.split_list, _choice(args))


def _choice(args: argparse.Namespace):
    from troupe_training.prepare import Choice

    return Choice(args.include, args.test_name, args.mirror)


def _source(args: argparse.Namespace):
    """The reader of the data: a robot's CSV files where a URDF is given, else BVH."""
    from troupe_training.bvh_source import BvhSource
    from troupe_training.robot_source import RobotSource

    if args.urdf is None and args.end_effector:
        raise SystemExit("--end-effector is for robots: it needs --urdf")
    if args.urdf is not None and args.scale is not None:
        raise SystemExit("--scale is for BVH files: a robot's are in metres")
    if args.urdf is None:
        return BvhSource(args.contact_joints, args.scale)
    try:
        return RobotSource(args.urdf, args.end_effector, args.contact_joints, args.fps)
    except ValueError as error:
        raise SystemExit(str(error)) from error


def _prepare_once(args: argparse.Namespace) -> None:
    """Prepares, unless the cache is there already; refuses a cache that was made from another folder or otherwise."""
    index = args.cache / "clips.json"
    if not index.exists():
        _prepare(args)
        return
    made = json.loads(index.read_text())
    advice = "choose another --name, or --run and --cache"
    if Path(made["source"]) != args.source.resolve():
        raise SystemExit(f"{args.cache} was made from {made['source']}; {advice}")
    wanted = _source(args).options() | asdict(_choice(args))
    for option, value in made.get("options", wanted).items():
        if value != wanted.get(option):
            raise SystemExit(
                f"{args.cache} was made with {option} = {value}, not {wanted.get(option)}; {advice}"
            )


def _train(args: argparse.Namespace, stage: str) -> bool:
    from troupe_training.stages import train_stage
    from troupe_training.trainer import Budget

    torch.set_num_threads(args.threads)
    default = (DEFAULT_MINUTES | BASELINE_MINUTES)[stage]
    minutes = args.minutes if args.minutes or args.steps else default
    rate = getattr(args, "rate", None) or DEFAULT_RATES[stage]
    budget = Budget(minutes=minutes, steps=args.steps, learning_rate=rate)
    seed = args.seed if args.seed is not None else DEFAULT_SEEDS[stage]
    done = train_stage(
        stage,
        args.cache,
        args.run,
        args.preset,
        budget,
        args.frames_per_step,
        seed,
        args.device,
        balance=args.balance,
        fresh_schedule=getattr(args, "fresh_schedule", False),
        teacher_run=getattr(args, "teacher", None),
    )
    if not done:
        print(f"{stage}: stopped; the same command goes on from the checkpoint")
    return done


def _adopt(args: argparse.Namespace) -> None:
    from troupe_training.adopt import adopt

    for stage, names in adopt(args.pack, args.cache, args.run, args.preset).items():
        anew = f", anew: {', '.join(names)}" if names else ""
        print(f"{args.run / stage}.pt from {args.pack}{anew}")
    print(f"next: troupe-train train refine --run {args.run} --preset {args.preset}")


def _export(args: argparse.Namespace) -> None:
    from troupe_training.config import ModelConfig
    from troupe_training.export import export_pack
    from troupe_training.features import ClipStore
    from troupe_training.plots import histories_of, plot_curves
    from troupe_training.stages import STAGES, load

    store = ClipStore(args.cache, "train")
    decoder_stage = "refine" if (args.run / "refine.pt").exists() else "tokenizer"
    tokenizer, root, pose = (load(args.run, s, store) for s in (decoder_stage, "root", "pose"))
    seen = [c for c in store.clips if not c.get("mirrored")]
    training = {"clips": len(seen), "frames": sum(c["frames"] for c in seen)}
    if len(seen) < len(store.clips):
        training["mirrored"] = True
    config = None
    for stage in STAGES:
        path = args.run / f"{stage}.pt"
        if path.exists():
            state = torch.load(path, map_location="cpu", weights_only=False)
            config = config or ModelConfig(**state["meta"]["model"])
            training[f"{stage}_steps"] = state["step"]
            training[f"{stage}_minutes"] = round(state["seconds"] / 60, 1)
            training[f"{stage}_final_loss"] = state["history"][-1]["total"] if state["history"] else None
    training = {k: v for k, v in training.items() if v is not None}
    about = {"licence": args.licence, "credits": args.credit, "training": training}
    export_pack(args.out, args.name, args.version, config, store, tokenizer, root, pose, about)
    if histories_of(args.run):  # none after a handful of updates, or where all stages are adopted
        plot_curves(args.run, args.out / "curves.png")


def _evaluator(args: argparse.Namespace) -> bool:
    from troupe_training.evaluator import LEARNING_RATE, train_evaluator
    from troupe_training.trainer import Budget

    torch.set_num_threads(args.threads)
    run = args.run or args.cache.resolve().with_name(args.cache.resolve().name + "-evaluator")
    budget = Budget(
        minutes=None if args.steps else args.minutes, steps=args.steps, learning_rate=LEARNING_RATE
    )
    about = train_evaluator(args.cache, run, args.out, budget, args.frames_per_step, args.seed, args.device)
    if about is None:
        print("evaluator: stopped; the same command goes on from the checkpoint")
        return False
    size = args.out.stat().st_size / 1e6
    print(
        f"{args.out}: {size:.1f} MB, {about['steps']} updates, differs from PyTorch by {about['difference']:.1e}"
    )
    for split, errors in about["errors"].items():
        for frames, error in errors.items():
            print(
                f"{split}, {frames} frames: joints off by {1e3 * error['joint_m']:.1f} mm, root by "
                f"{1e3 * error['root_m']:.1f} mm, joint velocities by {error['velocity_mps']:.3f} m/s"
            )
    return True


def _evaluator_of(args: argparse.Namespace, folder: Path) -> Path | None:
    """The evaluator that was asked for, or the folder's, or none."""
    path = args.evaluator or folder / "evaluator.onnx"
    if path.exists():
        return path
    if args.evaluator:
        raise SystemExit(f"{path} is missing: `troupe-train evaluator` makes it")
    print(f"{path} is missing: no FID, MMD and latent diversity")
    return None


def _evaluate(args: argparse.Namespace) -> None:
    from troupe_training.delta import DeltaMethod
    from troupe_training.evaluate import Bench, Options, evaluate, of_networks
    from troupe_training.evaluation_tables import markdown, print_report
    from troupe_training.inbetween import Sampling, open_networks
    from troupe_training.stages import load

    torch.set_num_threads(args.threads)
    folder = args.run or args.pack
    options = Options(
        gaps=args.gaps,
        stride=args.stride,
        split=args.split,
        pinned=args.pinned,
        sampling=Sampling(args.pose_steps, args.temperature, args.seed),
        diversity_seeds=args.diversity_seeds,
        diversity_windows=args.diversity_windows,
        max_windows=args.max_windows,
    )
    bench = Bench(args.cache, options, _evaluator_of(args, folder), args.threads)
    methods = {"pack": of_networks(open_networks(folder, bench.store, args.threads))}
    sampled = {"pack"}
    if args.single_head:
        methods["single head"] = of_networks(open_networks(args.single_head, bench.store, args.threads))
        sampled.add("single head")
    if args.delta:
        methods["transformer"] = DeltaMethod(load(args.delta, "delta", bench.store), bench.skeleton)
    report = {"source": folder.name} | evaluate(bench, methods, sampled)
    print_report(report)
    if args.json:
        args.json.write_text(json.dumps(report, indent=1) + "\n")
    if args.markdown:
        args.markdown.write_text(markdown(report))


def _analyse(args: argparse.Namespace) -> bool:
    from troupe_training.analyses import ANALYSES
    from troupe_training.analyses.common import Setting

    torch.set_num_threads(args.threads)
    folder = args.run or args.pack
    setting = Setting(
        cache=args.cache,
        out=args.out,
        source=folder,
        evaluator=_evaluator_of(args, folder),
        minutes=args.minutes,
        steps=args.steps,
        seeds=args.seeds,
        preset=PRESETS[args.preset],
        frames_per_step=args.frames_per_step,
        gap=args.gap,
        stride=args.stride,
        max_windows=args.max_windows,
        split=args.split,
        threads=args.threads,
        device=args.device,
    )
    done = ANALYSES[args.name](setting)
    if not done:
        print(f"{args.name}: stopped; the same command goes on from its checkpoints")
    return done


def _random_pack(args: argparse.Namespace) -> None:
    from troupe_training.random_pack import random_pack

    counts = random_pack(args.out, args.like, PRESETS[args.preset], args.preset, args.seed)
    for network, parameters in counts.items():
        print(f"{network:>8} {parameters / 1e6:8.1f} M parameters")
    print(f"{args.out}: random weights of preset {args.preset}")


def main(argv: list[str] | None = None) -> int:
    """Runs one command; 0 on success, 130 where training was stopped before its budget was spent."""
    args = _parser().parse_args(argv)
    if args.command == "prepare":
        _prepare(args)
    elif args.command == "train":
        return 0 if _train(args, args.stage) else 130
    elif args.command == "adopt":
        _adopt(args)
    elif args.command == "export":
        _export(args)
    elif args.command == "evaluator":
        return 0 if _evaluator(args) else 130
    elif args.command == "evaluate":
        _evaluate(args)
    elif args.command == "analyse":
        return 0 if _analyse(args) else 130
    elif args.command == "curves":
        from troupe_training.plots import plot_curves

        plot_curves(args.run, args.out)
    elif args.command == "card":
        from troupe_training.card import write_card

        write_card(args.pack, args.evaluation, args.notes)
    elif args.command == "random-pack":
        _random_pack(args)
    elif args.command == "pack":
        args.run = args.run or Path("runs") / args.name
        args.cache = args.cache or args.run / "cache"
        _prepare_once(args)
        for stage in DEFAULT_MINUTES:
            if not _train(args, stage):
                return 130
        _export(args)
    return 0
