"""Axes, handedness and unit of what sessions take and give. Formulas are those of the server."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from troupe.arrays import F32

# Rows: the convention's axes in terms of native x (left), y (up), z (forward).
_AXES = {
    0: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    1: [[0, 0, 1], [-1, 0, 0], [0, 1, 0]],
    2: [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
    3: [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
}


class Convention(IntEnum):
    """A convention of axes and units."""

    NATIVE = 0
    """Right-handed, X left, Y up, Z forward, metres. glTF's too."""
    UNREAL = 1
    """Left-handed, X forward, Y right, Z up, centimetres."""
    UNITY = 2
    """Left-handed, X right, Y up, Z forward, metres."""
    ROS = 3
    """ROS and MuJoCo: right-handed, X forward, Y left, Z up, metres."""

    @property
    def units_per_metre(self) -> float:
        """100 in Unreal's, else 1."""
        return 100.0 if self is Convention.UNREAL else 1.0

    @property
    def up(self) -> int:
        """Index of the axis that points up."""
        return 1 if self in (Convention.NATIVE, Convention.UNITY) else 2

    @property
    def axes(self) -> F32:
        """(3, 3): a native direction times this, from the left, is the convention's."""
        return np.array(_AXES[self], np.float32)

    @property
    def _angle_sign(self) -> float:
        return -1.0 if self in (Convention.UNREAL, Convention.UNITY) else 1.0

    def position_from_native(self, positions: F32) -> F32:
        """Native positions, offsets or velocities (..., 3) in the convention's axes and unit."""
        return self._turn(positions, self.axes * np.float32(self.units_per_metre))

    def position_to_native(self, positions: F32) -> F32:
        """The convention's positions, offsets or velocities (..., 3) in native axes and metres."""
        return self._turn(positions, self.axes.T / np.float32(self.units_per_metre))

    def rotation_from_native(self, rotations: F32) -> F32:
        """Native quaternions (..., 4), w first, in the convention's axes."""
        return self._turn(rotations, self._of_quaternions())

    def rotation_to_native(self, rotations: F32) -> F32:
        """The convention's quaternions (..., 4), w first, in native axes."""
        return self._turn(rotations, self._of_quaternions().T)

    def _of_quaternions(self) -> F32:
        matrix = np.zeros((4, 4), np.float32)
        matrix[0, 0] = 1
        # A rotation's axis is a pseudovector: a mirror turns it round.
        matrix[1:, 1:] = self.axes * np.float32(self._angle_sign)
        return matrix

    def _turn(self, values: F32, matrix: F32) -> F32:
        if self is Convention.NATIVE:
            return values
        turned: F32 = values @ matrix.T
        return turned
