#!/usr/bin/env python3
"""How well the skills of a pack go, through a running server: the tables of docs/skills.md.

Every variant of every skill is done by characters that stand or walk in several styles, is held for a second and ended. Measures are
those of the pack's card. With --data the same measures of the clips come beside, from the frames that scripts/build-skills.sh names.

    target/python-client/bin/python scripts/measure-skills.py http://127.0.0.1:8080 --pack g1 --data unitree-lafan1/g1
"""

import argparse
import pathlib
import re
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "clients" / "python"))
import troupe  # noqa: E402
from troupe.v1 import event_pb2  # noqa: E402

# Where characters come from: style and speed, m/s.
STARTS = (("normal", 0.0), ("normal", 1.2), ("slow", 0.6), ("march", 1.0), ("crouch", 0.9))
SEEDS = 4
MOST_FRAMES = 900
# As motion/src/metrics has them.
SKATE_HEIGHT_M = 0.025
PENETRATION_TOLERANCE_M = 0.005
# A keyframe is met within so much of root and all joints, metres, and heading, degrees.
MET = (0.05, 15.0)


def measures(positions, joints, clearance, fps):
    """Foot skate (mm a frame), penetration of feet (mm), deepest joint (cm), jitter and 99.9 % of acceleration (m/s2)."""
    feet = positions[:, joints]
    height = feet[..., 1] - clearance
    step = np.linalg.norm(np.diff(feet[..., (0, 2)], axis=0), axis=-1)
    weight = np.clip(2 - 2 ** (height[1:] / SKATE_HEIGHT_M), 0, 1)
    acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1) * fps**2
    return {
        "skate": 1000 * float((step * weight).mean()),
        "penetration": 1000 * float(np.maximum(-height - PENETRATION_TOLERANCE_M, 0).mean()),
        "deepest": 100 * float(np.maximum(-positions[..., 1].min(), 0)),
        "jitter": float(acceleration.mean()),
        "acceleration": float(np.percentile(acceleration, 99.9)),
    }


def do(client, pack, skill, variant, start, seed):
    """Frames of a skill from its first set to its end, and what was told."""
    style, speed = start
    frames, events = [], []
    options = troupe.SessionOptions(seed=seed, style=style)
    with client.session(options, pack=pack) as session:
        if speed:
            session.walk((0, 0, speed))
            session.step(60)
        session.act(troupe.skill(skill, variant=variant))
        ended = False
        while len(frames) * 5 < MOST_FRAMES:
            frames.append(session.step(5))
            events += session.events
            if any(event.kind in ("done", "failed", "interrupted") for event in session.events):
                break
            if not ended and session.info().activity.kind == event_pb2.ACTIVITY_KIND_HELD:
                frames.append(session.step(30))
                events += session.events
                session.act(troupe.end_interaction())
                ended = True
    first = int(frames[0].first_frames[0])
    positions = np.concatenate([part.world_positions()[:, 0] for part in frames])
    entered = next((event.frame for event in events if event.kind == "entered"), first)
    return positions[entered - first :], events


