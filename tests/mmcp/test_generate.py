"""Generated motion: every feature of the protocol, measured on the answer with the protocol's own kinematics."""

import copy

import numpy as np
import pytest
from motionmcp.client import generate
from motionmcp_client import client
from other_side import Answer, angle, free, request, root_path

STRAIGHT = {0: (0.0, 0.0), 30: (0.0, 1.2), 60: (0.0, 2.4), 90: (0.0, 3.6), 119: (0.0, 4.76)}


def seeded(seed=1, **more) -> dict:
    return {"seed": seed, **more}


def whole_pose(answer: Answer, frame: int, at: int, root=None) -> dict:
    """The pose of a frame of an answer, as a keyframe of another frame."""
    quaternions = answer.quaternions()[0, frame]
    rotations = {name: [float(v) for v in q] for name, q in zip(answer.names, quaternions, strict=True)}
    key = {"type": "pose_keyframe", "frame": at, "joint_rotations": rotations}
    return key if root is None else {**key, "root_position": [float(v) for v in root]}


def test_motion_of_its_own(ours, mover):
    answer = ours.make(request(mover, [free(120)], options=seeded()))
    roots = answer.roots()[0]
    steps = np.linalg.norm(np.diff(roots, axis=0), axis=-1) * mover["fps"]
    assert steps.max() < 8, "no jumps"
    assert np.linalg.norm((roots[-1] - roots[0])[[0, 2]]) > 0.5, "it goes somewhere"
    turns = angle(answer.quaternions()[0, 1:], answer.quaternions()[0, :-1])
    assert turns.max() < 0.9, "no joint jumps"
    assert answer.extension["samples"][0]["chunk_boundaries"], "it is stitched"
    assert "path_drawn" in answer.notes()


def test_the_same_seed_makes_the_same_and_another_another(ours, mover):
    body = request(mover, [free(60)], options=seeded(7))
    first, again = ours.make(body), ours.make(body)
    assert first.document == again.document
    other = ours.make(request(mover, [free(60)], options=seeded(8)))
    assert not np.allclose(first.quaternions(), other.quaternions())
    drawn = ours.make(request(mover, [free(60)]))
    assert "seed" in drawn.notes(), "a note names a drawn seed"


def test_samples_differ(ours, mover):
    answer = ours.make(request(mover, [free(60)], options=seeded(num_samples=4)))
    quaternions = answer.quaternions()
    for a in range(4):
        for b in range(a):
            assert not np.allclose(quaternions[a], quaternions[b], atol=1e-3), (a, b)


def test_paths_are_met(ours, mover):
    answer = ours.make(request(mover, [free(120)], constraints=[root_path(STRAIGHT)], options=seeded()))
    roots = answer.roots()[0]
    for frame, (x, z) in STRAIGHT.items():
        np.testing.assert_allclose(roots[frame, [0, 2]], [x, z], atol=2e-3, err_msg=str(frame))
    speed = np.linalg.norm(np.diff(roots[:, [0, 2]], axis=0), axis=-1) * 30
    assert 0.6 < np.median(speed) < 1.8
    assert "path_drawn" not in answer.notes()
    trajectory = answer.extension["samples"][0]["trajectory"]
    assert trajectory["model"] == "line", trajectory["model"]
    positions = np.array(trajectory["position"])
    np.testing.assert_allclose(positions[-1] - positions[0], [0, 4.76], atol=0.3)


def test_headings_are_met(ours, walker):
    # Towards +X, facing +X: a quarter turn to the left of +Z.
    places = {frame: (0.035 * frame, 0.0) for frame in range(0, 90, 15)}
    path = root_path(places, [np.pi / 2] * len(places))
    answer = ours.make(request(walker, [free(90)], constraints=[path], options=seeded()))
    ahead = ours.make(request(walker, [free(90)], constraints=[root_path({0: (0, 0), 89: (0, 3)})], options=seeded()))
    left = {"human": ("Shoulder_L", "Shoulder_R")}.get(walker["id"], ("left_shoulder_pitch", "right_shoulder_pitch"))

    def facing(positions):
        across = positions[answer.names.index(left[0])] - positions[answer.names.index(left[1])]
        return np.arctan2(across[0], across[2]) - np.pi / 2

    turned = [facing(answer.positions()[0, f]) - facing(ahead.positions()[0, f]) for f in (30, 45, 60, 75)]
    wrapped = np.angle(np.exp(1j * np.array(turned)))
    assert abs(abs(wrapped.mean()) - np.pi / 2) < 0.3, wrapped


