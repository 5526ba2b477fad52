"""``prepare``: a folder of motion, of a character or of a robot -> cached arrays that training reads.

The cache holds, for all clips end to end: world joint positions ``[F, J, 3]`` (metres), world rotations in 6D
``[F, J, 6]``, headings ``[F]``, contacts ``[F, C]``; ``clips.json`` says which frames belong to which clip, what was
understood of the files, and which files were dropped, cut or look odd, and why; ``skeleton.json`` is the skeleton that all kept
clips share.
"""

import json
import re
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import troupe_reader
from troupe_training.data.cells import cell_of, mirrored_cell
from troupe_training.data.clips import (
    MAX_FLOOR_ERROR_M,
    Clip,
    MotionSource,
    cut,
    detect_contacts,
    floor_errors,
    headings,
    in_test_split,
    with_suffix,
)
from troupe_training.data.conventions import FPS
from troupe_training.data.joint_source import JointSource
from troupe_training.data.mirror import mirror_of
from troupe_training.data.reader import printed, understood
from troupe_training.data.retarget import RetargetSource, carried_line
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import ClipEntry

MAX_OFFSET_ERROR_M = 0.02
SONIC_FILE = "joint_pos.csv"  # of a motion; the reader takes the other files beside it
NOTES_SHOWN = 4  # of one file; clips.json has them all


@dataclass
class Choice:
    """Which files are taken and what for."""

    include: str | None = None  # only files whose name this expression finds
    test_name: str | None = None  # finds the names of the test split; a hash of the name tells if left out
    mirror: bool = False  # adds the mirror image of every training clip
    cells: list[str] = field(
        default_factory=list
    )  # combinations of content and style that are held out (`data/cells.py`)

    def tests(self, clip: Clip) -> bool:
        """True for clips kept for testing."""
        return in_test_split(clip.file, self.test_name)

    def holds_out(self, clip: Clip) -> bool:
        """True for clips of a held-out cell, and for mirrored ones that show one."""
        cell = cell_of(clip.file)
        return cell is not None and (mirrored_cell(cell) if clip.mirrored else cell) in self.cells


@dataclass
class Loaded:
    """Result of one file: its clips, or the reason why there are none."""

    file: str
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    clips: list[Clip] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    report: dict[str, Any] | None = None
    carried: dict[str, Any] | None = None
    dropped: str | None = None


def load_file(path: Path, source: MotionSource) -> list[Loaded]:
    """One file's clips, or why it has none. If the file has several animations, each is as a file of its own."""
    name = file_name(path)
    try:
        animations = troupe_reader.animations(path, name=path.name)
    except (ValueError, OSError) as error:
        return [_dropped(name, path, error)]
    if len(animations) < 2:
        return [_load(name, path, source)]
    return [_load(with_suffix(name, f"_{animation}"), path, source, animation) for animation in animations]


def _load(name: str, path: Path, source: MotionSource, animation: str | None = None) -> Loaded:
    try:
        motion = source.load(path, animation)
        clips, notes = cut(name, motion)
    except (ValueError, LookupError, ArithmeticError, OSError, MemoryError) as error:
        return _dropped(name, path, error)
    return Loaded(name, motion.names, motion.parents, motion.offsets, clips, notes, motion.report, motion.carried)


def _dropped(name: str, path: Path, error: Exception) -> Loaded:
    reason = str(error).removeprefix(f"{path.name}: ")
    return Loaded(name, dropped=reason or type(error).__name__)


def file_name(path: Path) -> str:
    """The name of a file's clips. SONIC's files have the same names in each folder, so the folder gives it."""
    return f"{path.parent.name}{path.suffix}" if path.name == SONIC_FILE else path.name


def files_of(folder: Path, source: MotionSource, include: str | None) -> list[Path]:
    """The files that a source reads, in all of a folder; ends the command if there are none."""
    files = sorted(p for p in folder.rglob("*") if p.suffix.lower() in source.endings and p.is_file())
    sonic = {p.parent for p in files if p.name == SONIC_FILE}
    files = [p for p in files if p.parent not in sonic or p.name == SONIC_FILE or p.suffix.lower() != ".csv"]
    endings = ", ".join(source.endings)
    if not files:
        if not folder.is_dir():
            raise SystemExit(f"{folder} is no folder; give the folder of the {endings} files")
        others = set(troupe_reader.ROBOT_ENDINGS) - set(source.endings)
        found = sorted({p.suffix.lower() for p in folder.rglob("*")} & others)
        hint = f"; {' and '.join(found)} files need their robot's --urdf" if found else ""
        raise SystemExit(f"no {endings} file under {folder}{hint}")
    files = [p for p in files if include is None or re.search(include, file_name(p))]
    if not files:
        raise SystemExit(f"no {endings} file under {folder} has a name that fits {include!r}")
    return files


