#!/usr/bin/env python3
"""How well the skills of a pack go, through a running server: the tables of docs/skills.md.

Every variant of every skill is done by characters that stand or walk in several styles, is held for a second and ended.
Measures are those of the pack's card. With --data the same measures of the clips come beside, from the frames that
scripts/build-skills.sh names. Then every style walks for four seconds. The Python client must be installed (clients/python).

    target/python-client/bin/python scripts/measure-skills.py http://127.0.0.1:8080 --pack g1 --data unitree-lafan1/g1
"""

import argparse
import pathlib
import re
import sys
from collections.abc import Iterator

import numpy as np

import troupe
from troupe.v1 import event_pb2

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Where characters come from: style and speed, m/s.
STARTS = (("normal", 0.0), ("normal", 1.2), ("slow", 0.6), ("march", 1.0), ("crouch", 0.9))
SEEDS = range(1, 5)
FPS = 30
MOST_STEPS, STEP_FRAMES, HELD_FRAMES = 180, 5, 30
# As motion/src/metrics has them.
SKATE_HEIGHT_M = 0.025
PENETRATION_TOLERANCE_M = 0.005
# A keyframe is met within so much of root and all joints, metres, and heading, degrees.
MET_M, MET_DEG = 0.05, 15.0
# Frames of a clip before the first keyframe of the way out.
LEAD_FRAMES = 25
HEAD = (
    "skill",
    "done",
    "keyframes met",
    "seconds",
    "before pinning: joint, root (cm)",
    "foot skate (mm/frame)",
    "feet in the ground (mm)",
    "deepest joint (cm)",
    "joint jitter (m/s²)",
    "acceleration, 99.9 % (m/s²)",
)


class Feet:
    """The contact joints of a pack."""

    def __init__(self, pack: troupe.Pack) -> None:
        names = [joint.name for joint in pack.message.joints]
        self.joints = [names.index(name) for name in pack.message.contact_joints]
        self.clearance = np.array(pack.message.contact_rules.clearance)

    def measures(self, positions: np.ndarray) -> dict[str, float]:
        """Foot skate (mm a frame), feet in the ground (mm), deepest joint (cm), jitter and acceleration (m/s²)."""
        feet = positions[:, self.joints]
        height = feet[..., 1] - self.clearance
        step = np.linalg.norm(np.diff(feet[..., (0, 2)], axis=0), axis=-1)
        weight = np.clip(2 - 2 ** (height[1:] / SKATE_HEIGHT_M), 0, 1)
        acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1) * FPS**2
        return {
            "skate": 1000 * float((step * weight).mean()),
            "penetration": 1000 * float(np.maximum(-height - PENETRATION_TOLERANCE_M, 0).mean()),
            "deepest": 100 * float(max(-positions[..., 1].min(), 0)),
            "jitter": float(acceleration.mean()),
            "acceleration": float(np.percentile(acceleration, 99.9)),
        }

    def over(self, parts: list[np.ndarray]) -> dict[str, float]:
        """The means over all frames of several motions; of the deepest joint the most."""
        each = [self.measures(part) for part in parts]
        weights = [len(part) for part in parts]
        mean = {name: float(np.average([one[name] for one in each], weights=weights)) for name in each[0]}
        return mean | {"deepest": max(one["deepest"] for one in each)}


def do(
    client: troupe.Client, pack: str, skill: tuple[str, str], start: tuple[str, float], seed: int
) -> tuple[np.ndarray, list[troupe.Event]]:
    """Joints from a skill's first set to its end, and what happened."""
    (name, variant), (style, speed) = skill, start
    frames: list[troupe.Frames] = []
    events: list[troupe.Event] = []
    ended = False
    with client.session(troupe.SessionOptions(seed=seed, style=style), pack=pack) as session:
        if speed:
            session.walk((0, 0, speed))
            session.step(60)
        session.act(troupe.skill(name, variant=variant))
        for _ in range(MOST_STEPS):
            frames.append(session.step(STEP_FRAMES))
            events += session.events
            if any(event.kind in ("done", "failed", "interrupted") for event in session.events):
                break
            if not ended and session.info().activity.kind == event_pb2.ACTIVITY_KIND_HELD:
                frames.append(session.step(HELD_FRAMES))
                events += session.events
                session.act(troupe.end_interaction())
                ended = True
    first = int(frames[0].first_frames[0])
    positions = np.concatenate([part.world_positions()[:, 0] for part in frames])
    entered = next((event.frame for event in events if event.kind == "entered"), first)
    return positions[entered - first :], events


