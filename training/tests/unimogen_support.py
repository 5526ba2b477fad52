"""Two small bodies, motion of them, and a corpus, for tests of UniMoGen."""

import json
from pathlib import Path

import numpy as np

from robot_support import write_robot
from troupe_training.data.bodies import Body, body_of
from troupe_training.data.corpus import Wanted, make_corpus
from troupe_training.data.joint_source import JointSource
from troupe_training.data.neutral import quaternion_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.robots.source import RobotSource

SKELETON = Skeleton(
    names=["Hips", "Spine", "Leg_L", "Foot_L", "Toes_L", "Leg_R", "Foot_R", "Toes_R"],
    parents=[-1, 0, 0, 2, 3, 0, 5, 6],
    offsets=[
        [0, 0, 0],
        [0, 0.4, 0],
        [0.1, 0, 0],
        [0, -0.9, 0],
        [0, -0.05, 0.12],
        [-0.1, 0, 0],
        [0, -0.9, 0],
        [0, -0.05, 0.12],
    ],
    left_axis=[1.0, 0.0, 0.0],
    contact_joints=[3, 4, 6, 7],
    contact_max_height_m=[0.12, 0.06, 0.12, 0.06],
    contact_max_speed_mps=0.4,
    contact_clearance_m=[0.07, 0.02, 0.07, 0.02],
)


def biped(neutral_seed: int | None = None) -> Body:
    """A body of eight joints; with a seed its joints have axes of their own, and the same neutral pose."""
    if neutral_seed is None:
        return body_of("biped", SKELETON, np.tile(np.eye(3), (8, 1, 1)))
    rng = np.random.default_rng(neutral_seed)
    turned = random_rotations(rng, 8)
    offsets = [turned[max(p, 0)].T @ np.array(o) for p, o in zip(SKELETON.parents, SKELETON.offsets, strict=True)]
    fields = json.loads(json.dumps(SKELETON.__dict__)) | {"offsets": [list(map(float, o)) for o in offsets]}
    fields["left_axis"] = [float(v) for v in turned[0].T @ np.array([1.0, 0.0, 0.0])]
    return body_of("turned", Skeleton(**fields), turned)


def random_rotations(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Uniform rotations ``[*shape, 3, 3]``."""
    quat = rng.standard_normal((*shape, 4))
    return quaternion_matrix(quat / np.linalg.norm(quat, axis=-1, keepdims=True))


def small_rotations(rng: np.random.Generator, scale: float, *shape: int) -> np.ndarray:
    """Rotations near the identity ``[*shape, 3, 3]``."""
    quat = np.concatenate([np.ones((*shape, 1)), scale * rng.standard_normal((*shape, 3))], -1)
    return quaternion_matrix(quat / np.linalg.norm(quat, axis=-1, keepdims=True))


def make_cache(folder: Path, bvh: Path) -> Path:
    """A corpus of two bodies: walking bipeds from BVH, and a robot from CSV with its URDF."""
    robot = write_robot(folder / "robot")
    wanted = [
        Wanted("walker", bvh, JointSource()),
        Wanted("toy", robot / "csv", RobotSource(robot / "toy.urdf"), test_name="subject5"),
    ]
    make_corpus(wanted, folder / "cache")
    return folder / "cache"
