"""``export``: checkpoints -> a model pack: one ONNX file a stage and ``pack.toml``.

Weights are rounded to 16 bits and stored so, each with a Cast node that ONNX Runtime folds away when it loads; inputs and
outputs stay 32-bit. The batch axis is dynamic everywhere, and so is the time axis of the pose stage and the decoder: a
call with 9 tokens and 36 frames costs 9/16 of one with 16 tokens and 64 frames. Every stage is compared with PyTorch, at
several batch sizes and lengths, before the pack is written.
"""

import copy
import hashlib
import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from troupe_training.config import (
    CONTEXT_FRAMES,
    COUNTS,
    FPS,
    FRAMES_PER_TOKEN,
    MAX_TARGETS,
    MAX_TOKENS,
    MIN_TOKENS,
    SLOTS,
    ModelConfig,
)
from troupe_training.features import ClipStore, random_keyframe_mask, slot_frames
from troupe_training.layers import unroll_convolutions
from troupe_training.pose_module import PoseModule
from troupe_training.root_module import RootModule, RootStage
from troupe_training.skeleton import Skeleton
from troupe_training.tokenizer import DecoderStage, Tokenizer

OPSET = 20
CHECKED = ((1, MIN_TOKENS, 2), (5, 9, 3), (8, 12, 5), (32, MAX_TOKENS, 4))  # batch size, tokens, seed
TOLERANCE = 1e-3
SMALLEST_HALF = 256  # tensors with fewer numbers stay in 32 bits
# Read by rows, and not before a product: OpenVINO turns every row that it reads of such a table into 32 bits number by number,
# which takes 25 times as long as to copy it.
STORED_WHOLE = ("trust",)

ROOT_OUTPUTS = ["num_tokens", "count_probs", "global_root"]
POSE_OUTPUTS = ["logits"]
DECODER_OUTPUTS = ["rotations", "refined_root", "contacts"]


def round_to_half(module: nn.Module) -> None:
    """Rounds every large weight to the nearest 16-bit float: what is checked is what is shipped."""
    with torch.no_grad():
        for tensor in list(module.parameters()) + list(module.buffers()):
            if tensor.is_floating_point() and tensor.numel() >= SMALLEST_HALF:
                tensor.copy_(tensor.half().float())


def store_as_half(model: onnx.ModelProto) -> None:
    """Replaces large 32-bit initializers by 16-bit ones followed by a Cast, save `STORED_WHOLE`."""
    casts = []
    for tensor in model.graph.initializer:
        name, small = tensor.name, np.prod(tensor.dims) < SMALLEST_HALF
        if tensor.data_type != TensorProto.FLOAT or small or name in STORED_WHOLE:
            continue
        half = numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float16), name + ".half")
        tensor.CopyFrom(half)
        casts.append(helper.make_node("Cast", [name + ".half"], [name], to=TensorProto.FLOAT))
    nodes = casts + list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    del model.graph.value_info[:]


