"""HAProxy and Envoy as they are configured in deploy/cluster, before servers of the test."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
CONFIGURATIONS = ROOT / "deploy/cluster"
NAMES = ("troupe-0:8080", "troupe-1:8080", "troupe-2:8080")
START_S = 60.0
VENV = Path(sys.executable).parent


def free_ports(count: int) -> list[int]:
    """Ports that were free a moment ago."""
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def accepts(port: int) -> bool:
    """Whether something listens."""
    with socket.socket() as one:
        one.settimeout(1)
        return one.connect_ex(("127.0.0.1", port)) == 0


def until(is_so, what: str, limit_s: float = START_S):
    """Waits for something, and gives it."""
    end = time.monotonic() + limit_s
    while not (found := is_so()):
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {limit_s:g} s")
        time.sleep(0.05)
    return found


class Process:
    """A process whose output is a file."""

    def __init__(self, command: list[str | Path], log: Path, more: dict[str, str] | None = None, cores: str = ""):
        self.command = ["taskset", "--cpu-list", cores, *command] if cores else command
        self.environment = {**os.environ, **(more or {})}
        self.log = log
        self.start()

    def start(self):
        """Starts it, for the first time or again."""
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(self.command, env=self.environment, stdout=log, stderr=subprocess.STDOUT)

    def send(self, which: signal.Signals):
        """Sends a signal."""
        self.process.send_signal(which)

    def kill(self):
        """Ends it without a word, also while it is stopped."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


def haproxy() -> str | None:
    """The program, if it is there."""
    return shutil.which("haproxy") or shutil.which("/usr/sbin/haproxy")


class Router(Process):
    """A router that listens on a port of its own."""

    def __init__(self, kind: str, ports: dict[str, int], folder: Path, cores: str = ""):
        self.kind = kind
        (self.port,) = free_ports(1)
        make = self.of_haproxy if kind == "haproxy" else self.of_envoy
        command, more = make(ports, folder)
        super().__init__(command, folder / f"{kind}.log", more, cores)
        until(lambda: accepts(self.port) or self.process.poll() is not None, f"{kind} listens")
        if self.process.poll() is not None:
            raise AssertionError(self.log.read_text())

    def of_haproxy(self, ports: dict[str, int], _folder: Path):
        """Its file as it is: addresses come from the environment."""
        more = {
            name.upper().replace("-", "_").removesuffix(":8080"): f"127.0.0.1:{port}" for name, port in ports.items()
        }
        more["TROUPE_BIND"] = f"127.0.0.1:{self.port}"
        return [haproxy(), "-f", CONFIGURATIONS / "haproxy.cfg"], more

    def of_envoy(self, ports: dict[str, int], folder: Path):
        """Its file with other addresses."""
        of = yaml.safe_load((CONFIGURATIONS / "envoy.yaml").read_text())
        resources = of["static_resources"]
        resources["listeners"][0]["address"]["socket_address"] = {"address": "127.0.0.1", "port_value": self.port}
        for one in resources["clusters"][0]["load_assignment"]["endpoints"][0]["lb_endpoints"]:
            name = one["metadata"]["filter_metadata"]["envoy.lb"]["server"]
            one["endpoint"]["address"]["socket_address"] = {"address": "127.0.0.1", "port_value": ports[name]}
        file = folder / "envoy.yaml"
        file.write_text(yaml.safe_dump(of))
        return [VENV / "envoy", "-c", file, "--concurrency", "1", "--use-dynamic-base-id"], {}
