"""Commands of the family UniMoGen: one diffusion model for many bodies."""

import argparse
import json
import tomllib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from troupe_reader import ENDINGS
from troupe_reader.options import FileOptions
from troupe_training.cli.options import OPTIONS, READING_FLAGS, STOPPED, command, reading, robot_of
from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BALANCE, BodyStore, Corpus
from troupe_training.data.cells import read_cells
from troupe_training.data.clips import MotionSource
from troupe_training.data.conventions import FPS
from troupe_training.data.corpus import RIG_ENDINGS, Wanted, make_corpus
from troupe_training.data.joint_source import JointSource
from troupe_training.evaluate.unimogen.card import paths_table, write_card
from troupe_training.evaluate.unimogen.encoders import encoder_of
from troupe_training.evaluate.unimogen.measure import Figures, measure, table, why_no_fid
from troupe_training.evaluate.unimogen.methods import Method, Setting, copied, frozen, interpolated, of_network
from troupe_training.evaluate.unimogen.networks import Network, load_network
from troupe_training.evaluate.unimogen.style import blend as blend_styles
from troupe_training.evaluate.unimogen.style import blend_table, shows, trained_classifier
from troupe_training.evaluate.unimogen.sway import sway_table
from troupe_training.evaluate.unimogen.user_paths import measure_paths, roots_of
from troupe_training.evaluate.unimogen.walk import film as draw_film
from troupe_training.evaluate.unimogen.walk import swinging
from troupe_training.export.manifest import About, read_manifest, set_version
from troupe_training.export.unimogen.adopt import adopt as adopt_pack
from troupe_training.export.unimogen.kinds import KINDS
from troupe_training.export.unimogen.kinds import add as add_kind
from troupe_training.export.unimogen.pack import export_run, network_of
from troupe_training.export.unimogen.sway import write_sway
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
MINUTES = 480.0  # of training, if neither minutes nor steps are given
OPTIONS["--bodies"] = {"type": Path, "help": "TOML list of bodies and their motion, as training/bodies.toml is one"}
OPTIONS["--data"] = {"type": Path, "default": Path(), "help": "folder that the list's paths of motion are relative to"}
OPTIONS["--source"] = {
    "type": Path,
    "help": "one folder of motion instead of a list: a body, a robot (with --urdf), or of glTF files alone a body a file",
}
OPTIONS["--trained-bodies"] = {"nargs": "+", "help": "train on these bodies of the cache alone"}
OPTIONS["--unimogen-preset"] = {
    "choices": PRESETS,
    "help": "network sizes; those of the checkpoint if left out, of a new run `default`",
}
OPTIONS["--without"] = {
    "nargs": "+",
    "choices": ABLATIONS,
    "default": [],
    "help": "parts of the method to leave out: " + "; ".join(f"{name}: {what}" for name, what in ABLATIONS.items()),
}
OPTIONS["--kind"] = {"choices": KINDS, "help": "kind of bodies with a network of its own"}
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
OPTIONS["--beside"] = {
    "nargs": "+",
    "default": [],
    "metavar": "NAME=RUN",
    "help": "other runs or packs to measure on the same windows, as one of a single body, or one of an ablation",
}
OPTIONS["--other-steps"] = {"type": int, "nargs": "+", "default": [], "help": "also measure with as many sampler steps"}
OPTIONS["--other-guidance"] = {"type": float, "nargs": "+", "default": [], "help": "also measure with such guidance"}
OPTIONS["--evaluations"] = {"type": Path, "nargs": "+", "help": "what the family's `evaluate --json FILE` wrote"}
OPTIONS["--sweeps"] = {
    "type": Path,
    "nargs": "+",
    "default": [],
    "help": "what `unimogen evaluate --other-steps` and `--other-guidance` wrote, for tables of their own",
}
OPTIONS["--copied-from"] = {
    "nargs": "+",
    "default": [],
    "metavar": "BODY",
    "help": "bodies whose motion of the same takes is copied by joint name, on the moments that all have",
}
OPTIONS["--styles"] = {"nargs": 2, "metavar": "STYLE", "help": "two styles to blend"}
OPTIONS["--blend"] = {"type": Path, "nargs": "+", "default": [], "help": "what `unimogen blend --json FILE` wrote"}
OPTIONS["--user-paths"] = {"type": Path, "nargs": "+", "default": [], "help": "what `unimogen paths --json FILE` wrote"}
OPTIONS["--shown"] = {
    "nargs": "+",
    "default": ["human", "g1", "h1_2", "horse"],
    "help": "bodies of the cache, whether trained on or not",
}
OPTIONS["--windows"] = {"type": int, "default": 3, "help": "windows that follow one another"}
OPTIONS["--packs"] = {
    "type": Path,
    "default": Path("models"),
    "help": "folder of packs whose evaluator.onnx measures FID, by the body's name",
}


