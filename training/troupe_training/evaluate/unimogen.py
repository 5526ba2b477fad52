"""What a UniMoGen pack can do without a server: path, feet, distance to captures, on test clips and held-out cells.

Every window has four frames of past, a path that is the captured root's own, and its clip's words; the network answers the rest.
All is measured on the network's own root and bends, before anything is pinned.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BodyStore, Windows
from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, MAX_FRAMES
from troupe_training.data.kinematics import near_ground
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix, wrap_angle, yaw_matrix
from troupe_training.evaluate.bench import Latents
from troupe_training.evaluate.distribution import Gaussian, frechet
from troupe_training.models.unimogen.sampler import Character, Denoiser, sample
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode

TOE_MARGIN_M = 0.01  # the paper's height of a toe that slides, and what a toe may be below where it stands
BATCH = 8
MIN_FOR_FID = 64


@dataclass
class Setting:
    """How windows are answered and how many."""

    frames: int = 68
    stride: int = 32
    most: int | None = 128
    steps: int = 4
    guidance: float = 1.0
    seed: int = 0


@dataclass
class Answer:
    """B motions: root positions ``[B, T, 3]`` and turns out of the neutral pose ``[B, T, J, 3, 3]``."""

    root: Tensor
    turned: Tensor


# Windows with their paths to motions.
Method = Callable[[Windows, Path2D], Answer]


def captured(body: Body) -> Method:
    """What was captured."""
    kinematics = BodyKinematics(body)
    return lambda windows, path: Answer(windows.root, kinematics.turned(six_d_to_matrix(windows.bends)))


def frozen(body: Body, limits: Range) -> Method:
    """The last pose of the past, carried along the path."""
    kinematics = BodyKinematics(body)

    def answer(windows: Windows, path: Path2D) -> Answer:
        rows = encode(body, windows.root, windows.bends, path, limits)
        rows[:, :, CONTEXT_FRAMES:] = rows[:, :, CONTEXT_FRAMES - 1 : CONTEXT_FRAMES]
        root, bends = decode(body, rows, path, limits)
        return Answer(root, kinematics.turned(bends))

    return answer


def of_network(body: Body, denoiser: Denoiser, limits: Range, setting: Setting) -> Method:
    """The network's answers; each window has a seed of its own."""
    kinematics = BodyKinematics(body)
    asked = 0

    def answer(windows: Windows, path: Path2D) -> Answer:
        nonlocal asked
        rows = encode(body, windows.root, windows.bends, path, limits).numpy()
        features = path.features(body.size_m).numpy()
        given = (np.arange(rows.shape[2]) < CONTEXT_FRAMES).astype(np.float32)
        characters = []
        for b in range(len(rows)):
            words = windows.words[b].numpy()
            seed = setting.seed + asked
            characters.append(Character(body, features[b], words, seed, given, rows[b], setting.guidance))
            asked += 1
        made = torch.from_numpy(np.stack(sample(denoiser, characters, setting.steps)))
        root, bends = decode(body, made, path, limits)
        return Answer(root, kinematics.turned(bends))

    return answer


def figures(body: Body, answer: Answer, truth: Answer, path: Path2D) -> dict[str, np.ndarray]:
    """Figures ``[B]`` by name, over the frames after the past."""
    skeleton, kinematics = body.skeleton, BodyKinematics(body)
    to_come = slice(CONTEXT_FRAMES, None)
    left = answer.turned[:, :, 0, :, 0]
    heading = torch.atan2(-left[..., 2], left[..., 0])
    positions, true = (kinematics.positions(a.root, a.turned) for a in (answer, truth))
    off = (answer.root[..., [0, 2]] - path.points).norm(dim=-1)
    turned = wrap_angle(heading - path.heading).abs()
    acceleration = (positions[:, 2:] - 2 * positions[:, 1:-1] + positions[:, :-2]).norm(dim=-1) * FPS**2
    found = {
        "path_position_m": off[:, to_come].mean(1),
        "path_rotation_deg": torch.rad2deg(turned[:, to_come].mean(1)),
        "l2p_m": (positions - true)[:, to_come].norm(dim=-1).mean((1, 2)),
        "jitter_mps2": acceleration[:, CONTEXT_FRAMES - 1 :].mean((1, 2)),
        "seam_mps2": acceleration[:, CONTEXT_FRAMES - 2].mean(1),
        "diversity_in_motion_m2": positions[:, to_come].sub(answer.root[:, to_come, None]).var(1).sum(-1).mean(1),
    }
    if skeleton.contact_joints:
        clearance = torch.tensor(skeleton.contact_clearance_m)
        feet = positions[:, CONTEXT_FRAMES - 1 :, skeleton.contact_joints]
        step = (feet[:, 1:] - feet[:, :-1])[..., [0, 2]].norm(dim=-1)
        above = feet[:, 1:, :, 1] - clearance
        found["foot_penetration_share"] = (above < -TOE_MARGIN_M).any(-1).float().mean(1)
        found["foot_sliding_m"] = (step * (above < TOE_MARGIN_M)).sum(1).mean(1)
        found["foot_skate_m_per_frame"] = (step * near_ground(above)).mean((1, 2))
    return {name: values.double().numpy() for name, values in found.items()}


