"""A cache of motion of many bodies, in terms that mean the same on each (`data/bodies.py`).

A folder a body: ``body.json``; ``clips.json``, which frames belong to which clip, what it shows, which split it is of, what
was understood of the files, what was dropped and why; ``bends.npy`` (`int16` ``[F, J, 6]``), ``roots.npy`` (positions
``[F, 3]``, metres), ``headings.npy`` (``[F]``, radians) and ``contacts.npy`` (``[F, C]`` of 0/1). A body that is there already,
made from the same options, is not made again.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import numpy as np

from troupe_reader.options import FileOptions
from troupe_training.data.bodies import (
    LEFT,
    Body,
    bends,
    body_of,
    pack_bends,
    positions_of,
    sides_of,
    unbend,
    unpack_bends,
)
from troupe_training.data.cells import CLIP_NAME, cell_of
from troupe_training.data.clips import (
    MIN_CLIP_FRAMES,
    Clip,
    MotionSource,
    detect_contacts,
    headings,
    in_test_split,
    skeleton_of,
)
from troupe_training.data.conventions import FPS
from troupe_training.data.gaits import feet_of, with_root_motion
from troupe_training.data.gltf import Rig, read_rig
from troupe_training.data.neutral import average_pose, robot_neutral, straightened
from troupe_training.data.prepare import drop_odd_skeletons, files_of, load_all
from troupe_training.data.reader import printed, understood
from troupe_training.data.rotations import columns_to_matrix
from troupe_training.data.skeleton import Skeleton

VERSION = 2  # of the cache
# Stance feet of gaits that are keyed by hand slide: they count as standing below this share of the
# root's speed.
KEYED_STANCE = 0.4
MAX_ROUND_TRIP_M = 1e-3
RIG_ENDINGS = (".glb", ".gltf")
LEFT_AXIS = [1.0, 0.0, 0.0]  # of rigs that head along +Z at rest
LAFAN_NAME = re.compile(r"(?P<content>[A-Za-z]+)\d*_subject\d+")
NAMED_REASONS = 3  # most clips that an error names
STILL = re.compile("rest.?pose", re.IGNORECASE)


class CorpusClip(TypedDict):
    """A clip of a body: its frames in the arrays, what it shows (``content``, and ``style`` if any), and its split.

    ``take`` is the file that it was cut out of and ``first`` its first frame there; older caches do not say.
    """

    name: str
    start: int
    frames: int
    split: str  # train, test, or cell: held out as a combination
    words: list[str]
    take: NotRequired[str]
    first: NotRequired[int]


@dataclass
class Wanted:
    """One body, or of rigs (glTF) one a file, to be made from a folder of motion."""

    name: str
    source: Path
    reader: MotionSource | None = None  # None: rigs
    test_name: str | None = None  # finds the names of the test split; 5 % by a hash if left out
    tested: bool = True  # false: everything is trained on
    cells: frozenset[str] = frozenset()  # held out, see `data/cells.py`
    licence: str = "unknown"
    credits: list[str] = field(default_factory=list)
    given: FileOptions = field(default_factory=FileOptions)  # options for reading rigs

    def options(self) -> dict[str, Any]:
        """Options that a cached body depends on."""
        reader: Mapping[str, Any] = self.reader.options() if self.reader else self.given
        about = {"licence": self.licence, "credits": self.credits, "version": VERSION}
        chosen = {"test_name": self.test_name, "tested": self.tested, "cells": sorted(self.cells)}
        return {"source": str(self.source.resolve()), **reader, **chosen, **about}


@dataclass
class Made:
    """A body's motion before it is written: clips, dropped files and notes."""

    body: Body
    clips: list[Clip]
    dropped: dict[str, str]
    notes: dict[str, list[str]]
    understood: list[list[str]]  # of the files: `data/reader.py`


def kebab(name: str) -> str:
    """``fallAndGetUp`` and ``Walk RM`` as ``fall-and-get-up`` and ``walk-rm``."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name)
    return re.sub(r"[\W_]+", "-", parted).strip("-").lower()


def words_of(clip: str) -> list[str]:
    """The words of a clip, by its file's name: content and style, or the name without the take's number."""
    if found := CLIP_NAME.match(clip):
        cell = cell_of(clip)
        assert cell is not None
        return [found["content"], cell.rsplit("_", 1)[1]]
    found = LAFAN_NAME.match(clip)
    stem = re.sub(r"_part\d+$", "", Path(clip).stem)
    content = found["content"] if found else re.sub(r"[\W_]*\d*$", "", stem)
    return [kebab(content) or "motion"]


def make_corpus(wanted: Iterable[Wanted], cache: Path, workers: int = 1) -> list[str]:
    """Makes every body that is not in the cache yet, and writes ``report.md`` there. Returns the bodies' names."""
    names = []
    for one in wanted:
        for name, make in _bodies(one, workers):
            folder, options = cache / name, one.options()
            done = folder / "clips.json"
            if done.exists() and json.loads(done.read_text())["options"] == json.loads(json.dumps(options)):
                print(f"{name}: cached")
            else:
                made = make()
                _write(folder, one, made, options)
                for row in printed(made.understood):
                    print(f"{name}: {row}")
            names.append(name)
    text = report(cache, names)
    (cache / "report.md").write_text(text)
    print(text)
    return names


