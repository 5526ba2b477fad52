"""The four programs that read motion: the command line, training, the Python client and the viewer."""

import io
import json
import os
import re
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

import formats
import troupe_reader
from inputs import ROOT, WALK, Kind, amass
from motion import Array, Motion
from robots import humanoid
from troupe_reader.options import FileOptions
from troupe_training.cli.options import READING
from troupe_training.data.clips import FileMotion, MotionSource
from troupe_training.data.conventions import FPS
from troupe_training.data.corpus import RIG_ENDINGS
from troupe_training.data.gltf import read_rig
from troupe_training.data.joint_source import JointSource
from troupe_training.data.prepare import Choice, prepare
from troupe_training.data.rotations import columns_to_matrix, matrix_to_quat
from troupe_training.data.skeleton import Skeleton
from troupe_training.robots.source import RobotSource

# Files that the client reads without the reader.
OWN_READERS = (".bvh", ".csv", ".npz")
# Options of the reader as the command line has them.
FLAGS = {"fps": "--fps", "max_slide": "--max-slide", "other_bones": "--other-bones", "quaternion": "--quaternion"}
CLIENT = ROOT / "target" / "python-client" / "bin" / "python"


@dataclass
class Answer:
    """What a program makes of a file: a motion in world terms, or an error."""

    names: list[str] = field(default_factory=list)
    fps: float = 0.0
    places: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))
    turns: Array = field(default_factory=lambda: np.zeros((0, 0, 4)))
    offsets: Array = field(default_factory=lambda: np.zeros((0, 3)))
    error: str | None = None
    notes: str = ""
    asks: list[str] = field(default_factory=list)  # options that decide, as the viewer shows them beside an error
    crashed: bool = False
    not_taken: bool = False


@dataclass
class Job:
    """A kind's file on the disk, and how it is to be read."""

    kind: Kind
    path: Path
    urdf: Path | None
    with_options: bool = False

    def options(self) -> dict[str, Any]:
        """Of the reader."""
        return self.kind.options if self.with_options else {}

    def legs(self) -> list[str]:
        """Of the robot."""
        return self.kind.legs if self.with_options else []

    def tables(self, needed: bool) -> dict[str, Any] | None:
        """The skeleton to read onto as tables of a pack. `needed`: also if the kind needs none."""
        if self.urdf is not None:
            # A page and a client have those of a pack, so legs are found before.
            skeleton = troupe_reader.read_robot(self.urdf, legs=self.kind.legs).skeleton
            return {"skeleton": skeleton.table, "robot": skeleton.robot}
        motion = self.kind.onto or ((self.kind.rig or self.kind.truth) if needed else None)
        if motion is None:
            return None
        skeleton = troupe_reader.Skeleton(motion.names, motion.parents, motion.offsets)
        return {"skeleton": skeleton.table, "robot": None}


def jobs_of(kinds: list[Kind], folder: Path) -> list[Job]:
    """Writes the kinds' files."""
    jobs = []
    for nth, kind in enumerate(kinds):
        (at := folder / str(nth)).mkdir()
        if not kind.truth.offsets.any():
            # AMASS: bones of the mean body, which the reader has. The pelvis is each file's own.
            found = troupe_reader.read(amass(156, "fps")[0], name="amass.npz").skeleton
            places = dict(zip(found.names, found.offsets.astype(np.float64), strict=True))
            offsets = np.array([places[name] for name in kind.truth.names])
            kind = replace(kind, truth=replace(kind.truth, offsets=offsets))
        for name, data in {kind.file: kind.data, **kind.beside}.items():
            (at / name).write_bytes(data)
        if kind.robot is not None:
            (folder / f"{nth}.urdf").write_text(kind.robot.urdf())
        jobs.append(Job(kind, at / kind.file, folder / f"{nth}.urdf" if kind.robot else None))
    return jobs


def command_line(program: Path, jobs: list[Job]) -> list[Answer]:
    """`troupe clip convert`, and what it wrote."""

    def one(job: Job) -> Answer:
        # Beside the folder, because training reads all files in it.
        out = job.path.parent.with_suffix(".out.npz")
        words = [str(program), "clip", "convert", str(job.path), str(out)]
        for key, value in job.options().items():
            words += [FLAGS[key]] + ([] if value is True else [str(value)])
        if job.urdf is not None:
            words += ["--urdf", str(job.urdf)] + (["--legs", ",".join(job.legs())] if job.legs() else [])
        elif job.kind.onto is not None:
            words += ["--pack-folder", str(ROOT / "models" / "human")]
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode:
            return Answer(error=done.stderr.strip(), crashed=done.returncode not in (1, 2))
        return replace(of_arrays(out), notes=done.stderr)

    return [one(job) for job in jobs]


