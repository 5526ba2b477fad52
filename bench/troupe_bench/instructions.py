"""Instruction counts of the hot loop under valgrind, and their comparison with the table that is checked in."""

import argparse
import json
import os
import sys
from pathlib import Path

from troupe_bench import programs
from troupe_bench.machine import ROOT
from troupe_bench.programs import HOME, Failed, say

RUNNER_VERSION = "0.20.0"
RUNNER = HOME / "tools" / "bin" / "gungraun-runner"
BASELINE = ROOT / "bench" / "instructions.json"
TOLERANCE = 0.03
BENCHES = (("troupe-motion", "motion_instructions"), ("troupe-server", "server_instructions"))


def measure() -> dict[str, int]:
    """Instructions of every bench by its name."""
    if not RUNNER.exists():
        say("installing gungraun-runner ...")
        tools = ("--root", HOME / "tools", "--locked")
        programs.call("cargo", "install", "gungraun-runner", "--version", RUNNER_VERSION, *tools)
    counts: dict[str, int] = {}
    home = ROOT / "target" / "gungraun"
    environment = {"GUNGRAUN_RUNNER": str(RUNNER), "GUNGRAUN_HOME": str(home), "GUNGRAUN_SAVE_SUMMARY": "json"}
    for package, bench in BENCHES:
        programs.call("cargo", "bench", "--locked", "-p", package, "--bench", bench, env=environment)
        for path in sorted((home / package / bench).glob("**/summary.json")):
            name, count = read_summary(path)
            counts[name] = count
    if not counts:
        raise Failed(f"no counts were written to {home}")
    return counts


def read_summary(path: Path) -> tuple[str, int]:
    """A bench's name and its instructions."""
    summary = json.loads(path.read_text())
    for profile in summary["profiles"]:
        if profile["tool"] == "Callgrind":
            instructions = profile["data"]["total"]["metrics"]["Ir"]["values"]["new"]
            return f"{summary['function_name']} {summary['id']}", int(instructions)
    raise Failed(f"{path} has no counts of callgrind")


def compare(now: dict[str, int], baseline: dict[str, int], tolerance: float) -> list[str]:
    """Prints every bench beside the baseline; returns those that need more instructions than ``tolerance`` allows."""
    worse = []
    for name in sorted(now | baseline):
        old, new = baseline.get(name), now.get(name)
        if old is None or new is None:
            print(f"{name:<40} {old or '–':>14} {new or '–':>14}   {'new' if old is None else 'gone'}")
            continue
        change = new / old - 1.0
        mark = "more" if change > tolerance else "fewer" if change < -tolerance else ""
        print(f"{name:<40} {old:>14,} {new:>14,} {change:>+8.2%} {mark}")
        if change > tolerance:
            worse.append(name)
    return worse


def main() -> int:
    """Counts and compares; 1 where a bench needs more instructions than it did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", action="store_true", help="make the counts the new baseline")
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help="share that a count may grow by")
    args = parser.parse_args()
    now = measure()
    if args.save:
        BASELINE.write_text(json.dumps(now, indent=1, sort_keys=True) + "\n")
        print(f"{len(now)} counts saved to {os.path.relpath(BASELINE)}")
        return 0
    worse = compare(now, json.loads(BASELINE.read_text()), args.tolerance)
    if worse:
        print(
            f"more instructions than before: {', '.join(worse)}; if that is meant, run it with --save", file=sys.stderr
        )
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
