"""``export``: checkpoints -> a model pack: one ONNX file a stage and ``pack.toml``.

Weights are rounded to 16 bits and stored so, each with a Cast node that ONNX Runtime folds away when it loads; inputs and
outputs stay 32-bit. The batch axis is dynamic everywhere, and so is the time axis of the pose stage and the decoder: a
call with 9 tokens and 36 frames costs 9/16 of one with 16 tokens and 64 frames. Every stage is compared with PyTorch, at
several batch sizes and lengths, before the pack is written.
"""

import copy
import hashlib
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_TARGETS
from troupe_training.data.limits import measure
from troupe_training.data.store import ClipStore, SegmentSource
from troupe_training.export.manifest import About, Family, write_limits, write_manifest
from troupe_training.export.motionbricks.examples import Inputs, example_inputs
from troupe_training.export.onnx import Axes, Session, graph_of, largest_of, round_to_half, store_as_half
from troupe_training.models.layers import unroll_convolutions
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, MAX_TOKENS, MIN_TOKENS
from troupe_training.models.motionbricks.served import OUTPUTS, Networks
from troupe_training.train.checkpoints import read_checkpoint
from troupe_training.train.motionbricks.stages import STAGES, load_networks
from troupe_training.train.motionbricks.tokenizer import REFINE, TOKENIZER
from troupe_training.train.plots import plot_curves

FAMILY = Family("motionbricks", ("inbetween", "live"))
OPSET = 20
EXPORTED = (3, 7, 1)  # batch size, tokens, seed
CHECKED = ((1, MIN_TOKENS, 2), (5, 9, 3), (8, 12, 5), (32, MAX_TOKENS, 4))
TOLERANCE = 1e-3
# Read by rows, and not before a product: OpenVINO turns every row that it reads of such a table
# into 32 bits number by number, which takes 25 times as long as to copy it.
STORED_WHOLE = ("trust",)


def export_run(run: Path, cache: Path, out: Path, about: About) -> None:
    """A run's checkpoints as a pack, with what they note of their training, and curves."""
    store = ClipStore(cache, "train")
    networks = load_networks(run, store)
    export_pack(out, replace(about, training=_training(run, store)), store, networks)
    write_limits(out / "pack.toml", measure(cache))
    plot_curves(run, STAGES, out / "curves.png")  # none after a handful of updates, or where all stages are adopted


def _training(run: Path, store: ClipStore) -> dict[str, Any]:
    """Clips, and the updates, minutes and last loss of each stage."""
    seen = [c for c in store.clips if not c.get("mirrored")]
    training: dict[str, Any] = {"clips": len(seen), "frames": sum(c["frames"] for c in seen)}
    if len(seen) < len(store.clips):
        training["mirrored"] = True
    for stage in STAGES:
        path = run / f"{stage}.pt"
        if path.exists():
            state = read_checkpoint(path)
            training[f"{stage}_steps"] = state["step"]
            training[f"{stage}_minutes"] = round(state["seconds"] / 60, 1)
            if state["history"]:
                training[f"{stage}_final_loss"] = state["history"][-1]["total"]
        elif stage == REFINE.name:
            training |= TOKENIZER.read(run)["meta"].get("refined", {})
    return training