def _bodies(one: Wanted, workers: int) -> list[tuple[str, Callable[[], Made]]]:
    if one.reader is not None:
        return [(one.name, partial(_from_files, one, one.reader, workers))]
    files = sorted(p for p in one.source.rglob("*") if p.suffix.lower() in RIG_ENDINGS)
    if not files:
        raise SystemExit(f"no {' or '.join(RIG_ENDINGS)} file under {one.source}")
    return [(_rig_name(path), partial(_from_rig, path, one.given)) for path in files]


def _rig_name(path: Path) -> str:
    return re.sub("-animations?$", "", kebab(path.stem))


def _from_files(one: Wanted, reader: MotionSource, workers: int) -> Made:
    """A folder of files that share a skeleton."""
    loaded = load_all(files_of(one.source, reader, None), reader, workers, one.name)
    drop_odd_skeletons(loaded)
    kept = [file for file in loaded if file.dropped is None]
    clips = [clip for file in kept for clip in file.clips]
    offsets = np.median([file.offsets for file in kept], axis=0)
    try:
        skeleton = reader.skeleton(kept[0].names, kept[0].parents, offsets, clips)
    except ValueError as error:
        raise SystemExit(f"{one.source}, skeleton of {kept[0].file}: {error}") from error
    if skeleton.robot is not None:
        neutral = robot_neutral(skeleton)
    else:
        neutral = straightened(skeleton, average_pose([c.six_d for c in clips], skeleton.left_axis))
    dropped = {file.file: file.dropped for file in loaded if file.dropped is not None}
    notes = {file.file: file.notes for file in kept if file.notes}
    table = understood(file.report for file in kept if file.report is not None)
    return Made(body_of(one.name, skeleton, neutral), clips, dropped, notes, table)


def _from_rig(path: Path, given: FileOptions) -> Made:
    """One glTF file: its rest pose is neutral, and gaits get their root motion from stance feet."""
    try:
        rig = read_rig(path, given)
    except ValueError as error:
        raise SystemExit(f"{path}: {str(error).removeprefix(f'{path.name}: ')}") from error
    names, parents = rig.rest.names, rig.rest.parents
    feet, sides = feet_of(rig.rest, sides_of(names)), sides_of(names)
    extent = float(np.linalg.norm(np.ptp(rig.rest.positions[0], axis=0)))
    size = max(float(rig.rest.positions[0, 0, 1]), extent / 4) if any(sides) else extent / 4
    dropped, notes, clips = dict(rig.refused), {path.name: rig.notes} if rig.notes else {}, []
    for name, motion in rig.clips.items():
        if STILL.search(name):
            dropped[name] = "the rest pose, no motion"
            continue
        moved = with_root_motion(name, motion, feet, size)
        if moved.motion is None:
            dropped[name] = moved.reason or ""
            continue
        notes |= {name: [moved.note]} if moved.note else {}
        if len(moved.motion.positions) < MIN_CLIP_FRAMES:
            dropped[name] = f"only {len(moved.motion.positions)} frames, at least {MIN_CLIP_FRAMES} are needed"
            continue
        # Keyed by hand: what is checked in captures (speeds, shifts, the ground) is meant here.
        columns = moved.motion.rotations
        six_d = np.concatenate([columns[..., 0], columns[..., 1]], -1).astype(np.float32)
        clips.append(Clip(name, name, 0, moved.motion.positions.astype(np.float32), six_d))
    if not clips:
        raise SystemExit(
            f"{path}: none of its {len(dropped)} animations can be used: {_reasons(dropped)}. Its root is {names[0]}: --root "
            "decides if another joint carries the body; else take the file out of the folder"
        )
    return Made(
        _rig_body(_rig_name(path), rig, names, parents, feet, clips), clips, dropped, notes, understood(rig.reports)
    )


