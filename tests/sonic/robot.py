"""A G1 by the written rules of its controller: it reads messages, plays poses at its own clock, and reports each broken rule.

The rules are those of SONIC's deployed controller, measured from its public code: how messages are laid out, how a window joins
the motion that the robot holds, when its playback starts again, and in which mode it takes a start.

    tests/sonic/robot.py PORT...    has robots listen on ports, and prints each second how they are doing
"""

import json
import sys
import time
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import msgpack
import numpy as np
import zmq

HEADER = 1280
CONTROL_S = 0.02
INPUT_S = 0.01
LOOK_AHEAD = 46
HISTORY = 5
MOST_BEHIND = 205
SILENCE_S = 0.15
#: A program that does not hear itself for longer is paused, and cannot say who is silent.
PAUSE_S = 0.1
#: Until the robot's own planner is ready. Its input is not read meanwhile.
PLANNER_S = 0.3
#: No hinge of a G1 turns by more in a tick.
JUMP_RAD = 0.6
DTYPES = {"f32": "<f4", "f64": "<f8", "i32": "<i4", "i64": "<i8", "u8": "u1", "bool": "u1"}
ISAAC = [0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27, 21, 28]


def limits() -> np.ndarray:
    """Lower and upper limits of the hinges in MuJoCo's order, from the pack."""
    pack = tomllib.loads((Path(__file__).parents[2] / "models/g1/pack.toml").read_text())
    return np.array([[hinge["lower_rad"], hinge["upper_rad"]] for hinge in pack["robot"]["hinges"]])


LIMITS = limits()


@dataclass
class Pose:
    """The fields of a window."""

    joint_pos: np.ndarray
    joint_vel: np.ndarray
    body_quat: np.ndarray
    frame_index: np.ndarray


