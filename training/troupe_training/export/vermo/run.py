"""A run's checkpoints as a pack: the tokenizer, the latest stage of the language model, and the flow decoder if it has one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from troupe_training.data.store import ClipStore
from troupe_training.export.manifest import About
from troupe_training.export.vermo.graphs import Networks
from troupe_training.export.vermo.pack import Served, export_pack
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.plots import plot_curves
from troupe_training.train.vermo.corpus import MOST_AGENTS, SHARES
from troupe_training.train.vermo.flow import STAGE as FLOW
from troupe_training.train.vermo.language import PIECES, WORDS, latest_stage, load_language
from troupe_training.train.vermo.tokenizer import REFINE, load_tokenizer
from troupe_training.train.vermo.tokenizer import STAGE as TOKENIZER

METHOD = "VerMo (Ling et al. 2025) for the method"


def load_networks(
    run: Path, store: ClipStore, task: str | None = None, stage: str | None = None
) -> tuple[Networks, str]:
    """The networks of a run, and the name of the language model's stage: the latest one, of a task's if one is given."""
    stage = stage or latest_stage(run, task)
    flow = FLOW.load(run, store) if FLOW.path(run).exists() else None
    return Networks(load_tokenizer(run, store), load_language(run, stage), flow), stage


def steps_of(run: Path, stage: str) -> dict[str, int]:
    """How far the stages of a run are that a pack is made of, by the manifest's names; ``stage`` is the language model's."""
    return {f"{_key(name)}_steps": read_checkpoint(run / f"{name}.pt")["step"] for name in _stages(run, stage)}


def _stages(run: Path, stage: str) -> list[str]:
    """The stages of a run that a pack is made of."""
    return [name for name in (TOKENIZER.name, REFINE.name, stage, FLOW.name) if (run / f"{name}.pt").exists()]


def _key(stage: str) -> str:
    """A stage as the manifest names it."""
    return stage.replace("-", "_")


def export_run(run: Path, cache: Path, out: Path, about: About, task: str | None = None) -> None:
    """A run's checkpoints as a pack, with what they note of their training, and curves. ``task``: the specialist's."""
    store = ClipStore(cache, "train", lengths=())
    networks, stage = load_networks(run, store, task)
    seen = [c for c in store.clips if not c.get("mirrored")]
    training: dict[str, Any] = {"clips": len(seen), "frames": sum(c["frames"] for c in seen)}
    stages = _stages(run, stage)
    for name in stages:
        state = read_checkpoint(run / f"{name}.pt")
        key = _key(name)
        training[f"{key}_steps"] = state["step"]
        training[f"{key}_minutes"] = round(state["seconds"] / 60, 1)
        if state["history"]:
            training[f"{key}_final_loss"] = state["history"][-1]["total"]
    words = (run / WORDS).read_text(encoding="utf-8").split()
    served = Served([task] if task else list(SHARES), Pieces.read(run / PIECES), words, MOST_AGENTS)
    about_run = replace(about, training=training, credits=[*about.credits, METHOD])
    export_pack(out, about_run, store.skeleton, networks, served)
    plot_curves(run, stages, out / "curves.png")
