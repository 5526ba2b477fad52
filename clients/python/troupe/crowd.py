"""Many characters of one pack, advanced together by the caller's clock: the part that no connection is needed for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from troupe import calls, character, errors, events, frames, io
from troupe.arrays import Ints
from troupe.character import Character
from troupe.conventions import Convention
from troupe.errors import AnswerError, InvalidArgumentError, SessionError, TroupeError
from troupe.events import Event, Fault
from troupe.frames import Frames
from troupe.intent import Act, Locomotion, locomotions
from troupe.io import Call, Steps
from troupe.options import FrameOptions, SessionOptions
from troupe.pack import Pack
from troupe.v1 import event_pb2, session_pb2

GRID_M = 2.0
C = TypeVar("C", bound=Character)


def on_a_grid(count: int) -> list[SessionOptions]:
    """Characters on a square around the origin, two metres apart, with seeds from 0 on."""
    side = int(np.ceil(np.sqrt(count)))
    places = [((n % side - (side - 1) / 2) * GRID_M, 0, (n // side - (side - 1) / 2) * GRID_M) for n in range(count)]
    return [SessionOptions(seed=seed, position=place) for seed, place in enumerate(places)]


@dataclass(frozen=True, eq=False)
class CrowdStep:
    """The result of a step."""

    frames: Frames
    """Frames of those that moved, in the order of `members`."""
    members: Ints = field(repr=False)
    """Numbers of the crowd's characters that moved: all of them, where `faults` is empty."""
    faults: tuple[Fault, ...]
    """Characters that could not be served, and those whose command was refused, which moved on as before."""
    events: tuple[Event, ...]
    """Events of characters in their scenes, in order for each."""
    held: tuple[event_pb2.HeldObject, ...] = field(repr=False)
    """Objects in the characters' hands; `slot` is the number of the character."""
    waited: float
    """Longest time that a request of the step waited for plans on the server, seconds."""

    def _repr_html_(self) -> str:
        return self.frames._repr_html_()


class CrowdCore(Generic[C]):
    """Characters by their numbers, which are never used again for others."""

    def __init__(self, pack: Pack, options: FrameOptions, per_request: int = 1024) -> None:
        self.pack = pack
        self.frame_options = options
        self._per_request = max(per_request, 1)
        self._members: list[C | None] = []

    def __len__(self) -> int:
        """Characters that were ever in it: arrays of intents have as many rows."""
        return len(self._members)

    def __getitem__(self, member: int) -> C:
        """A character, to be commanded.

        Raises:
            IndexError: There is none of that number, or it has left.

        """
        found = self._members[member]
        if found is None:
            raise IndexError(f"character {member} has left the crowd")
        return found

    def __iter__(self) -> Iterator[C]:
        """The characters that have not left."""
        return (member for member in self._members if member is not None)

    def adopt(self, session: C) -> int:
        """Takes in a character whose session is open already, and gives its number."""
        pack = session.pack
        if (pack.name, pack.skeleton.names) != (self.pack.name, self.pack.skeleton.names):
            message = (
                f"session: {session.id} is of pack {pack.name} {pack.body}; allowed: {self.pack.name} {self.pack.body}"
            )
            raise InvalidArgumentError(message, field="session", allowed=f"{self.pack.name} {self.pack.body}".strip())
        if session.convention is not self.convention:
            message = f"session: {session.id} is in the convention {session.convention.name}"
            raise InvalidArgumentError(message, field="session", allowed=self.convention.name)
        self._members.append(session)
        return len(self._members) - 1

    @property
    def convention(self) -> Convention:
        """Axes and unit of all that its characters take and give; UNREAL and such where the first one's is."""
        return next((of.convention for of in self), Convention.NATIVE)

    def walk(
        self,
        velocities: npt.ArrayLike,
        *,
        facing: npt.ArrayLike | None = None,
        styles: str | Sequence[str | None] | None = None,
    ) -> None:
        """Commands for all characters, from arrays with a row for each: only changes go to the server.

        `velocities` is (n, 3), units a second over the ground; zero stands. `facing` is (n) radians, NaN where a character faces
        its way. `styles` is one name for all, or one for each, None for the style that it has.
        """
        before = [of._intent.wanted if of else Locomotion() for of in self._members]
        wanted = locomotions(velocities, facing, styles, before)
        for of, locomotion in zip(self._members, wanted, strict=True):
            if of is not None:
                of.locomotion = locomotion

    def act(self, act: Act) -> None:
        """Has everybody do something once, such as follow a path."""
        for of in self:
            of.act(act)

    def _add(
        self, options: int | Sequence[SessionOptions], make: Callable[[Pack, session_pb2.Session], C]
    ) -> Steps[list[int]]:
        new = on_a_grid(options) if isinstance(options, int) else options
        opened = yield from calls.open_sessions(new, self.pack, self.pack.body, make)
        return [self.adopt(session) for session in opened]

    def _step(self, count: int) -> Steps[CrowdStep]:
        here = [number for number, of in enumerate(self._members) if of is not None]
        chunks = [here[first : first + self._per_request] for first in range(0, len(here), self._per_request)]
        requests = [
            character.step_request([self[number] for number in chunk], count, self.frame_options) for chunk in chunks
        ]
        answers = yield from io.ask_all([Call(io.STEP, request) for request in requests])
        taken = _Taken(self)
        failed: TroupeError | None = None
        for chunk, answer in zip(chunks, answers, strict=True):
            if isinstance(answer, TroupeError):
                for number in chunk:
                    self[number]._intent.doubt()
                if isinstance(answer, SessionError):
                    yield from self._ask_each(chunk, answer, taken)
                else:
                    failed = failed or answer
            else:
                taken.answer(chunk, answer)
        if failed is not None:
            raise failed
        return taken.step()

    def _ask_each(self, chunk: list[int], common: SessionError, taken: _Taken[C]) -> Steps[None]:
        """If not one of a request could be served, the server answers with the first one's problem alone."""
        questions = [Call(io.GET_SESSION, session_pb2.GetSessionRequest(id=self[number].id)) for number in chunk]
        answers = yield from io.ask_all(questions)
        for number, answer in zip(chunk, answers, strict=True):
            if isinstance(answer, SessionError):
                taken.fault(number, answer)
            elif isinstance(answer, TroupeError):
                raise answer
            else:
                taken.fault(number, common)

    def _close(self) -> Steps[int]:
        ids = [of.id for of in self]
        self._members = [None] * len(self._members)
        return (yield from calls.close_sessions(ids))


