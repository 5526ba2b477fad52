"""Motions of any length along one path, window after window as a live session makes them, and a picture of several bodies."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from troupe_training.data.bodies import Body
from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.data.kinematics import near_ground
from troupe_training.data.rotations import matrix_to_six_d
from troupe_training.evaluate.unimogen.methods import Answer, Setting, sampled
from troupe_training.evaluate.unimogen.networks import Network
from troupe_training.models.unimogen.sampler import Character
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, decode, encode

PERIOD_S = 6.0  # of a path that swings to the left and to the right
VIEW_YAW, VIEW_PITCH = math.radians(35), math.radians(20)
MAX_POSES = 12  # of a strip; fewer where a body is long


def swinging(windows: int, frames: int, speed: float, turn_deg: float) -> Path2D:
    """A path of as many chained windows: ahead at ``speed`` (m/s), turning to either side at up to ``turn_deg`` a second."""
    time = torch.arange(frames + (windows - 1) * (frames - CONTEXT_FRAMES)) / FPS
    heading = math.radians(turn_deg) * PERIOD_S / (2 * math.pi) * torch.sin(2 * math.pi * time / PERIOD_S)
    step = speed / FPS * torch.stack([torch.sin(heading), torch.cos(heading)], -1)
    return Path2D(step.cumsum(0)[None], heading[None])


def seams(windows: int, frames: int) -> list[int]:
    """First new frames of all windows but the first."""
    return [frames + n * (frames - CONTEXT_FRAMES) for n in range(windows - 1)]


def chained(body: Body, network: Network, path: Path2D, style: np.ndarray, setting: Setting) -> Answer:
    """A motion along a path `swinging` over several windows: each goes on from the last four frames of the one before."""
    denoiser, kinematics = network.denoiser(body), BodyKinematics(body)
    fresh = setting.frames - CONTEXT_FRAMES
    roots, bends = torch.empty(1, 0, 3), torch.empty(1, 0, body.joint_count, 3, 3)
    for number in range((path.heading.shape[1] - CONTEXT_FRAMES) // fresh):
        some = slice(number * fresh, number * fresh + setting.frames)
        part = Path2D(path.points[:, some], path.heading[:, some])
        given = known = None
        if number:
            past = roots[:, -CONTEXT_FRAMES:], matrix_to_six_d(bends[:, -CONTEXT_FRAMES:])
            lead = Path2D(part.points[:, :CONTEXT_FRAMES], part.heading[:, :CONTEXT_FRAMES])
            known = np.zeros((body.joint_count + 1, setting.frames, 6), np.float32)
            known[:, :CONTEXT_FRAMES] = encode(body, *past, lead, network.limits)[0].numpy()
            given = (np.arange(setting.frames) < CONTEXT_FRAMES).astype(np.float32)
        features = part.features(body.size_m)[0].numpy()
        one = Character(body, features, style, setting.seed + number, given, known, setting.guidance)
        root, turned = decode(body, sampled(denoiser, [one], setting.steps), part, network.limits)
        keep = slice(CONTEXT_FRAMES if number else 0, None)
        roots, bends = torch.cat([roots, root[:, keep]], 1), torch.cat([bends, turned[:, keep]], 1)
    return Answer(roots, kinematics.turned(bends))


def walk_figures(body: Body, answer: Answer, path: Path2D, setting: Setting) -> dict[str, float]:
    """How a chained motion keeps to its path, slides, and what its seams show."""
    positions = BodyKinematics(body).positions(answer.root, answer.turned)[0]  # [T, J, 3]
    frames = len(positions)
    acceleration = (positions[2:] - 2 * positions[1:-1] + positions[:-2]).norm(dim=-1).mean(1) * FPS**2
    at = [
        seam - 2 for seam in seams(_windows(frames, setting), setting.frames)
    ]  # the last given frame, as in `measure.py`
    found = {
        "path_position_m": float((answer.root[0][:, [0, 2]] - path.points[0, :frames]).norm(dim=-1).mean()),
        "jitter_mps2": float(acceleration.mean()),
    }
    if at:
        found["seam_mps2"] = float(acceleration[at].mean())
    if body.skeleton.contact_joints:
        feet = positions[:, body.skeleton.contact_joints]
        above = feet[1:, :, 1] - torch.tensor(body.skeleton.contact_clearance_m)
        step = (feet[1:] - feet[:-1])[..., [0, 2]].norm(dim=-1)
        found["foot_skate_m_per_frame"] = float((step * near_ground(above)).mean())
    return found


def _windows(frames: int, setting: Setting) -> int:
    return (frames - CONTEXT_FRAMES) // (setting.frames - CONTEXT_FRAMES)


def _seen(points: torch.Tensor) -> np.ndarray:
    """Points ``[..., 3]`` as a far camera to the side and above sees them ``[..., 2]``."""
    x, y, z = points.unbind(-1)
    across = z * math.cos(VIEW_YAW) - x * math.sin(VIEW_YAW)
    away = z * math.sin(VIEW_YAW) + x * math.cos(VIEW_YAW)
    return torch.stack([across, y * math.cos(VIEW_PITCH) + away * math.sin(VIEW_PITCH)], -1).numpy()


def draw_walk(axis: Axes, body: Body, answer: Answer, path: Path2D) -> None:
    """Poses of a motion along its path, as sticks."""
    positions = BodyKinematics(body).positions(answer.root, answer.turned)[0]
    ground = torch.stack([path.points[0, :, 0], torch.zeros(path.points.shape[1]), path.points[0, :, 1]], -1)
    axis.plot(*_seen(ground).T, color="0.75", lw=1.0)
    length = float((ground[1:] - ground[:-1]).norm(dim=-1).sum())
    extent = float(np.ptp(body.places()[:, 2]))
    poses = int(np.clip(length / (1.2 * max(extent, 1e-3)), 3, MAX_POSES))
    for nth, frame in enumerate(np.linspace(0, len(positions) - 1, poses).astype(int)):
        joints, shade = _seen(positions[frame]), 0.25 + 0.6 * nth / (poses - 1)
        for j, parent in enumerate(body.skeleton.parents):
            if parent >= 0:
                axis.plot(*joints[[parent, j]].T, color=(0.15, 0.2 + 0.4 * shade, shade), lw=1.2)
    axis.set_title(body.name, fontsize=9, loc="left")
    axis.set_aspect("equal")
    axis.axis("off")


def film(
    bodies: list[Body], network: Network, style: np.ndarray, path: Path2D, setting: Setting, out: Path
) -> dict[str, dict[str, float]]:
    """Draws one path walked by several bodies, and says how each did."""
    figure = Figure(figsize=(7, 2.4 * len(bodies)))
    axes = figure.subplots(len(bodies), 1, squeeze=False)[:, 0]
    found = {}
    for nth, (body, axis) in enumerate(zip(bodies, axes, strict=True)):
        answer = chained(body, network, path, style, replace(setting, seed=setting.seed + 1000 * nth))
        found[body.name] = walk_figures(body, answer, path, setting)
        draw_walk(axis, body, answer, path)
    figure.tight_layout()
    figure.savefig(out, dpi=110)
    return found
