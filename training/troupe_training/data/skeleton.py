"""The pack's skeleton: joint names, parents, offsets, the pelvis's left axis, contact joints, a robot's hinges."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import numpy as np


class HingeTable(TypedDict):
    """A robot's hinge: world rotation of its joint = parent's * rest * rotation about the axis."""

    joint: str
    axis: list[float]  # unit, in the joint's own frame
    rest: list[float]  # quaternion (w, x, y, z)
    lower_rad: float
    upper_rad: float
    max_speed_rad_per_s: float
    max_acceleration_rad_per_s2: NotRequired[float]  # left out: no limit is known


class MimicTable(TypedDict):
    """A joint without a hinge of its own: its angle is ``multiplier`` times that of another joint's hinge, and an offset."""

    joint: str
    follows: str
    multiplier: float
    offset_rad: float
    axis: list[float]  # as of a hinge
    rest: list[float]


class RobotTable(TypedDict):
    """A robot's name, its hinges in the order of the motion file's columns, and the joints that follow them, if any."""

    name: str
    hinges: list[HingeTable]
    mimics: NotRequired[list[MimicTable]]


@dataclass
class Skeleton:
    """Joints in file order with parents first; the first joint is the root (pelvis). Offsets in metres.

    ``robot`` is None for characters. Joints of a robot turn by their hinges, follow one, or turn with their parents.
    """

    names: list[str]
    parents: list[int]
    offsets: list[list[float]]
    left_axis: list[float]
    contact_joints: list[int] = field(default_factory=list)
    contact_max_height_m: list[float] = field(default_factory=list)
    contact_max_speed_mps: float = 0.3
    contact_clearance_m: list[float] = field(default_factory=list)
    robot: RobotTable | None = None

    @property
    def joint_count(self) -> int:
        """Number of joints J."""
        return len(self.names)

    def ancestor_matrix(self) -> np.ndarray:
        """``[J, J]``: row j has ones at j and its ancestors except the root, so positions = A @ bone vectors."""
        matrix = np.zeros((self.joint_count, self.joint_count), dtype=np.float32)
        for j in range(self.joint_count):
            k = j
            while k > 0:
                matrix[j, k] = 1.0
                k = self.parents[k]
        return matrix

    def forward_kinematics(self, root: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """World positions ``[F, J, 3]`` from root positions ``[F, 3]`` and world rotations ``[F, J, 3, 3]``."""
        positions = np.zeros((*rotations.shape[:2], 3))
        positions[:, 0] = root
        for j in range(1, self.joint_count):
            parent = self.parents[j]
            positions[:, j] = positions[:, parent] + rotations[:, parent] @ np.array(self.offsets[j])
        return positions

    def save(self, path: Path) -> None:
        """Writes the skeleton as JSON."""
        path.write_text(json.dumps(asdict(self), indent=1))

    @staticmethod
    def load(path: Path) -> "Skeleton":
        """Reads what `save` wrote."""
        return Skeleton(**json.loads(path.read_text()))

    @staticmethod
    def of_manifest(manifest: dict[str, Any]) -> "Skeleton":
        """The skeleton in a pack's manifest (``pack.toml``)."""
        table = manifest["skeleton"]
        names = [joint["name"] for joint in table["joints"]]
        contacts = table["contacts"]
        return Skeleton(
            names=names,
            parents=[names.index(joint["parent"]) if joint["parent"] else -1 for joint in table["joints"]],
            offsets=[joint["offset_m"] for joint in table["joints"]],
            left_axis=table["left_axis"],
            contact_joints=[names.index(joint) for joint in contacts["joints"]],
            contact_max_height_m=contacts["max_height_m"],
            contact_max_speed_mps=contacts["max_speed_mps"],
            contact_clearance_m=contacts["clearance_m"],
            robot=manifest.get("robot"),
        )
