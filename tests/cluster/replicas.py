"""Servers that share a Redis, behind HAProxy, all as processes of the test."""

import os
import shutil
import signal
import sys
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import httpx
import redis
from processes import START_S, Process, accepts, free_ports, until
from routers import NAMES, ROOT, Router, haproxy
from spots import Loopback, Namespace, Networks

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

    def __init__(self, folder: Path, is_open: bool = False):
        (self.port,) = free_ports(1)
        # Namespaces reach it by another address than loopback.
        hosts = ["--bind", "0.0.0.0", "--protected-mode", "no"] if is_open else ["--bind", "127.0.0.1"]
        command = ["redis-server", "--port", str(self.port), *hosts, "--save", "", "--appendonly", "no"]
        super().__init__([*command, "--dir", str(folder)], folder / "redis.log")
        with self.or_end():
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


class Replica(Process):
    """A server. `store` is its store's address or folder; `spot` says where it runs."""

    def __init__(
        self,
        name: str,
        store: str,
        folder: Path,
        spot: Loopback | Namespace | None = None,
        prefix: list[str] | None = None,
        packs: str = PACKS,
    ):
        (self.port,) = free_ports(1)
        self.host = spot.host if spot else "127.0.0.1"
        library = os.environ.get("ORT_DYLIB_PATH", str(ROOT / ".runtime/libonnxruntime.so"))
        state = str(folder / name.split(":")[0])
        more = {"ORT_DYLIB_PATH": library, "TROUPE_STORE": store, "XDG_STATE_HOME": state}
        if self.host != "127.0.0.1":
            # Nothing but this machine reaches the namespaces.
            more["TROUPE_WITHOUT_KEYS"] = "anyone"
        command = [str(BINARY), "--packs", packs, "--listen", self.address, "--advertise", name]
        # A namespace hides control groups from what is started in it.
        command = [*(prefix or []), *(spot.prefix if spot else ()), *command]
        super().__init__(command, folder / f"{name.split(':')[0]}.log", more)

    @property
    def address(self) -> str:
        """Where it listens."""
        return f"{self.host}:{self.port}"

    def wait_ready(self):
        """Waits until it serves."""

        def is_ready() -> bool:
            assert self.process.poll() is None, self.log.read_text()[-4000:]
            with suppress(httpx.HTTPError):
                return httpx.get(f"http://{self.address}/readyz", trust_env=False).status_code == 200
            return False

        until(is_ready, f"{self.command[-1]} is ready", READY_S)

    def metric(self, name: str, labels: str = "") -> float:
        """A metric: the sum of all its series that have these labels."""
        text = httpx.get(f"http://{self.address}/metrics", trust_env=False).text
        lines = (line.rsplit(" ", 1) for line in text.splitlines() if line.startswith((f"{name} ", f"{name}{{")))
        return sum(float(value) for series, value in lines if labels in series)

    def leases(self, result: str) -> float:
        """Number of its leases with a result."""
        return self.metric("troupe_store_leases_total", f'result="{result}"')


class Witness(threading.Thread):
    """Looks at the leases in Redis all the time. Each has one owner, and its token only rises."""

    def __init__(self, port: int, every_s: float):
        super().__init__(daemon=True)
        self.redis = redis.Redis(port=port, socket_timeout=1, decode_responses=True)
        self.every_s = every_s
        self.owners: dict[str, dict[int, str]] = {}
        self.faults: list[str] = []
        self.looks = 0
        self.is_over = threading.Event()
        self.start()

    def run(self):
        """Looks."""
        while not self.is_over.wait(self.every_s):
            with suppress(redis.RedisError, OSError):
                # Sessions and scenes.
                keys = list(self.redis.scan_iter("troupe:s[ce]*", count=1000))
                pipe = self.redis.pipeline(transaction=False)
                for key in keys:
                    pipe.hmget(key, "token", "owner")
                for key, (token, owner) in zip(keys, pipe.execute(), strict=True):
                    self.look(key, token, owner)
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
    """Redis, servers, and HAProxy. `prefixes` go before the commands of the servers."""

    def __init__(
        self,
        folder: Path,
        count: int = 3,
        prefixes: list[list[str]] | None = None,
        in_namespaces: bool = False,
        look_s: float = 0.05,
    ):
        self.parts = ExitStack()
        try:
            self.begin(folder, count, prefixes, in_namespaces, look_s)
        except BaseException:
            self.stop()
            raise

    def begin(self, folder: Path, count: int, prefixes: list[list[str]] | None, in_namespaces: bool, look_s: float):
        """Starts all of it, one after another."""
        if in_namespaces:
            self.parts.callback(Networks().close)
        self.redis = Redis(folder, in_namespaces)
        self.parts.callback(self.redis.kill)
        names = NAMES[:count]
        self.spots: dict[str, Loopback | Namespace] = {}
        self.replicas: dict[str, Replica] = {}
        for nth, name in enumerate(names):
            spot = Namespace(nth, self.redis.port) if in_namespaces else Loopback(self.redis.port)
            self.spots[name] = spot
            self.parts.callback(spot.close)
            prefix = prefixes[nth] if prefixes else None
            self.replicas[name] = Replica(name, f"redis://{spot.store}", folder, spot, prefix)
            self.parts.callback(self.replicas[name].kill)
        for one in self.replicas.values():
            one.wait_ready()
        # On ports of servers that are not there nothing listens.
        servers = {name: f"127.0.0.1:{port}" for name, port in zip(NAMES, free_ports(len(NAMES)), strict=True)}
        servers |= {name: one.address for name, one in self.replicas.items()}
        self.router = Router("haproxy", servers, folder)
        self.parts.callback(self.router.kill)
        self.address = f"127.0.0.1:{self.router.port}"
        until(
            lambda: httpx.get(f"http://{self.address}/v1/packs", trust_env=False).status_code == 200, "HAProxy serves"
        )
        time.sleep(START_S / 30)
        self.witness = Witness(self.redis.port, look_s)
        self.parts.callback(self.witness.end)

    def stop(self):
        """Ends all, the last part first."""
        self.parts.close()
