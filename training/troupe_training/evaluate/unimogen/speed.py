"""How fast the network is in PyTorch: one motion alone, and a batch of all bodies in one ragged call.

`python -m troupe_training.evaluate.unimogen.speed` beside `cargo run --release -p troupe-eval -- unimogen`, in turns.
Weights are random: they cost the same.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import torch

from troupe_training.data.bodies import Body
from troupe_training.models.unimogen.config import PATH_FEATURES, PRESETS, SAMPLER_STEPS
from troupe_training.models.unimogen.network import UniMoGen
from troupe_training.models.unimogen.sampler import INPUTS, Arrays, Character, Denoiser, sample

ROUNDS = 3  # of which the best counts
WORDS = 64  # length of the style vector


def denoiser(network: UniMoGen, bf16: bool) -> Denoiser:
    """The network as the sampler calls it."""

    def run(arrays: Arrays) -> np.ndarray:
        with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            clean = network(*(torch.from_numpy(arrays[name]) for name in INPUTS))
        return clean.float().numpy()

    return run


def walker(body: Body, frames: int, seed: int) -> Character:
    """Somebody who goes ahead without a style."""
    path = np.tile(np.array([0.0, 1.3, 0.0], np.float32), (frames, 1))
    assert path.shape[1] == PATH_FEATURES
    return Character(body, path, np.zeros(WORDS, np.float32), seed)


def best_s(run: Callable[[], object]) -> float:
    """The least time of a few runs, after one that does not count."""
    run()
    times = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    """Prints a line for each body, and one for each size of a batch."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, default=Path("runs/unimogen-cache"), help="`unimogen prepare` wrote it")
    parser.add_argument("--frames", type=int, default=68)
    parser.add_argument("--batches", type=int, nargs="*", default=[8, 32], help="motions of a call")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    torch.manual_seed(0)
    network = UniMoGen(PRESETS["default"], WORDS).eval()
    bodies = [Body.load(path) for path in sorted(options.cache.glob("*/body.json"))]
    for bf16 in (False, True):
        print(f"{'bf16 autocast' if bf16 else 'f32'}, {options.threads} threads, {options.frames} frames")
        report(denoiser(network, bf16), bodies, options.frames, options.batches)


def report(run: Denoiser, bodies: list[Body], frames: int, batches: list[int]) -> None:
    """One motion of each body, and batches of them all."""
    print("  one motion alone, ms")
    for body in bodies:
        one = [walker(body, frames, 0)]
        took = best_s(partial(sample, run, one, SAMPLER_STEPS))
        print(f"    {body.name:8} {body.joint_count:3} joints {took * 1000:7.1f}")
    for count in batches:
        crowd = [walker(bodies[i % len(bodies)], frames, i) for i in range(count)]
        took = best_s(partial(sample, run, crowd, SAMPLER_STEPS))
        print(f"  {count} motions of all bodies in a call: {count / took:.1f} motions/s")


if __name__ == "__main__":
    main()
