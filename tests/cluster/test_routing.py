"""The rules of deploy/cluster, in HAProxy and Envoy as they run: which server gets what, and what changes if one goes."""

import signal
import subprocess
import sys
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
from processes import START_S, Process, accepts, free_ports, until
from routers import CONFIGURATIONS, NAMES, VENV, Router, haproxy
from websockets.sync.client import connect

SESSIONS = [f"hero-{nth}" for nth in range(90)]
CALL = "/troupe.v1.Sessions/Command"
# Servers of the sessions by HAProxy: with all three, and without the second. The router's model in
# live/src/records/shared/simulation/ring.rs is compared with the same lines.
PLACES = (Path(__file__).parent / "haproxy-places.txt").read_text().split()


class Cluster:
    """Three servers that say their names, and a router."""

    def __init__(self, kind: str, folder: Path):
        self.parts = ExitStack()
        try:
            self.begin(kind, folder)
        except BaseException:
            self.stop()
            raise

    def begin(self, kind: str, folder: Path):
        """Starts all of it."""
        ports = dict(zip(NAMES, free_ports(3), strict=True))
        self.servers: dict[str, Process] = {}
        for name, port in ports.items():
            command = [sys.executable, Path(__file__).parent / "stub.py", name, str(port)]
            self.servers[name] = Process(command, folder / "stub.log")
            self.parts.callback(self.servers[name].kill)
        for name, port in ports.items():
            until(lambda port=port: accepts(port), f"{name} listens")
        self.router = Router(kind, {name: f"127.0.0.1:{port}" for name, port in ports.items()}, folder)
        self.parts.callback(self.router.kill)
        self.base = f"http://127.0.0.1:{self.router.port}"
        self.http1 = self.parts.enter_context(httpx.Client(base_url=self.base, trust_env=False, timeout=START_S))
        self.http2 = self.parts.enter_context(
            httpx.Client(base_url=self.base, trust_env=False, timeout=START_S, http1=False, http2=True)
        )
        until(lambda: self.seen() == set(NAMES), "all three serve")

    def seen(self) -> set[str]:
        """The servers that answer requests without a key: at random, so it asks often."""
        return {self.http1.get("/v1/packs").json().get("server") for _ in range(40)} if self.answers() else set()

    def answers(self) -> bool:
        """Whether any server is up."""
        return self.http1.get("/v1/packs").status_code == 200

    def call(self, **headers: str) -> httpx.Response:
        """A call by its headers. gRPC's shortest message has five bytes; HAProxy 2.6 may stall on a POST that has none."""
        named = {f"troupe-{key}": value for key, value in headers.items()} | {"content-type": "application/grpc"}
        return self.http2.post(CALL, headers=named, content=bytes(5))

    def grpc(self, **headers: str) -> str:
        """The server of a call, by its headers."""
        return self.call(**headers).json()["server"]

    def places(self) -> dict[str, str]:
        """The server of each session."""
        return {name: self.grpc(session=name) for name in SESSIONS}

    def stop(self):
        """Ends all."""
        self.parts.close()


@pytest.fixture(params=["haproxy", "envoy"])
def cluster(request, tmp_path):
    """A cluster behind a router."""
    if request.param == "haproxy" and not haproxy():
        pytest.skip("*** HAPROXY IS NOT TESTED: it is not installed")
    of = Cluster(request.param, tmp_path)
    yield of
    of.stop()


def test_a_session_has_one_server_however_it_is_named(cluster):
    places = cluster.places()
    shares = Counter(places.values())
    assert set(shares) == set(NAMES)
    assert min(shares.values()) >= len(SESSIONS) / 6, shares
    for name in SESSIONS[:20]:
        by_header = cluster.http1.post("/v1/step", headers={"troupe-session": name}, json={})
        by_path = cluster.http1.get(f"/v1/sessions/{name}")
        peek = cluster.http1.get(f"/v1/sessions/{name}/peek?frames=3")
        with connect(f"ws{cluster.base[4:]}/v1/drive?ticket=1&session={name}") as socket:
            by_query = socket.recv()
        named = {by_header.json()["server"], by_path.json()["server"], peek.json()["server"], by_query}
        assert named == {places[name]}, name
        assert cluster.grpc(session=name) == places[name]