def clips(data: pathlib.Path, skeleton: troupe.Skeleton) -> Iterator[tuple[tuple[str, str], list[np.ndarray]]]:
    """Joints of each variant's clip, in two parts: the way in, and the way out."""
    text = (ROOT / "scripts" / "build-skills.sh").read_text().replace("\\\n", " ")
    name = ""
    for line in re.findall(r"^new .*", text, re.MULTILINE):
        options = dict(re.findall(r"--(\w+) (\S+)", line))
        name = options.get("name", name)
        frames = [int(frame) for frame in options["frames"].split(",")]
        held = frames.index(int(options["hold"])) if "hold" in options else len(frames) - 1
        file = data / options["from"].strip('"').rpartition("/")[2]
        joints = troupe.Clip.from_csv(file, skeleton).world_positions()
        parts = [joints[int(options["start"]) : frames[held]]]
        if held + 1 < len(frames):
            parts.append(joints[frames[held + 1] - LEAD_FRAMES : frames[-1]])
        yield (name, options["variant"]), parts


def row(cells: tuple[str, ...]) -> None:
    """Prints a row of a table."""
    print("| " + " | ".join(cells) + " |", flush=True)


def skills(client: troupe.Client, pack: troupe.Pack, of_clips: dict[tuple[str, str], dict[str, float]]) -> None:
    """The table of skills."""
    feet = Feet(pack)
    row(HEAD)
    row(("---",) * len(HEAD))
    for skill in [(of.name, variant) for of in pack.message.skills for variant in of.variants]:
        runs = [do(client, pack.name, skill, start, seed) for start in STARTS for seed in SEEDS]
        done = [any(event.kind == "done" for event in events) for _, events in runs]
        reached = [event.detail for _, events in runs for event in events if event.kind == "reached"]
        after = [of.after for of in reached if of.early_frames == 0]
        met = [max(of.root_m, of.joint_m) < MET_M and abs(of.heading_deg) < MET_DEG for of in after]
        before = [
            100 * np.percentile([getattr(of.before, part) for of in reached], 95) for part in ("joint_m", "root_m")
        ]
        mean, clip = feet.over([positions for positions, _ in runs]), of_clips.get(skill)
        cells = []
        for name, digits in (("skate", 1), ("penetration", 1), ("deepest", 0), ("jitter", 1), ("acceleration", 0)):
            beside = f" ({clip[name]:.{digits}f})" if clip else ""
            cells.append(f"{mean[name]:.{digits}f}{beside}")
        seconds = np.mean([len(positions) for positions, _ in runs]) / FPS
        results = (f"{sum(done)} of {len(done)}", f"{sum(met)} of {len(met)}", f"{seconds:.1f}")
        row((f"`{skill[0]}` {skill[1]}", *results, f"{before[0]:.0f}, {before[1]:.0f}", *cells))


def styles(client: troupe.Client, pack: troupe.Pack) -> None:
    """The table of styles."""
    feet, names = Feet(pack), [joint.name for joint in pack.message.joints]
    limbs = [[nth for nth, name in enumerate(names) if name.endswith(end)] for end in ("_knee", "_hand")]
    head = ("style", "speed (m/s)", *HEAD[5:7], *HEAD[8:], "lowest knee, hand (cm)")
    row(head)
    row(("---",) * len(head))
    for style in client.styles(pack=pack.name).styles:
        with client.session(troupe.SessionOptions(seed=1, style=style.name), pack=pack.name) as session:
            session.walk((0, 0, style.default_speed))
            session.step(60)
            positions = session.step(120).world_positions()[:, 0]
        of = feet.measures(positions)
        low = [100 * positions[:, limb, 1].min() if limb else 0 for limb in limbs]
        figures = [f"{of[name]:.1f}" for name in ("skate", "penetration", "jitter", "acceleration")]
        row((f"`{style.name}`", f"{style.default_speed:.2f}", *figures, f"{low[0]:.0f}, {low[1]:.0f}"))


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", help="such as http://127.0.0.1:8080")
    parser.add_argument("--pack", default="g1")
    parser.add_argument("--data", type=pathlib.Path, help="folder of the clips")
    args = parser.parse_args()
    client = troupe.Client(args.server)
    pack = client.pack(args.pack)
    feet = Feet(pack)
    of_clips = {skill: feet.over(parts) for skill, parts in clips(args.data, pack.skeleton)} if args.data else {}
    skills(client, pack, of_clips)
    print()
    styles(client, pack)
    return 0


if __name__ == "__main__":
    sys.exit(main())
