"""Animations of glTF binaries (``.glb``) as motion: joints of the first skin, at 30 fps, metres, Y up.

The file is parsed by pygltflib; what is here is sampling and the tree.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pygltflib import GLTF2, Animation

from troupe_training.data.clips import FileMotion
from troupe_training.data.conventions import FPS
from troupe_training.data.neutral import quaternion_matrix

NUMBERS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# A joint that moves by more relative to its parent is not held by a bone of constant length.
LOOSE_M = 1e-3
MAX_SECONDS = 600.0
Pose = dict[str, np.ndarray]  # of one node: translation [F, 3], rotation [F, 4] (x, y, z, w), scale [F, 3]


class GltfError(ValueError):
    """A file without a skin or animations that can be used; the message says what."""


@dataclass
class Rig:
    """A file's skeleton at rest and its animations by name, all with the same joints."""

    rest: FileMotion  # one frame
    clips: dict[str, FileMotion]
    notes: list[str]


def read_glb(path: Path) -> Rig:
    """Reads all animations of a file. Raises `GltfError` with the reason if there are none."""
    try:
        gltf = GLTF2().load(str(path))
    except Exception as error:  # the library raises errors of any kind
        raise GltfError(f"not a glTF file: {error}") from error
    if gltf is None or not gltf.skins or not gltf.animations:
        raise GltfError("no skin or no animation in it")
    return _Reader(gltf).rig()


