"""Paths that UniMoGen plans itself beside those that another pack plans, on a running server.

python scripts/carried-figures.py [--server ADDRESS] [--bodies NAME ...]

Lines, arcs and S curves at 0.6, 1.2 and 1.8 m/s, as `troupe-eval bodies` has them, one seed. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

import troupe

SPEEDS = (0.6, 1.2, 1.8)
"""Metres a second."""
SECONDS = 6.0
STEP_S = 0.1
TURN = np.pi / 6
"""Turn rate of arcs and S curves, radians a second."""
SUNK_M = 0.01
MODELS = Path(__file__).resolve().parent.parent / "models" / "unimogen"


def path(shape: str, speed: float) -> troupe.FollowPath:
    """A path of points every tenth of a second, with the heading along it."""
    times = np.arange(round(SECONDS / STEP_S) + 1) * STEP_S
    turns = np.zeros(len(times))
    if shape != "line":
        turns[1:] = TURN * STEP_S
    if shape == "S":
        turns[1:][times[:-1] >= SECONDS / 2] *= -1
    headings = np.cumsum(turns)
    ways = speed * STEP_S * np.stack([np.sin(headings[1:]), np.zeros(len(times) - 1), np.cos(headings[1:])], axis=1)
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(ways, axis=0)])
    return troupe.FollowPath(points, headings, times, words={"walk": 1.0})


def toes(body: str) -> dict[str, float]:
    """Contact joints at the ends of the legs, with the heights at which they stand."""
    skeleton = tomllib.loads((MODELS / "bodies" / f"{body}.toml").read_text())["skeleton"]
    contacts = skeleton["contacts"]
    parents = {joint["parent"] for joint in skeleton["joints"] if joint["name"] in contacts["joints"]}
    pairs = zip(contacts["joints"], contacts["clearance_m"], strict=True)
    return {name: clearance for name, clearance in pairs if name not in parents}


def figures(clip: troupe.Clip, body: str, way: troupe.FollowPath) -> list[float]:
    """Standing foot (mm a frame), a toe in the ground (%), acceleration (m/s²), highest toe (cm), off the path (cm)."""
    places = clip.world_positions()
    ends = toes(body)
    at_toes = places[:, [clip.skeleton.names.index(name) for name in ends]]
    steps = np.linalg.norm(np.diff(at_toes[..., [0, 2]], axis=0), axis=-1).min(axis=1)
    above = at_toes[..., 1] - np.array(list(ends.values()))
    bends = np.linalg.norm(places[:-2] - 2 * places[1:-1] + places[2:], axis=-1) * clip.fps**2
    seconds = np.arange(len(clip)) / clip.fps
    points, times = np.asarray(way.points), np.asarray(way.times)
    wanted = np.stack([np.interp(seconds, times, points[:, axis]) for axis in (0, 2)], axis=1)
    off = np.linalg.norm(clip.root[:, [0, 2]] - wanted, axis=1)
    sunk = (above.min(axis=1) < -SUNK_M).mean()
    return [1e3 * steps.mean(), 100 * sunk, bends.mean(), 100 * above.max(), 100 * off.mean()]


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--server", default="127.0.0.1:8080")
    parser.add_argument("--bodies", nargs="+", default=["human", "g1", "h1", "h1_2"])
    options = parser.parse_args()
    print("| body | planned by | standing foot | a toe in the ground | acceleration | highest toe | off the path |")
    print("|---|---|---:|---:|---:|---:|---:|")
    with troupe.Client(options.server) as client:
        for body in options.bodies:
            for planner in (troupe.Planner.OWN, troupe.Planner.CARRIED):
                found, notes = [], set()
                for shape in ("line", "arc", "S"):
                    for speed in SPEEDS:
                        way = replace(path(shape, speed), planner=planner)
                        if planner is not troupe.Planner.OWN:
                            # Default styles are faster than those of the name `walk`.
                            way = replace(way, words={})
                        made = client.generate(way, pack="unimogen", body=body, seed=1)
                        found.append(figures(made.clip, body, way))
                        notes |= set(made.notes)
                row = np.array(found)
                mean = row.mean(axis=0)
                mean[3] = row[:, 3].max()
                cells = [f"{value:.1f}" for value in mean]
                print(f"| {body} | {'; '.join(sorted(notes)) or 'itself'} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