def test_feet_stand_still(ours, walker):
    """Feet do not slide in the frames that the answer names as contacts."""
    held = ours.make(request(walker, [free(120)], constraints=[root_path(STRAIGHT)], options=seeded()))
    raw = ours.make(
        request(walker, [free(120)], constraints=[root_path(STRAIGHT)], options=seeded(post_processing=False))
    )

    def slide(answer):
        joints = [answer.names.index(name) for name in answer.extension["samples"][0]["foot_contacts"]]
        places = answer.positions()[0][:, joints][:, :, [0, 2]]
        stands = answer.contacts()[1:] & answer.contacts()[:-1]
        assert stands.mean() > 0.15, "feet stand"
        return (np.linalg.norm(np.diff(places, axis=0), axis=-1) * 30)[stands].mean()

    assert slide(held) < 0.12, slide(held)
    assert slide(held) < slide(raw)


def test_poses_are_met(ours, walker):
    source = ours.make(request(walker, [free(120)], constraints=[root_path(STRAIGHT)], options=seeded(3)))
    keys = [
        whole_pose(source, 10, 0, source.roots()[0, 10]),
        whole_pose(source, 50, 40, source.roots()[0, 50]),
        whole_pose(source, 55, 43, source.roots()[0, 55]),
        whole_pose(source, 110, 119, source.roots()[0, 110]),
    ]
    answer = ours.make(request(walker, [free(120)], constraints=keys, options=seeded()))
    quaternions, wanted = answer.quaternions()[0], source.quaternions()[0]
    # A robot's poses are fitted to its hinges. Those of the source fit already.
    for at, frame in [(0, 10), (40, 50), (43, 55), (119, 110)]:
        assert angle(quaternions[at], wanted[frame]).max() < 0.02, at
        np.testing.assert_allclose(answer.roots()[0, at], source.roots()[0, frame], atol=2e-3, err_msg=str(at))
    assert angle(quaternions[1:], quaternions[:-1]).max() < 0.9, "no joint jumps"


def test_poses_without_segments(ours, walker):
    source = ours.make(request(walker, [free(60)], options=seeded(3)))
    keys = [whole_pose(source, 0, 0, source.roots()[0, 0]), whole_pose(source, 59, 39, source.roots()[0, 40])]
    answer = ours.make(request(walker, constraints=keys, duration_frames=40, options=seeded()))
    assert angle(answer.quaternions()[0, 39], source.quaternions()[0, 59]).max() < 0.02


def test_parts_of_poses(ours):
    model = ours.model("human")
    turn = [0.0, 0.0, float(np.sin(0.4)), float(np.cos(0.4))]
    part = {"type": "pose_keyframe", "frame": 45, "joint_rotations": {"Head": turn}}
    answer = ours.make(request(model, [free(90)], constraints=[part], options=seeded()))
    head = answer.quaternions()[0, :, answer.names.index("Head")]
    assert angle(head[45], np.array(turn)) < 0.01
    assert angle(head[44], head[45]) < 0.3, "it leads there"
    still = ours.make(request(model, [free(90)], constraints=[{**part, "fill_mode": "rest"}], options=seeded()))
    rest = np.array([joint["rest_rotation"] for joint in still.joints])
    others = [i for i, name in enumerate(still.names) if name != "Head"]
    assert angle(still.quaternions()[0, 45][others], rest[others]).max() < 0.01


@pytest.mark.parametrize(("name", "joint"), [("human", "Hand_R"), ("human", "Foot_L"), ("g1", "left_wrist_yaw")])
def test_effectors_reach(ours, name, joint):
    model = ours.model(name)
    place = {"Hand_R": [0.1, 1.2, 1.5], "Foot_L": [0.1, 0.35, 1.2], "left_wrist_yaw": [0.1, 0.9, 1.0]}[joint]
    target = {"type": "effector_target", "joint": joint, "frames": [60], "positions": [place]}
    answer = ours.make(request(model, [free(90)], constraints=[target], options=seeded(num_samples=2)))
    for sample in range(2):
        reached = answer.positions()[sample, :, answer.names.index(joint)]
        np.testing.assert_allclose(reached[60], place, atol=0.05)
        assert np.linalg.norm(reached[59] - reached[60]) < 0.2, "it leads there"


