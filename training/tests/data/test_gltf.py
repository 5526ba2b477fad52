"""A rig of two legs that walks in place, written as glTF."""

import struct
from pathlib import Path

import numpy as np
import pygltflib as gl
import pytest

from troupe_reader import ReadError
from troupe_training.data.bodies import sides_of
from troupe_training.data.corpus import Wanted, make_corpus
from troupe_training.data.gaits import feet_of, with_root_motion
from troupe_training.data.gltf import read_rig

NODES = [  # name, parent, translation
    ("root", None, (0, 0, 0)),
    ("hips", 0, (0, 1.0, 0)),
    ("leg_l", 1, (0.1, 0, 0)),
    ("foot_l", 2, (0, -1.0, 0)),
    ("leg_r", 1, (-0.1, 0, 0)),
    ("foot_r", 4, (0, -1.0, 0)),
    ("finger", 1, (0, 0.3, 0)),
]
FRAMES, SPEED_MPS = 31, 0.6


def write_rig(path: Path, clips: tuple[str, ...] = ("Walk", "Swim", "Idle")) -> Path:
    """Legs swing, hips bob, the finger leaves its bone: far in "Pointing". In "Torn" a leg leaves the body."""
    gltf = gl.GLTF2(scene=0, scenes=[gl.Scene(nodes=[0])], skins=[gl.Skin(joints=list(range(len(NODES))))])
    for i, (name, _, translation) in enumerate(NODES):
        children = [k for k, (_, parent, _) in enumerate(NODES) if parent == i]
        gltf.nodes.append(gl.Node(name=name, translation=list(translation), children=children))
    blob = b""

    def accessor(values: np.ndarray) -> int:
        nonlocal blob
        data = values.astype("<f4").tobytes()
        gltf.bufferViews.append(gl.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data)))
        kind = {1: gl.SCALAR, 3: gl.VEC3, 4: gl.VEC4}[values.shape[1]]
        view = len(gltf.bufferViews) - 1
        gltf.accessors.append(gl.Accessor(bufferView=view, componentType=gl.FLOAT, count=len(values), type=kind))
        blob += data
        return len(gltf.accessors) - 1

    phase = np.linspace(0, 2, FRAMES)
    for clip in clips:
        times = accessor((np.arange(FRAMES) / 30.0)[:, None])
        animation = gl.Animation(name=clip)
        swing = 0.0 if clip == "Idle" else 1.0
        for node, shift in ((2, 0.0), (4, 1.0)):
            place = (phase + shift) % 2
            # One second for a cycle: half of it stance, from 0.15 m ahead to 0.15 m behind.
            ahead = np.where(place < 1, 0.15 - 0.3 * place, -0.15 + 0.3 * (place - 1))
            angle = swing * -np.arcsin(ahead)
            quat = np.stack([np.sin(angle / 2), 0 * angle, 0 * angle, np.cos(angle / 2)], -1)
            animation.samplers.append(gl.AnimationSampler(input=times, output=accessor(quat)))
            channel = gl.AnimationChannelTarget(node=node, path=gl.ROTATION)
            animation.channels.append(gl.AnimationChannel(sampler=len(animation.samplers) - 1, target=channel))
        far, torn = (3.0 * (clip == name) for name in ("Pointing", "Torn"))
        for node, values in (
            (2, np.stack([0.1 + 0 * phase, 0 * phase, torn * phase], -1)),
            (1, np.stack([0 * phase, 1.0 + 0.01 * np.sin(np.pi * phase), 0 * phase], -1)),
            (6, np.stack([0 * phase, 0.3 + 0.05 * np.sin(np.pi * phase), far * phase], -1)),
        ):
            animation.samplers.append(gl.AnimationSampler(input=times, output=accessor(values)))
            channel = gl.AnimationChannelTarget(node=node, path=gl.TRANSLATION)
            animation.channels.append(gl.AnimationChannel(sampler=len(animation.samplers) - 1, target=channel))
        gltf.animations.append(animation)
    gltf.buffers = [gl.Buffer(byteLength=len(blob))]
    gltf.set_binary_blob(blob)
    gltf.save_binary(str(path))
    return path


@pytest.fixture(scope="module")
def rig_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_rig(tmp_path_factory.mktemp("rigs") / "toy-animations.glb")


def test_the_root_is_what_moves_and_loose_joints_are_held(rig_file: Path):
    rig = read_rig(rig_file)
    assert rig.rest.names == ["hips", "leg_l", "foot_l", "leg_r", "foot_r", "finger"]
    assert any("finger" in note for note in rig.notes)
    assert len(rig.clips["Walk"].positions) == FRAMES
    np.testing.assert_allclose(rig.rest.positions[0, 2], [0.1, 0, 0], atol=1e-6)


