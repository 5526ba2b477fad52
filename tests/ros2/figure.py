"""Robots that walk circles for a while: rates, how long poses are under way, and what that costs.

The server's cores include a stream a robot that this program watches, to know when the server sent each pose.
"""

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
    sent: dict[tuple, list[float]] = {}
    for came, row in rows:
        sent.setdefault(tuple(np.float32(row[7:])), []).append(came)
    # A robot that stands may have one pose for many frames: the nearest in time is meant.
    found = [(came, sent.get(tuple(np.float32(state.position)))) for came, state in states]
    behind = [came - min(times, key=lambda at: abs(came - at)) for came, times in found if times]
    late = [came - state.header.stamp.seconds for came, state in states]
    return 1e3 * np.array(late), 1e3 * np.array(behind), len(found) - len(behind)


def main():
    """Prints the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    names = [f"r{nth}" for nth in range(given.robots)]
    robots = "".join(f'[[robot]]\nname = "{name}"\nstart = [0, {2 * n}, 0]\n' for n, name in enumerate(names))
    server = Server()
    try:
        # The node reads the file some time after it was started.
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robots.toml"
            file.write_text(robots)
            node = Node(server.url, free_domain(), file)
            try:
                figures = measured(server, node, names, given.seconds)
            finally:
                node.kill()
    finally:
        server.kill()
    print(json.dumps(figures, indent=1))


def measured(server: Server, node: Node, names: list[str], seconds: float) -> dict:
    """The figures of robots that walk for some seconds."""
    ros = Ros(free_domain(), *names)
    joints = [ros.joints[name] for name in names]

    def ready() -> bool:
        assert node.process.poll() is None, "the node ended:\n" + "\n".join(node.said)
        return ros.matched() and all(heard.all for heard in joints)

    wait(ready, 60, lambda: "\n".join(node.said))
    watches = {name: Watch(server.url, session_of(node, name)) for name in names}
    wait(lambda: all(watch.rows for watch in watches.values()), 10)
    drive(ros, names, 3.0)  # They stood, and the first plans of a walk take longer.
    for heard in joints:
        heard.all.clear()
    processes = {"node": node.process.pid, "server": server.process.pid}
    before, begun = {name: cpu_s(pid) for name, pid in processes.items()}, time.monotonic()
    drive(ros, names, seconds)
    spent = time.monotonic() - begun
    cores = {name: (cpu_s(pid) - before[name]) / spent for name, pid in processes.items()}
    heard = {name: list(ros.joints[name].all) for name in names}
    time.sleep(0.2)  # What is still on its way over the server's own stream.
    return {"cores": cores, "robots": {name: of(heard[name], list(watches[name].rows)) for name in names}}


def drive(ros: Ros, names: list[str], seconds: float):
    """Walks circles."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        for name in names:
            ros.drive(name, 0.8, 0.0, 0.4)
        time.sleep(0.1)


def of(states: list, rows: list) -> dict:
    """The figures of one robot."""
    assert len(states) > 1, "no poses came"
    late, behind, strangers = under_way(states, rows)
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


def quantiles(numbers: np.ndarray) -> dict | None:
    """Median, 99th percentile and most; None if there are no numbers."""
    if not len(numbers):
        return None
    return {"p50": np.median(numbers), "p99": np.quantile(numbers, 0.99), "most": numbers.max()}


if __name__ == "__main__":
    main()
