"""Stations: places along the cutting path with the cutter there, one record each; SI, set-up frame."""

from collections.abc import Iterator, Mapping

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.workpiece import Workpiece
from toolpath_stiff.nc.courses import move_lengths, points_along
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.sampling import Samples

BLOCK = 2048  # stations at a time
# The front of the cutter would touch what the pieces just before have left: these are taken for smaller by SLACK. It is
# above the rounding of coordinates (4 decimals of a mm); a turn of the tool moves it on by much more.
RECENT, SLACK = 0.05, 5e-7  # radii of the cutter along the path; m
TOUCH = 1e-9  # m, by which the envelope is taken for smaller: what it only touches is not in cut

STATION = np.dtype([
    *((name, np.float64) for name in ("x", "y", "z")),  # tip
    *((name, np.float64) for name in ("ahead_x", "ahead_y")),  # unit vector of the motion in the plane
    *((name, np.float64) for name in ("level", "down")),  # parts of the motion in the plane and down the axis
    *((name, np.float64) for name in ("reach", "flat", "longest")),  # cutter: radius, of its flat end, cutting length
    ("move", np.int64),
    ("share", np.float64),  # of the move
    ("piece", np.int64),  # the station's own
    ("recent", np.int64),  # first piece of those just before
    ("path", np.float64),  # from the program's start
    ("plunge", np.bool_),
])  # fmt: skip


def stations_along(
    work: Workpiece, moves: Moves, cutters: Mapping[int, Cutter], move: IntArray, share: FloatArray
) -> AnyArray:
    """(n,) records at shares of cutting moves of some length."""
    position, tangent = points_along(moves, move, share)
    stations, length = np.zeros(len(move), dtype=STATION), move_lengths(moves)
    stations["x"], stations["y"], stations["z"] = position.T
    level = np.hypot(tangent[:, 0], tangent[:, 1])
    still = np.where(level > 0.0, level, 1.0)
    stations["ahead_x"] = np.where(level > 0.0, tangent[:, 0] / still, 1.0)
    stations["ahead_y"] = tangent[:, 1] / still
    stations["level"], stations["down"] = level, -tangent[:, 2]
    stations["plunge"] = np.abs(tangent[:, 2]) >= np.cos(defaults.PLUNGE_ANGLE) - 1e-12
    for tool in np.unique(moves.tool[move]).tolist():
        rows, cutter = moves.tool[move] == tool, cutters[tool]
        stations["reach"][rows], stations["flat"][rows] = cutter.radius, cutter.radius - cutter.corner_radius
        stations["longest"][rows] = np.nan_to_num(cutter.cutting_length, nan=np.inf)
    counts = np.diff(work.first)[move]
    stations["piece"] = work.first[move] + np.minimum((share * counts + 1e-9).astype(np.int64), counts - 1)
    stations["move"], stations["share"] = move, share
    stations["path"] = (np.cumsum(length) - length)[move] + share * length[move]
    stations["recent"] = np.searchsorted(work.pieces["after"], stations["path"] - RECENT * stations["reach"], "right")
    return stations


def blocks_of_stations(
    work: Workpiece, moves: Moves, samples: Samples, cutters: Mapping[int, Cutter]
) -> Iterator[tuple[IntArray, AnyArray]]:
    """Rows of samples that lie on cutting moves of some length, and their records, in blocks."""
    length = move_lengths(moves)
    before = np.cumsum(length) - length
    rows = np.flatnonzero((moves.motion[samples.move] != RAPID) & (length[samples.move] > 0.0))
    for first in range(0, len(rows), BLOCK):
        some = rows[first : first + BLOCK]
        move = samples.move[some]
        share = np.clip((samples.s[some] - before[move]) / length[move], 0.0, 1.0)
        yield some, stations_along(work, moves, cutters, move, share)


def headings(samples: Samples) -> FloatArray:
    """(n,) rad from x to y, the direction in the plane that the angles of each sample's contact start from."""
    return np.asarray(np.arctan2(samples.tangent[:, 1], samples.tangent[:, 0]))


def points_around(stations: AnyArray, radius: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x, y, m, of points around the axis, end to end; radius and angle (from the left, clockwise) are (n, ...)."""
    shape = (-1,) + (1,) * (np.broadcast(radius, angle).ndim - 1)
    x, y, ahead_x, ahead_y = (stations[name].reshape(shape) for name in ("x", "y", "ahead_x", "ahead_y"))
    across, ahead = radius * np.cos(angle), radius * np.sin(angle)
    return (x + ahead * ahead_x - across * ahead_y).ravel(), (y + ahead * ahead_y + across * ahead_x).ravel()


def heights_around(
    work: Workpiece, stations: AnyArray, radius: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Top of the material before each station, underside of the stock, m above the tip; points as `points_around`."""
    x, y = points_around(stations, radius, angle)
    around = len(x) // max(len(stations), 1)
    piece, recent, z = (np.repeat(stations[name], around) for name in ("piece", "recent", "z"))
    top = work.tops(x, y, (np.zeros(len(x), dtype=np.int64), piece), recent, SLACK)[0]
    shape = np.broadcast_shapes(radius.shape, angle.shape)
    return (top - z).reshape(shape), (work.stock.bottoms(x, y) - z).reshape(shape)