def test_an_effector_out_of_reach_gives_a_note(ours):
    target = {"type": "effector_target", "joint": "Hand_R", "frames": [60], "positions": [[0, 3.5, 1]]}
    assert "effector_missed" in ours.make(request(ours.model("human"), [free(90)], constraints=[target])).notes()


def test_level_ground_lifts(ours, mover):
    ground = {"type": "ground_height", "points": [[0, 0, 1.5], [0, 5, 1.5]]}
    flat = ours.make(request(mover, [free(90)], options=seeded()))
    high = ours.make(request(mover, [free(90)], constraints=[ground], options=seeded()))
    np.testing.assert_allclose(high.roots() - flat.roots(), np.broadcast_to([0, 1.5, 0], flat.roots().shape), atol=1e-4)


def test_feet_stand_on_uneven_ground(ours):
    # Stairs of 15 cm every 60 cm along +Z.
    def height(z):
        return 0.15 * np.floor(max(z, 0) / 0.6)

    points = [[float(x), float(z), float(height(z))] for x in np.arange(-1, 1.1, 0.25) for z in np.arange(-1, 6, 0.05)]
    constraints = [root_path(STRAIGHT), {"type": "ground_height", "points": points}]
    answer = ours.make(request(ours.model("human"), [free(120)], constraints=constraints, options=seeded()))
    assert "ground_lifted" in answer.notes()
    climbed = answer.roots()[0, -1, 1] - answer.roots()[0, 0, 1]
    assert abs(climbed - height(4.76)) < 0.2, climbed
    for name, stands in zip(answer.extension["samples"][0]["foot_contacts"], answer.contacts().T, strict=True):
        if not name.startswith("Foot"):
            continue
        foot = answer.positions()[0, :, answer.names.index(name)]
        # In the middle of a contact the ankle has the same height over the step as over a floor.
        middle = np.convolve(stands, np.ones(5), "same") == 5
        off = [min(abs(y - height(z + ahead) - 0.12) for ahead in (0, 0.1, 0.2)) for _, y, z in foot[middle]]
        assert len(off) > 5
        assert np.median(off) < 0.03, off


def test_loops_close(ours, mover):
    for path in (None, root_path({0: (0.0, 0.0), 59: (0.0, 2.2)})):
        constraints = [path] if path else []
        body = request(mover, [free(60)], constraints=constraints, options=seeded(loop=True, num_samples=2))
        answer = ours.make(body)
        for sample in range(2):
            quaternions, roots = answer.quaternions()[sample], answer.roots()[sample]
            assert angle(quaternions[0], quaternions[-1]).max() < 0.01, "the last frame is the first"
            assert abs(roots[0, 1] - roots[-1, 1]) < 1e-3
            # If the motion plays twice, the seam is as smooth as the rest.
            turns = angle(quaternions[1:], quaternions[:-1]).max(axis=-1)
            assert turns[[0, 1, -2, -1]].max() < 2 * turns.max() + 0.05
            speed = np.linalg.norm(np.diff(roots, axis=0), axis=-1)
            assert abs(speed[0] - speed[-1]) < 1.5 * np.abs(np.diff(speed)).max() + 0.005, (speed[0], speed[-1])
        if path:
            np.testing.assert_allclose((roots[-1] - roots[0])[[0, 2]], [0, 2.2], atol=5e-3)


def test_segments_follow_each_other(ours, mover):
    def make(*seeds):
        segments = [free(50, **({} if seed is None else {"seed": seed})) for seed in seeds]
        return ours.make(request(mover, segments, constraints=[root_path({0: (0, 0), 149: (0, 5)})], options=seeded()))

    first, second = make(None, None, 5), make(None, None, 6)
    a, b = first.quaternions()[0], second.quaternions()[0]
    assert angle(a[:40], b[:40]).max() < 0.2, "the first segment is nearly the same"
    assert not np.allclose(a[110:], b[110:], atol=1e-3), "a segment has a seed of its own"
    assert angle(a[1:], a[:-1]).max() < 0.9, "no joint jumps between segments"
    boundaries = first.extension["samples"][0]["chunk_boundaries"]
    assert {50, 100} <= set(boundaries), boundaries


