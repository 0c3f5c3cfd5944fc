"""Points on rings around the cutter, and the material there before a station."""

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.workpiece import Window, Workpiece


def points_around(stations: AnyArray, radius: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x, y, m, of points around the axis, end to end; radius and angle (from the left, clockwise) are (n, ...)."""
    shape = (-1,) + (1,) * (np.broadcast(radius, angle).ndim - 1)
    x, y, ahead_x, ahead_y = (stations[name].reshape(shape) for name in ("x", "y", "ahead_x", "ahead_y"))
    across, ahead = radius * np.cos(angle), radius * np.sin(angle)
    return (x + ahead * ahead_x - across * ahead_y).ravel(), (y + ahead * ahead_y + across * ahead_x).ravel()


def around(
    stations: AnyArray, radius: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, Window]:
    """x, y of points as `points_around`; their tilts, and the window of what stands before each station."""
    x, y = points_around(stations, radius, angle)
    names = ("tilt", "until", "recent")
    tilt, until, recent = (np.repeat(stations[name], len(x) // max(len(stations), 1)) for name in names)
    return x, y, tilt, (np.zeros_like(until), until, recent)


def heights_around(
    work: Workpiece,
    stations: AnyArray,
    radius: FloatArray,
    angle: FloatArray,
    ceiling: FloatArray | float,
    enough: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Top and underside of the material before each station, m above the tip; points as `points_around`.

    `ceiling` and `enough`, m above the tip, are the ends of `Workpiece.span`.
    """
    x, y, tilt, window = around(stations, radius, angle)
    whole = np.zeros(np.broadcast_shapes(radius.shape, angle.shape))
    z = stations["z"].reshape((-1,) + (1,) * (whole.ndim - 1))
    low, high = ((whole + (z + height)).ravel() for height in (enough, ceiling))
    bottom, top = work.span(x, y, tilt, (low, high), window)
    return top.reshape(whole.shape) - z, bottom.reshape(whole.shape) - z
