"""The limits of a cache's motion, and their table in a manifest."""

from pathlib import Path

import numpy as np
import pytest

from troupe_training.data.conventions import FPS
from troupe_training.data.limits import (
    FIGURES,
    Bend,
    Frames,
    frame_figures,
    limits_of,
    measure,
    relative_parts,
    window_peaks,
)
from troupe_training.data.rotations import axis_rotation
from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import read_manifest, write_limits

SKELETON = Skeleton(["Hips", "Spine"], [-1, 0], [[0, 0, 0], [0, 0.4, 0]], [1.0, 0.0, 0.0])


def frames(roots: np.ndarray, pelvis: np.ndarray, bend: np.ndarray) -> Frames:
    """Motion of pelvis and spine: places, and world rotations about Y and X in degrees."""
    hips = axis_rotation("Y", pelvis)
    world = np.stack([hips, hips @ axis_rotation("X", bend)], 1)
    return Frames.of(SKELETON.forward_kinematics(roots, world), world, SKELETON)


def line(count: int, speed: float, height: float = 0.9) -> np.ndarray:
    roots = np.zeros((count, 3))
    roots[:, 1], roots[:, 2] = height, speed * np.arange(count) / FPS
    return roots


def test_figures_are_those_of_the_motion():
    count = 40
    roots = line(count, 1.5)
    roots[20:, 0] += 0.3  # a step aside in one frame
    clip = frames(roots, 3.0 * np.arange(count), np.full(count, 20.0))
    bends = [Bend("Spine", [1.0, 0.0, 0.0, 0.0], [-0.05] * 3, [0.05] * 3)]
    found = dict(zip(FIGURES, frame_figures(clip, np.array([0.0, 1.0, 0.0]), bends).T, strict=True))
    assert found["root_speed_mps"][10] == pytest.approx(1.5)
    assert found["root_speed_mps"][20] == pytest.approx(np.hypot(1.5, 9.0))
    assert found["root_acceleration_mps2"][19] == pytest.approx(0.3 * FPS**2)
    assert found["turning_rad_per_s"][5] == pytest.approx(np.radians(90.0), rel=1e-3)
    assert found["off_ground_m"] == pytest.approx(0.9)
    assert found["tilt_rad"] == pytest.approx(0.0, abs=1e-3)
    assert found["bend_rad"] == pytest.approx(np.radians(20.0) - 2 * np.arcsin(0.05), abs=1e-5)


def test_windows_have_the_peaks_of_their_frames():
    values = np.zeros((100, 2))
    values[70] = 5.0
    peaks = window_peaks(values)
    assert peaks.shape == (5, 2)
    assert peaks[:, 0].tolist() == [0.0, 5.0, 5.0, 5.0, 5.0]
    assert len(window_peaks(values[:20])) == 1


def test_vector_parts_do_not_depend_on_the_sign_of_a_quaternion():
    usual, turned = np.array([np.cos(0.2), np.sin(0.2), 0, 0]), np.array([[np.cos(0.5), np.sin(0.5), 0, 0]])
    for sign in (1, -1):
        assert relative_parts(usual, sign * turned) == pytest.approx(np.array([[np.sin(0.3), 0, 0]]))


def test_limits_hold_for_the_motion_that_they_are_of_and_not_for_wilder():
    rng = np.random.default_rng(1)
    sway = 20 * np.sin(np.arange(200) / 5)
    calm = [frames(line(200, speed), sway, 30 + 10 * rng.random(200)) for speed in (0.5, 1.0, 1.5)]
    limits = limits_of(SKELETON, calm)
    assert limits.root_speed_mps == pytest.approx(1.5, abs=0.01)
    assert limits.tilt_rad <= 0.01 and limits.upright == [0.0, 1.0, 0.0]
    # It is no farther from its straight course than by rounding.
    assert max(limits.root_reach_m) <= 0.01
    [spine] = limits.bends
    assert spine.usual[1] == pytest.approx(np.sin(np.radians(35 / 2)), abs=0.01)
    wild = frame_figures(
        frames(line(50, 4.0), 0 * sway[:50], np.full(50, 120.0)), np.array(limits.upright), limits.bends
    )
    found = dict(zip(FIGURES, wild.max(0), strict=True))
    assert found["root_speed_mps"] > 2 * limits.root_speed_mps
    assert found["bend_rad"] > 2 * limits.bend_rad


def test_a_table_replaces_the_one_before_and_nothing_else(cache: Path, tmp_path: Path):
    skeleton = Skeleton.load(cache / "skeleton.json")
    limits = measure(cache)
    manifest = tmp_path / "pack.toml"
    joints = "".join(f'[[skeleton.joints]]\nname = "{n}"\n' for n in skeleton.names)
    text = f'content_hash = "sha256:0"\n\n{joints}\n[training]\nclips = 1\n'
    manifest.write_text(text)
    write_limits(manifest, limits)
    once = manifest.read_text()
    write_limits(manifest, limits)
    assert manifest.read_text() == once
    assert [line for line in text.splitlines() if line and line not in once] == []
    found = read_manifest(tmp_path)
    assert found["limits"]["root_speed_mps"] == limits.root_speed_mps
    assert [bend["joint"] for bend in found["limits"]["bends"]] == skeleton.names[1:]
    assert list(found)[-1] == "training"
    manifest.write_text(text.replace(skeleton.names[1], "Tail"))
    with pytest.raises(ValueError, match="not that of the cache"):
        write_limits(manifest, limits)
