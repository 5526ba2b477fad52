"""Runs the three stages of a pack or of a run's checkpoints on evaluation windows, without a server."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.conventions import CONTEXT_FRAMES, MAX_FRAMES, MIN_FRAMES
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.data.store import ClipStore, Segments
from troupe_training.evaluate.bench import Method, Sampling
from troupe_training.evaluate.tables import Reference
from troupe_training.export.onnx import Session
from troupe_training.models.motionbricks.config import COUNTS, FRAMES_PER_TOKEN, MIN_TOKENS, SLOTS
from troupe_training.models.motionbricks.served import OUTPUTS
from troupe_training.train.motionbricks.stages import load_networks

PAPER_G1 = Reference(
    "MotionBricks, table 4",  # of LaFAN1 on the G1, its own method
    {
        "mmd": 0.2835,
        "fid": 0.891,
        "joint_jitter_mps2": 4.53,
        "root_jitter_mps2": 2.53,
        "foot_skate_m_per_frame": 0.003,
        "penetration_m": 0.003,
        # Of the contacts that the network gives, or of those that its motion makes: the text leaves
        # it open.
        "contact_accuracy": 0.889,
        "contact_prediction_accuracy": 0.889,
        "context_keyframe_error_m": 0.053,
        "target_keyframe_error_m": 0.179,
        "context_root_error_m": 0.006,
        "target_root_error_m": 0.100,
        "reached": 0.611,
    },
    ("mmd", "fid"),
    "The paper's figures are of its own windows, drawn at random; those in brackets are in the space of its own feature "
    "network and do not compare. Its joint diversity is not defined as ours.",
)


ROOT_STREAM = 0x526F6F74  # added to the seed


@dataclass
class StageNetworks:
    """The three stages, wherever they run: ``run`` takes a stage and tensors by name, and gives tensors by name."""

    heads: int
    codes: int
    run: Callable[..., dict[str, Tensor]]
    root_choices: int = 0  # numbers that choose a root, where the root stage has a choice


def pack_networks(pack: Path, threads: int) -> StageNetworks:
    """The ONNX files of a pack folder."""
    sessions = {name: Session(pack / f"{name}.onnx", threads) for name in OUTPUTS}
    heads, codes = sessions["pose"].session.get_outputs()[0].shape[2:]
    noise = [i.shape[1] for i in sessions["root"].session.get_inputs() if i.name == "root_noise"]
    return StageNetworks(heads, codes, lambda stage, **inputs: sessions[stage].run(inputs), sum(noise))


def run_networks(run: Path, store: ClipStore) -> StageNetworks:
    """The checkpoints of a run folder, as they would be exported; the decoder of `refine` if there is one."""
    networks = load_networks(run, store)
    stages = networks.stages()

    @torch.no_grad()
    def run_stage(stage: str, **inputs: Tensor) -> dict[str, Tensor]:
        outputs = stages[stage](**inputs)
        outputs = outputs if isinstance(outputs, tuple) else (outputs,)
        return dict(zip(OUTPUTS[stage], outputs, strict=True))

    return StageNetworks(networks.pose.heads, networks.pose.codes, run_stage, networks.root_choices)


def open_networks(folder: Path, store: ClipStore, threads: int) -> StageNetworks:
    """The networks in ``folder``, whichever kind of folder it is."""
    if (folder / "root.onnx").exists():
        return pack_networks(folder, threads)
    if (folder / "root.pt").exists():
        return run_networks(folder, store)
    raise SystemExit(f"{folder} holds neither a pack (root.onnx) nor the checkpoints of a run (root.pt)")


@dataclass
class Keys:
    """A request: four context frames and one target in the segment frame. K = 5 frames."""

    pose: Tensor  # [B, 5, J*9]
    global_root: Tensor  # [B, 5, 5]
    local_root: Tensor  # [B, 4, 4], of the context alone

    @staticmethod
    def of(segments: Segments, frames: int) -> "Keys":
        """The given frames of captured segments whose last frame is the target."""
        index = [*range(CONTEXT_FRAMES), frames - 1]
        return Keys(segments.pose[:, index], segments.global_root[:, index], segments.local_root[:, :CONTEXT_FRAMES])


@dataclass
class Plan:
    """The choices of the root and pose stages: all that the decoder needs."""

    frames: int
    tokens: Tensor  # [B, n, K]
    num_tokens: Tensor  # [B]
    global_root: Tensor  # [B, 4 n, 5], r_g3
    frame_pose: Tensor  # [B, 4 n, J*9]
    frame_mask: Tensor  # [B, 4 n]

    def inputs(self) -> dict[str, Tensor]:
        """The inputs that the pose stage and the decoder share."""
        return {name: getattr(self, name) for name in ("num_tokens", "global_root", "frame_pose", "frame_mask")}


def masked_after(total: int, step: int, steps: int) -> int:
    """How many of ``total`` tokens stay masked after pass ``step`` of ``steps`` (MaskGIT's cosine, as in the server)."""
    if step >= steps:
        return 0
    angle = np.float32(np.pi / 2) * np.float32(step) / np.float32(steps)
    return int(np.float32(total) * np.cos(angle))


def choose_tokens(networks: StageNetworks, plan: Plan, sampling: Sampling) -> Tensor:
    """Fills all masked tokens ``[B, n, K]`` over one or more passes, the most confident first.

    The server's rule (`server/src/engine/sampling.rs`): codes are drawn from softmax(logits / temperature), confidence is
    the log-probability of the drawn code at temperature 1, and every pass commits something. Its random numbers are its own,
    so seeds give other draws here than there. ``any_order`` is not the server's: see `analyses/diversity.py`.
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
        logits = networks.run("pose", tokens=shaped, **plan.inputs())["logits"].reshape(batch, -1, networks.codes)
        if sampling.temperature > 0.0:
            weights = torch.softmax(logits.double() / sampling.temperature, -1).cumsum(-1)
            unit = torch.rand(batch, slots * heads, 1, generator=generator, dtype=torch.float64)
            chosen = (weights <= unit * weights[..., -1:]).sum(-1).clamp_max(networks.codes - 1)
        else:
            chosen = logits.argmax(-1)
        if sampling.any_order:
            confidence = torch.rand(chosen.shape, generator=generator)
        else:
            confidence = torch.log_softmax(logits, -1).gather(-1, chosen[..., None])[..., 0]
        commit = max(left - masked_after(slots * heads, step, sampling.steps), 1)
        order = confidence.masked_fill(~masked, -torch.inf).argsort(dim=-1, descending=True, stable=True)
        first = order[:, :commit]
        tokens.scatter_(1, first, chosen.gather(1, first))
    return tokens.reshape(batch, slots, heads)


def root_noise(networks: StageNetworks, batch: int, sampling: Sampling) -> dict[str, Tensor]:
    """The input that chooses roots ``[B, K]``, zero at temperature 0; none if roots have no choice."""
    if not networks.root_choices:
        return {}
    # A stream of its own: the tokens' draws do not depend on whether roots have a choice.
    generator = torch.Generator().manual_seed(sampling.seed + ROOT_STREAM)
    noise = torch.randn(batch, networks.root_choices, generator=generator)
    return {"root_noise": sampling.root_temperature * noise}


def make_plan(networks: StageNetworks, keys: Keys, frames: int, sampling: Sampling) -> Plan:
    """Root trajectory and pose tokens for segments of ``frames`` frames (12 to 64) whose last frame is the target."""
    batch, tokens = len(keys.pose), -(-frames // FRAMES_PER_TOKEN)
    padded = tokens * FRAMES_PER_TOKEN
    slots = [*range(CONTEXT_FRAMES), CONTEXT_FRAMES + (frames - 1) - (tokens - 1) * FRAMES_PER_TOKEN]

    def keyed(values: Tensor) -> Tensor:
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
        **root_noise(networks, batch, sampling),
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


def decode(networks: StageNetworks, plan: Plan) -> Motion:
    """The frames of a plan, not pinned to anything."""
    out = networks.run("decoder", tokens=plan.tokens, **plan.inputs())
    frames = plan.frames
    return Motion(
        out["refined_root"][:, :frames, :3], six_d_to_matrix(out["rotations"][:, :frames]), out["contacts"][:, :frames]
    )


def in_between(networks: StageNetworks, keys: Keys, frames: int, sampling: Sampling | None = None) -> Motion:
    """Fills segments of ``frames`` frames from four context frames and the last frame as the one target."""
    if not MIN_FRAMES <= frames <= MAX_FRAMES:
        raise ValueError(f"segments have {MIN_FRAMES} to {MAX_FRAMES} frames, not {frames}")
    return decode(networks, make_plan(networks, keys, frames, sampling or Sampling()))


def of_networks(networks: StageNetworks) -> Method:
    """The method that runs the three stages of a pack or run."""

    def method(segments: Segments, frames: int, sampling: Sampling) -> Motion:
        return in_between(networks, Keys.of(segments, frames), frames, sampling)

    return method
