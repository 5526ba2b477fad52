"""The pack's skeleton: joint names, parents, offsets, the pelvis's left axis, contact joints."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class Skeleton:
    """Joints in file order with parents first; the first joint is the root (pelvis). Offsets in metres."""

    names: list[str]
    parents: list[int]
    offsets: list[list[float]]
    left_axis: list[float]
    contact_joints: list[int] = field(default_factory=list)
    contact_max_height_m: list[float] = field(default_factory=list)
    contact_max_speed_mps: float = 0.3
    contact_clearance_m: list[float] = field(default_factory=list)
    robot: dict | None = None

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

    def save(self, path: Path) -> None:
        """Writes the skeleton as JSON."""
        Path(path).write_text(json.dumps(asdict(self), indent=1))

    @staticmethod
    def load(path: Path) -> "Skeleton":
        """Reads what `save` wrote."""
        return Skeleton(**json.loads(Path(path).read_text()))
