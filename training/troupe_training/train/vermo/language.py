"""The language model's training in three stages (paper, section 4.3): all tokens, replies alone, and one task alone.

Validation messages, out of clips that are not trained on, decide which weights are kept and when to stop.
"""

import random
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.store import ClipStore
from troupe_training.models.vermo.config import MAX_TOKENS, PRESETS, LanguageConfig
from troupe_training.models.vermo.language import LanguageModel
from troupe_training.models.vermo.messages import PAD, Message, Vocabulary
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.train.checkpoints import read_checkpoint, write_checkpoint
from troupe_training.train.trainer import Job, Loss, Trainer
from troupe_training.train.vermo.corpus import SHARES, MessageSource, Motions, message_batches, split_validation
from troupe_training.train.vermo.tokenizer import load_tokenizer

PRETRAIN, INSTRUCT, SPECIALIST = "pretrain", "instruct", "specialist"
BEFORE = {INSTRUCT: PRETRAIN, SPECIALIST: INSTRUCT}  # the stage whose weights a stage begins with
PIECES, WORDS = "pieces.json", "words.txt"  # of a run; a pack calls the first tokenizer.json
DROPOUT = 0.1
POOL = 8  # batches that are drawn at once and sorted by length
VALIDATED = 192  # messages
PATIENCE = 6  # validations without a better one before the training stops
VALIDATION_STEPS = 200  # updates between validations at least


@dataclass
class Batch:
    """Messages side by side, padded."""

    tokens: Tensor  # [S, L]
    counted: Tensor  # [S, L - 1], of bool: targets whose loss counts
    task: list[str]


def collate(messages: list[Message], vocabulary: Vocabulary, whole: bool) -> Batch:
    """A batch; ``whole``: the loss counts all tokens and not replies alone."""
    prompts = [m.prompt(vocabulary) for m in messages]
    rows = [prompt + m.answer(vocabulary) for prompt, m in zip(prompts, messages, strict=True)]
    longest = max(map(len, rows))
    tokens = torch.tensor([row + [PAD] * (longest - len(row)) for row in rows])
    place = torch.arange(1, longest)[None]
    first = torch.tensor([1 if whole else len(prompt) for prompt in prompts])[:, None]
    end = torch.tensor([len(row) for row in rows])[:, None]
    return Batch(tokens, (place >= first) & (place < end), [m.task for m in messages])


def token_losses(model: LanguageModel, batch: Batch) -> Tensor:
    """Cross-entropy of every counted target ``[N]``, in the order of the batch."""
    table = model.table()
    hidden = model.hidden(batch.tokens[:, :-1], table)[batch.counted]
    logits = F.linear(hidden, table).float()
    return F.cross_entropy(logits, batch.tokens[:, 1:][batch.counted], reduction="none")


class Watched(Trainer[LanguageModel]):
    """A trainer that measures the averaged weights when it saves, keeps the best, and stops if none gets better.

    A stage that was cut short may not have been measured since: its last checkpoint is not lost, but the best one counts.
    """

    def watch(self, batches: list[Batch]) -> None:
        """Sets what is measured on."""
        self.batches = batches
        self.best, self.since, self.measured_step = float("inf"), 0, 0
        self.validations: list[dict[str, float]] = []

    @property
    def best_path(self) -> Path:
        """The checkpoint of the best weights."""
        return self.run / f"{self.stage}-best.pt"

    def resume(self) -> bool:
        """Loads the checkpoint, and what was measured."""
        resumed = super().resume()
        self.measured_step = self.step
        if resumed and self.best_path.exists():
            self.best = min(v["total"] for v in read_checkpoint(self.best_path)["meta"]["validations"])
        return resumed

    def save(self) -> None:
        """Measures where enough has changed, then saves."""
        if self.step - self.measured_step < VALIDATION_STEPS and self.progress() < 1.0:
            super().save()
            return
        self.measured_step = self.step
        measured = validation(self.average, self.batches)
        self.validations.append({"step": self.step} | measured)
        self.meta["validations"] = self.validations
        super().save()
        print(f"\n{self.stage} step {self.step}: {measured}", flush=True)
        self.since += 1
        if measured["total"] < self.best:
            self.best, self.since = measured["total"], 0
            write_checkpoint(self.best_path, read_checkpoint(self.path))
        elif self.since >= PATIENCE:
            self._stop = True


@torch.no_grad()
def validation(model: LanguageModel, batches: list[Batch]) -> dict[str, float]:
    """Loss of a reply's token, over all and by task."""
    sums: dict[str, list[float]] = {}
    for batch in batches:
        losses = token_losses(model, batch)
        rows = torch.nonzero(batch.counted)[:, 0]
        for name in {*batch.task, "total"}:
            of = torch.tensor([name in (task, "total") for task in batch.task])
            kept = losses[of[rows]]
            total = sums.setdefault(name, [0.0, 0.0])
            total[0] += float(kept.sum())
            total[1] += len(kept)
    return {name: round(total / max(count, 1), 4) for name, (total, count) in sorted(sums.items())}


