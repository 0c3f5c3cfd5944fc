"""From the coordinates of a program to those of the same program written for another placement. mm, degrees.

The untouched program at the placement (o, Q) puts the set-up point p at o + Q p; the written one, at the original
origin (oo, Qo), must put its own point there: p_new = Qo^T (Q p + o - oo). Orientations follow the rule of
`path.turns`, undone with the original: R_new = Qo^T Q R Rz(-C) Rz(Co).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.nc.frames import Pose
from toolpath_stiff.path.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices

FloatArray = NDArray[np.float64]

NOISE = 1e-12  # of a direction cosine: what is left of 0 or 1 after cosines and products
UPRIGHT = 1e-9  # degrees; smaller tilts are rounding


class Turn:
    """The rigid motion of the set-up frame that takes the original work to the placed one.

    Parameters
    ----------
    placement, original
        Origins as `--origin` takes them, but in mm and degrees.
    """

    def __init__(self, placement: Pose, original: Pose) -> None:
        new, old = (rotation_matrices(np.radians(origin[3:])) for origin in (placement, original))
        self.turn: FloatArray = _clean(old.T @ new)
        shift = np.array(placement[:3]) - np.array(original[:3])
        self.shift = shift if not any(original[3:]) else old.T @ shift
        self._yaw = np.radians(original[5] - placement[5])
        self.turns = not np.array_equal(self.turn, np.eye(3))
        still = _clean(self.turn @ rotation_about_z(self._yaw))
        self._never_yaws = np.array_equal(still, np.eye(3))  # a turn about the vertical alone
        self._rows = [[float(v) for v in row] for row in self.turn]
        self._shift = [float(v) for v in self.shift]

    def point(self, point: Sequence[float]) -> list[float]:
        """The placed point of a point of the set-up frame, x, y, z in mm."""
        x, y, z = point
        if not self.turns:
            return [x + self._shift[0], y + self._shift[1], z + self._shift[2]]
        return [a * x + b * y + c * z + s for (a, b, c), s in zip(self._rows, self._shift, strict=True)]

    def rotations(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations R_new of programmed roll, pitch, yaw (n, 3) in degrees."""
        return self.turn @ rotation_matrices(np.radians(abc)) @ rotation_about_z(self._yaw)

    def angles(self, abc: Sequence[float], near: Sequence[float]) -> list[float]:
        """Rotary words a, b, c in degrees; of the many that are the same rotation, those next to `near`."""
        if self.keeps(abc):
            return list(abc)
        a, b, c = np.degrees(roll_pitch_yaw(self.rotations(np.array([abc], dtype=float))[0]))
        same = [np.array([a, b, c]), np.array([a + 180.0, 180.0 - b, c + 180.0])]
        close = [angles - 360.0 * np.round((angles - np.array(near)) / 360.0) for angles in same]
        best = min(close, key=lambda angles: float(np.abs(angles - near).max()))
        return [float(v) for v in best]

    def keeps(self, abc: Sequence[float]) -> bool:
        """Whether rotary words stay as they are: a vertical platform never yaws with the work."""
        return self._never_yaws and (not self.turns or max(abs(abc[0]), abs(abc[1])) < UPRIGHT)

    def in_program(self, rotation: float) -> FloatArray:
        """(3, 3) turn as it looks in program axes that a work offset's rotation (degrees) turned already."""
        if not rotation or not self.turns:
            return self.turn
        inner = rotation_about_z(np.radians(rotation))
        return _clean(inner.T @ self.turn @ inner)


def _clean(matrix: FloatArray) -> FloatArray:
    """Direction cosines with the noise about 0 and +-1 taken off, so that what is unturned stays so exactly."""
    whole = np.round(matrix)
    return np.where(np.abs(matrix - whole) < NOISE, whole, matrix) + 0.0
