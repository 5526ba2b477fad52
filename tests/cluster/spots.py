"""Where a server of the test runs: on loopback, or in a network namespace of its own. Either way it can be cut off from Redis."""

import os
import shutil
import socket
import subprocess
import threading
import time
from contextlib import suppress

STORE_HOST, STORE_NET = "10.78.0.1", "10.78.0"
CLIENT_HOST, CLIENT_NET = "10.77.0.1", "10.77.0"


class Loopback:
    """On loopback, with a TCP proxy before Redis. While that is cut nothing passes, as if packets were lost."""

    host = "127.0.0.1"
    prefix: tuple[str, ...] = ()

    def __init__(self, redis_port: int):
        self.to = redis_port
        self.is_cut = threading.Event()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.store = f"127.0.0.1:{self.listener.getsockname()[1]}"
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

    def cut(self):
        """From now on it does not reach Redis."""
        self.is_cut.set()

    def heal(self):
        """It reaches Redis again."""
        self.is_cut.clear()

    def close(self):
        """Ends it."""
        self.heal()
        for one in (self.listener, *self.open):
            with suppress(OSError):
                one.close()


def ip(*arguments: str):
    """Runs `ip`."""
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


class Networks:
    """Two bridges: one for routers and clients, one for Redis. Only root can make them."""

    BRIDGES = (("troupe-clients", CLIENT_HOST), ("troupe-store", STORE_HOST))

    def __init__(self):
        for name, host in self.BRIDGES:
            with suppress(subprocess.CalledProcessError):
                # One that was left.
                ip("link", "delete", name)
            ip("link", "add", name, "type", "bridge")
            ip("address", "add", f"{host}/24", "dev", name)
            ip("link", "set", name, "up")

    @staticmethod
    def lacking() -> str | None:
        """Why there can be none."""
        if os.geteuid() != 0:
            return "network namespaces need root"
        return None if shutil.which("ip") else "network namespaces need the program ip"

    def close(self):
        """Removes them."""
        for name, _ in self.BRIDGES:
            ip("link", "delete", name)


class Namespace:
    """In a network namespace, with a cable to each bridge. The one to Redis can be pulled out."""

    def __init__(self, nth: int, redis_port: int):
        self.name = f"troupe-{nth}"
        self.prefix = ("ip", "netns", "exec", self.name)
        self.host = f"{CLIENT_NET}.{nth + 11}"
        self.store = f"{STORE_HOST}:{redis_port}"
        self.store_end = f"troupe-s{nth}"
        with suppress(subprocess.CalledProcessError):
            ip("netns", "delete", self.name)
        ip("netns", "add", self.name)
        ip("-netns", self.name, "link", "set", "lo", "up")
        for end, inside, bridge, address in (
            (f"troupe-c{nth}", "clients", "troupe-clients", self.host),
            (self.store_end, "store", "troupe-store", f"{STORE_NET}.{nth + 11}"),
        ):
            ip("link", "add", end, "type", "veth", "peer", "name", inside, "netns", self.name)
            ip("link", "set", end, "master", bridge, "up")
            ip("-netns", self.name, "address", "add", f"{address}/24", "dev", inside)
            ip("-netns", self.name, "link", "set", inside, "up")

    def cut(self):
        """From now on it does not reach Redis."""
        ip("link", "set", self.store_end, "down")

    def heal(self):
        """It reaches Redis again."""
        ip("link", "set", self.store_end, "up")

    def close(self):
        """Removes it, and its cables with it."""
        ip("netns", "delete", self.name)
