"""The Python servers' code: bodies, and that a row's answer does not hang on the rows beside it."""

import numpy as np
import pytest

from troupe_bench.body import ANSWER, REQUEST, Task, read_task
from troupe_bench.machine import ROOT
from troupe_bench.stages import Solved, Stages, slots_of

WIDTH = 21 * 9
COUNTS = 14


def body(frames: int, targets: int = 1, speed: float = 0.04) -> bytes:
    """A straight walk of neutral poses, as the Rust program writes requests."""
    keys = 4 + targets
    at = np.r_[:4, frames - targets : frames] - 3
    given = np.ones((keys, 3), "<f4")
    local = np.tile(np.float32([0, 30 * speed, 0, 0.9]), (keys, 1))
    root = np.tile(np.float32([0, 0.9, 0, 1, 0]), (keys, 1))
    root[:, 2] = at * speed
    pose = np.full((keys, WIDTH), 0.1, "<f4")
    allowed = 1 << (-(-frames // 4) - 3)
    header = REQUEST.pack(b"TBQ1", frames, targets, allowed)
    return header + b"".join(column.astype("<f4").tobytes() for column in (given, local, root, pose))


@pytest.fixture(scope="module")
def stages() -> Stages:
    return Stages(ROOT / "models" / "human", "cpu", 1)


def test_a_body_is_read_as_it_was_written():
    task = read_task(body(30, 2), WIDTH)
    assert (task.frames, task.targets, task.allowed) == (30, 2, 1 << 5)
    assert task.pose.shape == (6, WIDTH) and task.given.all()
    np.testing.assert_allclose(task.global_root[:, 2], np.float32([-3, -2, -1, 0, 25, 26]) * 0.04, atol=1e-6)


@pytest.mark.parametrize("broken", [b"", b"TBQ1", body(30)[:-1], b"X" + body(30)[1:], body(30) + b"\0"])
def test_what_is_no_request_is_refused(broken: bytes):
    with pytest.raises(ValueError, match="body"):
        read_task(broken, WIDTH)


def test_targets_take_the_last_slots_and_what_lies_too_far_ahead_of_the_end_has_none():
    slots, keys = slots_of(0, 2)
    assert (slots.tolist(), keys.tolist()) == ([0, 1, 2, 3, 6, 7], [0, 1, 2, 3, 4, 5])
    slots, keys = slots_of(3, 2)  # three frames behind the last target: the first target has no slot left
    assert (slots.tolist(), keys.tolist()) == ([0, 1, 2, 3, 4], [0, 1, 2, 3, 5])


def test_a_row_does_not_hang_on_its_neighbours(stages: Stages):
    tasks = [read_task(body(frames, speed=frames / 1000), WIDTH) for frames in (64, 30, 12, 33, 64)]
    together = stages.solve(tasks)
    for task, ours in zip(tasks, together, strict=True):
        alone = stages.solve([task])[0]
        assert len(ours.tokens) == -(-task.frames // 4) and len(ours.root) == task.frames
        np.testing.assert_array_equal(ours.tokens, alone.tokens)
        np.testing.assert_allclose(ours.rotations, alone.rotations, atol=1e-5)


def test_padding_to_the_longest_gives_the_same(stages: Stages):
    tasks = [read_task(body(frames), WIDTH) for frames in (12, 40, 64)]
    grouped = stages.solve(tasks)
    stages.group = False
    try:
        padded = stages.solve(tasks)
    finally:
        stages.group = True
    for a, b in zip(grouped, padded, strict=True):
        np.testing.assert_allclose(a.rotations, b.rotations, atol=1e-4)
        np.testing.assert_allclose(a.root, b.root, atol=1e-4)


def test_an_answer_has_the_size_that_the_load_tester_checks(stages: Stages):
    answer = stages.run([body(30)])[0]
    assert len(answer) == ANSWER.size + 4 * 30 * (21 * 6 + 5 + 4)
    assert ANSWER.unpack_from(answer) == (b"TBA1", 8, 30)
    empty = Solved(np.zeros((3, 4)), *(np.zeros((0, n), np.float32) for n in (126, 5, 4)))
    assert empty.encode() == ANSWER.pack(b"TBA1", 3, 0)


def test_a_task_that_fixes_no_frames_gets_those_of_its_tokens(stages: Stages):
    task = read_task(body(40), WIDTH)
    free = Task(0, task.targets, 1 << 4, task.given, task.local_root, task.global_root, task.pose)
    solved = stages.solve([free])[0]
    assert len(solved.tokens) == 7 and len(solved.root) == 28
