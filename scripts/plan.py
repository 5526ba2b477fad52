#!/usr/bin/env python3
"""The table of docs/planning.md: what a number of live characters needs, by figures that other pages have measured.

plan.py [--characters N] [--cores N] prints it; plan.py --check compares the page with it. A figure is read from the page of
its measurement, so that a new one changes the plan.
"""

import argparse
import math
import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = DOCS / "planning.md"
# What is chosen, and not measured.
FRAMES_PER_S = 30
LOAD = 2 / 3
ROUTER_GBIT_PER_S = 6.0
STORE_LOAD = 0.6


def figure(page: str, pattern: str) -> float:
    """The one number of a page that a pattern finds."""
    found = re.findall(pattern, (DOCS / page).read_text(encoding="utf-8"))
    if len(found) != 1:
        sys.exit(f"docs/{page}: {pattern!r} is there {len(found)} times, and must be there once")
    return float(found[0].replace(",", ""))


class Measured:
    """Figures of the pages."""

    def __init__(self) -> None:
        live = r"\| bf16 \| EPYC \| {}"
        rest = r"400 \| 4 \| 0 \| 0 \| 0 \| 0 \| ([\d.]+)"
        self.characters_of_two_cores = figure("benchmarks.md", live.format(r"(\d+) \| 4 \| 0 \| 0 \| 0"))
        self.plans_per_s = figure("benchmarks.md", live.format(rest))
        self.session_bytes = figure("benchmarks.md", r"\| f32 \| EPYC \| 10,000 \|[^|]*\|[^|]*\| ([\d,]+) \|")
        self.server_mib = figure("benchmarks.md", r"\| f32 \| EPYC \| 10,000 \| (\d+)")
        self.frame_bytes = figure("sessions.md", r"349 bytes as floats and (\d+) in compact form")
        self.round_ms = figure("running.md", r"writes changed sessions every (\d+) ms")
        self.round_mib = figure("running.md", r"writes changed sessions every 250 ms, (\d+) MiB at a time")
        self.sessions_of_round = figure("running.md", r"enough for about (\d+)\s+people who walk")
        self.write_us = figure("planning.md", r"\| write a record of 28 kB \| (\d+) µs")
        self.claim_us = figure("planning.md", r"\| take a lease, and get the record \| (\d+) µs")
        self.stored_kb = figure("cluster.md", r"(\d+) KB for each session")


