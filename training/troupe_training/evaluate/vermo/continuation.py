"""Prediction and in-between: how far from what was captured, how like captures as a set, and how different from one another.

A crop of 80 frames is split as the paper splits it: 40 % given and 60 % made, or 20 / 60 / 20. The baselines go on with the last
velocity in the last pose, or interpolate. Motions are placed by the last given frame. Tokens do not know where the motion is that
a gap leads to, so a gap is also measured *joined*: what is missing to that place is spread evenly over its frames.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix
from troupe_training.evaluate.distribution import Gaussian, frechet, pairwise_distance
from troupe_training.evaluate.vermo.answers import Clip, Model, captured, markdown, world
from troupe_training.models.vermo.config import RATE
from troupe_training.models.vermo.frames import Body, features, state_of, turned
from troupe_training.models.vermo.messages import Message
from troupe_training.train.vermo.corpus import Crop, Motions

TOKENS = 20
SPLITS = {"prediction": (8, 0), "inbetween": (4, 4)}  # tokens before and behind
ANCHOR = 3  # frame of a window that the evaluator's segments have at the origin
VELOCITY_FRAMES = 4  # of which the last velocity is the mean
Latents = Callable[[Tensor, Tensor, Tensor], np.ndarray]
Figures = dict[str, float]
Method = Callable[["Window", int], Clip]


@dataclass
class Window:
    """A captured crop, and the frames of it that are given before and behind."""

    crop: Crop
    truth: Clip
    before: int
    behind: int

    def made(self, clip: Clip) -> Clip:
        """The frames that were to be made."""
        return clip.part(self.before, len(clip.pose) - self.behind)


def moved(clip: Clip, frame: int, to: Tensor) -> Clip:
    """The motion turned and shifted on the ground so that the root of a frame stands where ``to`` ``[5]`` does."""
    own = clip.root[frame]
    cosine, sine = to[3] * own[3] + to[4] * own[4], to[4] * own[3] - to[3] * own[4]
    ground = torch.tensor([1.0, 0.0, 1.0])
    place = turned((clip.root[:, :3] - own[:3] * ground), cosine, sine) + to[:3] * ground
    heading = turned(torch.stack([clip.root[:, 4], torch.zeros(len(clip.root)), clip.root[:, 3]], -1), cosine, sine)
    pose = turned(clip.pose.unflatten(-1, (-1, 3)), cosine, sine).flatten(1)
    return Clip(pose, torch.cat([place, heading[:, 2:], heading[:, :1]], -1))


def joined(clip: Clip, window: Window) -> Clip:
    """A gap's motion with what is missing to the place behind it spread over its frames."""
    end = len(clip.pose) - window.behind
    missing = window.truth.root[end, :3] - clip.root[end, :3]
    share = ((torch.arange(len(clip.pose)) - window.before + 1) / (end - window.before + 1)).clamp(0.0, 1.0)
    root = clip.root.clone()
    root[:, [0, 2]] += share[:, None] * missing[[0, 2]]
    return Clip(clip.pose, root)


def on_way(clip: Clip, way: Clip) -> Clip:
    """The poses of a motion on the root of another, as a server has words fill a gap: they turn with it, and take its height."""
    own, to = clip.root, way.root
    cosine, sine = to[:, 3] * own[:, 3] + to[:, 4] * own[:, 4], to[:, 4] * own[:, 3] - to[:, 3] * own[:, 4]
    pose = turned(clip.pose.unflatten(-1, (-1, 3)), cosine[:, None], sine[:, None]).unflatten(1, (-1, 3))
    pose[:, :, 0, 1] += (to[:, 1] - own[:, 1])[:, None]
    return Clip(pose.flatten(1), to)


def last_velocity(body: Body) -> Method:
    """Goes on with the last velocity and turn, in the last pose."""

    def method(window: Window, _: int) -> Clip:
        truth, before = window.truth, window.before
        states = state_of(features(truth.pose[None, :before], truth.root[None, :before]))
        going = states[:, -1:].clone()
        going[..., -4:-1] = states[:, -1 - VELOCITY_FRAMES : -1, -4:-1].mean(1, keepdim=True)
        pose, root = body.frames(going.expand(-1, len(truth.pose) - before + 1, -1))
        after = moved(Clip(pose[0], root[0]), 0, truth.root[before - 1])
        return Clip(torch.cat([truth.pose[:before], after.pose[1:]]), torch.cat([truth.root[:before], after.root[1:]]))

    return method


