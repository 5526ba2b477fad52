"""Motion on skeletons of the caller's own, beside the model's own answer to the same request."""

import copy

import numpy as np
import pytest
from motionmcp.trajectory import fk_positions
from other_side import Answer, angle, free, request, root_path
from rigs import Rig, mixamo, octopus, other_animal, rigify, rotated, times

SEED = {"seed": 3}
# Bones of limbs, by the model's joints.
LIMBS = [
    (f"{upper}_{side}", f"{lower}_{side}")
    for upper, lower in [("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")]
    for side in "LR"
]
HORSE_LIMBS = [
    (f"{end}_leg_{upper}_{side}", f"{end}_leg_{lower}_{side}")
    for end in ("front", "back")
    for upper, lower in [("upper", "lower"), ("lower", "ankle"), ("ankle", "foot")]
    for side in "lr"
]
RIGS = {"mixamo": mixamo, "rigify": rigify, "as Blender sends it": lambda: rigify(1.3, is_twisted=False)}


@pytest.fixture(params=RIGS)
def rig(request) -> Rig:
    return RIGS[request.param]()


def on(rig: Rig, model: dict, segments=None, **more) -> dict:
    return {**request(model, segments, **more), "skeleton": rig.skeleton}


def rest(skeleton: dict) -> dict[str, np.ndarray]:
    """Places of the joints at rest."""
    joints = skeleton["joints"]
    names = [joint["name"] for joint in joints]
    rotations = np.array([joint["rest_rotation"] for joint in joints])[None, None]
    root = np.array(joints[0]["rest_translation"])[None, None]
    return dict(zip(names, fk_positions(joints, names, rotations, root)[0][0, 0], strict=True))


def size(rig: Rig, model: dict) -> float:
    """Length of a rig's legs by that of the model's."""
    own, canonical = rest(rig.skeleton), rest(model["canonical_skeleton"])

    def bones(places, name):
        hip, knee, ankle = (places[name(joint)] for joint in ("UpperLeg_L", "LowerLeg_L", "Foot_L"))
        return np.linalg.norm(hip - knee) + np.linalg.norm(knee - ankle)

    return bones(own, rig.joints.get) / bones(canonical, str)


def directions(answer: Answer, bones: list[tuple[str, str]]) -> np.ndarray:
    """Directions of bones, [frames, bones, 3]."""
    places = answer.positions()[0]
    index = {name: nth for nth, name in enumerate(answer.names)}
    made = np.stack([places[:, index[end]] - places[:, index[start]] for start, end in bones], axis=1)
    return made / np.linalg.norm(made, axis=-1, keepdims=True)


def apart(rig: Rig, own: Answer, canonical: Answer, bones: list[tuple[str, str]]) -> np.ndarray:
    """Mean angles between bones of both answers, degrees."""
    named = [(rig.joints[start], rig.joints[end]) for start, end in bones]
    dots = (directions(own, named) * directions(canonical, bones)).sum(-1)
    return np.degrees(np.arccos(np.clip(dots, -1, 1))).mean(axis=0)


def check_lengths(rig: Rig, answer: Answer):
    """Names and order, which `Answer` checks too, and the length of every bone."""
    joints = rig.skeleton["joints"]
    assert [node["name"] for node in answer.document["nodes"]] == [joint["name"] for joint in joints]
    for node, joint in zip(answer.document["nodes"], joints, strict=True):
        np.testing.assert_allclose(node["translation"], joint["rest_translation"], atol=1e-5)
        np.testing.assert_allclose(node["rotation"], joint["rest_rotation"], atol=1e-5)
    at_rest, places = rest(rig.skeleton), answer.positions()[0]
    for nth, joint in enumerate(joints):
        if joint["parent"]:
            above = answer.names.index(joint["parent"])
            length = np.linalg.norm(places[:, nth] - places[:, above], axis=-1)
            np.testing.assert_allclose(
                length, np.linalg.norm(at_rest[joint["name"]] - at_rest[joint["parent"]]), atol=1e-4
            )


def slide(answer: Answer) -> float:
    """Mean speed over the ground of joints in contact, m/s."""
    joints = [answer.names.index(name) for name in answer.extension["samples"][0]["foot_contacts"]]
    places = answer.positions()[0][:, joints][:, :, [0, 2]]
    stands = answer.contacts()[1:] & answer.contacts()[:-1]
    assert stands.mean() > 0.15, "feet stand"
    return (np.linalg.norm(np.diff(places, axis=0), axis=-1) * answer.fps)[stands].mean()


