"""The tables of a study of VerMo: training stages (paper, table 11), with the flow decoder and without, FSQ beside VQ."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from troupe_training.data.store import ClipStore
from troupe_training.evaluate.tables import Figure, Measure
from troupe_training.evaluate.vermo.answers import Clip, Model, captured, markdown
from troupe_training.evaluate.vermo.measure import Setting
from troupe_training.evaluate.vermo.reconstruction import codes_used, reconstruction, reconstruction_table, whole_crops
from troupe_training.evaluate.vermo.text import (
    asked_of,
    description_figures,
    generated,
    judged,
    retrieved,
    text_figures,
)
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.vermo.corpus import Crop, Motions, captions_of
from troupe_training.train.vermo.judge import STAGE as JUDGE
from troupe_training.train.vermo.language import INSTRUCT, PIECES, PRETRAIN, SPECIALIST, motions_of
from troupe_training.train.vermo.study import TASKS, Part, Planned
from troupe_training.train.vermo.tokenizer import STAGE as TOKENIZER
from troupe_training.train.vermo.tokenizer import load_tokenizer

Figures = dict[str, float]
Report = dict[str, dict[str, Figures]]  # by split, then by method

CAPTURED, SEEN = "captured", "nearest seen caption"
# Rows of the table of stages, by the stage and whether it begins with random weights.
TITLES = {
    (SPECIALIST, True): "single task",
    (INSTRUCT, True): "one stage",
    (PRETRAIN, False): "pretraining",
    (INSTRUCT, False): "+ instruction",
    (SPECIALIST, False): "+ specialist",
}
MOTION = (
    Measure("r3_32", "R@3, pool 32 ↑", 1, 3),
    Measure("r3_256", "R@3, pool 256 ↑", 1, 3),
    Measure("mm_distance", "MM distance ↓", 1, 3),
    Measure("fid", "FID ↓", 1, 3),
    Measure("diversity", "diversity ≈", 1, 3),
    Measure("content", "content (%) ↑", 100, 1),
    Measure("style", "style (%) ↑", 100, 1),
)
WORDS = (
    Measure("said_content", "said content (%) ↑", 100, 1),
    Measure("said_style", "said style (%) ↑", 100, 1),
    Measure("said_side", "said side (%) ↑", 100, 1),
)
MEASURES = (*MOTION, *WORDS)
HANDS = ("left", "right")


@dataclass(frozen=True)
class Trained:
    """A language model of the study: a run after one of its stages."""

    run: str
    part: Part
    updates: int  # of all stages up to here
    best: int  # update of the stage whose weights are measured
    seed: int

    @property
    def name(self) -> str:
        """As reports name it."""
        return f"{self.run}/{self.part.name}"

    @property
    def title(self) -> str:
        """Its row in the table."""
        return TITLES[self.part.stage, self.part.scratch]

    @property
    def tasks(self) -> tuple[str, ...]:
        """The split to measure on."""
        return (self.part.task,) if self.part.task else TASKS


def trained_of(folder: Path, runs: Sequence[Planned]) -> list[Trained]:
    """The language models of runs, stage after stage; specialists begin with what all tasks were trained on."""
    found: list[Trained] = []
    for run in runs:
        before = 0
        for part in run.parts:
            if part.quantizer:
                continue
            own = read_checkpoint(folder / run.name / f"{part.name}.pt")["step"]
            best = folder / run.name / f"{part.name}-best.pt"
            chosen = read_checkpoint(best)["step"] if best.exists() else own
            found.append(Trained(run.name, part, before + own, chosen, run.seed))
            before += 0 if part.task else own
    return found


def said_side(texts: Sequence[str], contents: Sequence[str]) -> Figures:
    """How often a sentence has the side of a content such as "wave-left-hand", and only that.

    Counts the contents that have one; without any there is no figure.
    """
    sided = [(text, side) for text, content in zip(texts, contents, strict=True) for side in HANDS if side in content]
    right = sum([word for word in HANDS if word in text.split()] == [side] for text, side in sided)
    return {"said_side": right / len(sided)} if sided else {}


@dataclass
class Tested:
    """A split: its motions, what is asked of them, and what was captured."""

    motions: Motions
    crops: list[Crop]
    real: list[Clip]


class Study:
    """Data, tokenizer and judge that all language models of a study share. ``setting.run`` is the tokenizer's run."""

    def __init__(self, setting: Setting):
        self.setting = setting
        self.train = motions_of(setting.run, setting.cache, "train")
        self.store = self.train.store
        self.tokenizer = load_tokenizer(setting.run, self.store)
        self.judge = JUDGE.load(setting.run, self.store)
        self.pieces = Pieces.read(setting.run / PIECES)
        self.splits = {name: self._tested(name) for name in setting.splits}
        self.names = sorted(
            {*self.train.names, *(name for split in self.splits.values() for name in split.motions.names)}, key=str
        )

    def _tested(self, split: str) -> Tested:
        motions = Motions(self.store, self.tokenizer, motions_of(None, self.setting.cache, split).clips)
        if len(motions.clips) < 2:
            raise SystemExit(f"the cache has {len(motions.clips)} clips of the part '{split}': leave it out of --parts")
        crops = whole_crops(motions, self.setting.most)
        return Tested(motions, crops, [captured(motions, crop) for crop in crops])

    def model(self, run: Path, stage: str) -> Model:
        """A language model of the study."""
        return Model(run, self.store, self.setting.sampling, stage=stage)

    def motion(self, split: Tested, clips: list[list[Clip]]) -> Figures:
        """Means over samples: how motions answer their captions."""
        asked = asked_of(split.motions, split.crops, self.setting.seed)
        ids = [self.pieces.ids(one.text) for one in asked]
        real = judged(self.judge, split.real)
        found = [text_figures(self.judge, judged(self.judge, some), real, asked, ids) for some in clips]
        return {m.name: sum(f[m.name] for f in found) / len(found) for m in MOTION}

    def text_to_motion(self, model: Model, split: Tested, flow_steps: int = 0) -> Figures:
        """Motions for captions."""
        asked = asked_of(split.motions, split.crops, self.setting.seed)
        seeds = range(self.setting.seed, self.setting.seed + self.setting.samples)
        return self.motion(split, [generated(model, asked, seed, flow_steps) for seed in seeds])

    def motion_to_text(self, model: Model, split: Tested) -> Figures:
        """Sentences for captured motions."""
        figures, texts = description_figures(model, split.motions, split.crops, self.names)
        contents = [split.motions.names[crop.clip][0] for crop in split.crops]
        said = {"said_content": figures["content"], "said_style": figures["style"]}
        return said | said_side(texts, contents)

    def references(self, split: Tested) -> dict[str, Figures]:
        """The captured motion, and the training clips of the nearest captions."""
        asked = asked_of(split.motions, split.crops, self.setting.seed)
        ids = [self.pieces.ids(one.text) for one in asked]
        seen = [self.pieces.ids(rows[0]) for rows in captions_of(self.train, 1, self.setting.seed + 1)]
        found = retrieved(self.judge, ids, self.train, seen)
        return {CAPTURED: self.motion(split, [split.real]), SEEN: self.motion(split, [found])}

    def stages(self, folder: Path, trained: Sequence[Trained]) -> Report:
        """Figures of every language model, beside the references."""
        report: Report = {name: self.references(split) for name, split in self.splits.items()}
        for one in trained:
            print(f"measuring {one.name}", flush=True)
            model = self.model(folder / one.run, one.part.name)
            for name, split in self.splits.items():
                figures = report[name].setdefault(one.name, {})
                for task in one.tasks:
                    figures |= getattr(self, task)(model, split)
        return report

    def decoders(self, run: Path, stage: str) -> Report:
        """The same tokens by the first stage's decoder, and by the flow decoder if the run has one."""
        model = self.model(run, stage)
        flow = model.networks.flow
        report: Report = {}
        for name, split in self.splits.items():
            for steps in [0, *([self.setting.flow_steps] if flow is not None and self.setting.flow_steps else [])]:
                print(f"measuring {decoder_name(steps)}, {name}", flush=True)
                figures = reconstruction(self.tokenizer, flow, split.motions, split.crops, steps)
                answers = self.text_to_motion(model, split, steps)
                report.setdefault(name, {})[decoder_name(steps)] = figures | answers
        return report