@command(
    ("--bodies", "--source"),
    *(
        "--data",
        "--name",
        "--urdf",
        "--end-effector",
        "--legs",
        "--contact-joints",
        "--scale",
        "--test-name",
        "--cells",
    ),
    *READING_FLAGS,
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
    except KeyError as error:
        raise SystemExit(f"{args.bodies}: {error} is missing") from error
    except (OSError, ValueError) as error:
        raise SystemExit(f"{args.bodies or args.source}: {error}") from error
    make_corpus(wanted, args.cache, args.workers)
    return 0


def _listed(path: Path, data: Path) -> list[Wanted]:
    """The bodies of a list."""
    bodies: list[dict[str, Any]] = tomllib.loads(path.read_text(encoding="utf-8"))["bodies"]
    return [_wanted(report_head, data, path.parent) for report_head in bodies]


def _wanted(report_head: dict[str, Any], data: Path, beside: Path) -> Wanted:
    reader: MotionSource | None
    if report_head.get("glb"):
        reader = None
    elif "urdf" in report_head:
        reader = RobotSource(data / report_head["urdf"])
    else:
        reader = JointSource(report_head.get("contact_joints"), report_head.get("scale"))
    return Wanted(
        report_head["name"],
        data / report_head["source"],
        reader,
        report_head.get("test_name"),
        report_head.get("tested", True),
        read_cells(beside / report_head["cells"]) if "cells" in report_head else frozenset(),
        report_head.get("licence", "unknown"),
        report_head.get("credits", []),
    )


def _own(args: argparse.Namespace) -> Wanted:
    """A folder of the user's own motion, by the kind of its files."""
    endings = {p.suffix.lower() for p in args.source.rglob("*")}
    reader: MotionSource | None = robot_of(args)
    if reader is None and (not endings & set(RIG_ENDINGS) or endings & (set(ENDINGS) - set(RIG_ENDINGS))):
        reader = JointSource(args.contact_joints, args.scale, reading(args))
    cells = read_cells(args.cells) if args.cells else frozenset()
    about = (args.test_name, True, cells, args.licence, args.credit)
    given: FileOptions = {"unit": args.scale, **reading(args)} if args.scale is not None else reading(args)
    return Wanted(args.name, args.source, reader, *about, given)


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
        PRESETS[args.unimogen_preset] if args.unimogen_preset else None,
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


@command("--pack", "--run", "--kind", "--unimogen-preset", group=GROUP, pack=Path("models/unimogen"), run=RUN)
def adopt(args: argparse.Namespace) -> int:
    """A pack's network -> a checkpoint to train on from, with the sizes of a larger preset if one is given.

    With --kind it is the network of that kind, otherwise that for all bodies.
    """
    config = PRESETS[args.unimogen_preset] if args.unimogen_preset else None
    model = adopt_pack(args.pack, args.run, config, args.kind)
    parameters = sum(p.numel() for p in model.parameters())
    print(f"{args.run / STAGE}.pt from {args.pack}, {parameters / 1e6:.2f} million parameters")
    return 0


@command("--run", "--cache", *ABOUT, group=GROUP, cache=CACHE, run=RUN, out=Path("models/unimogen"), name="unimogen")
def export(args: argparse.Namespace) -> int:
    """A checkpoint -> a pack: one ONNX file with ragged rows, checked against PyTorch, and a file a body."""
    export_run(args.run, args.cache, args.out, About(args.name, args.version, args.licence, args.credit))
    return 0


@command(
    *("--pack", "--kind", "--run", "--cache", "--version"),
    required=("--kind",),
    group=GROUP,
    pack=Path("models/unimogen"),
    run=RUN,
    cache=CACHE,
    version=None,  # the pack keeps its own
)
def add(args: argparse.Namespace) -> int:
    """A checkpoint -> a pack's network for one kind of bodies, those that the run was trained on (`--trained-bodies`)."""
    add_kind(args.pack, args.kind, args.run, args.cache, args.version)
    return 0


@command(
    *("--pack", "--cache", "--shown", "--version"),
    group=GROUP,
    pack=Path("models/unimogen"),
    cache=CACHE,
    shown=["human", "g1", "h1", "h1_2"],
    version=None,  # the pack keeps its own
)
def sway(args: argparse.Namespace) -> int:
    """How the roots of bodies with two feet sway about their way in training clips -> the bodies' files in a pack."""
    words = read_manifest(args.pack)["unimogen"]["words"]
    for name in args.shown:
        table = sway_table(Corpus(args.cache, "train", [name], words=words).stores[name])
        write_sway(args.pack, name, table)
        print(f"{name}: {len(table.get('gaits', []))} gaits")
    set_version(args.pack, args.version)
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


NETWORK = ("--run", "--pack")  # of which one is measured


@command(
    NETWORK,
    *("--cache", "--trained-bodies", "--parts", "--frames", "--stride", "--max-windows", *SAMPLING),
    *("--other-steps", "--other-guidance", "--beside", "--copied-from", "--packs", "--json", "--markdown"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    pack=None,
    seed=1,
    stride=32,
    max_windows=128,
)
def evaluate(args: argparse.Namespace) -> int:
    """Path, feet and distance to captures of networks on test clips and held-out cells, beside captures and baselines."""
    torch.set_num_threads(args.threads)
    network, setting = _network(args), setting_of(args)
    answering = {"unimogen": (network, setting)}
    answering |= {f"{n} steps": (network, replace(setting, steps=n)) for n in args.other_steps}
    answering |= {f"guidance {w:g}": (network, replace(setting, guidance=w)) for w in args.other_guidance}
    others = {name: load_network(Path(folder), args.threads) for name, folder in map(_named, args.beside)}
    answering |= {name: (other, setting) for name, other in others.items()}
    limits, report, notes = network.limits, dict[str, dict[str, Figures]](), dict[str, str]()
    for part in args.parts:
        names = [*args.trained_bodies, *args.copied_from] if args.trained_bodies else None
        corpus = Corpus(args.cache, part, names)
        measured = set(args.trained_bodies or corpus.names)
        for name, store in corpus.stores.items():
            if name not in measured:
                continue
            donors = {n: corpus.stores[n] for n in args.copied_from if n != name and n in corpus.stores}
            methods: dict[str, Method] = {
                "frozen pose": frozen(store.body, limits),
                "interpolated": interpolated(store.body, limits),
            }
            methods |= {f"copied from {n}": copied(store, donor, limits) for n, donor in donors.items()}
            for n, (one, how) in answering.items():
                one.check_body(store.body)
                methods[n] = of_network(store.body, one, corpus.words, how)
            encoder, without_encoder = encoder_of(args.packs, store.body, args.threads)
            what = f"{name}, {part}"
            report[what] = measure(store, methods, setting, encoder, list(donors.values()))
            notes[what] = why_no_fid(report[what], without_encoder)
    text = table(report, notes)
    print(text)
    if args.markdown:
        args.markdown.write_text(f"    {args.command_line}\n\n{text}")
    if args.json:
        report_head = network.source | {"command": args.command_line, "setting": asdict(setting)}
        args.json.write_text(json.dumps(report_head | {"figures": report, "notes": notes}, indent=1) + "\n")
    return 0


@command(
    NETWORK,
    *("--cache", "--shown", "--frames", "--max-windows", *SAMPLING, "--beside", "--packs", "--json"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    pack=None,
    shown=["human", "g1", "h1", "h1_2", "horse", "fox"],
    seed=1,
    max_windows=64,
)
def paths(args: argparse.Namespace) -> int:
    """Feet on paths as users give them (lines, arcs, S curves at even speed), beside captures of the same speed and turn."""
    torch.set_num_threads(args.threads)
    network, setting = _network(args), setting_of(args)
    networks = {"unimogen": network}
    networks |= {name: load_network(Path(folder), args.threads) for name, folder in map(_named, args.beside)}
    report = dict[str, dict[str, Figures]]()
    for name in args.shown:
        stores = _stores(args.cache, name, network.words)
        store = stores[0]
        methods = dict[str, Method]()
        for n, one in networks.items():
            one.check_body(store.body)
            methods[n] = of_network(store.body, one, store.words, setting)
        encoder, _ = encoder_of(args.packs, store.body, args.threads)
        found = measure_paths(store, stores, methods, setting, encoder)
        report |= {f"{name}, {case}": figures for case, figures in found.items()}
        print(paths_table({what: report[what] for what in report if what.startswith(f"{name}, ")}), flush=True)
    if args.json:
        report_head = network.source | {"command": args.command_line, "setting": asdict(setting)}
        args.json.write_text(json.dumps(report_head | {"figures": report}, indent=1) + "\n")
    return 0


@command(
    NETWORK,
    *("--cache", "--body", "--styles", "--packs", "--parts", "--frames", "--stride", "--max-windows", *SAMPLING),
    "--json",
    required=("--styles",),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    pack=None,
    seed=1,
    stride=32,
    max_windows=64,
)
def blend(args: argparse.Namespace) -> int:
    """Which of two styles a classifier takes blends of them for, on the paths of held-out windows."""
    torch.set_num_threads(args.threads)
    network, styles = _network(args), (args.styles[0], args.styles[1])
    style_vector(list(styles), network.words)
    train, *held_out = (
        Corpus(args.cache, part, [args.body], network.words).stores.get(args.body) for part in ("train", *args.parts)
    )
    if train is None:
        raise SystemExit(f"{args.cache} has no training clips of {args.body}")
    network.check_body(train.body)
    encoder, without_encoder = encoder_of(args.packs, train.body, args.threads)
    if encoder is None:
        raise SystemExit(f"{without_encoder}: `troupe-train evaluator` makes one")
    judge, report = trained_classifier(train, styles, setting_of(args), encoder), {}
    for part, store in zip(args.parts, held_out, strict=True):
        if store is None or not shows(store, styles, args.frames):
            print(f"{part}: not both styles are shown")
            continue
        report[part] = blend_styles(judge, store, styles, network, setting_of(args), encoder)
        print(f"{part}\n\n{blend_table(styles, report[part])}")
    if args.json:
        report_head = network.source | {"command": args.command_line, "styles": styles, "shares": report}
        args.json.write_text(json.dumps(report_head) + "\n")
    return 0


@command(
    NETWORK,
    *("--cache", "--shown", "--words", "--speed", "--turn", "--windows", "--frames", *SAMPLING, "--out", "--json"),
    group=GROUP,
    cache=CACHE,
    run=RUN,
    pack=None,
    out=Path("film.png"),
    seed=1,
    turn=20.0,
)
def film(args: argparse.Namespace) -> int:
    """One path walked by several bodies, window after window: a picture, and how each keeps to it, slides, and joins windows."""
    torch.set_num_threads(args.threads)
    network = _network(args)
    bodies = [Body.load(args.cache / name / "body.json") for name in args.shown]
    for body in bodies:
        network.check_body(body)
    path = swinging(args.windows, args.frames, args.speed, args.turn)
    style = style_vector(args.words, network.words)
    found = draw_film(bodies, network, style, path, setting_of(args), args.out)
    for name, figures in found.items():
        print(f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in figures.items()))
    if args.json:
        args.json.write_text(json.dumps(network.source | {"figures": found}, indent=1) + "\n")
    return 0


@command(
    *("--pack", "--evaluations", "--sweeps", "--user-paths", "--notes", "--blend"),
    required=("--evaluations",),
    group=GROUP,
    pack=Path("models/unimogen"),
)
def card(args: argparse.Namespace) -> int:
    """Writes a pack's README from its manifest, its bodies, and the JSON of `unimogen evaluate`."""
    write_card(args.pack, args.evaluations, args.notes, args.blend, args.sweeps, args.user_paths)
    return 0


def _network(args: argparse.Namespace) -> Network:
    """The network to measure: of a pack if one is named, else of a run."""
    if args.pack and not (args.pack / "pack.toml").exists():
        raise SystemExit(f"{args.pack} is no pack: it has no pack.toml")
    return load_network(args.pack or args.run, args.threads)


def setting_of(args: argparse.Namespace) -> Setting:
    """How windows are answered; 0 windows means all of them."""
    stride, most = getattr(args, "stride", 1), getattr(args, "max_windows", None) or None
    return Setting(args.frames, stride, most, args.sampler_steps, args.guidance, args.seed)


@command(
    *("--cache", "--shown", "--frames", "--max-windows", "--json"),
    group=GROUP,
    cache=CACHE,
    shown=["human", "g1", "h1", "h1_2", "horse", "fox"],
    max_windows=32,
    json=Path("roots.json"),
)
def roots(args: argparse.Namespace) -> int:
    """The roots of captured straight walks, and how the captures walk: for `troupe-eval bodies --roots FILE`."""
    report = {}
    for name in args.shown:
        store = _stores(args.cache, name)[0]
        report[name] = roots_of(store, Setting(frames=args.frames, most=args.max_windows))
        print(f"{name}: {len(report[name]['roots'])} walks")
    args.json.write_text(json.dumps(report) + "\n")
    return 0


def _stores(cache: Path, name: str, words: list[str] | None = None) -> list[BodyStore]:
    """A body's clips by split: first the test clips, or of a body without test clips what it was trained on."""
    splits = [Corpus(cache, split, [name], words=words) for split in ("test", "train", "cell")]
    stores = [corpus.stores[name] for corpus in splits if name in corpus.stores]
    if not stores:
        raise SystemExit(f"{cache} has no clips of {name}")
    return stores


def _named(text: str) -> tuple[str, str]:
    name, _, run = text.partition("=")
    if not run:
        raise SystemExit(f"{text!r} is not NAME=RUN")
    return name, run
