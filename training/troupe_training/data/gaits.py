"""Root motion for gaits that walk in place: the body moves as its stance feet say, which are held.

Animators key a walk cycle on the spot. A foot that stands then slides backwards as fast as the body should move forwards.
"""

import re
from dataclasses import dataclass

import numpy as np

from troupe_training.data.clips import FileMotion
from troupe_training.data.conventions import FPS

GAIT = re.compile(r"walk|run|trot|gallop|canter|sneak|crawl|turn|hop", re.IGNORECASE)
TURN = re.compile("turn", re.IGNORECASE)
WITHOUT_GROUND = re.compile(r"swim|fly|flap|glide|wind", re.IGNORECASE)
# Shares of the body's size.
STANCE_HEIGHT, SLOW_PER_S = 0.012, 0.15
FOOT_HEIGHT = 0.03
MIN_STANCE_SHARE = 0.2  # of the frames
MAX_RESIDUAL = 0.6  # what of the speed of stance feet no motion of the body explains
CYCLE_RAD, CYCLE_STEPS, MIN_LOOP_FRAMES = 0.15, 1.5, 120
MAX_LOOPS = 12
SMOOTH_FRAMES = 1.5


@dataclass
class Moved:
    """A clip with root motion; ``reason`` if it is left out instead."""

    motion: FileMotion | None
    note: str | None = None
    reason: str | None = None


def feet_of(rest: FileMotion, sides: list[int]) -> list[int]:
    """Ends of left and right limbs that stand on the ground in the rest pose."""
    height = rest.positions[0, :, 1]
    extent = float(np.ptp(rest.positions[0], axis=0).max())
    leaves = [j for j in range(len(rest.names)) if j not in rest.parents and sides[j]]
    if not leaves or abs(min(height[leaves])) > 0.1 * extent:
        return []
    return [j for j in leaves if height[j] < min(height[leaves]) + FOOT_HEIGHT * extent]


def is_cycle(motion: FileMotion) -> bool:
    """True if the last pose leads back to the first."""
    if len(motion.positions) <= 8:
        return False
    back = _turned(motion.rotations[-1:], motion.rotations[:1]).max()
    step = _turned(motion.rotations[:-1], motion.rotations[1:]).max()
    return bool(back < max(CYCLE_RAD, CYCLE_STEPS * step))