def language_loss(source: MessageSource, vocabulary: Vocabulary, tokens: int, whole: bool) -> Loss[LanguageModel]:
    """Cross-entropy of random messages, about ``tokens`` in a batch with the padding."""
    waiting: list[Batch] = []

    def refill(generator: Generator) -> None:
        rng = random.Random(int(torch.randint(2**31, (1,), generator=generator)))
        messages: list[Message] = []
        lengths: list[int] = []
        while sum(lengths) < POOL * tokens:
            message = source.message(rng)
            messages.append(message)
            lengths.append(len(message.prompt(vocabulary)) + len(message.answer(vocabulary)))
        groups = message_batches(messages, lengths, tokens)
        rng.shuffle(groups)
        waiting.extend(collate([messages[i] for i in group], vocabulary, whole) for group in groups)

    def loss(model: LanguageModel, generator: Generator, progress: float) -> dict[str, Tensor]:
        if not waiting:
            refill(generator)
        return {"token": token_losses(model, waiting.pop()).mean()}

    return loss


def stage_name(stage: str, task: str | None) -> str:
    """Name of a stage's files."""
    return f"language-{stage}" + (f"-{task}" if task else "")


def latest_stage(run: Path, task: str | None = None) -> str:
    """The last stage that has a checkpoint: the specialist's of a task, else of all tasks."""
    if task:
        return stage_name(SPECIALIST, task)
    stages = [stage_name(stage, None) for stage in (INSTRUCT, PRETRAIN)]
    return next((name for name in stages if (run / f"{name}.pt").exists()), stages[0])


def load_language(run: Path, name: str, dropout: float = 0.0) -> LanguageModel:
    """The best weights of a stage, or the averaged ones if none were measured; ends the command without either."""
    path = run / f"{name}-best.pt"
    path = path if path.exists() else run / f"{name}.pt"
    if not path.exists():
        raise SystemExit(f"{path} is missing: train the stage '{name}' first")
    state = read_checkpoint(path)
    meta = state["meta"]
    model = LanguageModel(
        LanguageConfig(**meta["model"]), Vocabulary(**meta["vocabulary"]), tuple(meta["levels"]), dropout
    )
    model.load_state_dict(state["average"])
    return model.eval()


def motions_of(run: Path | None, cache: Path, split: str) -> Motions:
    """Clips of a split, with the run's tokenizer. ``validation`` is a part of ``train``, and is left out of that."""
    store = ClipStore(cache, "train" if split == "validation" else split, lengths=())
    clips = store.clips
    if split in ("train", "validation"):
        clips = split_validation(clips)[split == "validation"]
    return Motions(store, load_tokenizer(run, store) if run else None, clips)


def train_language(job: Job, stage: str, preset: str, task: str | None = None, scratch: bool = False) -> bool:
    """Trains one stage, resuming its checkpoint; true when the budget is spent or nothing gets better.

    ``scratch``: it begins with random weights and not with those of the stage before.
    """
    torch.manual_seed(job.seed)
    pieces = Pieces.read(job.run / PIECES)
    motions = motions_of(job.run, job.cache, "train")
    assert motions.tokenizer is not None
    held = Motions(motions.store, motions.tokenizer, split_validation(motions.store.clips)[1])
    shares = {task: 1.0} if task else SHARES
    sizes = PRESETS[preset]
    tokenizer = motions.tokenizer.config
    vocabulary = Vocabulary(pieces.count, tokenizer.codes, 0, MAX_TOKENS)
    before = None if scratch else BEFORE.get(stage)
    if before is None:
        model = LanguageModel(sizes.language, vocabulary, tokenizer.levels, DROPOUT)
    else:
        model = load_language(job.run, stage_name(before, None), DROPOUT)
    meta: dict[str, Any] = {
        "model": asdict(sizes.language),
        "vocabulary": asdict(vocabulary),
        "levels": list(tokenizer.levels),
        "seed": job.seed,
        "tokens_per_step": job.frames_per_step,
        "shares": shares,
    }
    trainer = Watched(job.run, stage_name(stage, task), model, job.budget, meta, job.seed, job.device)
    rng = random.Random(2026)
    fixed = MessageSource(held, pieces, shares)
    messages = [fixed.message(rng) for _ in range(VALIDATED)]
    lengths = [len(m.prompt(vocabulary)) + len(m.answer(vocabulary)) for m in messages]
    groups = message_batches(messages, lengths, 4096)
    trainer.watch([collate([messages[i] for i in group], vocabulary, whole=False) for group in groups])
    if trainer.resume():
        if job.fresh_schedule:
            trainer.start_schedule()
        print(f"{trainer.stage}: going on from step {trainer.step}")
    source = MessageSource(motions, pieces.varied(), shares)
    done = trainer.fit(language_loss(source, vocabulary, job.frames_per_step, stage == PRETRAIN))
    return done or trainer.since >= PATIENCE
