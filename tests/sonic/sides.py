"""A server and a bridge as processes of their own."""

import json
import os
import re
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILD = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / os.environ.get("TROUPE_BUILD", "debug")
TROUPE = BUILD / os.environ.get("TROUPE_CLI", "troupe-under-test")
READY_S = 120


def free_ports(count: int) -> list[int]:
    """Ports that are free, each with the one after it."""
    found: list[int] = []
    while len(found) < count:
        with socket.socket() as one, socket.socket() as two:
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
            try:
                two.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
        if not {port - 1, port, port + 1} & set(found):
            found.append(port)
    return found


def cpu_s(pid: int) -> float:
    """Seconds of a core that a process has used."""
    numbers = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(numbers[11]) + int(numbers[12])) / os.sysconf("SC_CLK_TCK")


class Server:
    """A server with the pack of the G1."""

    def __init__(self, port: int = 0):
        command = [BUILD / "troupe-server", "--packs", ROOT / "models/g1", "--listen", f"127.0.0.1:{port}"]
        library = os.environ.get("ORT_DYLIB_PATH", str(ROOT / ".runtime/libonnxruntime.so"))
        self.process = subprocess.Popen(
            command,
            env={**os.environ, "ORT_DYLIB_PATH": library},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.url = self.wait()
        threading.Thread(target=self.process.stdout.read, daemon=True).start()

    def wait(self) -> str:
        """The address, once it serves."""
        said = []
        for line in self.process.stdout:
            said.append(line)
            if found := re.match(r"Troupe serves .* on (http://\S+)$", line):
                return found[1]
        raise RuntimeError("the server does not start:\n" + "".join(said))

    @property
    def port(self) -> int:
        return int(self.url.rsplit(":", 1)[1])

    def signal(self, which: signal.Signals):
        """Stops, continues or kills it."""
        self.process.send_signal(which)

    def kill(self):
        """Ends it without a word."""
        self.process.kill()
        self.process.wait()


class Bridge:
    """`troupe bridge sonic` with robots on ports."""

    def __init__(self, url: str, ports: list[int], folder: Path, more: str = ""):
        robots = "".join(
            f'[[robot]]\nname = "r{nth}"\nport = {port}\nfeedback = "127.0.0.1:{port + 1}"\n{more}\n'
            for nth, port in enumerate(ports)
        )
        file = folder / "robots.toml"
        file.write_text(f'listen = "127.0.0.1"\n{robots}')
        command = [TROUPE, "--server", url, "bridge", "sonic", file, "--json"]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.said: list[str] = []
        self.listener = threading.Thread(target=self.listen, daemon=True)
        self.listener.start()

    def listen(self):
        """Keeps its notes."""
        for line in self.process.stderr:
            self.said.append(line.rstrip())

    def order(self, *lines: str) -> float:
        """Gives orders, and says when."""
        self.process.stdin.write("".join(f"{line}\n" for line in lines))
        self.process.stdin.flush()
        return time.monotonic()

    def end(self, live=lambda: None) -> dict:
        """Has it leave, and gives its figures. `live` runs until then."""
        self.order("quit")
        live()
        out = self.process.stdout.read()
        assert self.wait() == 0, "\n".join(self.said)
        return json.loads(out)

    def wait(self) -> int:
        """Its exit code, once it has left."""
        code = self.process.wait(timeout=READY_S)
        self.listener.join()
        return code

    def kill(self):
        """Ends it if it has not left."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
