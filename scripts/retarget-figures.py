"""Measures how well motion is carried over: every clip of a list onto every character, as a table in Markdown.

.venv/bin/python scripts/retarget-figures.py --clip CLIP ... --to CHARACTER ... [--urdf ROBOT]

Beside it the same figures of rotations copied by name, relative to the rest poses. `--urdf` is the robot of clips in
.csv. The character `mixamo` is a skeleton with Mixamo's joints at rest, which this script writes. Build the program first:

cargo build --release --package troupe-motion --features fbx --example copied
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))

# Joints of a grown person with parents and offsets in cm, in a T-pose. `*` is a side; on the right,
# x has the other sign.
MIXAMO = [
    ("Hips", "", (0, 100, 0)),
    ("Spine", "Hips", (0, 10, -1)),
    ("Spine1", "Spine", (0, 12, 0)),
    ("Spine2", "Spine1", (0, 13, 0)),
    ("Neck", "Spine2", (0, 15, 1)),
    ("Head", "Neck", (0, 10, 3)),
    ("*Shoulder", "Spine2", (6, 9, 0)),
    ("*Arm", "*Shoulder", (13, 0, 0)),
    ("*ForeArm", "*Arm", (27, 0, 0)),
    ("*Hand", "*ForeArm", (27, 0, 0)),
    ("*UpLeg", "Hips", (9, -6, 0)),
    ("*Leg", "*UpLeg", (0, -41, 0)),
    ("*Foot", "*Leg", (0, -42, -1)),
    ("*ToeBase", "*Foot", (0, -9, 14)),
    ("*Toe_End", "*ToeBase", (0, -1, 9)),
]


def mixamo() -> str:
    """The skeleton as a BVH of one frame."""
    joints = []
    for name, parent, (x, y, z) in MIXAMO:
        for side, sign in (("Left", 1), ("Right", -1)) if "*" in name else (("", 1),):
            joints.append((name.replace("*", side), parent.replace("*", side), (sign * x, y, z)))

    def written(name: str, offset: tuple[int, int, int], depth: int) -> str:
        places = "Xposition Yposition Zposition " if depth == 0 else ""
        lines = [
            f"{'JOINT' if depth else 'ROOT'} mixamorig:{name}",
            "{",
            f"OFFSET {offset[0]} {offset[1]} {offset[2]}",
            f"CHANNELS {6 if depth == 0 else 3} {places}Zrotation Xrotation Yrotation",
        ]
        below = [written(child, at, depth + 1) for child, parent, at in joints if parent == name]
        return "\n".join([*lines, *(below or ["End Site", "{", "OFFSET 0 0 0", "}"]), "}"])

    frame = ["0", "100", "0", *["0"] * 3 * len(joints)]
    return "\n".join(
        ["HIERARCHY", written("Hips", (0, 0, 0), 0), "MOTION", "Frames: 1", "Frame Time: 0.033", " ".join(frame)]
    )


def measured(program: Path, clips: list[Path], to: Path, urdf: Path | None) -> list[dict[str, Any]]:
    """The figures of each clip on a character."""
    words = [str(word) for word in (program, to, *clips, *(("--urdf", urdf) if urdf else ()))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{to}: {done.stderr.strip()}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def cells(of: list[dict[str, Any]]) -> list[str]:
    """Bones, sliding, depth under the ground and distance of feet from their places."""
    mean = statistics.fmean(one["directions_deg"] for one in of)
    worst = max(one["worst_deg"] for one in of)
    skate = sum(one["skate_mps"] for one in of) / max(sum(one["source_skate_mps"] for one in of), 1e-9)
    under, short = (1e2 * max(one[key] for one in of) for key in ("under_m", "short_m"))
    return [f"{mean:.1f}° ({worst:.1f}°)", f"{skate:.2f}", f"{under:.1f} cm", f"{short:.1f} cm"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clip", type=Path, nargs="+", required=True)
    parser.add_argument("--to", type=Path, nargs="+", required=True)
    parser.add_argument("--urdf", type=Path)
    parser.add_argument("--program", type=Path, default=TARGET / "release/examples/copied")
    args = parser.parse_args()
    print(
        "| onto | certificate | clips | within the bar | bones, mean (worst) | sliding, of the clip's | under ground "
        "| feet short | copied by name: within | bones | sliding |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    folder = tempfile.TemporaryDirectory()
    rig = Path(folder.name, "mixamo.bvh")
    rig.write_text(mixamo() + "\n")
    for to in (rig if to == Path("mixamo") else to for to in args.to):
        found = measured(args.program, args.clip, to, args.urdf)
        faults = found[0]["certificate"]
        passed, copied = (sum(not one[key] for one in found) for key in ("faults", "copied_faults"))
        bare = cells([one["copied"] for one in found])[:2]
        row = [to.stem, "passes" if not faults else f"{len(faults)} faults", str(len(found)), str(passed)]
        print("| " + " | ".join([*row, *cells([one["figures"] for one in found]), str(copied), *bare]) + " |")
        for one in found:
            if one["faults"]:
                print(f"{one['clip']}: {'; '.join(one['faults'])}", file=sys.stderr)


if __name__ == "__main__":
    main()
