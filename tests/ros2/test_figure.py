"""The figures of `make ros2-figure`, by poses that are made up."""

import numpy as np
import pytest
from figure import of, under_way
from messages import Header, JointState, Time

ROOT = [0.0] * 7


def state(stamp_s: float, angle: float) -> JointState:
    whole = int(stamp_s)
    return JointState(Header(Time(whole, round((stamp_s - whole) * 1e9)), ""), ["knee"], [angle], [0.0], [])


def test_a_pose_that_came_again_is_the_nearest_one():
    # It stands for two frames, walks, and stands again as before.
    rows = [(10.00, [*ROOT, 0.5]), (10.02, [*ROOT, 0.5]), (10.04, [*ROOT, 0.7]), (12.00, [*ROOT, 0.5])]
    states = [(came + 0.001, state(came - 0.002, row[7])) for came, row in rows]
    late, behind, strangers = under_way(states, rows)
    assert late == pytest.approx(np.full(4, 3.0), abs=1e-3)
    assert behind == pytest.approx(np.full(4, 1.0), abs=1e-3)
    assert strangers == 0


def test_poses_that_the_server_did_not_send_are_counted_and_not_timed():
    states = [(10.0 + 0.02 * nth, state(10.0 + 0.02 * nth, nth)) for nth in range(5)]
    figures = of(states, [(10.0, [*ROOT, 0.0])])
    assert (figures["poses"], figures["not_the_servers"]) == (5, 4)
    assert figures["rate_hz"] == pytest.approx(50)
    assert figures["behind_the_servers_stream_ms"]["most"] == pytest.approx(0)
    assert of(states, [])["behind_the_servers_stream_ms"] is None