def test_models_that_can(ours):
    can = {model["id"]: model["supports_retargeting"] for model in ours.capabilities["models"]}
    assert all(can[name] for name in ("human", "g1", "vermo", "unimogen/human", "unimogen/horse", "unimogen/fox")), can
    assert not can["unimogen/snake"], "a snake stands on nothing"


@pytest.mark.parametrize("name", ["human", "unimogen/human"])
def test_the_motion_is_the_models(ours, rig, name):
    model = ours.model(name)
    own = ours.make(on(rig, model, [free(120)], options=SEED))
    canonical = ours.make(request(model, [free(120)], options=SEED))
    check_lengths(rig, own)
    angles = apart(rig, own, canonical, LIMBS)
    assert angles.max() < 5, dict(zip(LIMBS, angles.round(1), strict=True))
    scale = size(rig, model)
    travel = [answer.roots()[0, -1, [0, 2]] - answer.roots()[0, 0, [0, 2]] for answer in (own, canonical)]
    np.testing.assert_allclose(travel[0], scale * travel[1], atol=0.05 * scale)
    # It stands on its own soles.
    at_rest = rest(rig.skeleton)
    for side in "LR":
        toe, of_model = rig.joints[f"Toes_{side}"], f"Toes_{side}"
        lowest = own.positions()[0, :, own.names.index(toe), 1].min() - at_rest[toe][1]
        model_lowest = canonical.positions()[0, :, canonical.names.index(of_model), 1].min()
        model_lowest -= rest(model["canonical_skeleton"])[of_model][1]
        assert abs(lowest - scale * model_lowest) < 0.03 * scale, (toe, lowest, scale * model_lowest)
    assert slide(own) < 1.2 * scale * slide(canonical) + 0.02
    feet = {rig.joints[f"{part}_{side}"] for part in ("Foot", "Toes") for side in "LR"}
    assert set(own.extension["samples"][0]["foot_contacts"]) == feet
    mapped = own.extension["canonical_to_request"]
    assert {part: mapped[part] for part in rig.joints} == rig.joints
    assert "canonical_to_request" not in canonical.extension


def test_paths_are_met_in_the_callers_metres(ours, rig):
    path = {0: (0.5, 0.0), 30: (0.5, 1.2), 60: (0.9, 2.3), 90: (1.9, 2.8), 119: (3.0, 2.8)}
    for name in ("human", "unimogen/human"):
        answer = ours.make(on(rig, ours.model(name), [free(120)], constraints=[root_path(path)], options=SEED))
        for frame, place in path.items():
            np.testing.assert_allclose(answer.roots()[0, frame, [0, 2]], place, atol=2e-3, err_msg=f"{name} {frame}")
        check_lengths(rig, answer)
        assert "root_moved" not in answer.notes()


def test_headings_are_met(ours, rig):
    model = ours.model("human")

    def facing(headings):
        path = root_path({frame: (0.0, 0.03 * frame) for frame in range(0, 90, 15)}, headings)
        answer = ours.make(on(rig, model, [free(90)], constraints=[path], options=SEED))
        left, right = (answer.positions()[0, :, answer.names.index(rig.joints[f"UpperLeg_{side}"])] for side in "LR")
        across = (left - right)[[30, 45, 60]]
        return np.arctan2(across[:, 0], across[:, 2]) - np.pi / 2

    turned = facing([np.pi / 4] * 6) - facing([0.0] * 6)
    assert abs(np.angle(np.exp(1j * (turned - np.pi / 4)))).max() < 0.15, turned


def whole(answer: Answer, frame: int, at: int, leave=()) -> dict:
    rotations = {
        name: [float(v) for v in q]
        for name, q in zip(answer.names, answer.quaternions()[0, frame], strict=True)
        if name not in leave
    }
    place = [float(v) for v in answer.roots()[0, frame]]
    return {"type": "pose_keyframe", "frame": at, "joint_rotations": rotations, "root_position": place}


