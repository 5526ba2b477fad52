"""The node with Cyclone DDS on the other side, and the server that moves its robots."""

import math
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from node import Node, Ros, Server, Simulator, Watch, free_domain, session_of, wait

ROBOTS = """rate = 50
[[robot]]
name = "left"
start = [0, 1, 0]
[[robot]]
name = "right"
start = [0, -1, 1.5707963]
"""
JOINTS = 29


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.kill()


class Scene:
    """A node, and what its robots publish."""

    def __init__(self, url: str, domain: int, robots: list[str], *arguments):
        self.node = Node(url, domain, *arguments)
        self.ros = Ros(domain, *robots)
        seen = lambda robot: self.ros.joints[robot].all and self.ros.places(robot)  # noqa: E731
        self.wait(lambda: self.ros.matched() and all(seen(robot) for robot in robots), 30)

    def wait(self, what, seconds: float = 20.0):
        wait(what, seconds, lambda: "\n".join([*self.node.said, *self.ros.notes()]))


@pytest.fixture(scope="module")
def scene(server: Server, tmp_path_factory) -> Iterator[Scene]:
    file = tmp_path_factory.mktemp("ros2") / "robots.toml"
    file.write_text(ROBOTS)
    scene = Scene(server.url, free_domain(), ["left", "right"], file)
    yield scene
    scene.node.kill()


def turned(before: float, after: float) -> float:
    return (after - before + math.pi) % (2 * math.pi) - math.pi


def test_robots_stand_where_the_file_says(scene: Scene):
    for robot, wanted in (("left", (0, 1, 0)), ("right", (0, -1, math.pi / 2))):
        x, y, heading = scene.ros.place(robot)
        assert math.dist((x, y), wanted[:2]) < 0.15
        assert abs(turned(wanted[2], heading)) < 0.2
        assert scene.ros.speed(robot) < 0.1
    height = scene.ros.tf.all[-1][1].transforms[0].transform.translation.z
    assert 0.6 < height < 0.9


def test_poses_are_those_of_the_session(server: Server, scene: Scene):
    watch = Watch(server.url, session_of(scene.node, "left"))
    wait(lambda: watch.rows)
    heard, tf = scene.ros.joints["left"], scene.ros.tf
    heard.all.clear()
    tf.all.clear()
    scene.ros.drive_for(3, "left", 0.6)
    states, transforms, rows = list(heard.all), list(tf.all), list(watch.rows)

    # The rate, and how long a pose is under way.
    stamps = np.array([state.header.stamp.seconds for _, state in states])
    rate = (len(stamps) - 1) / (stamps[-1] - stamps[0])
    assert 40 < rate < 52
    late_s = np.array([came for came, _ in states]) - stamps
    assert np.median(late_s) < 0.05

    names = states[0][1].name
    assert len(names) == JOINTS
    assert names[:2] == ["left_hip_pitch_joint", "left_hip_roll_joint"]
    # Every pose is one that the server sent, to the bit. Each robot has a stream of its own.
    sent = {tuple(np.float32(row[7:])): row for _, row in rows}
    known = [sent.get(tuple(np.float32(state.position))) for _, state in states]
    found = [row for row in known if row is not None]
    assert len(found) > 0.9 * len(states)
    assert all(row is not None for row in known[10:-10])

    # So is the place, whose quaternion has its w at the end.
    by_stamp = {
        one.header.stamp.seconds: one.transform
        for _, message in transforms
        for one in message.transforms
        if one.child_frame_id == "left/pelvis" and one.header.frame_id == "odom"
    }
    for (_, state), row in zip(states, known, strict=True):
        of = by_stamp.get(state.header.stamp.seconds)
        if row is None or of is None:
            continue
        at, turn = of.translation, of.rotation
        root = np.float32([at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z])
        assert root.tolist() == np.float32(row[:7]).tolist()

    # Velocities are differences, of frames that follow each other by 20 ms.
    angles = np.array([state.position for _, state in states])
    speeds = np.array([state.velocity for _, state in states])
    wanted = np.diff(angles, axis=0) * 50
    near = np.abs(speeds[1:] - wanted).max(axis=1) < 1e-3
    assert near.mean() > 0.9
    assert np.abs(speeds).max() > 0.5


def test_twist_moves_a_robot_in_its_own_frame_until_silence(scene: Scene):
    scene.wait(lambda: scene.ros.speed("left") < 0.05, 4)
    before, still = scene.ros.place("right"), scene.ros.place("left")
    scene.ros.drive_for(2.5, "right", 0.8)
    x, y, heading = scene.ros.place("right")
    # It faces along +Y.
    assert y - before[1] > 1.0
    assert abs(x - before[0]) < 0.3
    assert abs(turned(before[2], heading)) < 0.3
    assert math.dist(scene.ros.place("left")[:2], still[:2]) < 0.1, "the other one stands"
    scene.wait(lambda: scene.ros.speed("right") < 0.05, 4)

    scene.ros.drive_for(3, "right", 0.0, 0.0, 0.5)
    time.sleep(1)
    assert turned(heading, scene.ros.place("right")[2]) == pytest.approx(1.5, abs=0.5)


