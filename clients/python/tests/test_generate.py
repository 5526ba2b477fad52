import pytest

import troupe
from troupe.pack import of_message
from troupe.v1 import motion_pb2


@pytest.mark.parametrize("planner", list(troupe.Planner))
def test_the_planner_of_a_path_is_sent(planner: troupe.Planner) -> None:
    pack = of_message(motion_pb2.Pack(name="unimogen", joints=[motion_pb2.Joint(name="hips", parent=-1)]))
    goal = troupe.FollowPath([[0, 0, 0], [0, 0, 1]], planner=planner).to_message(pack)
    assert motion_pb2.PathPlanner.Name(goal.planner) == f"PATH_PLANNER_{planner.name}"


def test_the_planner_is_automatic_unless_another_is_named() -> None:
    assert troupe.FollowPath([[0, 0, 0]]).planner is troupe.Planner.AUTO
