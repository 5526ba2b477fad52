#!/usr/bin/env python3
"""What the scripts of a shared store cost Redis: its processor time for each, for the table of docs/planning.md.

It starts a redis-server of its own, and runs the scripts of live/src/records/shared/script.rs on 2,000 sessions.
"""

import os
import re
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1] / "live/src/records/shared/script.rs"
SESSIONS, REPEATS, AT_ONCE = 2000, 5, 64
# A walker's record: 16 MiB are enough for 600 of them (docs/running.md).
RECORD = os.urandom(2**24 // 600)


class Redis:
    """A redis-server, and one connection to it."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        options = ["--bind", "127.0.0.1", "--port", str(port), "--save", "", "--appendonly", "no"]
        self.process = subprocess.Popen(["redis-server", *options], stdout=subprocess.DEVNULL)
        for _ in range(500):
            try:
                self.socket = socket.create_connection(("127.0.0.1", port))
                break
            except ConnectionRefusedError:
                time.sleep(0.02)
        self.answers = self.socket.makefile("rb")

    def read(self):
        """The next answer."""
        line = self.answers.readline()
        kind, rest = line[:1], line[1:-2]
        if kind == b"-":
            sys.exit(rest.decode())
        if kind in b"+:":
            return rest
        if int(rest) < 0:
            return None
        if kind == b"$":
            return self.answers.read(int(rest) + 2)[:-2]
        return [self.read() for _ in range(int(rest))]

    def send(self, commands: list[tuple]) -> list:
        """Answers of commands, some of them under way at a time."""
        found = []
        for start in range(0, len(commands), AT_ONCE):
            part = commands[start : start + AT_ONCE]
            self.socket.sendall(b"".join(encoded(command) for command in part))
            found += [self.read() for _ in part]
        return found

    def processor_s(self) -> float:
        """Processor time of the server until now."""
        text = self.send([("INFO", "cpu")])[0].decode()
        return sum(float(re.search(rf"used_cpu_{kind}:([\d.]+)", text)[1]) for kind in ("user", "sys"))


def encoded(command: tuple) -> bytes:
    """A command as Redis reads it."""
    parts = [part if isinstance(part, bytes) else str(part).encode() for part in command]
    return b"*%d\r\n" % len(parts) + b"".join(b"$%d\r\n%s\r\n" % (len(part), part) for part in parts)


def measure(redis: Redis, claim: str, hold: str) -> dict[str, float]:
    """Microseconds of each call."""
    keys = [f"troupe:session:{number:024x}" for number in range(SESSIONS)]
    costs = {}

    def cost(what: str, commands: list[tuple]) -> list:
        before = redis.processor_s()
        answers = redis.send(commands)
        costs[what] = (redis.processor_s() - before) / len(commands) * 1e6
        return answers

    def held(what: str, number: int, *record: bytes) -> list[tuple]:
        times = (1, 60_000, 3_600_000, number)
        return [
            ("EVAL", hold, 1, key, what, "a:8080", 3000, token, token, *times, *record)
            for key, token in zip(keys, tokens, strict=True)
        ]

    redis.send([("FLUSHALL",)])
    answers = cost("take a new lease", [("EVAL", claim, 1, key, "a:8080", 3000, "new", 3_600_000) for key in keys])
    tokens = [answer[1] for answer in answers]
    assert all(answer == [b"kept"] for answer in cost("write a record of 28 kB", held("write", 1, RECORD)))
    cost("renew a lease", held("renew", 2))
    redis.send(held("release", 3))
    known = [("EVAL", claim, 1, key, "b:8080", 3000, "known", 3_600_000) for key in keys]
    answers = cost("take a lease, and get the record", known)
    assert all(answer[2] == RECORD for answer in answers)
    return costs


def script(name: str) -> str:
    """A script of the server."""
    found = re.search(rf'const {name}: &str = r"\n(.*?)\n";', SCRIPTS.read_text(encoding="utf-8"), re.DOTALL)
    return found[1] if found else sys.exit(f"{SCRIPTS}: there is no {name}")


def main() -> None:
    """Prints medians."""
    claim, hold = script("CLAIM"), script("HOLD")
    redis = Redis()
    try:
        runs = [measure(redis, claim, hold) for _ in range(REPEATS)]
    finally:
        redis.process.kill()
        redis.process.wait()
    for what in runs[0]:
        values = sorted(run[what] for run in runs)
        print(f"| {what} | {statistics.median(values):.0f} µs | {values[0]:.0f} to {values[-1]:.0f} |")


if __name__ == "__main__":
    main()