def latents_of(body: Body, latents: Latents, answer: Answer) -> np.ndarray:
    """Latents of the pack evaluator that knows this skeleton, ``[B, 256]``; the first 64 frames in the segment frame."""
    answer = Answer(answer.root[:, :MAX_FRAMES], answer.turned[:, :MAX_FRAMES])
    kinematics = BodyKinematics(body)
    anchor = CONTEXT_FRAMES - 1
    left = answer.turned[:, anchor, 0, :, 0]
    back = yaw_matrix(-torch.atan2(-left[:, 2], left[:, 0]))
    origin = answer.root[:, anchor : anchor + 1] * torch.tensor([1.0, 0.0, 1.0])
    root = torch.einsum("bij,btj->bti", back, answer.root - origin)
    rotations = back[:, None, None] @ kinematics.rotations(answer.turned)
    motion = Motion(root, rotations)
    global_root = motion.global_root(torch.tensor(body.skeleton.left_axis))
    positions = kinematics.positions(torch.zeros_like(root), back[:, None, None] @ answer.turned)
    height = root * torch.tensor([0.0, 1.0, 0.0])
    return latents.of(global_root, positions + height[:, :, None], matrix_to_six_d(rotations))


def measure(
    store: BodyStore, methods: dict[str, Method], setting: Setting, evaluator: Path | None = None
) -> dict[str, dict[str, float]]:
    """Mean figures of each method over a body's windows, and the Fréchet distance to the captures where there is an evaluator."""
    starts, owners = store.every(setting.frames, setting.stride, setting.most)
    latents = Latents(evaluator, torch.get_num_threads()) if evaluator else None
    truth_of, found = captured(store.body), {}
    true_latents: list[np.ndarray] = []
    for name, method in methods.items():
        parts: list[dict[str, np.ndarray]] = []
        encoded: list[np.ndarray] = []
        for chunk in tqdm(range(0, len(starts), BATCH), desc=f"{store.body.name}: {name}", leave=False):
            windows = store.windows(starts[chunk : chunk + BATCH], setting.frames, owners[chunk : chunk + BATCH])
            path = Path2D(windows.root[..., [0, 2]], windows.heading)
            truth, answer = truth_of(windows, path), method(windows, path)
            parts.append(figures(store.body, answer, truth, path))
            if latents:
                encoded.append(latents_of(store.body, latents, answer))
        found[name] = {key: float(np.concatenate([p[key] for p in parts]).mean()) for key in parts[0]} if parts else {}
        found[name]["windows"] = float(len(starts))
        if encoded and len(starts) >= MIN_FOR_FID:
            if name == "captured":
                true_latents = encoded
            elif true_latents:
                found[name]["fid"] = frechet(Gaussian(np.concatenate(encoded)), Gaussian(np.concatenate(true_latents)))
    return found


def table(report: dict[str, dict[str, dict[str, float]]]) -> str:
    """The figures as Markdown: a row for each body, split and method."""
    names = [
        "path_position_m",
        "path_rotation_deg",
        "foot_penetration_share",
        "foot_sliding_m",
        "foot_skate_m_per_frame",
    ]
    names += ["l2p_m", "jitter_mps2", "seam_mps2", "diversity_in_motion_m2", "fid", "windows"]
    lines = [f"| what | method | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for what, methods in report.items():
        for method, values in methods.items():
            cells = (f"{values[name]:.4g}" if name in values else "–" for name in names)
            lines.append(f"| {what} | {method} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
