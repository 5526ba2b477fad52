"""Invalid requests: each gives an error of the protocol's list, the same that the protocol's own server gives."""

import copy

import pytest
from motionmcp.errors import STATUS_FOR
from other_side import free, request, root_path

IDENTITY = [0, 0, 0, 1]


def changed(body: dict, change) -> dict:
    body = copy.deepcopy(body)
    change(body)
    return body


def pose(frame, joint="?"):
    return {"type": "pose_keyframe", "frame": frame, "joint_rotations": {joint: IDENTITY}}


# Changes of a good request, by name.
CHANGES = {
    "no version": lambda b: b.pop("protocol_version"),
    "a version of another form": lambda b: b.update(protocol_version="one"),
    "another major version": lambda b: b.update(protocol_version="2.0"),
    "an unknown model": lambda b: b.update(model="missing"),
    "no model": lambda b: b.pop("model"),
    "an unknown field": lambda b: b.update(speed=1),
    "no skeleton": lambda b: b.pop("skeleton"),
    "an unknown field of the skeleton": lambda b: b["skeleton"].update(scale=1),
    "no joints": lambda b: b["skeleton"].update(joints=[]),
    "two roots": lambda b: b["skeleton"]["joints"][1].update(parent=None),
    "a parent that is missing": lambda b: b["skeleton"]["joints"][1].update(parent="missing"),
    "a child before its parent": lambda b: b["skeleton"]["joints"].reverse(),
    "a name twice": lambda b: b["skeleton"]["joints"][2].update(name=b["skeleton"]["joints"][1]["name"]),
    "a name that is empty": lambda b: b["skeleton"]["joints"][0].update(name=""),
    "another unit": lambda b: b["skeleton"].update(units="feet"),
    "other axes": lambda b: b["skeleton"].update(coordinate_system="z_up"),
    "nothing to do": lambda b: b.pop("segments"),
    "nothing to do but a length": lambda b: (b.pop("segments"), b.update(duration_frames=30)),
    "a constraint without a length": lambda b: (b.pop("segments"), b.update(constraints=[root_path({0: (0, 0)})])),
    "a length beside segments": lambda b: b.update(duration_frames=30),
    "a length of zero": lambda b: b["segments"][0].update(duration_frames=0),
    "a negative length": lambda b: b["segments"][0].update(duration_frames=-5),
    "a length in words": lambda b: b["segments"][0].update(duration_frames="long"),
    "a length that is too long": lambda b: b["segments"][0].update(duration_frames=100_000),
    "an unknown segment": lambda b: b.update(segments=[{"type": "dance"}]),
    "a segment without a type": lambda b: b.update(segments=[{"duration_frames": 3}]),
    "an unknown field of a segment": lambda b: b["segments"][0].update(mood="glad"),
    "a segment of words": lambda b: b.update(segments=[{"type": "text", "prompt": "walk", "duration_frames": 30}]),
    "a pose of words": lambda b: b.update(segments=[{"type": "pose", "prompt": "sit"}]),
    "a reference motion": lambda b: b.update(segments=[{"type": "motion_reference", "anything": "at all"}]),
    "a reference video": lambda b: b.update(segments=[{"type": "video_reference"}]),
    "a constraint behind the end": lambda b: b.update(constraints=[root_path({90: (0, 0)})]),
    "a pose behind the end": lambda b: b.update(constraints=[pose(90, b["skeleton"]["joints"][0]["name"])]),
    "a pose before the start": lambda b: b.update(constraints=[pose(-1, b["skeleton"]["joints"][0]["name"])]),
    "a pose of an unknown joint": lambda b: b.update(constraints=[pose(5)]),
    "an effector of an unknown joint": lambda b: b.update(
        constraints=[{"type": "effector_target", "joint": "?", "frames": [1], "positions": [[0, 0, 0]]}]
    ),
    "frames that do not grow": lambda b: b.update(
        constraints=[{"type": "root_path", "frames": [5, 5], "positions_xz": [[0, 0], [1, 1]]}]
    ),
    "a path of two lengths": lambda b: b.update(
        constraints=[{"type": "root_path", "frames": [5], "positions_xz": [[0, 0], [1, 1]]}]
    ),
    "an empty path": lambda b: b.update(constraints=[{"type": "root_path", "frames": [], "positions_xz": []}]),
    "a place of words": lambda b: b.update(
        constraints=[{"type": "root_path", "frames": [5], "positions_xz": [["far", "away"]]}]
    ),
    "an unknown constraint": lambda b: b.update(constraints=[{"type": "gravity"}]),
    "too many constraints": lambda b: b.update(
        constraints=[{"type": "ground_height", "points": [[0, 0, 0]]} for _ in range(300)]
    ),
    "no ground": lambda b: b.update(constraints=[{"type": "ground_height", "points": []}]),
    "too many samples": lambda b: b.update(options={"num_samples": 17}),
    "no samples": lambda b: b.update(options={"num_samples": 0}),
    "an unknown option": lambda b: b.update(options={"speed": 1}),
    "too many steps": lambda b: b.update(options={"diffusion_steps": 501}),
    "a long transition": lambda b: b.update(options={"transition_frames": 61}),
    "thinned curves": lambda b: b.update(options={"keyframe_budget": 0.01}),
    "an option of no model": lambda b: b.update(options={"model_options": {"mood": "glad"}}),
    "an unknown style": lambda b: b.update(options={"model_options": {"style": "?"}}),
    "a temperature that is too high": lambda b: b.update(options={"model_options": {"temperature": 3}}),
    "guidance without a weight": lambda b: b.update(options={"guidance": {"type": "regular", "weight": []}}),
    "guidance of another type": lambda b: b.update(options={"guidance": {"type": "free"}}),
    "a loop of two segments": lambda b: (b["segments"].append(free(30)), b.update(options={"loop": True})),
    "a frame rate of zero": lambda b: b.update(timing={"fps": 0}),
    "an unknown field of timing": lambda b: b.update(timing={"fps": 30, "unit": "s"}),
}


