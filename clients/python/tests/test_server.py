"""Against a real server."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import troupe
from conftest import ROOT
from troupe import codec, rotation, v1


@pytest.fixture(scope="module")
def walk() -> troupe.Clip:
    return troupe.Clip.from_bvh(ROOT / "examples" / "walk.bvh")


def took(
    client: troupe.Client, options: troupe.FrameOptions, pack: troupe.Pack | str = "", **more: object
) -> troupe.Frames:
    """Sixty frames of a walk of a fresh character, the same for all options."""
    with client.session(troupe.SessionOptions(seed=3, **more), pack=pack) as session:  # type: ignore[arg-type]
        session.frame_options = options
        ahead = session.convention.position_from_native(np.array([0, 0, 1.2], np.float32))
        session.walk(ahead)
        return session.step(60)


def test_packs_have_skeletons_and_bodies(client: troupe.Client) -> None:
    packs = {pack.name: pack for pack in client.packs()}
    default = client.pack()
    assert default.is_default and default == packs[default.name]
    assert {"inbetween", "live"} <= default.capabilities
    assert default.joint_names[0] == "Hips" and default.skeleton.parents[0] == -1
    assert packs["g1"].robot is not None and packs["g1"].robot.qpos_size == 36
    many = client.pack("unimogen")
    assert many.of_body("horse").skeleton.joint_count != many.of_body("human").skeleton.joint_count
    with pytest.raises(troupe.InvalidArgumentError, match="allowed: human") as caught:
        many.of_body("cow")
    assert caught.value.field == "body"
    with pytest.raises(troupe.InvalidArgumentError, match=r"client\.pack"):
        packs["unimogen"].of_body("horse")
    with pytest.raises(troupe.NotFoundError) as missing:
        client.pack("absent")
    assert missing.value.request_id


def test_compact_frames_are_those_of_floats_within_the_documented_error(client: troupe.Client) -> None:
    floats = took(client, troupe.FrameOptions())
    again = took(client, troupe.FrameOptions())
    assert np.array_equal(floats.rotations, again.rotations) and np.array_equal(floats.root, again.root)
    compact = took(client, troupe.FrameOptions(encoding=troupe.Encoding.COMPACT))
    assert rotation.angle_between(floats.rotations, compact.rotations).max() <= codec.MAX_ROTATION_ERROR_RAD
    assert np.abs(floats.root - compact.root).max() <= codec.MAX_ROOT_ERROR_M
    assert np.array_equal(floats.contacts, compact.contacts) and floats.contacts.any()


@pytest.mark.parametrize("convention", troupe.Convention)
def test_world_positions_are_the_servers(client: troupe.Client, convention: troupe.Convention) -> None:
    framed = took(client, troupe.FrameOptions(positions=True), convention=convention)
    assert framed.positions is not None and framed.positions.shape == (60, 1, 21, 3)
    made = framed.skeleton.world(framed.root, framed.rotations, convention)[0]
    assert np.abs(made - framed.positions).max() < 1e-4 * convention.units_per_metre
    native = took(client, troupe.FrameOptions())
    assert np.abs(framed.clip().world_positions() - native.clip().world_positions()).max() < 1e-3
    packed = took(client, troupe.FrameOptions(encoding=troupe.Encoding.COMPACT), convention=convention)
    assert np.abs(packed.root - framed.root).max() <= codec.MAX_ROOT_ERROR_M * convention.units_per_metre * 1.01


def test_a_robots_qpos_is_the_same_pose(client: troupe.Client) -> None:
    options = troupe.FrameOptions(encoding=troupe.Encoding.QPOS)
    qpos = took(client, options, "g1")
    floats = took(client, troupe.FrameOptions(), "g1")
    assert qpos.qpos is not None and qpos.qpos.shape == (60, 1, 36)
    assert rotation.angle_between(qpos.rotations, floats.rotations).max() < 1e-3
    assert np.abs(floats.to_qpos()[..., 7:] - qpos.qpos[..., 7:]).max() < 1e-3
    assert np.abs(qpos.root - floats.root).max() < 1e-5
    assert qpos.hinge_residuals is not None and qpos.hinge_residuals.shape == (60, 1)
    assert qpos.skeleton.robot is not None
    most = np.array([hinge.max_speed for hinge in qpos.skeleton.robot.hinges])
    ratios = np.abs(np.diff(qpos.qpos[:, 0, 7:], axis=0)) * qpos.fps / most
    assert qpos.hinge_speed_ratios is not None and qpos.fastest_hinges is not None
    assert np.abs(ratios.max(1) - qpos.hinge_speed_ratios[1:, 0]).max() < 1e-3
    there = np.take_along_axis(ratios, qpos.fastest_hinges[1:], 1)[:, 0]
    assert np.abs(there - qpos.hinge_speed_ratios[1:, 0]).max() < 1e-3
    assert qpos.hinge_accelerations is not None and qpos.hinge_accelerations.shape == (60, 1)


def test_a_gap_is_filled_and_its_ends_are_met(client: troupe.Client, walk: troupe.Clip) -> None:
    pack = client.pack()
    clip = walk.on(pack.skeleton)
    gap = troupe.InBetween.from_clip(clip, 30, 65, seed=7, id="a", intermediates=True)
    answer = client.in_between(gap, pack=pack)
    assert (answer.id, len(answer.clip), answer.clip.fps) == ("a", 39, pack.fps)
    assert np.abs(answer.clip.root[-1] - clip.root[65]).max() < 1e-5
    assert rotation.angle_between(answer.clip.rotations[-1], clip.rotations[65]).max() < 1e-3
    assert rotation.angle_between(answer.clip.rotations[:4], clip.rotations[27:31]).max() < 1e-3
    assert answer.intermediates is not None and answer.intermediates.tokens and answer.timing.total_us > 0
    again = client.in_between_many([gap, gap], pack=pack)
    assert all(np.array_equal(one.clip.rotations, answer.clip.rotations) for one in again)


def test_a_given_root_is_met(client: troupe.Client, walk: troupe.Clip) -> None:
    pack = client.pack()
    clip = walk.on(pack.skeleton)
    x, _, z = clip.root[47]
    aside = [troupe.RootKey(20, x + 0.25, z), troupe.RootKey(26, x + 0.3, z + 0.25, height=0.9, heading=0.2)]
    gap = troupe.InBetween.from_clip(clip, 30, 65, root=aside)
    made = client.in_between(gap, pack=pack).clip
    for key in aside:
        assert np.abs(made.root[key.frame, [0, 2]] - (key.x, key.z)).max() < 1e-3
    assert abs(made.root[26, 1] - 0.9) < 1e-3
    assert np.abs(made.root[-1] - clip.root[65]).max() < 1e-3
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        client.in_between(troupe.InBetween.from_clip(clip, 30, 65, root=[troupe.RootKey(39, x, z)]), pack=pack)
    assert caught.value.field == "characters[0].root[0].frame"


def test_part_of_a_keyframe_is_enough(client: troupe.Client, walk: troupe.Clip) -> None:
    pack = client.pack()
    clip = walk.on(pack.skeleton)
    there = clip.root[30] + (0.2, 0, 1.0)
    for key in (
        troupe.Keyframe(root=there, heading=0.3),
        troupe.Keyframe(rotations=clip.rotations[50], root_height=float(clip.root[50, 1])),
        troupe.Keyframe(velocity=(0, 1.0, 0), root_height=0.9),
    ):
        made = client.in_between(troupe.InBetween(clip[27:31], [key], frames=40), pack=pack).clip
        assert len(made) == 40
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        client.in_between(troupe.InBetween(clip[27:31], [troupe.Keyframe(root=there)], frames=40), pack=pack)
    assert caught.value.field == "characters[0].targets[0].root.heading"


def test_refusals_name_field_and_range(client: troupe.Client, walk: troupe.Clip) -> None:
    pack = client.pack()
    clip = walk.on(pack.skeleton)
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        client.in_between(troupe.InBetween(clip[27:31], clip[65:66], frames=5), pack=pack)
    assert (caught.value.field, caught.value.allowed) == ("characters[0].frame_count", "12 to 64")
    assert caught.value.reason == "INVALID_FIELD"
    with pytest.raises(troupe.InvalidArgumentError) as ours:
        client.in_between(troupe.InBetween(clip[27:31], [troupe.Keyframe(rotations=np.zeros((5, 4)))]), pack=pack)
    assert (ours.value.field, ours.value.allowed) == ("characters[0].targets[0].rotations", "(21, 4)")
    with pytest.raises(troupe.InvalidArgumentError, match="allowed: 3 <= after"):
        troupe.InBetween.from_clip(clip, 2, 30)


def test_a_robots_keyframes_may_be_qpos(client: troupe.Client) -> None:
    frames = took(client, troupe.FrameOptions(encoding=troupe.Encoding.QPOS), "g1")
    assert frames.qpos is not None
    keys = [troupe.Keyframe(qpos=numbers) for numbers in frames.qpos[:, 0]]
    answer = client.in_between(troupe.InBetween(keys[20:24], [keys[50]], frames=31), pack="g1")
    assert answer.qpos is not None and answer.qpos.shape == (31, 36)
    assert np.abs(answer.qpos[-1, 7:] - frames.qpos[50, 0, 7:]).max() < 1e-3
    assert answer.hinge_residuals.shape == (31,)
    assert answer.hinge_speed_ratios.shape == answer.hinge_accelerations.shape == (31,)
    assert answer.hinge_speed_ratios[0] == 0 and answer.hinge_speed_ratios.max() > 0
    assert answer.feasibility is not None and answer.feasibility.hinge_speed.limit > 0


def test_a_horse_follows_a_path(client: troupe.Client) -> None:
    points = np.array([[0, 0, 0], [0, 0, 1.5], [0.4, 0, 3]])
    path = troupe.FollowPath(points, words={"trot": 1.0}, steps=2)
    parts = list(client.generate_parts(path, pack="unimogen", body="horse", seed=3))
    made = troupe.join_clips([part.clip for part in parts])
    assert np.linalg.norm(made.root[-1, [0, 2]] - points[-1, [0, 2]]) < 0.3
    assert made.skeleton == client.pack("unimogen").of_body("horse").skeleton
    further = made.root[-1] * (1, 0, 1) + [[0, 0, 0], [0, 0, 1]]
    on = client.generate(troupe.FollowPath(further, steps=2), pack="unimogen", body="horse", past=made[-4:])
    assert np.linalg.norm(on.clip.root[0] - made.root[-4]) < 0.5
    with pytest.raises(troupe.InvalidArgumentError, match="gallivant"):
        client.generate(troupe.FollowPath(points, words={"gallivant": 1.0}), pack="unimogen")


def test_feet_of_a_path_stand_unless_the_network_s_own_frames_are_wanted(client: troupe.Client) -> None:
    own = troupe.Planner.OWN
    path = troupe.FollowPath([[0, 0, 0], [0, 0, 5]], times=[0, 5], words={"walk": 1.0}, planner=own)

    def slowest_toe(raw: bool) -> float:
        """Mean way of the slower toe over the ground, metres a frame. In a walk one foot always stands."""
        clip = client.generate(path, pack="unimogen", body="human", seed=1, raw=raw).clip
        toes = [clip.skeleton.names.index(name) for name in ("Toes_L", "Toes_R")]
        ways = np.diff(clip.world_positions()[20:-20, toes][:, :, [0, 2]], axis=0)
        return float(np.linalg.norm(ways, axis=2).min(1).mean())

    assert slowest_toe(raw=False) < 0.001 < slowest_toe(raw=True)


def test_a_path_is_planned_by_another_pack_unless_its_own_is_wanted(client: troupe.Client) -> None:
    def made(planner: troupe.Planner) -> troupe.Generated:
        path = troupe.FollowPath([[0, 0, 0], [0, 0, 2]], times=[0, 2], words={"walk": 1.0}, planner=planner)
        return client.generate(path, pack="unimogen", body="h1", seed=1)

    carried, own = made(troupe.Planner.CARRIED), made(troupe.Planner.OWN)
    assert carried.notes[0].startswith("planned by g1 ")
    assert not any(note.startswith("planned by") for note in own.notes)
    assert carried.clip.skeleton == own.clip.skeleton
    assert np.abs(made(troupe.Planner.AUTO).clip.rotations - carried.clip.rotations).max() < 1e-5
    path = troupe.FollowPath([[0, 0, 0], [0, 0, 2]], planner=troupe.Planner.CARRIED)
    with pytest.raises(troupe.InvalidArgumentError, match="a body on two legs"):
        client.generate(path, pack="unimogen", body="fox")


@pytest.mark.parametrize("pack", ["human", "g1"])
def test_a_pack_of_keyframes_walks_along_a_path(client: troupe.Client, pack: str) -> None:
    path = troupe.FollowPath([[0, 0, 0], [0, 0, 3]], times=[0, 3])
    made = client.generate(path, pack=pack, seed=3)
    assert len(made.clip) == 91
    assert np.linalg.norm(made.clip.root[-1, [0, 2]] - [0, 3]) < 0.1
    place = made.clip.root[40] + np.array([0.2, 0, 0])
    pose = troupe.Keyframe(root=place, rotations=made.clip.rotations[40])
    through = troupe.FollowPath([[0, 0, 0], [0, 0, 3]], times=[0, 3], keyframes={1.5: pose})
    again = client.generate(through, pack=pack, seed=3, sampling=troupe.Sampling(temperature=0))
    assert np.abs(again.clip.root[45] - place).max() < 1e-3


def test_a_body_of_ones_own_follows_a_path(client: troupe.Client) -> None:
    own = client.pack("unimogen").of_body("fox").skeleton
    path = troupe.FollowPath([[0, 0, 0], [0, 0, 1]], skeleton=own, steps=2)
    assert client.generate(path, pack="unimogen").clip.skeleton is own


def test_words_are_for_packs_that_know_them(client: troupe.Client, walk: troupe.Clip) -> None:
    for call in (lambda: client.generate(prompt="wave"), lambda: client.describe(walk[:30])):
        with pytest.raises(troupe.TroupeError) as caught:
            call()
        assert caught.value.reason == "PACK_CANNOT", caught.value
    with pytest.raises(troupe.InvalidArgumentError, match="one of path and prompt"):
        client.generate()


def test_a_session_is_commanded_looked_at_and_closed(client: troupe.Client) -> None:
    session = client.session(troupe.SessionOptions(id="guard", position=(4, 0, 2), heading=0.5))
    try:
        assert session.id == "guard"
        frames = session.walk((0, 0, 1.4), style="elderly").step(45)
        assert frames.root.shape == (45, 1, 3) and frames.first_frames.tolist() == [1]
        info = session.info()
        assert (info.frame, info.style, info.last_sequence) == (45, "elderly", 1)
        assert session.peek().plan.root_r_g3
        session.stand().send()
        session.walk((1, 0, 0)).send_at(60)
        with pytest.raises(troupe.SessionError) as refused:
            session.style("nonsense").step()
        assert refused.value.session == "guard" and refused.value.reason == "UNKNOWN_STYLE"
        assert any(one.id == "guard" for one in client.list_sessions())
        assert client.resume_session("guard").id == "guard"
        with pytest.raises(troupe.SessionError):
            client.session(troupe.SessionOptions(id="guard"))
    finally:
        session.close()
    with pytest.raises(troupe.SessionError) as gone:
        session.step()
    assert gone.value.is_gone and gone.value.session == "guard"


def test_fifty_characters_go_as_arrays_say(client: troupe.Client) -> None:
    heading = np.linspace(-3, 3, 50)
    velocities = 1.2 * np.stack([np.sin(heading), 0 * heading, np.cos(heading)], axis=1)
    with client.crowd(50, frames=troupe.FrameOptions(encoding=troupe.Encoding.COMPACT)) as crowd:
        crowd.walk(velocities, styles=["elderly", None] * 25)
        steps = [crowd.step(15) for _ in range(6)]
        for step in steps:
            assert step.faults == () and step.members.tolist() == list(range(50))
            assert step.frames.rotations.shape == (15, 50, 21, 4)
        frames = troupe.join_frames([step.frames for step in steps[2:]])
        speed = (frames.root[-1] - frames.root[0]) / (59 / 30)
        assert np.abs(speed - velocities)[:, [0, 2]].max() < 0.5
        assert crowd[0].info().style == "elderly" and crowd[1].info().style != "elderly"
        # One goes, the others keep their numbers.
        client.close_sessions([crowd[7].id])
        step = crowd.step()
        assert [(fault.member, fault.left) for fault in step.faults] == [(7, True)]
        assert 7 not in step.members and len(step.members) == 49 and len(crowd) == 50
        with pytest.raises(IndexError, match="7"):
            crowd[7]
        crowd.walk(np.zeros((50, 3)))
        assert crowd.step().faults == ()


def test_a_step_of_an_empty_crowd_names_each_lost_member(client: troupe.Client) -> None:
    with client.crowd(3) as crowd:
        client.close_sessions([of.id for of in crowd])
        step = crowd.step()
        assert sorted(fault.member for fault in step.faults) == [0, 1, 2] and len(step.members) == 0
        assert crowd.step().frames.rotations.shape[1] == 0


def test_bodies_and_paths_of_a_crowd(client: troupe.Client) -> None:
    with client.crowd(2, pack="unimogen", body="horse") as crowd:
        for of in crowd:
            place = np.array([of.info().position.x, 0, of.info().position.z])
            of.act(troupe.follow_path([place, np.add(place, (0, 0, 1))], speed=1.5))
        happened = [event for _ in range(8) for event in crowd.step(15).events]
        arrived = [event for event in happened if event.kind == "arrived"]
        assert len(arrived) == 2 and all(event.detail.off < 0.3 for event in arrived)


def test_styles_are_listed_and_added(client: troupe.Client) -> None:
    listed = client.styles()
    assert listed.default_style in {style.name for style in listed.styles}
    new = client.style(listed.default_style)
    new.name, new.built_in = "python-own", False
    assert client.put_style(new).name == "python-own"
    assert "python-own" in {style.name for style in client.styles().styles}


def test_a_character_sits_down_in_a_scene(client: troupe.Client) -> None:
    objects = sorted((ROOT / "examples" / "objects").glob("*.toml"))
    for path in objects:
        client.put_object(path, pack="human")
    summary = client.put_scene(ROOT / "examples" / "scenes" / "courtyard.toml")
    assert summary.name == "courtyard" and {one.name for one in client.scenes()} >= {"courtyard"}
    start = troupe.SessionOptions(scene="courtyard", position=(-0.6, 0, 2.6), heading=np.pi)
    with client.session(start) as session:
        session.act(troupe.interact("stool", variant="upright"))
        kinds: list[str] = []
        for _ in range(20):
            session.step(15)
            kinds += [event.kind for event in session.events]
        assert kinds[0] == "started" and "reached" in kinds
        assert session.info().activity.kind == v1.ActivityKind.ACTIVITY_KIND_HELD
        session.act(troupe.end_interaction())
        for _ in range(10):
            session.step(15)
            kinds += [event.kind for event in session.events]
        assert kinds[-1] == "done"
        with pytest.raises(troupe.SessionError) as caught:
            session.act(troupe.interact("nothing")).step()
        assert caught.value.reason == "UNKNOWN_OBJECT"
        detected = client.detect(v1.DetectRequest(session_id=session.id, ahead=3.0))
        assert detected.scene == "courtyard"
    cup = v1.SceneObject(id="cup-9", definition="cup", position=v1.Vec3(x=0.3, y=0.8, z=2.8), heading=3.0)
    assert not client.add_objects("courtyard", [cup]).results[0].HasField("problem")
    moved = client.move_objects("courtyard", [v1.ObjectMove(id="cup-9", position=v1.Vec3(x=0.5, y=0.8, z=2.8))])
    assert not moved.results[0].HasField("problem")
    assert any(one.id == "cup-9" for one in client.scene("courtyard").objects)
    assert not client.remove_objects("courtyard", ["cup-9"]).results[0].HasField("problem")
    assert client.object_definition("cup").definition.name in {one.name for one in client.object_definitions()}
    client.delete_scene("courtyard")


def test_a_robot_sits_down_on_the_ground_and_rises(client: troupe.Client) -> None:
    assert "sit-on-ground" in client.pack("g1").skills
    with client.session(troupe.SessionOptions(seed=1), pack="g1") as session:
        session.act(troupe.skill("sit-on-ground"))
        session.step(100)
        assert session.info().activity.kind == v1.ActivityKind.ACTIVITY_KIND_HELD
        assert session.info().position.y < 0.2
        session.act(troupe.end_interaction())
        session.step(120)
        assert session.events[-1].kind == "done"
        with pytest.raises(troupe.SessionError) as caught:
            session.act(troupe.skill("fly")).step()
        assert caught.value.reason == "UNKNOWN_SKILL"


def test_an_error_in_a_document_has_its_place(client: troupe.Client) -> None:
    text = (ROOT / "examples" / "objects" / "cup.toml").read_text()
    wrong = text.replace("reach_m = ", "reach_m = 60 # ", 1)
    assert wrong != text
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        client.put_object(wrong, pack="human", check_only=True)
    line = 1 + next(nth for nth, row in enumerate(wrong.splitlines()) if "= 60 #" in row)
    assert caught.value.field == "trigger.reach_m" and caught.value.place is not None
    assert (caught.value.place[0], caught.value.allowed) == (line, "0 to 10")


def test_a_drive_gives_ticks(client: troupe.Client) -> None:
    sessions = client.sessions([troupe.SessionOptions(position=(2 * n, 0, 0)) for n in range(3)])
    with client.drive(sessions, troupe.DriveOptions(close_sessions=True, every_tick=True)) as drive:
        for of in sessions:
            of.walk((0, 0, 1.2))
        ticks = [tick for tick, _ in zip(drive, range(45), strict=False)]
        attached = [one for tick in ticks for one in tick.news]
        assert {one.session for one in attached if isinstance(one, troupe.Attached)} == set(drive.sessions)
        last = ticks[-1].frames
        assert last.root.shape == (1, 3, 3) and sorted(last.ids) == sorted(of.id for of in sessions)
        # The client counts the frames that a busy server could not send.
        assert ticks[-1].number - ticks[0].number + 1 <= len(ticks) + ticks[-1].dropped
        assert all(later.number > tick.number for tick, later in pairwise(ticks))
        together = troupe.join_frames([tick.frames for tick in ticks if len(tick.frames.ids) == 3])
        assert len(together) > 40
        # On a busy machine plans are late, and characters slow down.
        walked = (all(tick.frames.root[-1, :, 2] > 0.5) for tick, _ in zip(drive, range(300), strict=False))
        assert any(walked)
        drive[sessions[0].id].style("nonsense")
        refused = [one for tick, _ in zip(drive, range(10), strict=False) for one in tick.news]
        assert any(isinstance(one, troupe.Refused) and one.problem.reason == "UNKNOWN_STYLE" for one in refused)
        drive.detach([of.id for of in sessions])
        assert len(list(drive)) < 10, "the stream is empty"
        assert {type(one) for one in drive.news} == {troupe.Left}


def test_a_slow_reader_gets_the_newest_tick(client: troupe.Client) -> None:
    import time

    sessions = client.sessions([troupe.SessionOptions()])
    with client.drive(sessions, troupe.DriveOptions(close_sessions=True)) as drive:
        first = drive.next(10)
        time.sleep(0.5)
        second = drive.next(10)
        assert first is not None and second is not None
        assert second.number - first.number >= 10 and second.dropped >= 9


def test_a_drive_goes_on_after_the_server_was_killed(own_server: object, tmp_path: Path) -> None:
    with troupe.Client(own_server.start()) as client:  # type: ignore[attr-defined]
        (session,) = client.sessions([troupe.SessionOptions(id="survivor")])
        drive = client.drive([session], troupe.DriveOptions(reconnect=60.0, every_tick=True))
        session.walk((0, 0, 1.2))
        before = [tick for tick, _ in zip(drive, range(60), strict=False)]
        own_server.stop(kill=True)  # type: ignore[attr-defined]
        own_server.start()  # type: ignore[attr-defined]
        after = [tick for tick, _ in zip(drive, range(90), strict=False)]
        (resumed,) = [one for tick in after for one in tick.news if isinstance(one, troupe.Resumed)]
        assert resumed.session == "survivor" and resumed.restored
        numbers = [int(tick.frames.first_frames[0]) for tick in before + after]
        assert all(later > number for number, later in pairwise(numbers)), "they never go back"
        roots = np.concatenate([tick.frames.root[:, 0] for tick in before + after])
        # A busy server leaves out ticks, so that some steps are of several frames.
        steps = np.linalg.norm(np.diff(roots, axis=0), axis=1) / np.diff(numbers)
        assert steps.max() < 0.1, "no jump"
        assert after[-1].frames.root[0, 0, 2] > before[-1].frames.root[0, 0, 2] + 1.0, "it walks on"
        drive.close()


def test_a_recorded_session_is_played_again(client: troupe.Client) -> None:
    with client.session(troupe.SessionOptions(seed=5, record=True)) as session:
        session.walk((0, 0, 1.2)).step(40)
        made = client.recording(session.id)
    assert made.session_id == session.id
    played = client.replay(made.lines)
    assert played.equal and played.frames >= 40 and played.commands == 1
    changed = made.lines.replace('"z":1.2', '"z":1.1')
    assert changed != made.lines
    other = client.replay(changed)
    assert not other.equal and other.difference.frame > 0
    with client.session() as session, pytest.raises(troupe.TroupeError, match="record"):
        client.recording(session.id)


def test_packs_are_swapped_by_name(client: troupe.Client) -> None:
    same = client.swap_pack("human")
    assert (same.name, same.changed) == ("human", False)
    with pytest.raises(troupe.NotFoundError, match="unknown-pack"):
        client.load_pack("unknown-pack")
    with pytest.raises(troupe.TroupeError, match="human"):
        client.unload_pack("human")


def test_characters_wear_a_skeleton_of_ones_own(client: troupe.Client, walk: troupe.Clip, tmp_path: Path) -> None:
    file = tmp_path / "my hero.glb"
    walk.to_glb(file)
    hero = client.skeleton(file)
    assert hero.worn == "my-hero" and abs(hero.scale - 1) < 0.05
    assert hero.own is not None and not hero.own.fit.faults
    assert set(hero.skeleton.contact_joints) <= set(hero.joint_names)
    assert "my-hero" in {found.name for found in client.skeletons()}
    own = took(client, troupe.FrameOptions(), hero)
    theirs = took(client, troupe.FrameOptions())
    assert own.skeleton.names == hero.joint_names
    assert np.abs(own.root - theirs.root).max() < 0.05
    path = troupe.FollowPath([(0, 0, 0), (0, 0, 2)], seconds=2)
    made = client.generate(path=path, pack=hero)
    assert made.clip.skeleton.names == hero.joint_names
    again = client.wearing("my-hero")
    assert again.joint_names == hero.joint_names
    with pytest.raises(troupe.InvalidArgumentError) as refused:
        client.skeleton(file, pack="unimogen", body="horse", name="centaur")
    assert refused.value.field == "source" and "four" in str(refused.value)
    client.delete_skeleton("my-hero")
    with pytest.raises(troupe.NotFoundError, match="my-hero"):
        client.session(pack=hero)
