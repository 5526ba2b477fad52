"""Makes the skinned body of the human pack, web/src/bodies/human.glb: `make body`. The same input gives the same file."""

import argparse
import tomllib
from pathlib import Path

import fast_simplification
import numpy as np
from body_shape import Shape, person
from glb import Rig, write_glb
from skimage.measure import marching_cubes

ROOT = Path(__file__).resolve().parents[2]
# Distance between samples of the shape, and how many triangles remain, metres and count.
VOXEL_M = 0.0095
TRIANGLES = 7800
# The pose in which the body is made: limbs are spread so that they do not grow together, degrees.
ARM_OUT, LEG_OUT = 48.0, 9.0
# Joints that a vertex may have, and how many times weights are smoothed over the mesh.
JOINTS_PER_VERTEX = 4
SMOOTHINGS = 10
# How quickly a bone's weight falls with its distance.
FALL = 5.0
# How far the last bones of limbs reach, metres.
ENDS_M = {"Head": 0.2, "Hand": 0.16, "Toes": 0.08}


def turn(axis: int, degrees: float) -> np.ndarray:
    """A rotation about an axis of the world, as a matrix."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def matrix_of(wxyz: list[float]) -> np.ndarray:
    """The matrix of a unit quaternion."""
    w, x, y, z = np.array(wxyz) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def read_rig(pack: Path, body: Path) -> tuple[Rig, float]:
    """The pack's skeleton in the pose in which the body is made, and the height of its soles, metres."""
    skeleton = tomllib.loads(pack.read_text())["skeleton"]
    described = tomllib.loads(body.read_text())
    joints = skeleton["joints"]
    if [(j["name"], j["parent"]) for j in joints] != [
        (j["name"], j["parent"]) for j in described["skeleton"]["joints"]
    ]:
        raise SystemExit(f"{body}: its joints are not those of {pack}, so its neutral pose does not fit")
    names = [joint["name"] for joint in joints]
    parents = [names.index(joint["parent"]) if joint["parent"] else -1 for joint in joints]
    offsets = np.array([joint["offset_m"] for joint in joints])
    neutral = [matrix_of(rotation) for rotation in described["neutral"]["rotations"]]

    # Spread the limbs, and set the feet flat on the ground.
    clearance = dict(zip(skeleton["contacts"]["joints"], skeleton["contacts"]["clearance_m"], strict=True))
    rotations = []
    for name, rotation in zip(names, neutral, strict=True):
        side = 1 if name.endswith("_L") else -1
        stem = name.split("_")[0]
        if stem in ("UpperArm", "LowerArm", "Hand"):
            rotation = turn(2, side * ARM_OUT) @ rotation
        elif stem in ("UpperLeg", "LowerLeg"):
            rotation = turn(2, side * LEG_OUT) @ rotation
        elif stem in ("Foot", "Toes"):
            toes = names.index(f"Toes_{name[-1]}")
            away = neutral[parents[toes]] @ offsets[toes]
            drop = clearance[f"Foot_{name[-1]}"] - clearance[f"Toes_{name[-1]}"]
            pitch = np.arcsin(drop / np.linalg.norm(away)) - np.arcsin(-away[1] / np.linalg.norm(away))
            rotation = turn(0, np.degrees(pitch)) @ rotation
        rotations.append(rotation)
    places = np.zeros((len(names), 3))
    for j, parent in enumerate(parents):
        if parent >= 0:
            places[j] = places[parent] + rotations[parent] @ offsets[j]
    sole = places[names.index("Foot_L")][1] - clearance["Foot_L"]
    return Rig(names, parents, offsets, np.array(rotations), places), sole