def _reasons(dropped: dict[str, str]) -> str:
    """Why some clips are left out."""
    return "; ".join(f"{name}: {reason}" for name, reason in list(dropped.items())[:NAMED_REASONS])


def _rig_body(name: str, rig: Rig, names: list[str], parents: list[int], feet: list[int], clips: list[Clip]) -> Body:
    if feet:
        contacts = [names[j] for j in feet]
        skeleton = skeleton_of(names, parents, rig.rest.offsets, 9, LEFT_AXIS, contacts, clips)
    else:
        skeleton = Skeleton(names, parents, rig.rest.offsets.tolist(), LEFT_AXIS)
    return body_of(name, skeleton, rig.rest.rotations[0])


def _write(folder: Path, one: Wanted, made: Made, options: dict[str, Any]) -> None:
    """Checks every clip's round trip and writes the body's files, the index last."""
    body, index, start = made.body, [], 0
    arrays: dict[str, list[np.ndarray]] = {"bends": [], "roots": [], "headings": [], "contacts": []}
    worst = 0.0
    for clip in made.clips:
        packed = pack_bends(bends(body, columns_to_matrix(clip.six_d)))
        again = positions_of(body, clip.positions[:, 0], unbend(body, unpack_bends(packed)))
        error = float(np.linalg.norm(again - clip.positions, axis=-1).max())
        if error > MAX_ROUND_TRIP_M:
            made.dropped[clip.name] = f"joints are {1e3 * error:.1f} mm off after the round trip through bends"
            continue
        worst = max(worst, error)
        arrays["bends"].append(packed)
        arrays["roots"].append(clip.positions[:, 0].astype(np.float32))
        arrays["headings"].append(headings(_neutral_six_d(body, clip), LEFT).astype(np.float32))
        share = KEYED_STANCE if one.reader is None else 0.0
        arrays["contacts"].append(detect_contacts(clip.positions, body.skeleton, share))
        index.append(_entry(one, clip, start))
        start += len(clip.positions)
    if not index:
        raise SystemExit(f"{body.name}, {one.source}: no clip is left: {_reasons(made.dropped)}")
    folder.mkdir(parents=True, exist_ok=True)
    body.save(folder / "body.json")
    for name, parts in arrays.items():
        np.save(folder / f"{name}.npy", np.concatenate(parts))
    about = {"options": options, "understood": made.understood, "dropped": made.dropped, "notes": made.notes}
    (folder / "clips.json").write_text(json.dumps(about | {"round_trip_m": worst, "clips": index}, indent=1))


def _neutral_six_d(body: Body, clip: Clip) -> np.ndarray:
    """The root's turn out of the neutral pose as ``[F, 1, 6]``: there, left is +X on every body."""
    turned = columns_to_matrix(clip.six_d[:, 0]) @ body.rotations[0].T
    return np.concatenate([turned[..., 0], turned[..., 1]], -1)[:, None]


def _entry(one: Wanted, clip: Clip, start: int) -> CorpusClip:
    tested = one.tested and in_test_split(clip.file, one.test_name)
    split = "cell" if cell_of(clip.name) in one.cells else "test" if tested else "train"
    frames = len(clip.positions)
    return {
        "name": clip.name,
        "start": start,
        "frames": frames,
        "split": split,
        "words": words_of(clip.name),
        "take": clip.file,
        "first": clip.first_frame,
    }


def report(cache: Path, names: list[str]) -> str:
    """The content of the cache as Markdown: a row a body, then all that was left out, and why."""
    rows = [
        "| body | joints | rows with hinge | clips | train | test | cells | minutes | round trip, mm | left out |",
        "|---" * 10 + "|",
    ]
    left_out = []
    for name in names:
        listing, body = json.loads((cache / name / "clips.json").read_text()), Body.load(cache / name / "body.json")
        clips: list[CorpusClip] = listing["clips"]
        split = [sum(c["split"] == which for c in clips) for which in ("train", "test", "cell")]
        minutes = sum(c["frames"] for c in clips) / FPS / 60
        hinges = int((np.linalg.norm(body.axes, axis=-1) > 0.5).sum())
        rows.append(
            f"| {name} | {body.joint_count} | {hinges} | {len(clips)} | {split[0]} | {split[1]} | {split[2]} | {minutes:.1f} | "
            f"{1e3 * listing['round_trip_m']:.2f} | {len(listing['dropped'])} |"
        )
        left_out += [f"- {name}, left out: {file}: {reason}" for file, reason in listing["dropped"].items()]
        left_out += [
            f"- {name}, note: {file}: {text}" for file, texts in listing["notes"].items() for text in texts[:4]
        ]
    return "\n".join([*rows, "", *left_out]) + "\n"
