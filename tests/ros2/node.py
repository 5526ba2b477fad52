"""`troupe-ros2` as a process, another DDS implementation on the other side, and a server between them."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path as File

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from messages import (
    Clock,
    Header,
    JointState,
    Log,
    Path,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    TFMessage,
    Time,
    Twist,
    Vector3,
)
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

sys.path.append(str(File(__file__).parents[1] / "sonic"))
from sides import BUILD, READY_S, Server

__all__ = ["READY_S", "Node", "Ros", "Server", "Simulator", "Watch", "free_domain", "session_of", "wait"]

RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100))
LOOPBACK = """<CycloneDDS><Domain Id="any">
  <General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>30</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""


def free_domain() -> int:
    """A domain that other tests on this machine hardly use."""
    return 1 + os.getpid() % 90


class Node:
    """`troupe-ros2` on this machine alone."""

    def __init__(self, url: str, domain: int, *arguments: str | File):
        self.process = subprocess.Popen(
            [BUILD / os.environ.get("TROUPE_ROS2", "troupe-ros2-under-test"), "--server", url, *arguments],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            stderr=subprocess.PIPE,
            text=True,
        )
        self.said: list[str] = []
        self.listener = threading.Thread(target=self.listen, daemon=True)
        self.listener.start()

    def listen(self):
        """Keeps its notes."""
        for line in self.process.stderr:
            self.said.append(line.rstrip())

    def end(self) -> int:
        """Presses Ctrl-C, and gives the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.wait()

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


class Heard:
    """A topic and what came over it, with the times at which it came."""

    def __init__(self, participant: DomainParticipant, name: str, kind: type):
        self.all: list[tuple[float, object]] = []
        self.reader = DataReader(participant, Topic(participant, name, kind), qos=RELIABLE)
        threading.Thread(target=self.take, daemon=True).start()

    def take(self):
        """Takes messages as they come."""
        for message in self.reader.take_iter(timeout=duration(seconds=READY_S * 10)):
            self.all.append((time.time(), message))


class Ros:
    """What hears and orders robots: Cyclone DDS on the loopback interface."""

    def __init__(self, domain: int, *robots: str):
        self.domain = Domain(domain, LOOPBACK)
        self.participant = DomainParticipant(domain)
        self.joints = {robot: self.heard(f"rt/{robot}/joint_states", JointState) for robot in robots}
        self.tf = self.heard("rt/tf", TFMessage)
        self.log = self.heard("rt/rosout", Log)
        orders = {"cmd_vel": Twist, "path": Path, "say": String, "style": String}
        self.writers = {
            (robot, name): self.writer(f"rt/{robot}/{name}", kind) for robot in robots for name, kind in orders.items()
        }

    def heard(self, name: str, kind: type) -> Heard:
        """Listens to a topic."""
        return Heard(self.participant, name, kind)

    def writer(self, name: str, kind: type) -> DataWriter:
        """Speaks on a topic."""
        return DataWriter(self.participant, Topic(self.participant, name, kind), qos=RELIABLE)

    def matched(self) -> bool:
        """Whether a node hears all orders."""
        return all(writer.get_matched_subscriptions() for writer in self.writers.values())

    def drive(self, robot: str, ahead: float, left: float = 0.0, turn: float = 0.0):
        """Gives a velocity once."""
        twist = Twist(Vector3(ahead, left, 0.0), Vector3(0.0, 0.0, turn))
        self.writers[robot, "cmd_vel"].write(twist)

    def drive_for(self, seconds: float, robot: str, *velocity: float):
        """Gives a velocity ten times a second."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.drive(robot, *velocity)
            time.sleep(0.1)

    def follow(self, robot: str, *places: tuple[float, float], frame: str = "odom"):
        """Gives a path."""
        poses = [PoseStamped(Header(Time(), ""), Pose(Point(x, y, 0.0), Quaternion())) for x, y in places]
        self.writers[robot, "path"].write(Path(Header(Time(), frame), poses))

    def say(self, robot: str, topic: str, text: str):
        """Gives a sentence or a style."""
        self.writers[robot, topic].write(String(text))

    def places(self, robot: str) -> list[tuple[float, float, float, float]]:
        """Stamp, X, Y and heading of the poses so far."""
        found = []
        for _, message in list(self.tf.all):
            for one in message.transforms:
                if one.child_frame_id == f"{robot}/pelvis":
                    at, turn = one.transform.translation, one.transform.rotation
                    heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
                    found.append((one.header.stamp.seconds, at.x, at.y, heading))
        return found

    def place(self, robot: str) -> tuple[float, float, float]:
        """X, Y and heading now."""
        return self.places(robot)[-1][1:]

    def notes(self) -> list[str]:
        """What robots noted, with their names."""
        return [f"{message.name}: {message.msg}" for _, message in list(self.log.all)]

    def speed(self, robot: str, seconds: float = 0.5) -> float:
        """Metres a second over the ground, over the last moment."""
        places = self.places(robot)
        last = places[-1]
        first = next(place for place in places if place[0] >= last[0] - seconds)
        return math.dist(first[1:3], last[1:3]) / max(last[0] - first[0], 1e-9)


class Watch:
    """A session as the server sends it, over a WebSocket."""

    def __init__(self, url: str, session: str):
        self.rows: list[tuple[float, list[float]]] = []
        self.address = f"{url.replace('http', 'ws')}/v1/drive"
        threading.Thread(target=self.take, args=(session,), daemon=True).start()

    def take(self, session: str):
        """Keeps the `qpos` of each frame, with the time at which it came."""
        # The server may end first.
        with suppress(ConnectionClosed), connect(self.address) as socket:
            socket.send(json.dumps({"open": {"watch": session}}))
            for text in socket:
                for block in json.loads(text).get("frames", {}).get("blocks", []):
                    self.rows.append((time.time(), block["qpos"]))


class Simulator:
    """A clock that others go by."""

    def __init__(self, ros: Ros):
        self.writer = ros.writer("rt/clock", Clock)

    def tell(self, seconds: float):
        """Gives the time."""
        whole = int(seconds)
        self.writer.write(Clock(Time(whole, round((seconds - whole) * 1e9))))


def session_of(node: Node, robot: str) -> str:
    """Id of a robot's session, as the node noted it last."""
    found = [re.search(rf" {robot}: session (\S+) on", line) for line in node.said]
    return next(match[1] for match in reversed(found) if match)


def wait(what, seconds: float = 20.0, why=lambda: ""):
    """Waits until something is so."""
    until = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until, why()
        time.sleep(0.02)