def of_arrays(path: Path) -> Answer:
    """What Troupe's npz holds."""
    arrays = np.load(path)
    numbers = [arrays[name].astype(np.float64) for name in ("offsets", "root", "quaternions")]
    names, parents, fps = arrays["joint_names"].tolist(), arrays["parents"].tolist(), float(arrays["fps"])
    return of_motion(Motion(names, parents, numbers[0], fps, numbers[1], numbers[2]))


def round_trips(program: Path, folder: Path) -> dict[str, tuple[Motion, Answer]]:
    """What is read back of each format that the command line writes, with what was written."""
    robot = humanoid()
    (folder / "robot.urdf").write_text(robot.urdf())
    (folder / "walk.bvh").write_text(formats.bvh(WALK))
    clips = {}
    for fps in (30, 50):
        clips[fps], rows = robot.walk(0.85, 100, fps)
        (folder / f"robot{fps}.csv").write_bytes(formats.csv(rows))
    on = ["--urdf", str(folder / "robot.urdf")]

    def trip(truth: Motion, start: str, file: str, back: str = "", *options: str, of: tuple[str, ...] = ()) -> Answer:
        written, read = folder / "written" / file, folder / "read.npz"
        written.parent.mkdir(exist_ok=True)
        convert = [str(program), "clip", "convert"]
        subprocess.run([*convert, str(folder / start), str(written), *of, *options], check=True, capture_output=True)
        subprocess.run(
            [*convert, str(written / back if back else written), str(read), *options], check=True, capture_output=True
        )
        return of_arrays(read)

    trips = {file: (WALK, trip(WALK, "walk.bvh", file)) for file in ("clip.bvh", "clip.glb", "clip.npz")}
    for file in ("robot.csv", "robot.npy"):
        trips[file] = clips[30], trip(clips[30], "robot30.csv", file, "", *on)
    beyond = trip(clips[50], "robot50.csv", "tracker.npz", "", *on, "--fps", "50", of=("--layout", "beyondmimic"))
    sonic = trip(clips[50], "robot50.csv", "sonic", "joint_pos.csv", *on, "--fps", "50", of=("--layout", "sonic"))
    return trips | {"--layout beyondmimic": (clips[50], beyond), "--layout sonic": (clips[50], sonic)}


def of_motion(motion: Motion) -> Answer:
    """A motion as an answer."""
    places, turns = motion.world()
    return Answer(motion.names, motion.fps, places, turns, motion.offsets)


def training(jobs: list[Job]) -> list[Answer]:
    """`prepare`: what it writes for training."""
    return [_tried(_prepared, job) for job in jobs]


def rigs(jobs: list[Job]) -> list[Answer]:
    """`unimogen prepare`: glTF files, whose animations it brings onto one skeleton. It reads others as `prepare` does."""
    return [_tried(_rig, job) for job in jobs]


def _tried(read: Callable[[Job], Answer], job: Job) -> Answer:
    if job.kind.onto is not None:
        return Answer(not_taken=True)
    try:
        return read(job)
    except (ValueError, SystemExit) as error:
        return Answer(error=str(error))
    except Exception as error:
        return Answer(error=f"{type(error).__name__}: {error}", crashed=True)


def _given(job: Job) -> FileOptions:
    """Options that training's commands have."""
    return cast(FileOptions, {key: value for key, value in job.options().items() if key in READING})


