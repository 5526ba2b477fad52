"""Bodies: skeletons described so that the same number means the same bend on every one of them.

A body is a skeleton with a neutral pose: it stands upright, heads along +Z, and its limbs hang down (`data/neutral.py`). With
``N[j]`` the world rotation of a joint in that pose and ``R[j]`` its world rotation in a frame:

- ``D[j] = R[j] N[j]^T`` is how far the joint has turned out of the neutral pose, in world axes;
- ``L[j] = D[parent]^T D[j]`` is its bend; ``L[root] = D[root]``. All are the identity in the neutral pose;
- a hinge turns about one constant axis ``N[j] axis[j]`` in these terms;
- positions follow from ``p[j] = p[parent] + D[parent] b[j]`` with ``b[j]`` the bone in the neutral pose, in world axes.
"""

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from troupe_training.data.rotations import columns_to_matrix
from troupe_training.data.sides import side_pairs
from troupe_training.data.skeleton import Skeleton

# Of a joint row, in the order of `Body.description`.
DESCRIPTION = (
    *("bone_x", "bone_y", "bone_z", "place_x", "place_y", "place_z", "axis_x", "axis_y", "axis_z"),
    *("is_hinge", "is_fixed", "is_contact", "is_end", "is_root", "is_place", "depth", "left", "reach", "log_size"),
)
SYMMETRY_TOLERANCE_M = 0.02
LEFT = np.array([1.0, 0.0, 0.0])  # of the neutral pose
SAME_LEFT = 0.99  # cosine of the angle by which a skeleton's left may differ from it
# Rows that a row of the joint attention reads: itself, its nearest ancestors, the root joint and
# the root's place.
SLOTS = 16