def decoder_name(flow_steps: int) -> str:
    """A decoder's row."""
    return f"flow of {flow_steps} steps" if flow_steps else "first stage"


def tokenizers(folder: Path, runs: Sequence[Planned], setting: Setting) -> tuple[Report, dict[str, Figures]]:
    """Reconstruction by each tokenizer, by split, and its updates and codes in use on the training clips."""
    report: Report = {name: {} for name in setting.splits}
    about: dict[str, Figures] = {}
    store = ClipStore(setting.cache, "train", lengths=())
    for run in runs:
        if not run.tokenizer:
            continue
        print(f"measuring {run.name}", flush=True)
        tokenizer = TOKENIZER.load(folder / run.name, store)
        seen = Motions(store, tokenizer, motions_of(None, setting.cache, "train").clips)
        codes = [seen.codes(crop.start, crop.tokens) for crop in whole_crops(seen)]
        about[run.name] = {"updates": TOKENIZER.read(folder / run.name)["step"], "count": tokenizer.config.codes}
        about[run.name] |= codes_used(codes, tokenizer.config.codes)
        for name in setting.splits:
            motions = Motions(store, tokenizer, motions_of(None, setting.cache, name).clips)
            report[name][run.name] = reconstruction(tokenizer, None, motions, whole_crops(motions, setting.most), 0)
    return report, about


