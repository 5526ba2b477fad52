"""What characters notice of failures, and what one, two and three servers can do: `make cluster-figure`.

Servers are pinned to equal shares of the cores that are left beside the router and the load.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from replicas import Cluster, lacking
from routers import NAMES, ROOT, until

PER_STREAM = 10
LOADTEST = Path(os.environ.get("TROUPE_LOADTEST") or ROOT / "target/release/troupe-loadtest")


def cores() -> list[str]:
    """A list of cores for each of three servers: equal shares, which overlap if there are fewer than three cores."""
    here = sorted(os.sched_getaffinity(0))
    share = max((len(here) - 1) // 3, 1)
    return [",".join(str(here[(nth * share + one) % len(here)]) for one in range(share)) for nth in range(3)]


def failures(folder: Path, characters: int, seconds: float, every: float, pinned: bool) -> dict:
    """Characters walk while a server is killed again and again, then while Redis fails in its ways."""
    from crowd import Crowd

    cluster = Cluster(folder, cores=tuple(cores()) if pinned else ("", "", ""))
    try:
        crowd = Crowd(cluster.address, characters, max(characters // PER_STREAM, 1))
        until(lambda: crowd.all_walk(0), "all walk", 120)
        marks = [("walking", time.monotonic())]
        time.sleep(5)
        begun = time.monotonic()
        marks.append(("servers killed", begun))
        nth = 0
        while time.monotonic() - begun < seconds:
            next_kill = time.monotonic() + every
            name = NAMES[nth % len(NAMES)]
            cluster.replicas[name].kill()
            died = time.monotonic()
            until(lambda died=died: crowd.all_walk(died), "all walk again", 30)
            cluster.replicas[name].start()
            cluster.replicas[name].wait_ready()
            time.sleep(max(next_kill - time.monotonic(), 2))
            nth += 1
        for what, act in (
            ("Redis paused for 5 s", lambda: cluster.redis.pause(5)),
            ("Redis restarted empty", cluster.redis.restart_empty),
            ("all servers cut off from Redis for 4 s", lambda: cut(cluster)),
        ):
            marks.append((what, time.monotonic()))
            act()
            time.sleep(6)
        end = time.monotonic()
        until(lambda: crowd.all_walk(end), "all still walk", 30)
        report = crowd.end()
        return {"kills": nth, "report": report, "faults": cluster.witness.faults, "keys": len(cluster.witness.owners)}
    finally:
        cluster.stop()


def cut(cluster: Cluster):
    """No server reaches Redis for longer than a lease."""
    for one in cluster.cables.values():
        one.is_cut.set()
    time.sleep(4)
    for one in cluster.cables.values():
        one.is_cut.clear()


def search(address: str, workload: str, p99_ms: int, folder: Path) -> float:
    """The highest load that the load tester finds."""
    file = folder / f"{workload}.json"
    command = [LOADTEST, "search", "--server", f"http://{address}", "--workload", workload, "--p99-ms", str(p99_ms)]
    # A process of the load tester has one client, whose characters are on one server.
    more = ["--processes", "12"] if workload == "drive" else ["--connections", "12"]
    subprocess.run([*command, *more, "--duration", "15s", "--json", file], check=False, stdout=subprocess.DEVNULL)
    report = json.loads(file.read_text())
    return (report["search"] or {}).get("found") or float("nan")


def scaling(folder: Path):
    """One, two and three servers on equal shares."""
    print(
        "\n| servers | cores of each | requests/s (p99 100 ms) | live characters (p99 33 ms, no underrun) |\n|---:|---|---:|---:|"
    )
    for count in (1, 2, 3):
        here = folder / str(count)
        here.mkdir()
        cluster = Cluster(here, count, tuple(cores()))
        try:
            found = [search(cluster.address, kind, ms, here) for kind, ms in (("inbetween", 100), ("drive", 33))]
        finally:
            cluster.stop()
        print(f"| {count} | {' / '.join(cores()[:count])} | {found[0]:.0f} | {found[1]:.0f} |", flush=True)


def main():
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--characters", type=int, default=300)
    parser.add_argument("--seconds", type=float, default=180)
    parser.add_argument("--every", type=float, default=20, help="seconds from kill to kill")
    parser.add_argument("--unpinned", action="store_true", help="servers may use all cores")
    parser.add_argument("--only", choices=["failures", "scaling"])
    args = parser.parse_args()
    if missing := lacking():
        raise SystemExit(missing)
    with tempfile.TemporaryDirectory() as folder:
        if args.only != "scaling":
            (Path(folder) / "failures").mkdir()
            of = failures(Path(folder) / "failures", args.characters, args.seconds, args.every, not args.unpinned)
            show(args.characters, of)
        if args.only != "failures":
            scaling(Path(folder))


def show(characters: int, of: dict):
    """The table of failures."""
    report = of["report"]
    breaks = report.breaks_s or [0.0]
    rows = {
        "characters": characters,
        "servers killed": of["kills"],
        "characters lost": len(report.lost),
        "frame numbers that went back": sum(one.backwards for one in report.characters.values()),
        "breaks of a character": len(report.breaks_s),
        "from the last frame to the next, p50 / p99 / most (s)": " / ".join(
            f"{number:.2f}" for number in (*np.percentile(breaks, [50, 99]), max(breaks))
        ),
        "largest step of a root in a frame, usual / after a break (m)": f"{report.usual[0]:.3f} / {report.seams[0]:.3f}",
        "largest turn of a joint in a frame, usual / after a break (rad)": f"{report.usual[1]:.2f} / {report.seams[1]:.2f}",
        "slowed frames": report.underruns,
        "keys in Redis that two servers wrote with one token, or whose token fell": len(of["faults"]),
        "keys looked at": of["keys"],
    }
    print("| figure | value |\n|---|---:|")
    for name, value in rows.items():
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