def export_pack(out: Path, about: About, store: SegmentSource, networks: Networks) -> None:
    """Writes the pack folder and fails if a stage differs from PyTorch by more than `TOLERANCE`."""
    fresh = out.with_name(out.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    stages, pose = networks.stages(), networks.pose
    choices = networks.root_choices
    example, *checked = (example_inputs(store, pose, *size, choices) for size in (EXPORTED, *CHECKED))
    checks = {}
    for name, stage in stages.items():
        stage.eval().requires_grad_(False)
        exact = copy.deepcopy(stage)
        round_to_half(stage)
        export_stage(name, stage, example[name], fresh / f"{name}.onnx")
        checks[name] = check_stage(name, stage, exact, checked, fresh / f"{name}.onnx")
    parameters = networks.parameters()
    sizes = {
        "frames_per_token": FRAMES_PER_TOKEN,
        "min_tokens": MIN_TOKENS,
        "max_tokens": MAX_TOKENS,
        "heads": pose.heads,
        "codes": pose.codes,
        "context_frames": CONTEXT_FRAMES,
        "max_targets": MAX_TARGETS,
        **({"root_choices": choices} if choices else {}),
        "parameters": sum(parameters[name] for name in stages) + networks.tokenizer.quantizer.book.numel(),
    }
    write_manifest(fresh, FAMILY, about, sizes, digest_of(fresh, list(stages)), store.skeleton, checks)
    settle(fresh, out)


def digest_of(pack: Path, stages: list[str]) -> str:
    """SHA-256 of a pack's ONNX files, in the order of the stages."""
    digest = hashlib.sha256()
    for name in stages:
        with (pack / f"{name}.onnx").open("rb") as file:
            while chunk := file.read(1 << 20):
                digest.update(chunk)
    return digest.hexdigest()


def settle(fresh: Path, out: Path) -> None:
    """Moves the files of a pack over those of the one before, which stays if an export fails."""
    out.mkdir(parents=True, exist_ok=True)
    for path in fresh.iterdir():
        path.replace(out / path.name)
    fresh.rmdir()


def open_axes(inputs: Inputs, min_tokens: int = MIN_TOKENS) -> list[Axes]:
    """The dynamic axes of each input: the batch, and time where the stage reads tokens."""
    batch = torch.export.Dim("batch", min=1, max=4096)
    if "tokens" not in inputs:
        return [{0: batch} for _ in inputs]
    tokens = torch.export.Dim("tokens", min=min_tokens, max=MAX_TOKENS)
    axes: dict[str, Axes] = {"tokens": {0: batch, 1: tokens}, "num_tokens": {0: batch}}
    return [axes.get(name, {0: batch, 1: FRAMES_PER_TOKEN * tokens}) for name in inputs]


def export_stage(name: str, stage: nn.Module, inputs: Inputs, path: Path) -> None:
    """Writes one ONNX file with the dynamic axes of `open_axes`."""
    shipped = copy.deepcopy(stage)
    unroll_convolutions(shipped)
    model = graph_of(shipped, inputs, OUTPUTS[name], open_axes(inputs), OPSET)
    store_as_half(model, STORED_WHOLE)
    model.doc_string = f"Troupe {name} stage"
    onnx.checker.check_model(model)
    onnx.save(model, path)


def check_stage(name: str, stage: nn.Module, exact: nn.Module, examples: list[dict[str, Inputs]], path: Path) -> float:
    """The largest difference between a file and PyTorch; too large a one ends the export.

    ``exact`` is the stage before its weights were rounded to 16 bits: what that makes is printed.
    """
    worst, rounding = 0.0, 0.0
    for example in examples:
        inputs, lengths = example[name], example["pose"]["num_tokens"]
        with torch.no_grad():
            rounded, unrounded = (_last(module(*inputs.values())) for module in (stage, exact))
            if name == "root":
                lengths = stage(*inputs.values())[0]
        worst = max(worst, largest_difference(path, stage, inputs, lengths))
        rounding = max(rounding, float((rounded[0] - unrounded[0]).abs().mean()))
    size = path.stat().st_size / 1e6
    print(
        f"{name}.onnx: {size:.1f} MB, differs from PyTorch by at most {worst:.1e}, and by 16-bit weights "
        f"{rounding:.1e} in the mean"
    )
    if worst > TOLERANCE:
        raise SystemExit(f"{name}.onnx differs from PyTorch by {worst:.1e}, at most {TOLERANCE} is allowed")
    return worst


def _last(outputs: Tensor | tuple[Tensor, ...]) -> Tensor:
    """A stage's last output: root, logits, contacts."""
    return outputs[-1] if isinstance(outputs, tuple) else outputs


def largest_difference(path: Path, stage: nn.Module, inputs: Inputs, lengths: Tensor) -> float:
    """Largest absolute difference between ONNX Runtime and PyTorch over all outputs, frames past the end left out.

    ``lengths`` ``[B]`` are the segments' tokens.
    """
    with torch.no_grad():
        expected = stage(*inputs.values())
    expected = expected if isinstance(expected, tuple) else (expected,)
    actual = Session(path).run(inputs).values()
    slots = inputs["tokens"].shape[1] if "tokens" in inputs else MAX_TOKENS
    worst = 0.0
    for a, e in zip(actual, expected, strict=True):
        difference = (a - e).abs()
        if difference.dim() >= 3:  # the second axis is time, in tokens or frames
            steps = difference.shape[1]
            difference = difference[torch.arange(steps)[None] < lengths[:, None] * (steps // slots)]
        worst = max(worst, largest_of(difference))
    return worst
