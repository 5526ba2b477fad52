"""Each example does what it says, against a real server."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import troupe
from conftest import ROOT

EXAMPLES = ROOT / "clients" / "python" / "examples"


def run(name: str, address: str, folder: Path, **environment: str) -> str:
    command = [sys.executable, str(EXAMPLES / name), address]
    done = subprocess.run(
        command, cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_crowd_is_ten_lines(address: str, tmp_path: Path) -> None:
    lines = (EXAMPLES / "crowd.py").read_text().split('"""')[2].splitlines()
    assert len([line for line in lines if line.strip()]) == 10
    assert "after 150 ticks" in run("crowd.py", address, tmp_path)


def test_fill_gap(address: str, tmp_path: Path) -> None:
    assert "39 frames" in run("fill_gap.py", address, tmp_path)
    assert len(troupe.Clip.from_bvh(tmp_path / "filled.bvh")) == 39
    assert (tmp_path / "reached.glb").read_bytes().startswith(b"glTF")


def test_path(address: str, tmp_path: Path) -> None:
    assert "frames" in run("path.py", address, tmp_path)
    assert "</html>" in (tmp_path / "path.html").read_text()


@pytest.fixture(scope="module")
def gl() -> str:
    """Something that MuJoCo renders with here."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco pillow")
    probe = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8)"
    for kind in ("egl", "osmesa"):
        command = [sys.executable, "-c", probe]
        done = subprocess.run(command, env=os.environ | {"MUJOCO_GL": kind}, capture_output=True, check=False)
        if done.returncode == 0:
            return kind
    pytest.skip("MuJoCo renders neither with EGL nor with OSMesa here: apt-get install libosmesa6")
    raise AssertionError


def test_mujoco_g1(address: str, tmp_path: Path, gl: str) -> None:
    from PIL import Image

    assert "120 frames of 36 numbers" in run("mujoco_g1.py", address, tmp_path, MUJOCO_GL=gl)
    picture = np.asarray(Image.open(tmp_path / "g1.png"))
    assert picture.shape == (640, 1600, 3)
    for shot in np.split(picture, 4, axis=1):
        # Dark joints and their shadow on light ground.
        assert 0.01 < (shot.max(axis=2) < 110).mean() < 0.3


def test_mujoco_has_the_links_where_we_have_them(client: troupe.Client) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    with client.session(pack="g1") as session:
        frames = session.walk((0, 0, 1.2)).step(40)
        skeleton = session.pack.skeleton
    model = mujoco.MjModel.from_xml_string(troupe.robot_mjcf(skeleton))
    data = mujoco.MjData(model)
    data.qpos[:] = frames.to_qpos()[-1, 0]
    mujoco.mj_forward(model, data)
    ours = troupe.Convention.ROS.position_from_native(frames.world_positions()[-1, 0])
    theirs = np.array([data.body(name).xpos for name in skeleton.names])
    assert np.abs(ours - theirs).max() < 1e-4
    assert skeleton.robot is not None
    for hinge in skeleton.robot.hinges:
        assert np.allclose(model.joint(hinge.joint).range, (hinge.lower, hinge.upper), atol=1e-6)


def test_other_skeletons_make_no_model(arm: troupe.Skeleton) -> None:
    with pytest.raises(troupe.InvalidArgumentError, match="no robot"):
        troupe.robot_mjcf(arm)
