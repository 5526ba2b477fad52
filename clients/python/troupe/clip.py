"""A clip: the motion of one character."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from troupe import arrays, notebook
from troupe.arrays import F32
from troupe.errors import InvalidArgumentError
from troupe.formats import bvh, csv, glb, npz, reader
from troupe.keyframe import Keyframe
from troupe.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Clip:
    """Consecutive frames of one character, in native axes (X left, Y up, Z forward) and metres."""

    skeleton: Skeleton = field(repr=False)
    fps: float
    root: F32 = field(repr=False)
    """(frames, 3) world positions of the root joint."""
    rotations: F32 = field(repr=False)
    """(frames, joints, 4) w x y z: the first joint's in the world, others relative to their parents."""
    contacts: F32 | None = field(default=None, repr=False)
    """(frames, contact joints) probability that each of `skeleton.contact_joints` is on the ground."""
    info: dict[str, Any] | None = field(default=None, repr=False)
    """What was understood of the file, if `read` made the clip: as `troupe clip info --json` prints it."""

    def __post_init__(self) -> None:
        """Refuses arrays that do not fit each other."""
        frames = len(self.rotations)
        arrays.floats("rotations", self.rotations, (None, self.skeleton.joint_count, 4))
        arrays.floats("root", self.root, (frames, 3))

    def __len__(self) -> int:
        return len(self.root)

    def __getitem__(self, frames: slice) -> Clip:
        contacts = None if self.contacts is None else self.contacts[frames]
        return replace(self, root=self.root[frames], rotations=self.rotations[frames], contacts=contacts)

    def world_positions(self) -> F32:
        """(frames, joints, 3) metres."""
        return self.skeleton.world(self.root, self.rotations)[0]

    def world_rotations(self) -> F32:
        """(frames, joints, 4)."""
        return self.skeleton.world(self.root, self.rotations)[1]

    def on(self, skeleton: Skeleton) -> Clip:
        """The same motion on a skeleton with the same joint names, in its order: for clips of files.

        Raises:
            InvalidArgumentError: The clip lacks joints, or its bones have other lengths.

        """
        missing = [name for name in skeleton.names if name not in self.skeleton.names]
        if missing:
            message = f"clip: lacks joints of the skeleton: {', '.join(missing)}"
            raise InvalidArgumentError(message, field="clip", allowed=", ".join(skeleton.names))
        order = [self.skeleton.names.index(name) for name in skeleton.names]
        parents = [self.skeleton.parents[joint] for joint in order]
        wanted = [order[parent] if parent >= 0 else -1 for parent in skeleton.parents]
        differing = [skeleton.names[n] for n, (a, b) in enumerate(zip(parents, wanted, strict=True)) if a != b]
        off = np.linalg.norm(self.skeleton.offsets[order][1:] - skeleton.offsets[1:], axis=1)
        differing += [skeleton.names[1 + int(joint)] for joint in np.flatnonzero(off > bvh.OFFSET_TOLERANCE_M)]
        if differing:
            message = f"clip: bones differ from the skeleton's: {', '.join(differing)}"
            raise InvalidArgumentError(message, field="clip")
        return replace(self, skeleton=skeleton, rotations=self.rotations[:, order], contacts=None)

    def keyframe(self, frame: int) -> Keyframe:
        """Root and pose of a frame."""
        return Keyframe(root=self.root[frame], rotations=self.rotations[frame])

    def keyframes(self) -> list[Keyframe]:
        """Root and pose of every frame."""
        return [self.keyframe(frame) for frame in range(len(self))]

    @staticmethod
    def read(path: str | Path, skeleton: Skeleton | None = None, **options: Any) -> Clip:
        """Reads a file of any format that Troupe knows, onto `skeleton` if one is given. Robots' files need one.

        `options` have the names of those of `troupe clip`: up="z", unit="cm", fps=60, quaternion="wxyz", and so on.

        Raises:
            FailedPreconditionError: The package troupe-reader (`pip install ./bindings/python`) is not installed.
            InvalidArgumentError: The file cannot be read; the message names the place and the option that decides.

        """
        found, fps, root, rotations, info = reader.read(path, skeleton, options)
        return Clip(found, fps, root, rotations, info=info)

    def to_bvh(self, path: str | Path | None = None, *, units_per_metre: float = 100) -> str:
        """The clip as BVH text (Z X Y rotations, centimetres unless said otherwise); also written to `path`."""
        text = bvh.write(self.skeleton, self.fps, self.root, self.rotations, units_per_metre)
        if path is not None:
            Path(path).write_text(text)
        return text

    @staticmethod
    def from_bvh(path: str | Path, *, units_per_metre: float | None = None, up: Literal["y"] | None = None) -> Clip:
        """Reads a BVH file as Troupe writes it: Y up, centimetres, only the root moves. `on` brings it onto a pack's skeleton.

        A person who stands along another axis, or whose height speaks for another unit, is refused. `up` and `units_per_metre`
        say that the file is meant so. A rig whose feet or head are not clear needs both. `read` finds both.

        Raises:
            InvalidArgumentError: The file is of another kind, or wrong; the message has the line.

        """
        path = Path(path)
        return Clip(*bvh.read(path.read_bytes(), path.name, units_per_metre, up))

    def to_glb(self, path: str | Path | None = None) -> bytes:
        """The clip as binary glTF: a node a joint, a plain mesh a bone, one animation; also written to `path`."""
        data = glb.write(self.skeleton, self.fps, self.root[:, None], self.rotations[:, None])
        if path is not None:
            Path(path).write_bytes(data)
        return data

    def to_npz(self, path: str | Path) -> None:
        """Writes named arrays: `troupe.formats.npz` lists them."""
        npz.write(path, self.skeleton, self.fps, self.root, self.rotations, self.contacts)

    @staticmethod
    def from_npz(path: str | Path) -> Clip:
        """Reads what `to_npz` wrote."""
        return Clip(*npz.read(path))

    def to_qpos(self) -> F32:
        """(frames, qpos_size) MuJoCo's `qpos`, on the robot's hinges and within their limits.

        Raises:
            InvalidArgumentError: The skeleton is no robot's.

        """
        csv.check_robot(self.skeleton)
        return self.skeleton.to_qpos(self.root, self.rotations)

    def to_csv(self, path: str | Path | None = None) -> str:
        """A robot's clip as Unitree's CSV: x y z qx qy qz qw and the hinges' angles a row; also written to `path`."""
        text = csv.write(self.skeleton, self.root, self.rotations)
        if path is not None:
            Path(path).write_text(text)
        return text

    @staticmethod
    def from_csv(path: str | Path, skeleton: Skeleton, fps: float = 30) -> Clip:
        """Reads Unitree's CSV of a robot. The file knows no rate.

        Raises:
            InvalidArgumentError: The file is of another kind, such as with quaternions w x y z, degrees or another robot's.

        """
        path = Path(path)
        return Clip(skeleton, fps, *csv.read(path.read_bytes(), path.name, skeleton))

    def to_html(self, title: str = "") -> str:
        """A page that plays the clip, without any other file."""
        return notebook.page(self.world_positions()[:, None], self.skeleton.parents, self.fps, 1, title)

    def _repr_html_(self) -> str:
        return notebook.frame(self.to_html())


def joined(clips: Sequence[Clip]) -> Clip:
    """Clips of one skeleton and rate, one after the other."""
    if not clips:
        raise InvalidArgumentError("clips: there are none", field="clips", allowed="one or more")
    first = clips[0]
    if any(clip.skeleton.names != first.skeleton.names or clip.fps != first.fps for clip in clips):
        raise InvalidArgumentError("clips: they differ in skeleton or rate", field="clips")
    contacts: list[npt.NDArray[np.float32]] = [clip.contacts for clip in clips if clip.contacts is not None]
    return replace(
        first,
        root=np.concatenate([clip.root for clip in clips]),
        rotations=np.concatenate([clip.rotations for clip in clips]),
        contacts=np.concatenate(contacts) if len(contacts) == len(clips) else None,
    )
