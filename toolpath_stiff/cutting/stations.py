"""Stations: places along the path with the cutter there, one record each; SI, set-up frame."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray, product
from toolpath_stiff.cutting.cutters import Cutter, of_tools
from toolpath_stiff.cutting.tilts import TURNING
from toolpath_stiff.cutting.workpiece import Window, Workpiece
from toolpath_stiff.nc.courses import points_along
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.path.sampling import Samples

BLOCK = 8192  # stations at a time
# Radii of the cutter along the path, whose pieces are those just before. Where the tool turns on its way, these count
# as not yet cut: a piece ends with the tool turned back a little from where the next begins.
RECENT, RECENT_TURNING = 0.05, 0.25
TOUCH = 1e-9  # m, by which the envelope is reduced: mere touching is no cut

Seen = tuple[IntArray, FloatArray, FloatArray]
STATION = np.dtype([
    *((name, np.float64) for name in ("x", "y", "z")),  # tip
    *((name, np.float64) for name in ("ahead_x", "ahead_y")),  # unit vector of the motion in the plane
    *((name, np.float64) for name in ("level", "down")),  # parts of the motion in the plane and down the axis
    *((name, np.float64) for name in ("reach", "flat", "longest")),  # cutter: radius, of its flat end, cutting length
    *((name, np.float64) for name in ("swing_ahead", "swing_left")),  # motion per height above the corner
    ("move", np.int64),
    ("piece", np.int64),  # the station's own piece, for a rapid the next
    ("recent", np.int64),  # first of the pieces just before
    ("until", np.int64),  # pieces before this one have cut the material that the station meets
    ("path", np.float64),  # from the program's start
    ("tilt", np.int64),  # the frame of the quantities above
    ("end_alone", np.bool_),  # a plunge or a rapid: only material below the cutter's end counts
])  # fmt: skip


def stations_at(
    work: Workpiece, cutters: Mapping[int, Cutter], columns: tuple[IntArray, IntArray, FloatArray], seen: Seen
) -> AnyArray:
    """(n,) records of places along moves of nonzero length; `columns`: tool, move, path from its start."""
    (tool, move, path), (tilt, position, motion) = columns, seen
    stations = np.zeros(len(move), dtype=STATION)
    stations["x"], stations["y"], stations["z"] = position.T
    stations["tilt"] = tilt
    level = np.hypot(motion[:, 0], motion[:, 1])
    stations["ahead_x"], stations["ahead_y"] = np.divide(
        motion[:, :2].T, level, out=np.tile([[1.0], [0.0]], len(move)), where=level > 0.0
    )
    stations["level"], stations["down"] = level, -motion[:, 2]
    stations["reach"], stations["flat"] = (of_tools(cutters, tool, name) for name in ("radius", "flat"))
    stations["longest"] = np.nan_to_num(of_tools(cutters, tool, "cutting_length"), nan=np.inf)
    stations["move"], stations["path"] = move, path
    stations["piece"] = pieces_at(work, move, path)
    rapid = work.first[move + 1] == work.first[move]
    steep = np.cos(defaults.PLUNGE_ANGLE) * np.hypot(level, motion[:, 2])
    stations["end_alone"] = rapid | (np.abs(motion[:, 2]) >= steep - 1e-12)
    turning = (work.tilts[move] == TURNING) & (stations["flat"] > 0.0)  # a ball moves the same however it turns
    radii = np.where(turning, RECENT_TURNING, RECENT)
    recent = np.searchsorted(work.pieces["after"], path - radii * stations["reach"], "right")
    stations["recent"] = np.where(rapid, len(work.pieces), recent)
    stations["until"] = stations["piece"]
    if turning.any():
        part: AnyArray = work.pieces[np.minimum(stations["piece"], len(work.pieces) - 1)]
        x, y, ahead_x, ahead_y = part["swing_x"], part["swing_y"], stations["ahead_x"], stations["ahead_y"]
        stations["swing_ahead"], stations["swing_left"] = x * ahead_x + y * ahead_y, y * ahead_x - x * ahead_y
        run = np.maximum.accumulate(
            np.where(work.pieces["tilt"] > work.tilts.max(), 0, np.arange(1, len(work.pieces) + 1))
        )
        until = np.maximum(recent, run[np.maximum(stations["piece"] - 1, 0)])
        stations["until"] = np.where(turning, np.minimum(until, stations["piece"]), stations["piece"])
    return stations


def seen_upright(work: Workpiece, move: IntArray, path: FloatArray, position: FloatArray, tangent: FloatArray) -> Seen:
    """(n,) number of the frame in which the tool is upright at places along moves; tip and motion (n, 3) in it.

    The motion is that per length of path. Where the tool turns, both are those of the piece of constant tilt; on a
    rapid of which nothing is: the number is `TURNING`.
    """
    tilt = work.tilts[move]
    if not work.tilted:
        return tilt, position, tangent
    piece = np.minimum(pieces_at(work, move, path), len(work.pieces) - 1)
    part, turning = work.pieces[piece], (tilt == TURNING) & (work.first[move + 1] > work.first[move])
    tilt = np.where(turning, part["tilt"], tilt)
    turn = work.turns[tilt]
    position, motion = (product(vectors[:, None], turn)[:, 0] for vectors in (position, tangent))
    rows = np.flatnonzero(turning & (part["extent"] > 0.0) & (tangent != 0.0).any(axis=1))
    some = part[rows]
    length = some["after"] - some["before"]
    along = some["extent"] * np.clip((path[rows] - some["before"]) / length, 0.0, 1.0)
    place = np.stack([some["cos"], some["sin"], some["slope"]], axis=1)
    motion[rows] = (some["extent"] / length)[:, None] * place
    position[rows] = np.stack([some["x"], some["y"], some["z"]], axis=1) + along[:, None] * place
    return tilt, position, motion


def samples_seen(work: Workpiece, samples: Samples) -> tuple[IntArray, Samples]:
    """(n,) number of each sample's frame, and the samples as `seen_upright`."""
    if not work.tilted:
        return work.tilts[samples.move], samples
    tilt, position, motion = seen_upright(work, samples.move, samples.s, samples.position, samples.tangent)
    return tilt, replace(samples, position=position, tangent=motion, abc=np.zeros_like(samples.abc))


