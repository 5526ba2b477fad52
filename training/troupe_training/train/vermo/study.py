"""The trainings of the paper's ablations of VerMo: training stages (table 11), and fixed levels beside a codebook.

All language models are trained over the tokenizer of one run, with its pieces and its judge.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from troupe_training.models.vermo.config import QUANTIZERS
from troupe_training.train.trainer import Budget, Job
from troupe_training.train.vermo.flow import STAGE as FLOW
from troupe_training.train.vermo.judge import STAGE as JUDGE
from troupe_training.train.vermo.language import (
    INSTRUCT,
    PIECES,
    PRETRAIN,
    SPECIALIST,
    WORDS,
    stage_name,
    train_language,
)
from troupe_training.train.vermo.tokenizer import REFINE, train_tokenizer
from troupe_training.train.vermo.tokenizer import STAGE as TOKENIZER

STAGES = "stages-"  # begins the names of the baseline's runs; their seeds follow
ONE_STAGE = "one-stage"
ALONE = "-alone"  # ends the names of runs of one task
TASKS = ("text_to_motion", "motion_to_text")
CAPTIONS = "captions.json"
SHARED = (f"{TOKENIZER.name}.pt", f"{JUDGE.name}.pt", CAPTIONS, PIECES, WORDS)  # what all language models share
WHERE_THERE = (f"{REFINE.name}.pt", f"{FLOW.name}.pt")
# Parts of the study's budget. Pretraining and instruction make one; whatever begins with random
# weights gets as much.
PRETRAINING, SPECIALISING, TOKENIZING = 0.2, 0.2, 1.2
WARM_UP = 0.1  # of a stage's updates at most
SPECIALIST_RATE = 0.3  # of the other stages' rate


@dataclass(frozen=True)
class Part:
    """One stage of a run. ``share``: of the study's budget."""

    stage: str
    share: float
    task: str | None = None
    scratch: bool = False
    quantizer: str | None = None  # of a tokenizer

    @property
    def name(self) -> str:
        """Name of its files."""
        return TOKENIZER.name if self.quantizer else stage_name(self.stage, self.task)


@dataclass(frozen=True)
class Planned:
    """A run of the study: stages in one folder, one after another."""

    name: str
    seed: int
    parts: tuple[Part, ...]

    @property
    def tokenizer(self) -> bool:
        """True if it trains a tokenizer and no language model."""
        return any(part.quantizer for part in self.parts)


@dataclass(frozen=True)
class Terms:
    """Terms that all runs share."""

    cache: Path
    source: Path  # the run with the tokenizer, the pieces and the judge
    preset: str
    minutes: float | None  # for pretraining and instruction together; so are steps
    steps: int | None
    rate: float
    tokenizer_rate: float
    per_step: int  # tokens
    frames_per_step: int
    balance: float  # of kinds of motion, for tokenizers
    device: str = "cpu"

    def job(self, run: Path, seed: int, part: Part) -> Job:
        """Inputs of a stage's training."""
        steps = round(self.steps * part.share) if self.steps else None
        minutes = self.minutes * part.share if self.minutes else None
        rate = self.tokenizer_rate if part.quantizer else self.rate
        rate *= SPECIALIST_RATE if part.stage == SPECIALIST and not part.scratch else 1.0
        budget = Budget(minutes, steps, rate)
        if steps:
            budget = replace(budget, warmup_steps=max(1, min(budget.warmup_steps, round(WARM_UP * steps))))
        size = self.frames_per_step if part.quantizer else self.per_step
        return Job(self.cache, run, budget, size, seed, self.device, self.balance)


def planned(seeds: Sequence[int]) -> list[Planned]:
    """All runs: the three stages with every seed, then those with the first seed."""
    first = seeds[0]
    general = (Part(PRETRAIN, PRETRAINING), Part(INSTRUCT, 1.0 - PRETRAINING))
    special = tuple(Part(SPECIALIST, SPECIALISING, task) for task in TASKS)
    runs = [Planned(f"{STAGES}{seed}", seed, general + (special if seed == first else ())) for seed in seeds]
    runs.append(Planned(ONE_STAGE, first, (Part(INSTRUCT, 1.0, scratch=True),)))
    runs += [Planned(task + ALONE, first, (Part(SPECIALIST, 1.0, task, scratch=True),)) for task in TASKS]
    return runs + [Planned(name, first, (Part(TOKENIZER.name, TOKENIZING, quantizer=name),)) for name in QUANTIZERS]


def begun_with(terms: Terms) -> dict[str, Any]:
    """The terms that a study cannot change once it is begun, by name."""
    noted = {name: str(value) if isinstance(value, Path) else value for name, value in asdict(terms).items()}
    return {name: value for name, value in noted.items() if name not in ("cache", "device")}


def link_shared(source: Path, run: Path) -> None:
    """Links the tokenizer, the pieces, the judge and the flow decoder, if any, of a run into another folder."""
    missing = [name for name in SHARED if not (source / name).exists()]
    if missing:
        raise SystemExit(f"{source} has no {', '.join(missing)}: --tokenizer-run takes a run of `vermo train`")
    run.mkdir(parents=True, exist_ok=True)
    for name in (*SHARED, *WHERE_THERE):
        if (source / name).exists() and not (run / name).exists():
            (run / name).symlink_to((source / name).resolve())


def _mark(folder: Path, run: Planned, part: Part) -> Path:
    return folder / run.name / f"{part.name}.done"


def done(folder: Path, run: Planned) -> bool:
    """True if all stages of a run are done."""
    return all(_mark(folder, run, part).exists() for part in run.parts)


def train_all(folder: Path, runs: Sequence[Planned], terms: Terms) -> bool:
    """Trains one after another what is not done; an interrupted stage goes on. False if it was stopped."""
    for number, run in enumerate(runs, 1):
        if not run.tokenizer:
            link_shared(terms.source, folder / run.name)
        for part in run.parts:
            noted = f"{run.name} ({number} of {len(runs)}): {part.name}"
            mark = _mark(folder, run, part)
            if mark.exists():
                print(f"{noted}: done before", flush=True)
                continue
            print(f"{noted}: training", flush=True)
            job = terms.job(folder / run.name, run.seed, part)
            if part.quantizer:
                finished = train_tokenizer(job, terms.preset, part.quantizer)
            else:
                finished = train_language(job, part.stage, terms.preset, part.task, part.scratch)
            if not finished:
                return False
            mark.touch()
    return True