@dataclass
class Body:
    """A skeleton, its neutral pose and its size. ``test`` and ``loops`` are no part of it."""

    name: str
    skeleton: Skeleton
    neutral: list[list[list[float]]]  # [J, 3, 3], world rotations of the neutral pose
    height_m: float  # of the root joint in the neutral pose, above the ground
    size_m: float  # divides lengths: the root's height, or half the extent of a body without legs
    sides: list[int] = field(default_factory=list)  # [J]: 1 left, -1 right, 0 middle

    @property
    def joint_count(self) -> int:
        """Number of joints J; a body has J + 1 rows, the first of them for the place of its root."""
        return self.skeleton.joint_count

    @property
    def rotations(self) -> np.ndarray:
        """``N``, ``[J, 3, 3]``."""
        return np.array(self.neutral)

    @property
    def bones(self) -> np.ndarray:
        """Bones in the neutral pose ``[J, 3]``, metres, world axes; that of the root is zero."""
        parents = np.maximum(self.skeleton.parents, 0)
        bones = np.einsum("jik,jk->ji", self.rotations[parents], np.array(self.skeleton.offsets))
        bones[0] = 0.0
        return bones

    @property
    def axes(self) -> np.ndarray:
        """Hinge axes in the neutral pose ``[J, 3]``, world axes; zero if a joint turns freely or not at all."""
        axes = np.zeros((self.joint_count, 3))
        if self.skeleton.robot is not None:
            robot = self.skeleton.robot
            for turning in (*robot["hinges"], *robot.get("mimics", [])):
                joint = self.skeleton.names.index(turning["joint"])
                axes[joint] = self.rotations[joint] @ np.array(turning["axis"])
        return axes

    def places(self) -> np.ndarray:
        """Joint positions of the neutral pose relative to the root ``[J, 3]``, metres."""
        places = np.zeros((self.joint_count, 3))
        for j, bone in enumerate(self.bones):
            if j:
                places[j] = places[self.skeleton.parents[j]] + bone
        return places

    def ancestors(self, joint: int) -> list[int]:
        """A joint's ancestors, nearest first, the root last."""
        found = []
        while (joint := self.skeleton.parents[joint]) >= 0:
            found.append(joint)
        return found

    def ends(self) -> list[int]:
        """Joints that the root's row reads: those that touch the ground, then the ends of other limbs."""
        contacts = list(self.skeleton.contact_joints)
        leaves = [j for j in range(self.joint_count) if j not in self.skeleton.parents and j not in contacts]
        return contacts + leaves

    def slots(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows that each row of the joint attention reads ``[J + 1, SLOTS]`` and which of them count ``[J + 1, SLOTS]``.

        Row 0 is the root's place, row ``j + 1`` is joint ``j``. Slot 0 is the row itself, slot 1 the root's place, slot 2 the
        root joint, then ancestors, nearest first; row 0 reads the body's `ends` there. What does not count points to row 0.
        """
        rows = np.zeros((self.joint_count + 1, SLOTS), dtype=np.int64)
        count = np.zeros((self.joint_count + 1, SLOTS), dtype=bool)
        for row in range(self.joint_count + 1):
            read: list[int | None] = [row]
            if row == 0:
                read += [None, 1, *(j + 1 for j in self.ends() if j > 0)]
            else:
                above = self.ancestors(row - 1)
                read += [0, 1 if above else None, *(j + 1 for j in above[:-1])]
            for slot, other in enumerate(read[:SLOTS]):
                if other is not None:
                    rows[row, slot], count[row, slot] = other, True
        return rows, count

    def description(self) -> np.ndarray:
        """The networks' description of each row, ``[J + 1, len(DESCRIPTION)]``; lengths are shares of the size."""
        skeleton, bones, places, axes = self.skeleton, self.bones / self.size_m, self.places() / self.size_m, self.axes
        hinged = np.linalg.norm(axes, axis=-1) > 0.5
        rows = np.zeros((self.joint_count + 1, len(DESCRIPTION)), dtype=np.float32)
        reach = np.zeros(self.joint_count)
        for j in reversed(range(1, self.joint_count)):
            parent = skeleton.parents[j]
            reach[parent] = max(reach[parent], reach[j] + np.linalg.norm(bones[j]))
        log_size = np.log(self.size_m)
        rows[0, DESCRIPTION.index("is_place")], rows[0, DESCRIPTION.index("log_size")] = 1.0, log_size
        for j in range(self.joint_count):
            fixed = skeleton.robot is not None and not hinged[j] and j > 0
            flags = [hinged[j], fixed, j in skeleton.contact_joints, j not in skeleton.parents, j == 0, False]
            depth = len(self.ancestors(j)) / 8.0
            rows[j + 1] = [*bones[j], *places[j], *axes[j], *flags, depth, self.sides[j], reach[j], log_size]
        return rows

    def save(self, path: Path) -> None:
        """Writes the body as JSON."""
        path.write_text(json.dumps(asdict(self), indent=1))

    @staticmethod
    def load(path: Path) -> "Body":
        """Reads what `save` wrote."""
        saved = json.loads(path.read_text())
        return Body(**saved | {"skeleton": Skeleton(**saved["skeleton"])})


def body_of(name: str, skeleton: Skeleton, neutral: np.ndarray) -> Body:
    """The body of a skeleton with its neutral pose ``[J, 3, 3]`` (world rotations), which faces +Z."""
    left = neutral[0].T @ LEFT
    if left @ np.array(skeleton.left_axis) < SAME_LEFT:
        # The root bone of a rig may point anywhere.
        skeleton = replace(skeleton, left_axis=left.round(6).tolist())
    body = Body(name, skeleton, neutral.round(9).tolist(), 0.0, 1.0, sides_of(skeleton.names))
    places = body.places()
    feet = places[skeleton.contact_joints] if skeleton.contact_joints else places[:0]
    clearance = np.array(skeleton.contact_clearance_m)
    # The lowest foot stands on the ground.
    height = float(np.max(clearance - feet[:, 1])) if len(feet) else 0.0
    extent = float(np.linalg.norm(places.max(0) - places.min(0)))
    size = height if height > 0.15 * extent else extent / 2
    body.height_m, body.size_m = round(height, 6), round(size, 6)
    return body


def sides_of(names: list[str]) -> list[int]:
    """1 for left, -1 for right, 0 for the middle, by name."""
    sides = [0] * len(names)
    for left, right in side_pairs(names):
        sides[left], sides[right] = 1, -1
    return sides


def bends(body: Body, rotations: np.ndarray) -> np.ndarray:
    """World rotations ``[F, J, 3, 3]`` to bends ``L`` ``[F, J, 3, 3]``."""
    turned = rotations @ body.rotations.transpose(0, 2, 1)
    above = turned[:, np.maximum(body.skeleton.parents, 0)].transpose(0, 1, 3, 2)
    out = above @ turned
    out[:, 0] = turned[:, 0]
    return out


def unbend(body: Body, local: np.ndarray) -> np.ndarray:
    """Bends ``L`` ``[F, J, 3, 3]`` to turns out of the neutral pose ``D`` ``[F, J, 3, 3]``; world rotations are ``D N``."""
    turned = np.empty_like(local)
    for j, parent in enumerate(body.skeleton.parents):
        turned[:, j] = local[:, j] if parent < 0 else turned[:, parent] @ local[:, j]
    return turned


def positions_of(body: Body, root: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Joint positions ``[F, J, 3]`` from root positions ``[F, 3]`` and turns ``D`` ``[F, J, 3, 3]``."""
    positions, bones = np.zeros((*turned.shape[:2], 3)), body.bones
    positions[:, 0] = root
    for j, parent in enumerate(body.skeleton.parents):
        if parent >= 0:
            positions[:, j] = positions[:, parent] + turned[:, parent] @ bones[j]
    return positions


# Bends as they are cached: two columns in 16 bits, steps of 3e-5.
STEP = 1.0 / 32767


def pack_bends(local: np.ndarray) -> np.ndarray:
    """Bends ``[F, J, 3, 3]`` to ``int16`` ``[F, J, 6]``."""
    six = np.concatenate([local[..., 0], local[..., 1]], -1)
    return np.rint(six.clip(-1, 1) / STEP).astype(np.int16)


def unpack_bends(packed: np.ndarray) -> np.ndarray:
    """The bends that `pack_bends` wrote, made orthonormal again: ``[F, J, 3, 3]``."""
    six = packed.astype(np.float64) * STEP
    x = six[..., :3] / np.linalg.norm(six[..., :3], axis=-1, keepdims=True)
    y = six[..., 3:] - (x * six[..., 3:]).sum(-1, keepdims=True) * x
    return columns_to_matrix(np.concatenate([x, y / np.linalg.norm(y, axis=-1, keepdims=True)], -1))


def is_symmetric(body: Body) -> bool:
    """True if every left joint mirrors a right one, and middle ones lie in the middle."""
    places, pairs = body.places(), mirror_pairs(body)
    mirrored = places[pairs] * np.array([-1.0, 1.0, 1.0])
    return bool(np.abs(mirrored - places).max() < SYMMETRY_TOLERANCE_M)


def mirror_pairs(body: Body) -> list[int]:
    """For each joint the joint on the other side, itself in the middle."""
    pairs = list(range(body.joint_count))
    for left, right in side_pairs(body.skeleton.names):
        pairs[left], pairs[right] = right, left
    return pairs
