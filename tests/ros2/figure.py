"""Robots that walk circles for a while: rates, how long poses are under way, and what that costs."""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from node import Node, Ros, Server, Watch, free_domain, session_of, wait
from sides import cpu_s


def under_way(states: list, rows: list) -> tuple[np.ndarray, np.ndarray, int]:
    """Milliseconds from a stamp and from the server's own stream to the other side, and poses that the server did not send."""
    sent = {tuple(np.float32(row[7:])): came for came, row in rows}
    found = [(came, sent.get(tuple(np.float32(state.position)))) for came, state in states]
    late = np.array([came - state.header.stamp.seconds for came, state in states])
    behind = np.array([came - before for came, before in found if before is not None])
    return 1e3 * late, 1e3 * behind, sum(before is None for _, before in found)


def main():
    """Prints the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    names = [f"r{nth}" for nth in range(given.robots)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robots.toml"
        file.write_text(
            "".join(f'[[robot]]\nname = "{name}"\nstart = [0, {2 * n}, 0]\n' for n, name in enumerate(names))
        )
        server = Server()
        node = Node(server.url, free_domain(), file)
    try:
        ros = Ros(free_domain(), *names)
        wait(
            lambda: ros.matched() and all(heard.all for heard in ros.joints.values()), 60, lambda: "\n".join(node.said)
        )
        watches = {name: Watch(server.url, session_of(node, name)) for name in names}
        time.sleep(1)
        for heard in ros.joints.values():
            heard.all.clear()
        before = {"node": cpu_s(node.process.pid), "server": cpu_s(server.process.pid)}
        until = time.monotonic() + given.seconds
        while time.monotonic() < until:
            for name in names:
                ros.drive(name, 0.8, 0.0, 0.4)
            time.sleep(0.1)
        cores = {
            "node": (cpu_s(node.process.pid) - before["node"]) / given.seconds,
            "server": (cpu_s(server.process.pid) - before["server"]) / given.seconds,
        }
        time.sleep(0.2)
        figures = {"cores": cores, "robots": {name: of(ros, name, watches[name]) for name in names}}
        print(json.dumps(figures, indent=1))
    finally:
        node.kill()
        server.kill()


def of(ros: Ros, name: str, watch: Watch) -> dict:
    """The figures of one robot."""
    states = list(ros.joints[name].all)
    late, behind, strangers = under_way(states, list(watch.rows))
    stamps = np.array([state.header.stamp.seconds for _, state in states])
    gaps = 1e3 * np.diff([came for came, _ in states])
    return {
        "poses": len(states),
        "rate_hz": (len(stamps) - 1) / (stamps[-1] - stamps[0]),
        "not_the_servers": strangers,
        "stamp_to_receipt_ms": quantiles(late),
        "behind_the_servers_stream_ms": quantiles(behind),
        "between_poses_ms": quantiles(gaps),
    }


def quantiles(numbers: np.ndarray) -> dict:
    """Median, 99th percentile and most."""
    return {"p50": np.median(numbers), "p99": np.quantile(numbers, 0.99), "most": numbers.max()}


if __name__ == "__main__":
    main()
