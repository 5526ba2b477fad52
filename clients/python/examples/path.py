"""A horse trots along a curve: python path.py [ADDRESS]. The page path.html plays it."""

import sys
from pathlib import Path

import numpy as np

import troupe

with troupe.Client(*sys.argv[1:2]) as client:
    z = np.linspace(0, 12, 25)
    points = np.stack([1.5 * np.sin(z / 2), np.zeros_like(z), z], axis=1)
    path = troupe.FollowPath(points, words={"trot": 1.0})
    made = client.generate(path, pack="unimogen", body="horse", seed=3)

    off = np.linalg.norm(made.clip.root[-1, [0, 2]] - points[-1, [0, 2]])
    print(f"{len(made.clip)} frames, {len(made.clip) / made.clip.fps:.1f} s; ends {off:.2f} m from the path's end")
    for note in made.notes:
        print(f"note: {note}")
    made.clip.to_glb("horse.glb")
    Path("path.html").write_text(made.clip.to_html("A horse on a path"), encoding="utf-8")
