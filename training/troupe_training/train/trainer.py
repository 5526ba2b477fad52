"""The training loop that all stages share: optimiser, schedule, averaged weights, checkpoints, curves.

A run is bounded by steps or by minutes, whichever is given; the learning rate follows a cosine over that budget. It may
be stopped at any moment (ctrl-c or SIGTERM): it writes its checkpoint and the same command goes on from there. A trained
stage can be trained further with a fresh schedule, that is, a new budget counted from where it stands.
"""

import copy
import json
import math
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import Generator, Tensor, nn
from tqdm import tqdm

from troupe_training.data.precision import multiplies_bfloat16
from troupe_training.data.store import BALANCE, ClipStore
from troupe_training.train.checkpoints import read_checkpoint, write_checkpoint

M = TypeVar("M", bound=nn.Module)
# A model, a random generator and the share of the budget that is spent (0 to 1) to named terms,
# which are added up; those whose names begin with an underscore are only noted.
Loss = Callable[[M, Generator, float], dict[str, Tensor]]

CHECKPOINT_SECONDS = 120
LOG_STEPS = 25


@dataclass
class Budget:
    """How long a stage trains, and how fast it learns."""

    minutes: float | None = None
    steps: int | None = None
    learning_rate: float = 4e-4
    warmup_steps: int = 200

    def progress(self, step: int, seconds: float) -> float:
        """Share of the budget that is spent, 0 to 1."""
        by_steps = step / self.steps if self.steps else 0.0
        by_time = seconds / (60 * self.minutes) if self.minutes else 0.0
        return min(1.0, max(by_steps, by_time))

    def rate(self, step: int, progress: float) -> float:
        """Learning rate: linear warm-up, then cosine down to a fiftieth."""
        warm = min(1.0, (step + 1) / self.warmup_steps)
        return self.learning_rate * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * progress)))


