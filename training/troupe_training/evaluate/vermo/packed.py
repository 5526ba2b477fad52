"""A pack's networks at work in ONNX Runtime, where a run's checkpoints are gone: texts to motions."""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from troupe_training.evaluate.vermo.answers import Answering, Clip
from troupe_training.export.manifest import read_manifest
from troupe_training.export.onnx import Session
from troupe_training.models.vermo.config import LanguageConfig
from troupe_training.models.vermo.messages import Vocabulary
from troupe_training.models.vermo.pieces import Pieces
from troupe_training.models.vermo.sampler import Call, Sampling


@dataclass
class PackLanguage:
    """The language model of a pack."""

    session: Session
    vocabulary: Vocabulary
    config: LanguageConfig

    def served(self) -> Call:
        """The graph itself."""

        def call(tokens: Tensor, count: Tensor, start: Tensor, cache: Tensor) -> tuple[Tensor, Tensor]:
            found = self.session.run({"tokens": tokens, "count": count, "start": start, "cache": cache})
            return found["logits"], found["columns"]

        return call


class PackModel(Answering):
    """A pack, and how it is sampled."""

    def __init__(self, pack: Path, sampling: Sampling, threads: int):
        manifest = read_manifest(pack)
        if manifest["family"] != "vermo":
            raise SystemExit(f"{pack} is a pack of the family {manifest['family']}")
        table = manifest["vermo"]
        vocabulary = Vocabulary(
            table["text_pieces"], table["motion_codes"], table["audio_codes"], manifest["max_tokens"]
        )
        # A graph does not say how many heads its queries have, and its caller need not know.
        config = LanguageConfig(
            width=table["key_heads"] * table["head_width"],
            layers=table["layers"],
            heads=table["key_heads"],
            key_heads=table["key_heads"],
            positions=table["positions"],
        )
        self.steps: dict[str, int] = {k: v for k, v in manifest["training"].items() if k.endswith("_steps")}
        language = PackLanguage(Session(pack / "language.onnx", threads), vocabulary, config)
        super().__init__(language, Pieces.read(pack / "tokenizer.json"), sampling)
        self.decoder = Session(pack / "decoder.onnx", threads)

    def motions(self, codes: list[list[int]], flow_steps: int, seed: int) -> list[Clip]:
        """Motions of codes, by the first stage's decoder."""
        if flow_steps:
            raise SystemExit("--flow-steps: a pack is measured without its flow decoder; measure the --run")
        found = [self.decoder.run({"tokens": torch.tensor([one])}) for one in codes]
        return [Clip(made["pose"][0], made["root"][0]) for made in found]
