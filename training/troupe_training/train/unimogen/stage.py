"""The training of a UniMoGen network: build, resume, fit, load."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch

from troupe_training.data.bodies_store import BALANCE, Corpus
from troupe_training.models.unimogen.config import PRESETS, UniMoGenConfig
from troupe_training.models.unimogen.network import UniMoGen
from troupe_training.models.unimogen.state import Range
from troupe_training.train.checkpoints import Checkpoint, read_checkpoint
from troupe_training.train.trainer import Budget, Trainer
from troupe_training.train.unimogen.ablations import ablated_balance, ablated_config, ablated_range, ablated_weights
from troupe_training.train.unimogen.diffusion import Recipe, diffusion_loss, offset_range

STAGE = "unimogen"


@dataclass
class Training:
    """Inputs of a training. ``bodies`` are the bodies to train on, None for all of the cache."""

    cache: Path
    run: Path
    budget: Budget
    config: UniMoGenConfig | None  # None: that of the checkpoint, or the default preset
    rows_per_step: int
    seed: int
    device: str = "cpu"
    bodies: list[str] | None = None
    balance: float = BALANCE
    mirror: bool = True
    without: list[str] = field(default_factory=list)  # of `ABLATIONS`
    fresh_schedule: bool = False


@dataclass
class Trained:
    """A network with what belongs to it."""

    model: UniMoGen
    words: list[str]  # of the style vector
    bodies: list[str]  # that it was trained on
    limits: Range
    state: Checkpoint


def _bodies(wanted: list[str] | None, begun: list[str] | None, path: Path) -> list[str] | None:
    """The bodies to train on: those that are wanted, and otherwise those of the checkpoint. No others can be added to it."""
    if wanted is None or begun is None:
        return wanted or begun
    if others := [body for body in wanted if body not in begun]:
        raise SystemExit(
            f"--trained-bodies {' '.join(others)}: {path} was begun with {', '.join(begun)}: "
            "name some of those, or give another --run"
        )
    return wanted


def train(training: Training) -> bool:
    """Trains a network, resuming its checkpoint; true when the budget is spent.

    A checkpoint keeps its sizes and the parts that it was begun without: another choice ends the command.
    """
    without = sorted(set(training.without))
    torch.manual_seed(training.seed)
    path = training.run / f"{STAGE}.pt"
    begun: dict[str, Any] = read_checkpoint(path)["meta"] if path.exists() else {}
    if begun and begun.get("without", []) != without:
        left_out = ", ".join(begun.get("without", [])) or "nothing"
        raise SystemExit(f"{path} was begun without {left_out}: give the same --without, or another --run")
    config = ablated_config(training.config or PRESETS["default"], without)
    if begun:
        kept = UniMoGenConfig(**begun["model"])
        if training.config is not None and config != kept:
            raise SystemExit(f"{path} has the sizes {kept}: leave out --unimogen-preset, or give another --run")
        config = kept
    balance, body_balance, speed_balance = ablated_balance(training.balance, without)
    bodies, words = _bodies(training.bodies, begun.get("bodies"), path), begun.get("words")
    corpus = Corpus(training.cache, "train", bodies, words, balance, training.mirror, speed_balance)
    limits = _range(begun["range"]) if begun else ablated_range(offset_range(corpus), without)
    model = UniMoGen(config, len(corpus.words)).to(training.device)
    meta = {
        "model": asdict(config),
        "words": corpus.words,
        "bodies": corpus.names,
        "range": [limits.low.tolist(), limits.high.tolist()],
        "seed": training.seed,
        "rows_per_step": training.rows_per_step,
        "mirror": training.mirror,
        "balance": balance,
        "without": without,
    }
    budget = training.budget
    trainer = Trainer(training.run, STAGE, model, budget, meta, training.seed, training.device, takes_adopted=True)
    if trainer.resume():
        if training.fresh_schedule:
            trainer.start_schedule()
        print(f"{STAGE}: going on from step {trainer.step}", flush=True)
    recipe = Recipe(ablated_weights(without), body_balance)
    return trainer.fit(diffusion_loss(corpus, limits, training.rows_per_step, recipe))


def _range(ends: list[list[float]]) -> Range:
    low, high = (torch.tensor(values) for values in ends)
    return Range(low, high)


def load(run: Path) -> Trained:
    """The averaged weights of a run, ready for use; ends the command if there are none."""
    path = run / f"{STAGE}.pt"
    if not path.exists():
        raise SystemExit(f"{path} is missing: `troupe-train unimogen train` makes it")
    state = read_checkpoint(path)
    meta = state["meta"]
    model = UniMoGen(UniMoGenConfig(**meta["model"]), len(meta["words"]))
    model.load_state_dict(state["average"])
    return Trained(model.eval().requires_grad_(False), meta["words"], meta["bodies"], _range(meta["range"]), state)
