"""NVIDIA's public code beside Troupe: ratios of turns, processes that begin together, and the walk that requests are made of."""

import math
import random
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import troupe_reader
from troupe_bench import figures, official, report_tables
from troupe_bench.machine import ROOT, busy_share, cores
from troupe_bench.programs import Failed
from troupe_bench.settings import OFFICIAL_WAYS, Settings
from troupe_bench.store import Store
from troupe_bench.walk import FRAMES, angles, write_walk

G1 = ROOT / "models" / "g1"


def measured(store: Store) -> None:
    """Two turns in which everything takes twice as long the second time, but Troupe."""
    speeds = {"alone": 400.0, "processes": 500.0, "alone-bf16": 800.0, "batched": 1000.0, "batched-bf16": 2000.0}
    for repeat, slow in enumerate((1, 2)):
        for way, speed in speeds.items():
            key = {"target": "public", "way": way, "frames": 40, "repeat": repeat}
            store.add(key, {"p50_ms": 40_000 / speed * slow, "frames_per_s": speed / slow})
        for engine, speed in (("cpu", 2000.0), ("openvino-bf16", 10_000.0)):
            key = {"target": "troupe", "engine": engine, "frames": 40, "repeat": repeat}
            store.add(key | {"way": "alone"}, {"p50_ms": 40_000 / speed, "frames_per_s": speed})
            store.add(key | {"way": "saturated"}, {"p50_ms": 500.0, "frames_per_s": speed})
    # A turn that was stopped.
    store.add({"target": "public", "way": "alone", "frames": 40, "repeat": 2}, {"p50_ms": 1.0, "frames_per_s": 1e6})


def test_turns_stay_together_and_the_fastest_way_of_the_public_code_counts(tmp_path: Path):
    store = Store(tmp_path, "official")
    measured(store)
    found = {(row["engine"], row["what"]): row["spread"] for row in figures.official(store)["ratios"]}
    assert found == {
        ("cpu", "alone"): [5.0, 7.5, 10.0],
        ("cpu", "alone_changed"): [5.0, 7.5, 10.0],
        ("cpu", "published"): [4.0, 6.0, 8.0],
        ("cpu", "changed"): [2.0, 3.0, 4.0],
        ("openvino-bf16", "alone"): [25.0, 37.5, 50.0],
        ("openvino-bf16", "alone_changed"): [12.5, 18.75, 25.0],
        ("openvino-bf16", "published"): [20.0, 30.0, 40.0],
        ("openvino-bf16", "changed"): [5.0, 7.5, 10.0],
    }


def test_the_tables_have_every_way_of_both(tmp_path: Path):
    store = Store(tmp_path, "official")
    measured(store)
    machine = [{"title": "box", "parts": {"official": figures.official(store)}}]
    rows = report_tables.official(machine)
    assert len(rows) == 2 + len(OFFICIAL_WAYS) + 4
    assert "| NVIDIA's code | as published, a process a core | f32 | box | 375 | – | 120.0 | – |" in rows
    assert "| **Troupe** | 32 clients | bf16 | box | 10,000 | – | 500.0 | – |" in rows
    ratios = report_tables.official_ratios(machine)
    published = "frames/s, NVIDIA's code as published"
    assert f"| {published} | 40 | bf16 | box | 30.0 × (20.0 to 40.0) | ≥ 25 × |" in ratios
    assert f"| {published} | 40 | f32 | box | 6.0 × (4.0 to 8.0) |  |" in ratios


def process(code: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def test_processes_begin_when_all_are_ready():
    code = "import time; time.sleep({}); at = time.time(); print('a note\\nready', flush=True); input(); print(at, time.time())"
    pair = [process(code.format(seconds)) for seconds in (0, 0.5)]
    times = [[float(number) for number in text.split()] for text in official._together(pair)]
    assert min(begun for _, begun in times) >= max(ready for ready, _ in times)


@pytest.mark.parametrize(
    ("code", "why"), [("", "before it was ready"), ("print('ready', flush=True); input(); 1 / 0", "failed")]
)
def test_public_code_that_fails_is_no_figure(code: str, why: str):
    with pytest.raises(Failed, match=why):
        official._together([process(code)])


def test_other_work_on_the_cores_is_noticed():
    many = max(1, int(cores()))
    running = [process("while True: pass") for _ in range(many)]
    try:
        assert busy_share(0.5) > 0.5
    finally:
        for one in running:
            one.kill()
            one.wait()


def test_nothing_is_measured_beside_other_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "out" / "motionbricks_pose").mkdir(parents=True)
    monkeypatch.setattr(official, "prepare", lambda *_: None)
    monkeypatch.setattr(official, "busy_share", lambda _: 0.4)
    with pytest.raises(Failed, match="other programs take 40% of the cores, at most 5% is allowed"):
        official.measure(Settings(official=tmp_path, results=tmp_path / "results"))
    assert not (tmp_path / "results").exists()


def test_a_folder_that_is_no_checkout_is_refused_with_what_is_expected(tmp_path: Path):
    settings = Settings()
    with pytest.raises(Failed, match="--official names a checkout"):
        official.checkout_of(settings)
    settings.official = tmp_path
    with pytest.raises(Failed, match="a checkout is expected"):
        official.checkout_of(settings)
    (tmp_path / "motionbricks" / "out" / "motionbricks_pose").mkdir(parents=True)
    assert official.checkout_of(settings) == tmp_path / "motionbricks"


def test_angles_are_those_of_the_channels():
    def about(axis: int, degrees: float) -> np.ndarray:
        cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = np.eye(3)
        one, other = (axis + 1) % 3, (axis + 2) % 3
        turn[one, one], turn[one, other], turn[other, one], turn[other, other] = cos, -sin, sin, cos
        return turn

    draw = random.Random(3)
    for _ in range(50):
        w, x, y, z = numbers = np.array([draw.gauss(0, 1) for _ in range(4)])
        w, x, y, z = numbers / np.linalg.norm(numbers)
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        about_z, about_x, about_y = angles((w, x, y, z))
        assert np.allclose(about(2, about_z) @ about(0, about_x) @ about(1, about_y), matrix)


def test_the_walk_is_the_robots(tmp_path: Path):
    write_walk(G1, tmp_path / "walk.bvh")
    clip = troupe_reader.read(tmp_path / "walk.bvh")
    joints = tomllib.loads((G1 / "pack.toml").read_text())["skeleton"]["joints"]
    assert set(clip.skeleton.names) == {joint["name"] for joint in joints}
    positions, _ = clip.world()
    assert len(positions) == FRAMES
    pelvis, foot = (positions[:, clip.skeleton.names.index(name)] for name in ("pelvis", "left_ankle_roll"))
    speed_mps = (pelvis[-1, 2] - pelvis[0, 2]) / (FRAMES - 1) * 30
    assert 1.0 < speed_mps < 1.5
    assert 0.7 < pelvis[:, 1].min() < pelvis[:, 1].max() < 0.85
    # The feet are near the ground, and one of them is lifted.
    assert 0.0 < foot[:, 1].min() < 0.1
    assert 0.05 < np.ptp(foot[:, 1]) < 0.4