@pytest.mark.parametrize("fps", [24, 60])
def test_other_frame_rates(ours, mover, fps):
    path = root_path({0: (0, 0), 2 * fps: (0, 2.4)})
    body = request(mover, [free(2 * fps + 1)], constraints=[path], timing={"fps": fps}, options=seeded())
    answer = ours.make(body)
    assert "resampled" in answer.notes()
    np.testing.assert_allclose(answer.roots()[0, -1, [0, 2]], [0, 2.4], atol=0.02)


def test_another_order_of_joints(ours, walker):
    """Joints are matched by name, and the answer keeps the order of the request."""
    joints = walker["canonical_skeleton"]["joints"]
    depth = {}
    for joint in joints:
        depth[joint["name"]] = depth.get(joint["parent"], -1) + 1
    body = request(walker, [free(40)], options=seeded())
    other = copy.deepcopy(body)
    other["skeleton"]["joints"] = sorted(joints, key=lambda joint: (depth[joint["name"]], joint["name"]))
    assert other["skeleton"] != body["skeleton"]
    plain, moved = ours.make(body), ours.make(other)
    order = [moved.names.index(name) for name in plain.names]
    np.testing.assert_allclose(moved.positions()[:, :, order], plain.positions(), atol=1e-5)


def test_rest_rotations_of_the_client(ours, walker):
    """Channels replace the rest pose, so the client may choose its rotations."""
    body = request(walker, [free(40)], options=seeded())
    other = copy.deepcopy(body)
    for joint in other["skeleton"]["joints"]:
        joint["rest_rotation"] = [0, 0.6, 0, 0.8]
    np.testing.assert_array_equal(ours.make(body).quaternions(), ours.make(other).quaternions())


def test_styles(ours):
    human = ours.model("human")
    styles = {option["name"]: option for option in human["model_options"]}["style"]["values"]
    assert {"normal", "old", "run"} <= set(styles)
    path = [root_path(STRAIGHT)]

    def heights(style):
        options = seeded(model_options={"style": style, "temperature": 0})
        return (
            ours.make(request(human, [free(120)], constraints=path, options=options)).positions()[0, 60:, :, 1].max(-1)
        )

    assert heights("old").mean() < heights("normal").mean() - 0.02, "the old bow"
    horse = ours.model("unimogen/horse")
    words = {option["name"]: option for option in horse.get("model_options", [])}["style"]["values"]
    options = seeded(
        model_options={"style": words[0]}, diffusion_steps=100, guidance={"type": "regular", "weight": [2.0]}
    )
    assert "diffusion_steps" in ours.make(request(horse, [free(60)], options=options)).notes()


@pytest.mark.parametrize(
    ("name", "by", "wanted"), [("human", "human", "carried"), ("g1", "g1", None), ("h1", "g1", None)]
)
def test_a_path_on_two_legs_is_planned_by_another_pack(ours, name, by, wanted):
    model = ours.model(f"unimogen/{name}")
    options = {option["name"]: option for option in model["model_options"]}
    assert options["planner"]["values"] == ["auto", "own", "carried"]

    def make(planner=None):
        chosen = {} if planner is None else {"model_options": {"planner": planner}}
        return ours.make(request(model, [free(120)], constraints=[root_path(STRAIGHT)], options=seeded(3, **chosen)))

    def said(answer):
        return [note["message"] for note in answer.extension.get("notes", []) if note["code"] == "planner"]

    answer, own = make(wanted), make("own")
    (message,) = said(answer)
    assert message.startswith(f"the path is planned by {by} in its style "), message
    assert not said(own)
    for made in (answer, own):
        for frame, place in STRAIGHT.items():
            np.testing.assert_allclose(made.roots()[0, frame, [0, 2]], place, atol=2e-3)
    np.testing.assert_array_equal(answer.roots(), make("carried").roots())
    # Nothing said: people plan themselves, robots do not.
    np.testing.assert_array_equal(make().roots(), (own if wanted else answer).roots())
    assert not np.allclose(answer.quaternions(), own.quaternions(), atol=1e-3)
    assert answer.positions()[0, :, :, 1].min() > -0.06, "feet stay on the ground"
    contacts = set(answer.extension["samples"][0]["foot_contacts"])
    assert contacts == set(own.extension["samples"][0]["foot_contacts"])


