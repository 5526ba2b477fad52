"""Collects the clips that the pack learns from, under names that say what they show.

    python models/open/collect.py FOLDER OUT

FOLDER is the unpacked open-motion archive. OUT gets a link to each clip that is taken, named ``KIND_NUMBER.bvh`` as
``troupe-train`` balances kinds, and ``clips.tsv``: every clip of people with its name there, or why it was left out.
"""

import csv
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

IDLE_S = 60.0  # of each idle: the pack should not stand more than it walks
JUMPED = "its feet are 25 cm under to 50 cm over the ground"
# Clips that cannot be used, and why.
FAULTY = {
    "o3de-locomotion/Jumps1.bvh": JUMPED,
    "o3de-locomotion/JumpsFreeRoam1.bvh": JUMPED,
    "cmu-daz/07/07_12.bvh": "leaps at its start and lies 85 cm too low",
    "cmu-daz/09/09_10.bvh": "leaps at its start",
    "cmu-original/from-expmap/train--directing_traffic--directing_traffic_1.bvh": "its hips shake by 4 cm",
}
LEAPING = re.compile(r".*train--walking_extra--walking_(2[2-6]|4[89]|50)\.bvh")  # at 20 to 40 m/s
# Folders that nothing is taken from, and why.
LEFT_OUT = {
    "cmu-deepmimic": "no format that the reader knows",
    "kaykit": "hand-keyed, of one second, in place",
    "mesh2motion-human": "hand-keyed, of one second, in place",
    "quaternius-human": "hand-keyed, of one second, in place",
    "universal-animation-library": "hand-keyed, of one second, in place",
}
OTHER_BODIES = ("fox", "g1-moves", "quaternius-animals")
SLIDES = "standing feet slide by more than 20 cm/s"
# What slides: dances, dribbling and break dance, and walks of which there are better ones.
SLIDING = re.compile(
    r"cmu-dance-martial/(salsa|indian)|cmu-daz/0[5-8]/|cmu-daz/10/10_04|cmu-daz/12/|cmu-fbx/(85|49|55)_"
)
CLIMBS = re.compile("climb|stool|ladder|steps")


def refusal(clip: dict[str, str]) -> str | None:
    """Why a clip is left out; none if it is taken."""
    path, text = clip["path"], clip["text"]
    folder = path.split("/")[0]
    if folder in LEFT_OUT:
        return LEFT_OUT[folder]
    if path in FAULTY:
        return FAULTY[path]
    if "/03_0" in path:
        return "uneven ground"
    if LEAPING.match(path):
        return "its feet leap"
    if SLIDING.match(path):
        return SLIDES
    if CLIMBS.search(text):
        return "stands or sits on what is not there"
    return None


def name_of(path: str, text: str) -> str:
    """``KIND_NUMBER``: takes of one kind differ in the number alone."""
    folder, stem = path.split("/")[0], Path(path).stem
    if folder == "o3de-locomotion":
        words, number = re.fullmatch(r"(\D+)(\d+)", stem).groups()
        return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", words).lower() + f"_{number}"
    if folder == "react-idle":
        number, kind = stem.split("_")
        return f"idle-{kind}_{number}"
    if "from-expmap" in path:
        split, _, take = stem.split("--")
        kind, number = take.rsplit("_", 1)
        extra = "-extra" if "extra" in stem else ""
        return f"{kind.replace('_', '-')}{extra}-{split}_{number}"
    if folder == "cmu-dance-martial":
        return f"{path.split('/')[1]}_{stem}"
    if path.startswith("cmu-fbx/91"):
        return f"jump-turn_{stem.replace('_', '')}"
    kind = re.sub("[^a-z]+", "-", re.split("[,(]", text.lower().removeprefix("dance - "))[0]).strip("-")
    kind = "dance" if path.startswith("cmu-daz/05") and text.startswith("dance") else kind
    return f"{kind}-{folder.removeprefix('cmu-')}_{stem.replace('_', '')}"


def doubled(clips: Iterable[dict[str, str]]) -> Iterator[str]:
    """Paths of takes that are there on CMU's own skeleton too, which slide less."""
    clips = list(clips)
    trials = {Path(c["path"]).stem for c in clips if "from-amc" in c["path"]}
    known = {c["same_as"].removeprefix("CMU ") for c in clips if "from-expmap" in c["path"] and c["same_as"]}
    for clip in clips:
        stem = Path(clip["path"]).stem
        if clip["path"].startswith("cmu-daz") and stem in trials | known:
            yield clip["path"]
        if "from-expmap" in clip["path"] and clip["same_as"].removeprefix("CMU ") in trials:
            yield clip["path"]


def with_ends(text: str) -> str:
    """A BVH file with hands and toes as joints, which arms and feet are found by: its limbs end in sites without names."""
    for limb, end in (("forearm", "hand"), ("foot", "toe")):
        site = rf"(JOINT {limb}\.([LR])\s*\{{[^{{}}]*)End Site(\s*\{{\s*OFFSET[^\n}}]*)"
        text = re.sub(site, rf"\1JOINT {end}.\2\3\nCHANNELS 0\nEnd Site {{ OFFSET 0 0 0 }}\n", text)
    return text


def cut(text: str, seconds: float) -> str:
    """The first seconds of a BVH file."""
    head, motion = text.split("MOTION")
    lines = motion.strip().splitlines()
    step = float(lines[1].split(":")[1])
    frames = min(len(lines) - 2, round(seconds / step))
    return f"{head}MOTION\nFrames: {frames}\n{lines[1]}\n" + "\n".join(lines[2 : 2 + frames]) + "\n"


def main(folder: Path, out: Path) -> None:
    """Links or cuts every clip that is taken, and writes the list."""
    clips = list(csv.DictReader((folder / "clips.csv").open(encoding="utf-8")))
    clips = [clip for clip in clips if not clip["path"].startswith(OTHER_BODIES)]
    again = set(doubled(clips))
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for clip in clips:
        path = clip["path"]
        why = refusal(clip) or ("the same take is on CMU's own skeleton" if path in again else None)
        if why is not None:
            rows.append((path, clip["clip"], "", why))
            continue
        made = out / (name_of(path, clip["text"]) + Path(path).suffix)
        if made.exists():
            raise SystemExit(f"{path}: {made.name} is taken already; empty {out} first")
        if path.startswith("react-idle"):
            made.write_text(cut(with_ends((folder / path).read_text()), IDLE_S))
        else:
            made.symlink_to((folder / path).resolve())
        rows.append((path, clip["clip"], made.name, ""))
    lines = ["\t".join(row) for row in [("path", "clip", "name", "left out because"), *rows]]
    (out / "clips.tsv").write_text("\n".join(lines) + "\n")
    print(f"{sum(bool(row[2]) for row in rows)} clips taken, {sum(bool(row[3]) for row in rows)} left out")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