def test_a_scene_counts_more_than_a_session(cluster):
    of_scene = cluster.grpc(scene="yard")
    assert {cluster.grpc(scene="yard", session=name) for name in SESSIONS[:30]} == {of_scene}
    assert cluster.http1.get("/v1/scenes/yard").json()["server"] == of_scene
    assert cluster.http1.post("/v1/scenes/yard/move", json={}).json()["server"] == of_scene
    with connect(f"ws{cluster.base[4:]}/v1/drive?session=hero-1&scene=yard") as socket:
        assert socket.recv() == of_scene
    assert len({cluster.grpc(scene=f"yard-{nth}") for nth in range(30)}) == 3


def test_grpc_stays_http2_and_the_viewer_http1_is_served_too(cluster):
    assert cluster.call(session="a").json()["protocol"] == "2"
    assert cluster.http1.get("/viewer").status_code == 200


def test_requests_without_state_go_anywhere(cluster):
    for path in ("/v1/inbetween", "/v1/sessions", "/v1/sessions/resume", "/troupe.v1.Motion/InBetween"):
        assert {cluster.http1.post(path, json={}).json()["server"] for _ in range(40)} == set(NAMES), path


def test_the_server_that_an_error_names_gets_the_next_call(cluster):
    for server in NAMES:
        assert {cluster.grpc(session=name, server=server) for name in SESSIONS[:5]} == {server}
        assert cluster.grpc(scene="yard", server=server) == server
        with connect(f"ws{cluster.base[4:]}/v1/drive?session=hero-1&server={server}") as socket:
            assert socket.recv() == server
    # A name that no server has changes nothing.
    assert cluster.grpc(session="hero-1", server="other:1") == cluster.grpc(session="hero-1")


def test_only_the_sessions_of_a_dead_server_move_and_they_come_back(cluster):
    before = cluster.places()
    dead = NAMES[1]
    cluster.servers[dead].kill()

    def during():
        """Places without the dead server, once the router knows."""
        try:
            places = cluster.places()
        except ValueError:  # An answer of the router itself.
            return None
        return places if dead not in places.values() else None

    places = until(during, "its sessions move")
    moved = {name for name in SESSIONS if places[name] != before[name]}
    of_dead = {name for name in SESSIONS if before[name] == dead}
    if cluster.router.kind == "haproxy":
        assert moved == of_dead
        lines = ["".join(str(NAMES.index(of[name])) for name in SESSIONS) for of in (before, places)]
        assert lines == PLACES
    else:
        # Envoy gives the servers that are left more places on its ring, so some others move, too.
        assert of_dead <= moved
        assert len(moved - of_dead) <= len(SESSIONS) / 4
    # They are spread over the others.
    assert {places[name] for name in moved} == set(NAMES) - {dead}
    cluster.servers[dead].start()
    until(lambda: cluster.places() == before, "they come back", 60)


def test_a_server_that_stops_gets_nothing_new_and_keeps_its_streams(cluster):
    stops = NAMES[2]
    name = next(name for name, place in cluster.places().items() if place == stops)
    with connect(f"ws{cluster.base[4:]}/v1/drive?session={name}") as socket:
        assert socket.recv() == stops
        cluster.servers[stops].send(signal.SIGUSR1)
        until(lambda: stops not in cluster.places().values(), "nothing new")
        assert stops not in cluster.seen()
        socket.send("still there?")
        assert socket.recv() == stops


def test_configurations_are_valid_as_they_are():
    subprocess.run([VENV / "envoy", "--mode", "validate", "-c", CONFIGURATIONS / "envoy.yaml"], check=True)
    if haproxy():
        subprocess.run([haproxy(), "-c", "-f", CONFIGURATIONS / "haproxy.cfg"], check=True)
