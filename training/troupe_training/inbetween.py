"""Runs the three stages of a pack or of a run's checkpoints on evaluation windows, without a server."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import onnxruntime
import torch

from troupe_training.config import (
    CONTEXT_FRAMES,
    COUNTS,
    FRAMES_PER_TOKEN,
    MAX_FRAMES,
    MIN_TOKENS,
    SLOTS,
)
from troupe_training.features import ClipStore, Segments
from troupe_training.motion import Motion
from troupe_training.rotations import six_d_to_matrix


class PackNetworks:
    """The ONNX files of a pack folder."""

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


class RunNetworks:
    """The checkpoints of a run folder, as they would be exported; the decoder of `refine` where there is one."""

    def __init__(self, run: Path, store: ClipStore):
        from troupe_training.export import DECODER_OUTPUTS, POSE_OUTPUTS, ROOT_OUTPUTS
        from troupe_training.root_module import RootStage
        from troupe_training.stages import load
        from troupe_training.tokenizer import DecoderStage

        decoder_stage = "refine" if (Path(run) / "refine.pt").exists() else "tokenizer"
        pose = load(run, "pose", store)
        self.heads, self.codes = pose.heads, pose.codes
        self.stages = {
            "root": (RootStage(load(run, "root", store)), ROOT_OUTPUTS),
            "pose": (pose, POSE_OUTPUTS),
            "decoder": (DecoderStage(load(run, decoder_stage, store)), DECODER_OUTPUTS),
        }

    @torch.no_grad()
    def run(self, stage: str, **inputs: torch.Tensor) -> dict[str, torch.Tensor]:
        """One stage; tensors by name in, tensors by name out."""
        module, names = self.stages[stage]
        outputs = module(**inputs)
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        return dict(zip(names, outputs, strict=True))


def open_networks(folder: Path, store: ClipStore, threads: int) -> PackNetworks | RunNetworks:
    """The networks in ``folder``, whichever kind of folder it is."""
    folder = Path(folder)
    if (folder / "root.onnx").exists():
        return PackNetworks(folder, threads)
    if (folder / "root.pt").exists():
        return RunNetworks(folder, store)
    raise SystemExit(f"{folder} holds neither a pack (root.onnx) nor the checkpoints of a run (root.pt)")


@dataclass
class Keys:
    """What a request gives: four context frames and one target in the segment frame. K = 5 frames."""

    pose: torch.Tensor  # [B, 5, J*9]
    global_root: torch.Tensor  # [B, 5, 5]
    local_root: torch.Tensor  # [B, 4, 4], of the context alone

    @staticmethod
    def of(segments: Segments, frames: int) -> "Keys":
        """The given frames of captured segments whose last frame is the target."""
        index = [*range(CONTEXT_FRAMES), frames - 1]
        return Keys(
            segments.pose[:, index], segments.global_root[:, index], segments.local_root[:, :CONTEXT_FRAMES]
        )


@dataclass(frozen=True)
class Sampling:
    """How pose tokens are chosen: passes, and the temperature and seed of the choice (0: the likeliest)."""

    steps: int = 1
    temperature: float = 0.0
    seed: int = 0


@dataclass
class Plan:
    """What the root and pose stages chose; all that the decoder needs."""

    frames: int
    tokens: torch.Tensor  # [B, n, K]
    num_tokens: torch.Tensor  # [B]
    global_root: torch.Tensor  # [B, 4 n, 5], r_g3
    frame_pose: torch.Tensor  # [B, 4 n, J*9]
    frame_mask: torch.Tensor  # [B, 4 n]

    def inputs(self) -> dict[str, torch.Tensor]:
        """The inputs that the pose stage and the decoder share."""
        return {
            "num_tokens": self.num_tokens,
            "global_root": self.global_root,
            "frame_pose": self.frame_pose,
            "frame_mask": self.frame_mask,
        }


def masked_after(total: int, step: int, steps: int) -> int:
    """How many of ``total`` tokens stay masked after pass ``step`` of ``steps`` (MaskGIT's cosine, as in the server)."""
    if step >= steps:
        return 0
    angle = np.float32(np.pi / 2) * np.float32(step) / np.float32(steps)
    return int(np.float32(total) * np.cos(angle))


def choose_tokens(networks, plan: Plan, sampling: Sampling) -> torch.Tensor:
    """Fills all masked tokens ``[B, n, K]`` over one or more passes, the most confident first.

    The server's rule (`server/src/engine/sampling.rs`): codes are drawn from softmax(logits / temperature), confidence is
    the log-probability of the drawn code at temperature 1, and every pass commits something. Its random numbers are its own,
    so seeds give other draws here than there.
    """
    batch, slots, heads = plan.tokens.shape
    tokens = torch.full((batch, slots * heads), networks.codes)
    generator = torch.Generator().manual_seed(sampling.seed)
    for step in range(1, sampling.steps + 1):
        masked = tokens == networks.codes
        left = int(masked[0].sum())
        if left == 0:
            break
        shaped = tokens.reshape(batch, slots, heads)
        logits = networks.run("pose", tokens=shaped, **plan.inputs())["logits"].reshape(
            batch, -1, networks.codes
        )
        if sampling.temperature > 0.0:
            weights = torch.softmax(logits.double() / sampling.temperature, -1).cumsum(-1)
            unit = torch.rand(batch, slots * heads, 1, generator=generator, dtype=torch.float64)
            chosen = (weights <= unit * weights[..., -1:]).sum(-1).clamp_max(networks.codes - 1)
        else:
            chosen = logits.argmax(-1)
        confidence = torch.log_softmax(logits, -1).gather(-1, chosen[..., None])[..., 0]
        commit = max(left - masked_after(slots * heads, step, sampling.steps), 1)
        order = confidence.masked_fill(~masked, -torch.inf).argsort(dim=-1, descending=True, stable=True)
        first = order[:, :commit]
        tokens.scatter_(1, first, chosen.gather(1, first))
    return tokens.reshape(batch, slots, heads)


def make_plan(networks, keys: Keys, frames: int, sampling: Sampling) -> Plan:
    """Root trajectory and pose tokens for segments of ``frames`` frames (12 to 64) whose last frame is the target."""
    batch, tokens = len(keys.pose), -(-frames // FRAMES_PER_TOKEN)
    padded = tokens * FRAMES_PER_TOKEN
    slots = [*range(CONTEXT_FRAMES), CONTEXT_FRAMES + (frames - 1) - (tokens - 1) * FRAMES_PER_TOKEN]

    def keyed(values: torch.Tensor) -> torch.Tensor:
        out = torch.zeros(batch, SLOTS, values.shape[-1])
        out[:, slots[: values.shape[1]]] = values
        return out

    given = torch.zeros(batch, SLOTS)
    given[:, slots] = 1.0
    context_only = given.clone()
    context_only[:, CONTEXT_FRAMES:] = 0.0
    allowed = torch.zeros(batch, COUNTS)
    allowed[:, tokens - MIN_TOKENS] = 1.0
    root = networks.run(
        "root",
        key_local_root=keyed(keys.local_root),
        key_global_root=keyed(keys.global_root),
        key_pose=keyed(keys.pose),
        has_local_root=context_only,
        has_global_root=given,
        has_pose=given,
        allowed_counts=allowed,
        count_noise=torch.zeros(batch, COUNTS),
    )
    index = [*range(CONTEXT_FRAMES), frames - 1]
    frame_pose = torch.zeros(batch, padded, keys.pose.shape[-1])
    frame_mask = torch.zeros(batch, padded)
    frame_pose[:, index] = keys.pose
    frame_mask[:, index] = 1.0
    plan = Plan(
        frames=frames,
        tokens=torch.zeros(batch, tokens, networks.heads, dtype=torch.long),
        num_tokens=root["num_tokens"],
        global_root=root["global_root"][:, :padded],
        frame_pose=frame_pose,
        frame_mask=frame_mask,
    )
    return replace(plan, tokens=choose_tokens(networks, plan, sampling))


def decode(networks, plan: Plan) -> Motion:
    """The frames of a plan, not pinned to anything."""
    out = networks.run("decoder", tokens=plan.tokens, **plan.inputs())
    frames = plan.frames
    return Motion(
        out["refined_root"][:, :frames, :3],
        six_d_to_matrix(out["rotations"][:, :frames]),
        out["contacts"][:, :frames],
    )


def in_between(networks, keys: Keys, frames: int, sampling: Sampling | None = None) -> Motion:
    """Fills segments of ``frames`` frames from four context frames and the last frame as the one target."""
    if not MIN_TOKENS * FRAMES_PER_TOKEN <= frames <= MAX_FRAMES:
        raise ValueError(f"segments have 12 to {MAX_FRAMES} frames, not {frames}")
    return decode(networks, make_plan(networks, keys, frames, sampling or Sampling()))
