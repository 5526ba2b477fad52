"""A folder of small synthetic BVH clips: a biped that walks, turns and waves, with the structure of real captures."""

import math
import random
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.cli.options import OPTIONS
from troupe_training.data.prepare import prepare
from unimogen_support import make_cache

# Networks this small gain nothing from a second thread, and lose much on a busy machine.
torch.set_num_threads(1)
OPTIONS["--threads"]["default"] = 1

SKELETON = [  # name, parent, offset in centimetres
    ("joint_Root", None, (0, 0, 0)),
    ("Hips", "joint_Root", (0, 92, 0)),
    ("Spine", "Hips", (0, 16, 0)),
    ("Head", "Spine", (0, 40, 0)),
    ("Arm_L", "Spine", (18, 30, 0)),
    ("Arm_R", "Spine", (-18, 30, 0)),
    ("UpperLeg_L", "Hips", (9, -2, 0)),
    ("LowerLeg_L", "UpperLeg_L", (0, -40, 0)),
    ("Foot_L", "LowerLeg_L", (0, -40, 0)),
    ("Toes_L", "Foot_L", (0, -5, 12)),
    ("UpperLeg_R", "Hips", (-9, -2, 0)),
    ("LowerLeg_R", "UpperLeg_R", (0, -40, 0)),
    ("Foot_R", "LowerLeg_R", (0, -40, 0)),
    ("Toes_R", "Foot_R", (0, -5, 12)),
]


def _hierarchy(name: str, depth: int) -> list[str]:
    pad = "\t" * depth
    offset = next(o for n, _, o in SKELETON if n == name)
    channels = (
        "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        if depth < 2
        else "3 Zrotation Xrotation Yrotation"
    )
    lines = [f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {name}", pad + "{"]
    lines += [f"{pad}\tOFFSET {offset[0]} {offset[1]} {offset[2]}", f"{pad}\tCHANNELS {channels}"]
    children = [n for n, p, _ in SKELETON if p == name]
    for child in children:
        lines += _hierarchy(child, depth + 1)
    if not children:
        lines += [f"{pad}\tEnd Site", pad + "\t{", f"{pad}\t\tOFFSET 0 0 0", pad + "\t}"]
    return [*lines, pad + "}"]


def _frame(seconds: float, speed: float, heading: float, cadence: float) -> list[float]:
    phase = 2 * math.pi * cadence * seconds
    swing = 25 * math.sin(phase)
    turn = math.radians(heading)
    hips = [
        100 * speed * seconds * math.sin(turn),
        90 + 2 * math.cos(2 * phase),
        100 * speed * seconds * math.cos(turn),
    ]
    angles = {
        "Hips": (0, 0, heading),
        "Arm_L": (0, -swing, 0),
        "Arm_R": (0, swing, 0),
        "UpperLeg_L": (0, swing, 0),
        "UpperLeg_R": (0, -swing, 0),
        "LowerLeg_L": (0, 20 - 15 * math.cos(phase), 0),
        "LowerLeg_R": (0, 20 + 15 * math.cos(phase), 0),
    }
    values = [0.0] * 6 + hips + list(angles["Hips"])
    for name, _, _ in SKELETON[2:]:
        values += list(angles.get(name, (0, 0, 0)))
    return values


def write_walk(path: Path, frames: int, speed: float, heading: float, cadence: float) -> None:
    """One clip of a straight walk."""
    lines = ["HIERARCHY", *_hierarchy("joint_Root", 0), "MOTION", f"Frames: {frames}", "Frame Time: 0.0333333"]
    lines += [" ".join(f"{v:.6f}" for v in _frame(f / 30, speed, heading, cadence)) for f in range(frames)]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="session")
def bvh_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Thirty clips, and one file that is no BVH."""
    folder = tmp_path_factory.mktemp("bvh")
    rng = random.Random(7)
    for i in range(30):
        write_walk(
            folder / f"walk_{i:02}.bvh",
            rng.randint(70, 100),
            rng.uniform(0.5, 1.6),
            rng.uniform(-180, 180),
            rng.uniform(0.7, 1.2),
        )
    (folder / "broken.bvh").write_text("HIERARCHY\nROOT Hips\n{\n")
    return folder


@pytest.fixture(scope="session")
def cache(bvh_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The prepared cache of `bvh_folder`."""
    folder = tmp_path_factory.mktemp("cache")
    prepare(bvh_folder, folder)
    return folder


@pytest.fixture(scope="session")
def corpus_cache(bvh_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A corpus of two bodies."""
    return make_cache(tmp_path_factory.mktemp("corpus"), bvh_folder)


@pytest.fixture(scope="session")
def vermo_run(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of VerMo with a few updates of every stage, of tiny networks."""
    folder = tmp_path_factory.mktemp("vermo")
    common = ["--cache", str(cache), "--run", str(folder)]
    assert main(["vermo", "captions", *common]) == 0
    stages = [[name] for name in ("tokenizer", "refine", "flow", "pretrain", "instruct", "judge")]
    for stage in [*stages, ["specialist", "--task", "prediction"]]:
        size = ["--vermo-preset", "tiny", "--steps", "2", "--per-step", "512"]
        assert main(["vermo", "train", *stage, *common, *size]) == 0
    return folder
