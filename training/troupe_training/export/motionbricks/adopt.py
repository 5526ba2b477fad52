"""``adopt``: the networks of a pack as a run's checkpoints, to train on where those are gone, or on other motion.

A pack has no encoder and none of the decoder's outputs that only training reads: both begin with random weights. `refine` then
trains the decoder on what the other two networks predict, see `train.motionbricks.refine`.
"""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from troupe_training.data.store import ClipStore
from troupe_training.export.manifest import read_manifest
from troupe_training.export.weights import weights_of
from troupe_training.models.layers import FrameConv
from troupe_training.models.motionbricks.carried import usual_heights
from troupe_training.models.motionbricks.config import PRESETS, ModelConfig
from troupe_training.models.motionbricks.served import DecoderStage, RootStage
from troupe_training.models.motionbricks.tokenizer import Tokenizer
from troupe_training.train.checkpoints import write_checkpoint
from troupe_training.train.motionbricks.choice import CHOICE
from troupe_training.train.motionbricks.pose import POSE
from troupe_training.train.motionbricks.root import ROOT
from troupe_training.train.motionbricks.tokenizer import TOKENIZER


def find_folded(numbers: dict[str, Tensor], name: str, folded: tuple[int, ...], shape: torch.Size) -> None:
    """Adds a constant that the exporter has reshaped and named itself, if there is just one of that shape."""
    found = [value for value in numbers.values() if value.shape == folded]
    if name not in numbers and len(found) == 1:
        numbers[name] = found[0].reshape(shape)


def find_mean(numbers: dict[str, Tensor], name: str, shape: torch.Size, shipped: nn.Module) -> None:
    """Adds the mean of poses, of which a graph has usual heights and the rest apart, by names of the exporter."""
    named = shipped.state_dict().keys()
    parts = [value for key, value in numbers.items() if value.shape == shape and key not in named]
    if name not in numbers and len(parts) == 2:
        numbers[name] = parts[0] + parts[1]


def adopt_stage(module: nn.Module, numbers: dict[str, Tensor]) -> list[str]:
    """Fills ``module`` with a graph's numbers; the names that the graph lacks."""
    convolutions = {
        f"{name}.weight": m.kernel_size[0] for name, m in module.named_modules() if isinstance(m, FrameConv)
    }
    missing = []
    with torch.no_grad():
        for name, tensor in module.state_dict().items():
            if not tensor.is_floating_point():
                continue  # places, which follow from the sizes
            value = numbers.get(name)
            if value is None:
                missing.append(name)
                continue
            if name in convolutions:  # as `UnrolledConv` lays them out
                value = value.T if value.shape[0] == tensor.shape[0] != value.shape[1] else value
                value = value.unflatten(0, (convolutions[name], -1)).permute(2, 1, 0)
            if value.shape != tensor.shape:
                raise SystemExit(
                    f"{name} has the shape {tuple(value.shape)} in the pack, {tuple(tensor.shape)} in the preset"
                )
            tensor.copy_(value)
    return missing


def adopt(pack: Path, cache: Path, run: Path, preset: str) -> dict[str, list[str]]:
    """Writes the checkpoints ``root``, ``pose``, ``tokenizer`` and, where the pack has one, ``choice``.

    Gives what of each the pack does not have.
    """
    manifest = read_manifest(pack)
    choices = manifest.get("root_choices", 0)
    store, config = ClipStore(cache, "train"), PRESETS[preset]
    config = replace(config, root_choices=choices) if choices else config
    run.mkdir(parents=True, exist_ok=True)
    root, pose, tokenizer = ROOT.build(config, store), POSE.build(config, store), TOKENIZER.build(config, store)
    numbers = weights_of(pack / "root.onnx")
    find_folded(numbers, "module.slots", (1, *root.slots.shape), root.slots.shape)
    choice = CHOICE.build(config, store) if choices else None
    missing = {
        "root": adopt_stage(RootStage(root, choice), numbers),
        "pose": adopt_stage(pose, weights_of(pack / "pose.onnx")),
        "tokenizer": adopt_decoder(tokenizer, weights_of(pack / "decoder.onnx")),
    }
    models = {"root": root, "pose": pose, "tokenizer": tokenizer} | ({CHOICE.name: choice} if choice else {})
    for stage, model in models.items():
        save_adopted(run, stage, model, config, preset, manifest["training"])
    return missing


def adopt_decoder(tokenizer: Tokenizer, numbers: dict[str, Tensor]) -> list[str]:
    """The decoder, codebooks and those rows of the read-out that are served."""
    shipped = DecoderStage(tokenizer)
    book = tokenizer.quantizer.book.shape
    find_folded(numbers, "quantizer.book", (book[0] * book[1], book[2]), book)
    decoder, width = tokenizer.decoder, shipped.widths[0]
    find_mean(numbers, "decoder.pose_scale.mean", decoder.pose_scale.mean.shape, shipped)
    missing = adopt_stage(shipped, numbers)
    rows = shipped.columns
    scale = decoder.pose_scale.std[rows[:width]]
    centre = (decoder.pose_scale.mean - usual_heights(decoder.pose_scale.mean))[rows[:width]]
    weight, bias = shipped.leave.weight.clone(), shipped.leave.bias.clone()
    weight[:width] /= scale[:, None]  # a pack reads out physical units
    bias[:width] = (bias[:width] - centre) / scale
    with torch.no_grad():
        decoder.leave.weight[rows], decoder.leave.bias[rows] = weight, bias
        decoder.carried.trust[:, rows[:width]] = shipped.trust
    return [name for name in missing if not name.startswith("decoder.leave.")]


def save_adopted(
    run: Path, stage: str, model: nn.Module, config: ModelConfig, preset: str, trained: dict[str, Any]
) -> None:
    """A checkpoint with the updates and minutes that the pack's manifest tells of the stage."""
    steps, loss = trained.get(f"{stage}_steps", 0), trained.get(f"{stage}_final_loss")
    # The next manifest reports the refinement of a pack's decoder, also without another one.
    refined = {key: value for key, value in trained.items() if stage == TOKENIZER.name and key.startswith("refine_")}
    write_checkpoint(
        run / f"{stage}.pt",
        {
            "stage": stage,
            "meta": {"model": asdict(config), "preset": preset, "adopted": True, "refined": refined},
            "model": model.state_dict(),
            "average": model.state_dict(),
            "step": steps,
            "seconds": 60.0 * trained.get(f"{stage}_minutes", 0.0),
            "history": [] if loss is None else [{"step": steps, "total": loss}],
        },
    )
