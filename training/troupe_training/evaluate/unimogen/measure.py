"""Figures of a UniMoGen network without a server: path, feet, distance to captures, on test clips and held-out cells.

Every window has four frames of past, a path that is the captured root's own, and its clip's words; the network answers the rest.
All is measured on the network's own root and bends, before anything is pinned.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from troupe_training.data.bodies import Body
from troupe_training.data.bodies_store import BodyStore
from troupe_training.data.conventions import CONTEXT_FRAMES, FPS, MAX_FRAMES
from troupe_training.data.kinematics import near_ground
from troupe_training.data.motion import Motion
from troupe_training.data.rotations import matrix_to_six_d, wrap_angle, yaw_matrix
from troupe_training.evaluate.distribution import Gaussian, frechet
from troupe_training.evaluate.unimogen.encoders import Encoder
from troupe_training.evaluate.unimogen.methods import Answer, Asked, Method, Setting, captured, counterparts
from troupe_training.models.unimogen.state import BodyKinematics, Path2D

TOE_MARGIN_M = 0.01  # the paper's height of a toe that slides, and what a toe may be below where it stands
BATCH = 8
MIN_FOR_FID = 64
Figures = dict[str, float]


def toes(body: Body) -> list[int]:
    """Those of the contact joints that have no contact joint below them, by their place in the list: toes, not ankles."""
    contacts = body.skeleton.contact_joints
    above = {ancestor for joint in contacts for ancestor in body.ancestors(joint)}
    return [place for place, joint in enumerate(contacts) if joint not in above]


def _foot_figures(body: Body, positions: Tensor) -> dict[str, Tensor]:
    """Figures ``[B]`` of feet, over the frames after the past, of joint positions ``[B, T, J, 3]``."""
    contacts, ends = body.skeleton.contact_joints, toes(body)
    feet = positions[:, CONTEXT_FRAMES - 1 :, contacts]
    step = (feet[:, 1:] - feet[:, :-1])[..., [0, 2]].norm(dim=-1)
    above = feet[:, 1:, :, 1] - torch.tensor(body.skeleton.contact_clearance_m)
    sunk = above < -TOE_MARGIN_M
    found = {
        "foot_penetration_share": sunk[..., ends].any(-1).float().mean(1),
        "foot_sliding_m": (step * (above < TOE_MARGIN_M))[..., ends].sum(1).mean(1),
        "foot_skate_m_per_frame": (step * near_ground(above)).mean((1, 2)),
        "standing_foot_m_per_frame": step[..., ends].amin(-1).mean(1),
        "toe_highest_m": above[..., ends].amax((1, 2)),
    }
    for side, sign in (("left", 1), ("right", -1)):
        of_side = [place for place in ends if body.sides[contacts[place]] == sign]
        if of_side:
            found[f"{side}_penetration_share"] = sunk[..., of_side].any(-1).float().mean(1)
    return found


def figures(body: Body, answer: Answer, truth: Answer, path: Path2D) -> dict[str, np.ndarray]:
    """Figures ``[B]`` by name, over the frames after the past."""
    kinematics = BodyKinematics(body)
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
    if body.skeleton.contact_joints:
        found |= _foot_figures(body, positions)
    return {name: values.double().numpy() for name, values in found.items()}


def in_segment_frame(body: Body, answer: Answer) -> tuple[Motion, Tensor]:
    """The first 64 frames seen from the last one of the past: its point on the ground is the origin, its heading +Z.

    Also joint positions ``[B, T, J, 3]`` relative to the root's point on the ground in each frame.
    """
    answer = Answer(answer.root[:, :MAX_FRAMES], answer.turned[:, :MAX_FRAMES])
    kinematics, anchor = BodyKinematics(body), CONTEXT_FRAMES - 1
    left = answer.turned[:, anchor, 0, :, 0]
    back = yaw_matrix(-torch.atan2(-left[:, 2], left[:, 0]))
    origin = answer.root[:, anchor : anchor + 1] * torch.tensor([1.0, 0.0, 1.0])
    root = torch.einsum("bij,btj->bti", back, answer.root - origin)
    rotations = back[:, None, None] @ kinematics.rotations(answer.turned)
    positions = kinematics.positions(torch.zeros_like(root), back[:, None, None] @ answer.turned)
    height = root * torch.tensor([0.0, 1.0, 0.0])
    return Motion(root, rotations), positions + height[:, :, None]


def latents_of(body: Body, encoder: Encoder, answer: Answer) -> np.ndarray:
    """Latents of the pack evaluator that knows this skeleton, ``[B, 256]``."""
    motion, positions = in_segment_frame(body, answer)
    global_root = motion.global_root(torch.tensor(body.skeleton.left_axis))
    return encoder(global_root, positions, matrix_to_six_d(motion.rotations))


def chosen(store: BodyStore, setting: Setting, donors: Sequence[BodyStore] = ()) -> tuple[Tensor, Tensor]:
    """First frames and clips of the windows to measure: those that every donor has as well, evenly over all."""
    starts, owners = store.every(setting.frames, setting.stride)
    for donor in donors:
        has = counterparts(store, donor, starts, owners, setting.frames)[0] >= 0
        starts, owners = starts[has], owners[has]
    if setting.most is not None and len(starts) > setting.most:
        which = torch.arange(setting.most) * len(starts) // setting.most
        starts, owners = starts[which], owners[which]
    return starts, owners


class Tally:
    """The answers of one method, window by window."""

    def __init__(self, store: BodyStore, encoder: Encoder | None):
        self.body, self.encoder = store.body, encoder
        self.parts: list[dict[str, np.ndarray]] = []
        self.latents: list[np.ndarray] = []
        self.positions: list[Tensor] = []

    def add(self, answer: Answer, truth: Answer, path: Path2D) -> None:
        """Measures some windows more."""
        self.parts.append(figures(self.body, answer, truth, path))
        self.positions.append(in_segment_frame(self.body, answer)[1][:, CONTEXT_FRAMES:])
        if self.encoder:
            self.latents.append(latents_of(self.body, self.encoder, answer))

    def encoded(self) -> np.ndarray:
        """All latents, if they are enough for a Fréchet distance; else none."""
        all_of_them = np.concatenate(self.latents) if self.latents else np.empty((0, 0))
        return all_of_them if len(all_of_them) >= MIN_FOR_FID else all_of_them[:0]

    def means(self) -> Figures:
        """Means over all windows, and how much motions differ from one another."""
        found = {key: float(np.concatenate([p[key] for p in self.parts]).mean()) for key in self.parts[0]}
        # The body's own pose: a joint's place relative to the root's point on the ground.
        found["diversity_between_motions_m2"] = float(torch.cat(self.positions).var(0).sum(-1).mean())
        return found


def measure(
    store: BodyStore,
    methods: dict[str, Method],
    setting: Setting,
    encoder: Encoder | None = None,
    donors: Sequence[BodyStore] = (),
) -> dict[str, Figures]:
    """Mean figures of each method over a body's windows, captures first.

    With an encoder also the Fréchet distance to the captures; that of the captures is between every other window and the rest.
    """
    starts, owners = chosen(store, setting, donors)
    truth_of = captured(store.body)
    methods = {"captured": truth_of} | methods
    found: dict[str, Figures] = {}
    true_latents: np.ndarray | None = None
    for name, method in methods.items():
        tally = Tally(store, encoder)
        for chunk in tqdm(range(0, len(starts), BATCH), desc=f"{store.body.name}: {name}", leave=False):
            some = slice(chunk, chunk + BATCH)
            asked = Asked.of(store, starts[some], owners[some], setting.frames)
            tally.add(method(asked), truth_of(asked), asked.path)
        found[name] = (tally.means() if len(starts) else {}) | {"windows": float(len(starts))}
        encoded = tally.encoded()
        if true_latents is None:
            true_latents = encoded
            pair = encoded[::2], encoded[1::2]
        else:
            pair = encoded, true_latents
        if len(encoded):
            found[name]["fid"] = frechet(Gaussian(pair[0]), Gaussian(pair[1]))
    return found


def why_no_fid(report: dict[str, Figures], without_encoder: str) -> str:
    """Why the methods of one table have no FID, in words; nothing if they have. ``without_encoder``: of `encoder_of`."""
    windows = report["captured"]["windows"]
    if without_encoder:
        return f"FID is not measured: {without_encoder}."
    if windows < MIN_FOR_FID:
        return f"FID is not measured: it needs at least {MIN_FOR_FID} windows, these are {windows:.0f}."
    return ""


NAMES = (
    "path_position_m",
    "path_rotation_deg",
    "foot_penetration_share",
    "left_penetration_share",
    "right_penetration_share",
    "foot_sliding_m",
    "foot_skate_m_per_frame",
    "standing_foot_m_per_frame",
    "toe_highest_m",
    "l2p_m",
    "jitter_mps2",
    "seam_mps2",
    "diversity_in_motion_m2",
    "diversity_between_motions_m2",
    "fid",
    "windows",
)


def table(report: dict[str, dict[str, Figures]], notes: dict[str, str]) -> str:
    """The figures as Markdown: a row for each body, split and method. ``notes``: `why_no_fid` of each body and split."""
    lines = [f"| what | method | {' | '.join(NAMES)} |", "|---" * (len(NAMES) + 2) + "|"]
    for what, methods in report.items():
        for method, values in methods.items():
            missing = {"fid": "not measured"} if notes.get(what) else {}
            cells = (f"{values[name]:.4g}" if name in values else missing.get(name, "–") for name in NAMES)
            lines.append(f"| {what} | {method} | {' | '.join(cells)} |")
    reasons = [f"- {what}: {note}" for what, note in notes.items() if note]
    return "\n".join([*lines, *([""] if reasons else []), *reasons]) + "\n"
