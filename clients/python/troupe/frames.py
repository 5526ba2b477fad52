"""Frames of many characters as they come: views of the answer, or one decode of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from troupe import codec, notebook
from troupe.arrays import F32, Bools, Ints
from troupe.clip import Clip
from troupe.conventions import Convention
from troupe.errors import AnswerError, InvalidArgumentError
from troupe.formats import csv, glb, npz
from troupe.skeleton import ROOT_QPOS, Skeleton
from troupe.v1 import session_pb2

_HINGES = ("hinge_residuals", "clamped_hinges", "hinge_speed_ratios", "fastest_hinges", "hinge_accelerations")
_COLUMNS = ("root", "rotations", "contacts", "positions", "qpos", *_HINGES)


@dataclass(frozen=True, eq=False)
class Frames:
    """Consecutive frames of characters of one skeleton, in their sessions' convention.

    The arrays' axes are frames, characters, and then what is said below.
    """

    skeleton: Skeleton = field(repr=False)
    fps: float
    convention: Convention
    ids: tuple[str, ...]
    """Names of the characters' sessions."""
    root: F32 = field(repr=False)
    """(frames, characters, 3) world positions of the root joint."""
    rotations: F32 = field(repr=False)
    """(frames, characters, joints, 4) w x y z: the first joint's in the world, others relative to their parents."""
    contacts: Bools = field(repr=False)
    """(frames, characters, contact joints) whether each of `skeleton.contact_joints` is on the ground."""
    first_frames: Ints = field(repr=False)
    """(characters) numbers of the first frames on the sessions' timelines, which count 30 a second."""
    positions: F32 | None = field(default=None, repr=False)
    """(frames, characters, joints, 3) world positions, if they were asked for."""
    qpos: F32 | None = field(default=None, repr=False)
    """(frames, characters, qpos_size) MuJoCo's `qpos`, in its own axes, if frames came so."""
    hinge_residuals: F32 | None = field(default=None, repr=False)
    """(frames, characters) how far a robot's hinges could not follow, radians, if frames came as `qpos`."""
    clamped_hinges: Ints | None = field(default=None, repr=False)
    """(frames, characters) hinges that were asked for more than their limits, if frames came as `qpos`."""
    hinge_speed_ratios: F32 | None = field(default=None, repr=False)
    """(frames, characters) speed of the fastest hinge since the frame before, divided by its highest speed, if frames
    came as `qpos`. Above 1 the hinge would have to be faster than it can."""
    fastest_hinges: Ints | None = field(default=None, repr=False)
    """(frames, characters) index of that hinge in `skeleton.robot.hinges`, if frames came as `qpos`."""
    hinge_accelerations: F32 | None = field(default=None, repr=False)
    """(frames, characters) largest acceleration of a hinge, rad/s², if frames came as `qpos`."""

    def __len__(self) -> int:
        return len(self.root)

    def world_positions(self) -> F32:
        """(frames, characters, joints, 3): those that came, else by forward kinematics."""
        if self.positions is not None:
            return self.positions
        return self.skeleton.world(self.root, self.rotations, self.convention)[0]

    def world_rotations(self) -> F32:
        """(frames, characters, joints, 4)."""
        return self.skeleton.world(self.root, self.rotations, self.convention)[1]

    def clip(self, character: int | str = 0) -> Clip:
        """The motion of one character, by its place or its session's name, in native axes."""
        nth = self.ids.index(character) if isinstance(character, str) else character
        return Clip(
            self.skeleton,
            self.fps,
            self.convention.position_to_native(self.root[:, nth]),
            self.convention.rotation_to_native(self.rotations[:, nth]),
            self.contacts[:, nth].astype(np.float32),
        )

    def clips(self) -> list[Clip]:
        """The motion of every character, in native axes."""
        return [self.clip(nth) for nth in range(len(self.ids))]

    def to_qpos(self) -> F32:
        """(frames, characters, qpos_size) MuJoCo's `qpos`: what came, else on the hinges and within their limits."""
        if self.qpos is not None:
            return self.qpos
        csv.check_robot(self.skeleton)
        of = self.convention
        return self.skeleton.to_qpos(of.position_to_native(self.root), of.rotation_to_native(self.rotations))

    def to_glb(self, path: str | Path | None = None) -> bytes:
        """All characters as one binary glTF; also written to `path`."""
        of = self.convention
        root, rotations = of.position_to_native(self.root), of.rotation_to_native(self.rotations)
        data = glb.write(self.skeleton, self.fps, root, rotations)
        if path is not None:
            Path(path).write_bytes(data)
        return data

    def to_npz(self, path: str | Path) -> None:
        """Writes named arrays with an axis for the characters behind that of the frames, in native axes."""
        of = self.convention
        root, rotations = of.position_to_native(self.root), of.rotation_to_native(self.rotations)
        npz.write(path, self.skeleton, self.fps, root, rotations, self.contacts.astype(np.float32))

    def to_html(self, title: str = "") -> str:
        """A page that plays all characters, without any other file."""
        positions = self.convention.position_to_native(self.world_positions())
        return notebook.page(positions, self.skeleton.parents, self.fps, len(self.ids), title)

    def _repr_html_(self) -> str:
        return notebook.frame(self.to_html())


