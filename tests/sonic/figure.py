"""Robots that walk their routes for some minutes: broken rules, times of windows, and the cost.

tests/sonic/figure.py --robots 20 --seconds 600
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from robot import Robots
from sides import Bridge, Server, cpu_s, free_ports

ROUTE = "route = [[0, 0], [3, 0], [3, 3], [0, 3]]\nspeed = 0.8\nloop = true"


def main():
    """Prints the figures."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robots", type=int, default=20)
    arguments.add_argument("--seconds", type=float, default=600)
    given = arguments.parse_args()
    ports = free_ports(given.robots)
    server = Server()
    with tempfile.TemporaryDirectory() as folder:
        bridge = Bridge(server.url, ports, Path(folder), ROUTE)
        robots = Robots(ports, every=5)
        robots.live(60, lambda: all(len(robot.arrivals) > 10 for robot in robots.robots))
        bridge.order("start")
        robots.live(5)
        bridge.order("go")
        robots.live(5)
        before, begin = [cpu_s(server.process.pid), cpu_s(bridge.process.pid)], time.monotonic()
        robots.live(given.seconds)
        spent = time.monotonic() - begin
        after = [cpu_s(server.process.pid), cpu_s(bridge.process.pid)]
        since = bridge.order("stop")
        robots.live(2.5)
        stood = [robot.stands_since(since) for robot in robots.robots]
        figures = bridge.end(lambda: robots.live(2.2))
        robots.close()
        server.kill()
    between = np.concatenate([np.diff(robot.arrivals) for robot in robots.robots]) * 1e3
    moving = [np.mean([step > 1e-3 for _, step in robot.steps]) for robot in robots.robots]
    print(f"robots {given.robots}, seconds {spent:.0f}, windows {sum(len(robot.arrivals) for robot in robots.robots)}")
    print(f"broken rules {len(robots.violations)}", *robots.violations[:5], sep="\n  ")
    print(
        f"windows left late by (ms): {', '.join(f'{name} {value:.2f}' for name, value in figures['late_ms'].items())}"
    )
    p1, p50, p99 = np.percentile(between, [1, 50, 99])
    print(f"between windows at the robot (ms): p1 {p1:.2f}, p50 {p50:.2f}, p99 {p99:.2f}, most {between.max():.2f}")
    print(f"pauses of this program {len(robots.pauses)}, at most {max(robots.pauses, default=0):.2f} s")
    print(f"ticks of playback that moved {100 * np.mean(moving):.1f} %")
    print(f"ticks that waited for frames {sum(robot.waits for robot in robots.robots)}")
    print(f"frames behind, at most {max(robot.behind for robot in robots.robots)}")
    print(f"frames guessed {sum(robot['guessed_frames'] for robot in figures['robots'])}")
    print(f"times late {sum(robot['times_late'] for robot in figures['robots'])}")
    print(f"stood after the stop (s): {max(at - since if at else float('nan') for at in stood):.2f} at most")
    said = [line for line in bridge.said if "late" in line or "lost" in line or "no word" in line]
    print(f"notes of trouble {len(said)}", *said[:5], sep="\n  ")
    print(
        "cores: "
        + ", ".join(
            f"{name} {(b - a) / spent:.2f}" for name, a, b in zip(["server", "bridge"], before, after, strict=True)
        )
    )


if __name__ == "__main__":
    main()
