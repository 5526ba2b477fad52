"""``evaluator``: the motion autoencoder in whose latent space FID and MMD are measured, as ``evaluator.onnx``.

TMR's autoencoder (Petrovich et al. 2023) without the text: an ACTOR-like transformer VAE, whose encoder reads frames behind
two tokens, one for the mean and one for the deviation. It is trained on the train split alone, on segments of any
length from 12 to 64 frames. The latent is the mean, shifted and scaled so that those of the train split have mean 0 and
length one in the root mean square.

The graph holds plain operators of opset 17 only, so that small runtimes can run it.
"""

import hashlib
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from torch import nn
from torch.nn import functional as F

from troupe_training.config import FPS, MAX_FRAMES
from troupe_training.cut import any_length, spread, windows
from troupe_training.features import ClipStore, Segments
from troupe_training.layers import Standardiser, full_precision, sinusoids
from troupe_training.trainer import Budget, Trainer

LATENT = 256
DIM = 192
LAYERS = 4
DECODER_LAYERS = 3  # not exported
HEAD_DIM = 32
FEEDFORWARD = 2
KL_WEIGHT = 1e-5  # TMR's
OPSET = 17
SEED = 17
LEARNING_RATE = 6e-4
STATISTIC_BATCHES = 40
TOLERANCE = 1e-3
REPORTED_WINDOWS = 600
REPORTED_FRAMES = (20, 35, 50)  # windows of gaps of 15, 30 and 45 frames
CHECKED = ((1, 12), (3, 20), (5, 33), (2, 64))  # batch size, frames
INPUTS = ("root", "positions", "six_d")
# Smallest deviations by which features are divided: metres, turns, m/s.
FLOORS = {"root": 0.1, "positions": 0.03, "six_d": 0.03, "velocities": 0.1}
# Operators of the exported graph, all the same in opset 17 and 18: PyTorch writes the latter.
OPERATORS = {
    "Add", "Concat", "Constant", "Div", "Gather", "Gemm", "MatMul", "Mul", "ReduceSum", "Reshape", "Shape", "Sigmoid",
    "Slice", "Softmax", "Sqrt", "Squeeze", "Sub", "Transpose", "Unsqueeze",
}  # fmt: skip


class Norm(nn.Module):
    """Layer normalisation in plain operators."""

    def __init__(self):
        super().__init__()
        self.gain, self.shift = nn.Parameter(torch.ones(DIM)), nn.Parameter(torch.zeros(DIM))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = x - x.sum(-1, keepdim=True) / DIM
        return x / torch.sqrt((x * x).sum(-1, keepdim=True) / DIM + 1e-5) * self.gain + self.shift


