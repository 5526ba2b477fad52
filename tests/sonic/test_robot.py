"""The stand-in itself: a stream by the rules breaks none, and each fault is reported."""

import json

import numpy as np
import pytest
from robot import ISAAC, LIMITS, Robot

FRAMES = 50
MIDDLE = LIMITS.mean(axis=1)[ISAAC]


def frames(first: int, count: int = FRAMES) -> dict:
    """A window of a motion that swings all hinges."""
    time_s = np.arange(first - 1, first + count + 1)[:, None] / 50
    angles = (MIDDLE + 0.1 * np.sin(5 * time_s)).astype(np.float32)
    quat = np.zeros((count, 4), np.float32)
    quat[:, 0] = 1
    return {
        "joint_pos": angles[1:-1],
        "joint_vel": ((angles[2:] - angles[:-2]) * 25).astype(np.float32),
        "body_quat": quat,
        "frame_index": np.arange(first, first + count, dtype=np.int64),
    }


def message(topic: bytes, fields: dict, header: int = 1280) -> bytes:
    names = {"float32": "f32", "int64": "i64", "uint8": "u8"}
    described = [{"name": n, "dtype": names[v.dtype.name], "shape": list(v.shape)} for n, v in fields.items()]
    head = json.dumps({"v": 1, "endian": "le", "count": 1, "fields": described}).encode()
    return topic + head.ljust(header, b"\x00") + b"".join(value.tobytes() for value in fields.values())


class Stream:
    """Windows to a robot, fifty a second of its own time."""

    def __init__(self):
        self.robot = Robot(follows=True)
        self.now = self.robot.next_control

    def send(self, first: int, **changes):
        self.now += 0.02
        self.robot.advance(self.now)
        self.robot.take(message(b"pose", {**frames(first), **changes}), self.now)

    def send_all(self, first: int, last: int):
        for index in range(first, last):
            self.send(index)


@pytest.fixture
def stream() -> Stream:
    stream = Stream()
    stream.send_all(1, 120)
    assert stream.robot.violations == []
    assert len(stream.robot.steps) > 100
    return stream


def test_windows_by_the_rules_are_played(stream):
    assert stream.robot.waits <= 2
    assert stream.robot.behind <= 2
    assert max(step for _, step in stream.robot.steps) < 0.02
    assert stream.robot.stands_since(stream.now) is None


def test_the_last_frames_are_held(stream):
    stream.robot.advance(stream.now + 5)
    assert stream.robot.stands_since(stream.now) == pytest.approx(stream.now, abs=0.2)


@pytest.mark.parametrize(
    ("first", "wanted"), [(1, "begins before"), (118, "ends before"), (119, "ends before"), (300, "leaves a gap")]
)
def test_windows_that_start_playback_again_are_reported(stream, first, wanted):
    stream.send(first)
    stream.robot.advance(stream.now + 0.05)
    assert wanted in stream.robot.violations[0]
    assert stream.robot.restarts == 1


def test_a_robot_that_is_far_behind_is_reported(stream):
    for index in range(120, 340):
        stream.robot.take(message(b"pose", frames(index)), stream.now)
        stream.robot.handle_input(stream.now)
    assert "too far ahead" in stream.robot.violations[0]


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        (frames(120, 45), "window of 45 frames"),
        (frames(120, 60), "window of 60 frames"),
        ({"body_quat": np.ones((FRAMES, 4), np.float32)}, "unit length"),
        ({"joint_pos": np.full((FRAMES, 29), np.nan, np.float32)}, "a number that is none"),
        ({"joint_vel": np.ones((FRAMES, 29), np.float32)}, "not the speed"),
        ({"joint_pos": frames(120)["joint_pos"][:, ISAAC]}, "beyond its limits"),
        ({"frame_index": np.full(FRAMES, 120, np.int64)}, "does not rise"),
        ({"more": np.ones(1, np.float32)}, "pose with the fields"),
    ],
)
def test_odd_windows_are_reported(stream, changes, wanted):
    stream.send(120, **changes)
    assert any(wanted in what for what in stream.robot.violations), stream.robot.violations


def test_silence_and_odd_messages_are_reported(stream):
    stream.now += 0.2
    stream.send(120)
    robot = stream.robot
    assert "no pose for 220 ms" in robot.violations[-1]
    robot.take(b"other", stream.now)
    assert "topic" in robot.violations[-1]
    robot.take(message(b"pose", frames(121), header=1024), stream.now)
    assert "the header is not 1280" in robot.violations[-1]
    robot.take(message(b"pose", frames(121)) + b"x", stream.now)
    assert any("1 bytes too many" in what for what in robot.violations)
    jump = frames(122)["joint_pos"] + np.float32(0.7)
    stream.send(122, joint_pos=jump)
    stream.robot.advance(stream.now + 0.1)
    assert "a hinge jumps" in robot.violations[-1]


def command(start: int, stop: int, planner: int) -> bytes:
    fields = {"start": start, "stop": stop, "planner": planner}
    return message(b"command", {name: np.array([value], np.uint8) for name, value in fields.items()})


def test_a_start_counts_in_the_planners_mode_alone():
    robot = Robot()
    now = robot.next_input
    robot.take(command(1, 0, 1), now)
    robot.advance(now + 0.5)
    assert robot.started and not robot.follows
    robot.take(command(0, 0, 0), now + 0.5)
    robot.advance(now + 0.6)
    assert robot.follows and robot.violations == []
    robot.take(command(0, 1, 0), now + 0.6)
    robot.advance(now + 0.7)
    assert robot.ended

    hasty = Robot()
    hasty.take(command(1, 0, 1), now)
    hasty.take(command(0, 0, 0), now)
    hasty.advance(now + 0.5)
    assert not hasty.started and "a start in the mode" in hasty.violations[0]
