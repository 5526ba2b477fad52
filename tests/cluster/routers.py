"""HAProxy and Envoy as they are configured in deploy/cluster, before servers of the test."""

import shutil
import sys
from pathlib import Path

import yaml
from processes import Process, accepts, free_ports, until

ROOT = Path(__file__).parents[2]
CONFIGURATIONS = ROOT / "deploy/cluster"
NAMES = ("troupe-0:8080", "troupe-1:8080", "troupe-2:8080")
VENV = Path(sys.executable).parent


def haproxy() -> str | None:
    """The program, if it is there."""
    return shutil.which("haproxy") or shutil.which("/usr/sbin/haproxy")


class Router(Process):
    """A router that listens on a port of its own. `servers` has the address of each server by its name."""

    def __init__(self, kind: str, servers: dict[str, str], folder: Path):
        self.kind = kind
        (self.port,) = free_ports(1)
        make = self.of_haproxy if kind == "haproxy" else self.of_envoy
        command, more = make(servers, folder)
        super().__init__(command, folder / f"{kind}.log", more)
        with self.or_end():
            until(lambda: accepts(self.port) or self.process.poll() is not None, f"{kind} listens")
            assert self.process.poll() is None, self.log.read_text()

    def of_haproxy(self, servers: dict[str, str], _folder: Path):
        """Its file as it is: addresses come from the environment."""
        more = {name.upper().replace("-", "_").removesuffix(":8080"): at for name, at in servers.items()}
        more["TROUPE_BIND"] = f"127.0.0.1:{self.port}"
        return [haproxy(), "-f", CONFIGURATIONS / "haproxy.cfg"], more

    def of_envoy(self, servers: dict[str, str], folder: Path):
        """Its file with other addresses."""
        of = yaml.safe_load((CONFIGURATIONS / "envoy.yaml").read_text())
        resources = of["static_resources"]
        resources["listeners"][0]["address"]["socket_address"] = {"address": "127.0.0.1", "port_value": self.port}
        for one in resources["clusters"][0]["load_assignment"]["endpoints"][0]["lb_endpoints"]:
            name = one["metadata"]["filter_metadata"]["envoy.lb"]["server"]
            host, _, port = servers[name].partition(":")
            one["endpoint"]["address"]["socket_address"] = {"address": host, "port_value": int(port)}
        file = folder / "envoy.yaml"
        file.write_text(yaml.safe_dump(of))
        return [VENV / "envoy", "-c", file, "--concurrency", "1", "--use-dynamic-base-id"], {}
