"""The judge's training: contents, styles, and captions drawn to their motions, on the train split alone."""

import random
from dataclasses import asdict, dataclass

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from troupe_training.data.captions import caption
from troupe_training.data.facts import contents_and_styles
from troupe_training.data.store import ClipStore
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.judge import Judge, JudgeConfig
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.train.checkpoints import Stage
from troupe_training.train.trainer import Job, Loss
from troupe_training.train.vermo.corpus import Crop, MessageSource, Motions
from troupe_training.train.vermo.language import PIECES, motions_of
from troupe_training.train.vermo.tokenizer import CROPS, set_scale

MOST_TOKENS = 64
NO_STYLE = "none"


@dataclass
class Shown:
    """Motions side by side, padded with their last frame, and what they show."""

    pose: Tensor  # [B, F, 9 J]
    root: Tensor  # [B, F, 5]
    tokens: Tensor  # [B]


def shown(motions: Motions, crops: list[Crop]) -> Shown:
    """The frames of crops."""
    longest = max(crop.tokens for crop in crops) * RATE
    poses, roots = [], []
    for crop in crops:
        one = motions.store.segments(torch.tensor([crop.start]), crop.tokens * RATE)
        missing = longest - crop.tokens * RATE
        poses.append(torch.cat([one.pose[0], one.pose[0, -1:].expand(missing, -1)]))
        roots.append(torch.cat([one.global_root[0], one.global_root[0, -1:].expand(missing, -1)]))
    return Shown(torch.stack(poses), torch.stack(roots), torch.tensor([crop.tokens for crop in crops]))


def build_judge(config: JudgeConfig, store: ClipStore) -> Judge:
    """A new judge, whose standardisation constants are not set."""
    return Judge(config, store.skeleton.joint_count).to(store.device)


def config_of(contents: list[str], styles: list[str], **sizes: int) -> JudgeConfig:
    """Sizes as a checkpoint notes them."""
    return JudgeConfig(tuple(contents), tuple(styles), **sizes)


STAGE = Stage("judge", config_of, build_judge)


def judge_loss(source: MessageSource, frames: int) -> Loss[Judge]:
    """Cross-entropy of contents and styles, and of captions against motions; all of a cell count as one another's."""
    motions = source.motions

    def loss(model: Judge, generator: Generator, progress: float) -> dict[str, Tensor]:
        rng = random.Random(int(torch.randint(2**31, (1,), generator=generator)))
        crops: list[Crop] = []
        while sum(crop.tokens * RATE for crop in crops) < frames:
            crops.append(motions.crop(source.clip(rng), rng, MOST_TOKENS))
        some = shown(motions, crops)
        names = [motions.names[crop.clip] for crop in crops]
        contents = torch.tensor([model.config.contents.index(content) for content, _ in names])
        styles = torch.tensor([model.config.styles.index(style or NO_STYLE) for _, style in names])
        texts = [source.pieces.ids(caption(motions.facts(crop), rng.getrandbits(32))) for crop in crops]
        hidden = model.read(some.pose, some.root, some.tokens)
        near = (model.motions(hidden) @ model.captions(texts).T).float() * model.sharpness.exp()
        alike = (contents[:, None] == contents) & (styles[:, None] == styles)
        wanted = alike.float() / alike.sum(-1, keepdim=True)
        return {
            "content": F.cross_entropy(model.content(hidden).float(), contents),
            "style": F.cross_entropy(model.style(hidden).float(), styles),
            "pairs": 0.5 * (F.cross_entropy(near, wanted) + F.cross_entropy(near.T, wanted.T)),
        }

    return loss


def train_judge(job: Job) -> bool:
    """Trains the judge, resuming its checkpoint; true when the budget is spent."""
    torch.manual_seed(job.seed)
    pieces = Pieces.read(job.run / PIECES)
    motions = motions_of(None, job.cache, "train")
    contents, styles = contents_and_styles(motions.names)
    config = JudgeConfig(tuple(contents), (NO_STYLE, *styles), pieces.count)
    model = build_judge(config, motions.store)
    set_scale(model.scale, ClipStore(job.cache, "train", lengths=CROPS))
    meta = {"model": asdict(config) | {"contents": list(config.contents), "styles": list(config.styles)}}
    return job.fit(STAGE.name, model, meta, judge_loss(MessageSource(motions, pieces, {}), job.frames_per_step))
