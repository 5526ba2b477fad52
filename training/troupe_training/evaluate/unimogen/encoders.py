"""Evaluators of packs, by the body that they know: what FID and classifiers of styles are measured in."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from torch import Tensor

from troupe_training.data.bodies import Body
from troupe_training.evaluate.bench import Latents
from troupe_training.export.manifest import read_manifest

# `Latents.of`: roots, positions, rotations to latents.
Encoder = Callable[[Tensor, Tensor, Tensor], np.ndarray]


def encoder_of(packs: Path, body: Body, threads: int) -> tuple[Encoder | None, str]:
    """The evaluator of the pack that has the body's name and joints; or none, and why."""
    pack = packs / body.name
    path = pack / "evaluator.onnx"
    if not path.exists():
        return None, f"no evaluator knows the skeleton of {body.name} ({path} does not exist)"
    if (pack / "pack.toml").exists():
        joints = [joint["name"] for joint in read_manifest(pack)["skeleton"]["joints"]]
        if joints != body.skeleton.names:
            return None, f"the evaluator of {pack} knows other joints than {body.name} has"
    return Latents(path, threads).of, ""
