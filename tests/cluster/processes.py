"""Processes of a test. They end with it, also if it fails, is interrupted or is killed."""

import atexit
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

START_S = 60.0
RUNNING: set["Process"] = set()
"""All processes that were started and not ended."""
SETPRIV = shutil.which("setpriv")
"""Has Linux kill a process when the thread that started it ends, however that ends. A function that runs between fork and
exec could do so too, but gRPC's threads do not survive such a fork."""


def free_ports(count: int) -> list[int]:
    """Ports that were free a moment ago."""
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def accepts(port: int, host: str = "127.0.0.1") -> bool:
    """Whether something listens."""
    with socket.socket() as one:
        one.settimeout(1)
        return one.connect_ex((host, port)) == 0


def until(is_so, what: str, limit_s: float = START_S):
    """Waits for something, and gives it."""
    end = time.monotonic() + limit_s
    while not (found := is_so()):
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {limit_s:g} s")
        time.sleep(0.05)
    return found


@atexit.register
def end_all():
    """Ends what a test has left, on systems that do not do it themselves."""
    for one in list(RUNNING):
        one.kill()


class Process:
    """A process whose output is a file. The thread that starts it must live as long as the test."""

    def __init__(self, command: list[str | Path], log: Path, more: dict[str, str] | None = None):
        self.command = [SETPRIV, "--pdeathsig", "KILL", *command] if SETPRIV else command
        self.environment = {**os.environ, **(more or {})}
        self.log = log
        self.start()

    def start(self):
        """Starts it, for the first time or again."""
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(self.command, env=self.environment, stdout=log, stderr=subprocess.STDOUT)
        RUNNING.add(self)

    @contextmanager
    def or_end(self) -> Iterator[None]:
        """Ends it if what is done within fails."""
        try:
            yield
        except BaseException:
            self.kill()
            raise

    def send(self, which: signal.Signals):
        """Sends a signal."""
        self.process.send_signal(which)

    def kill(self):
        """Ends it without a word, also while it is stopped."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        RUNNING.discard(self)

    def processor_s(self) -> float:
        """Processor time that it has taken until now, by all its threads."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