def load_all(files: list[Path], source: MotionSource, workers: int, what: str) -> list[Loaded]:
    """All files' clips, in order; ends the command if none can be used."""
    try:
        source.survey(files)
    except (OSError, ValueError) as error:
        raise SystemExit(f"{what}: {error}") from error
    load = partial(load_file, source=source)
    with ProcessPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        results = pool.map(load, files, chunksize=1 + len(files) // (16 * workers)) if pool else map(load, files)
        loaded = [one for of_file in tqdm(results, total=len(files), desc=what) for one in of_file]
    if all(one.dropped for one in loaded):
        raise SystemExit(f"{what}: none of {len(files)} files can be used, e.g. {loaded[0].file}: {loaded[0].dropped}")
    return loaded


def drop_odd_skeletons(loaded: list[Loaded]) -> None:
    """Drops the files whose joints or bones are not those of the others; ends the command if none are left."""
    kept = [one for one in loaded if one.dropped is None]
    for one in kept:
        if one.names != kept[0].names:
            one.dropped = "another skeleton than the first clip's"
    kept = [one for one in kept if one.dropped is None]
    usual = np.median([one.offsets for one in kept], axis=0)
    for one in kept:
        error = np.abs(one.offsets - usual)[1:].max(initial=0.0)
        if error > MAX_OFFSET_ERROR_M:
            one.dropped = f"a bone is {error:.3f} m off the usual length"
    if all(one.dropped for one in kept):
        raise SystemExit(
            f"the files are of different bodies, e.g. {kept[0].file}: {kept[0].dropped}; prepare a folder for each body"
        )


def prepare(
    folder: Path,
    cache: Path,
    source: MotionSource | None = None,
    workers: int = 1,
    split_list: Path | None = None,
    choice: Choice | None = None,
) -> None:
    """Builds the cache and prints what was kept, cut and dropped, by name and reason.

    ``split_list`` also gets the names of the test files, one a line.
    """
    source, choice = source or JointSource(), choice or Choice()
    if isinstance(source, RetargetSource):
        workers = 1  # it holds figures, which do not go to other processes
    loaded = load_all(files_of(folder, source, choice.include), source, workers, "prepare")
    drop_odd_skeletons(loaded)
    kept = [one for one in loaded if one.dropped is None]
    clips = [clip for one in kept for clip in one.clips]
    offsets = np.median([one.offsets for one in kept], axis=0)
    notes = {one.file: one.notes for one in kept if one.notes}
    table = understood(one.report for one in kept if one.report is not None)
    try:
        skeleton = source.skeleton(kept[0].names, kept[0].parents, offsets, clips)
        if choice.mirror:
            trained = [c for c in clips if not choice.tests(c) and not choice.holds_out(c)]
            mirroring = mirror_of(skeleton, trained)
            notes |= {"mirror": mirroring.notes} if mirroring.notes else {}
            mirrored = (mirroring.clip(c) for c in trained)
            clips += [c for c in mirrored if not choice.holds_out(c)]
    except ValueError as error:
        raise SystemExit(f"{folder}, skeleton of {kept[0].file}: {error}") from error

    for clip, floor in zip(clips, floor_errors(clips, skeleton), strict=True):
        if abs(floor) > MAX_FLOOR_ERROR_M and not clip.mirrored:
            text = f"{clip.name}: its feet stand {floor:+.3f} m off the ground of the other clips"
            notes.setdefault(clip.file, []).append(text)
    dropped = {one.file: one.dropped for one in loaded if one.dropped is not None}
    tested = [choice.tests(c) for c in clips]
    about = {"source": str(folder.resolve()), "options": source.options() | asdict(choice), "understood": table}
    held_out = [choice.holds_out(c) for c in clips]
    carried = {one.file: one.carried for one in kept if one.carried is not None}
    about |= {"carried": carried} if carried else {}
    _write(cache, skeleton, clips, tested, held_out, about | {"dropped": dropped, "notes": notes})
    if split_list is not None:
        names = sorted({c.file for c, test in zip(clips, tested, strict=True) if test})
        split_list.write_text("".join(name + "\n" for name in names))
    if any(held_out):
        print(
            f"{sum(held_out)} clips are of held-out cells: neither trained on nor, but for the test clips among them, tested"
        )
    print(*printed(table), sep="\n")
    for file, figures in carried.items():
        print(carried_line(file, figures))
    _report(clips, sum(tested), dropped, notes)


def _report(clips: list[Clip], tested: int, dropped: dict[str, str], notes: dict[str, list[str]]) -> None:
    mirrored = sum(c.mirrored for c in clips)
    hours = sum(len(c.positions) for c in clips if not c.mirrored) / FPS / 3600
    print(
        f"{len(clips) - mirrored} clips, {hours:.2f} hours; {len(clips) - mirrored - tested} to train"
        f"{' and as many mirrored' if mirrored else ''}, {tested} to test; {len(dropped)} files dropped"
    )
    for name, reason in dropped.items():
        print(f"dropped {name}: {reason}")
    for name, texts in notes.items():
        for text in texts[:NOTES_SHOWN]:
            print(f"note {name}: {text}")
        if len(texts) > NOTES_SHOWN:
            print(f"note {name}: and {len(texts) - NOTES_SHOWN} more, all in clips.json")


def _write(
    cache: Path, skeleton: Skeleton, clips: list[Clip], tested: list[bool], held_out: list[bool], about: dict[str, Any]
) -> None:
    cache.mkdir(parents=True, exist_ok=True)
    skeleton.save(cache / "skeleton.json")
    left = np.array(skeleton.left_axis)
    turned = np.concatenate([headings(c.six_d, left) for c in clips])
    np.save(cache / "positions.npy", np.concatenate([c.positions for c in clips]))
    np.save(cache / "six_d.npy", np.concatenate([c.six_d for c in clips]))
    np.save(cache / "headings.npy", turned.astype(np.float32))
    np.save(cache / "contacts.npy", np.concatenate([detect_contacts(c.positions, skeleton) for c in clips]))
    start, index = 0, []
    for clip, test, held in zip(clips, tested, held_out, strict=True):
        frames = len(clip.positions)
        entry: ClipEntry = {"name": clip.name, "start": start, "frames": frames, "test": test}
        if clip.name != clip.file:
            entry |= {"file": clip.file, "first_frame": clip.first_frame, "mirrored": clip.mirrored}
        if held:
            entry["held_out"] = True
        index.append(entry)
        start += frames
    (cache / "clips.json").write_text(json.dumps(about | {"clips": index}, indent=1))