def test_poses_are_met(ours, rig):
    model = ours.model("human")
    source = ours.make(on(rig, model, [free(120)], options=SEED))
    frames = {0: 10, 40: 50, 43: 55, 119: 110}
    keys = [whole(source, frame, at) for at, frame in frames.items()]
    answer = ours.make(on(rig, model, [free(120)], constraints=keys, options={"seed": 4}))
    made, wanted = answer.quaternions()[0], source.quaternions()[0]
    for at, frame in frames.items():
        assert angle(made[at], wanted[frame]).max() < 2e-3, at
        np.testing.assert_allclose(answer.roots()[0, at], source.roots()[0, frame], atol=1e-3, err_msg=str(at))
    assert angle(made[1:], made[:-1]).max() < 0.9, "no joint jumps"
    # The model leads there: a frame before is near already.
    assert angle(made[39], made[40]).max() < 0.35


def test_parts_of_poses_are_met(ours, rig):
    model, head = ours.model("human"), rig.joints["Head"]
    turned = [0.0, 0.0, float(np.sin(0.2)), float(np.cos(0.2))]
    still = {joint["name"]: joint["rest_rotation"] for joint in rig.skeleton["joints"]}
    goal = times(np.array(still[head]), np.array(turned))
    part = {"type": "pose_keyframe", "frame": 45, "joint_rotations": {head: [float(v) for v in goal]}}
    answer = ours.make(on(rig, model, [free(90)], constraints=[part], options=SEED))
    assert angle(answer.quaternions()[0, 45, answer.names.index(head)], goal) < 1e-2
    stands = ours.make(on(rig, model, [free(90)], constraints=[{**part, "fill_mode": "rest"}], options=SEED))
    for name, rotation in still.items():
        # The root's heading is free.
        if name not in (head, answer.names[0]):
            assert angle(stands.quaternions()[0, 45, answer.names.index(name)], np.array(rotation)) < 1e-2, name
    fingers = [name for name in answer.names if name not in rig.joints.values()]
    key = whole(answer, 20, 60, leave=[name for name in fingers if "and" in name and "DEF-hand" not in name])
    again = ours.make(on(rig, model, [free(90)], constraints=[key], options=SEED))
    assert angle(again.quaternions()[0, 60], answer.quaternions()[0, 20]).max() < 0.1


@pytest.mark.parametrize("part", ["Hand_R", "Foot_L", "Head"])
def test_effectors_reach_or_say_so(ours, rig, part):
    model, joint = ours.model("human"), rig.joints[part]
    scale = size(rig, model)
    place = {"Hand_R": [0.1, 1.2, 1.5], "Foot_L": [0.1, 0.35, 1.2], "Head": [0.0, 1.5, 1.0]}[part]
    place = [float(scale * v) for v in place]
    target = {"type": "effector_target", "joint": joint, "frames": [60], "positions": [place]}
    answer = ours.make(on(rig, model, [free(90)], constraints=[target], options={**SEED, "num_samples": 2}))
    reached = answer.positions()[:, :, answer.names.index(joint)]
    missed = np.linalg.norm(reached[:, 60] - place, axis=-1).max()
    assert missed < 0.02 or "effector_missed" in answer.notes(), missed
    if part != "Head":
        assert missed < 0.02, (missed, answer.notes())
    assert np.linalg.norm(reached[:, 59] - reached[:, 60], axis=-1).max() < 0.2 * max(scale, 1), "it leads there"
    check_lengths(rig, answer)


def test_the_root_and_turned_hands_as_effectors(ours, rig):
    model, hand = ours.model("human"), rig.joints["Hand_L"]
    scale = size(rig, model)
    goal = [0.3, 0.2, -0.4, 0.8]
    goal = [float(v) for v in np.array(goal) / np.linalg.norm(goal)]
    targets = [
        {
            "type": "effector_target",
            "joint": rig.joints["Hips"],
            "frames": [60],
            "positions": [[0.2, 0.8 * scale, 1.1]],
        },
        {
            "type": "effector_target",
            "joint": hand,
            "frames": [60],
            "positions": [[0.2 + 0.25 * scale, 1.2 * scale, 1.1 + 0.3 * scale]],
            "rotations": [goal],
        },
    ]
    answer = ours.make(on(rig, model, [free(90)], constraints=targets, options=SEED))
    np.testing.assert_allclose(answer.roots()[0, 60], targets[0]["positions"][0], atol=2e-3)
    joints = {joint["name"]: joint for joint in answer.joints}
    line, world = hand, np.array([0.0, 0.0, 0.0, 1.0])
    while line:
        world = times(answer.quaternions()[0, 60, answer.names.index(line)], world)
        line = joints[line]["parent"]
    assert angle(world, np.array(goal)) < 1e-2


