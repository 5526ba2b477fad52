"""Clips of other skeletons brought onto one, for ``prepare --retarget``.

Clips of one skeleton share a figure, which all their motion shows: one clip may not show how the feet stand.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import troupe_reader
from troupe_reader import Figure
from troupe_training.data.clips import Clip, ClipError, FileMotion, MotionSource
from troupe_training.data.conventions import FPS
from troupe_training.data.joint_source import JointSource
from troupe_training.data.reader import file_motion
from troupe_training.data.skeleton import Skeleton

SAME_BONES_M = 1e-3  # most that the bones of one skeleton differ between files
FIGURE_FRAMES = 9000  # most that a figure is found by, spread evenly over the clips of its skeleton
STANDING_PERCENTILE = 5.0  # of the heights of the lowest joint of the feet: it stands there
# Height of toes over the ground, and of ankles of feet without toes, by the length of the legs. The
# figure of a skeleton takes up what is off, because it is measured on the same clips.
TOE_SHARE, ANKLE_SHARE = 0.03, 0.09
PACK_FILE = "pack.toml"
ROBOTS_OWN = (".csv", ".npy")  # endings of files that hold a robot's angles and nothing else


@dataclass
class Group:
    """The clips of one skeleton, at 30 fps."""

    skeleton: troupe_reader.Skeleton
    first: str  # name of its first file
    clips: list[troupe_reader.Clip] = field(default_factory=list)
    figure: Figure | None = None
    refused: str = ""  # why it has no figure
    feet: list[list[int]] = field(default_factory=list)  # ankle and toe, or ankle alone, of each leg
    standing_y_m: float = 0.0  # height of the lowest joint of the feet where they stand

    @property
    def name(self) -> str:
        """What a report calls the skeleton."""
        return f"{len(self.skeleton)} joints, as in {self.first}"


class RobotReader(MotionSource, Protocol):
    """Reads a robot's own files."""

    @property
    def joints(self) -> troupe_reader.Skeleton:
        """The robot's joints and hinges as its description has them."""


class RetargetSource:
    """Reads files of any skeleton onto one. Files that have it already are as `JointSource` reads them, bit for bit.

    ``to`` is the name of a file in the folder, or the path of a file of motion, of a character or of a ``pack.toml``; with
    a ``robot`` it is that robot, whose own files are read too. Clips beyond the retargeter's bar are refused unless ``force``
    is set. ``fit_ground`` puts each clip on the ground, as far as its feet stand. What was carried over is also written as
    BVH into the folder ``carried``.
    """

    def __init__(
        self,
        inner: JointSource,
        to: str,
        force: bool = False,
        fit_ground: bool = False,
        robot: RobotReader | None = None,
        carried: Path | None = None,
    ):
        self.endings = (*inner.endings, *(ROBOTS_OWN if robot else ()))
        self._inner, self._to, self._force, self._fit_ground = inner, to, force, fit_ground
        self._robot, self._carried = robot, carried
        self._groups: list[Group] = []
        self._target: Figure | None = None
        self._own: Group | None = None  # clips that have the target's skeleton

    def options(self) -> dict[str, Any]:
        """Options that the result depends on besides the files. Caches with others are made again."""
        own = {"retarget": self._to, "force": self._force, "fit_ground": self._fit_ground}
        robot = self._robot.options() if self._robot else {}
        return self._inner.options() | robot | own

    def survey(self, files: Sequence[Path]) -> None:
        """Reads all files and finds their skeletons and figures. Raises `ValueError` if the target has none."""
        files = [path for path in files if not self._is_robots(path)]
        self._inner.survey(files)
        if self._carried is not None:
            self._carried.mkdir(parents=True, exist_ok=True)
        for path in files:
            self._add(path)
        to = next((path for path in files if self._to in (path.name, path.stem)), Path(self._to))
        skeleton = self._robot.joints if self._robot else _skeleton_of(to, self._inner)
        self._own = next((group for group in self._groups if _same(group.skeleton, skeleton)), None)
        for group in self._groups:
            _find_figure(group, self._fit_ground and group is not self._own)
            group.clips.clear()
        if self._own and self._own.figure:
            self._target = self._own.figure
        else:
            self._target = _figure_of(skeleton if self._robot or to.name == PACK_FILE else to, to)

    def load(self, path: Path, animation: str | None = None) -> FileMotion:
        """Reads one file, or one of its animations, onto the skeleton. Raises `ValueError` with the joint and the reason."""
        if self._robot and self._is_robots(path):
            return self._robot.load(path)
        if self._target is None:
            raise ClipError("the files were not surveyed")
        clip = self._inner.read(path, animation)
        if _same(clip.skeleton, self._target.skeleton):
            return file_motion(clip)
        report = clip.report
        clip = _at_rate(clip)
        group = next((one for one in self._groups if _same(one.skeleton, clip.skeleton)), None)
        if group is None or group.figure is None:
            raise ClipError(group.refused if group else "its skeleton was not found in the survey")
        lift_m = 0.0
        if self._fit_ground:
            lift_m = group.standing_y_m - _standing_y_m(clip, group.feet)
            clip = _lifted(clip, lift_m)
        made, figures = clip.retarget(self._target, body=group.figure)
        if self._fit_ground and self._own is not None:
            made = _lifted(made, self._own.standing_y_m - _standing_y_m(made, self._own.feet))
        if figures["faults"] and not self._force:
            raise ClipError(f"beyond the bar: {'; '.join(figures['faults'])}; --force takes it all the same")
        if self._carried is not None:
            name = path.stem if animation is None else f"{path.stem}_{animation}"
            made.write(self._carried / f"{name}.bvh")
        motion = file_motion(made)
        motion.report = report
        motion.carried = {"skeleton": group.name, "lift_m": round(lift_m, 4), **figures}
        return motion

    def skeleton(self, names: list[str], parents: list[int], offsets: np.ndarray, clips: list[Clip]) -> Skeleton:
        """The target's skeleton; a robot's has hinges."""
        return (self._robot or self._inner).skeleton(names, parents, offsets, clips)

    def _is_robots(self, path: Path) -> bool:
        return self._robot is not None and path.suffix.lower() in ROBOTS_OWN

    def _add(self, path: Path) -> None:
        """Adds a file's clips to the groups. What cannot be read is refused when it is loaded."""
        try:
            names = troupe_reader.animations(path, name=path.name)
            clips = [self._inner.read(path, name) for name in (names if len(names) > 1 else [None])]
        except (ValueError, OSError):
            return
        for clip in map(_at_rate, clips):
            group = next((one for one in self._groups if _same(one.skeleton, clip.skeleton)), None)
            if group is None:
                group = Group(clip.skeleton, path.name)
                self._groups.append(group)
            group.clips.append(clip)


