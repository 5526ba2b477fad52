"""``vermo evaluate``: the parts of the evaluation, each a table beside its baselines."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from troupe_training.evaluate import bench
from troupe_training.evaluate.bench import Latents
from troupe_training.evaluate.vermo.answers import Answering, Clip, Model, captured
from troupe_training.evaluate.vermo.continuation import (
    SPLITS,
    Method,
    Window,
    answered,
    continuation_table,
    figures_of,
    interpolated,
    joined,
    last_velocity,
    on_way,
    windows_of,
)
from troupe_training.evaluate.vermo.motionbricks import of_pack
from troupe_training.evaluate.vermo.nearest import nearest, nearest_table, training_windows
from troupe_training.evaluate.vermo.nearest import windows_of as motion_windows
from troupe_training.evaluate.vermo.packed import PackModel
from troupe_training.evaluate.vermo.reconstruction import reconstruction, reconstruction_table, whole_crops
from troupe_training.evaluate.vermo.text import (
    asked_of,
    description_figures,
    description_table,
    generated,
    judged,
    multimodality,
    retrieved,
    text_figures,
    text_table,
)
from troupe_training.export.vermo.graphs import Networks
from troupe_training.export.vermo.run import steps_of
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.judge import Judge
from troupe_training.models.vermo.sampler import Sampling
from troupe_training.train.vermo.corpus import Motions, captions_of
from troupe_training.train.vermo.judge import STAGE as JUDGE
from troupe_training.train.vermo.language import latest_stage, motions_of

PARTS = ("reconstruction", "continuation", "text", "description", "nearest")
NEAREST_WINDOWS = 8  # frames between a sample's windows
MULTIMODAL = (20, 5)  # captions, and motions for each


@dataclass
class Setting:
    """The setting of a measurement."""

    run: Path
    cache: Path
    splits: list[str]
    sampling: Sampling
    most: int | None = None  # clips or windows of a split
    samples: int = 4  # of each window, for diversity
    flow_steps: int = 0  # of the flow decoder in all but the reconstruction; 0: the first stage's decoder
    seed: int = 1
    evaluator: Path | None = None  # evaluator.onnx, for the FID of continuations
    task: str | None = None  # the specialist to measure
    motionbricks: Path | None = None  # pack that fills the same gaps
    pack: Path | None = None  # to measure instead of the run's networks; the judge is the run's


class Measured:
    """Networks and data of a setting, and its parts."""

    def __init__(self, setting: Setting):
        self.setting = setting
        run = None if setting.pack else setting.run
        train = motions_of(run, setting.cache, "train")
        self.model: Answering
        if setting.pack is None:
            self.model = Model(setting.run, train.store, setting.sampling, setting.task)
            self.steps = steps_of(setting.run, latest_stage(setting.run, setting.task))
        else:
            packed = PackModel(setting.pack, setting.sampling, torch.get_num_threads())
            self.model, self.steps = packed, packed.steps
        tokenizer = self.model.networks.tokenizer if isinstance(self.model, Model) else None
        self.train = Motions(train.store, tokenizer, train.clips)
        self.splits = {
            name: Motions(train.store, tokenizer, motions_of(None, setting.cache, name).clips)
            for name in setting.splits
        }

    @property
    def trained(self) -> tuple[Model, Networks]:
        """The run's model and its networks; ends the command if a pack is measured."""
        if not isinstance(self.model, Model):
            raise SystemExit(
                "--pack: only the part text can be measured of a pack; the others need the checkpoints of --run"
            )
        return self.model, self.model.networks

    def judge(self) -> Judge:
        """The run's judge."""
        return JUDGE.load(self.setting.run, self.train.store)

    def reconstruction(self) -> tuple[dict[str, Any], str]:
        """Captured motion to tokens and back, by both decoders."""
        figures = {}
        _, networks = self.trained
        steps = [0] + ([4, 28] if networks.flow is not None else [])
        for split, motions in self.splits.items():
            crops = whole_crops(motions, self.setting.most)
            for count in steps:
                name = f"{split}, flow of {count} steps" if count else f"{split}, first stage"
                figures[name] = reconstruction(networks.tokenizer, networks.flow, motions, crops, count)
        return figures, reconstruction_table(figures)

    def continuation(self) -> tuple[dict[str, Any], str]:
        """Prediction and in-between beside simple baselines."""
        setting = self.setting
        model, networks = self.trained
        body = networks.tokenizer.body
        encode = Latents(setting.evaluator, 1).of if setting.evaluator else None
        figures = {}
        for split, motions in self.splits.items():
            for task in SPLITS:
                windows = windows_of(motions, task, setting.most or len(motions.clips))
                if len(windows) < 2:
                    continue
                simple: dict[str, Method] = {"last velocity": last_velocity(body)}
                if task == "inbetween":
                    simple["interpolated"] = interpolated(body)
                for name, method in simple.items():
                    figures[f"{task}, {split}: {name}"] = figures_of(windows, [[method(w, 0) for w in windows]], encode)
                seeds = range(setting.seed, setting.seed + setting.samples)
                samples = [answered(model, motions, task, windows, seed, setting.flow_steps) for seed in seeds]
                figures[f"{task}, {split}: vermo"] = figures_of(windows, samples, encode)
                if task == "inbetween":
                    closed = [[joined(c, w) for c, w in zip(clips, windows, strict=True)] for clips in samples]
                    figures[f"{task}, {split}: vermo, joined"] = figures_of(windows, closed, encode)
                    for name, filled in self.motionbricks(motions, windows).items():
                        figures[f"{task}, {split}: {name}"] = figures_of(windows, filled, encode)
                        if name == "motionbricks":
                            placed = [
                                [on_way(c, w) for c, w in zip(clips, filled[0], strict=True)] for clips in samples
                            ]
                            figures[f"{task}, {split}: vermo, root of {name}"] = figures_of(windows, placed, encode)
        return figures, continuation_table(figures)

    def motionbricks(self, motions: Motions, windows: list[Window]) -> dict[str, list[list[Clip]]]:
        """Gaps as the pack beside fills them, with the likeliest codes and with drawn codes; empty without such a pack."""
        setting = self.setting
        if setting.motionbricks is None:
            return {}
        fill = of_pack(setting.motionbricks, self.train.store.skeleton, torch.get_num_threads())
        seeds = range(setting.seed, setting.seed + setting.samples)
        drawn = [fill(motions, windows, bench.Sampling(temperature=1.0, seed=seed)) for seed in seeds]
        return {"motionbricks": [fill(motions, windows, bench.Sampling())], "motionbricks, drawn": drawn}

    def text(self) -> tuple[dict[str, Any], str]:
        """Text to motion beside captured motion, and beside the nearest training caption's clip."""
        setting, judge, pieces = self.setting, self.judge(), self.model.pieces
        seen = [pieces.ids(rows[0]) for rows in captions_of(self.train, 1, setting.seed + 1)]
        figures = {}
        for split, motions in self.splits.items():
            asked = asked_of(motions, whole_crops(motions, setting.most), setting.seed)
            ids = [pieces.ids(one.text) for one in asked]
            real = judged(judge, [captured(motions, one.crop) for one in asked])
            found = judged(judge, retrieved(judge, ids, self.train, seen))
            figures[f"{split}: captured"] = text_figures(judge, real, real, asked, ids)
            captions, each = MULTIMODAL
            some = asked[:: max(1, len(asked) // captions)][:captions]
            made = judged(judge, generated(self.model, asked, setting.seed, setting.flow_steps))
            figures[f"{split}: vermo"] = text_figures(judge, made, real, asked, ids)
            figures[f"{split}: vermo"]["multimodality"] = multimodality(
                judge, self.model, some, each, setting.flow_steps
            )
            figures[f"{split}: nearest seen caption"] = text_figures(judge, found, real, asked, ids)
        return figures, text_table(figures)

    def description(self) -> tuple[dict[str, Any], str]:
        """Motion to text."""
        figures = {}
        names = sorted({*self.train.names, *(n for m in self.splits.values() for n in m.names)}, key=str)
        for split, motions in self.splits.items():
            crops = whole_crops(motions, self.setting.most)
            figures[split], _ = description_figures(self.trained[0], motions, crops, names)
        return figures, description_table(figures)

    def nearest(self) -> tuple[dict[str, Any], str]:
        """How near samples and captures of the splits are to training clips."""
        setting, training = self.setting, training_windows(self.train)
        figures = {}
        for split, motions in self.splits.items():
            asked = asked_of(motions, whole_crops(motions, setting.most), setting.seed)
            asked = [one for one in asked if one.crop.tokens >= max(8, 32 // RATE)]
            for name, clips in (
                ("captured", [captured(motions, one.crop) for one in asked]),
                ("vermo", generated(self.model, asked, setting.seed, setting.flow_steps)),
            ):
                distance = nearest(torch.cat([motion_windows(clip, NEAREST_WINDOWS) for clip in clips]), training)
                figures[f"{split}: {name}"] = {
                    "median": float(distance.median()),
                    "tenth": float(distance.quantile(0.1)),
                    "mean": float(distance.mean()),
                }
        return figures, nearest_table(figures)


def measure(setting: Setting, parts: list[str]) -> tuple[dict[str, Any], str]:
    """How far the networks are, figures of the parts; tables."""
    measured = Measured(setting)
    figures, tables = {}, []
    for part in parts:
        figures[part], table = getattr(measured, part)()
        print(table, flush=True)
        tables.append(f"{part}\n\n{table}")
    return {"steps": measured.steps, "figures": figures}, "\n".join(tables)
