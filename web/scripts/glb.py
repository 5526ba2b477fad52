"""Writes a skinned mesh as a glb file."""

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ARRAY, ELEMENTS = 34962, 34963
TYPES = {np.dtype("<f4"): 5126, np.dtype("u1"): 5121, np.dtype("i1"): 5120, np.dtype("<u2"): 5123}
SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass(frozen=True)
class Rig:
    """A skeleton in the pose in which its mesh is bound."""

    names: list[str]
    parents: list[int]
    # From the parent, in its frame (joints, 3), metres.
    offsets: np.ndarray
    # In the world: matrices (joints, 3, 3) and places (joints, 3).
    rotations: np.ndarray
    places: np.ndarray


class Buffers:
    """The binary part of a file."""

    def __init__(self):
        self.data = bytearray()
        self.views: list[dict] = []
        self.accessors: list[dict] = []

    def add(self, array: np.ndarray, target: int | None = None, normalized: bool = False, bounds: bool = False) -> int:
        """Appends an array (n, width) and returns the index of its accessor."""
        array = np.ascontiguousarray(array)
        width = array.shape[1] if array.ndim > 1 else 1
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        if target:
            view["target"] = target
        kind = {"componentType": TYPES[array.dtype], "type": SHAPES[width], "count": len(array)}
        accessor = {"bufferView": len(self.views), **kind}
        if normalized:
            accessor["normalized"] = True
        if bounds:
            accessor["min"], accessor["max"] = array.min(axis=0).tolist(), array.max(axis=0).tolist()
        self.data += array.tobytes()
        self.data += bytes(-len(self.data) % 4)
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def quaternion(matrix: np.ndarray) -> list[float]:
    """x, y, z, w of a rotation: the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix."""
    m = matrix
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    vector = np.linalg.eigh(k)[1][:, -1]
    vector = vector if vector[3] >= 0 else -vector
    return [round(float(value), 7) for value in vector]


def joint_nodes(rig: Rig) -> list[dict]:
    """The nodes of the joints, in the pose in which the mesh is bound."""
    nodes = []
    for j, (name, parent) in enumerate(zip(rig.names, rig.parents, strict=True)):
        local = rig.rotations[j] if parent < 0 else rig.rotations[parent].T @ rig.rotations[j]
        node = {"name": name, "translation": rig.offsets[j].tolist(), "rotation": quaternion(local)}
        children = [c for c, other in enumerate(rig.parents) if other == j]
        if children:
            node["children"] = children
        nodes.append(node)
    return nodes


def top_four(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints and weights (n, 4) in 255ths that add up to 255."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(weights, joints, axis=1)
    whole = np.floor(kept / kept.sum(axis=1, keepdims=True) * 255).astype(int)
    whole[:, 0] += 255 - whole.sum(axis=1)
    joints[whole == 0] = 0
    return joints.astype("u1"), whole.astype("u1")


def write_glb(
    path: Path,
    rig: Rig,
    vertices: np.ndarray,
    normals: np.ndarray,
    triangles: np.ndarray,
    weights: np.ndarray,
    shade: np.ndarray,
) -> int:
    """Writes the mesh (places in metres) with its skeleton; returns the size of the file in bytes."""
    buffers = Buffers()
    inverses = []
    for rotation, place in zip(rig.rotations, rig.places, strict=True):
        inverse = np.eye(4)
        inverse[:3, :3], inverse[:3, 3] = rotation.T, -rotation.T @ place
        inverses.append(inverse.T.ravel())
    joints, shares = top_four(weights)
    # The brightest shade is the full colour.
    colours = np.full((len(vertices), 4), 255, "u1")
    colours[:, :3] = np.round(shade / shade.max() * 255)[:, None]
    attributes = {
        "POSITION": buffers.add(vertices.astype("<f4"), ARRAY, bounds=True),
        "NORMAL": buffers.add(normals.astype("<f4"), ARRAY),
        "JOINTS_0": buffers.add(joints, ARRAY),
        "WEIGHTS_0": buffers.add(shares, ARRAY, normalized=True),
        "COLOR_0": buffers.add(colours, ARRAY, normalized=True),
    }
    indices = buffers.add(triangles.astype("<u2").ravel(), ELEMENTS)
    bind = buffers.add(np.array(inverses, "<f4"))
    nodes = joint_nodes(rig)
    material = {"name": "body", "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.62}}
    document = {
        "asset": {"version": "2.0", "generator": "Troupe, web/scripts/make_body.py"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes)]}],
        "nodes": [*nodes, {"name": "Body", "mesh": 0, "skin": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [material],
        "skins": [{"inverseBindMatrices": bind, "joints": list(range(len(nodes))), "skeleton": 0}],
        "accessors": buffers.accessors,
        "bufferViews": buffers.views,
        "buffers": [{"byteLength": len(buffers.data)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffers.data), b"BIN\0") + bytes(buffers.data)
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
    return 12 + len(chunks)
