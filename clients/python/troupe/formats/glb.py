"""Binary glTF 2.0: a node a joint, one animation, and a plain mesh a bone so that viewers show something."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from troupe import rotation
from troupe.arrays import F32
from troupe.skeleton import Skeleton

_FLOAT, _SHORT = 5126, 5123
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
MIN_BONE_M = 1e-3
"""Bones shorter than this get no mesh."""
_XYZW = [1, 2, 3, 0]


class _Builder:
    """The JSON root and the binary chunk, as they grow."""

    def __init__(self) -> None:
        self.root: dict[str, Any] = {"bufferViews": [], "accessors": [], "meshes": [], "nodes": []}
        self.data = bytearray()

    def add(self, values: np.ndarray, *, bounds: bool = False) -> int:
        """An accessor of numbers (n) or vectors (n, 3 or 4)."""
        width = values.shape[1] if values.ndim == 2 else 1
        data = values.tobytes()
        self.root["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data + bytes(-len(data) % 4)
        accessor: dict[str, Any] = {
            "bufferView": len(self.root["bufferViews"]) - 1,
            "componentType": _SHORT if values.dtype == np.uint16 else _FLOAT,
            "count": len(values),
            "type": _KINDS[width],
        }
        if bounds:
            table = values.reshape(len(values), width)
            accessor |= {"min": table.min(0).tolist(), "max": table.max(0).tolist()}
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def add_bones(self, skeleton: Skeleton) -> dict[int, int]:
        """A mesh for each joint with children: its index by the joint's."""
        meshes = {}
        for joint in range(skeleton.joint_count):
            tips = [skeleton.offsets[child] for child in skeleton.children(joint)]
            parts = [_octahedron(tip) for tip in tips if np.linalg.norm(tip) >= MIN_BONE_M]
            if not parts:
                continue
            corners = np.concatenate([indices + 6 * nth for nth, (_, indices) in enumerate(parts)]).astype(np.uint16)
            positions = self.add(np.concatenate([vertices for vertices, _ in parts]), bounds=True)
            primitive = {"attributes": {"POSITION": positions}, "indices": self.add(corners)}
            self.root["meshes"].append({"name": skeleton.names[joint], "primitives": [primitive]})
            meshes[joint] = len(self.root["meshes"]) - 1
        return meshes

    def finish(self) -> bytes:
        """The container: a header, the JSON chunk, the binary chunk; all lengths are multiples of four."""
        text = json.dumps(self.root, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write(skeleton: Skeleton, fps: float, root: F32, rotations: F32) -> bytes:
    """The file of native frames (frames, characters, ...), one tree of nodes for each character."""
    builder = _Builder()
    meshes = builder.add_bones(skeleton)
    times = builder.add((np.arange(len(root)) / fps).astype(np.float32), bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def track(node: int, path: str, output: int) -> None:
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append({"input": times, "interpolation": "LINEAR", "output": output})

    for nth in range(root.shape[1]):
        first = len(builder.root["nodes"])
        turns = rotation.continuous(np.ascontiguousarray(rotations[:, nth]))[..., _XYZW]
        for joint in range(skeleton.joint_count):
            place = skeleton.offsets[joint] if joint else root[0, nth]
            node: dict[str, Any] = {
                "name": skeleton.names[joint],
                "translation": place.tolist(),
                "rotation": turns[0, joint].tolist(),
            }
            children = [first + child for child in skeleton.children(joint)]
            if children:
                node["children"] = children
            if joint in meshes:
                node["mesh"] = meshes[joint]
            builder.root["nodes"].append(node)
        track(first, "translation", builder.add(np.ascontiguousarray(root[:, nth], np.float32), bounds=True))
        for joint in range(skeleton.joint_count):
            output = builder.add(np.ascontiguousarray(turns[:, joint], np.float32))
            track(first + joint, "rotation", output)
    step = skeleton.joint_count
    scene = {"nodes": [step * nth for nth in range(root.shape[1])]}
    asset = {"version": "2.0", "generator": "troupe-motion"}
    more = {
        "asset": asset,
        "scene": 0,
        "scenes": [scene],
        "animations": [{"name": "motion", "samplers": samplers, "channels": channels}],
        "buffers": [{"byteLength": len(builder.data)}],
    }
    builder.root |= more
    return builder.finish()


def _octahedron(tip: F32) -> tuple[F32, np.ndarray]:
    """A slim octahedron from the origin to `tip`: six corners, and eight triangles seen counter-clockwise from outside."""
    length = float(np.linalg.norm(tip))
    along = tip / length
    helper = np.eye(3, dtype=np.float32)[int(np.argmin(np.abs(along)))]
    across = np.cross(along, helper)
    across /= np.linalg.norm(across)
    a, b = across * length * 0.08, np.cross(along, across) * length * 0.08
    middle = tip * 0.2
    vertices = np.array([np.zeros(3), middle + a, middle + b, middle - a, middle - b, tip], np.float32)
    indices = []
    for side in range(4):
        this, following = 1 + side, 1 + (side + 1) % 4
        indices += [0, following, this, 5, this, following]
    return vertices, np.array(indices)
