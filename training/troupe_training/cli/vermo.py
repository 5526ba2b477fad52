"""Commands of the family VerMo: a language model over text and motion tokens."""

import argparse
import json
from itertools import chain
from pathlib import Path

import torch

from troupe_training.cli.options import OPTIONS, STOPPED, command
from troupe_training.evaluate.vermo.card import write_card
from troupe_training.evaluate.vermo.measure import PARTS, Setting, measure
from troupe_training.export.manifest import About
from troupe_training.export.vermo.pack import SAMPLING
from troupe_training.export.vermo.random_pack import random_pack as export_random
from troupe_training.export.vermo.random_pack import write_reference
from troupe_training.export.vermo.run import export_run
from troupe_training.models.vermo.config import PRESETS, QUANTIZERS
from troupe_training.models.vermo.pieces import Pieces, train_pieces, words_of
from troupe_training.models.vermo.sampler import Sampling
from troupe_training.train.trainer import Budget, Job
from troupe_training.train.vermo.corpus import SHARES, captions_of
from troupe_training.train.vermo.flow import STAGE as FLOW
from troupe_training.train.vermo.flow import train_flow
from troupe_training.train.vermo.judge import STAGE as JUDGE
from troupe_training.train.vermo.judge import train_judge
from troupe_training.train.vermo.language import (
    INSTRUCT,
    PIECES,
    PRETRAIN,
    SPECIALIST,
    WORDS,
    motions_of,
    train_language,
)
from troupe_training.train.vermo.tokenizer import REFINE, refine_tokenizer, train_tokenizer
from troupe_training.train.vermo.tokenizer import STAGE as TOKENIZER

GROUP = "vermo"
RUN, CACHE = Path("runs/vermo"), Path("runs/cache")
# Minutes, seed, learning rate, and frames or tokens in one update, if the command line does not
# say them.
DEFAULTS = {
    TOKENIZER.name: (180.0, 41, 5e-4, 3072),
    REFINE.name: (60.0, 47, 5e-4, 3072),
    FLOW.name: (120.0, 42, 5e-4, 3072),
    PRETRAIN: (30.0, 43, 1e-3, 2048),
    INSTRUCT: (90.0, 44, 6e-4, 2048),
    SPECIALIST: (30.0, 45, 2e-4, 2048),
    JUDGE.name: (15.0, 46, 1e-3, 4096),
}
CAPTIONS = "captions.json"
SAMPLED = ("--temperature", "--top-k", "--top-p", "--repetition")
OPTIONS["vermo_stage"] = {"choices": DEFAULTS, "metavar": "STAGE", "help": ", ".join(DEFAULTS)}
OPTIONS["--per-step"] = {
    "type": int,
    "help": "frames in one update, tokens for the language model; the stage's own if left out",
}
OPTIONS["--quantizer"] = {
    "choices": QUANTIZERS,
    "default": "fsq",
    "help": "the tokenizer's codes: fixed levels, or a codebook, which nothing else works with",
}
OPTIONS["--task"] = {"choices": SHARES, "help": f"what a {SPECIALIST} is for"}
OPTIONS["--each"] = {"type": int, "default": 8, "help": "captions of every clip"}
OPTIONS["--reference"] = {"type": Path, "help": "also write what PyTorch answers to some messages here, as JSON"}
OPTIONS["--measured"] = {"nargs": "+", "choices": PARTS, "default": list(PARTS), "help": "parts of the evaluation"}
OPTIONS["--top-k"] = {"type": int, "default": 0, "help": "draw of the largest logits alone; 0: of all"}
OPTIONS["--top-p"] = {"type": float, "default": SAMPLING.top_p, "help": "draw of the tokens that make up this share"}
OPTIONS["--repetition"] = {
    "type": float,
    "default": SAMPLING.repetition,
    "help": "how much codes of the last tokens are held back",
}
OPTIONS["--content-guidance"] = {
    "type": float,
    "default": SAMPLING.content_guidance,
    "help": "how strongly the content counts in texts that name a style; 1: as trained",
}
OPTIONS["--style-guidance"] = {
    "type": float,
    "default": SAMPLING.style_guidance,
    "help": "how strongly the style counts there; 1: as trained",
}
OPTIONS["--samples"] = {"type": int, "default": 4, "help": "answers to each window, for diversity"}
OPTIONS["--flow-steps"] = {"type": int, "default": 0, "help": "of the flow decoder; 0: the first stage's decoder"}
OPTIONS["--motionbricks"] = {
    "type": Path,
    "metavar": "PACK",
    "help": "also fill the gaps of the part continuation with this pack of MotionBricks, of the same body",
}
OPTIONS["--vermo-preset"] = {"choices": PRESETS, "default": "default", "help": "network sizes"}