def example_inputs(
    store: ClipStore, config: ModelConfig, batch: int, slots: int, seed: int
) -> dict[str, dict[str, torch.Tensor]]:
    """Real segments of up to ``slots`` tokens, padded to ``slots`` as the server pads them, as inputs for each stage."""
    generator = torch.Generator().manual_seed(seed)
    joints, padded_frames = store.skeleton.joint_count, slots * FRAMES_PER_TOKEN
    fitting = [length for length in store.lengths() if length <= slots]
    lengths = [fitting[int(i)] for i in torch.randint(len(fitting), (batch,), generator=generator)]
    pad = {"pose": joints * 9, "root": 5}
    frame_pose, roots = (
        torch.zeros(batch, padded_frames, pad["pose"]),
        torch.zeros(batch, padded_frames, pad["root"]),
    )
    mask = torch.zeros(batch, padded_frames)
    keys = {"local": torch.zeros(batch, SLOTS, 4), "global": torch.zeros(batch, SLOTS, 5)}
    key_pose = torch.zeros(batch, SLOTS, pad["pose"])
    for row, tokens in enumerate(lengths):
        segment = store.batch(1, generator, tokens)
        frames = segment.frames
        mask[row, :frames] = random_keyframe_mask(2, frames, generator)[0]
        frame_pose[row, :frames] = segment.pose[0] * mask[row, :frames, None]
        roots[row, :frames] = segment.global_root[0]
        index = slot_frames(frames)
        keys["local"][row], keys["global"][row] = segment.local_root[0, index], segment.global_root[0, index]
        key_pose[row] = segment.pose[0, index]
    given = {}
    for kind in ("local", "global", "pose"):
        given[kind] = torch.ones(batch, SLOTS)
        given[kind][:, CONTEXT_FRAMES:] = (torch.rand(batch, MAX_TARGETS, generator=generator) < 0.5).float()
    allowed = (torch.rand(batch, COUNTS, generator=generator) < 0.5).float()
    allowed[torch.arange(batch), num_tokens_of(lengths)] = 1.0
    allowed[: batch // 3] = torch.nn.functional.one_hot(num_tokens_of(lengths)[: batch // 3], COUNTS).float()
    num_tokens = torch.tensor(lengths)
    tokens = torch.randint(config.codes, (batch, slots, config.heads), generator=generator)
    segment_inputs = {
        "num_tokens": num_tokens,
        "global_root": roots,
        "frame_pose": frame_pose,
        "frame_mask": mask,
    }
    return {
        "root": {
            "key_local_root": keys["local"] * given["local"][..., None],
            "key_global_root": keys["global"] * given["global"][..., None],
            "key_pose": key_pose * given["pose"][..., None],
            "has_local_root": given["local"],
            "has_global_root": given["global"],
            "has_pose": given["pose"],
            "allowed_counts": allowed,
            "count_noise": torch.randn(batch, COUNTS, generator=generator),
        },
        "pose": {"tokens": torch.full_like(tokens, config.codes)} | segment_inputs,
        "decoder": {"tokens": tokens} | segment_inputs,
    }


def num_tokens_of(lengths: list[int]) -> torch.Tensor:
    """Index of each token count among the counts 3 to 16."""
    return torch.tensor(lengths) - MIN_TOKENS


def open_axes(inputs: dict[str, torch.Tensor]) -> list[dict[int, torch.export.Dim]]:
    """The dynamic axes of each input: the batch, and time where the stage reads tokens."""
    batch = torch.export.Dim("batch", min=1, max=4096)
    if "tokens" not in inputs:
        return [{0: batch} for _ in inputs]
    tokens = torch.export.Dim("tokens", min=MIN_TOKENS, max=MAX_TOKENS)
    frames = FRAMES_PER_TOKEN * tokens
    axes = {"tokens": {0: batch, 1: tokens}, "num_tokens": {0: batch}}
    return [axes.get(name, {0: batch, 1: frames}) for name in inputs]


def export_stage(
    name: str, module: nn.Module, inputs: dict[str, torch.Tensor], outputs: list[str], path: Path
) -> None:
    """Writes one ONNX file with the dynamic axes of `open_axes`."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "stage.onnx"
        torch.onnx.export(
            module,
            tuple(inputs.values()),
            raw,
            input_names=list(inputs),
            output_names=outputs,
            dynamic_shapes=open_axes(inputs),
            opset_version=OPSET,
            dynamo=True,
            external_data=False,
            verbose=False,
        )
        model = onnx.load(raw)
    store_as_half(model)
    model.doc_string = f"Troupe {name} stage"
    for node in model.graph.node:
        node.doc_string = ""
        del node.metadata_props[:]
    onnx.checker.check_model(model)
    onnx.save(model, path)


def largest_difference(
    path: Path, module: nn.Module, inputs: dict[str, torch.Tensor], lengths: torch.Tensor
) -> float:
    """Largest absolute difference between ONNX Runtime and PyTorch over all outputs, frames past the end left out."""
    with torch.no_grad():
        expected = module(*inputs.values())
    expected = expected if isinstance(expected, tuple) else (expected,)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    actual = session.run(None, {name: value.numpy() for name, value in inputs.items()})
    slots = inputs["tokens"].shape[1] if "tokens" in inputs else MAX_TOKENS
    worst = 0.0
    for a, e in zip(actual, expected, strict=True):
        difference = np.abs(a - e.numpy())
        if difference.ndim >= 3:  # the second axis is time, in tokens or frames
            per_token = difference.shape[1] // slots
            steps = np.arange(difference.shape[1])[None] < lengths.numpy()[:, None] * per_token
            difference = difference[steps]
        worst = max(worst, float(difference.max()))
    return worst


def mean_difference(module: nn.Module, exact: nn.Module, inputs: dict[str, torch.Tensor]) -> float:
    """Mean absolute difference of the last output (root, logits, contacts) that 16-bit weights make."""
    with torch.no_grad():
        outputs = [m(*inputs.values()) for m in (module, exact)]
    last = [o[-1] if isinstance(o, tuple) else o for o in outputs]
    return float((last[0] - last[1]).abs().mean())


def export_pack(
    out: Path,
    name: str,
    version: str,
    config: ModelConfig,
    store: ClipStore,
    tokenizer: Tokenizer,
    root: RootModule,
    pose: PoseModule,
    about: dict,
) -> None:
    """Writes the pack folder and fails where a stage differs from PyTorch by more than `TOLERANCE`."""
    stages = {
        "root": (RootStage(root), ROOT_OUTPUTS),
        "pose": (pose, POSE_OUTPUTS),
        "decoder": (DecoderStage(tokenizer), DECODER_OUTPUTS),
    }
    fresh = Path(out).with_name(Path(out).name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    checks = {
        stage: _export_checked(stage, module, outputs, fresh, config, store)
        for stage, (module, outputs) in stages.items()
    }
    digest = hashlib.sha256()
    for stage in stages:
        digest.update((fresh / f"{stage}.onnx").read_bytes())
    modules = (tokenizer.decoder, root, pose)
    parameters = sum(t.numel() for m in modules for t in m.parameters()) + tokenizer.quantizer.book.numel()
    about = about | {"onnx_check": checks}
    write_manifest(fresh, name, version, config, store.skeleton, parameters, digest.hexdigest(), about)
    Path(out).mkdir(parents=True, exist_ok=True)
    for path in fresh.iterdir():  # only a pack that passed replaces the one before
        path.replace(Path(out) / path.name)
    fresh.rmdir()


def _export_checked(
    stage: str, module: nn.Module, outputs: list[str], folder: Path, config: ModelConfig, store: ClipStore
) -> float:
    """Writes one stage and returns its largest difference to PyTorch; too large a difference ends the export."""
    module.eval().requires_grad_(False)
    exact = copy.deepcopy(module)
    round_to_half(module)
    path = folder / f"{stage}.onnx"
    shipped = copy.deepcopy(module)
    unroll_convolutions(shipped)
    export_stage(stage, shipped, example_inputs(store, config, 3, 7, 1)[stage], outputs, path)
    worst, rounding = 0.0, 0.0
    for batch, slots, seed in CHECKED:
        example = example_inputs(store, config, batch, slots, seed)
        lengths = example["pose"]["num_tokens"]
        if stage == "root":
            lengths = module(*example[stage].values())[0]
        worst = max(worst, largest_difference(path, module, example[stage], lengths))
        rounding = max(rounding, mean_difference(module, exact, example[stage]))
    size = path.stat().st_size / 1e6
    print(
        f"{stage}.onnx: {size:.1f} MB, differs from PyTorch by at most {worst:.1e}, and by 16-bit weights {rounding:.1e} in the mean"
    )
    if worst > TOLERANCE:
        raise SystemExit(f"{stage}.onnx differs from PyTorch by {worst:.1e}, at most {TOLERANCE} is allowed")
    return worst


def write_manifest(
    out: Path,
    name: str,
    version: str,
    config: ModelConfig,
    skeleton: Skeleton,
    parameters: int,
    digest: str,
    about: dict,
) -> None:
    """Writes ``pack.toml``."""
    lines = [
        "# Written by `troupe-train export`. The server refuses the pack if the hash does not fit the ONNX files.",
        "format = 1",
        f"name = {json.dumps(name, ensure_ascii=False)}",
        f"version = {json.dumps(version)}",
        f"licence = {json.dumps(about.get('licence', 'unknown'), ensure_ascii=False)}",
        f"credits = {json.dumps(about.get('credits', []), ensure_ascii=False)}",
        f"fps = {FPS}",
        f"frames_per_token = {FRAMES_PER_TOKEN}",
        f"min_tokens = {MIN_TOKENS}",
        f"max_tokens = {MAX_TOKENS}",
        f"heads = {config.heads}",
        f"codes = {config.codes}",
        f"context_frames = {CONTEXT_FRAMES}",
        f"max_targets = {MAX_TARGETS}",
        f"parameters = {parameters}",
        f'content_hash = "sha256:{digest}"',
        "",
        "[skeleton]",
        f"left_axis = {json.dumps(skeleton.left_axis)}",
        "ground_y_m = 0.0",
        "",
        "[skeleton.contacts]",
        f"joints = {json.dumps([skeleton.names[j] for j in skeleton.contact_joints])}",
        f"max_height_m = {json.dumps(skeleton.contact_max_height_m)}",
        f"max_speed_mps = {skeleton.contact_max_speed_mps}",
        f"clearance_m = {json.dumps(skeleton.contact_clearance_m)}",
    ]
    for joint, parent, offset in zip(skeleton.names, skeleton.parents, skeleton.offsets, strict=True):
        parent_name = skeleton.names[parent] if parent >= 0 else ""
        lines += [
            "",
            "[[skeleton.joints]]",
            f"name = {json.dumps(joint)}",
            f"parent = {json.dumps(parent_name)}",
            f"offset_m = {json.dumps(offset)}",
        ]
    lines += robot_lines(skeleton.robot)
    lines += ["", "[training]"] + [f"{k} = {json.dumps(v)}" for k, v in about.get("training", {}).items()]
    lines += ["", "# Largest difference between ONNX Runtime and PyTorch.", "[training.onnx_check]"]
    lines += [f"{k} = {v:.2e}" for k, v in about["onnx_check"].items()]
    (out / "pack.toml").write_text("\n".join(lines) + "\n")


def robot_lines(robot: dict | None) -> list[str]:
    """The ``[robot]`` table: hinges in the order of the motion files' columns; nothing for characters."""
    if robot is None:
        return []
    lines = ["", "[robot]", f"name = {json.dumps(robot['name'])}"]
    for hinge in robot["hinges"]:
        lines += ["", "[[robot.hinges]]"] + [f"{key} = {json.dumps(value)}" for key, value in hinge.items()]
    return lines