def _prepared(job: Job) -> Answer:
    given = _given(job)
    source: MotionSource = JointSource(given=given)
    if job.urdf is not None:
        source = RobotSource(job.urdf, fps=given.get("fps"), given=given, legs=job.legs())
    with tempfile.TemporaryDirectory() as folder:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            prepare(job.path.parent, Path(folder), source, choice=Choice(test_name="none", mirror=job.kind.mirror))
        positions, six_d = (np.load(Path(folder) / f"{name}.npy").astype(np.float64) for name in ("positions", "six_d"))
        about = json.loads((Path(folder) / "clips.json").read_text())
        skeleton = Skeleton(**json.loads((Path(folder) / "skeleton.json").read_text()))
    if job.kind.mirror:
        half = len(positions) // 2
        off = _off_mirror(skeleton.names, positions[:half], positions[half:])
        if off > 5e-4:
            return Answer(error=f"the mirror image is {1e3 * off:.1f} mm off", crashed=True)
        positions, six_d = positions[:half], six_d[:half]
    turns = matrix_to_quat(torch.from_numpy(columns_to_matrix(six_d))).numpy()
    evidence = [row[2] for row in about["understood"]]
    notes = "\n".join([*evidence, *(text for texts in about["notes"].values() for text in texts)])
    return Answer(skeleton.names, FPS, positions, turns, np.array(skeleton.offsets), notes=notes)


def _off_mirror(names: list[str], positions: Array, mirrored: Array) -> float:
    """How far the mirrored clip is from the clip's mirror image, metres."""
    swapped = [
        names.index(re.sub("left|right", lambda side: {"left": "right", "right": "left"}[side[0]], n)) for n in names
    ]
    # A hinge may stand anywhere along its own axis: the head alone does, in the image too.
    kept = [nth for nth, name in enumerate(names) if not name.startswith("head")]
    off = np.linalg.norm(positions[:, swapped] * [-1, 1, 1] - mirrored, axis=-1)
    return float(off[:, kept].max())


def _rig(job: Job) -> Answer:
    if job.path.suffix not in RIG_ENDINGS:
        return Answer(not_taken=True)
    (motion,) = read_rig(job.path, _given(job)).clips.values()
    return _of_file(motion)


def _of_file(motion: FileMotion) -> Answer:
    turns = matrix_to_quat(torch.from_numpy(motion.rotations)).numpy()
    return Answer(motion.names, FPS, motion.positions, turns, motion.offsets, notes="\n".join(motion.notes))


def client(jobs: list[Job], extension: bool) -> list[Answer]:
    """`Clip.read` of the package troupe with the reader, or its own `Clip.from_…`."""
    taken = [job for job in jobs if extension or job.path.suffix in OWN_READERS]
    sent = [
        {"path": str(job.path), "tables": job.tables(False), "options": job.options(), "extension": extension}
        for job in taken
    ]
    script = Path(__file__).with_name("client.py")
    # A reader that stands in the path of this program is the client's, too.
    path = [str(ROOT / "clients" / "python"), os.environ.get("PYTHONPATH", "")]
    variables = {"PYTHONPATH": os.pathsep.join(filter(None, path))}
    return _in_place(jobs, taken, _asked([str(CLIENT), str(script)], sent, variables))


def viewer(jobs: list[Job]) -> list[Answer]:
    """The reader of the web page, onto a rig with the kind's skeleton."""
    sent = [
        {
            "path": str(job.path), "tables": job.tables(True), "given": job.options(),
            "fps": 30 if job.urdf else job.kind.truth.fps,
        }
        for job in jobs
    ]  # fmt: skip
    return _asked(["node", str(Path(__file__).with_name("viewer.mjs"))], sent, {})


def _in_place(jobs: list[Job], taken: list[Job], answers: list[Answer]) -> list[Answer]:
    """An answer for each job."""
    found = dict(zip([str(job.path) for job in taken], answers, strict=True))
    return [found.get(str(job.path), Answer(not_taken=True)) for job in jobs]


def _asked(command: list[str], sent: list[dict[str, Any]], variables: dict[str, str]) -> list[Answer]:
    done = subprocess.run(
        command, input=json.dumps(sent), stdout=subprocess.PIPE, text=True, env=os.environ | variables
    )
    done.check_returncode()
    return [_answer(found) for found in json.loads(done.stdout)]


def _answer(found: dict[str, Any]) -> Answer:
    if "error" in found or "crash" in found:
        error = found.get("error") or found["crash"]
        return Answer(error=error, asks=found.get("asks", []), crashed="crash" in found)
    arrays = [np.array(found[key], np.float64) for key in ("offsets", "roots", "turns")]
    motion = Motion(found["names"], found["parents"], arrays[0], found["fps"], arrays[1], arrays[2])
    return replace(of_motion(motion), notes="\n".join(found.get("notes", [])))
