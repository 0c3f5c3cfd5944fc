"""Surface of the finished part: the stations that make its walls, floors and scallops; its heights, with owners."""

from collections.abc import Iterator, Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.envelopes import down_slope, foot, rise, within
from toolpath_stiff.cutting.stations import blocks_of_stations, points_around
from toolpath_stiff.cutting.tilts import TURNING
from toolpath_stiff.cutting.workpiece import Workpiece, in_frames
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.path.sampling import Samples

BESIDE = 2e-6  # m, outside of a wall, where it must stand; and how far above the finished surface still is that surface
COLUMNS, DEEP = 32, 1e9  # of cells at a time; m, below everything
MADE = 5.0  # times that, along a tool, within which the piece lies that made a surface
TOUCHED = 2e-7  # m, within which a later pass touches a surface, and makes it: less than any surface error
LATER = 0.1  # radii of the cutter along the path, beyond which a pass is another one
ACROSS = 41  # points across the cutter's end
# Radii of a ball, above the finished surface: where the nearest of these points may lie beside a narrow scallop,
# (pi / 80)^2 / 2.
SCALLOP = 8e-4


def walls_of_passes(
    work: Workpiece, tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter]
) -> tuple[FloatArray, FloatArray]:
    """(n, 2, 2) m above the tip: lowest and highest point of the walls that a sample makes, left and right.

    Samples and their tilts (n,) as `stations.samples_seen`.

    First the walls that no later pass has cut deeper, then those of them that none has touched since (a spring pass
    makes a wall anew). nan where the finished part has no wall there. A corner's radius is below the wall.
    """
    made, own = np.full((2, len(samples), 2, 2), np.nan)
    for rows, stations in _blocks(work, tilt, samples, cutters, np.full(len(samples), True)):
        sides, reach = np.array([[0.0, np.pi]]), stations["reach"][:, None]
        x, y = points_around(stations, reach + BESIDE, sides)
        every, tip = np.full(len(x), len(work.pieces)), np.repeat(stations["z"], 2)
        tilts, other = np.repeat(stations["tilt"], 2), stations["path"] + LATER * stations["reach"]
        later = np.repeat(np.searchsorted(work.pieces["before"], other, "right"), 2)
        limits = tip + np.repeat(stations["reach"] - stations["flat"], 2), tip + np.repeat(stations["longest"], 2)
        low, high = work.span(x, y, tilts, limits, (np.zeros_like(every), every))
        stands = np.flatnonzero((high - low > BESIDE) & ~np.repeat(stations["end_alone"], 2))
        window, tilts = (later[stands], every[stands]), tilts[stands]
        for walls, offset in ((made, TOUCHED), (own, -TOUCHED)):
            x, y = (axis[stands] for axis in points_around(stations, reach + offset, sides))
            foot, top = (z - tip[stands] for z in work.span(x, y, tilts, (low[stands], high[stands]), window))
            part = np.full((len(tip), 2), np.nan)
            stays = top - foot > BESIDE
            part[stands[stays]] = np.stack([foot, top], axis=1)[stays]
            walls[rows] = part.reshape(-1, 2, 2)
    return made, own


