"""What stays in the finished part: which stations make its walls, its floors and scallops; its heights, with owners."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.envelopes import down_slope, foot, rise, within
from toolpath_stiff.cutting.stations import blocks_of_stations, points_around
from toolpath_stiff.cutting.workpiece import Workpiece
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.path.sampling import Samples

BESIDE = 2e-6  # m, outside of a wall, where it must stand; and how far above the finished surface still is that surface
ALWAYS = 1e9  # m of path, longer than any
TOUCHED = 2e-7  # m, within which a later pass touches a surface, and makes it: less than any surface error
LATER = 0.1  # radii of the cutter along the path from where on a pass is another one
ACROSS = 41  # points across the cutter's end
# Radii of a ball, above the finished surface: where the nearest of these points may lie beside a narrow scallop,
# (pi / 80)^2 / 2.
SCALLOP = 8e-4


def walls_of_passes(
    works: Sequence[Workpiece], tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter]
) -> tuple[FloatArray, FloatArray]:
    """(n, 2, 2) m above the tip: lowest and highest point of the wall that a sample makes on its left and right.

    Works by tilt, and samples in the frames of their tilts (n,).

    First the walls that no later pass has cut deeper, then those of them that none has touched since (a spring pass
    makes a wall anew). nan where the finished part has no wall there. A corner's radius is below the wall.
    """
    made, own = np.full((2, len(samples), 2, 2), np.nan)
    for work, rows, stations in _blocks(works, tilt, samples, cutters, np.full(len(samples), True)):
        sides, reach = np.array([[0.0, np.pi]]), stations["reach"][:, None]
        wall = points_around(stations, reach + BESIDE, sides)
        every, tip = np.full(len(wall[0]), len(work.pieces)), np.repeat(stations["z"], 2)
        other = stations["path"] + LATER * stations["reach"]
        later = np.repeat(np.searchsorted(work.pieces["before"], other, "right"), 2)
        longest = tip + np.repeat(stations["longest"], 2)
        high = work.tops(*wall, (np.zeros_like(every), every), ceiling=longest)[0]
        low = np.maximum(work.stock.bottoms(*wall), tip + np.repeat(stations["reach"] - stations["flat"], 2))
        low, high = (z - tip for z in work.span(*wall, (low, high), -ALWAYS + tip, ALWAYS + tip))
        stands = np.flatnonzero((high - low > BESIDE) & ~np.repeat(stations["end_alone"], 2))
        for walls, offset in ((made, TOUCHED), (own, -TOUCHED)):
            x, y = (axis[stands] for axis in points_around(stations, reach + offset, sides))
            base = tip[stands]
            top = work.tops(x, y, (later[stands], every[stands]), ceiling=base + high[stands])[0]
            since = np.repeat(stations["path"], 2)[stands]
            foot, top = (z - base for z in work.span(x, y, (base + low[stands], top), since, ALWAYS + base))
            part = np.full((len(tip), 2), np.nan)
            stays = top - foot > BESIDE
            part[stands[stays]] = np.stack([foot, top], axis=1)[stays]
            walls[rows] = part.reshape(-1, 2, 2)
    return made, own


def final_strip(
    works: Sequence[Workpiece], tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter], chosen: BoolArray
) -> FloatArray:
    """(n, 2) m across the feed, + to the left: lowest and highest offset at which a sample makes the finished surface.

    Of the samples chosen (n,), as of `walls_of_passes`, with the end of the cutter: of a flat end the strip of floor,
    of a ball the scallop around its point of contact kappa = asin(|offset| / R). nan: none.
    """
    strips = np.full((len(samples), 2), np.nan)
    for work, rows, stations in _blocks(works, tilt, samples, cutters, chosen):
        offset = stations["reach"][:, None] * np.sin(np.linspace(-0.5, 0.5, ACROSS) * np.pi)[None, :]
        reach, flat = stations["reach"][:, None], stations["flat"][:, None]
        # On a slope the envelope leaves a point behind the tip, or before it, where its normal is square to the motion.
        slope = stations["down"] / np.maximum(stations["level"], 1e-12)
        back = down_slope(np.abs(slope)[:, None], np.abs(offset), reach, flat)
        back = np.where(slope == 0.0, 0.0, np.sign(slope))[:, None] * back
        away = np.hypot(offset, back)
        surface = (stations["z"][:, None] + rise(reach, flat, away)).ravel()
        x, y = points_around(stations, away, np.arctan2(-back, offset))
        every = np.full(len(surface), len(work.pieces))
        ball = np.repeat(np.where(stations["flat"] == 0.0, SCALLOP * stations["reach"], 0.0), ACROSS)
        near = BESIDE + ball
        limits = surface + 2.0 * near, surface - near
        top = work.tops(x, y, (np.zeros_like(every), every), None, 0.0, *limits)[0]
        stays: BoolArray = np.abs(top - surface) < near
        stays &= (work.stock.bottoms(x, y) < surface) & ~np.repeat(stations["end_alone"], ACROSS)
        stays &= work.standing(np.stack([x, y, surface - BESIDE]), x - ALWAYS, x + ALWAYS)
        # A flat end passes a point of the floor twice, with its front and with its back.
        other = stations["path"] + LATER * stations["reach"] + 2.0 * stations["flat"]
        some = np.flatnonzero(stays)
        later = np.searchsorted(work.pieces["before"], other, "right")[some // ACROSS]
        ceiling = surface[some] + 2.0 * TOUCHED
        above = work.tops(x[some], y[some], (later, every[some]), ceiling=ceiling)[0] - surface[some]
        stays[some] = (above > TOUCHED) | ((above < -TOUCHED) & (ball[some] > 0.0))
        stays = stays.reshape(offset.shape)
        low, high = np.where(stays, offset, np.inf).min(axis=1), np.where(stays, offset, -np.inf).max(axis=1)
        strips[rows] = np.where(np.isfinite(low)[:, None], np.stack([low, high], axis=1), np.nan)
    return strips


def finished_surface(
    work: Workpiece, samples: Samples, cell: float
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """(nx,) and (ny,) m, the middles of cells; (nx, ny) m, height of the finished part there; the sample that made it.

    -inf and -1: no material, or the wall of a tool that stood aslant; nothing cut.
    """
    size = work.stock.cell * work.stock.top.shape
    x, y = (
        corner + (np.arange(count) + 0.5) * edge / count
        for corner, edge, count in zip(work.stock.corner, size, np.ceil(size / cell).astype(np.int64), strict=True)
    )
    top, owner = np.empty((len(x), len(y))), np.empty((len(x), len(y)), dtype=np.int64)
    for i in range(len(x)):
        column, always = np.full(len(y), x[i]), np.full(len(y), ALWAYS)
        own, path = _left(work, column, y)
        top[i] = work.span(column, y, (work.stock.bottoms(column, y), own), -always, always)[1]
        lower = top[i] < own
        for turn, other in work.others:
            across, beside, height = product(turn, np.stack([column, y, top[i]]))
            left, made = _left(other, across, beside)
            floor = lower & (np.abs(left - height) < BESIDE)
            path[floor], lower[floor] = made[floor], False
        top[i, lower] = -np.inf
        owner[i] = np.where(path < 0.0, -1, np.searchsorted(0.5 * (samples.s[1:] + samples.s[:-1]), path))
    return x, y, np.where(top <= work.stock.bottom.min(), -np.inf, top), owner


def _left(work: Workpiece, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) m, the height that the pieces of a work leave at points, and (n,) m of the path where; -1: nowhere."""
    top, piece = work.tops(x, y, (np.zeros(len(y), np.int64), np.full(len(y), len(work.pieces))))
    part: AnyArray = work.pieces[piece]
    along = np.where(part["turn"] != 0.0, foot(part, x, y, True)[0], foot(part, x, y, False)[0])
    share = within(along, part["extent"]) / np.where(part["extent"] > 0.0, part["extent"], 1.0)
    return top, np.where(piece < 0, -1.0, part["before"] + share * (part["after"] - part["before"]))


def _blocks(
    works: Sequence[Workpiece], tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter], chosen: BoolArray
) -> Iterator[tuple[Workpiece, IntArray, AnyArray]]:
    """Of the samples chosen (n,) that cut and move the work, some rows and their records."""
    moving = np.flatnonzero(chosen & (samples.motion != RAPID) & (samples.tangent != 0.0).any(axis=1))
    for number, work in enumerate(works):
        for rows, stations in blocks_of_stations(work, samples, cutters, moving[tilt[moving] == number]):
            yield work, rows, stations
