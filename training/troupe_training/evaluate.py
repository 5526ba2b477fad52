"""``evaluate``: in-betweening figures of a pack on the test split, beside ground truth and interpolation.

Runs the pack's ONNX files without a server, at temperature 0 with one pose step, and measures what the decoder gives:
unlike the server it does not pin roots and poses to the keyframes. `troupe eval` prints the full table through a
running server.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from tqdm import tqdm

from troupe_training.config import (
    CONTEXT_FRAMES,
    COUNTS,
    FPS,
    FRAMES_PER_TOKEN,
    MAX_FRAMES,
    MAX_TOKENS,
    MIN_TOKENS,
    SLOTS,
)
from troupe_training.features import ClipStore, Segments
from troupe_training.losses import Kinematics
from troupe_training.rotations import matrix_to_quat, quat_to_matrix, six_d_to_matrix

SKATE_HEIGHT_M = 0.025


@dataclass
class Motion:
    """Root positions ``[B, N, 3]`` and world rotations ``[B, N, J, 3, 3]`` of one method's answer."""

    root: torch.Tensor
    rotations: torch.Tensor


class Pack:
    """The three stages of a pack folder, run one after the other."""

    def __init__(self, folder: Path, threads: int):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        self.stages = {
            name: onnxruntime.InferenceSession(
                Path(folder) / f"{name}.onnx", options, providers=["CPUExecutionProvider"]
            )
            for name in ("root", "pose", "decoder")
        }
        self.heads, self.codes = self.stages["pose"].get_outputs()[0].shape[2:]

    def run(self, stage: str, **inputs: torch.Tensor) -> dict[str, torch.Tensor]:
        """One stage; tensors by name in, tensors by name out."""
        session = self.stages[stage]
        arrays = session.run(None, {name: value.contiguous().numpy() for name, value in inputs.items()})
        return {o.name: torch.from_numpy(a) for o, a in zip(session.get_outputs(), arrays, strict=True)}

    def in_between(self, segments: Segments, frames: int) -> Motion:
        """Fills segments of ``frames`` frames from four context frames and the last frame as the one target."""
        batch, tokens = len(segments.pose), -(-frames // FRAMES_PER_TOKEN)
        slot = CONTEXT_FRAMES + (frames - 1) - (tokens - 1) * FRAMES_PER_TOKEN
        index = list(range(CONTEXT_FRAMES)) + [frames - 1]
        slots = list(range(CONTEXT_FRAMES)) + [slot]

        def keyed(values: torch.Tensor) -> torch.Tensor:
            out = torch.zeros(batch, SLOTS, values.shape[-1])
            out[:, slots] = values[:, index]
            return out

        given = torch.zeros(batch, SLOTS)
        given[:, slots] = 1.0
        context_only = given.clone()
        context_only[:, CONTEXT_FRAMES:] = 0.0
        allowed = torch.zeros(batch, COUNTS)
        allowed[:, tokens - MIN_TOKENS] = 1.0
        root = self.run(
            "root",
            key_local_root=keyed(segments.local_root) * context_only[..., None],
            key_global_root=keyed(segments.global_root),
            key_pose=keyed(segments.pose),
            has_local_root=context_only,
            has_global_root=given,
            has_pose=given,
            allowed_counts=allowed,
            count_noise=torch.zeros(batch, COUNTS),
        )
        frame_pose = torch.zeros(batch, MAX_FRAMES, segments.pose.shape[-1])
        frame_mask = torch.zeros(batch, MAX_FRAMES)
        frame_pose[:, index] = segments.pose[:, index]
        frame_mask[:, index] = 1.0
        rest = {"num_tokens": root["num_tokens"], "global_root": root["global_root"]}
        rest |= {"frame_pose": frame_pose, "frame_mask": frame_mask}
        masked = torch.full((batch, MAX_TOKENS, self.heads), self.codes)
        chosen = self.run("pose", tokens=masked, **rest)["logits"].argmax(-1)
        out = self.run("decoder", tokens=chosen, **rest)
        return Motion(out["refined_root"][:, :frames, :3], six_d_to_matrix(out["rotations"][:, :frames]))


def interpolate(truth: Motion, frames: int, parents: list[int]) -> Motion:
    """Linear root and slerped parent-relative rotations between the last context frame and the target."""
    first, last = CONTEXT_FRAMES - 1, frames - 1
    share = ((torch.arange(frames) - first) / (last - first)).clamp(0, 1)
    local = truth.rotations.clone()
    for j, parent in enumerate(parents):
        if parent >= 0:
            local[:, :, j] = truth.rotations[:, :, parent].transpose(-1, -2) @ truth.rotations[:, :, j]
    a, b = matrix_to_quat(local[:, first]), matrix_to_quat(local[:, last])
    dot = (a * b).sum(-1, keepdim=True)
    b = torch.where(dot < 0, -b, b)
    angle = torch.arccos(dot.abs().clamp(max=1 - 1e-7))[:, None]
    t = share[None, :, None, None]
    quat = (torch.sin((1 - t) * angle) * a[:, None] + torch.sin(t * angle) * b[:, None]) / torch.sin(angle)
    between = quat_to_matrix(quat / quat.norm(dim=-1, keepdim=True))
    between[:, :CONTEXT_FRAMES] = local[:, :CONTEXT_FRAMES]
    for j, parent in enumerate(parents):
        if parent >= 0:
            between[:, :, j] = between[:, :, parent] @ between[:, :, j]
    root = truth.root[:, first : first + 1] * (1 - t[..., 0]) + truth.root[:, last:frames] * t[..., 0]
    root = torch.cat([truth.root[:, :CONTEXT_FRAMES], root[:, CONTEXT_FRAMES:]], 1)
    return Motion(root, between)


def npss(predicted: np.ndarray, truth: np.ndarray) -> float:
    """NPSS of ``[B, T, D]`` sequences (Gopalakrishnan et al. 2019), as the LaFAN1 benchmark computes it."""
    power = [np.real(np.fft.fft(x, axis=1)) ** 2 for x in (predicted, truth)]
    total = [p.sum(1) for p in power]
    share = [p / np.maximum(t, 1e-12)[:, None] for p, t in zip(power, total, strict=True)]
    distance = np.abs(np.cumsum(share[0], 1) - np.cumsum(share[1], 1)).sum(1)
    return float((distance * total[1]).sum() / total[1].sum())


def continuous(quat: torch.Tensor) -> torch.Tensor:
    """Quaternions ``[B, T, ..., 4]`` with signs chosen so that each is on the side of the one before it."""
    sign = torch.where((quat[:, 1:] * quat[:, :-1]).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    return torch.cat([quat[:, :1], quat[:, 1:] * torch.cumprod(sign, 1)], 1)


def measures(
    motion: Motion, truth: Motion, kinematics: Kinematics, clearance: torch.Tensor, frames: int
) -> dict:
    """The figures of one method on one batch, means over its windows (NPSS inputs are returned as arrays)."""
    gap = slice(CONTEXT_FRAMES, frames - 1)
    world = kinematics.positions(motion.rotations) + motion.root[:, :, None]
    true_world = kinematics.positions(truth.rotations) + truth.root[:, :, None]
    error = (world - true_world).norm(dim=-1)
    quat, true_quat = matrix_to_quat(motion.rotations), matrix_to_quat(truth.rotations)
    quat = torch.where((quat * true_quat).sum(-1, keepdim=True) < 0, -quat, quat)
    feet = world[:, :, kinematics.feet]
    step = (feet[:, 1:] - feet[:, :-1])[..., [0, 2]].norm(dim=-1)
    height = feet[:, 1:, :, 1] - clearance
    skate = step * (2 - 2 ** (height / SKATE_HEIGHT_M)).clamp(0, 1)
    jitter = (world[:, 2:] - 2 * world[:, 1:-1] + world[:, :-2]).norm(dim=-1) * FPS**2
    return {
        "l2p_m": (error[:, gap] ** 2).sum(-1).sqrt().mean().item(),
        "l2q": ((quat - true_quat)[:, gap] ** 2).sum((-1, -2)).sqrt().mean().item(),
        "foot_skate_m_per_frame": skate[:, CONTEXT_FRAMES - 1 : frames - 2].mean().item(),
        "joint_jitter_mps2": jitter[:, CONTEXT_FRAMES - 2 : frames - 3].mean().item(),
        "context_keyframe_error_m": error[:, :CONTEXT_FRAMES].amax((1, 2)).mean().item(),
        "target_keyframe_error_m": error[:, frames - 1].amax(-1).mean().item(),
        "target_root_error_m": (motion.root - truth.root)[:, frames - 1].norm(dim=-1).mean().item(),
        "npss_inputs": tuple(continuous(q[:, gap]).flatten(2).numpy() for q in (quat, true_quat)),
    }


def windows(store: ClipStore, frames: int, stride: int) -> torch.Tensor:
    """Start frames of evaluation windows: every ``stride`` frames of every clip that is long enough."""
    starts = []
    for clip in store.clips:
        starts += list(range(clip["start"], clip["start"] + clip["frames"] - frames + 1, stride))
    return torch.tensor(starts, dtype=torch.long)


def evaluate(pack_folder: Path, cache: Path, gaps: list[int], stride: int, split: str, threads: int) -> dict:
    """``{gap: {method: {measure: value}}}`` for the pack, interpolation and ground truth."""
    store = ClipStore(cache, split)
    pack, kinematics = Pack(pack_folder, threads), Kinematics(store.skeleton)
    clearance = torch.tensor(store.skeleton.contact_clearance_m)
    report: dict = {}
    for gap in gaps:
        frames = CONTEXT_FRAMES + gap + 1
        if not MIN_TOKENS * FRAMES_PER_TOKEN <= frames <= MAX_FRAMES:
            raise SystemExit(
                f"a gap of {gap} frames makes a segment of {frames}; 12 to {MAX_FRAMES} frames are allowed"
            )
        collected: dict[str, list[dict]] = {}
        starts = windows(store, frames, stride)
        if not len(starts):
            raise SystemExit(f"no clip of the {split} split has {frames} frames")
        for chunk in tqdm(starts.split(64), desc=f"gap {gap}"):
            segments = store.segments(chunk, frames)
            truth = Motion(segments.global_root[..., :3], six_d_to_matrix(segments.six_d))
            answers = {
                "pack": pack.in_between(segments, frames),
                "interpolation": interpolate(truth, frames, store.skeleton.parents),
                "ground truth": truth,
            }
            for name, motion in answers.items():
                figures = measures(motion, truth, kinematics, clearance, frames) | {"windows": len(chunk)}
                collected.setdefault(name, []).append(figures)
        report[str(gap)] = {name: _merge(parts) for name, parts in collected.items()}
    return report


def _merge(parts: list[dict]) -> dict:
    weights = np.array([p["windows"] for p in parts], dtype=float)
    out = {
        k: float(np.average([p[k] for p in parts], weights=weights))
        for k in parts[0]
        if k not in ("npss_inputs", "windows")
    }
    predicted, truth = (np.concatenate([p["npss_inputs"][i] for p in parts]) for i in (0, 1))
    return out | {"npss": npss(predicted, truth), "windows": int(weights.sum())}


def print_report(report: dict) -> None:
    """A plain table, one block a gap."""
    for gap, methods in report.items():
        names = [k for k in next(iter(methods.values())) if k != "windows"]
        print(f"\ngap {gap} frames, {methods['pack']['windows']} windows")
        print(" " * 15 + "".join(f"{n[:22]:>24}" for n in names))
        for method, values in methods.items():
            print(f"{method:15}" + "".join(f"{values[n]:24.5f}" for n in names))
