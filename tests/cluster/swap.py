"""What a swap of a pack costs those who use it: live characters, and single requests. `make swap-figure` prints tables.

A copy of the pack with another version takes its place, again and again. It moves as before, so that a step of a joint or a root
that is larger than usual is of the swap.
"""

import argparse
import re
import shutil
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import loads
from loads import Load
from processes import until
from replicas import BINARY, Replica
from routers import ROOT

PER_STREAM = 10
SEAM = 1.25
"""As for failures of servers."""
WATCHED_FRAMES = 90
"""Frames after a swap in which plans of the new version begin: one is made every second."""


def versions(pack: str, folder: Path) -> list[str]:
    """A folder of packs with two versions of one. Gives their numbers; a server starts with the last."""
    found = []
    for nth in range(2):
        copy = folder / f"{pack}-{nth}"
        shutil.copytree(ROOT / "models" / pack, copy)
        manifest = copy / "pack.toml"
        text = manifest.read_text()
        major, minor, patch = re.search(r'^version = "(\d+)\.(\d+)\.(\d+)"$', text, re.MULTILINE).groups()
        found.append(f"{major}.{minor}.{int(patch) + nth}")
        manifest.write_text(re.sub(r"^version = .*$", f'version = "{found[-1]}"', text, count=1, flags=re.MULTILINE))
    return found


class Server:
    """A server with two versions of a pack."""

    def __init__(self, pack: str, folder: Path, parts: ExitStack):
        import troupe

        packs = folder / "packs"
        packs.mkdir()
        self.pack, self.versions = pack, versions(pack, packs)
        self.replica = Replica("troupe-0:8080", "", folder, packs=str(packs))
        parts.callback(self.replica.kill)
        self.replica.wait_ready()
        self.client = parts.enter_context(troupe.Client(self.replica.address, timeout=600))
        self.swaps_s: list[float] = []

    def swap(self):
        """Puts the other version in the place of the one that serves."""
        began = time.monotonic()
        change = self.client.swap_pack(self.pack, self.versions[len(self.swaps_s) % 2])
        assert change.changed, change
        self.swaps_s.append(time.monotonic() - began)

    def swap_for(self, seconds: float, every: float, after=lambda: None):
        """Swaps for a time, and calls something after each."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            began = time.monotonic()
            self.swap()
            after()
            time.sleep(max(began + every - time.monotonic(), 0))


def table(rows: list[tuple[str, object, bool]]) -> int:
    """Prints figures. Gives 1 if a bound was missed."""
    print("\n| figure | value |\n|---|---:|")
    for name, value, _ in rows:
        print(f"| {name} | {value} |")
    missed = [(name, value) for name, value, is_kept in rows if not is_kept]
    for name, value in missed:
        print(f"MISSED: {name}: {value}")
    print(flush=True)
    return 1 if missed else 0


def live(folder: Path, args: argparse.Namespace) -> int:
    """Swaps under live characters, after as long without a swap."""
    from crowd import Crowd

    with ExitStack() as parts:
        server = Server(args.pack, folder, parts)
        crowd = Crowd(server.replica.address, args.characters, max(args.characters // PER_STREAM, 1))
        until(lambda: crowd.all_walk(0), "all walk", 180)
        time.sleep(5)
        before = crowd.report.underruns
        time.sleep(args.seconds)
        quiet = crowd.report.underruns - before
        server.swap_for(args.seconds, args.every, lambda: crowd.mark(WATCHED_FRAMES))
        time.sleep(WATCHED_FRAMES / 30)
        swapped = crowd.report.underruns - before - quiet
        report = crowd.end()
    (root, turn), (root_seam, turn_seam) = report.usual, report.seams
    steps, turns = f"{root:.3f} / {root_seam:.3f}", f"{turn:.2f} / {turn_seam:.2f}"
    return table(
        [
            ("live characters", args.characters, True),
            ("swaps", len(server.swaps_s), bool(server.swaps_s)),
            ("longest swap (s)", f"{max(server.swaps_s, default=0):.1f}", True),
            (f"slowed frames in {args.seconds:g} s without a swap", quiet, True),
            (f"slowed frames in {args.seconds:g} s with swaps", swapped, swapped == 0),
            ("characters lost", len(report.lost), not report.lost),
            ("waits of half a second", len(report.breaks), not report.breaks),
            ("largest step of a root in a frame, usual / after a swap (m)", steps, root_seam <= root * SEAM),
            ("largest turn of a joint in a frame, usual / after a swap (rad)", turns, turn_seam <= turn * SEAM),
        ]
    )


def requests(folder: Path, args: argparse.Namespace) -> int:
    """Swaps under single requests."""
    with ExitStack() as parts:
        server = Server(args.pack, folder, parts)
        warm_s = 3
        command = ["run", "--workload", "inbetween", "--pack", args.pack, "--clients", str(args.clients)]
        times = ["--warmup", f"{warm_s}s", "--duration", f"{args.seconds:g}s"]
        load = Load([*command, *times], server.replica.address, folder / "run.json")
        parts.callback(load.kill)
        time.sleep(warm_s)
        server.swap_for(args.seconds, args.every)
        report = load.report()
    assert report, "the load tester has no report"
    counts = report["median"]["counts"]
    failed = counts["failed"] + counts["refused"] + counts["dropped"]
    return table(
        [
            ("clients that wait for their answers", args.clients, True),
            ("swaps", len(server.swaps_s), bool(server.swaps_s)),
            ("longest swap (s)", f"{max(server.swaps_s, default=0):.1f}", True),
            ("right answers", f"{counts['right']:.0f}", counts["right"] > 0),
            ("failed, refused or dropped", f"{failed:.0f}", failed == 0),
            ("p99 (ms)", f"{report['median']['latency_ms']['p99']:.1f}", True),
        ]
    )


def main():
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pack", default="human")
    parser.add_argument("--characters", type=int, default=400)
    parser.add_argument("--clients", type=int, default=16, help="of single requests")
    parser.add_argument("--seconds", type=float, default=60, help="in which the pack is swapped")
    parser.add_argument("--every", type=float, default=10, help="seconds from swap to swap")
    parser.add_argument("--only", choices=["live", "requests"])
    args = parser.parse_args()
    if not BINARY.exists():
        raise SystemExit(f"there is no {BINARY}")
    if args.only != "live" and (missing := loads.lacking()):
        raise SystemExit(missing)
    missed = 0
    for name, measure in (("live", live), ("requests", requests)):
        if args.only in (None, name):
            with tempfile.TemporaryDirectory() as folder:
                missed |= measure(Path(folder), args)
    raise SystemExit(missed)


if __name__ == "__main__":
    main()