def test_who_may_plan_is_checked(ours):
    def refused(name, planner, constraints):
        options = seeded(model_options={"planner": planner})
        status, _, answer = ours.send(request(ours.model(name), [free(60)], constraints=constraints, options=options))
        assert status == 400, answer
        return str(answer)

    path = [root_path({0: (0.0, 0.0), 59: (0.0, 2.0)})]
    assert "auto, own, carried" in refused("unimogen/h1", "both", path)
    assert "without a root_path" in refused("unimogen/h1", "carried", [])
    assert "cannot be carried over" in refused("unimogen/horse", "carried", path)
    horse = {option["name"] for option in ours.model("unimogen/horse")["model_options"]}
    assert "planner" not in horse


@pytest.mark.parametrize("name", ["human", "g1", "unimogen/horse"])
def test_requests_of_the_client_for_blender(ours, name):
    separated = {"type": "separated", "weight": [2.0, 2.0]}
    options = seeded(diffusion_steps=50, num_samples=1, post_processing=True, transition_frames=5, guidance=separated)
    body = request(ours.model(name), [free(120)], constraints=[root_path(STRAIGHT)], options=options)
    assert "guidance" in ours.make(body | {"protocol_version": "1.0"}).notes()


def test_a_batch_gives_the_answers_of_its_requests(ours):
    bodies = [
        request(ours.model("human"), [free(60)], options=seeded(num_samples=2)),
        request(ours.model("human"), [free(40)], options=seeded(5)),
        request(ours.model("unimogen/fox"), [free(40)], options=seeded(6)),
    ]
    alone = [ours.make(body).document for body in bodies]
    without = [{name: value for name, value in body.items() if name != "protocol_version"} for body in bodies]
    status, headers, answer = ours.send({"protocol_version": "1.4", "requests": without})
    assert status == 200
    assert headers["content-type"] == "application/json"
    for body, result, document in zip(bodies, answer["results"], alone, strict=True):
        assert list(result) == ["gltf"]
        made = Answer(body, result["gltf"], ours.model(body["model"]))
        # Rounding depends on the size of the batch.
        single = Answer(body, document, ours.model(body["model"]))
        np.testing.assert_allclose(made.roots(), single.roots(), atol=0.02)


def test_both_clients_get_the_same(ours, walker):
    body = request(walker, [free(20)], options=seeded())
    assert generate(ours.url, body) == client.generate(ours.url, body)


def test_the_document_has_the_form_of_the_null_servers(ours, theirs, walker):
    body = request(walker, [free(20)], options=seeded())
    mine, their = ours.send(body)[2], theirs.send(body)[2]

    def form(value, depth=3):
        if isinstance(value, dict) and depth:
            return {name: form(value[name], depth - 1) for name in sorted(value)}
        return type(value).__name__

    assert set(their) <= set(mine)
    assert set(their["extensions"]["MMCP_motion"]) <= set(mine["extensions"]["MMCP_motion"])
    sample, twin = (document["extensions"]["MMCP_motion"]["samples"][0] for document in (mine, their))
    assert set(twin) <= set(sample) | {"trajectory"}
    for name in ("nodes", "animations", "skins", "scenes", "accessors", "bufferViews", "buffers"):
        assert set(their[name][0]) - {"min", "max"} <= set(mine[name][0]) | {"children"}, name
    assert form(mine["asset"]) == form(their["asset"])


def test_short_motions(ours, mover):
    for frames in (1, 2, 5):
        ours.make(request(mover, [free(frames)], options=seeded()))
        ours.make(request(mover, [free(frames)], options=seeded(loop=True)))


def test_long_motions(ours, walker):
    answer = ours.make(request(walker, [free(900)], options=seeded()))
    assert len(answer.extension["samples"][0]["chunk_boundaries"]) > 20
    assert angle(answer.quaternions()[0, 1:], answer.quaternions()[0, :-1]).max() < 0.9