def _turned(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between rotations ``[..., 3, 3]``."""
    return np.arccos(((np.einsum("...ik,...ik->...", a, b) - 1) / 2).clip(-1, 1))


def with_root_motion(name: str, motion: FileMotion, feet: list[int], size: float) -> Moved:
    """Adds the root motion that held stance feet ask for where a gait walks in place, and repeats cycles.

    ``feet`` are joints that may touch the ground, ``size`` (m) is that of the body. Clips that are no gaits stay as they are.
    """
    still = np.zeros((len(motion.positions), 2))
    if WITHOUT_GROUND.search(name):
        return Moved(None, reason="moves without feet on the ground; its root motion is not known")
    if GAIT.search(name) is None:
        return Moved(repeated(motion, still) if is_cycle(motion) else motion)
    if TURN.search(name):
        # Two to four feet that slide in several directions tell a turn too roughly.
        return Moved(None, reason="turns on the spot; its stance feet do not tell how fast")
    if not feet:
        return Moved(None, reason="a gait of a body without feet; its root motion is not known")
    height = motion.positions[:, feet, 1]
    lowest = np.percentile(height, 1, axis=0)
    low = (height < lowest + STANCE_HEIGHT * size) & (lowest < lowest.min() + FOOT_HEIGHT * size)
    stands = low[1:] & low[:-1]
    if stands.any(1).mean() < MIN_STANCE_SHARE:
        return Moved(None, reason="a gait without stance feet; its root motion is not known")
    velocity = np.diff(motion.positions[:, feet][..., [0, 2]], axis=0) * FPS
    speed = float(np.linalg.norm(velocity[stands], axis=-1).mean())
    if speed < SLOW_PER_S * size:
        kept = repeated(motion, still) if is_cycle(motion) else motion
        return Moved(kept, f"its stance feet hold already ({speed:.2f} m/s)")
    body, residual = _body_motion(velocity, stands)
    if residual > MAX_RESIDUAL * speed:
        reason = f"its stance feet slide at {speed:.2f} m/s, and by {residual:.2f} m/s with any motion of the body"
        return Moved(None, reason=reason)
    step = np.concatenate([np.zeros((1, 2)), _smooth(body, is_cycle(motion)) / FPS])
    pace = np.linalg.norm(body.mean(0))
    note = f"moves at {pace:.2f} m/s, as its stance feet say (they slide at {residual:.2f} m/s all the same)"
    return Moved(repeated(motion, step) if is_cycle(motion) else _moved(motion, step), note)


def _body_motion(velocity: np.ndarray, stands: np.ndarray) -> tuple[np.ndarray, float]:
    """Velocity x, z ``[F, 2]`` of the body that holds its stance feet, and the speed that remains (m/s).

    ``velocity`` ``[F, C, 2]`` is that of the feet on the spot, m/s.
    """
    weights, known = stands.astype(float)[..., None], np.flatnonzero(stands.any(1))
    mean = -(velocity * weights).sum(1)[known] / weights.sum(1)[known]
    body = np.stack([np.interp(np.arange(len(velocity)), known, mean[:, axis]) for axis in range(2)], -1)
    return body, float(np.linalg.norm(velocity + body[:, None], axis=-1)[stands].mean())


def _smooth(values: np.ndarray, cycle: bool) -> np.ndarray:
    """A Gaussian filter over frames ``[F, D]``, around the end of a cycle."""
    taps = np.arange(-4, 5)
    kernel = np.exp(-0.5 * (taps / SMOOTH_FRAMES) ** 2)
    padded = np.pad(values, ((4, 4), (0, 0)), mode="wrap" if cycle else "edge")
    return np.stack([padded[f : f + 9].T @ kernel / kernel.sum() for f in range(len(values))])


def _moved(motion: FileMotion, step: np.ndarray) -> FileMotion:
    """The motion carried along by steps of the root ``[F, 2]``, x and z, metres a frame."""
    path = np.zeros((len(step), 1, 3))
    path[:, 0, [0, 2]] = np.cumsum(step, 0)
    return FileMotion(
        motion.names, motion.parents, motion.offsets, motion.positions + path, motion.rotations, motion.notes
    )


def repeated(motion: FileMotion, step: np.ndarray) -> FileMotion:
    """A cycle over and over, to about four seconds; ``step`` ``[F, 2]`` is what the root moves by in each frame (`_moved`)."""
    back = _turned(motion.rotations[-1], motion.rotations[0]).max()
    step_rad = float(np.median(_turned(motion.rotations[:-1], motion.rotations[1:]).max(1)))
    # Where the last frame is the first again it counts once; keys that do not fall on frames end a
    # part of one before that.
    first = 1 if back < 0.5 * step_rad else 0
    cycle = np.arange(first, len(motion.positions))
    times = min(MAX_LOOPS, max(1, -(-MIN_LOOP_FRAMES // len(cycle))))
    index = np.concatenate([np.arange(first), np.tile(cycle, times)])
    step = step.copy()
    step[0] = 0.0 if first else step[1:].mean(0)
    # The root's drift over a cycle is spread over all of its frames.
    drift = np.linspace(0, 1, len(motion.positions))[:, None, None] * (motion.positions[-1, 0] - motion.positions[0, 0])
    closed = (motion.positions - drift)[index]
    whole = FileMotion(motion.names, motion.parents, motion.offsets, closed, motion.rotations[index], motion.notes)
    return _moved(whole, step[index])