def rows(measured: Measured, characters: int, cores: int) -> list[tuple[str, str, str]]:
    """What, how it is computed, and how much it is."""
    a_core = measured.characters_of_two_cores / 2
    most = a_core * cores
    planned = math.floor(most * LOAD)
    servers = math.ceil(characters / planned)
    gbit = characters * FRAMES_PER_S * measured.frame_bytes * 8 / 1e9
    rounds = 1000 / measured.round_ms
    wanted = planned * rounds
    possible = measured.sessions_of_round * rounds
    writes = min(wanted, possible) * servers
    record = measured.round_mib * 2**20 / measured.sessions_of_round
    store_cores = math.ceil(writes * measured.write_us / 1e6 / STORE_LOAD)
    plans = a_core * measured.plans_per_s * cores
    spare = (1 - LOAD) * plans
    heirs = servers - math.ceil(servers / 3)
    zone = characters / 3
    claims = zone * measured.claim_us / 1e6 / (store_cores * (1 - STORE_LOAD))
    return [
        ("characters of a core", f"{measured.characters_of_two_cores:.0f} ÷ 2", f"{a_core:.0f}"),
        (f"characters of a server of {cores} cores, at most", f"{a_core:.0f} × {cores}", f"{most:,.0f}"),
        ("characters of a server, planned", f"{most:,.0f} × 2/3", f"{planned:,}"),
        ("servers", f"{characters:,} ÷ {planned:,}", f"{servers:,}"),
        ("cores of all servers", f"{servers:,} × {cores}", f"{servers * cores:,}"),
        (
            "memory of a server in f32, MiB",
            f"{measured.server_mib:.0f} + {planned:,} × {measured.session_bytes:,.0f} B",
            f"{measured.server_mib + planned * measured.session_bytes / 2**20:.0f}",
        ),
        (
            "frames to all clients, Gbit/s",
            f"{characters:,} × {FRAMES_PER_S} × {measured.frame_bytes:.0f} B × 8",
            f"{gbit:.1f}",
        ),
        (
            "frames of a server, Mbit/s",
            f"{planned:,} × {FRAMES_PER_S} × {measured.frame_bytes:.0f} B × 8",
            f"{planned * FRAMES_PER_S * measured.frame_bytes * 8 / 1e6:.0f}",
        ),
        (
            f"routers of {ROUTER_GBIT_PER_S:.0f} Gbit/s",
            f"{gbit:.1f} ÷ {ROUTER_GBIT_PER_S:.0f}",
            f"{math.ceil(gbit / ROUTER_GBIT_PER_S)}",
        ),
        (
            "records that a server writes a second",
            f"min({planned:,}, {measured.sessions_of_round:.0f}) × {rounds:.0f}",
            f"{min(wanted, possible):,.0f}",
        ),
        (
            "age of a record when its server dies, at most, s",
            f"{planned:,} ÷ {min(wanted, possible):,.0f}",
            f"{planned / min(wanted, possible):.2f}",
        ),
        ("records to all stores a second", f"{servers:,} × {min(wanted, possible):,.0f}", f"{writes:,.0f}"),
        ("bytes to all stores, GB/s", f"{writes:,.0f} × {record:,.0f} B", f"{writes * record / 1e9:.0f}"),
        ("cores of all stores, 60 % busy", f"{writes:,.0f} × {measured.write_us:.0f} µs ÷ 0.6", f"{store_cores:,}"),
        ("servers of one store's core", f"{servers:,} ÷ {store_cores:,}", f"{servers / store_cores:.1f}"),
        (
            "memory of all stores, GB",
            f"{characters:,} × {measured.stored_kb:.0f} kB",
            f"{characters * measured.stored_kb / 1e6:.0f}",
        ),
        ("plans of a server, a second, at most", f"{most:,.0f} × {measured.plans_per_s}", f"{plans:,.0f}"),
        (
            "after a server's death: time of its sessions' plans at all others, ms",
            f"{planned:,} ÷ ({servers - 1:,} × {plans:,.0f} ÷ 3)",
            f"{1000 * planned / ((servers - 1) * spare):.1f}",
        ),
        (
            "the same, of three servers, at two others, ms",
            f"{planned:,} ÷ (2 × {plans:,.0f} ÷ 3)",
            f"{1000 * planned / (2 * spare):.0f}",
        ),
        (
            "after a third of all servers died: time of plans, ms",
            f"{zone:,.0f} ÷ ({heirs:,} × {plans:,.0f} ÷ 3)",
            f"{1000 * zone / (heirs * spare):.0f}",
        ),
        (
            "the same: time of leases at the stores, ms",
            f"{zone:,.0f} × {measured.claim_us:.0f} µs ÷ ({store_cores:,} × 0.4)",
            f"{1000 * claims:.0f}",
        ),
    ]


def main() -> None:
    """Prints the table, or compares the page with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--characters", type=int, default=1_000_000, help="live characters (1,000,000)")
    parser.add_argument("--cores", type=int, default=8, help="cores of a server (8)")
    parser.add_argument("--check", action="store_true", help="compare docs/planning.md")
    asked = parser.parse_args()
    table = [f"| {what} | {how} | {value} |" for what, how, value in rows(Measured(), asked.characters, asked.cores)]
    if not asked.check:
        print("\n".join(table))
        return
    page = PAGE.read_text(encoding="utf-8")
    lacking = [row for row in table if row not in page.splitlines()]
    if lacking:
        sys.exit("docs/planning.md lacks these rows (scripts/plan.py prints all):\n" + "\n".join(lacking))


if __name__ == "__main__":
    main()
