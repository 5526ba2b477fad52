"""Servers that share a Redis, behind HAProxy, all as processes of the test."""

import os
import shutil
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import httpx
import redis
from routers import NAMES, ROOT, START_S, Process, Router, accepts, free_ports, haproxy, until

sys.path.append(str(ROOT / "clients/python"))

BINARY = Path(os.environ.get("TROUPE_SERVER") or ROOT / "target/debug/troupe-server")
PACKS = os.environ.get("TROUPE_CLUSTER_PACKS", str(ROOT / "models/human"))
READY_S = 180.0


def lacking() -> str | None:
    """What the test of failures lacks on this machine."""
    found = {"haproxy": haproxy(), "redis-server": shutil.which("redis-server"), str(BINARY): BINARY.exists()}
    missing = [name for name, is_there in found.items() if not is_there]
    return f"*** SEVERAL SERVERS WERE NOT TESTED: there is no {', no '.join(missing)}" if missing else None


class Redis(Process):
    """A redis-server that writes nothing to the disk."""

    def __init__(self, folder: Path):
        (self.port,) = free_ports(1)
        command = ["redis-server", "--port", str(self.port), "--bind", "127.0.0.1", "--save", "", "--appendonly", "no"]
        super().__init__([*command, "--dir", str(folder)], folder / "redis.log")
        until(lambda: accepts(self.port), "Redis listens")

    def pause(self, seconds: float):
        """Stops it for a time."""
        self.send(signal.SIGSTOP)
        time.sleep(seconds)
        self.send(signal.SIGCONT)

    def restart_empty(self):
        """Starts it again with nothing in it."""
        self.kill()
        self.start()
        until(lambda: accepts(self.port), "Redis listens again")


class Cable:
    """A TCP proxy between a server and Redis. While it is cut nothing passes, as if packets were lost."""

    def __init__(self, to: int):
        self.to = to
        self.is_cut = threading.Event()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.open: list[socket.socket] = []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        """Takes connections, also while it is cut: packets that open them are what gets lost last."""
        with suppress(OSError):
            while True:
                near, _ = self.listener.accept()
                with suppress(OSError):
                    far = socket.create_connection(("127.0.0.1", self.to))
                    self.open += [near, far]
                    threading.Thread(target=self.pass_on, args=(near, far), daemon=True).start()
                    threading.Thread(target=self.pass_on, args=(far, near), daemon=True).start()
                    continue
                near.close()

    def pass_on(self, source: socket.socket, target: socket.socket):
        """Passes bytes on. What came while it was cut comes late."""
        with suppress(OSError):
            while data := source.recv(1 << 16):
                while self.is_cut.is_set():
                    time.sleep(0.01)
                target.sendall(data)
        for one in (source, target):
            with suppress(OSError):
                one.close()

    def close(self):
        """Ends it."""
        self.is_cut.clear()
        for one in (self.listener, *self.open):
            with suppress(OSError):
                one.close()


class Replica(Process):
    """A server of the cluster."""

    def __init__(self, name: str, port: int, store: int, folder: Path, cores: str = ""):
        self.port = port
        library = os.environ.get("ORT_DYLIB_PATH", str(ROOT / ".runtime/libonnxruntime.so"))
        more = {
            "ORT_DYLIB_PATH": library,
            "TROUPE_STORE": f"redis://127.0.0.1:{store}",
            "XDG_STATE_HOME": str(folder / name.split(":")[0]),
        }
        command = [str(BINARY), "--packs", PACKS, "--listen", f"127.0.0.1:{port}", "--advertise", name]
        super().__init__(command, folder / f"{name.split(':')[0]}.log", more, cores)

    def wait_ready(self):
        """Waits until it serves."""

        def is_ready() -> bool:
            assert self.process.poll() is None, self.log.read_text()[-4000:]
            with suppress(httpx.HTTPError):
                return httpx.get(f"http://127.0.0.1:{self.port}/readyz", trust_env=False).status_code == 200
            return False

        until(is_ready, f"{self.command[-1]} is ready", READY_S)

    def leases(self, result: str) -> float:
        """Number of its leases with a result."""
        text = httpx.get(f"http://127.0.0.1:{self.port}/metrics", trust_env=False).text
        start = f'troupe_store_leases_total{{result="{result}"}} '
        return next(float(line.removeprefix(start)) for line in text.splitlines() if line.startswith(start))


class Witness(threading.Thread):
    """Looks at the leases in Redis all the time. Each has one owner, and its token only rises."""

    def __init__(self, port: int):
        super().__init__(daemon=True)
        self.redis = redis.Redis(port=port, socket_timeout=1, decode_responses=True)
        self.owners: dict[str, dict[int, str]] = {}
        self.faults: list[str] = []
        self.looks = 0
        self.is_over = threading.Event()
        self.start()

    def run(self):
        """Looks."""
        while not self.is_over.wait(0.05):
            with suppress(redis.RedisError, OSError):
                for key in self.redis.scan_iter("troupe:*", count=1000):
                    self.look(key, *self.redis.hmget(key, "token", "owner"))
                self.looks += 1

    def look(self, key: str, token: str | None, owner: str | None):
        """Notes the owner of a token."""
        if token is None or owner is None:
            return
        known = self.owners.setdefault(key, {})
        if known and int(token) < max(known):
            self.faults.append(f"{key}: token {token} of {owner} after {max(known)} of {known[max(known)]}")
        if known.setdefault(int(token), owner) != owner:
            self.faults.append(f"{key}: token {token} is of {known[int(token)]} and of {owner}")

    def owner(self, session: str) -> str | None:
        """The server that has a session now."""
        key = next((key for key in self.redis.scan_iter("troupe:session:*") if key.endswith(session)), None)
        return self.redis.hget(key, "owner") if key else None

    def end(self):
        """Stops looking."""
        self.is_over.set()
        self.join()


class Cluster:
    """Redis, servers with a cable to it each, and HAProxy."""

    def __init__(self, folder: Path, count: int = 3, cores: tuple[str, ...] = ("", "", "")):
        self.redis = Redis(folder)
        names = NAMES[:count]
        ports = dict(zip(NAMES, free_ports(3), strict=True))
        self.cables = {name: Cable(self.redis.port) for name in names}
        self.replicas = {
            name: Replica(name, ports[name], self.cables[name].port, folder, cores[nth])
            for nth, name in enumerate(names)
        }
        for one in self.replicas.values():
            one.wait_ready()
        # Servers that are not there have ports on which nothing listens.
        self.router = Router("haproxy", ports, folder)
        self.address = f"127.0.0.1:{self.router.port}"
        until(
            lambda: httpx.get(f"http://{self.address}/v1/packs", trust_env=False).status_code == 200, "HAProxy serves"
        )
        time.sleep(START_S / 30)
        self.witness = Witness(self.redis.port)

    def stop(self):
        """Ends all."""
        self.witness.end()
        for one in (self.router, *self.replicas.values(), self.redis):
            one.kill()
        for one in self.cables.values():
            one.close()