class _Taken(Generic[C]):
    """The answers to a step's requests so far."""

    def __init__(self, crowd: CrowdCore[C]) -> None:
        self._crowd = crowd
        self._frames: list[Frames] = []
        self._members: list[int] = []
        self._faults: list[Fault] = []
        self._events: list[Event] = []
        self._held: list[event_pb2.HeldObject] = []
        self._waited_us = 0

    def answer(self, chunk: list[int], answer: session_pb2.StepResponse) -> None:
        """Takes in the answer to one request."""
        crowd = self._crowd
        self._waited_us = max(self._waited_us, answer.waited_us)
        for block in answer.blocks:
            if any(slot >= len(chunk) for slot in block.slots):
                raise AnswerError("a slot is of no character", field="slots")
            numbers = [chunk[slot] for slot in block.slots]
            ids = tuple(crowd[number].id for number in numbers)
            rate = crowd.frame_options.rate
            of = frames.Of(crowd.pack.skeleton, rate, crowd.convention, ids)
            self._frames.append(frames.of_block(block, of))
            self._members.extend(numbers)
        by_id = {crowd[number].id: number for number in chunk}
        for of_session in answer.events:
            happened = events.of_message(of_session)
            crowd[by_id[of_session.session_id]].events = happened
            self._events.extend(happened)
        for held in answer.held:
            held.slot = chunk[held.slot]
            self._held.append(held)
        for problem in answer.problems:
            number = chunk[problem.slot]
            self.fault(number, errors.of_problem(problem.problem, crowd[number].id))
        for result in answer.command_results:
            refused = result.status == character.REFUSED
            # Whoever is gone has been reported.
            if refused and crowd._members[by_id[result.session_id]] is not None:
                self.fault(by_id[result.session_id], errors.of_problem(result.problem, result.session_id))

    def fault(self, number: int, problem: SessionError) -> None:
        """Reports a character, which leaves where its session is gone."""
        self._faults.append(Fault(number, problem, problem.is_gone))
        if problem.is_gone:
            self._crowd._members[number] = None

    def step(self) -> CrowdStep:
        """All of it."""
        if not self._frames:
            crowd = self._crowd
            of = frames.Of(crowd.pack.skeleton, crowd.frame_options.rate, crowd.convention, ())
            self._frames.append(frames.of_block(session_pb2.FrameBlock(), of))
        return CrowdStep(
            frames.side_by_side(self._frames),
            np.array(self._members, np.int64),
            tuple(self._faults),
            tuple(self._events),
            tuple(self._held),
            self._waited_us / 1e6,
        )
