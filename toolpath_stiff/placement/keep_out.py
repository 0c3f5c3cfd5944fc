"""Keep-outs: boxes that the tool tip must stay out of."""

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.units import m_from_mm


@dataclass(frozen=True)
class KeepOut:
    """A box that the tool tip must stay out of, also in rapids: its name, two corners in machine coordinates, mm.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> vice = tps.KeepOut("vice", (-100, -50, 600), (100, 50, 700))
    >>> vice.high_mm
    (100, 50, 700)
    >>> vice.corners[1].tolist(), round(float(vice.clearances(np.array([0.0, 0.0, 0.75]))), 6)  # in m
    ([0.1, 0.05, 0.7], 0.05)
    """

    name: str
    low_mm: tuple[float, float, float]
    high_mm: tuple[float, float, float]

    def __post_init__(self) -> None:
        for low, high, axis in zip(self.low_mm, self.high_mm, "XYZ", strict=True):
            if low >= high:
                raise InputError(f"keep-out {self.name}: {axis}1 = {high:g} is not above {axis}0 = {low:g}")

    @property
    def corners(self) -> FloatArray:
        """(2, 3) m, lower and upper corner."""
        return m_from_mm(np.array([self.low_mm, self.high_mm], dtype=float))

    def clearances(self, position: FloatArray) -> FloatArray:
        """(...,) m, distance of points (..., 3) from the box; negative inside: the depth below the nearest face."""
        low, high = self.corners
        return np.asarray(np.maximum(low - position, position - high).max(axis=-1))
