"""Live characters behind a router, driven by the Python client, and what a viewer of them would notice."""

import asyncio
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import troupe
import troupe.aio

SETTLE_FRAMES = 12
"""Frames after a break in which the motion fades over, and a few more."""
WALK_M_S = 1.2
TURN_S = 4.0
BREAK_S = 0.5
LONG_AGO = 1 << 30


@dataclass(frozen=True)
class Break:
    """A character that got no frame for a while."""

    session: str
    began: float
    """When its last frame came."""
    pause_s: float


class Track:
    """The characters of a stream, and their last frames."""

    def __init__(self, names: Sequence[str]):
        self.names = list(names)
        self.places = {name: place for place, name in enumerate(self.names)}
        self.frame = np.full(len(self.names), -1)
        self.came = np.zeros(len(self.names))
        # Frames since the last break.
        self.since = np.full(len(self.names), LONG_AGO)
        self.root: np.ndarray | None = None
        self.rotations: np.ndarray | None = None
        # The largest steps from frame to frame: metres of the root, radians of a joint.
        self.usual, self.seam = np.zeros(2), np.zeros(2)
        self.backwards = 0
        self.frames = 0
        self.breaks: list[Break] = []

    def take(self, ids: Sequence[str], frames: np.ndarray, root: np.ndarray, rotations: np.ndarray):
        """Takes a frame of some of them: numbers, (n, 3) roots and (n, joints, 4) rotations."""
        now = time.monotonic()
        at = np.array([self.places[name] for name in ids])
        if self.root is None:
            self.root = np.zeros((len(self.names), 3))
            self.rotations = np.zeros((len(self.names), *rotations.shape[1:]))
        frames = frames.astype(self.frame.dtype)
        before = self.frame[at]
        is_known = before >= 0
        self.break_off(at[is_known], now)
        self.backwards += int(np.sum(frames[is_known] < before[is_known]))
        steps = self.steps(at, root, rotations) / np.maximum(frames - before, 1)
        is_seam = self.since[at] <= SETTLE_FRAMES
        for of, where in ((self.usual, is_known & ~is_seam), (self.seam, is_known & is_seam)):
            if where.any():
                np.maximum(of, steps[:, where].max(axis=1), out=of)
        self.frame[at] = np.maximum(frames, before)
        self.came[at], self.root[at], self.rotations[at] = now, root, rotations
        self.frames += len(at)

    def break_off(self, at: np.ndarray, now: float):
        """Notes which of them have waited for long."""
        self.since[at] += 1
        pause_s = now - self.came[at]
        for place, pause in zip(at[pause_s > BREAK_S], pause_s[pause_s > BREAK_S], strict=True):
            self.breaks.append(Break(self.names[place], float(self.came[place]), float(pause)))
            self.since[place] = 0

    def steps(self, at: np.ndarray, root: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """How far each is from its last frame: the root, and the joint that turns most."""
        cosines = np.abs(np.sum(rotations * self.rotations[at], axis=-1)).clip(0, 1)
        return np.stack([np.linalg.norm(root - self.root[at], axis=-1), 2 * np.arccos(cosines.min(axis=-1))])

    def mark(self, frames: int):
        """Counts the next frames as those after a break."""
        self.since[:] = SETTLE_FRAMES - frames


@dataclass
class Report:
    """What came of all characters."""

    tracks: list[Track]
    lost: list[str] = field(default_factory=list)
    underruns: int = 0

    @property
    def breaks(self) -> list[Break]:
        """All breaks, in order."""
        return sorted((one for track in self.tracks for one in track.breaks), key=lambda one: one.began)

    @property
    def breaks_s(self) -> list[float]:
        """For each character and break: time from the last frame before it to the first after it."""
        return [one.pause_s for one in self.breaks]

    @property
    def backwards(self) -> int:
        """Frames whose number was lower than that of a frame before."""
        return sum(track.backwards for track in self.tracks)

    @property
    def usual(self) -> tuple[float, float]:
        """The largest steps without a break."""
        return tuple(np.max([track.usual for track in self.tracks], axis=0).tolist())

    @property
    def seams(self) -> tuple[float, float]:
        """The largest steps after a break."""
        return tuple(np.max([track.seam for track in self.tracks], axis=0).tolist())


class Crowd(threading.Thread):
    """Characters that walk and turn, on streams of their own clients, until they are to stop."""

    count = 0

    def __init__(self, address: str, characters: int, streams: int):
        super().__init__(daemon=True)
        self.address = address
        Crowd.count += 1
        self.names = [
            [f"crowd-{Crowd.count}-{nth}" for nth in range(stream, characters, streams)] for stream in range(streams)
        ]
        self.report = Report([Track(names) for names in self.names])
        self.error: BaseException | None = None
        self.is_over = threading.Event()
        self.start()

    def run(self):
        """Walks."""
        try:
            asyncio.run(self.all())
        except BaseException as error:  # It is raised in the test's thread.
            self.error = error

    async def all(self):
        """All streams, on one connection to the router."""
        async with troupe.aio.Client(self.address) as client:
            await asyncio.gather(*(self.stream(client, track) for track in self.report.tracks))

    async def stream(self, client: troupe.aio.Client, track: Track):
        """One stream."""
        names = track.names
        routed = client.routed(troupe.Route(session=names[0]))
        options = [
            troupe.SessionOptions(id=name, seed=nth + 1, position=(nth * 2.0, 0, 0), ttl=600)
            for nth, name in enumerate(names)
        ]
        sessions = await routed.sessions(options)
        how = troupe.DriveOptions(every_tick=True, reconnect=60.0, encoding=troupe.Encoding.F32)
        drive = await routed.drive(sessions, how)
        begun = time.monotonic()
        while not self.is_over.is_set():
            angle = int((time.monotonic() - begun) / TURN_S) * 0.7
            for one in drive.sessions.values():
                one.walk((WALK_M_S * np.sin(angle), 0, WALK_M_S * np.cos(angle)))
            tick = await drive.next()
            if tick is None:
                self.report.lost += names
                return
            self.report.underruns += tick.underruns
            self.report.lost += [
                f"{news.session}: {news.problem}"
                for news in tick.news
                if isinstance(news, troupe.Left | troupe.NotAttached)
            ]
            for block in tick.blocks:
                if block.ids:
                    track.take(block.ids, np.asarray(block.first_frames), block.root[-1], block.rotations[-1])
        await drive.close()
        closed = await routed.close_sessions(names)
        if closed != len(names):
            self.report.lost.append(f"{len(names) - closed} of the stream of {names[0]} at the end")

    def mark(self, frames: int):
        """Counts the next frames of all as those after a break."""
        for track in self.report.tracks:
            track.mark(frames)

    def end(self) -> Report:
        """Stops, and gives the report."""
        self.is_over.set()
        self.join(60)
        if self.error:
            raise self.error
        return self.report

    def all_walk(self, after: float) -> bool:
        """Whether every character has had a frame since then."""
        if self.error:
            raise self.error
        return all((track.came > after).all() for track in self.report.tracks)