def test_keys_are_sampled_at_thirty_frames(rig_file: Path):
    walk = read_rig(rig_file).clips["Walk"]
    np.testing.assert_allclose(walk.positions[0, 2, 2], 0.15, atol=1e-5)
    np.testing.assert_allclose(walk.positions[15, 2, 2], -0.15, atol=1e-3)


def test_a_table_says_whose_rate_it_is(rig_file: Path):
    evidence = [read_rig(rig_file, given).reports[0]["fps"]["evidence"] for given in (None, {"fps": 60.0})]
    assert evidence == ["training's own: it samples the keys at this rate", "--fps"]


def test_an_animation_that_is_torn_is_named_and_the_option_works(tmp_path: Path):
    path = write_rig(tmp_path / "torn.glb", ("Walk", "Torn"))
    rig = read_rig(path)
    assert list(rig.clips) == ["Walk"] and list(rig.refused) == ["Torn"]
    assert '"leg_l" moves' in rig.refused["Torn"] and "--max-slide" in rig.refused["Torn"]
    assert list(read_rig(path, {"max_slide_m": 9.0}).clips) == ["Walk", "Torn"]
    with pytest.raises(ValueError, match="none of 1 animations can be read"):
        read_rig(write_rig(tmp_path / "all.glb", ("Torn",)))


def test_what_one_animation_leaves_out_no_animation_has(tmp_path: Path):
    rig = read_rig(write_rig(tmp_path / "pointing.glb", ("Walk", "Pointing")))
    names = ["hips", "leg_l", "foot_l", "leg_r", "foot_r"]
    assert rig.rest.names == names and [clip.names for clip in rig.clips.values()] == [names, names]
    assert rig.notes[0] == "left out of all animations, as some have them left out: finger"
    alone = read_rig(write_rig(tmp_path / "alone.glb", ("Walk",)))
    np.testing.assert_array_equal(rig.clips["Walk"].positions, alone.clips["Walk"].positions[:, :5])


def test_gltf_with_files_beside_it_is_the_same_rig(rig_file: Path, tmp_path: Path):
    gltf = gl.GLTF2().load(str(rig_file))
    gltf.convert_buffers(gl.BufferFormat.BINFILE)
    gltf.save(str(tmp_path / "toy.gltf"))
    (rig_file.parent / "0.bin").rename(tmp_path / "0.bin")
    rig, same = read_rig(tmp_path / "toy.gltf"), read_rig(rig_file)
    np.testing.assert_array_equal(rig.clips["Walk"].positions, same.clips["Walk"].positions)
    assert make_corpus([Wanted("rigs", tmp_path)], tmp_path / "cache") == ["toy"]


def test_feet_are_the_ends_of_sided_limbs_on_the_ground(rig_file: Path):
    rest = read_rig(rig_file).rest
    assert [rest.names[j] for j in feet_of(rest, sides_of(rest.names))] == ["foot_l", "foot_r"]


def test_a_gait_in_place_moves_as_held_feet_say():
    """A body whose feet slide back by turns at a steady speed goes ahead at that speed."""
    from troupe_training.data.clips import FileMotion

    frames = 30
    place = (np.arange(frames) / 15.0) % 2
    positions = np.zeros((frames, 3, 3))
    positions[:, 0, 1] = 1.0
    for foot, shift in ((1, 0.0), (2, 1.0)):
        own = (place + shift) % 2
        positions[:, foot, 2] = np.where(own < 1, 0.15 - 0.3 * own, -0.15 + 0.3 * (own - 1))
        positions[:, foot, 1] = np.where(own < 1, 0.0, 0.1 * np.sin(np.pi * own) ** 2 + 0.03)
    motion = FileMotion(
        ["hips", "l", "r"], [-1, 0, 0], np.zeros((3, 3)), positions, np.tile(np.eye(3), (frames, 3, 1, 1))
    )
    moved = with_root_motion("Walk", motion, [1, 2], 1.0)
    assert moved.motion is not None
    root = moved.motion.positions[:, 0]
    pace = (root[-1, 2] - root[0, 2]) / (len(root) - 1) * 30
    assert pace == pytest.approx(SPEED_MPS, rel=0.05)
    assert len(root) >= 120


def test_gaits_without_stance_are_left_out_and_listed(rig_file: Path, tmp_path: Path):
    assert make_corpus([Wanted("rigs", rig_file.parent, tested=False)], tmp_path) == ["toy"]
    text = (tmp_path / "report.md").read_text()
    assert "left out: Swim: moves without feet on the ground" in text


def test_other_files_are_refused(tmp_path: Path):
    path = tmp_path / "a.glb"
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12))
    with pytest.raises(ReadError, match=r"a\.glb: "):
        read_rig(path)