@pytest.mark.parametrize("name", CHANGES)
def test_the_code_is_that_of_the_protocols_own_server(ours, theirs, name):
    body = changed(request(ours.model("human"), [free(30)]), CHANGES[name])
    code, error = ours.error(body)
    assert code == theirs.error(body)[0], error
    assert error["details"]["field"], error
    assert error["details"]["allowed"], error


@pytest.mark.parametrize("raw", [b"", b"{", b"[]", b"3", b"null", b'"text"', b"\xff\xfe", b"{}", b"[" * 100_000])
def test_bodies_that_are_no_requests(ours, raw):
    assert ours.error(raw)[0] == "schema_validation"


def test_bodies_that_are_too_large(ours):
    most = ours.model("human")["limits"]["max_request_bytes"]
    assert ours.error(b" " * (most + 1))[0] == "payload_too_large"


def test_other_ways_to_ask(ours):
    assert ours.error(b"{}", headers={"Content-Type": "text/plain"})[0] == "schema_validation"
    assert ours.error(b"", method="GET")[0] == "invalid_request"
    assert ours.error(b"", method="DELETE", path="/capabilities")[0] == "invalid_request"
    assert ours.error(b"{}", headers={"Origin": "https://evil.example"})[0] == "forbidden"
    assert ours.error(b"", method="GET", path="/capabilities", headers={"Host": "evil.example"})[0] == "forbidden"


def test_constraints_that_bodies_which_follow_paths_do_not_take(ours, theirs):
    model = ours.model("unimogen/horse")
    body = request(model, [free(30)], constraints=[pose(5, model["canonical_skeleton"]["joints"][0]["name"])])
    assert ours.error(body)[0] == theirs.error(body)[0] == "unsupported_constraint"


def test_values_beyond_what_the_schema_says(ours, walker):
    def code(constraint=None, **more):
        body = request(walker, [free(30)], **more)
        if constraint is not None:
            body["constraints"] = [constraint]
        return ours.error(body)[0]

    assert code(root_path({0: (0, 0), 1: (9, 0)})) == "invalid_options", "270 m/s"
    assert code(root_path({0: (1e9, 0)})) == "schema_validation"
    joint = walker["canonical_skeleton"]["joints"][0]["name"]
    assert code({"type": "pose_keyframe", "frame": 3, "joint_rotations": {joint: [0, 0, 0, 0]}}) == "schema_validation"
    guided = {"guidance": {"type": "regular", "weight": [9.0]}}
    horse = ours.model("unimogen/horse")
    assert ours.error(request(horse, [free(30)], options=guided))[0] == "invalid_options"
    assert code(timing={"fps": 1e4}) == "schema_validation"
    body = request(walker, [free(30)])
    body["skeleton"] = copy.deepcopy(body["skeleton"])
    body["skeleton"]["joints"][3]["rest_translation"][1] = 1e9
    assert ours.error(body)[0] == "retargeting_unsupported"


@pytest.mark.parametrize(
    "change", [lambda joints: joints.pop(), lambda joints: joints[-1].update(name="tail of a cat")]
)
def test_other_joints_where_motion_is_not_carried_over(ours, theirs, change):
    body = changed(request(ours.model("unimogen/snake"), [free(30)]), lambda b: change(b["skeleton"]["joints"]))
    assert ours.error(body)[0] == theirs.error(body)[0] == "retargeting_unsupported"


def test_the_items_of_a_batch_fail_alone(ours, theirs):
    good = request(ours.model("human"), [free(20)])
    items = [good, changed(good, CHANGES["an unknown model"]), 3, changed(good, CHANGES["a segment of words"])]
    body = {"protocol_version": "1.4", "requests": items}
    results = [server.send(body)[2]["results"] for server in (ours, theirs)]
    for mine, their in zip(*results, strict=True):
        assert set(mine) == set(their)
        if "error" in mine:
            assert mine["error"]["code"] == their["error"]["code"]
            assert mine["error"]["code"] in STATUS_FOR


@pytest.mark.parametrize(
    "body",
    [
        {"requests": [{}]},
        {"protocol_version": "2.0", "requests": [{}]},
        {"protocol_version": "1.4", "requests": []},
        {"protocol_version": "1.4", "requests": {}},
        {"protocol_version": "1.4", "requests": [{}] * 17},
    ],
)
def test_batches_that_are_none(ours, theirs, body):
    assert ours.error(body)[0] == theirs.error(body)[0]
