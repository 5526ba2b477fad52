"""Cuts of motion, and mirroring."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from robot_support import biped, walk_rows, write_robot, write_rows
from troupe_training.data.clips import Clip, ClipError, cut
from troupe_training.data.mirror import MirrorError, mirror_of
from troupe_training.data.prepare import Choice, prepare
from troupe_training.data.rotations import columns_to_matrix, six_d_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import ClipStore
from troupe_training.robots.hinges import Hinges
from troupe_training.robots.source import RobotSource

WORLD = np.array([-1.0, 1.0, 1.0])


@pytest.fixture
def source(tmp_path: Path) -> RobotSource:
    (tmp_path / "toy.urdf").write_text(biped())
    return RobotSource(tmp_path / "toy.urdf")


def loaded(source: RobotSource, tmp_path: Path, rows: list[list[float]]):
    return source.load(write_rows(tmp_path / "clip.csv", rows))


def test_a_clip_is_split_where_its_root_shifts(source: RobotSource, tmp_path: Path):
    rows = walk_rows(100, 0.8, 20, 1)
    for row in rows[60:]:
        row[0] += 0.05
    clips, notes = cut("clip.csv", loaded(source, tmp_path, rows))
    assert [(c.name, c.file, c.first_frame, len(c.positions)) for c in clips] == [
        ("clip_part1.csv", "clip.csv", 0, 60),
        ("clip_part2.csv", "clip.csv", 60, 40),
    ]
    assert notes == ["cut before frame 60: pelvis shifts by 5 cm in one frame"]


def test_a_hard_landing_is_no_shift(source: RobotSource, tmp_path: Path):
    rows = walk_rows(100, 0.0, 0, 1)
    for frame, row in enumerate(rows):
        row[2] += max(0, 40 - frame) * 3.0 / 30  # falls at 3 m/s and stands at once
    clips, notes = cut("clip.csv", loaded(source, tmp_path, rows))
    # A robot that does not walk shows no order of its quaternion.
    assert [c.name for c in clips] == ["clip.csv"] and all("--quaternion decides" in note for note in notes)


def test_a_clip_is_split_where_a_joint_jumps(source: RobotSource, tmp_path: Path):
    rows = walk_rows(80, 0.5, 0, 1)
    for row in rows[30:]:
        row[15] -= 1.6  # the right arm is suddenly up
    motion = loaded(source, tmp_path, rows)
    clips, notes = cut("clip.csv", motion)
    assert [c.first_frame for c in clips] == [0, 30]
    assert len(notes) == 1 and notes[0].startswith("cut before frame 30: right_hand moves at 2")


def test_frames_deep_below_the_ground_are_left_out_and_said(source: RobotSource, tmp_path: Path):
    rows = walk_rows(100, 0.5, 0, 1)
    for frame, row in enumerate(rows):
        row[2] -= 0.03 * max(0, 10 - abs(frame - 50))
    clips, notes = cut("clip.csv", loaded(source, tmp_path, rows))
    left = sum(len(c.positions) for c in clips)
    assert len(clips) == 2 and 85 < left < 97
    assert len(notes) == 1 and "below the ground" in notes[0] and "left out" in notes[0]
    for row in rows:
        row[2] -= 1.0
    with pytest.raises(ClipError, match="nothing is left of it: frames 0 to 99 left out"):
        cut("clip.csv", loaded(source, tmp_path, rows))


def test_prepare_mirrors_training_clips_only(tmp_path: Path, capsys: pytest.CaptureFixture):
    folder = write_robot(tmp_path / "robot")
    rows = walk_rows(60, 0.5, 0, 1)
    write_rows(folder / "csv" / "floating_subject1.csv", [[*r[:2], r[2] + 0.1, *r[3:]] for r in rows])
    write_rows(folder / "csv" / "short_subject1.csv", rows[:5])
    choice = Choice(test_name="subject5", mirror=True)
    prepare(folder / "csv", tmp_path / "cache", RobotSource(folder / "toy.urdf"), 1, tmp_path / "list", choice)
    made = json.loads((tmp_path / "cache" / "clips.json").read_text())
    tests = [c["name"] for c in made["clips"] if c["test"]]
    assert tests == [f"walk{i:02}_subject5.csv" for i in (0, 4, 8, 12)]
    assert (tmp_path / "list").read_text().split() == tests
    mirrored = [c for c in made["clips"] if c.get("mirrored")]
    assert len(mirrored) == 13 and not any(c["test"] for c in mirrored)
    assert "walk01_subject1_M.csv" in [c["name"] for c in mirrored]
    assert made["dropped"] == {"short_subject1.csv": "only 5 frames, at least 16 are needed"}
    assert any("+0.1" in note for note in made["notes"]["floating_subject1.csv"])
    said = capsys.readouterr().out
    assert "17 clips" in said and "dropped short_subject1.csv" in said and "feet stand +0.1" in said
    skeleton = ClipStore(tmp_path / "cache", "train").skeleton
    assert skeleton.robot["name"] == "toy" and len(skeleton.robot["hinges"]) == 9
    # The sole is at the ground, the ankle 5 cm above it.
    assert skeleton.contact_clearance_m[0] - skeleton.contact_clearance_m[1] == pytest.approx(0.05, abs=0.02)


def robot_clip(source: RobotSource, tmp_path: Path) -> tuple[Skeleton, Clip, np.ndarray]:
    rows = walk_rows(60, 0.8, 40, 1)
    motion = loaded(source, tmp_path, rows)
    clips, _ = cut("clip.csv", motion)
    return (source.skeleton(motion.names, motion.parents, motion.offsets, clips), clips[0], np.array(rows)[:, 7:])


def test_a_mirrored_robot_is_the_mirror_image(source: RobotSource, tmp_path: Path):
    skeleton, clip, angles = robot_clip(source, tmp_path)
    mirror = mirror_of(skeleton, [clip])
    assert mirror.notes == []
    seen = mirror.clip(clip)
    assert seen.name == "clip_M.csv" and seen.mirrored
    np.testing.assert_allclose(seen.positions[:, mirror.partners], clip.positions * WORLD, atol=1e-5)
    # In angles: left and right swapped; pitch as it is, waist yaw and shoulder roll with the other
    # sign.
    expected = np.concatenate([angles[:, 3:6], angles[:, :3], -angles[:, 6:7], -angles[:, 8:9], -angles[:, 7:8]], 1)
    turned = Hinges(skeleton).project(six_d_to_matrix(torch.from_numpy(seen.six_d)))
    np.testing.assert_allclose(turned.angles, expected, atol=1e-3)
    np.testing.assert_allclose(mirror.clip(seen).six_d, clip.six_d, atol=1e-6)


def test_a_robot_without_a_mirror_image_is_refused(source: RobotSource, tmp_path: Path):
    skeleton, clip, _ = robot_clip(source, tmp_path)
    offsets = [list(o) for o in skeleton.offsets]
    offsets[skeleton.names.index("left_shoulder")][1] += 0.02
    with pytest.raises(MirrorError, match=r"left_shoulder is 20 mm off the mirror image of right_shoulder"):
        mirror_of(replace(skeleton, offsets=offsets), [clip])
    robot = json.loads(json.dumps(skeleton.robot))
    robot["hinges"][1]["axis"] = [0.6, 0.8, 0.0]
    with pytest.raises(MirrorError, match="the axis of left_knee is not the mirror image of right_knee's"):
        mirror_of(replace(skeleton, robot=robot), [clip])


def test_a_hinge_may_stand_anywhere_along_its_own_axis(source: RobotSource, tmp_path: Path):
    skeleton, clip, _ = robot_clip(source, tmp_path)
    offsets = [list(o) for o in skeleton.offsets]
    offsets[skeleton.names.index("left_shoulder")][2] += 0.03  # ahead, as the axis of the roll
    with pytest.raises(MirrorError, match=r": left_hand is 30 mm off the mirror image of right_hand; right_hand"):
        mirror_of(replace(skeleton, offsets=offsets), [clip])
    offsets[skeleton.names.index("left_hand")][2] -= 0.03
    moved = replace(skeleton, offsets=offsets)
    seen = mirror_of(moved, [clip]).clip(clip)
    hand, partner = (skeleton.names.index(f"{side}_hand") for side in ("left", "right"))
    np.testing.assert_allclose(seen.positions[:, hand], clip.positions[:, partner] * WORLD, atol=1e-5)


def test_a_bvh_skeleton_with_mirrored_axes_is_mirrored_too(cache: Path):
    """Captures often give the right side's joints axes of their own; the images must not depend on them."""
    store = ClipStore(cache, "train")
    skeleton = store.skeleton
    spans = [slice(c["start"], c["start"] + c["frames"]) for c in store.clips]
    plain = [Clip("a.bvh", "a.bvh", 0, store.positions[s].numpy(), store.six_d[s].numpy()) for s in spans]
    # The same motion with the axes of the right side's joints turned: R' = R Q, and the bones below
    # in the new axes.
    turn = np.diag([1.0, -1.0, -1.0])
    turned_joints = [j for j, name in enumerate(skeleton.names) if name.endswith("_R")]
    offsets = np.array(skeleton.offsets)
    for j, parent in enumerate(skeleton.parents):
        if parent in turned_joints:
            offsets[j] = turn.T @ offsets[j]
    turned_skeleton = replace(skeleton, offsets=offsets.tolist())

    def turned(clip: Clip) -> Clip:
        world = columns_to_matrix(clip.six_d)
        world[:, turned_joints] = world[:, turned_joints] @ turn
        return replace(clip, six_d=np.concatenate([world[..., 0], world[..., 1]], -1).astype(np.float32))

    images = [mirror_of(skeleton, plain).clip(c) for c in plain]
    with_axes = mirror_of(turned_skeleton, [turned(c) for c in plain])
    for clip, image in zip(plain, images, strict=True):
        again = with_axes.clip(turned(clip))
        np.testing.assert_allclose(again.positions[:, with_axes.partners], clip.positions * WORLD, atol=1e-3)
        np.testing.assert_allclose(again.positions, image.positions, atol=1e-5)
        np.testing.assert_allclose(again.six_d, turned(image).six_d, atol=1e-5)


def test_a_skeleton_whose_bones_differ_is_refused(cache: Path):
    store = ClipStore(cache, "train")
    offsets = [list(o) for o in store.skeleton.offsets]
    offsets[store.skeleton.names.index("LowerLeg_L")][1] -= 0.03
    span = slice(0, store.clips[0]["frames"])
    clip = Clip("a", "a", 0, store.positions[span].numpy(), store.six_d[span].numpy())
    with pytest.raises(MirrorError, match="bones below UpperLeg_L are not the mirror image of those below UpperLeg_R"):
        mirror_of(replace(store.skeleton, offsets=offsets), [clip])
    names = [n.replace("Arm_L", "Arm_X") for n in store.skeleton.names]
    with pytest.raises(MirrorError, match="Arm_X"):
        mirror_of(replace(store.skeleton, names=names), [clip])
