"""``unimogen adopt``: the network of a pack as a run's checkpoint, to train on from it, also at greater width."""

from dataclasses import asdict
from pathlib import Path

import torch
from torch import Tensor

from troupe_training.export.manifest import read_manifest
from troupe_training.export.unimogen.kinds import file_of, files_of
from troupe_training.export.unimogen.pack import FAMILY, FILE
from troupe_training.export.weights import weights_of
from troupe_training.models.unimogen.config import DIFFUSION_STEPS, UniMoGenConfig
from troupe_training.models.unimogen.grow import grown
from troupe_training.models.unimogen.network import JointAttention, UniMoGen
from troupe_training.train.checkpoints import write_checkpoint
from troupe_training.train.unimogen.stage import STAGE


def adopt(pack: Path, run: Path, config: UniMoGenConfig | None, kind: str | None = None) -> UniMoGen:
    """Writes a checkpoint with a pack's network for all bodies, or that of a kind, grown to the sizes ``config`` if given.

    It has no optimiser yet, and a new learning-rate schedule begins there. Ends the command if the run has a checkpoint
    already, or if the pack has no network of that kind.
    """
    path = run / f"{STAGE}.pt"
    if path.exists():
        raise SystemExit(f"{path} exists: give another --run")
    manifest = read_manifest(pack)
    if manifest.get("family") != FAMILY.name:
        raise SystemExit(f"{pack} is a pack of the family {manifest.get('family')}, not {FAMILY.name}")
    family, training = manifest["unimogen"], manifest["training"]
    bodies = family.get("kinds", {}).get(kind, []) if kind else family["bodies"]
    if not bodies:
        raise SystemExit(f"{pack} has no network for {kind}: it has {', '.join(files_of(family))}")
    model = network_in(pack / (file_of(kind) if kind else FILE), len(family["words"]))
    torch.manual_seed(0)  # new weights of a grown network
    model = grown(model, config) if config else model
    name = kind or "unimogen"
    step, seconds = training.get(f"{name}_steps", 0), 60.0 * training.get(f"{name}_minutes", 0.0)
    loss = training.get(f"{name}_final_loss")
    run.mkdir(parents=True, exist_ok=True)
    write_checkpoint(
        path,
        {
            "stage": STAGE,
            "meta": {
                "model": asdict(model.config),
                "words": family["words"],
                "bodies": bodies,
                "range": [family["root_low"], family["root_high"]],
            },
            "model": model.state_dict(),
            "average": model.state_dict(),
            "step": step,
            "seconds": seconds,
            "history": [] if loss is None else [{"step": step, "total": loss}],
            "schedule_step": step,
            "schedule_seconds": seconds,
        },
    )
    return model


def network_in(path: Path, words: int) -> UniMoGen:
    """The network of a pack's ONNX file; ends the command if a weight is missing."""
    numbers = weights_of(path)
    model = UniMoGen(sizes_of(numbers), words)
    numbers |= unnamed(model, numbers)
    missing = [name for name in model.state_dict() if name not in numbers]
    if missing:
        raise SystemExit(f"{path} has no {', '.join(missing)}: `unimogen export` of another version wrote it")
    model.load_state_dict({name: numbers[name].reshape(value.shape) for name, value in model.state_dict().items()})
    return model


def sizes_of(numbers: dict[str, Tensor]) -> UniMoGenConfig:
    """The sizes of a network with these weights. Networks of an ablation have others and are not adopted."""
    blocks = {name.split(".")[1] for name in numbers if name.startswith("deep_in.")}
    heads = next(value.shape[-1] for value in numbers.values() if value.dim() == 4)
    channels, condition = len(numbers["joint_in.bias"]), len(numbers["step.0.bias"])
    return UniMoGenConfig(channels, condition, len(numbers["tokens.0.bias"]), heads, len(blocks))


def unnamed(model: UniMoGen, numbers: dict[str, Tensor]) -> dict[str, Tensor]:
    """Weights that the exporter has reshaped and named itself, by their shapes, in the order of the graph."""
    attentions = [name for name, module in model.named_modules() if isinstance(module, JointAttention)]
    biases = [value[0, :, 0] for value in numbers.values() if value.dim() == 4]
    shares = model.carried.shares.shape[1:]
    found = {f"{name}.slot_bias": bias for name, bias in zip(attentions, biases, strict=True)}
    found["carried.shares"] = torch.stack([v for v in numbers.values() if v.shape == shares])
    found["carried.seen"] = next(v for v in numbers.values() if v.shape == (DIFFUSION_STEPS,))
    return found