def interpolated(body: Body) -> Method:
    """Poses and root from the last frame before the gap to the first behind it, evenly."""

    def method(window: Window, _: int) -> Clip:
        truth, first, end = window.truth, window.before - 1, len(window.truth.pose) - window.behind
        share = (torch.arange(end - first + 1) / (end - first))[:, None]
        root = torch.lerp(truth.root[first], truth.root[end], share)
        root[:, 3:] = root[:, 3:] / root[:, 3:].norm(dim=-1, keepdim=True).clamp_min(1e-6)
        six_d = [truth.pose[frame].unflatten(-1, (-1, 9))[:, 3:] for frame in (first, end)]
        rotations = six_d_to_matrix(torch.lerp(six_d[0], six_d[1], share[..., None]))
        positions = body.positions(rotations[None], root[None, :, 1])[0]
        pose = torch.cat([positions, matrix_to_six_d(rotations)], -1).flatten(1)
        return Clip(
            torch.cat([truth.pose[:first], pose, truth.pose[end + 1 :]]),
            torch.cat([truth.root[:first], root, truth.root[end + 1 :]]),
        )

    return method


def windows_of(motions: Motions, task: str, most: int) -> list[Window]:
    """At most so many windows of clips that are long enough, from the middle of each."""
    before, behind = SPLITS[task]
    long = [n for n, clip in enumerate(motions.clips) if clip["frames"] >= TOKENS * RATE]
    chosen = [long[n * len(long) // min(most, len(long))] for n in range(min(most, len(long)))]
    windows = []
    for n in chosen:
        clip = motions.clips[n]
        crop = Crop(n, clip["start"] + (clip["frames"] - TOKENS * RATE) // 2, TOKENS)
        windows.append(Window(crop, captured(motions, crop), before * RATE, behind * RATE))
    return windows


def answered(model: Model, motions: Motions, task: str, windows: list[Window], seed: int, steps: int) -> list[Clip]:
    """The model's motions, each with what was given as its tokens have it, placed by the last frame before."""
    before, behind = SPLITS[task]
    messages = []
    for window in windows:
        start = window.crop.start
        runs = [motions.codes(start, before)]
        if behind:
            runs.append(motions.codes(start + (TOKENS - behind) * RATE, behind))
        messages.append(Message(task, condition=[runs], length=TOKENS - before - behind))
    made = model.replies(messages, seed)
    codes = [
        m.condition[0][0] + row + (m.condition[0][1] if behind else []) for m, row in zip(messages, made, strict=True)
    ]
    clips = model.motions(codes, steps, seed)
    return [moved(clip, w.before - 1, w.truth.root[w.before - 1]) for clip, w in zip(clips, windows, strict=True)]


def latents(encode: Latents, windows: list[Window], clips: list[Clip]) -> np.ndarray:
    """The evaluator's latents of the made frames."""
    origin = torch.tensor([0.0, 0.0, 0.0, 1.0, 0.0])
    rows = [moved(part, ANCHOR, origin) for part in (w.made(c) for w, c in zip(windows, clips, strict=True))]
    features_of = torch.stack([row.pose for row in rows]).unflatten(-1, (-1, 9))
    root = torch.stack([row.root for row in rows])
    return encode(root, features_of[..., :3].contiguous(), features_of[..., 3:].contiguous())


def figures_of(windows: list[Window], samples: list[list[Clip]], encode: Latents | None) -> Figures:
    """Means over windows and samples: joints' distance to captures (m), FID, and distance between samples (m)."""
    errors = []
    for clips in samples:
        for window, clip in zip(windows, clips, strict=True):
            error = (world(window.made(clip)) - world(window.made(window.truth))).norm(dim=-1).mean(-1)
            errors.append([float(error.mean()), float(error[-1])])
    figures: Figures = {"windows": len(windows)}
    figures |= zip(("ade", "fde"), np.mean(errors, 0).tolist(), strict=True)
    if encode is not None:
        truth = Gaussian(latents(encode, windows, [w.truth for w in windows]))
        figures["fid"] = float(
            np.mean([frechet(Gaussian(latents(encode, windows, clips)), truth) for clips in samples])
        )
    if len(samples) > 1:
        joints = torch.stack(
            [torch.stack([world(w.made(c)) for w, c in zip(windows, clips, strict=True)]) for clips in samples]
        )
        figures["diversity"] = float(pairwise_distance(joints).mean())
    return figures


def continuation_table(figures: dict[str, Figures]) -> str:
    """Rows by task, split and method."""
    header = ["", "windows", "ADE (mm)", "FDE (mm)", "FID", "diversity (mm)"]
    rows = []
    for name, f in figures.items():
        row = [name, f"{f['windows']:.0f}", f"{1e3 * f['ade']:.0f}", f"{1e3 * f['fde']:.0f}"]
        row.append(f"{f['fid']:.3f}" if "fid" in f else "")
        rows.append([*row, f"{1e3 * f['diversity']:.0f}" if "diversity" in f else ""])
    return markdown(header, rows)
