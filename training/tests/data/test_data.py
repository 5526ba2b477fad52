"""Parsing, features and masks."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

import troupe_reader
from data.test_gltf import write_rig
from tests_support import random_rotations
from troupe_reader import ReadError
from troupe_training.data.joint_source import JointSource
from troupe_training.data.kinematics import Kinematics
from troupe_training.data.prepare import files_of, load_all, prepare
from troupe_training.data.roots import integrate_root
from troupe_training.data.rotations import matrix_to_quat, matrix_to_six_d, quat_to_matrix, six_d_to_matrix, yaw_matrix
from troupe_training.data.store import ClipStore, kind_of
from troupe_training.train.motionbricks.masks import random_keyframe_mask, random_slot_masks


def test_rotation_forms_agree():
    matrices = random_rotations(500)
    assert torch.allclose(six_d_to_matrix(matrix_to_six_d(matrices)), matrices, atol=1e-5)
    assert torch.allclose(quat_to_matrix(matrix_to_quat(matrices)), matrices, atol=1e-5)


def test_yaw_takes_forward_to_the_heading():
    forward = yaw_matrix(torch.tensor(torch.pi / 2)) @ torch.tensor([0.0, 0.0, 1.0])
    assert torch.allclose(forward, torch.tensor([1.0, 0.0, 0.0]), atol=1e-6)


def test_prepare_keeps_good_clips_and_names_the_broken_one(cache: Path):
    index = json.loads((cache / "clips.json").read_text())
    assert len(index["clips"]) == 30
    assert list(index["dropped"]) == ["broken.bvh"]
    understood = {what: values for what, values, _ in index["understood"]}
    assert (understood["format"], understood["up axis"], understood["metres a unit"]) == (
        "bvh (30)",
        "y (30)",
        "0.01 (30)",
    )
    skeleton = ClipStore(cache, "train").skeleton
    assert skeleton.names[0] == "Hips"
    assert skeleton.left_axis == [1.0, 0.0, 0.0]
    assert [skeleton.names[j] for j in skeleton.contact_joints] == ["Foot_L", "Toes_L", "Foot_R", "Toes_R"]


def test_bvh_errors_say_where(tmp_path: Path, bvh_folder: Path):
    text = (bvh_folder / "walk_00.bvh").read_text()
    for broken, message in (
        (text.replace("MOTION", "NOTION"), 'expected .*MOTION.*, found "NOTION"'),
        ("\n".join(text.split("\n")[:-6]) + "\n", "frames are declared"),
        (text.replace("Frame Time:", "Frame Rate:"), "line .*Time"),
    ):
        path = tmp_path / "x.bvh"
        path.write_text(broken)
        with pytest.raises(ReadError, match=message):
            JointSource().load(path)


def test_prepare_reads_every_format_of_joints(tmp_path: Path, bvh_folder: Path):
    folder = tmp_path / "motion"
    folder.mkdir()
    path = sorted(bvh_folder.glob("*.bvh"))[-1]
    (folder / "a.bvh").write_bytes(path.read_bytes())
    clip = troupe_reader.read(path)
    bones = clip.skeleton
    arrays = {"quaternions": clip.rotations, "root": clip.root_positions, "joint_names": np.array(bones.names)}
    arrays |= {"parents": np.array(bones.parents), "offsets": bones.offsets, "fps": np.array(clip.fps, np.float32)}
    np.savez(folder / "b.NPZ", **arrays)
    (folder / "b.NPZ.npz").rename(folder / "b.NPZ")
    first, second = load_all(files_of(folder, JointSource(), None), JointSource(), 1, "test")
    assert (first.file, second.file, first.dropped, second.dropped) == ("a.bvh", "b.NPZ", None, None)
    np.testing.assert_allclose(first.clips[0].positions, second.clips[0].positions, atol=1e-4)


def test_each_animation_of_a_file_is_a_clip(tmp_path: Path):
    write_rig(tmp_path / "toy.glb", ("Walk", "Torn"))
    walk, torn = load_all(files_of(tmp_path, JointSource(), None), JointSource(), 1, "test")
    assert walk.file == "toy_Walk.glb" and [clip.name for clip in walk.clips] == ["toy_Walk.glb"]
    assert torn.file == "toy_Torn.glb" and "--max-slide" in (torn.dropped or "")
    prepare(tmp_path, tmp_path / "cache")
    made = json.loads((tmp_path / "cache" / "clips.json").read_text())
    assert [clip["name"] for clip in made["clips"]] == ["toy_Walk.glb"] and list(made["dropped"]) == ["toy_Torn.glb"]


def test_segments_start_in_the_segment_frame(cache: Path):
    store = ClipStore(cache, "train")
    segments = store.segments(store.sample(8, 32, torch.Generator().manual_seed(1)), 32)
    anchor = segments.global_root[:, 3]
    assert torch.allclose(anchor[:, [0, 2]], torch.zeros(8, 2), atol=1e-5)
    assert torch.allclose(anchor[:, 3:], torch.tensor([[1.0, 0.0]]).expand(8, 2), atol=1e-4)
    # the walk goes where it faces, for every heading in the file
    assert (segments.global_root[:, -1, 2] > 0.2).all()
    assert (segments.global_root[:, -1, 0].abs() < 0.05).all()
    # pelvis position is relative to its own projection on the ground
    assert segments.positions[:, :, 0, [0, 2]].abs().max() < 1e-5


def test_kinds_are_names_without_the_take():
    assert kind_of("dataset-1_walk_old_002.bvh") == kind_of("dataset-1_walk_old_001.bvh") == "dataset-1_walk_old"
    assert kind_of("folder/jump 3.bvh") == "folder/jump"
    assert kind_of("dance.bvh") == "dance"
    assert kind_of("walk_old_002_part1_M.bvh") == kind_of("walk_old_002_M.bvh") == "walk_old"


def test_rare_kinds_are_drawn_more_often_than_their_length(cache: Path, tmp_path: Path):
    """One kind of a ninth of the segments: drawn as often as its length, its root, or evenly, as asked."""
    for file in cache.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    index = json.loads((cache / "clips.json").read_text())
    clips = [c for c in index["clips"] if not c["test"] and c["frames"] >= 67][:10]
    for i, clip in enumerate(clips):
        clip |= {"name": f"{'rare' if i == 0 else 'common'}_{i}.bvh", "frames": 67}
    (tmp_path / "clips.json").write_text(json.dumps(index | {"clips": clips}))
    first = clips[0]["start"]
    for balance, share in ((1.0, 0.1), (0.5, 0.25), (0.0, 0.5)):
        store = ClipStore(tmp_path, "train", balance=balance)
        starts = store.sample(4000, 64, torch.Generator().manual_seed(6))
        drawn = ((starts >= first) & (starts <= first + 3)).float().mean()
        assert abs(drawn - share) < 0.03
        assert len(starts.unique()) == 40, "every segment of every clip is drawn"


def test_local_root_integrates_back_to_the_global_root(cache: Path):
    store = ClipStore(cache, "train")
    segments = store.batch(512, torch.Generator().manual_seed(2), 40)
    again = integrate_root(segments.global_root[:, 0], segments.local_root)
    assert torch.allclose(again, segments.global_root, atol=1e-4)


def test_forward_kinematics_gives_the_files_positions(cache: Path):
    store = ClipStore(cache, "train")
    segments = store.batch(512, torch.Generator().manual_seed(3), 20)
    kinematics = Kinematics(store.skeleton)
    relative = kinematics.positions(six_d_to_matrix(segments.six_d)) + segments.positions[:, :, :1]
    assert torch.allclose(relative, segments.positions, atol=1e-4)


def test_keyframe_masks_keep_to_zero_to_ten_and_vary():
    mask = random_keyframe_mask(4000, 64, torch.Generator().manual_seed(4))
    counts = mask.sum(-1)
    assert counts.min() == 0 and counts.max() == 10
    assert len(np.unique(counts)) == 11
    as_served = mask[:, :4].min(-1).values == 1
    assert 0.5 < as_served.float().mean() < 0.8


def test_a_number_of_frames_that_is_one_off_is_put_right(tmp_path: Path, bvh_folder: Path):
    text = (bvh_folder / "walk_00.bvh").read_text()
    path = tmp_path / "x.bvh"
    path.write_text(text.rsplit("\n", 2)[0] + "\n")
    report = JointSource().load(path).report
    assert report is not None and [note["topic"] for note in report["repairs"]].count("frames") == 1


def test_slot_masks_always_give_the_context_root():
    masks = random_slot_masks(1000, torch.Generator().manual_seed(5))
    assert masks["global_root"][:, :4].min() == 1
    for mask in masks.values():
        share = mask[:, 4:].mean()
        assert 0.05 < share < 0.9


def test_a_moving_joint_above_the_pelvis_carries_it(tmp_path: Path, bvh_folder: Path):
    """Some captures move ``joint_Root`` instead of ``Hips``; the motion in the world is what counts."""
    lines = (bvh_folder / "walk_00.bvh").read_text().splitlines()
    body = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    for i in range(body, len(lines)):
        values = lines[i].split()
        values[0], values[2], values[6], values[8] = values[6], values[8], "0", "0"
        lines[i] = " ".join(values)
    (tmp_path / "moved.bvh").write_text("\n".join(lines) + "\n")
    moved, plain = (JointSource().load(p) for p in (tmp_path / "moved.bvh", bvh_folder / "walk_00.bvh"))
    assert moved.names == plain.names
    assert np.allclose(moved.positions, plain.positions, atol=1e-4)