def final_strip(
    work: Workpiece, tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter], chosen: BoolArray
) -> FloatArray:
    """(n, 2) m across the feed, + to the left: lowest and highest offset at which a sample makes the finished surface.

    Of the samples chosen (n,), as of `walls_of_passes`, with the end of the cutter: of a flat end the strip of floor,
    of a ball the scallop around its point of contact kappa = asin(|offset| / R). nan: none.
    """
    strips = np.full((len(samples), 2), np.nan)
    for rows, stations in _blocks(work, tilt, samples, cutters, chosen):
        offset = stations["reach"][:, None] * np.sin(np.linspace(-0.5, 0.5, ACROSS) * np.pi)[None, :]
        reach, flat = stations["reach"][:, None], stations["flat"][:, None]
        # On a slope the envelope leaves a point behind or ahead of the tip, where its normal is square to the motion.
        slope = stations["down"] / np.maximum(stations["level"], 1e-12)
        back = down_slope(np.abs(slope)[:, None], np.abs(offset), reach, flat)
        back = np.where(slope == 0.0, 0.0, np.sign(slope))[:, None] * back
        away = np.hypot(offset, back)
        surface = (stations["z"][:, None] + rise(reach, flat, away)).ravel()
        x, y = points_around(stations, away, np.arctan2(-back, offset))
        every, tilts = np.full(len(surface), len(work.pieces)), np.repeat(stations["tilt"], ACROSS)
        ball = stations["flat"] == 0.0
        near = np.repeat(BESIDE + np.where(ball, SCALLOP * stations["reach"], 0.0), ACROSS)
        limits = surface - near, surface + 2.0 * near
        low, high = work.span(x, y, tilts, limits, (np.zeros_like(every), every))
        stays: BoolArray = (np.abs(high - surface) < near) & (low < surface)
        stays &= ~np.repeat(stations["end_alone"], ACROSS)
        # A flat end passes a point of the floor twice, with its front and with its back.
        other = stations["path"] + LATER * stations["reach"] + 2.0 * stations["flat"]
        some = np.flatnonzero(stays)
        later = np.searchsorted(work.pieces["before"], other, "right")[some // ACROSS]
        limits = surface[some] - 2.0 * TOUCHED, surface[some] + 2.0 * TOUCHED
        above = work.span(x[some], y[some], tilts[some], limits, (later, every[some]))[1] - surface[some]
        stays[some] = (above > TOUCHED) | ((above < -TOUCHED) & ball[some // ACROSS])
        stays = stays.reshape(offset.shape)
        low, high = np.where(stays, offset, np.inf).min(axis=1), np.where(stays, offset, -np.inf).max(axis=1)
        strips[rows] = np.where(np.isfinite(low)[:, None], np.stack([low, high], axis=1), np.nan)
    return strips


def finished_surface(
    work: Workpiece, samples: Samples, cell: float
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """(nx,) and (ny,) m, centres of cells; (nx, ny) m, height of the finished part; (nx, ny) the sample that made it.

    -inf and -1: no material, or the wall of a tool that stood aslant; nothing cut.
    """
    size = work.stock.cell * work.stock.top.shape
    x, y = (
        corner + (np.arange(count) + 0.5) * edge / count
        for corner, edge, count in zip(work.stock.corner, size, np.ceil(size / cell).astype(np.int64), strict=True)
    )
    top, owner = np.empty((len(x), len(y))), np.empty((len(x), len(y)), dtype=np.int64)
    for rows in (slice(start, start + COLUMNS) for start in range(0, len(x), COLUMNS)):
        across, along = (places.ravel() for places in np.meshgrid(x[rows], y, indexing="ij"))
        upright = np.zeros(len(across), dtype=np.int64)
        whole = upright, np.full(len(across), len(work.pieces))
        if work.tilted:
            high = work.span(across, along, upright, (-np.inf, np.inf), whole)[1]
            below = np.stack([across, along, np.maximum(high, -DEEP) - BESIDE])
            piece = work.lowest(below, upright, whole, np.full(len(across), MADE * BESIDE))[1]
            high[(piece < 0) & (high < work.stock.tops(across, along) - BESIDE)] = -np.inf
        else:
            high, piece = work.tops(across, along, whole)
        part: AnyArray = work.pieces[piece]
        u, v, _ = in_frames(np.stack([across, along, np.maximum(high, -DEEP)]), work.turns, part["tilt"])
        place = np.where(part["turn"] != 0.0, foot(part, u, v, True)[0], foot(part, u, v, False)[0])
        share = within(place, part["extent"]) / np.where(part["extent"] > 0.0, part["extent"], 1.0)
        path = part["before"] + share * (part["after"] - part["before"])
        made = np.where(piece < 0, -1, np.searchsorted(0.5 * (samples.s[1:] + samples.s[:-1]), path))
        top[rows], owner[rows] = high.reshape(-1, len(y)), made.reshape(-1, len(y))
    return x, y, np.where(top <= work.stock.bottom.min(), -np.inf, top), owner


def _blocks(
    work: Workpiece, tilt: IntArray, samples: Samples, cutters: Mapping[int, Cutter], chosen: BoolArray
) -> Iterator[tuple[IntArray, AnyArray]]:
    """Blocks of the chosen samples (n,) that cut and move with a tool of fixed orientation: rows and their records."""
    chosen = chosen & (work.tilts[samples.move] != TURNING) & (samples.motion != RAPID)
    moving = np.flatnonzero(chosen & (samples.tangent != 0.0).any(axis=1))
    yield from blocks_of_stations(work, samples, tilt, cutters, moving)