def joined(parts: Sequence[Frames]) -> Frames:
    """Frames of the same characters, one after the other: such as those of many steps."""
    if not parts:
        raise InvalidArgumentError("frames: there are none", field="frames", allowed="one or more")
    first = parts[0]
    if any(part.ids != first.ids or part.fps != first.fps for part in parts):
        raise InvalidArgumentError("frames: they are of other characters, or of another rate", field="frames")
    return _concatenated(parts, 0, first.ids, first.first_frames)


def side_by_side(parts: Sequence[Frames]) -> Frames:
    """As many frames of different characters, together."""
    if len(parts) == 1:
        return parts[0]
    ids = tuple(name for part in parts for name in part.ids)
    return _concatenated(parts, 1, ids, np.concatenate([part.first_frames for part in parts]))


def _concatenated(parts: Sequence[Frames], axis: int, ids: tuple[str, ...], first_frames: Ints) -> Frames:
    columns: dict[str, Any] = {}
    for name in _COLUMNS:
        given = [getattr(part, name) for part in parts]
        columns[name] = None if any(column is None for column in given) else np.concatenate(given, axis)
    return replace(parts[0], ids=ids, first_frames=first_frames, **columns)


@dataclass(frozen=True)
class Of:
    """Whose frames a block has."""

    skeleton: Skeleton
    fps: float
    convention: Convention
    ids: tuple[str, ...]


def of_block(block: session_pb2.FrameBlock, of: Of) -> Frames:
    """Reads a block of frames of characters in one convention.

    Raises:
        AnswerError: A column has the wrong length.

    """
    shape = (len(block.slots), block.frame_count)
    skeleton = of.skeleton
    joints, contact_joints = skeleton.joint_count, len(skeleton.contact_joints)

    def column(name: str, values: np.ndarray, *more: int) -> np.ndarray:
        expected = int(np.prod((*shape, *more)))
        if values.size != expected:
            raise AnswerError(f"`{name}` has {values.size} numbers where {expected} belong", field=name)
        # The message has all frames of a character together.
        return values.reshape(*shape, *more).swapaxes(0, 1)

    if len(block.first_frames) != shape[0]:
        raise AnswerError("`first_frames` does not have a number for each character", field="first_frames")
    qpos = positions = None
    hinges: dict[str, Any] = {}
    if len(block.qpos):
        size = skeleton.robot.qpos_size if skeleton.robot else ROOT_QPOS
        qpos = column("qpos", np.asarray(block.qpos, np.float32), size)
        kinds = {"clamped_hinges": np.int64, "fastest_hinges": np.int64}
        for name in _HINGES:
            hinges[name] = column(name, np.asarray(getattr(block, name), kinds.get(name, np.float32)))
        native_root, native_rotations = skeleton.of_qpos(qpos)
        root = of.convention.position_from_native(native_root)
        rotations = of.convention.rotation_from_native(native_rotations)
    elif block.packed_roots:
        packed = block.packed_roots, block.packed_rotations
        if len(packed[0]) % codec.BYTES_PER_ROOT or len(packed[1]) % codec.BYTES_PER_ROTATION:
            raise AnswerError("packed frames end in the middle of a value", field="packed_roots")
        unit = np.float32(of.convention.units_per_metre)
        root = column("packed_roots", codec.decode_roots(packed[0]) * unit, 3)
        rotations = column("packed_rotations", codec.decode_rotations(packed[1]), joints, 4)
    else:
        root = column("root_positions", np.asarray(block.root_positions, np.float32), 3)
        rotations = column("rotations", np.asarray(block.rotations, np.float32), joints, 4)
    if len(block.positions):
        positions = column("positions", np.asarray(block.positions, np.float32), joints, 3)
    contacts = column("contacts", codec.decode_contacts(block.contacts, contact_joints), contact_joints)
    first_frames = np.asarray(block.first_frames, np.int64)
    return Frames(
        skeleton, of.fps, of.convention, of.ids, root, rotations, contacts, first_frames, positions, qpos, **hinges
    )


def chosen(frames: Frames, characters: Sequence[int]) -> Frames:
    """The frames of some characters, by their places."""
    places = list(characters)
    if places == list(range(len(frames.ids))):
        return frames
    columns: dict[str, Any] = {}
    for name in _COLUMNS:
        column = getattr(frames, name)
        columns[name] = None if column is None else column[:, places]
    ids = tuple(frames.ids[place] for place in places)
    return replace(frames, ids=ids, first_frames=frames.first_frames[places], **columns)


def of_mixed_block(
    block: session_pb2.FrameBlock, ids: Sequence[str | None], convention: Callable[[str], Convention], of: Of
) -> list[Frames]:
    """Reads a block whose characters may have different conventions; those without a name are passed over."""
    known = [(place, name) for place, name in enumerate(ids) if name is not None]
    names = tuple(name or "" for name in ids)
    groups: dict[Convention, list[int]] = {}
    for place, name in known:
        groups.setdefault(convention(name), []).append(place)
    return [chosen(of_block(block, replace(of, convention=key, ids=names)), places) for key, places in groups.items()]
