"""How the root of a walking body moves about its way, by gait and speed: measured in captures, for the server's drawn paths.

A root sways to the side with each stride, hurries and slows with each step, and turns with the legs. All of it is a wave of
the stride's rate, with its phase in the distance of the feet.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from troupe_training.data.bodies_store import BodyStore
from troupe_training.data.conventions import FPS
from troupe_training.data.rotations import six_d_to_matrix
from troupe_training.evaluate.unimogen.measure import BATCH, toes
from troupe_training.evaluate.unimogen.methods import Asked
from troupe_training.evaluate.unimogen.user_paths import MAX_ASIDE_RAD, MAX_TURN_DEG_PER_S, gait_of
from troupe_training.models.unimogen.state import BodyKinematics

FRAMES = 68
STRIDE = 8  # frames between the windows
MIN_SPEED = 0.2  # body sizes a second
RATES_HZ = torch.arange(0.4, 3.0, 0.025, dtype=torch.float64)  # of strides
MAX_LEFT = 0.3  # share of the feet's distance that a wave of one rate may leave
HARMONICS = 2
SIGNALS = ("left_m", "ahead_m", "heading_rad", "stride_m")
MIN_WINDOWS = 20  # of a word
MAX_SPEEDS, MIN_APART_MPS = 5, 0.15  # speeds of a gait
OUTER = (5, 95)  # percentiles of the windows' speeds


@dataclass
class Strides:
    """Straight windows in which the feet pass each other evenly, ``[N]`` each."""

    speed_mps: Tensor
    rate_hz: Tensor
    waves: Tensor  # [N, 4, 2 HARMONICS]: cosine and sine of each multiple of the phase, see `SIGNALS`
    clips: Tensor


def feet_of(body: Any) -> list[int]:
    """The left and the right foot of a body that has one of each, else nothing."""
    ends = [body.skeleton.contact_joints[place] for place in toes(body)]
    left, right = ([joint for joint in ends if body.sides[joint] == side] for side in (1, -1))
    return [*left, *right] if len(left) == len(right) == 1 else []


def strides_of(store: BodyStore, feet: list[int]) -> Strides:
    """The strides of all captured windows that go straight on."""
    starts, owners = store.every(FRAMES, STRIDE)
    gait = gait_of(store, starts, FRAMES)
    straight = (gait.turn_deg_per_s.abs() < MAX_TURN_DEG_PER_S) & (gait.aside_rad < MAX_ASIDE_RAD)
    which = straight & (gait.speed_mps > MIN_SPEED * store.body.size_m)
    starts, owners = starts[which], owners[which]
    kinematics, parts = BodyKinematics(store.body), []
    for chunk in range(0, len(starts), BATCH):
        some = slice(chunk, chunk + BATCH)
        asked = Asked.of(store, starts[some], owners[some], FRAMES)
        windows = asked.windows
        places = kinematics.positions(windows.root, kinematics.turned(six_d_to_matrix(windows.bends)))
        parts.append(_strides(windows.root, windows.heading, places[:, :, feet], owners[some]))
    return Strides(*(torch.cat([getattr(part, name) for part in parts]) for name in Strides.__dataclass_fields__))


def _strides(root: Tensor, heading: Tensor, feet: Tensor, clips: Tensor) -> Strides:
    time = torch.arange(FRAMES, dtype=torch.float64) / FPS
    trend = torch.stack([torch.ones(FRAMES, dtype=torch.float64), time - time.mean(), (time - time.mean()) ** 2], -1)
    ground = root[..., [0, 2]].double()
    velocity = torch.linalg.lstsq(trend.expand(len(root), -1, -1), ground).solution[:, 1]
    speed = velocity.norm(dim=-1)
    ahead = (velocity / speed[:, None])[:, None]
    left = torch.stack([ahead[..., 1], -ahead[..., 0]], -1)
    stride = ((feet[:, :, 0] - feet[:, :, 1])[..., [0, 2]].double() * ahead).sum(-1)
    stride_even = stride - stride.mean(1, keepdim=True)
    rest, phase, rate = _rhythm(stride_even, time)
    turned = torch.from_numpy(np.unwrap(heading.double().numpy(), axis=1))
    signals = torch.stack([(ground * left).sum(-1), (ground * ahead).sum(-1), turned, stride], -1)
    waves = [wave(n * phase) for n in range(1, HARMONICS + 1) for wave in (torch.cos, torch.sin)]
    design = torch.cat([trend.expand(len(root), -1, -1), torch.stack(waves, -1)], -1)
    fitted = torch.linalg.lstsq(design, signals).solution[:, trend.shape[1] :]
    even = rest < MAX_LEFT
    return Strides(speed[even], rate[even], fitted.transpose(1, 2)[even], clips[even])


def _rhythm(stride: Tensor, time: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """What the best wave of one rate leaves of distances ``[B, T]``, as a share; its phase ``[B, T]``; its rate ``[B]``."""
    best = torch.full((len(stride),), math.inf, dtype=torch.float64)
    phase, rate = torch.zeros_like(stride), torch.zeros_like(best)
    power = stride.square().mean(1).clamp_min(1e-12)
    for hz in RATES_HZ:
        angle = 2 * math.pi * hz * time
        wave = torch.stack([torch.cos(angle), torch.sin(angle)], -1)
        fitted = torch.linalg.lstsq(wave, stride.T).solution
        rest = (wave @ fitted - stride.T).square().mean(0) / power
        better = rest < best
        best = torch.where(better, rest, best)
        rate = torch.where(better, hz, rate)
        phase = torch.where(better[:, None], angle - torch.atan2(fitted[1], fitted[0])[:, None], phase)
    return best, phase, rate


def sway_table(store: BodyStore) -> dict[str, Any]:
    """The table ``[sway]`` of a body's file; empty without two feet or without walks."""
    feet = feet_of(store.body)
    if not feet:
        return {}
    strides = strides_of(store, feet)
    if len(strides.speed_mps) < MIN_WINDOWS:
        return {}
    shown = store.clip_words[strides.clips] > 0
    gaits = [_gait(strides, torch.ones(len(shown), dtype=torch.bool))]
    for place, word in enumerate(store.words):
        if int(shown[:, place].sum()) >= MIN_WINDOWS:
            gaits.append({"word": word} | _gait(strides, shown[:, place]))
    return {"feet": [store.body.skeleton.names[joint] for joint in feet], "gaits": gaits}


def _gait(strides: Strides, which: Tensor) -> dict[str, Any]:
    """Means about a few speeds, with weights that fall with the distance in speed."""
    speed = strides.speed_mps[which]
    low, high = np.percentile(speed.numpy(), OUTER)
    count = int(np.clip((high - low) / MIN_APART_MPS + 1, 1, MAX_SPEEDS))
    speeds = np.linspace(low, high, count) if count > 1 else np.array([np.median(speed.numpy())])
    width = max(MIN_APART_MPS, (high - low) / count) / 2
    share = torch.softmax(-0.5 * ((speed - torch.from_numpy(speeds)[:, None]) / width) ** 2, 1)
    waves = torch.einsum("kn,nsh->ksh", share, strides.waves[which])
    gait: dict[str, Any] = {
        "speeds_mps": [round(float(v), 3) for v in speeds],
        "rates_hz": [round(float(v), 3) for v in share @ strides.rate_hz[which]],
    }
    for place, name in enumerate(SIGNALS):
        gait[name] = [[round(float(v), 4) for v in row] for row in waves[:, place]]
    return gait