@dataclass
class Robot:
    """One robot. `advance` has it live until a time; `take` gives it a message."""

    #: Whether it plays poses without a command, as with `--input-type zmq`.
    follows: bool = False
    #: The numbers of every window of this count are checked. Each frame is in fifty windows.
    every: int = 1
    violations: list[str] = field(default_factory=list)
    #: Time and largest turn of a hinge in each tick of playback, rad.
    steps: list[tuple[float, float]] = field(default_factory=list)
    #: Times of windows.
    arrivals: list[float] = field(default_factory=list)
    #: Times at which playback started again, apart from the first.
    restarts: int = 0
    #: Ticks in which playback waited for frames.
    waits: int = 0
    #: Most frames that playback was behind the newest window's start.
    behind: int = 0
    started: bool = False
    ended: bool = False
    played: np.ndarray | None = None

    def __post_init__(self):
        """Nothing has come yet."""
        self.inbox: Pose | None = None
        self.command: dict | None = None
        self.length: int | None = None
        self.blocked_until = 0.0
        self.listens_since = 0.0
        self.forget()
        now = time.monotonic()
        self.next_input, self.next_control = now, now

    def forget(self):
        """Holds no motion any more, as after a change of the mode."""
        self.start, self.held, self.cursor = 0, None, 0

    def break_rule(self, what: str):
        """Reports a broken rule."""
        self.violations.append(what)

    # Messages

    def take(self, raw: bytes, now: float):
        """Reads a message that came."""
        for topic in (b"pose", b"command", b"planner"):
            if raw.startswith(topic):
                break
        else:
            self.break_rule(f"topic {raw[:8]!r}")
            return
        fields = self.read(raw[len(topic) :], topic)
        if fields is None:
            return
        if topic == b"command":
            self.take_command(fields)
        elif topic == b"pose":
            self.take_pose(fields, now)

    def read(self, raw: bytes, topic: bytes) -> dict | None:
        """The fields of a message without its topic."""
        head, _, padding = raw[:HEADER].partition(b"\x00")
        if len(raw) < HEADER or padding.strip(b"\x00"):
            self.break_rule(f"{topic!r}: the header is not {HEADER} bytes of JSON and zeros")
            return None
        header = json.loads(head)
        if (header.get("v"), header.get("endian"), header.get("count")) != (1, "le", 1):
            self.break_rule(f"{topic!r}: header {header}")
        fields, at = {}, HEADER
        for one in header["fields"]:
            dtype = np.dtype(DTYPES[one["dtype"]])
            count = int(np.prod(one["shape"]))
            if at + count * dtype.itemsize > len(raw):
                self.break_rule(f"{topic!r}: {one['name']} is cut off")
                return None
            fields[one["name"]] = np.frombuffer(raw, dtype, count, at).reshape(one["shape"])
            at += count * dtype.itemsize
        if at != len(raw):
            self.break_rule(f"{topic!r}: {len(raw) - at} bytes too many")
        return fields

    def take_command(self, fields: dict):
        """Starts and stops add up until the robot reads its input; the newest mode counts."""
        if set(fields) != {"start", "stop", "planner"} or any(value.shape != (1,) for value in fields.values()):
            self.break_rule(f"command with the fields {sorted(fields)}")
            return
        before = self.command or {"start": False, "stop": False}
        self.command = {
            "start": before["start"] or bool(fields["start"][0]),
            "stop": before["stop"] or bool(fields["stop"][0]),
            "planner": bool(fields["planner"][0]),
        }

    def take_pose(self, fields: dict, now: float):
        """Checks a window. The inbox holds one."""
        if self.arrivals:
            silence_s = now - max(self.arrivals[-1], self.listens_since)
            if silence_s > SILENCE_S:
                self.break_rule(f"no pose for {1000 * silence_s:.0f} ms")
        self.arrivals.append(now)
        if set(fields) != {"joint_pos", "joint_vel", "body_quat", "frame_index"}:
            self.break_rule(f"pose with the fields {sorted(fields)}")
            return
        pose = Pose(**fields)
        frames = len(pose.frame_index)
        if frames < LOOK_AHEAD or frames != (self.length or frames):
            self.break_rule(f"a window of {frames} frames")
        self.length = frames
        shapes = [value.shape for value in (pose.joint_pos, pose.joint_vel, pose.body_quat)]
        if shapes != [(frames, 29), (frames, 29), (frames, 4)]:
            self.break_rule(f"shapes {shapes}")
            return
        if (np.diff(pose.frame_index) != 1).any():
            self.break_rule("frame_index does not rise by one")
        self.inbox = pose
        if len(self.arrivals) % self.every == 0:
            self.check_numbers(pose)

    def check_numbers(self, pose: Pose):
        """Checks what the numbers of a window say."""
        if not all(np.isfinite(value).all() for value in (pose.joint_pos, pose.joint_vel, pose.body_quat)):
            self.break_rule("a number that is none")
        if (np.abs(np.linalg.norm(pose.body_quat, axis=1) - 1) > 1e-3).any():
            self.break_rule("a quaternion without unit length")
        if ((pose.body_quat[1:] * pose.body_quat[:-1]).sum(axis=1) < 0).any():
            self.break_rule("a quaternion changes its sign")
        mujoco = np.empty_like(pose.joint_pos)
        mujoco[:, ISAAC] = pose.joint_pos
        if (mujoco < LIMITS[:, 0] - 1e-3).any() or (mujoco > LIMITS[:, 1] + 1e-3).any():
            self.break_rule("a hinge beyond its limits")
        speed = (pose.joint_pos[2:] - pose.joint_pos[:-2]) / (2 * CONTROL_S)
        if (np.abs(speed - pose.joint_vel[1:-1]) > 0.01).any():
            self.break_rule("joint_vel is not the speed of joint_pos")

    # Its own clock

    def advance(self, now: float):
        """Reads input a hundred times a second, and plays fifty times a second."""
        while min(self.next_input, self.next_control) <= now:
            if self.next_input <= self.next_control:
                if self.next_input >= self.blocked_until:
                    self.handle_input(self.next_input)
                self.next_input += INPUT_S
            else:
                self.control(self.next_control)
                self.next_control += CONTROL_S

    def handle_input(self, now: float):
        """What the controller's input thread does."""
        if self.command is not None:
            command, self.command = self.command, None
            self.ended |= command["stop"]
            if command["start"] and not command["planner"]:
                self.break_rule("a start in the mode that does not take one")
            if command["planner"] == self.follows:
                self.follows = not command["planner"]
                self.forget()
                self.inbox = None
            if command["start"] and command["planner"] and not self.started:
                self.started = True
                self.blocked_until = now + PLANNER_S
        if self.follows and self.inbox is not None:
            pose, self.inbox = self.inbox, None
            self.merge(pose)

    def merge(self, pose: Pose):
        """Joins a window to the motion that is held."""
        first, last = int(pose.frame_index[0]), int(pose.frame_index[-1])
        window = np.concatenate([pose.joint_pos, pose.body_quat], axis=1)
        if self.held is None:
            self.start, self.held, self.cursor = first, window, 0
            return
        end = self.start + len(self.held) - 1
        kept = min(self.start + max(0, self.cursor - HISTORY), first)
        why = None
        if first <= self.start:
            why = "begins before what is held"
        elif last <= end:
            why = "ends before what is held"
        elif first > end + 1:
            why = "leaves a gap"
        elif first - kept > MOST_BEHIND:
            why = "is too far ahead"
        if why:
            self.restarts += 1
            self.break_rule(f"playback starts again: {first} to {last} {why}, {self.start} to {end}")
            self.start, self.held, self.cursor = first, window, 0
            return
        self.held = np.concatenate([self.held[kept - self.start : first - self.start], window])
        self.cursor -= kept - self.start
        self.start = kept
        self.behind = max(self.behind, first - (self.start + self.cursor))

    def control(self, now: float):
        """What the controller's loop does, apart from balancing."""
        if self.held is None or not self.follows or self.ended:
            return
        shown = self.held[self.cursor]
        if self.played is not None:
            step = float(np.abs(shown[:29] - self.played[:29]).max())
            self.steps.append((now, step))
            if step > JUMP_RAD:
                self.break_rule(f"a hinge jumps by {step:.2f} rad")
        self.played = shown
        if self.cursor + 1 < len(self.held) - LOOK_AHEAD:
            self.cursor += 1
        else:
            self.waits += 1

    # What tests ask

    def stands_since(self, after: float) -> float | None:
        """The time from which on no hinge moves, if that is so."""
        still = None
        for at, step in self.steps:
            if step > 1e-4:
                still = None
            elif still is None:
                still = max(at, after)
        return still

    def words(self, index: int) -> bytes:
        """What it says of itself."""
        played = np.zeros(33) if self.played is None else self.played
        target = np.empty(29)
        target[ISAAC] = played[:29]
        quat = [1.0, 0.0, 0.0, 0.0] if self.played is None else played[29:].tolist()
        said = {
            "control_loop_type": "cpp",
            "index": index,
            "base_quat": quat,
            "body_q": (target + 0.01).tolist(),
            "body_q_target": target.tolist(),
            "token_state": [],
        }
        return b"g1_debug" + msgpack.packb(said)