def test_ground_and_loops(ours, rig):
    model = ours.model("human")
    ground = {"type": "ground_height", "points": [[0, 0, 1.5], [0, 5, 1.5]]}
    flat = ours.make(on(rig, model, [free(60)], options=SEED))
    high = ours.make(on(rig, model, [free(60)], constraints=[ground], options=SEED))
    np.testing.assert_allclose(high.roots() - flat.roots(), np.broadcast_to([0, 1.5, 0], flat.roots().shape), atol=1e-4)
    scale = size(rig, model)

    def height(z):
        return 0.15 * scale * np.floor(max(z, 0) / (0.6 * scale))

    z = np.arange(-1, 6, 0.05) * scale
    stairs = {
        "type": "ground_height",
        "points": [[float(x), float(v), float(height(v))] for x in (-0.3, 0, 0.3) for v in z],
    }
    path = root_path({0: (0, 0), 119: (0, 4.76 * scale)})
    climbs = ours.make(on(rig, model, [free(120)], constraints=[path, stairs], options=SEED))
    climbed = climbs.roots()[0, -1, 1] - climbs.roots()[0, 0, 1]
    assert abs(climbed - height(4.76 * scale)) < 0.2 * scale, climbed
    loop = ours.make(on(rig, model, [free(60)], options={**SEED, "loop": True}))
    quaternions, roots = loop.quaternions()[0], loop.roots()[0]
    assert angle(quaternions[0], quaternions[-1]).max() < 0.01
    assert abs(roots[0, 1] - roots[-1, 1]) < 1e-3


def test_an_animal(ours):
    model = ours.model("unimogen/horse")
    rig = other_animal(model, legs=1.05)
    own = ours.make(on(rig, model, [free(120)], options=SEED))
    canonical = ours.make(request(model, [free(120)], options=SEED))
    check_lengths(rig, own)
    angles = apart(rig, own, canonical, HORSE_LIMBS)
    assert angles.max() < 5, dict(zip(HORSE_LIMBS, angles.round(1), strict=True))
    travel = [np.linalg.norm(answer.roots()[0, -1] - answer.roots()[0, 0]) for answer in (own, canonical)]
    assert 0.6 < travel[0] / travel[1] < 0.65, "as long as its legs are"
    path = {0: (0.0, 0.0), 60: (0.0, 1.0), 119: (0.8, 1.8)}
    answer = ours.make(on(rig, model, [free(120)], constraints=[root_path(path)], options=SEED))
    for frame, place in path.items():
        np.testing.assert_allclose(answer.roots()[0, frame, [0, 2]], place, atol=2e-3)


def test_a_robots_motion_on_a_person(ours, rig):
    model = ours.model("g1")
    path = {0: (0.0, 0.0), 89: (0.0, 2.5)}
    answer = ours.make(on(rig, model, [free(90)], constraints=[root_path(path)], options=SEED))
    check_lengths(rig, answer)
    np.testing.assert_allclose(answer.roots()[0, 89, [0, 2]], path[89], atol=2e-3)


def test_the_models_own_joints_in_another_size(ours):
    """Lengths that differ are another body's. Rest rotations that differ are not."""
    model = ours.model("human")
    other = copy.deepcopy(model["canonical_skeleton"])
    for joint in other["joints"]:
        joint["rest_translation"] = [1.25 * v for v in joint["rest_translation"]]
    body = {**request(model, [free(90)], options=SEED), "skeleton": other}
    larger, canonical = ours.make(body), ours.make(request(model, [free(90)], options=SEED))
    travel = [answer.roots()[0, -1, [0, 2]] - answer.roots()[0, 0, [0, 2]] for answer in (larger, canonical)]
    np.testing.assert_allclose(travel[0], 1.25 * travel[1], atol=0.02)
    rig = Rig(other, {name: name for name in larger.names})
    assert apart(rig, larger, canonical, LIMBS).max() < 5