def test_a_path_is_followed_in_odom(scene: Scene):
    x, y, _ = scene.ros.place("left")
    goal = (x + 1.2, y + 0.8)
    scene.ros.follow("left", (x, y), (x + 0.8, y), goal, frame="map")
    scene.wait(lambda: any("path: its frame is" in note for note in scene.ros.notes()), 3)
    scene.ros.follow("left", (x, y), (x + 0.8, y), goal)
    scene.wait(lambda: any(note.startswith("left.troupe: arrived") for note in scene.ros.notes()), 15)
    assert math.dist(scene.ros.place("left")[:2], goal) < 0.25
    assert not any(note.startswith("right.troupe: arrived") for note in scene.ros.notes())


def test_words_and_styles_that_cannot_be_are_noted(scene: Scene):
    scene.ros.say("left", "say", "a person waves")
    scene.wait(lambda: any(note.startswith("left.troupe: refused: ") for note in scene.ros.notes()), 5)
    scene.ros.say("left", "style", "no-such")
    scene.wait(lambda: any('style is "no-such"; allowed: ' in note for note in scene.ros.notes()), 5)
    scene.wait(lambda: scene.ros.speed("left") < 0.05, 4)


def test_stamps_go_by_the_simulators_clock(server: Server):
    domain = free_domain() + 1
    node = Node(server.url, domain, "--robot", "sim", "--use-sim-time", "--rate", "30")
    try:
        ros = Ros(domain, "sim")
        clock, heard = Simulator(ros), ros.joints["sim"]
        wait(lambda: ros.matched() and clock.writer.get_matched_subscriptions(), 30, lambda: "\n".join(node.said))
        time.sleep(0.5)
        assert not heard.all, "there is no time yet"
        for nth in range(100):
            clock.tell(1000 + nth * 0.01)
            time.sleep(0.01)
        stamps = [state.header.stamp.seconds for _, state in heard.all]
        assert len(stamps) > 15
        assert all(1000 <= stamp <= 1001 for stamp in stamps)
        assert stamps == sorted(set(stamps))
        time.sleep(0.3)
        count = len(heard.all)
        time.sleep(0.3)
        assert len(heard.all) == count, "time stands still"
    finally:
        node.kill()


def test_a_lost_server_has_the_robot_hold_until_it_is_back(tmp_path: Path):
    servers = [Server()]
    scene = Scene(servers[0].url, free_domain() + 2, ["g1"])
    try:
        scene.ros.drive_for(1.5, "g1", 0.8)
        assert scene.ros.speed("g1") > 0.3
        servers[0].kill()
        again = threading.Thread(target=lambda: servers.append(Server(servers[0].port)))
        again.start()
        scene.wait(lambda: any("holds its pose" in note for note in scene.ros.notes()), 3)
        heard = scene.ros.joints["g1"]
        time.sleep(0.5)
        (_, first), (last, held) = heard.all[-15], heard.all[-1]
        assert time.time() - last < 0.1
        assert first.position == held.position
        assert set(held.velocity) == {0.0}
        place = scene.ros.place("g1")
        again.join()
        scene.wait(lambda: any("frames come again" in note for note in scene.ros.notes()), 30)
        time.sleep(0.5)
        assert math.dist(scene.ros.place("g1")[:2], place[:2]) < 0.3
        scene.ros.drive_for(1.5, "g1", 0.8)
        assert scene.ros.speed("g1") > 0.3
    finally:
        scene.node.kill()
        servers[-1].kill()


def is_there(server: Server, session: str) -> bool:
    try:
        with urllib.request.urlopen(f"{server.url}/v1/sessions/{session}"):
            return True
    except urllib.error.HTTPError as error:
        return error.code not in (404, 410)


def test_ctrl_c_ends_the_node_and_its_sessions(server: Server):
    scene = Scene(server.url, free_domain() + 3, ["g1"])
    session = session_of(scene.node, "g1")
    assert is_there(server, session)
    since = time.monotonic()
    assert scene.node.end() == 0
    assert time.monotonic() - since < 3
    assert not is_there(server, session)


@pytest.mark.parametrize(
    ("robot", "why"), [("a:no-such", "no-such"), ("a:g1/h9", "h9"), ("a-b", "letters, digits and single _")]
)
def test_a_robot_that_cannot_be_is_named(server: Server, robot: str, why: str):
    node = Node(server.url, free_domain() + 4, "--robot", robot)
    assert node.wait() != 0
    assert why in "\n".join(node.said)
