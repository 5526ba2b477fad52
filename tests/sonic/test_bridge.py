"""The bridge with robots that follow the written rules, and report each broken one."""

import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from robot import Robots
from sides import Bridge, Server, free_ports

ROUTE = "route = [[0, 0], [2, 0], [2, 2], [0, 2]]\nspeed = 0.8\nloop = true"


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.signal(signal.SIGCONT)
    server.kill()


class Scene:
    """A bridge and its robots."""

    def __init__(self, server: Server, folder: Path, count: int, **more):
        self.ports = free_ports(count)
        self.bridge = Bridge(server.url, self.ports, folder, ROUTE)
        self.robots = Robots(self.ports, **more)
        self.all = self.robots.robots

    def live(self, seconds: float, until=lambda: False):
        assert self.bridge.process.poll() is None, "\n".join(self.bridge.said)
        self.robots.live(seconds, until)

    def until(self, what, seconds: float = 60):
        """Lives until something is so for all robots."""
        self.live(seconds, lambda: all(what(robot) for robot in self.all))
        assert all(what(robot) for robot in self.all), "\n".join([*self.bridge.said, *self.robots.violations[:5]])

    def begin(self):
        """All are connected, have been started, and follow poses."""
        self.until(lambda robot: len(robot.arrivals) > 10)
        self.bridge.order("start")
        self.until(lambda robot: robot.started and robot.follows and len(robot.steps) > 20)

    def moves(self):
        """All move."""
        self.until(lambda robot: max(step for _, step in robot.steps[-25:]) > 0.02)

    def assert_stands_within(self, seconds: float, since: float):
        self.live(2.5)
        for robot in self.all:
            still = robot.stands_since(since)
            assert still is not None, "it moves still"
            assert still - since <= seconds, f"it stands after {still - since:.2f} s"

    def end(self) -> dict:
        return self.bridge.end(lambda: self.robots.live(2.2))

    def close(self):
        self.bridge.kill()
        self.robots.close()


@pytest.fixture
def scene(server: Server, tmp_path: Path, request) -> Iterator[Scene]:
    count, more = getattr(request, "param", (2, {}))
    scene = Scene(server, tmp_path, count, **more)
    yield scene
    scene.close()


@pytest.mark.parametrize("scene", [(3, {})], indirect=True)
def test_robots_walk_by_orders_and_no_rule_is_broken(scene):
    scene.begin()
    assert all(step == 0 for robot in scene.all for _, step in robot.steps), "they stand until an order"
    scene.bridge.order("walk 0.8 0")
    scene.moves()
    scene.live(2)
    scene.bridge.order("r0,r2 style slow", "r1 walk 0.3 0.3 90", "r0 fly", "r9 stop")
    scene.live(2)
    scene.bridge.order("path 0,0 3,0 3,2")
    scene.live(2)
    scene.bridge.order("go")
    scene.live(3)
    since = scene.bridge.order("stop")
    scene.assert_stands_within(1.0, since)
    figures = scene.end()
    assert scene.robots.violations == []
    assert len(figures["robots"]) == 3
    for robot, figure in zip(scene.all, figures["robots"], strict=True):
        assert robot.restarts == 0
        assert figure["times_late"] == 0
        assert figure["windows"] >= len(robot.arrivals) > 500
        assert figure["feedback"]["messages"] > 200
        assert figure["feedback"]["off_rad"] == pytest.approx(0.01, abs=1e-4)
        assert figure["feedback"]["tilt_rad"] < 0.3
    said = "\n".join(scene.bridge.said)
    for wanted in ('"r0 fly" is no order', 'there is no robot "r9"', "r1: connected, moves"):
        assert wanted in said, said


def test_a_robot_that_only_listens_to_poses_follows_them(server, tmp_path):
    scene = Scene(server, tmp_path, 1, follows=True)
    try:
        scene.until(lambda robot: len(robot.steps) > 20)
        scene.bridge.order("walk 0.6 0")
        scene.moves()
        # Its link breaks for a moment.
        scene.robots.reconnect(scene.ports[0], scene.all[0])
        scene.live(2)
        assert scene.robots.violations == []
        scene.bridge.order("end")
        scene.until(lambda robot: robot.ended)
    finally:
        scene.close()


def test_a_late_server_ends_in_standing(scene, server):
    scene.begin()
    scene.bridge.order("walk 1 0")
    scene.moves()
    scene.live(1)
    server.signal(signal.SIGSTOP)
    since = scene.bridge.order("# the server says nothing any more")
    scene.assert_stands_within(1.0, since)
    scene.bridge.order("walk 1 0")
    scene.live(0.5)
    server.signal(signal.SIGCONT)
    scene.live(2)
    assert all(step == 0 for robot in scene.all for _, step in robot.steps[-20:]), "they stand until a new order"
    scene.bridge.order("walk 0.5 0")
    scene.moves()
    scene.live(1)
    figures = scene.end()
    assert scene.robots.violations == []
    assert all(figure["times_late"] == 1 for figure in figures["robots"])
    assert "r0: the server does not answer, so it stands" in "\n".join(scene.bridge.said)


def test_a_lost_server_ends_in_standing(tmp_path):
    servers = [Server()]
    scene = Scene(servers[0], tmp_path, 2)
    try:
        scene.begin()
        scene.bridge.order("go")
        scene.moves()
        scene.live(1)
        servers[0].kill()
        since = scene.bridge.order("# the server is gone")
        scene.assert_stands_within(1.0, since)
        again = threading.Thread(target=lambda: servers.append(Server(servers[0].port)))
        again.start()
        scene.live(60, lambda: len(servers) == 2)
        scene.live(3)
        scene.bridge.order("walk 0.5 0")
        scene.moves()
        scene.live(1)
        scene.end()
        assert scene.robots.violations == []
        assert "no Troupe server answers" in "\n".join(scene.bridge.said)
    finally:
        scene.close()
        servers[-1].kill()


def test_what_cannot_be_is_said(server, tmp_path):
    ports = free_ports(1)
    robots = Robots(ports, follows=True)
    try:
        bridge = Bridge(server.url, ports, tmp_path, 'style = "no-such"')
        assert bridge.wait() == 4
        assert "no-such" in bridge.said[-1], bridge.said
    finally:
        robots.close()
