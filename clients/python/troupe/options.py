"""How a session is set up, and how its frames are taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy.typing as npt

from troupe.arrays import floats
from troupe.conventions import Convention
from troupe.keyframe import Keyframe
from troupe.pack import Pack
from troupe.v1 import session_pb2


class Encoding(IntEnum):
    """How frames come over the wire."""

    F32 = 0
    """32-bit floats: exactly what the server has."""
    COMPACT = 1
    """Under half the bytes; root to 0.1 mm and rotations to 0.01 degrees (`troupe.codec` has the bounds)."""
    QPOS = 2
    """MuJoCo's `qpos`: a quarter of the bytes, for packs with a robot."""


@dataclass(frozen=True)
class FrameOptions:
    """How frames are taken."""

    rate: int = 30
    """Frames a second: 30, 50 or 60."""
    encoding: Encoding = Encoding.F32
    positions: bool = False
    """Whether world joint positions come with them."""


@dataclass(frozen=True, eq=False)
class SessionOptions:
    """Options of a new character: by default it stands at the origin in the pack's default style, seed 0."""

    id: str = ""
    """Unique on the server: 1 to 64 letters, digits, `-`, `_` or `.`. Empty: the server makes one."""
    style: str = ""
    """Style to start with. Empty: the pack's default."""
    seed: int = 0
    """The same seed, commands and steps give the same frames."""
    position: npt.ArrayLike | None = None
    """(3) where it stands at first, in its convention; the height is the pack's."""
    heading: float = 0.0
    """Where it faces at first, radians."""
    context: Sequence[Keyframe] = ()
    """How it stood before: four consecutive frames. Excludes position and heading."""
    scene: str = ""
    """The scene that it lives in."""
    convention: Convention = Convention.NATIVE
    """Axes, handedness and unit of everything that it takes and gives."""
    ttl: float | None = None
    """Seconds without a command, step or stream after which it expires: 1 s to a day, a minute by default."""
    look_ahead_frames: int | None = None
    """Frames between the cursor and the point where a new plan takes over: 2 to 12, 4 by default."""
    replan_interval_frames: int | None = None
    """Frames between plans, 3 to 30. The style's by default."""
    root_ratio: float | None = None
    """How closely the root follows the commanded path: 0 leaves it to the networks, at most 1.2."""
    temperature: float = 0.0
    """Above 0, poses are sampled. At most 2."""
    priority: float | None = None
    """How much it matters that it is planned for often: 0 is far from the camera, 1 the hero, 0.5 the default."""
    record: bool = False
    """Whether the server records the session, so that it can be played again: `Client.recording`. The key must allow it."""

    def to_message(self, pack: Pack) -> session_pb2.SessionOptions:
        """The options on the wire."""
        message = session_pb2.SessionOptions(
            id=self.id,
            pack=pack.name,
            body=pack.body,
            skeleton=pack.worn,
            style=self.style,
            seed=self.seed,
            convention=int(self.convention),  # type: ignore[arg-type]
            heading=self.heading,
            context=[key.to_message(f"context[{nth}]") for nth, key in enumerate(self.context)],
            ttl_ms=None if self.ttl is None else round(self.ttl * 1000),
            look_ahead_frames=self.look_ahead_frames,
            replan_interval_frames=self.replan_interval_frames,
            root_ratio=self.root_ratio,
            temperature=self.temperature,
            priority=self.priority,
            scene=self.scene,
            record=self.record,
        )
        if self.position is not None:
            x, y, z = floats("position", self.position, (3,)).tolist()
            message.position.x, message.position.y, message.position.z = x, y, z
        return message