class Robots:
    """Robots on this machine, each on its port, and on the next one its words."""

    def __init__(self, ports: list[int], **more):
        self.robots = [Robot(**more) for _ in ports]
        self.context = zmq.Context()
        self.poller = zmq.Poller()
        self.sockets: dict[zmq.Socket, Robot] = {}
        self.words: list[zmq.Socket] = []
        for port, robot in zip(ports, self.robots, strict=True):
            self.connect(port, robot)
            words = self.context.socket(zmq.PUB)
            words.bind(f"tcp://127.0.0.1:{port + 1}")
            self.words.append(words)
        self.next_words, self.index = time.monotonic(), 0
        #: Times in which this program did not hear itself through the same library, seconds.
        self.pauses: list[float] = []
        self.voice, self.ear = self.context.socket(zmq.PUB), self.context.socket(zmq.SUB)
        port = self.voice.bind_to_random_port("tcp://127.0.0.1")
        self.ear.set(zmq.SUBSCRIBE, b"")
        self.ear.connect(f"tcp://127.0.0.1:{port}")
        self.poller.register(self.ear, zmq.POLLIN)
        self.heard = self.next_words

    def connect(self, port: int, robot: Robot):
        """A robot has three sockets, one a topic."""
        for topic in (b"pose", b"command", b"planner"):
            socket = self.context.socket(zmq.SUB)
            socket.set(zmq.LINGER, 0)
            socket.set(zmq.RCVHWM, 3)
            socket.set(zmq.SUBSCRIBE, topic)
            socket.connect(f"tcp://127.0.0.1:{port}")
            self.sockets[socket] = robot
            self.poller.register(socket, zmq.POLLIN)

    def reconnect(self, port: int, robot: Robot):
        """A robot whose link breaks."""
        for socket in [socket for socket, of in self.sockets.items() if of is robot]:
            self.poller.unregister(socket)
            socket.close()
            del self.sockets[socket]
        self.connect(port, robot)

    def live(self, seconds: float, until=lambda: False):
        """Has all robots live for some seconds, or until something is so."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            came = self.poller.poll(5)
            now = time.monotonic()
            if now - self.heard > PAUSE_S:
                for robot in self.robots:
                    robot.listens_since = now
            while self.ear.poll(0):
                self.ear.recv()
                if now - self.heard > PAUSE_S:
                    self.pauses.append(now - self.heard)
                self.heard = now
            for socket, _ in came:
                if socket is self.ear:
                    continue
                robot = self.sockets[socket]
                while socket.poll(0):
                    parts = socket.recv_multipart()
                    now = time.monotonic()
                    if len(parts) != 1:
                        robot.break_rule(f"a message of {len(parts)} parts")
                    robot.advance(now)
                    robot.take(parts[0], now)
            now = time.monotonic()
            for robot in self.robots:
                robot.advance(now)
            if now >= self.next_words:
                self.next_words += CONTROL_S
                self.index += 1
                self.voice.send(b"", zmq.NOBLOCK)
                for socket, robot in zip(self.words, self.robots, strict=True):
                    socket.send(robot.words(self.index), zmq.NOBLOCK)

    @property
    def violations(self) -> list[str]:
        """Broken rules of all, each with its robot."""
        return [f"robot {nth}: {what}" for nth, robot in enumerate(self.robots) for what in robot.violations]

    def close(self):
        """Hangs up."""
        for socket in [*self.sockets, *self.words, self.voice, self.ear]:
            socket.close(linger=0)
        self.context.term()


def main():
    """Robots on the ports of the arguments, until Ctrl-C."""
    ports = [int(port) for port in sys.argv[1:]] or [5556]
    robots = Robots(ports)
    try:
        while True:
            robots.live(1)
            for port, robot in zip(ports, robots.robots, strict=True):
                mode = "follows poses" if robot.follows else "follows its own planner"
                moved = 50 * max([step for _, step in robot.steps[-50:]], default=0)
                print(
                    f"{port}: {len(robot.arrivals)} windows, {mode}, fastest hinge {moved:.1f} rad/s, "
                    f"{len(robot.violations)} broken rules",
                    *robot.violations[-1:],
                )
    except KeyboardInterrupt:
        robots.close()


if __name__ == "__main__":
    main()
