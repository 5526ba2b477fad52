"""The diffusion: cosine schedule, noise by seed and joint, and DDIM (paper, sections 3.1 and 3.3)."""

import math

import numpy as np

from troupe_training.models.unimogen.config import DIFFUSION_STEPS, ROW_CHANNELS

OFFSET = 0.008  # of the cosine schedule (Nichol and Dhariwal 2021)
MAX_BETA = 0.999
GOLDEN = 0x9E3779B97F4A7C15


def cosine_signal(steps: int = DIFFUSION_STEPS) -> np.ndarray:
    """Share of the signal's power (alpha bar) ``[steps]`` that is left at each diffusion step."""

    def f(t: float) -> float:
        return math.cos((t / steps + OFFSET) / (1 + OFFSET) * math.pi / 2) ** 2

    kept = [1.0 - min(1.0 - f(t + 1) / f(t), MAX_BETA) for t in range(steps)]
    return np.cumprod(kept)


def sampler_steps(count: int, steps: int = DIFFUSION_STEPS) -> list[int]:
    """The diffusion steps that a sampler of ``count`` steps visits: ``floor(steps (count - i) / count) - 1``."""
    if not 1 <= count <= steps:
        raise ValueError(f"{count} sampler steps, 1 to {steps} are possible")
    return [steps * (count - i) // count - 1 for i in range(count)]


def ddim(noisy: np.ndarray, clean: np.ndarray, step: int, then: int | None, signal: np.ndarray) -> np.ndarray:
    """From ``step`` to the next one, ``then``, without new noise; ``clean`` itself if there is none. 32 bits."""
    if then is None:
        return clean
    a, b = signal[step], signal[then]
    noise = (noisy - np.float32(math.sqrt(a)) * clean) / np.float32(math.sqrt(1 - a))
    mixed: np.ndarray = np.float32(math.sqrt(b)) * clean + np.float32(math.sqrt(1 - b)) * noise
    return mixed


def mix64(z: np.ndarray) -> np.ndarray:
    """The finaliser of splitmix64 (Steele et al. 2014) on ``uint64``, with wrapping products."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def row_noise(seed: int, row: int, frames: int) -> np.ndarray:
    """Standard normal noise ``[frames, 6]`` of one row of one character, 32 bits.

    Row 0 is the root's place, whose last three channels are 0; row ``j + 1`` is joint ``j``. A number depends on the seed, the
    row, the frame and the channel alone, never on the window's length or on who else is in the batch:

    - ``key = mix64(seed + GOLDEN (row + 1))``, ``u = mix64(key + GOLDEN (p + 1))`` with ``p = (6 frame + channel) / 2``, all
      modulo 2^64;
    - ``a = ((u >> 32) + 0.5) / 2^32``, ``b = ((u mod 2^32) + 0.5) / 2^32`` in 64 bits;
    - Box and Muller: ``sqrt(-2 ln a) cos(2 pi b)`` for even channels, ``sin`` for odd ones, rounded to 32 bits.
    """
    mask = (1 << 64) - 1
    key = mix64(np.array([(seed + GOLDEN * (row + 1)) & mask], dtype=np.uint64))
    pairs = np.arange(1, frames * ROW_CHANNELS // 2 + 1, dtype=np.uint64) * np.uint64(GOLDEN)
    u = mix64(key + pairs)
    a = ((u >> np.uint64(32)).astype(np.float64) + 0.5) / 2**32
    b = ((u & np.uint64(0xFFFFFFFF)).astype(np.float64) + 0.5) / 2**32
    radius, angle = np.sqrt(-2.0 * np.log(a)), 2.0 * np.pi * b
    noise = np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1).reshape(frames, ROW_CHANNELS)
    if row == 0:
        noise[:, ROW_CHANNELS // 2 :] = 0.0
    return noise.astype(np.float32)


def body_noise(seed: int, joints: int, frames: int) -> np.ndarray:
    """`row_noise` of a whole character ``[J + 1, frames, 6]``."""
    return np.stack([row_noise(seed, row, frames) for row in range(joints + 1)])
