"""Steps a crowd as fast as the server answers: python bench_crowd.py [ADDRESS] [--count 50] [--seconds 20].

All characters walk; every second each gets a new heading. Prints character frames a second and the time of a step, for floats
and compact frames in turns, and how much of it is this client's own work.
"""

import argparse
import time

import numpy as np

import troupe


def measure(client: troupe.Client, count: int, seconds: float, encoding: troupe.Encoding) -> None:
    """One turn."""
    random = np.random.default_rng(0)
    with client.crowd(count, frames=troupe.FrameOptions(encoding=encoding)) as crowd:
        crowd.step(30)
        times: list[float] = []
        processor = time.process_time()
        begin = time.perf_counter()
        while time.perf_counter() - begin < seconds:
            if len(times) % 30 == 0:
                heading = random.uniform(-np.pi, np.pi, count)
                crowd.walk(1.2 * np.stack([np.sin(heading), 0 * heading, np.cos(heading)], axis=1))
            since = time.perf_counter()
            crowd.step()
            times.append(time.perf_counter() - since)
        wall, own = time.perf_counter() - begin, time.process_time() - processor
    p50, p99 = (1e3 * float(value) for value in np.percentile(times, [50, 99]))
    print(
        f"{encoding.name:8} {count * len(times) / wall:10,.0f} character frames/s   "
        f"step p50 {p50:.2f} ms, p99 {p99:.2f} ms   client {1e3 * own / len(times):.2f} ms a step"
    )


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address", nargs="?", default="127.0.0.1:8080")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--turns", type=int, default=2)
    arguments = parser.parse_args()
    with troupe.Client(arguments.address) as client:
        for _ in range(arguments.turns):
            for encoding in (troupe.Encoding.F32, troupe.Encoding.COMPACT):
                measure(client, arguments.count, arguments.seconds, encoding)


if __name__ == "__main__":
    main()