@command("--cache", "--run", "--each", "--seed", "--threads", group=GROUP, run=RUN, seed=7)
def captions(args: argparse.Namespace) -> int:
    """Captions of all clips by templates -> text pieces and words, in the run's folder; the same for the same seed."""
    torch.set_num_threads(args.threads)
    motions = motions_of(None, args.cache, "train")
    written = captions_of(motions, args.each, args.seed)
    args.run.mkdir(parents=True, exist_ok=True)
    names = [clip["name"] for clip in motions.clips]
    (args.run / CAPTIONS).write_text(json.dumps(dict(zip(names, written, strict=True)), indent=1))
    pieces, words = Pieces(train_pieces(chain(*written))), words_of(chain(*written))
    pieces.save(args.run / PIECES)
    (args.run / WORDS).write_text("".join(word + "\n" for word in words))
    print(
        f"{len(names)} clips, {len(set(chain(*written)))} different captions, {len(words)} words, {pieces.count} pieces"
    )
    return 0


@command(
    *("vermo_stage", "--cache", "--run", "--vermo-preset", "--balance", "--quantizer", "--minutes", "--steps"),
    *("--per-step", "--task", "--rate", "--fresh-schedule", "--seed", "--device", "--threads"),
    group=GROUP,
    run=RUN,
)
def train(args: argparse.Namespace) -> int:
    """Trains one stage; stops at any moment (ctrl-c) and resumes from its checkpoint."""
    torch.set_num_threads(args.threads)
    stage: str = args.vermo_stage
    minutes, seed, rate, per_step = DEFAULTS[stage]
    minutes = args.minutes if args.minutes or args.steps else minutes
    if (stage == SPECIALIST) != (args.task is not None):
        raise SystemExit(f"--task is for the stage {SPECIALIST}, which needs it")
    if args.quantizer != "fsq" and stage != TOKENIZER.name:
        raise SystemExit(f"--quantizer is for the stage {TOKENIZER.name}: {stage} takes the tokenizer as it is")
    budget = Budget(minutes=minutes, steps=args.steps, learning_rate=args.rate or rate)
    seed = seed if args.seed is None else args.seed
    size = args.per_step or per_step
    job = Job(args.cache, args.run, budget, size, seed, args.device, args.balance, args.fresh_schedule)
    if stage == TOKENIZER.name:
        done = train_tokenizer(job, args.vermo_preset, args.quantizer)
    elif stage == REFINE.name:
        done = refine_tokenizer(job)
    elif stage == FLOW.name:
        done = train_flow(job, args.vermo_preset)
    elif stage == JUDGE.name:
        done = train_judge(job)
    else:
        done = train_language(job, stage, args.vermo_preset, args.task)
    if not done:
        print(f"{stage}: stopped; the same command goes on from the checkpoint")
    return 0 if done else STOPPED


@command(
    *("--run", "--cache", "--task", "--out", "--name", "--version", "--licence", "--credit"),
    group=GROUP,
    run=RUN,
    out=Path("models/vermo"),
    name="vermo",
)
def export(args: argparse.Namespace) -> int:
    """Checkpoints -> a pack of ONNX files with text pieces and words, checked against PyTorch."""
    export_run(args.run, args.cache, args.out, About(args.name, args.version, args.licence, args.credit), args.task)
    return 0


@command(
    *("--run", "--cache", "--task", "--measured", "--parts", "--max-windows", "--samples", "--flow-steps"),
    *(
        *SAMPLED,
        "--content-guidance",
        "--style-guidance",
        "--pack",
        "--evaluator",
        "--motionbricks",
        "--seed",
        "--threads",
    ),
    *("--json", "--markdown"),
    group=GROUP,
    run=RUN,
    pack=None,
    seed=1,
    temperature=SAMPLING.temperature,
)
def evaluate(args: argparse.Namespace) -> int:
    """Reconstruction, continuations, texts, descriptions and the distance to training clips, each beside its baselines.

    With ``--pack`` the part text alone is measured, of a pack; the judge is then all that the run needs to have.
    """
    torch.set_num_threads(args.threads)
    sampling = Sampling(
        args.temperature, args.top_k, args.top_p, args.repetition, args.content_guidance, args.style_guidance
    )
    setting = Setting(
        *(args.run, args.cache, args.parts, sampling, args.max_windows, args.samples, args.flow_steps, args.seed),
        args.evaluator,
        args.task,
        args.motionbricks,
        args.pack,
    )
    measured, text = measure(setting, args.measured)
    if args.markdown:
        args.markdown.write_text(f"    {args.command_line}\n\n{text}")
    if args.json:
        args.json.write_text(json.dumps({"command": args.command_line} | measured, indent=1) + "\n")
    return 0


@command(*("--pack", "--evaluations", "--notes"), group=GROUP, required=("--evaluations",), pack=Path("models/vermo"))
def card(args: argparse.Namespace) -> int:
    """Writes a pack's README from its manifest and the JSON of `vermo evaluate`."""
    write_card(args.pack, args.evaluations, args.notes)
    return 0


@command(
    *("--vermo-preset", "--out", "--like", "--seed", "--reference"),
    group=GROUP,
    required=("--out",),
    vermo_preset="tiny",
    seed=1,
)
def random_pack(args: argparse.Namespace) -> int:
    """A small pack with random weights, for tests of a server: its motion and text mean nothing."""
    networks, pieces = export_random(args.out, args.like, args.vermo_preset, args.seed)
    if args.reference:
        write_reference(args.reference, networks, pieces)
    print(f"{args.out}: random weights, {networks.parameters() / 1e6:.2f} M parameters")
    return 0