class Trainer(Generic[M]):
    """Minimises a `Loss` and keeps ``STAGE.pt`` and ``STAGE.json`` in the run folder."""

    def __init__(
        self,
        run: Path,
        stage: str,
        model: M,
        budget: Budget,
        meta: dict[str, Any],
        seed: int,
        device: str,
        takes_adopted: bool = False,
    ):
        self.run, self.stage, self.model, self.budget = run, stage, model, budget
        self.meta, self.seed, self.device = meta, seed, device
        self.half = multiplies_bfloat16(device)  # trunks in bfloat16, if that pays
        self.takes_adopted = takes_adopted  # goes on from a pack's weights, which have no optimiser
        self.run.mkdir(parents=True, exist_ok=True)
        self.average = copy.deepcopy(model).eval()
        self.optimizer = torch.optim.AdamW(
            [p for p in model.parameters() if p.requires_grad],
            lr=budget.learning_rate,
            betas=(0.9, 0.98),
            weight_decay=1e-3,
        )
        self.step, self.seconds = 0, 0.0
        self.history: list[dict[str, float]] = []
        self.schedule_step, self.schedule_seconds = 0, 0.0  # where the present budget began
        self._stop = False

    @property
    def path(self) -> Path:
        """The stage's checkpoint."""
        return self.run / f"{self.stage}.pt"

    def resume(self) -> bool:
        """Loads the checkpoint, if there is one."""
        if not self.path.exists():
            return False
        state = read_checkpoint(self.path, self.device)
        if "optimizer" not in state and not self.takes_adopted:
            raise SystemExit(f"{self.path} came out of a pack: it cannot be trained further, only refined")
        self.model.load_state_dict(state["model"])
        self.average.load_state_dict(state["average"])
        if "optimizer" in state:
            self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.seconds, self.history = state["step"], state["seconds"], state["history"]
        self.schedule_step = state.get("schedule_step", 0)
        self.schedule_seconds = state.get("schedule_seconds", 0.0)
        return True

    def start_schedule(self) -> None:
        """Counts budget, warm-up and averaging from here on, and goes on from the averaged weights."""
        self.model.load_state_dict(self.average.state_dict())
        self.schedule_step, self.schedule_seconds = self.step, self.seconds

    def progress(self) -> float:
        """Share of the present budget that is spent, 0 to 1."""
        return self.budget.progress(self.step - self.schedule_step, self.seconds - self.schedule_seconds)

    def save(self) -> None:
        """Writes the checkpoint and the curve."""
        write_checkpoint(
            self.path,
            {
                "stage": self.stage,
                "meta": self.meta,
                "model": self.model.state_dict(),
                "average": self.average.state_dict(),
                "optimizer": self.optimizer.state_dict(),
                "step": self.step,
                "seconds": self.seconds,
                "history": self.history,
                "schedule_step": self.schedule_step,
                "schedule_seconds": self.schedule_seconds,
            },
        )
        curve = self.run / f"{self.stage}.json"
        partial = curve.with_suffix(".json.tmp")
        partial.write_text(json.dumps({"step": self.step, "seconds": self.seconds, "history": self.history}))
        partial.replace(curve)

    def fit(self, loss_fn: Loss[M]) -> bool:
        """Trains until the budget is spent; false if it was stopped before that."""
        previous = [signal.signal(s, self._on_signal) for s in (signal.SIGINT, signal.SIGTERM)]
        # the position in the random stream follows from the step, so a resumed run does not repeat
        # its batches
        generator = Generator().manual_seed(self.seed + self.step)
        bar = tqdm(total=100, desc=self.stage, bar_format="{l_bar}{bar}| {n:.1f}% [{elapsed}<{remaining}{postfix}]")
        bar.update(100 * self.progress())
        saved = started = time.monotonic()
        before = self.seconds
        sums: dict[str, float] = {}
        updates = 0
        try:
            while not self._stop:
                progress = self.progress()
                if progress >= 1.0:
                    break
                terms = self._update(loss_fn, generator, progress)
                updates += 1
                for name, value in terms.items():
                    sums[name] = sums.get(name, 0.0) + value
                self.seconds = before + time.monotonic() - started
                if self.step % LOG_STEPS == 0:
                    entry = {name: round(value / updates, 5) for name, value in sums.items()}
                    self.history.append({"step": self.step} | entry)
                    sums, updates = {}, 0
                    bar.n = round(100 * self.progress(), 2)
                    bar.set_postfix_str(f"step {self.step} loss {entry['total']:.4f}")
                if time.monotonic() - saved > CHECKPOINT_SECONDS:
                    self.save()
                    saved = time.monotonic()
        finally:
            bar.close()
            for number, handler in zip((signal.SIGINT, signal.SIGTERM), previous, strict=True):
                signal.signal(number, handler)
        self.save()
        return not self._stop

    def _on_signal(self, *_: object) -> None:
        self._stop = True

    def _update(self, loss_fn: Loss[M], generator: Generator, progress: float) -> dict[str, float]:
        for group in self.optimizer.param_groups:
            group["lr"] = self.budget.rate(self.step - self.schedule_step, progress)
        self.model.train()
        with torch.autocast(torch.device(self.device).type, torch.bfloat16, enabled=self.half):
            terms = loss_fn(self.model, generator, progress)
        minimised = (value for name, value in terms.items() if not name.startswith("_"))
        total = sum(minimised, torch.zeros((), device=self.device))
        if not torch.isfinite(total):
            raise FloatingPointError(
                f"{self.stage}: the loss is not finite at step {self.step}; the last checkpoint is kept"
            )
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        self.step += 1
        self._average()
        return {"total": float(total.detach())} | {name: float(value.detach()) for name, value in terms.items()}

    @torch.no_grad()
    def _average(self) -> None:
        updates = self.step - self.schedule_step
        decay = min(0.999, (1 + updates) / (10 + updates))
        for mean, now in zip(self.average.parameters(), self.model.parameters(), strict=True):
            mean.lerp_(now, 1 - decay)
        for kept, new in zip(self.average.buffers(), self.model.buffers(), strict=True):
            kept.copy_(new)


@dataclass
class Job:
    """Inputs of the training of any network."""

    cache: Path  # of the data
    run: Path  # folder of checkpoints and curves
    budget: Budget
    frames_per_step: int
    seed: int
    device: str = "cpu"
    balance: float = BALANCE  # of kinds of motion, see `ClipStore`
    fresh_schedule: bool = False  # counts the budget from the checkpoint on, not from the first update

    def store(self) -> ClipStore:
        """The train split."""
        return ClipStore(self.cache, "train", self.device, self.balance)

    def fit(self, stage: str, model: M, meta: dict[str, Any], loss: Loss[M]) -> bool:
        """Trains a model, resuming its checkpoint; true when the budget is spent."""
        meta = meta | {"seed": self.seed, "frames_budget": self.frames_per_step}
        trainer = Trainer(self.run, stage, model, self.budget, meta, self.seed, self.device)
        if trainer.resume():
            if self.fresh_schedule:
                trainer.start_schedule()
            print(f"{stage}: going on from step {trainer.step}")
        return trainer.fit(loss)