def clips(data, skeleton):
    """The measures of each variant's clip, by the names of skill and variant, and of its way in and out together."""
    text = (ROOT / "scripts" / "build-skills.sh").read_text().replace("\\\n", " ")
    name = None
    for line in re.findall(r"^new .*", text, re.MULTILINE):
        word = lambda option: re.search(rf"--{option} (\S+)", line)  # noqa: E731
        name = word("name")[1] if word("name") else name
        frames = [int(frame) for frame in word("frames")[1].split(",")]
        clip = troupe.Clip.from_csv(data / word("from")[1].strip('"').split("/")[-1], skeleton)
        held = frames.index(int(word("hold")[1])) if word("hold") else len(frames) - 1
        yield (name, word("variant")[1]), [clip[int(word("start")[1]) : frames[held]], clip[frames[held + 1] - 25 : frames[-1]] if held + 1 < len(frames) else clip[:0]]


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server")
    parser.add_argument("--pack", default="g1")
    parser.add_argument("--data", type=pathlib.Path, help="folder of the clips")
    args = parser.parse_args()
    client = troupe.Client(args.server)
    pack = client.pack(args.pack)
    rules, names = pack.message.contact_rules, [joint.name for joint in pack.message.joints]
    joints = [names.index(name) for name in pack.message.contact_joints]
    clearance = np.array(rules.clearance) - pack.message.ground_y

    of_clips = {}
    if args.data:
        for key, parts in clips(args.data, pack.skeleton):
            parts = [part.world_positions() for part in parts if len(part) > 3]
            each = [measures(part, joints, clearance, 30) for part in parts]
            total = sum(map(len, parts))
            of_clips[key] = {name: sum(len(p) * m[name] for p, m in zip(parts, each)) / total for name in each[0]}
            of_clips[key]["deepest"] = max(m["deepest"] for m in each)

    head = "| skill | done | keyframes met | seconds | before pinning: joint, root | foot skate | penetration | deepest joint | jitter | acceleration |"
    print(head + "\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|")
    walks = []
    for skill in pack.message.skills:
        for variant in skill.variants:
            runs = [do(client, pack.name, skill.name, variant, s, seed) for s in STARTS for seed in range(1, SEEDS + 1)]
            done = [any(event.kind == "done" for event in events) for _, events in runs]
            reached = [event.detail for _, events in runs for event in events if event.kind == "reached"]
            hard = [detail for detail in reached if detail.early_frames == 0]
            near = [max(d.after.root_m, d.after.joint_m) < MET[0] and abs(d.after.heading_deg) < MET[1] for d in hard]
            each = [measures(positions, joints, clearance, 30) for positions, _ in runs]
            mean = {name: float(np.mean([m[name] for m in each])) for name in each[0]}
            mean["deepest"] = max(m["deepest"] for m in each)
            clip = of_clips.get((skill.name, variant))
            beside = lambda name, digits: (  # noqa: E731
                f"{mean[name]:.{digits}f}" + (f" ({clip[name]:.{digits}f})" if clip else "")
            )
            before = [100 * float(np.percentile([getattr(d.before, f) for d in reached], 95)) for f in ("joint_m", "root_m")]
            print(
                f"| `{skill.name}` {variant} | {sum(done)} of {len(done)} | {100 * np.mean(near):.0f} % of {len(near)} "
                f"| {np.mean([len(p) for p, _ in runs]) / 30:.1f} | {before[0]:.0f}, {before[1]:.0f} cm | {beside('skate', 1)} "
                f"| {beside('penetration', 1)} | {beside('deepest', 0)} | {beside('jitter', 1)} | {beside('acceleration', 0)} |",
                flush=True,
            )
    for style in client.styles(pack=pack.name).styles:
        speed = style.default_speed
        with client.session(troupe.SessionOptions(seed=1, style=style.name), pack=pack.name) as session:
            session.walk((0, 0, speed))
            session.step(60)
            walks.append((style.name, speed, session.step(120).world_positions()[:, 0]))
    hands = [nth for nth, name in enumerate(names) if name.endswith("_hand")]
    knees = [nth for nth, name in enumerate(names) if name.endswith("_knee")]
    print("\n| style | speed | foot skate | penetration | jitter | acceleration | lowest knee, hand |\n|---|---:|---:|---:|---:|---:|---|")
    for name, speed, positions in walks:
        m = measures(positions, joints, clearance, 30)
        low = [100 * positions[:, part, 1].min() for part in (knees, hands)]
        print(
            f"| `{name}` | {speed:.2f} m/s | {m['skate']:.1f} | {m['penetration']:.1f} | {m['jitter']:.1f} | {m['acceleration']:.0f} "
            f"| {low[0]:.0f}, {low[1]:.0f} cm |"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