class _Reader:
    def __init__(self, gltf: GLTF2):
        self.gltf, self.blob = gltf, gltf.binary_blob() or b""
        self.parent = {child: i for i, node in enumerate(gltf.nodes) for child in node.children or []}
        joints = set(gltf.skins[0].joints)
        self.order: list[int] = []  # all nodes, parents first
        for root in (i for i in range(len(gltf.nodes)) if i not in self.parent):
            self._walk(root)
        self.joints = [i for i in self.order if i in joints]
        if not self.joints:
            raise GltfError("its skin has no joints")
        tops = [i for i in self.joints if self.parent.get(i) not in joints]
        # Helpers of the rig may stand beside the body.
        top = max(tops, key=lambda i: len(self._below(i)))
        self.aside = [self._name(i) for i in tops if i != top]
        kept = self._below(top)
        self.joints = [i for i in self.joints if i in kept]

    def _walk(self, node: int) -> None:
        if node in self.order:
            raise GltfError("its nodes form a ring")
        self.order.append(node)
        for child in self.gltf.nodes[node].children or []:
            self._walk(child)

    def _below(self, top: int) -> set[int]:
        below = {top}
        for i in self.joints:
            if self.parent.get(i) in below:
                below.add(i)
        return below

    def _name(self, node: int) -> str:
        return self.gltf.nodes[node].name or f"node_{node}"

    def rig(self) -> Rig:
        sampled = {a.name or f"animation_{i}": self._sample(a) for i, a in enumerate(self.gltf.animations)}
        joints, notes = self._held(sampled)
        notes += [f"not of the body: {', '.join(self.aside)}"] if self.aside else []
        below = self._below(self._root(joints, sampled))
        joints = [i for i in joints if i in below]
        clips = {name: self._motion(joints, poses, frames) for name, (poses, frames) in sampled.items()}
        # Bones as the clips have them: a rest pose may stand in another scale by a hair.
        rest = self._motion(joints, {}, 1)
        rest.offsets = np.median([clip.offsets for clip in clips.values()], axis=0)
        return Rig(rest, clips, notes)

    def _held(self, sampled: dict[str, tuple[dict[int, Pose], int]]) -> tuple[list[int], list[str]]:
        """The joints without those that leave their bone in some clip (and all that hang on them), and which those are."""
        loose: set[int] = set()
        for poses, _ in sampled.values():
            for node, pose in poses.items():
                if "translation" in pose and np.ptp(pose["translation"], axis=0).max() > LOOSE_M:
                    loose.add(node)
        joints, dropped, branched = [], [], False
        for i in self.joints:
            parent = self.parent.get(i)
            chain = not branched  # above the first fork a joint that moves only carries the body
            if chain or (i not in loose and parent in joints):
                joints.append(i)
            else:
                dropped.append(self._name(i))
            branched = branched or len([c for c in self.gltf.nodes[i].children or [] if c in self.joints]) != 1
        notes = [f"joints that leave their bones are left out: {', '.join(dropped)}"] if dropped else []
        return joints, notes

    def _root(self, joints: list[int], sampled: dict[str, tuple[dict[int, Pose], int]]) -> int:
        """The joint that moves in the world: the last before the first fork that any clip moves, else the first."""
        root = node = joints[0]
        while True:
            children = [i for i in joints if self.parent.get(i) == node]
            if len(children) != 1:
                return root
            node = children[0]
            moves = (pose[node]["translation"] for pose, _ in sampled.values() if "translation" in pose.get(node, {}))
            if any(np.ptp(values, axis=0).max() > LOOSE_M for values in moves):
                root = node

    def _motion(self, joints: list[int], poses: dict[int, Pose], frames: int) -> FileMotion:
        world: dict[int, np.ndarray] = {}
        for node in self.order:
            pose = poses.get(node, {})
            entry = self.gltf.nodes[node]
            if entry.matrix:
                local = np.tile(np.array(entry.matrix, dtype=float).reshape(4, 4).T, (frames, 1, 1))
            else:
                rotation = pose.get("rotation", np.array([entry.rotation or [0, 0, 0, 1]], dtype=float))
                scale = pose.get("scale", np.array([entry.scale or [1, 1, 1]], dtype=float))
                local = np.tile(np.eye(4), (frames, 1, 1))
                local[:, :3, :3] = quaternion_matrix(rotation[:, [3, 0, 1, 2]]) * scale[:, None, :]
                local[:, :3, 3] = pose.get("translation", np.array([entry.translation or [0, 0, 0]], dtype=float))
            parent = self.parent.get(node)
            world[node] = local if parent is None else world[parent] @ local
        matrices = np.stack([world[i] for i in joints], 1)
        u, _, v = np.linalg.svd(matrices[..., :3, :3])
        positions, rotations = matrices[..., :3, 3], u @ v
        place = {node: j for j, node in enumerate(joints)}
        parents = [place.get(self.parent.get(i, -1), -1) for i in joints]
        above = np.maximum(parents, 0)
        offsets = np.einsum("jik,ji->jk", rotations[0, above], positions[0] - positions[0, above])
        offsets[0] = 0.0
        return FileMotion([self._name(i) for i in joints], parents, offsets, positions, rotations)

    def _sample(self, animation: Animation) -> tuple[dict[int, Pose], int]:
        """The animation of each node at 30 fps, and the number of frames."""
        read = [
            (c.target, s, self._numbers(s.input)[:, 0])
            for c in animation.channels
            if (s := animation.samplers[c.sampler])
        ]
        end = max((float(times[-1]) for _, _, times in read), default=0.0)
        if not 0.0 <= end <= MAX_SECONDS:
            raise GltfError(f"an animation of {end} s, at most {MAX_SECONDS} s are read")
        at = np.arange(0.0, end + 1e-6, 1.0 / FPS)
        poses: dict[int, Pose] = {}
        for target, sampler, times in read:
            if target.node is None or target.path not in ("translation", "rotation", "scale"):
                continue
            values = self._numbers(sampler.output)
            if sampler.interpolation == "CUBICSPLINE":  # tangents before and after each value
                values = values.reshape(len(times), 3, -1)[:, 1]
            poses.setdefault(target.node, {})[target.path] = _at(at, times, values, sampler.interpolation == "STEP")
        return poses, len(at)

    def _numbers(self, index: int) -> np.ndarray:
        """The numbers of an accessor ``[count, width]``."""
        accessor = self.gltf.accessors[index]
        if accessor.bufferView is None or accessor.sparse is not None:
            raise GltfError("an accessor without a buffer, or a sparse one")
        view, width = self.gltf.bufferViews[accessor.bufferView], WIDTHS[accessor.type]
        kind = np.dtype(NUMBERS[accessor.componentType])
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        stride = view.byteStride or width * kind.itemsize
        if start + stride * (accessor.count - 1) + width * kind.itemsize > len(self.blob):
            raise GltfError("an accessor ends beyond its buffer")
        raw = np.ndarray((accessor.count, width), kind, self.blob, start, (stride, kind.itemsize))
        values = raw.astype(np.float64)
        if accessor.normalized:
            values = np.maximum(values / np.iinfo(kind).max, -1.0)
        return values


def _at(at: np.ndarray, times: np.ndarray, values: np.ndarray, step: bool) -> np.ndarray:
    """Key values at other times: held, linear, or for rotations the normalised mean of neighbours on the same side."""
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
    if step or len(times) == 1:
        return values[index]
    index = np.minimum(index, len(times) - 2)
    gap = np.maximum(times[index + 1] - times[index], 1e-9)
    share = np.clip((at - times[index]) / gap, 0.0, 1.0)[:, None]
    first, second = values[index], values[index + 1]
    if values.shape[1] == 4:
        second = np.where((first * second).sum(-1, keepdims=True) < 0, -second, second)
        mean = first * (1 - share) + second * share
        return mean / np.linalg.norm(mean, axis=-1, keepdims=True)
    return first * (1 - share) + second * share
