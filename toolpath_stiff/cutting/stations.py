"""Stations: places along the path with the cutter there, one record each; SI, set-up frame."""

from collections.abc import Iterator, Mapping

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.workpiece import SLACK, Workpiece
from toolpath_stiff.nc.courses import points_along
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.path.sampling import Samples

BLOCK = 8192  # stations at a time
# The front of the cutter would touch what the pieces just before have left: these are taken for smaller by SLACK. It is
# above the rounding of coordinates (4 decimals of a mm); a turn of the tool moves it on by much more.
RECENT = 0.05  # radii of the cutter along the path
TOUCH = 1e-9  # m, by which the envelope is taken for smaller: what it only touches is not in cut

STATION = np.dtype([
    *((name, np.float64) for name in ("x", "y", "z")),  # tip
    *((name, np.float64) for name in ("ahead_x", "ahead_y")),  # unit vector of the motion in the plane
    *((name, np.float64) for name in ("level", "down")),  # parts of the motion in the plane and down the axis
    *((name, np.float64) for name in ("reach", "flat", "longest")),  # cutter: radius, of its flat end, cutting length
    ("move", np.int64),
    ("piece", np.int64),  # the station's own, of a rapid the next
    ("recent", np.int64),  # first piece of those just before
    ("path", np.float64),  # from the program's start
    ("end_alone", np.bool_),  # a plunge or a rapid: only what is below the cutter's end is looked at
])  # fmt: skip


def stations_at(
    work: Workpiece,
    cutters: Mapping[int, Cutter],
    columns: tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray],
) -> AnyArray:
    """(n,) records of places along moves of some length; tool, move, path from the start, tip and tangent of each."""
    tool, move, path, position, tangent = columns
    stations = np.zeros(len(move), dtype=STATION)
    stations["x"], stations["y"], stations["z"] = position.T
    level = np.hypot(tangent[:, 0], tangent[:, 1])
    stations["ahead_x"], stations["ahead_y"] = np.divide(
        tangent[:, :2].T, level, out=np.tile([[1.0], [0.0]], len(move)), where=level > 0.0
    )
    stations["level"], stations["down"] = level, -tangent[:, 2]
    for number, cutter in cutters.items():
        rows = tool == number
        stations["reach"][rows], stations["flat"][rows] = cutter.radius, cutter.radius - cutter.corner_radius
        stations["longest"][rows] = np.nan_to_num(cutter.cutting_length, nan=np.inf)
    stations["move"], stations["path"] = move, path
    stations["piece"] = pieces_at(work, move, path)
    rapid = work.first[move + 1] == work.first[move]
    stations["end_alone"] = rapid | (np.abs(tangent[:, 2]) >= np.cos(defaults.PLUNGE_ANGLE) - 1e-12)
    recent = np.searchsorted(work.pieces["after"], path - RECENT * stations["reach"], "right")
    stations["recent"] = np.where(rapid, len(work.pieces), recent)
    return stations


def pieces_at(work: Workpiece, move: IntArray, path: FloatArray) -> IntArray:
    """(n,) the piece at places along moves; of a rapid the next."""
    first, count = work.first[move], work.first[move + 1] - work.first[move]
    row = np.minimum(first, len(work.pieces) - 1)
    before, after = work.pieces["before"][row], work.pieces["after"][row]
    number = ((path - before) / np.where(count > 0, after - before, 1.0) + 1e-9).astype(np.int64)
    return np.asarray(first + np.clip(number, 0, np.maximum(count - 1, 0)))


def stations_between(
    work: Workpiece, moves: Moves, cutters: Mapping[int, Cutter], move: IntArray, path: FloatArray
) -> AnyArray:
    """(n,) records of places between samples, along cutting moves, ascending."""
    begin = int(move[0])
    some = moves.take(slice(begin, int(move[-1]) + 1))
    before, after = work.pieces["before"][work.first[move]], work.pieces["after"][work.first[move + 1] - 1]
    share = np.clip((path - before) / (after - before), 0.0, 1.0)
    return stations_at(work, cutters, (moves.tool[move], move, path, *points_along(some, move - begin, share)))


def blocks_of_stations(
    work: Workpiece, samples: Samples, cutters: Mapping[int, Cutter], rows: IntArray
) -> Iterator[tuple[IntArray, AnyArray]]:
    """Some rows of samples that move, and their records, in blocks."""
    for first in range(0, len(rows), BLOCK):
        some = rows[first : first + BLOCK]
        names = ("tool", "move", "s", "position", "tangent")
        tool, move, path, position, tangent = (getattr(samples, name)[some] for name in names)
        yield some, stations_at(work, cutters, (tool, move, path, position, tangent))


def points_around(stations: AnyArray, radius: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x, y, m, of points around the axis, end to end; radius and angle (from the left, clockwise) are (n, ...)."""
    shape = (-1,) + (1,) * (np.broadcast(radius, angle).ndim - 1)
    x, y, ahead_x, ahead_y = (stations[name].reshape(shape) for name in ("x", "y", "ahead_x", "ahead_y"))
    across, ahead = radius * np.cos(angle), radius * np.sin(angle)
    return (x + ahead * ahead_x - across * ahead_y).ravel(), (y + ahead * ahead_y + across * ahead_x).ravel()


def heights_around(
    work: Workpiece,
    stations: AnyArray,
    radius: FloatArray,
    angle: FloatArray,
    ceiling: FloatArray | float = np.inf,
    enough: FloatArray | float = -np.inf,
    at: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Top of the material before each station, underside of the stock, m above the tip; points as `points_around`.

    `ceiling` (m above the tip) and `enough` as of `Workpiece.tops`. `at`: only what stands at `enough` is asked.
    """
    x, y = points_around(stations, radius, angle)
    whole = np.zeros(np.broadcast_shapes(radius.shape, angle.shape))
    z = stations["z"].reshape((-1,) + (1,) * (whole.ndim - 1))
    limits = [(whole + (z + height)).ravel() for height in (ceiling, enough)]
    names = ("piece", "recent", "path")
    piece, recent, path = (np.repeat(stations[name], len(x) // max(len(stations), 1)) for name in names)
    window = np.zeros(len(x), dtype=np.int64), piece
    top, bottom = work.tops(x, y, window, recent, SLACK, *limits)[0], work.stock.bottoms(x, y)
    if at:
        rows = np.flatnonzero(top > limits[1]) if work.others else np.zeros(0, dtype=np.int64)
        stands = work.standing(np.stack([x, y, limits[1]])[:, rows], 0.0 * path[rows], path[rows] - TOUCH)
        top[rows[~stands]] = -np.inf
    else:
        bottom, top = work.span(x, y, (bottom, top), 0.0 * path, path - TOUCH)
    return top.reshape(whole.shape) - z, bottom.reshape(whole.shape) - z