def carried_line(file: str, carried: dict[str, Any]) -> str:
    """What a report says of a clip that was carried over."""
    lift = f", lifted by {100 * carried['lift_m']:+.0f} cm" if carried["lift_m"] else ""
    beyond = "".join(f"; beyond the bar: {fault}" for fault in carried["faults"])
    bone = carried["joints"]["bone"]
    return (
        f"carried over {file} ({carried['skeleton']}{lift}): bones off by {carried['directions_deg']:.1f}° (worst "
        f"{carried['worst_deg']:.1f}°{f' at {bone}' if bone else ''}), standing feet slide {100 * carried['skate_mps']:.1f} cm/s "
        f"(in the clip, scaled: {100 * carried['source_skate_mps']:.1f}), feet {100 * carried['under_m']:.1f} cm under the "
        f"ground and {100 * carried['short_m']:.1f} cm short{beyond}"
    )


def _figure_of(target: troupe_reader.Skeleton | Path, to: Path) -> Figure:
    """The target's figure. A pack has no rest pose: its skeleton stands with all rotations at zero, or is refused."""
    try:
        return Figure(target)
    except ValueError as error:
        if to.name != PACK_FILE:
            raise
        way = "name a file of motion of the same skeleton instead, whose poses show how it stands"
        raise ClipError(f"--retarget {to}: {error}; {way}") from error


def _find_figure(group: Group, fit_ground: bool) -> None:
    """Finds a group's figure by all its motion, with the clips on one ground if that is wanted."""
    try:
        body = Figure(group.clips[0])
        names = group.skeleton.names
        legs = (body.parts["left_leg"], body.parts["right_leg"])
        group.feet = [[names.index(leg[end]) for end in ("end", "toe") if end in leg] for leg in legs]
        clips = group.clips
        heights = [_standing_y_m(clip, group.feet) for clip in clips]
        group.standing_y_m = float(np.median(heights))
        if fit_ground:
            has_toes = len(group.feet[0]) > 1
            group.standing_y_m = (TOE_SHARE if has_toes else ANKLE_SHARE) * body.leg_m
            clips = [_lifted(clip, group.standing_y_m - height) for clip, height in zip(clips, heights, strict=True)]
        group.figure = Figure(_joined(clips))
    except ValueError as error:
        group.refused = str(error)


def _joined(clips: list[troupe_reader.Clip]) -> troupe_reader.Clip:
    """Frames of all clips, at most `FIGURE_FRAMES`, as one clip."""
    roots = np.concatenate([clip.root_positions for clip in clips])
    rotations = np.concatenate([clip.rotations for clip in clips])
    step = 1 + len(roots) // FIGURE_FRAMES
    return troupe_reader.Clip(clips[0].skeleton, FPS, roots[::step], rotations[::step])


def _lifted(clip: troupe_reader.Clip, lift_m: float) -> troupe_reader.Clip:
    lift = np.array([0.0, lift_m, 0.0])
    return troupe_reader.Clip(clip.skeleton, clip.fps, clip.root_positions + lift, clip.rotations)


def _standing_y_m(clip: troupe_reader.Clip, feet: list[list[int]]) -> float:
    """Height of the lowest joint of the feet where they stand, metres."""
    heights = clip.world()[0][:, [joint for foot in feet for joint in foot], 1].min(1)
    return float(np.percentile(heights, STANDING_PERCENTILE))


def _at_rate(clip: troupe_reader.Clip) -> troupe_reader.Clip:
    return clip if clip.fps == FPS else clip.resample(FPS)


def _same(one: troupe_reader.Skeleton, other: troupe_reader.Skeleton) -> bool:
    """Whether two skeletons have the same joints and bones."""
    if one.names != other.names or one.parents != other.parents:
        return False
    return bool(np.abs(one.offsets - other.offsets)[1:].max(initial=0.0) <= SAME_BONES_M)


def _skeleton_of(to: Path, inner: JointSource) -> troupe_reader.Skeleton:
    """The skeleton of a pack, or of a file of motion or of a character."""
    if to.name == PACK_FILE:
        tables = tomllib.loads(to.read_text(encoding="utf-8"))
        if "robot" in tables:
            raise ClipError(f"{to} is of a robot: --retarget needs its URDF or MJCF")
        return troupe_reader.Skeleton.of_tables(tables["skeleton"])
    try:
        return inner.read(to).skeleton
    except ValueError:  # several animations, or none
        return Figure(to).skeleton