def test_turned_and_placed_elsewhere(ours):
    """A character that looks backwards and stands on a stage at rest, as in an animator's scene."""
    model, plain = ours.model("human"), mixamo()
    turned = copy.deepcopy(plain)
    first = turned.skeleton["joints"][0]
    about = np.array([0.0, 1.0, 0.0, 0.0])
    stage = np.array([4.0, 2.0, -1.0])
    first["rest_translation"] = [float(v) for v in rotated(about, first["rest_translation"]) + stage]
    first["rest_rotation"] = [float(v) for v in times(about, np.array(first["rest_rotation"]))]
    path = [root_path({0: (0, 0), 89: (0, 3)})]
    answers = [ours.make(on(rig, model, [free(90)], constraints=path, options=SEED)) for rig in (plain, turned)]
    heights = [answer.roots()[0, :, 1].mean() for answer in answers]
    assert abs(heights[0] - heights[1]) < 0.02, heights
    np.testing.assert_allclose(answers[0].quaternions(), answers[1].quaternions(), atol=0.02)


def test_rates_samples_and_batches(ours, rig):
    model = ours.model("human")
    body = on(rig, model, [free(61)], timing={"fps": 60}, options={**SEED, "num_samples": 3})
    body["constraints"] = [root_path({0: (0, 0), 60: (0, 1.2)})]
    single = ours.make(body)
    for sample in range(3):
        np.testing.assert_allclose(single.roots()[sample, 60, [0, 2]], [0, 1.2], atol=0.02)
    refused = {**request(model, [free(20)]), "skeleton": octopus()}
    canonical = request(model, [free(20)], options=SEED)
    status, _, answer = ours.send({"protocol_version": "1.4", "requests": [body, refused, canonical]})
    assert status == 200
    assert answer["results"][1]["error"]["code"] == "retargeting_unsupported"
    first = Answer(body, answer["results"][0]["gltf"], model)
    np.testing.assert_allclose(first.roots(), single.roots(), atol=0.02)
    Answer(canonical, answer["results"][2]["gltf"], model)


def test_a_reference_motion_of_another_rig(ours, rig):
    """A model that imitates a motion reads it from the caller's rig, or from a third one."""
    vermo, human = ours.model("vermo"), ours.model("human")
    path = root_path({0: (0, 0), 89: (0, 3.3 * size(rig, human))})
    walk = ours.make(on(rig, human, [free(90)], constraints=[path], options=SEED))
    like = {
        "type": "motion_reference",
        "duration_frames": 60,
        "joint_names": walk.names,
        "rotations": walk.quaternions()[0].tolist(),
        "root_positions": walk.roots()[0].tolist(),
        "fps": 30,
    }
    answer = ours.make(on(rig, vermo, [like], options=SEED))
    words = [note["message"] for note in answer.extension["notes"] if note["code"] == "motion_reference"]
    assert any("walk" in message for message in words), words
    ours.make(request(vermo, [{**like, "skeleton": rig.skeleton}], options=SEED))


def test_bodies_that_do_not_go_together(ours):
    def refused(skeleton, name):
        code, error = ours.error({**request(ours.model(name), [free(20)]), "skeleton": skeleton})
        assert code == "retargeting_unsupported", error
        details = error["details"]
        assert details["field"] == "skeleton"
        assert "canonical_skeleton" in details["allowed"], "the way on"
        return error

    refused(octopus(), "human")
    refused(octopus(), "unimogen/horse")
    assert "two legs" in refused(mixamo().skeleton, "unimogen/horse")["message"]
    assert "in metres" in refused(mixamo(112.0).skeleton, "human")["message"], "centimetres"
    lying = copy.deepcopy(mixamo().skeleton)
    quarter = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    lying["joints"][0]["rest_rotation"] = times(quarter, np.array(lying["joints"][0]["rest_rotation"])).tolist()
    assert "no stance" in refused(lying, "human")["message"]
    # A snake's motion goes onto no other body.
    snake = ours.model("unimogen/snake")
    code, error = ours.error({**request(snake, [free(20)]), "skeleton": mixamo().skeleton})
    assert (code, error["details"]["field"]) == ("retargeting_unsupported", "skeleton.joints")


def test_figures_beyond_the_bar_are_named(ours):
    """Sides that are swapped by name: no angle of a bone shows it, the lines across the body do."""
    swapped = copy.deepcopy(mixamo().skeleton)
    for joint in swapped["joints"]:
        for key in ("name", "parent"):
            name = joint[key] or ""
            if "Arm" in name or "Hand" in name or "Shoulder" in name:
                other = name.replace("Left", "?").replace("Right", "Left").replace("?", "Right")
                joint[key] = other
    body = {**request(ours.model("human"), [free(20)]), "skeleton": swapped}
    code, error = ours.error(body)
    assert code == "retargeting_unsupported", error
    assert error["details"]["faults"], error
