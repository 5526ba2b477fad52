"""The trainings of the paper's ablations, of single bodies and of unseen ones: which there are, and which are done."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from troupe_training.train.trainer import Budget
from troupe_training.train.unimogen.ablations import ABLATIONS
from troupe_training.train.unimogen.stage import STAGE, Training
from troupe_training.train.unimogen.stage import train as train_network

WHOLE = "whole-"  # begins the names of the baseline's runs; their seeds follow


@dataclass(frozen=True)
class Planned:
    """One training of a study."""

    name: str
    seed: int
    bodies: tuple[str, ...]
    without: tuple[str, ...] = ()
    unseen: str = ""  # a body that is measured although it was left out

    def shown_on(self, body: str) -> bool:
        """True for bodies that belong into its tables: those it was trained on, and the unseen one."""
        return body in self.bodies or body == self.unseen


def planned(bodies: Sequence[str], seeds: Sequence[int], alone: Iterable[str], unseen: Iterable[str]) -> list[Planned]:
    """All trainings: the whole method with every seed, then those with the first seed that leave something out."""
    every, first = tuple(bodies), seeds[0]
    missing = sorted({*alone, *unseen} - set(every))
    if missing:
        raise SystemExit(f"the cache has no body {', '.join(missing)}, only {', '.join(every)}")
    runs = [Planned(f"{WHOLE}{seed}", seed, every) for seed in seeds]
    for name in unseen:
        runs.append(Planned(f"unseen-{name}", first, tuple(b for b in every if b != name), unseen=name))
    runs += [Planned(f"{name}-alone", first, (name,)) for name in alone]
    return runs + [Planned(f"without-{part}", first, every, (part,)) for part in ABLATIONS]


def done(run: Path, budget: Budget) -> bool:
    """True if a run has spent its budget, as its curve says."""
    path = run / f"{STAGE}.json"
    if not path.exists():
        return False
    curve = json.loads(path.read_text())
    return budget.progress(curve["step"], curve["seconds"]) >= 1.0


def train_all(folder: Path, runs: Sequence[Planned], terms: Training) -> bool:
    """Trains one after another what is not done; an interrupted run goes on. False if it was stopped."""
    for number, run in enumerate(runs, 1):
        title = f"{run.name} ({number} of {len(runs)})"
        if done(folder / run.name, terms.budget):
            print(f"{title}: done before", flush=True)
            continue
        print(f"{title}: training", flush=True)
        training = replace(
            terms, run=folder / run.name, seed=run.seed, bodies=list(run.bodies), without=list(run.without)
        )
        if not train_network(training):
            return False
    return True
