"""What characters notice of failures, what one, two and three servers can do, and what a shared store costs.

`make cluster-figure` runs all of it. With `--only`, about: failures 6 minutes, scaling 25, store 10. docs/cluster.md says more.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import loads
import numpy as np
from loads import Load
from processes import until
from replicas import Cluster, Redis, Replica, lacking
from routers import NAMES
from shares import Shares, equal_shares
from spots import Networks

PER_STREAM = 10
STREAMS = 60
"""Streams of live characters when servers are compared. Each is on one server: many are spread evenly."""
SEARCH_S = 300
"""Longest search. Where no load is carried, it would try ever smaller ones."""
RESUMED_S = 2.0
SEAM = 1.25
"""A seam is no larger than the largest step without one, and a quarter."""
STORE_RUN_S = 30
AFTER_S = 6.0
"""What follows a failure of Redis belongs to it for so long."""


@dataclass
class Phase:
    """A part of the time in which characters walk."""

    what: str
    began: float
    may_break: bool
    """Whether characters may wait, at most `RESUMED_S`."""
    underruns: int


@dataclass
class Failures:
    """All of it."""

    phases: list[Phase] = field(default_factory=list)
    kills: list[float] = field(default_factory=list)
    """When servers were killed."""
    trouble: str | None = None
    """Why it ended early."""


def failures(folder: Path, args: argparse.Namespace) -> int:
    """Characters walk while a server is killed again and again, then while Redis fails in its ways."""
    from crowd import Crowd

    of = Failures()
    cluster = Cluster(folder, in_namespaces=args.namespaces, look_s=0.25)
    try:
        crowd = Crowd(cluster.address, args.characters, max(args.characters // PER_STREAM, 1))
        until(lambda: crowd.all_walk(0), "all walk", 180)

        def begins(what: str, may_break: bool):
            of.phases.append(Phase(what, time.monotonic(), may_break, crowd.report.underruns))
            print(f"{what} ...", flush=True)

        try:
            begins("nothing", False)
            time.sleep(AFTER_S)
            begins(f"a server killed every {args.every:g} s", True)
            kill_in_turn(cluster, crowd, args, of)
            for what, may_break, act in redis_fails(cluster):
                begins(what, may_break)
                act()
                time.sleep(AFTER_S)
            end = time.monotonic()
            until(lambda: crowd.all_walk(end), "all still walk", 30)
        except AssertionError as error:
            of.trouble = str(error)
        begins("", False)
        # What ended it early says more than what follows from it.
        with suppress(Exception) if of.trouble else nullcontext():
            crowd.end()
        return show(args, of, crowd.report, cluster)
    finally:
        cluster.stop()


def kill_in_turn(cluster: Cluster, crowd, args: argparse.Namespace, of: Failures):
    """Kills the servers in turn. Each starts again once its characters walk elsewhere."""
    begun = time.monotonic()
    while time.monotonic() - begun < args.seconds:
        name = NAMES[len(of.kills) % len(NAMES)]
        cluster.replicas[name].kill()
        died = time.monotonic()
        of.kills.append(died)
        until(lambda died=died: crowd.all_walk(died), f"all walk after kill {len(of.kills)}", 30)
        cluster.replicas[name].start()
        cluster.replicas[name].wait_ready()
        # HAProxy must see it before the next one dies.
        time.sleep(max(died + args.every - time.monotonic(), 2))


def redis_fails(cluster: Cluster) -> list[tuple[str, bool, Callable[[], None]]]:
    """What is done to Redis, and whether characters may notice."""

    def cut(names: tuple[str, ...]):
        for name in names:
            cluster.spots[name].cut()
        time.sleep(4)
        for name in names:
            cluster.spots[name].heal()

    return [
        ("Redis stopped for 5 s", False, lambda: cluster.redis.pause(5)),
        ("Redis started again, empty", False, cluster.redis.restart_empty),
        ("a server cut off from Redis for 4 s", False, lambda: cut(NAMES[:1])),
        ("all servers cut off from Redis for 4 s", False, lambda: cut(NAMES)),
    ]


def show(args: argparse.Namespace, of: Failures, report, cluster: Cluster) -> int:
    """The tables of failures. Gives 1 if a bound was missed."""
    missed = []
    print(f"\n{args.characters} characters, {len(of.kills)} servers killed\n")
    print("| while | waits of a character | p50 / p99 / longest wait (s) | slowed frames |\n|---|---:|---|---:|")
    for phase, after in zip(of.phases, of.phases[1:], strict=False):
        waits = [one.pause_s for one in report.breaks if phase.began - 0.5 <= one.began < after.began - 0.5]
        allowed = RESUMED_S if phase.may_break else 0.0
        if max(waits, default=0) > allowed:
            missed.append(f"{phase.what}: a wait of {max(waits):.2f} s; allowed: {allowed:g} s")
        times = " / ".join(f"{time_s:.2f}" for time_s in (*np.percentile(waits, [50, 99]), max(waits))) if waits else ""
        print(f"| {phase.what} | {len(waits)} | {times} | {after.underruns - phase.underruns} |")
    gaps = np.diff(of.kills)
    (root, turn), (root_seam, turn_seam) = report.usual, report.seams
    keys = len(cluster.witness.owners)
    faults = cluster.witness.faults
    steps, turns = f"{root:.3f} / {root_seam:.3f}", f"{turn:.2f} / {turn_seam:.2f}"
    rows = [
        ("characters lost", len(report.lost), not report.lost),
        ("frame numbers that went back", report.backwards, report.backwards == 0),
        ("seconds from kill to kill", f"{gaps.min():.0f} to {gaps.max():.0f}" if len(gaps) else "", True),
        ("largest step of a root in a frame, usual / after a wait (m)", steps, root_seam <= root * SEAM),
        ("largest turn of a joint in a frame, usual / after a wait (rad)", turns, turn_seam <= turn * SEAM),
        ("keys in Redis with a token of two servers, or one that fell", f"{len(faults)} of {keys}", not faults),
    ]
    print("\n| figure | value |\n|---|---:|")
    for name, value, is_kept in rows:
        print(f"| {name} | {value} |")
        if not is_kept:
            missed.append(f"{name}: {value}")
    if of.trouble:
        missed.append(of.trouble)
    for text in (*missed, *report.lost[:5], *faults[:5]):
        print(f"MISSED: {text}")
    return 1 if missed else 0


def search(address: str, workload: str, p99_ms: int, folder: Path) -> float:
    """The highest load that the load tester finds."""
    live = ["--streams", str(STREAMS), "--connections", "12"] if workload == "drive" else ["--connections", "12"]
    command = ["search", "--workload", workload, "--p99-ms", str(p99_ms), *live, "--duration", "15s"]
    report = Load(command, address, folder / f"{workload}.json").report(SEARCH_S)
    found = (report or {}).get("search") or {}
    return found.get("found") or float("nan")


def fullest(cluster: Cluster) -> float:
    """The share of the server that had most of the sessions."""
    closed = [one.metric("troupe_session_evictions_total", 'reason="closed"') for one in cluster.replicas.values()]
    return max(closed) / max(sum(closed), 1)


def scaling(folder: Path, shares: Shares):
    """One, two and three servers on equal shares."""
    print(f"\nEach server has {shares.words}.\n")
    print(
        "| servers | requests/s, p99 100 ms | live characters, p99 33 ms, none slowed | sessions on the fullest server |"
    )
    print("|---:|---:|---:|---:|")
    for count in (1, 2, 3):
        here = folder / f"scaling-{count}"
        here.mkdir()
        cluster = Cluster(here, count, shares.prefixes, look_s=1.0)
        try:
            requests = search(cluster.address, "inbetween", 100, here)
            live = search(cluster.address, "drive", 33, here)
            print(f"| {count} | {requests:.0f} | {live:.0f} | {fullest(cluster):.0%} |", flush=True)
        finally:
            cluster.stop()


def one_store(kind: str, folder: Path, args: argparse.Namespace, shares: Shares) -> tuple[float, ...] | None:
    """What a server costs whose store is of this kind, with live characters: see the header of the table."""
    redis = Redis(folder) if kind == "Redis" else None
    redis_store = f"redis://127.0.0.1:{redis.port}" if redis else ""
    # Without a name nothing is kept.
    store = {"none": "", "redb": str(folder / "store"), "Redis": redis_store}[kind]
    server = None
    try:
        server = Replica("troupe-0:8080", store, folder, prefix=shares.prefixes[0])
        server.wait_ready()
        began = (time.monotonic(), server.processor_s(), redis.processor_s() if redis else 0.0)
        command = ["run", "--workload", "drive", "--characters", str(args.characters), "--streams", "4"]
        report = Load([*command, "--duration", f"{STORE_RUN_S}s"], server.address, folder / "run.json").report()
        took = time.monotonic() - began[0]
        if report is None:
            return None
        of, written = report["median"], server.metric("troupe_store_written_bytes_total")
        return (
            (server.processor_s() - began[1]) / took,
            ((redis.processor_s() if redis else 0.0) - began[2]) / took,
            of["latency_ms"]["p50"],
            of["latency_ms"]["p99"],
            of["live"]["slowed_frames"],
            written / took / 1e6,
        )
    finally:
        for one in (server, redis):
            if one:
                one.kill()


def stores(folder: Path, args: argparse.Namespace, shares: Shares):
    """The same load on a server without a store, with redb and with Redis, in turns."""
    kinds = ("none", "redb", "Redis")
    runs: dict[str, list[tuple[float, ...]]] = {kind: [] for kind in kinds}
    for turn in range(args.turns):
        for kind in kinds:
            here = folder / f"store-{turn}-{kind}"
            here.mkdir()
            if found := one_store(kind, here, args, shares):
                runs[kind].append(found)
                print(f"turn {turn + 1}, {kind}: " + ", ".join(f"{number:.3g}" for number in found), flush=True)
    print(
        f"\n{args.characters} live characters for {STORE_RUN_S} s on {shares.words}; median (range) of {args.turns} turns\n"
    )
    print("| store | server, cores | Redis, cores | tick late, p50 ms | p99 ms | slowed frames | written, MB/s |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for kind, found in runs.items():
        columns = [f"{median(all):.3g} ({min(all):.3g} to {max(all):.3g})" for all in zip(*found, strict=True)]
        print(f"| {kind} | {' | '.join(columns)} |")


def main():
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--characters", type=int, default=300, help="that walk during failures, or load the stores")
    parser.add_argument("--seconds", type=float, default=180, help="in which servers are killed")
    parser.add_argument("--every", type=float, default=20, help="seconds from kill to kill")
    parser.add_argument("--turns", type=int, default=3, help="runs with each store")
    parser.add_argument("--share", type=float, help="cores of a server, by quota; default: its own if there are four")
    parser.add_argument(
        "--namespaces", action="store_true", help="failures with servers in network namespaces; as root"
    )
    parser.add_argument("--only", choices=["failures", "scaling", "store"])
    args = parser.parse_args()
    needs = [lacking(), loads.lacking() if args.only != "failures" else None]
    needs.append(Networks.lacking() if args.namespaces else None)
    if missing := next(filter(None, needs), None):
        raise SystemExit(missing)
    with tempfile.TemporaryDirectory() as name:
        folder, missed = Path(name), 0
        if args.only in (None, "failures"):
            (folder / "failures").mkdir()
            missed = failures(folder / "failures", args)
        if args.only in (None, "scaling"):
            with equal_shares(args.share) as shares:
                scaling(folder, shares)
        if args.only in (None, "store"):
            with equal_shares(args.share) as shares:
                stores(folder, args, shares)
    raise SystemExit(missed)


if __name__ == "__main__":
    main()
