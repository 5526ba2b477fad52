"""Checkpoints: a network's weights with what it was built from and how far it has come, ``STAGE.pt`` in a run's folder."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, NotRequired, TypedDict, TypeVar

import torch
from torch import Tensor, nn

from troupe_training.data.store import ClipStore

C = TypeVar("C")
M = TypeVar("M", bound=nn.Module)


class Checkpoint(TypedDict):
    """The content of a checkpoint. An adopted one has no optimiser to go on with."""

    stage: str
    meta: dict[str, Any]  # "model": the network's sizes; besides, how it was trained
    model: dict[str, Tensor]
    average: dict[str, Tensor]  # the weights that are used and exported
    step: int
    seconds: float
    history: list[dict[str, float]]
    optimizer: NotRequired[dict[str, Any]]
    schedule_step: NotRequired[int]  # where the present budget began
    schedule_seconds: NotRequired[float]


def read_checkpoint(path: Path, device: str = "cpu") -> Checkpoint:
    """Reads a checkpoint; files that hold anything but plain values and tensors are refused."""
    checkpoint: Checkpoint = torch.load(path, map_location=device, weights_only=True)
    return checkpoint


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Writes a checkpoint; an interrupted write never destroys the last one."""
    partial = path.with_suffix(".tmp")
    torch.save(checkpoint, partial)
    os.replace(partial, path)


@dataclass(frozen=True)
class Stage(Generic[C, M]):
    """A network that is trained by itself.

    ``config`` makes its sizes out of what a checkpoint notes of them, ``build`` a new network with its standardisation
    constants set.
    """

    name: str
    config: Callable[..., C]
    build: Callable[[C, ClipStore], M]

    def path(self, run: Path) -> Path:
        """Its checkpoint in a run's folder."""
        return run / f"{self.name}.pt"

    def read(self, run: Path, device: str = "cpu") -> Checkpoint:
        """Its checkpoint; ends the command if there is none."""
        path = self.path(run)
        if not path.exists():
            raise SystemExit(f"{path} is missing: train the stage '{self.name}' first")
        return read_checkpoint(path, device)

    def load(self, run: Path, store: ClipStore) -> M:
        """The averaged weights, ready for use."""
        state = self.read(run, store.device)
        model = self.build(self.config(**state["meta"]["model"]), store)
        try:
            model.load_state_dict(state["average"])
        except RuntimeError as error:
            message = f"{self.path(run)} does not fit the networks of this version: {error}"
            raise SystemExit(message) from error
        return model.to(store.device).eval().requires_grad_(False)
