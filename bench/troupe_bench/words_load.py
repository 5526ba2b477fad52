"""Asks servers for motion of words, from many clients at once, and notes when frames come.

A client is a thread with a connection for each request. Both servers get the same words, lengths and seeds.
"""

import http.client
import itertools
import json
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from troupe_bench.body import PART, read_frames_header
from troupe_bench.store import Json

TIMEOUT_S = 300
SUBJECTS = ("an elderly person", "a happy person", "an angry person", "a proud person", "someone")
VERBS = ("walks", "waves with the left hand", "dances", "kicks", "bows")
SENTENCES = tuple(f"{subject} {verb}" for verb, subject in itertools.product(VERBS, SUBJECTS))
LENGTHS = (60, 92, 120, 180)
"""Frames of a motion: 2 to 6 seconds, 15 to 45 tokens."""
FRAME_COUNT = re.compile(rb'"frame_count":(\d+)')


@dataclass(frozen=True)
class Words:
    """A request: what to do, for how many frames."""

    text: str
    frames: int
    seed: int


def words(index: int) -> Words:
    """The request of a number: 100 different ones of sentence and length, then the same with other seeds."""
    turn, sentence = divmod(index, len(SENTENCES))
    return Words(SENTENCES[sentence], LENGTHS[(turn + sentence) % len(LENGTHS)], index + 1)


class Target:
    """A server, and how it is asked."""

    path = "/generate"

    def __init__(self, url: str):
        self.host = urlsplit(url).netloc

    def body(self, asked: Words, temperature: float | None) -> dict[str, Any]:
        """The request as JSON, as the FastAPI server takes it."""
        body: dict[str, Any] = {"text": asked.text, "frame_count": asked.frames, "seed": asked.seed}
        return body if temperature is None else body | {"temperature": temperature}

    def parts(self, answer: http.client.HTTPResponse) -> Iterator[tuple[int, bytes]]:
        """Frames of each part as it comes, and its body."""
        while True:
            frames, size = read_frames_header(answer.read(PART.size))
            if frames == 0:
                return
            yield frames, answer.read(size)

    def ask(self, asked: Words, temperature: float | None = None) -> Iterator[tuple[int, bytes]]:
        """Asks once, and gives the parts of the answer.

        Raises ValueError if the server refuses, or its frames are not as many as asked for.
        """
        connection = http.client.HTTPConnection(self.host, timeout=TIMEOUT_S)
        try:
            body = json.dumps(self.body(asked, temperature))
            connection.request("POST", self.path, body, {"content-type": "application/json"})
            answer = connection.getresponse()
            if answer.status != 200:
                raise ValueError(f"{answer.status} {answer.read(500).decode(errors='replace')}")
            made = 0
            for frames, part in self.parts(answer):
                made += frames
                yield frames, part
            if made != asked.frames:
                raise ValueError(f"{made} frames of {asked.frames} came")
        finally:
            connection.close()


class Troupe(Target):
    """A Troupe server."""

    path = "/v1/generate"

    def __init__(self, url: str, pack: str):
        super().__init__(url)
        self.pack = pack

    def body(self, asked: Words, temperature: float | None) -> dict[str, Any]:
        """The request as `docs/words.md` has it."""
        prompt = {"text": asked.text, "frame_count": asked.frames}
        body: dict[str, Any] = {"pack": self.pack, "seed": asked.seed, "prompt": prompt}
        return body if temperature is None else body | {"sampling": {"temperature": temperature}}

    def parts(self, answer: http.client.HTTPResponse) -> Iterator[tuple[int, bytes]]:
        """A JSON object a line."""
        while line := answer.readline():
            found = FRAME_COUNT.search(line)
            if found is None:
                if b'"frames"' in line or b'"is_last":true' not in line:
                    raise ValueError(line[:500].decode(errors="replace"))
                continue
            yield int(found[1]), line


@dataclass
class Seen:
    """The clients' view of a run; times by one clock."""

    parts: list[tuple[float, int]] = field(default_factory=list)  # when frames came, and how many
    answers: list[tuple[float, float, float]] = field(default_factory=list)  # begin, first frames, end
    failed: list[str] = field(default_factory=list)

    def figures(self, begin: float, end: float) -> Json:
        """Frames a second that came from `begin` to `end`, and latencies of the requests that were sent in that time."""
        frames = sum(count for at, count in self.parts if begin <= at < end)
        sent = [answer for answer in self.answers if begin <= answer[0] < end]
        times = {
            "first_frames_ms": [1e3 * (first - start) for start, first, _ in sent],
            "answer_ms": [1e3 * (last - start) for start, _, last in sent],
        }
        return {
            "frames": sum(count for _, count in self.parts),
            "frames_per_s": frames / (end - begin),
            "requests": len(sent),
            "failed": len(self.failed),
            "examples": self.failed[:3],
        } | {name: percentiles(values) for name, values in times.items()}


def percentiles(values: list[float]) -> Json:
    """The median and the 99th percentile."""
    return {name: float(np.percentile(values, part)) for name, part in (("p50", 50), ("p99", 99))} if values else {}


def load(target: Target, clients: int, warmup_s: float, measured_s: float) -> Json:
    """Every client sends its next request when it has its answer, until the time is over. The last answers are waited for."""
    seen, numbers = Seen(), itertools.count()
    begin = time.monotonic() + warmup_s
    end = begin + measured_s
    busy = time.process_time()

    def run() -> None:
        while time.monotonic() < end:
            start = time.monotonic()
            first = None
            try:
                for frames, _ in target.ask(words(next(numbers))):
                    now = time.monotonic()
                    first = first or now
                    seen.parts.append((now, frames))
            except (OSError, ValueError, http.client.HTTPException) as error:
                seen.failed.append(str(error))
                time.sleep(0.1)  # a server that refuses at once is not to be flooded
                continue
            seen.answers.append((start, first or start, time.monotonic()))

    threads = [threading.Thread(target=run, daemon=True) for _ in range(clients)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    cpus_busy = (time.process_time() - busy) / (time.monotonic() - begin + warmup_s)
    return seen.figures(begin, end) | {"client_cpus_busy": cpus_busy}