def rows_of(figures: Mapping[str, Figures], trained: Sequence[Trained]) -> dict[str, dict[str, Figure]]:
    """Figures by row: the models of a title in one, with their mean, lowest and highest; references by themselves."""
    names = {one.name for one in trained}
    rows = {
        name: {key: {"mean": value} for key, value in own.items()} for name, own in figures.items() if name not in names
    }
    for title in TITLES.values():
        own = [figures[one.name] for one in trained if one.title == title]
        for measure in MEASURES:
            values = [one[measure.name] for one in own if measure.name in one]
            if values:
                figure = {"mean": sum(values) / len(values), "low": min(values), "high": max(values)}
                rows.setdefault(title, {})[measure.name] = figure
    return rows


def stages_table(figures: Mapping[str, Figures], trained: Sequence[Trained]) -> str:
    """Markdown of one split: a row for each way to train."""
    header = ["", "seeds", "updates", *(m.heading for m in MEASURES)]
    rows = []
    for title, own in rows_of(figures, trained).items():
        models = [one for one in trained if one.title == title]
        updates = sorted({one.updates for one in models})
        updates_text = f"{updates[0]}–{updates[-1]}" if len(updates) > 1 else "".join(map(str, updates))
        seeds = str(len({one.seed for one in models})) if models else ""
        rows.append([title, seeds, updates_text, *(m.cell(own.get(m.name)) for m in MEASURES)])
    return markdown(header, rows)


def decoders_table(figures: Mapping[str, Figures]) -> str:
    """Markdown of one split: a row for each decoder."""
    shown = [
        Measure("mpjpe", "MPJPE (mm) ↓", 1e3, 1),
        Measure("local", "about the root (mm) ↓", 1e3, 1),
        Measure("ade", "root ADE (mm) ↓", 1e3, 1),
        Measure("fde", "root FDE (mm) ↓", 1e3, 1),
        *MOTION,
    ]
    rows = [[name, *(m.cell({"mean": own[m.name]}) for m in shown)] for name, own in figures.items()]
    return markdown(["", *(m.heading for m in shown)], rows)


def tokenizers_table(report: Report, about: Mapping[str, Figures]) -> str:
    """Markdown: reconstruction by quantizer and split, then codes in use on the training clips."""
    rows = {f"{name}, {split}": own for split, methods in report.items() for name, own in methods.items()}
    header = ["", "updates", "codes", "in use on training clips (%)", "perplexity on training clips"]
    codes = [
        [name, f"{f['updates']:.0f}", f"{f['count']:.0f}", f"{100 * f['codes']:.1f}", f"{f['perplexity']:.0f}"]
        for name, f in about.items()
    ]
    return reconstruction_table(rows) + "\n" + markdown(header, codes)


def measure_study(folder: Path, runs: Sequence[Planned], setting: Setting) -> tuple[dict[str, Any], str]:
    """Figures of all runs, and their tables."""
    trained = trained_of(folder, runs)
    report: dict[str, Any] = {"models": {one.name: _about(one) for one in trained}}
    text = ""
    if trained:
        study = Study(setting)
        report["stages"] = study.stages(folder, trained)
        for split, figures in report["stages"].items():
            text += f"\n## Training stages, {split}\n\n{stages_table(figures, trained)}"
        general = next((one for one in trained if one.title == TITLES[INSTRUCT, False]), None)
        if general:
            report["decoders"] = study.decoders(folder / general.run, general.part.name)
            for split, figures in report["decoders"].items():
                text += f"\n## Decoders of {general.name}, {split}\n\n{decoders_table(figures)}"
    if any(run.tokenizer for run in runs):
        report["tokenizers"], report["codes"] = tokenizers(folder, runs, setting)
        text += f"\n## Quantizers\n\n{tokenizers_table(report['tokenizers'], report['codes'])}"
    return report, text


def _about(one: Trained) -> dict[str, Any]:
    return {"row": one.title, "seed": one.seed, "updates": one.updates, "best_update_of_stage": one.best}