def surface(shape: Shape, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the shape around joints."""
    low, high = places.min(axis=0) - 0.3, places.max(axis=0) + 0.3
    axes = [np.arange(a, b, VOXEL_M) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distances = shape.distance(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, triangles, _, _ = marching_cubes(distances, 0.0, spacing=(VOXEL_M,) * 3)
    vertices = vertices + low
    share = 1 - TRIANGLES / len(triangles)
    vertices, triangles = fast_simplification.simplify(vertices.astype(np.float32), triangles.astype(np.int32), share)
    vertices = vertices.astype(np.float64)
    # Simplification leaves the surface a little; two steps of Newton's method bring vertices back
    # to it.
    for _ in range(2):
        vertices -= shape.distance(vertices)[:, None] * shape.gradient(vertices)
    return vertices, triangles


def facing_out(vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The triangles, all wound so that they face outwards."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * normals[triangles].mean(axis=1)).sum(axis=1) < 0
    flipped = triangles.copy()
    flipped[inwards] = flipped[inwards][:, ::-1]
    return flipped


def weights_of(rig: Rig, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Weights (n, joints) by distance from bones, smooth over the mesh, at most four of them above 0 in each row."""
    distances = np.full((len(vertices), len(rig.names)), np.inf)
    for j, name in enumerate(rig.names):
        children = [c for c, parent in enumerate(rig.parents) if parent == j]
        ends = [rig.places[c] for c in children] or [end_of(rig, j, ENDS_M.get(name.split("_")[0], 0.05))]
        for end in ends:
            distances[:, j] = np.minimum(distances[:, j], from_segment(vertices, rig.places[j], end))
    weights = (distances + 0.004) ** -FALL
    # Only the nearest bone and its neighbours in the tree: an arm does not move the thigh beside
    # it.
    near = neighbours(rig.parents)
    weights *= near[distances.argmin(axis=1)]
    weights /= weights.sum(axis=1, keepdims=True)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    counts = np.bincount(edges.ravel(), minlength=len(vertices))[:, None]
    for _ in range(SMOOTHINGS):
        sums = np.zeros_like(weights)
        np.add.at(sums, edges[:, 0], weights[edges[:, 1]])
        np.add.at(sums, edges[:, 1], weights[edges[:, 0]])
        weights = 0.5 * weights + 0.5 * sums / counts
    dropped = np.argsort(-weights, axis=1, kind="stable")[:, JOINTS_PER_VERTEX:]
    np.put_along_axis(weights, dropped, 0, axis=1)
    return weights / weights.sum(axis=1, keepdims=True)


def end_of(rig: Rig, joint: int, length_m: float) -> np.ndarray:
    """Where a bone without children ends: it goes on as it came."""
    away = rig.places[joint] - rig.places[rig.parents[joint]]
    if rig.names[joint].startswith("Toes"):
        away = away * np.array([1, 0, 1])
    return rig.places[joint] + away / np.linalg.norm(away) * length_m


def from_segment(places: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of places (n, 3) from a segment."""
    along = end - start
    share = np.clip((places - start) @ along / max(along @ along, 1e-12), 0, 1)
    return np.linalg.norm(places - start - share[:, None] * along, axis=1)


def neighbours(parents: list[int]) -> np.ndarray:
    """Which joints are at most two steps apart in the tree (joints, joints)."""
    step = np.eye(len(parents), dtype=bool)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            step[joint, parent] = step[parent, joint] = True
    return (step.astype(int) @ step.astype(int)) > 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pack", type=Path, default=ROOT / "models/human/pack.toml")
    parser.add_argument("--neutral", type=Path, default=ROOT / "models/unimogen/bodies/human.toml")
    parser.add_argument("--out", type=Path, default=ROOT / "web/src/bodies/human.glb")
    arguments = parser.parse_args()
    rig, sole_m = read_rig(arguments.pack, arguments.neutral)
    shape = person(dict(zip(rig.names, rig.places, strict=True)), sole_m)
    vertices, triangles = surface(shape, rig.places)
    normals = shape.gradient(vertices)
    triangles = facing_out(vertices, triangles, normals)
    weights = weights_of(rig, vertices, triangles)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    size = write_glb(arguments.out, rig, vertices, normals, triangles, weights, shape.shade(vertices))
    print(f"{arguments.out}: {len(triangles)} triangles, {len(vertices)} vertices, {size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
