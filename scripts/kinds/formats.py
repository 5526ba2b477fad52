"""Files as other programs write them, of motion that is known."""

import io
import json
import struct
from typing import Any

import numpy as np

from motion import Array, Motion, matrix

SECOND = 46_186_158_000  # ticks of FBX's clock


def bvh(motion: Motion, unit_m: float = 0.01) -> str:
    """BVH with channels Z X Y."""
    lines, order = ["HIERARCHY"], []

    def add(joint: int) -> None:
        order.append(joint)
        offset = motion.offsets[joint] / unit_m if joint else np.zeros(3)
        places = "" if joint else "Xposition Yposition Zposition "
        lines.append(f"{'JOINT' if joint else 'ROOT'} {motion.names[joint]}\n{{\nOFFSET {_numbers(offset)}")
        lines.append(f"CHANNELS {3 if joint else 6} {places}Zrotation Xrotation Yrotation")
        for child in [child for child, parent in enumerate(motion.parents) if parent == joint]:
            add(child)
        lines.append("}")

    add(0)
    m = matrix(motion.turns[:, order])
    z, x = np.arctan2(-m[..., 0, 1], m[..., 1, 1]), np.arcsin(np.clip(m[..., 2, 1], -1, 1))
    angles = np.degrees(np.stack([z, x, np.arctan2(-m[..., 2, 0], m[..., 2, 2])], -1))
    lines += ["MOTION", f"Frames: {len(m)}", f"Frame Time: {1 / motion.fps:.9f}"]
    lines += [_numbers([*root / unit_m, *turns.ravel()]) for root, turns in zip(motion.roots, angles, strict=True)]
    return "\n".join(lines) + "\n"


def _numbers(of: Any) -> str:
    return " ".join(f"{number:.6f}" for number in of)


class Gltf:
    """glTF of nodes that an animation moves. `doc` may be changed before it is written."""

    def __init__(self, motion: Motion) -> None:
        self._blob = b""
        nodes: list[dict[str, Any]] = [{"name": name} for name in motion.names]
        for joint, parent in enumerate(motion.parents):
            nodes[joint]["translation"] = motion.offsets[joint].tolist()
            if parent >= 0:
                nodes[parent].setdefault("children", []).append(joint)
        self.animation: dict[str, Any] = {"name": "walk", "samplers": [], "channels": []}
        self.doc: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
            "animations": [self.animation], "accessors": [], "bufferViews": [],
        }  # fmt: skip
        self._times = self._accessor(np.arange(len(motion.roots)) / motion.fps, "SCALAR")
        self.move(0, "translation", motion.roots)
        for joint in range(len(motion.names)):
            self.move(joint, "rotation", motion.turns[:, joint][:, [1, 2, 3, 0]])

    def move(self, node: int | None, path: str, values: Array) -> dict[str, Any]:
        """Adds a channel, and returns its target."""
        output = self._accessor(values, "VEC4" if values.shape[1] == 4 else "VEC3")
        target: dict[str, Any] = {"path": path} if node is None else {"node": node, "path": path}
        self.animation["channels"].append({"sampler": len(self.animation["samplers"]), "target": target})
        self.animation["samplers"].append({"input": self._times, "output": output})
        return target

    def node(self, on: int | None = None, **fields: Any) -> int:
        """Adds a node, on the scene or on another."""
        self.doc["nodes"].append(fields)
        index = len(self.doc["nodes"]) - 1
        above = self.doc["scenes"][0]["nodes"] if on is None else self.doc["nodes"][on].setdefault("children", [])
        above.append(index)
        return index

    def glb(self) -> bytes:
        """As one binary file."""
        text = json.dumps(self.doc | {"buffers": [{"byteLength": len(self._blob)}]}).encode()
        text += b" " * (-len(text) % 4)
        chunks = [struct.pack("<II", len(text), 0x4E4F534A) + text]
        chunks.append(struct.pack("<II", len(self._blob), 0x004E4942) + self._blob)
        body = b"".join(chunks)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def gltf(self, beside: str) -> tuple[bytes, bytes]:
        """As text, and the buffer of a file beside it."""
        buffers = [{"byteLength": len(self._blob), "uri": beside}]
        return json.dumps(self.doc | {"buffers": buffers}).encode(), self._blob

    def _accessor(self, values: Array, kind: str) -> int:
        data = values.astype("<f4")
        view = {"buffer": 0, "byteOffset": len(self._blob), "byteLength": data.nbytes}
        self._blob += data.tobytes()
        self.doc["bufferViews"].append(view)
        accessor: dict[str, Any] = {
            "bufferView": len(self.doc["bufferViews"]) - 1, "componentType": 5126, "count": len(data), "type": kind,
        }  # fmt: skip
        if kind == "SCALAR":
            accessor |= {"min": [float(data.min())], "max": [float(data.max())]}
        self.doc["accessors"].append(accessor)
        return len(self.doc["accessors"]) - 1


