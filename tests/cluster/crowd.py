"""Live characters behind a router, driven by the Python client, and what a viewer of them would notice."""

import asyncio
import threading
import time
from dataclasses import dataclass, field

import numpy as np

import troupe
import troupe.aio

SETTLE_FRAMES = 12
"""Frames after a break in which the motion fades over, and a few more."""
WALK_M_S = 1.2
TURN_S = 4.0
BREAK_S = 0.5


@dataclass
class Character:
    """What came of one character."""

    frame: int = -1
    root: np.ndarray | None = None
    rotations: np.ndarray | None = None
    came: float = 0.0
    since_break: int = 1 << 30
    backwards: int = 0
    frames: int = 0
    # The largest steps from frame to frame: metres of the root, radians of a joint.
    usual: tuple[float, float] = (0.0, 0.0)
    seam: tuple[float, float] = (0.0, 0.0)


@dataclass
class Report:
    """What came of all characters."""

    characters: dict[str, Character] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    breaks_s: list[float] = field(default_factory=list)
    """For each character and break: time from the last frame before it to the first after it."""
    underruns: int = 0

    def take(self, name: str, frame: int, root: np.ndarray, rotations: np.ndarray):
        """Takes a frame."""
        now = time.monotonic()
        one = self.characters[name]
        if one.root is not None:
            self.compare(one, frame, root, rotations, now - one.came)
        one.frame, one.root, one.rotations, one.came = max(frame, one.frame), root, rotations, now
        one.frames += 1

    def compare(self, one: Character, frame: int, root: np.ndarray, rotations: np.ndarray, pause_s: float):
        """Compares a frame with the one before."""
        one.since_break += 1
        if pause_s > BREAK_S:
            self.breaks_s.append(pause_s)
            one.since_break = 0
        one.backwards += frame < one.frame
        frames = max(frame - one.frame, 1)
        cosines = np.abs(np.sum(rotations * one.rotations, axis=-1)).clip(0, 1)
        step = (float(np.linalg.norm(root - one.root)) / frames, float(2 * np.arccos(cosines.min())) / frames)
        if one.since_break <= SETTLE_FRAMES:
            one.seam = (max(one.seam[0], step[0]), max(one.seam[1], step[1]))
        else:
            one.usual = (max(one.usual[0], step[0]), max(one.usual[1], step[1]))

    @property
    def usual(self) -> tuple[float, float]:
        """The largest steps without a break."""
        return tuple(np.max([one.usual for one in self.characters.values()], axis=0).tolist())

    @property
    def seams(self) -> tuple[float, float]:
        """The largest steps after a break."""
        return tuple(np.max([one.seam for one in self.characters.values()], axis=0).tolist())


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
        self.report = Report({name: Character() for names in self.names for name in names})
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
            await asyncio.gather(*(self.stream(client, names) for names in self.names))

    async def stream(self, client: troupe.aio.Client, names: list[str]):
        """One stream."""
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
            for name, block, place in tick.characters():
                frame = int(block.first_frames[place])
                self.report.take(name, frame, block.root[-1, place].copy(), block.rotations[-1, place].copy())
        await drive.close()
        await routed.close_sessions(names)

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
        return all(one.came > after for one in self.report.characters.values())
