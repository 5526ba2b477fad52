"""Prints the tokens and contacts that the Python servers' code finds for the first requests of a set, as JSON."""

import argparse
import json
from pathlib import Path

from troupe_bench.body import read_task
from troupe_bench.cli import ENGINES, read_bodies
from troupe_bench.stages import Stages

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pack", type=Path, required=True)
    parser.add_argument("--requests", type=Path, required=True)
    parser.add_argument("--engine", choices=ENGINES, required=True)
    parser.add_argument("--count", type=int, default=8)
    args = parser.parse_args()
    stages = Stages(args.pack, args.engine, 1)
    tasks = [read_task(body, stages.pose_width) for body in read_bodies(args.requests)[: args.count]]
    solved = stages.solve(tasks)
    print(json.dumps([{"tokens": s.tokens.ravel().tolist(), "contacts": s.contacts.ravel().tolist()} for s in solved]))
