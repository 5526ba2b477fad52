#!/usr/bin/env python3
"""Draws docs/images/feet.png: how feet stand in the network's own motion and in finished motion.

film-feet.py TROUPE FILE, in the training environment, with the server that TROUPE_SERVER names.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import troupe_reader

BODIES = {"human": 2, "g1": 2, "h1_2": 2, "horse": 4}
"""Bodies and their feet."""
PATHS = {
    "line": [(0.0, 4.0)],
    "arc": [(2.3 * (1 - math.cos(turn)), 2.3 * math.sin(turn)) for turn in np.radians([20, 40, 60, 80, 100])],
    "S": [(math.sin(1.4 * z), z) for z in (0.8, 1.6, 2.4, 3.2, 4.0)],
}
SPEED_MPS = 1.2
COLOURS = 32
SHOWN = range(20, 80, 3)
"""Frames of the line, seen from the side. Of the other paths all feet are shown from above."""


def generated(troupe: str, body: str, path: str, folder: Path, *options: str) -> tuple[np.ndarray, list[int | None]]:
    """Joint positions ``[T, J, 3]`` of a body on a path, and the parents of its joints."""
    points = "".join(f"[[waypoint]]\nat = [{x:.3f}, {z:.3f}]\nspeed = {SPEED_MPS}\n" for x, z in PATHS[path])
    asked, made = folder / "path.toml", folder / "made.bvh"
    asked.write_text(f"start = [0.0, 0.0]\nheading_deg = 0.0\n{points}")
    command = [troupe, "generate", "--skeleton", body, "--path", str(asked), "--style", "walk", "--planner", "own"]
    subprocess.run([*command, "--seed", "3", "--out", str(made), *options], check=True, capture_output=True)
    clip = troupe_reader.read(str(made))
    positions, _ = clip.world()
    return np.asarray(positions), list(clip.skeleton.parents)


def main() -> None:
    """Draws the picture."""
    troupe, out = sys.argv[1:]
    matplotlib.use("Agg")
    figure, axes = plt.subplots(len(BODIES), 2 * len(PATHS), figsize=(20, 11), dpi=52)
    columns = [(path, options) for path in PATHS for options in (["--raw"], [])]
    with tempfile.TemporaryDirectory() as folder:
        for (body, feet), row in zip(BODIES.items(), axes, strict=True):
            for (path, options), axis in zip(columns, row, strict=True):
                places, parents = generated(troupe, body, path, Path(folder), *options)
                if path == "line":
                    for frame in SHOWN:
                        colour = plt.get_cmap("viridis")((frame - SHOWN.start) / len(SHOWN) / SHOWN.step)
                        for joint, parent in enumerate(parents):
                            if parent is not None and parent >= 0:
                                bone = places[frame, [parent, joint]]
                                axis.plot(bone[:, 2], bone[:, 1], color=colour, linewidth=0.8)
                else:
                    ends = [joint for joint in range(len(parents)) if joint not in parents]
                    for foot in sorted(ends, key=lambda joint: places[:, joint, 1].mean())[:feet]:
                        axis.plot(places[:, foot, 0], places[:, foot, 2], ".", markersize=3)
                    axis.plot(places[:, 0, 0], places[:, 0, 2], color="gray", linewidth=0.7)
                axis.set_aspect("equal")
                axis.set_title(f"{body}, {path}, {'raw' if options else 'finished'}", fontsize=9)
                axis.tick_params(labelsize=6)
    figure.tight_layout()
    figure.savefig(out)
    Image.open(out).convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        out, optimize=True
    )


if __name__ == "__main__":
    main()
