"""Networks to measure: of a training run, in PyTorch, or of an exported pack, in ONNX Runtime."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from troupe_training.data.bodies import Body
from troupe_training.export.manifest import read_manifest
from troupe_training.export.unimogen.kinds import content_hash, files_of
from troupe_training.export.unimogen.pack import FAMILY, FILE, denoiser_of, network_of
from troupe_training.models.unimogen.sampler import Denoiser
from troupe_training.models.unimogen.state import Range
from troupe_training.train.unimogen.stage import Trained, load

SAME_BODY_M = (
    5e-3  # that a pack's bones and its size may differ from the cache's; sizes of animals come from their clips
)


@dataclass
class Network:
    """A network ready to answer. ``bodies`` are a pack's own, as their files tell them; none of a run."""

    general: Denoiser  # the one for all bodies without one of their kind
    words: list[str]
    limits: Range
    source: dict[str, Any]  # "step": its updates; of a pack also "content_hash"
    bodies: dict[str, dict[str, Any]] = field(default_factory=dict)
    kinds: dict[str, Denoiser] = field(default_factory=dict)  # by the names of bodies that have one of their kind

    def denoiser(self, body: Body) -> Denoiser:
        """What moves this body."""
        return self.kinds.get(body.name, self.general)

    def check_body(self, body: Body) -> None:
        """Ends the command if the pack knows a body of this name that is another one."""
        known = self.bodies.get(body.name)
        if known is None:
            return
        joints = known["skeleton"]["joints"]
        offsets = np.array([joint["offset_m"] for joint in joints])
        same = [joint["name"] for joint in joints] == body.skeleton.names
        if same:
            apart = max(abs(offsets - np.array(body.skeleton.offsets)).max(), abs(known["size_m"] - body.size_m))
            same = bool(apart <= SAME_BODY_M)
        if not same:
            raise SystemExit(
                f"the cache's body {body.name} has other joints than the pack's: prepare it from the same motion"
            )


def of_run(trained: Trained) -> Network:
    """A training run's averaged weights, in PyTorch."""
    return Network(network_of(trained.model), trained.words, trained.limits, {"step": trained.state["step"]})


def of_pack(pack: Path, threads: int) -> Network:
    """A pack's networks, in ONNX Runtime; ends the command if a file is not the one that the manifest tells of."""
    manifest = read_manifest(pack)
    if manifest.get("family") != FAMILY.name:
        raise SystemExit(f"{pack} is a pack of the family {manifest.get('family')}, not {FAMILY.name}")
    known = manifest["unimogen"]
    files, digest = files_of(known), content_hash(pack, known)
    if digest != manifest["content_hash"]:
        raise SystemExit(f"{', '.join(files)} of {pack} are not what pack.toml tells of: their hash is {digest}")
    low, high = (torch.tensor(known[key]) for key in ("root_low", "root_high"))
    source = {"step": manifest["training"].get("unimogen_steps", 0), "content_hash": digest}
    bodies = {name: tomllib.loads((pack / "bodies" / f"{name}.toml").read_text()) for name in known["bodies"]}
    denoisers = {file: denoiser_of(pack / file, threads) for file in files}
    kinds = {name: denoisers[file] for file, names in files.items() for name in names}
    return Network(denoisers[FILE], known["words"], Range(low, high), source, bodies, kinds)


def load_network(folder: Path, threads: int) -> Network:
    """The network of a pack's folder, or else of a run's."""
    return of_pack(folder, threads) if (folder / "pack.toml").exists() else of_run(load(folder))