def pieces_at(work: Workpiece, move: IntArray, path: FloatArray) -> IntArray:
    """(n,) the piece at places along moves; for a rapid the next one."""
    first, count = work.first[move], work.first[move + 1] - work.first[move]
    row = np.minimum(first, len(work.pieces) - 1)
    before, after = work.pieces["before"][row], work.pieces["after"][row]
    number = ((path - before) / np.where(count > 0, after - before, 1.0) + 1e-9).astype(np.int64)
    return np.asarray(first + np.clip(number, 0, np.maximum(count - 1, 0)))


def stations_between(
    work: Workpiece, moves: Moves, cutters: Mapping[int, Cutter], move: IntArray, path: FloatArray
) -> AnyArray:
    """(n,) records of places between samples along cutting moves, in ascending order."""
    begin = int(move[0])
    some = moves.take(slice(begin, int(move[-1]) + 1))
    before, after = work.pieces["before"][work.first[move]], work.pieces["after"][work.first[move + 1] - 1]
    share = np.clip((path - before) / (after - before), 0.0, 1.0)
    seen = seen_upright(work, move, path, *points_along(some, move - begin, share))
    return stations_at(work, cutters, (moves.tool[move], move, path), seen)


def blocks_of_stations(
    work: Workpiece, samples: Samples, tilt: IntArray, cutters: Mapping[int, Cutter], rows: IntArray
) -> Iterator[tuple[IntArray, AnyArray]]:
    """Rows of samples that move, as from `samples_seen`, and their records, in blocks."""
    for first in range(0, len(rows), BLOCK):
        some = rows[first : first + BLOCK]
        tool, move, path = (getattr(samples, name)[some] for name in ("tool", "move", "s"))
        seen = tilt[some], samples.position[some], samples.tangent[some]
        yield some, stations_at(work, cutters, (tool, move, path), seen)


def points_around(stations: AnyArray, radius: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x, y, m, of points around the axis, flattened; radius and angle (from the left, clockwise) are (n, ...)."""
    shape = (-1,) + (1,) * (np.broadcast(radius, angle).ndim - 1)
    x, y, ahead_x, ahead_y = (stations[name].reshape(shape) for name in ("x", "y", "ahead_x", "ahead_y"))
    across, ahead = radius * np.cos(angle), radius * np.sin(angle)
    return (x + ahead * ahead_x - across * ahead_y).ravel(), (y + ahead * ahead_y + across * ahead_x).ravel()


def around(
    stations: AnyArray, radius: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, Window]:
    """x, y of points as `points_around`; their tilts, and the window of pieces cut before each station."""
    x, y = points_around(stations, radius, angle)
    names = ("tilt", "until", "recent")
    tilt, until, recent = (np.repeat(stations[name], len(x) // max(len(stations), 1)) for name in names)
    return x, y, tilt, (np.zeros_like(until), until, recent)
