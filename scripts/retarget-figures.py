"""Measures how well motion is carried over: every clip of a list onto every character, as a table in Markdown.

.venv/bin/python scripts/retarget-figures.py --clip CLIP ... --to CHARACTER ... [--program target/release/troupe] [-- OPTION ...]

The options after `--` go to `troupe retarget`, such as `--urdf g1.urdf` for clips of a robot.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


def figures(program: Path, clip: Path, to: Path, options: list[str]) -> dict[str, Any]:
    """What `troupe retarget` says of a clip on a character."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.glb"
        words = [program, "retarget", clip, "--to", to, "--out", out, "--json", "--force", *options]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{clip} onto {to}: {done.stderr.strip()}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clip", type=Path, nargs="+", required=True)
    parser.add_argument("--to", type=Path, nargs="+", required=True)
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/troupe")
    parser.add_argument("options", nargs="*", help="options of troupe retarget, after --")
    args = parser.parse_args()
    print(
        "| character | clips | passed | bones, mean (worst) | skate, of the clip's | under ground, worst | feet short, worst |"
    )
    print("|---|---|---|---|---|---|---|")
    for to in args.to:
        found = [figures(args.program, clip, to, args.options) for clip in args.clip]
        of = [one["figures"] for one in found]
        mean = statistics.fmean(one["directions_deg"] for one in of)
        worst = max(one["worst_deg"] for one in of)
        skate = sum(one["skate_mps"] for one in of) / max(sum(one["source_skate_mps"] for one in of), 1e-9)
        under, short = (1e2 * max(one[key] for one in of) for key in ("under_m", "short_m"))
        passed = sum(not one["faults"] for one in found)
        print(
            f"| {to.stem} | {len(found)} | {passed} | {mean:.1f}° ({worst:.1f}°) | {skate:.2f} "
            f"| {under:.1f} cm | {short:.1f} cm |"
        )


if __name__ == "__main__":
    main()