class Layer(nn.Module):
    """Pre-norm self-attention and feed-forward, in plain operators."""

    def __init__(self):
        super().__init__()
        self.norm1, self.norm2 = Norm(), Norm()
        self.query, self.key, self.value, self.out = (nn.Linear(DIM, DIM) for _ in range(4))
        self.up, self.down = nn.Linear(DIM, FEEDFORWARD * DIM), nn.Linear(FEEDFORWARD * DIM, DIM)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """``[B, N, DIM]`` to the same."""
        y = self.norm1(x)
        q, k, v = (
            part(y).unflatten(-1, (DIM // HEAD_DIM, HEAD_DIM)).transpose(1, 2)
            for part in (self.query, self.key, self.value)
        )
        scores = torch.softmax(q @ k.transpose(-1, -2) * HEAD_DIM**-0.5, -1)
        x = x + self.out((scores @ v).transpose(1, 2).flatten(2))
        y = self.up(self.norm2(x))
        return x + self.down(y * torch.sigmoid(y))


class Evaluator(nn.Module):
    """The autoencoder. Frames go in as root ``[B, T, 5]``, positions ``[B, T, J, 3]`` and six_d ``[B, T, J, 6]``."""

    def __init__(self, joints: int):
        super().__init__()
        self.joints = joints
        self.widths = {
            "root": 5,
            "positions": joints * 3,
            "six_d": joints * 6,
            "velocities": joints * 3,
        }
        self.scales = nn.ModuleDict({name: Standardiser(width) for name, width in self.widths.items()})
        total = sum(self.widths.values())
        self.enter = nn.Linear(total, DIM)
        self.tokens = nn.Parameter(torch.randn(2, DIM) * 0.02)
        self.register_buffer("place", sinusoids(MAX_FRAMES + 2, DIM))
        self.encoder = nn.Sequential(*(Layer() for _ in range(LAYERS)), Norm())
        self.mean, self.deviation = nn.Linear(DIM, LATENT), nn.Linear(DIM, LATENT)
        self.open = nn.Linear(LATENT, DIM)
        self.decoder = nn.Sequential(*(Layer() for _ in range(DECODER_LAYERS)), Norm())
        self.leave = nn.Linear(DIM, total)
        # Of the means over the train split; measured when training is done.
        self.register_buffer("centre", torch.zeros(LATENT))
        self.register_buffer("spread", torch.ones(()))

    @full_precision
    def features(self, root: torch.Tensor, positions: torch.Tensor, six_d: torch.Tensor) -> torch.Tensor:
        """Standardised features ``[B, T, D]``, joint velocities in the segment frame among them."""
        ground = torch.cat([root[..., 0:1], root[..., 1:2] * 0.0, root[..., 2:3]], -1)
        world = positions + ground[:, :, None]
        step = (world[:, 1:] - world[:, :-1]) * FPS
        velocities = torch.cat([step[:, :1], step], 1)
        values = {"root": root, "positions": positions, "six_d": six_d, "velocities": velocities}
        flat = {
            n: v if v.dim() == 3 else v.reshape(v.shape[0], -1, self.widths[n]) for n, v in values.items()
        }
        return torch.cat([scale(flat[name]) for name, scale in self.scales.items()], -1)

    def encode(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and logarithm of the variance ``[B, 256]``."""
        x = self.enter(features)
        tokens = self.tokens[None] + x[:, :1] * 0.0
        x = torch.cat([tokens, x], 1)
        x = self.encoder(x + self.place[: x.shape[1]])
        return self.mean(x[:, 0]), self.deviation(x[:, 1])

    def decode(self, latent: torch.Tensor, frames: int) -> torch.Tensor:
        """Features ``[B, T, D]``. The latent is the only memory, so adding it to every query is what attention would do."""
        x = self.open(latent)[:, None] + self.place[:frames]
        return self.leave(self.decoder(x))

    def forward(self, root: torch.Tensor, positions: torch.Tensor, six_d: torch.Tensor) -> torch.Tensor:
        """Latents ``[B, 256]``."""
        mean, _ = self.encode(self.features(root, positions, six_d))
        return (mean - self.centre) / self.spread


def inputs_of(segments: Segments) -> dict[str, torch.Tensor]:
    """The evaluator's inputs for captured segments."""
    return {"root": segments.global_root, "positions": segments.positions, "six_d": segments.six_d}


def _set_scales(model: Evaluator, store: ClipStore) -> None:
    """Mean and deviation of every feature over random training segments."""
    generator = torch.Generator().manual_seed(1234)
    rows = [
        model.features(**inputs_of(any_length(store, 4096, generator))).flatten(0, 1)
        for _ in range(STATISTIC_BATCHES)
    ]
    parts = torch.cat(rows).split(list(model.widths.values()), -1)
    for (name, scale), part in zip(model.scales.items(), parts, strict=True):
        scale.set(part.mean(0), part.std(0).clamp_min(FLOORS[name]))


@torch.no_grad()
def _set_latent_scale(model: Evaluator, store: ClipStore) -> None:
    """Where the latents of random training segments lie and how far apart."""
    generator = torch.Generator().manual_seed(4321)
    batches = (any_length(store, 4096, generator) for _ in range(STATISTIC_BATCHES))
    means = torch.cat([model.encode(model.features(**inputs_of(b)))[0] for b in batches])
    model.centre.copy_(means.mean(0))
    model.spread.copy_((means - model.centre).square().sum(-1).mean().sqrt().clamp_min(1e-6))


def loss_of(store: ClipStore, frames_budget: int):
    """TMR's losses: smooth L1 of the reconstruction, and a little of the divergence to the standard normal."""

    def loss(model: Evaluator, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        features = model.features(**inputs_of(any_length(store, frames_budget, generator)))
        mean, logarithm = (x.float() for x in model.encode(features))
        noise = torch.randn(mean.shape, generator=generator).to(mean.device)
        made = model.decode(mean + noise * torch.exp(0.5 * logarithm), features.shape[1]).float()
        divergence = 0.5 * (mean**2 + logarithm.exp() - 1.0 - logarithm).mean()
        return {"reconstruction": F.smooth_l1_loss(made, features), "kl": KL_WEIGHT * divergence}

    return loss


@torch.no_grad()
def reconstruction_error(model: Evaluator, store: ClipStore, frames: int) -> dict[str, float]:
    """How far the decoder's joints, roots and velocities are off on segments of ``frames`` frames, in the mean."""
    starts, _ = windows(store, frames, frames // 2)
    starts = starts[spread(len(starts), REPORTED_WINDOWS)]
    sums, count = {"joint_m": 0.0, "root_m": 0.0, "velocity_mps": 0.0}, 0
    for chunk in starts.split(64):
        features = model.features(**inputs_of(store.segments(chunk, frames)))
        made = model.decode(model.encode(features)[0], frames)
        values = []
        for x in (made, features):
            parts = x.split(list(model.widths.values()), -1)
            values.append({n: s.invert(p) for (n, s), p in zip(model.scales.items(), parts, strict=True)})
        a, b = values
        for name, key in (("joint_m", "positions"), ("velocity_mps", "velocities")):
            distance = (a[key] - b[key]).unflatten(-1, (model.joints, 3)).norm(dim=-1)
            sums[name] += float(distance.mean()) * len(chunk)
        sums["root_m"] += float((a["root"] - b["root"])[..., :3].norm(dim=-1).mean()) * len(chunk)
        count += len(chunk)
    return {name: value / max(count, 1) for name, value in sums.items()}


def train_evaluator(
    cache: Path, run: Path, out: Path, budget: Budget, frames_budget: int, seed: int, device: str
) -> dict | None:
    """Trains (or goes on), exports to ``out`` and tells the errors; None where it was stopped before its budget."""
    torch.manual_seed(seed)
    store = ClipStore(cache, "train", device)
    model = Evaluator(store.skeleton.joint_count)
    _set_scales(model, store)
    meta = {"seed": seed, "frames_budget": frames_budget, "joints": model.joints}
    trainer = Trainer(run, "evaluator", model.to(device), budget, meta, seed, device)
    if trainer.resume():
        print(f"evaluator: going on from step {trainer.step}")
    if not trainer.fit(loss_of(store, frames_budget)):
        return None
    model = trainer.average.to("cpu").eval().requires_grad_(False)
    store, test = ClipStore(cache, "train"), ClipStore(cache, "test")
    _set_latent_scale(model, store)
    errors = {
        name: {frames: reconstruction_error(model, split, frames) for frames in REPORTED_FRAMES}
        for name, split in (("train", store), ("test", test))
    }
    about = {"steps": trainer.step, "minutes": round(trainer.seconds / 60, 1), "seed": seed}
    return about | {"difference": export_evaluator(model, store, out), "errors": errors}


def export_evaluator(model: Evaluator, store: ClipStore, out: Path) -> float:
    """Writes ``out`` and compares it with PyTorch at several sizes; too large a difference ends the export."""
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    examples = []
    for batch, frames in CHECKED:
        tokens = next((t for t in store.lengths() if t * 4 >= frames), None)
        if tokens is None:
            continue
        starts = store.sample(batch, tokens, torch.Generator().manual_seed(frames))
        examples.append(inputs_of(store.segments(starts, frames)))
    batch, frames = (
        torch.export.Dim("batch", min=1, max=4096),
        torch.export.Dim("frames", min=12, max=MAX_FRAMES),
    )
    torch.onnx.export(
        model,
        tuple(examples[1].values()),
        out,
        input_names=list(INPUTS),
        output_names=["latent"],
        dynamic_shapes=[{0: batch, 1: frames}] * len(INPUTS),
        opset_version=OPSET + 1,
        dynamo=True,
        external_data=False,
        verbose=False,
    )
    graph = onnx.load(out)
    graph.doc_string = "Troupe motion evaluator"
    for node in graph.graph.node:
        node.doc_string = ""
        del node.metadata_props[:]
    others = {node.op_type for node in graph.graph.node} - OPERATORS
    if others:
        raise SystemExit(f"the evaluator's graph has operators that it should not have: {sorted(others)}")
    graph.opset_import[0].version = OPSET
    onnx.checker.check_model(graph, full_check=True)
    onnx.save(graph, out)
    session = onnxruntime.InferenceSession(out, providers=["CPUExecutionProvider"])
    worst = 0.0
    for example in examples:
        got = session.run(None, {name: value.numpy() for name, value in example.items()})[0]
        with torch.no_grad():
            worst = max(worst, float(np.abs(got - model(**example).numpy()).max()))
    if worst > TOLERANCE:
        raise SystemExit(f"{out} differs from PyTorch by {worst:.1e}, at most {TOLERANCE} is allowed")
    return worst


class Latents:
    """``evaluator.onnx`` at work."""

    def __init__(self, path: Path, threads: int):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        self.session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        self.sha256 = hashlib.sha256(
            Path(path).read_bytes()
        ).hexdigest()  # latents of another file do not compare

    def of(self, root: torch.Tensor, positions: torch.Tensor, six_d: torch.Tensor) -> np.ndarray:
        """Latents ``[B, 256]``."""
        values = zip(INPUTS, (root, positions, six_d), strict=True)
        return self.session.run(None, {name: value.contiguous().numpy() for name, value in values})[0]