def npz(**arrays: Any) -> bytes:
    """NumPy's archive."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def npy(array: Array) -> bytes:
    """One NumPy array."""
    out = io.BytesIO()
    np.save(out, array.astype(np.float32))
    return out.getvalue()


def csv(rows: Array) -> bytes:
    """Rows of numbers with six digits."""
    return "".join(",".join(f"{number:.6f}" for number in row) + "\n" for row in rows).encode()


def fbx(motion: Motion) -> bytes:
    """FBX 7.4 as text: Y up, centimetres, curves of every frame, turns in the order X Y Z."""
    m = matrix(motion.turns)
    y = np.arcsin(np.clip(-m[..., 2, 0], -1, 1))
    angles = np.stack([np.arctan2(m[..., 2, 1], m[..., 2, 2]), y, np.arctan2(m[..., 1, 0], m[..., 0, 0])], -1)
    angles = np.degrees(np.unwrap(angles, axis=0))
    times = ",".join(str(round(frame * SECOND / motion.fps)) for frame in range(len(m)))
    objects, links = [], []

    def curve(node: int, axis: int, values: Array) -> None:
        curve_id, count = 10 * node + axis, len(values)
        keys = ",".join(f"{value:.6f}" for value in values)
        objects.append(
            f'AnimationCurve: {curve_id}, "AnimCurve::", "" {{\n Default: 0\n KeyVer: 4008\n'
            f" KeyTime: *{count} {{\n a: {times}\n }}\n KeyValueFloat: *{count} {{\n a: {keys}\n }}\n"
            " KeyAttrFlags: *1 {\n a: 4\n }\n KeyAttrDataFloat: *4 {\n a: 0,0,0,0\n }\n"
            f" KeyAttrRefCount: *1 {{\n a: {count}\n }}\n}}"
        )
        links.append(f'C: "OP",{curve_id},{node}, "d|{"XYZ"[axis]}"')

    for joint, (name, parent) in enumerate(zip(motion.names, motion.parents, strict=True)):
        place = _numbers(100 * motion.offsets[joint]).replace(" ", ",")
        objects.append(
            f'Model: {joint + 1}, "Model::{name}", "LimbNode" {{\n Version: 232\n Properties70: {{\n'
            f'P: "Lcl Translation", "Lcl Translation", "", "A",{place}\n }}\n}}\n'
            f'NodeAttribute: {joint + 501}, "NodeAttribute::{name}", "LimbNode" {{\n TypeFlags: "Skeleton"\n}}'
        )
        links += [f'C: "OO",{joint + 1},{parent + 1}', f'C: "OO",{joint + 501},{joint + 1}']
        moved = [("Rotation", angles[:, joint])] + ([] if joint else [("Translation", 100 * motion.roots)])
        for part, (word, values) in enumerate(moved):
            node = 10_000 + 10 * joint + part
            objects.append(f'AnimationCurveNode: {node}, "AnimCurveNode::{word}", "" {{\n}}')
            links += [f'C: "OO",{node},9001', f'C: "OP",{node},{joint + 1}, "Lcl {word}"']
            for axis in range(3):
                curve(node, axis, values[:, axis])
    stop = round((len(m) - 1) * SECOND / motion.fps)
    objects.append(
        'AnimationStack: 9000, "AnimStack::walk", "" {\n'
        f' Properties70: {{\nP: "LocalStop", "KTime", "Time", "",{stop}\n }}\n}}\n'
        'AnimationLayer: 9001, "AnimLayer::Base", "" {\n}'
    )
    links.append('C: "OO",9001,9000')
    axes = {"Up": (1, 1), "Front": (2, 1), "Coord": (0, 1)}
    settings = "".join(
        f'P: "{axis}Axis", "int", "Integer", "",{of}\nP: "{axis}AxisSign", "int", "Integer", "",{sign}\n'
        for axis, (of, sign) in axes.items()
    )
    return (
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {\n FBXHeaderVersion: 1003\n FBXVersion: 7400\n}\n"
        f'GlobalSettings: {{\n Version: 1000\n Properties70: {{\n{settings}P: "UnitScaleFactor", "double", "Number", "",1\n'
        f'P: "TimeMode", "enum", "", "",6\n }}\n}}\nObjects: {{\n{chr(10).join(objects)}\n}}\n'
        f"Connections: {{\n{chr(10).join(links)}\n}}\n"
    ).encode()
