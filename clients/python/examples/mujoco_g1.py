"""Plays a G1 in MuJoCo, kinematically, and renders pictures of it: python mujoco_g1.py [ADDRESS [FOLDER]].

The model comes from the pack. Without a screen set MUJOCO_GL=egl, or MUJOCO_GL=osmesa (Debian: libosmesa6).
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image

import troupe

SECONDS, SHOTS = 4, (40, 62, 84, 106)

folder = Path(sys.argv[2] if len(sys.argv) > 2 else ".")
with troupe.Client(*sys.argv[1:2]) as client, client.session(pack="g1") as robot:
    robot.frame_options = troupe.FrameOptions(encoding=troupe.Encoding.QPOS)
    robot.walk((0.0, 0.0, 0.9))
    qpos = robot.step(30 * SECONDS).to_qpos()[:, 0]
    (folder / "g1.xml").write_text(troupe.robot_mjcf(robot.pack.skeleton))

model = mujoco.MjModel.from_xml_path(str(folder / "g1.xml"))
data = mujoco.MjData(model)
camera = mujoco.MjvCamera()
camera.distance, camera.azimuth, camera.elevation = 2.9, 205.0, -14.0
pictures = []
with mujoco.Renderer(model, 640, 400) as renderer:
    for frame, numbers in enumerate(qpos):
        data.qpos[:] = numbers
        mujoco.mj_forward(model, data)
        if frame in SHOTS:
            camera.lookat[:] = (*data.qpos[:2], 0.66)
            renderer.update_scene(data, camera)
            pictures.append(renderer.render())
Image.fromarray(np.concatenate(pictures, axis=1)).save(folder / "g1.png")
print(
    f"{len(qpos)} frames of {model.nq} numbers; the G1 went {np.linalg.norm(qpos[-1, :2] - qpos[0, :2]):.2f} m; see g1.png"
)
