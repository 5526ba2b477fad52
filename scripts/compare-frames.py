#!/usr/bin/env python3
"""Compares the frames of two servers that serve the packs in models/: every bit must be the same.

Both play the same scenario: in-betweens of all lengths, alone and sixteen in a request; sessions of both packs that change
their mind; and sessions in a courtyard that sit, bow, carry a cup, greet and give up. A server is a binary that is built already.

    scripts/compare-frames.py OLD NEW
    scripts/compare-frames.py OLD NEW --engine openvino-bf16 --within 0.05

With --within numbers may differ by so much where the tokens are the same, for engines that round otherwise in calls of other
shapes. Sessions go on from their own frames and drift apart then, so only in-betweens are played.
"""

import argparse
import contextlib
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import urllib.error
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parent.parent
OBJECTS = ("cup", "greeter", "seat", "shrine", "sign")
STEPS = (1, 4, 15, 30, 8, 2)
STEPPED_FRAMES = 480
# What an answer says of itself, not of the frames.
LEFT_OUT = {"timing", "total_us", "waited_us", "pack_version"}
# Style, velocity along x and z, heading, from which frame on.
WALKS = [
    (0, "", 0.0, 1.2, None),
    (60, "", 1.0, 0.5, None),
    (150, "", -0.5, 0.0, 1.5),
    (240, "", 0.0, 0.0, None),
    (330, "", 0.0, -1.5, None),
]
# Who stands where (x, z, degrees), and does what from which frame on.
ACTORS = {
    "sit": ((-0.6, 2.6, 180.0), [(15, {"interact": {"instance": "stool"}}), (270, {"end_interaction": {}})]),
    "bow": ((1.0, -2.2, 90.0), [(15, {"interact": {"instance": "shrine"}})]),
    "carry": (
        (0.3, -0.2, 90.0),
        [
            (15, {"interact": {"instance": "cup-2"}}),
            (240, {"locomote": {"velocity": {"x": 0.0, "z": 0.8}}}),
            (330, {"drop": {}}),
        ],
    ),
    "greet": ((1.5, 4.0, 45.0), [(15, {"interact": {"instance": "gate"}})]),
    "give-up": ((-3.5, -5.0, 30.0), [(15, {"interact": {"instance": "sign"}}), (105, {"cancel": {}})]),
    "ramp": ((-4.0, -3.0, 0.0), [(15, {"locomote": {"velocity": {"x": 0.0, "z": 1.4}}})]),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", help="one server's binary")
    parser.add_argument("new", help="another one's")
    parser.add_argument("--engine", default="cpu", help="the engine of both; cpu computes in f32")
    parser.add_argument("--within", type=float, help="how far numbers may differ; left out: not at all")
    args = parser.parse_args()
    old, new = (dict(play(server, args.engine, args.within is None)) for server in (args.old, args.new))
    differ = [name for name in old if old[name] != new.get(name)]
    print(f"{len(old) - len(differ)} of {len(old)} answers are the same, bit by bit, on {args.engine}")
    if args.within is None:
        for name in differ:
            print(f"{name}: {first_difference(old[name], new.get(name))}")
        return 1 if differ or old.keys() != new.keys() else 0
    return near(old, new, args.within)


def near(old: dict, new: dict, within: float) -> int:
    """Compares the characters whose tokens are the same."""
    pairs = [
        (before, after)
        for name, answer in old.items()
        for before, after in zip(answer["characters"], new[name]["characters"], strict=True)
    ]
    tokens = [(token, other) for pair in pairs for token, other in zip(*map(tokens_of, pair), strict=False)]
    others = sum(token != other for token, other in tokens)
    print(f"{100 * others / len(tokens):.1f} % of {len(tokens)} tokens are others")
    same = [pair for pair in pairs if tokens_of(pair[0]) == tokens_of(pair[1])]
    most = max((distance(before["frames"], after["frames"]) for before, after in same), default=0.0)
    print(f"{len(same)} of {len(pairs)} characters have the same tokens; their numbers differ by {most:.6f} at most")
    return 1 if most > within or not same else 0


def tokens_of(character: dict) -> list:
    return character["intermediates"]["tokens"]


def distance(one: object, other: object) -> float:
    """The largest difference between numbers of the same place."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        return max((distance(one[key], other[key]) for key in one), default=0.0)
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return max((distance(*pair) for pair in zip(one, other, strict=True)), default=0.0)
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other)
    return 0.0 if one == other else math.inf


def first_difference(one: object, other: object, path: str = "") -> str:
    """Where two answers differ first, in words."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        return next(first_difference(one[key], other[key], f"{path}.{key}") for key in one if one[key] != other[key])
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        index = next(index for index, pair in enumerate(zip(one, other, strict=True)) if pair[0] != pair[1])
        return first_difference(one[index], other[index], f"{path}[{index}]")
    return f"{path or 'it'} is {str(other)[:200]}, was {str(one)[:200]}"


def play(server: str, engine: str, sessions: bool):
    """The scenario: names of answers, and the answers."""
    with running(server, engine) as url:
        for pack in call(f"{url}/v1/packs")["packs"]:
            if "inbetween" not in pack["capabilities"]:
                continue
            yield from in_betweens(url, pack)
            if sessions:
                yield from stepped(url, pack)
        if sessions:
            yield from courtyard(url)


@contextlib.contextmanager
def running(server: str, engine: str):
    command = [server, "--listen", "127.0.0.1:0", "--packs", str(ROOT / "models"), "--engine", engine]
    with tempfile.TemporaryFile("w+") as log:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            for line in process.stdout:
                if " on http://" in line and line.startswith("Troupe serves"):
                    yield line.rsplit(" on ", 1)[1].strip()
                    return
            log.seek(0)
            sys.exit(f"{server} does not start: {log.read()}")
        finally:
            process.terminate()
            process.wait()


def call(url: str, body: object = None, method: str | None = None) -> dict:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"content-type": "application/json"}, method=method)
    try:
        with urllib.request.urlopen(request) as answer:
            return clean(json.load(answer))
    except urllib.error.HTTPError as error:
        sys.exit(f"{url}: {error.code}: {error.read().decode()}")


def clean(answer: object) -> object:
    if isinstance(answer, dict):
        return {key: clean(value) for key, value in answer.items() if key not in LEFT_OUT}
    return [clean(value) for value in answer] if isinstance(answer, list) else answer


def in_betweens(url: str, pack: dict):
    characters = list(gaps(pack))
    for index, character in enumerate(characters):
        body = {"pack": pack["name"], "characters": [character]}
        yield f"{pack['name']} in-between {index}", call(f"{url}/v1/inbetween", body)
    for start in range(0, len(characters), 16):
        body = {"pack": pack["name"], "characters": characters[start : start + 16]}
        yield f"{pack['name']} in-betweens from {start}", call(f"{url}/v1/inbetween", body)


def gaps(pack: dict):
    """Gaps of a walk, or of the rest pose moved along for a pack that the walk does not fit."""
    walk = json.loads((ROOT / "examples/request.json").read_text())["characters"][0]
    fits = len(walk["context"][0]["pose"]["rotations"]) == 4 * len(pack["joints"])
    rest = [{"rotations": [1.0, 0.0, 0.0, 0.0] * len(pack["joints"])}] * 4

    def key(pose: dict, z: float) -> dict:
        return {"pose": pose, "root": {"position": {"x": 0.0, "y": 0.9, "z": z}}}

    for index, frames in enumerate(range(12, 65)):
        speed = 0.01 + 0.002 * (index % 20)
        if fits:
            context, targets = walk["context"], walk["targets"][: 1 + index % len(walk["targets"])]
        else:
            context = [key(pose, speed * frame) for frame, pose in enumerate(rest)]
            targets = [key(rest[0], speed * (frames - 1))]
        if index % 4 == 3:
            targets = [{"root": target["root"] | {"heading": 0.3}} for target in targets]
        character = {
            "id": str(index),
            "seed": index,
            "context": context,
            "targets": targets,
            "temperature": 0.8 * (index % 2),
            "pose_steps": 1 + 3 * (index % 3 == 0),
            "hold_feet": index % 5 != 0,
            "return_intermediates": True,
            "return_positions": True,
        }
        yield character if index % 7 == 6 else character | {"frame_count": frames}


def stepped(url: str, pack: dict):
    ids = [f"{pack['name']}-{index}" for index in range(6)]
    styles = [style["name"] for style in call(f"{url}/v1/packs/{pack['name']}/styles")["styles"]]
    sessions = [{"id": id, "pack": pack["name"], "seed": index} for index, id in enumerate(ids)]
    cues = []
    for index, id in enumerate(ids):
        for frame, _, x, z, facing in WALKS:
            velocity = {"x": x * (-1 if index % 2 else 1), "z": z}
            locomote = {"velocity": velocity, "style": styles[(index + frame) % len(styles)]}
            cues.append(
                (frame + 5 * index, id, {"locomote": locomote | ({} if facing is None else {"facing": facing})})
            )
    yield from steps(url, f"{pack['name']} steps", sessions, cues)


def courtyard(url: str):
    for name in OBJECTS:
        text = (ROOT / f"examples/objects/{name}.toml").read_text()
        name = tomllib.loads(text)["name"]
        call(f"{url}/v1/objects/{name}", {"pack": "human", "document": {"format": "toml", "text": text}}, "PUT")
    text = (ROOT / "examples/scenes/courtyard.toml").read_text()
    call(f"{url}/v1/scenes/courtyard", {"document": {"format": "toml", "text": text}}, "PUT")
    sessions, cues = [], []
    for index, (id, ((x, z, degrees), does)) in enumerate(ACTORS.items()):
        place = {"position": {"x": x, "y": 0.0, "z": z}, "heading": math.radians(degrees)}
        sessions.append({"id": id, "pack": "human", "seed": 400 + index, "scene": "courtyard"} | place)
        cues += [(frame, id, intent) for frame, intent in does]
    yield from steps(url, "courtyard", sessions, cues)


def steps(url: str, name: str, sessions: list[dict], cues: list[tuple]):
    """Steps sessions together, in steps of several lengths, and gives each cue with the first step from its frame on."""
    call(f"{url}/v1/sessions", {"sessions": [session | {"ttl_ms": 600_000} for session in sessions]})
    cues = sorted(enumerate(cues, 1), key=lambda cue: cue[1][0])
    frame, nth = 0, 0
    while frame < STEPPED_FRAMES:
        due = [cue for cue in cues if cue[1][0] <= frame]
        cues = cues[len(due) :]
        body = {
            "session_ids": [session["id"] for session in sessions],
            "frames": min(STEPS[nth % len(STEPS)], STEPPED_FRAMES - frame),
            "commands": [{"session_id": id, "sequence": sequence, **intent} for sequence, (_, id, intent) in due],
            "encoding": "f32",
            "return_positions": True,
        }
        yield f"{name}, step {nth}", call(f"{url}/v1/step", body)
        frame, nth = frame + body["frames"], nth + 1


if __name__ == "__main__":
    sys.exit(main())
