"""Engagement: contact of the cutter's envelope with the stock before it, and the volume removed.

Tested on rings around the envelope, one for each layer of height: a point of the front (where the motion has a part
along the outward normal) is in the material if this stands above it after all pieces before the station's. Where that
changes along a ring, the step is halved until it is exact: so a wall stands where the path that made it put it.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, numbered
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.envelopes import rise
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.stations import (
    BLOCK,
    STATION,
    TOUCH,
    around,
    blocks_of_stations,
    pieces_at,
    samples_seen,
    stations_between,
)
from toolpath_stiff.cutting.tilts import TURNING
from toolpath_stiff.cutting.workpiece import Workpiece
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.results import Progress, counter

AROUND = 33  # points of a ring, denser at the sides, where light cuts are
LEVELS, PARTS = 12, 3  # layers of the cylinder; parts of each where the work has not levels alone
CORNER_LAYERS, LOW, FEWER = 10, 0.8, 2.0  # of a corner or ball; by FEWER less if its contact ends at a kappa of LOW
COARSE = 3  # rings for finding the height up to which a corner or ball cuts
END_POINTS = 200  # on the end of a descending cutter
HALVINGS = 14, 7  # of up to 9 degrees: 1e-5 rad; of up to 18 degrees round a corner or a ball: 2.5e-3 rad
# Stations that share a contact: turn, rad, and tilt of the feed from one to the next; relative difference of rate and
# size of the contacts at the ends of a stretch, which has so many radii at most; stations that it may have.
SAME, ALIKE, SPAN, STRIDES = 0.05, 0.05, 0.8, (16, 8, 4, 2, 1)
NARROW = 1e-4  # rad, arcs below are rounding
PLATEAU = 1e-6  # m: heights closer than this are a level
# Relative change of the rate of removal between two stations that is looked into, and the steps for it in radii: the
# rate begins as a root where a cutter enters.
SMALL = 1e-4  # cubes of the radius; smaller volumes are not refined
STEPS = ((0.1, 0.05), (0.2, 0.01), (0.2, 0.002))

NO_PATCHES = Patches(np.zeros(0, dtype=np.int64), *[np.zeros(0)] * 4)
SIDES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, AROUND))  # shares of a ring


@dataclass(frozen=True)
class Engagement:
    """Engagement at n samples: contact and volume removed.

    Attributes
    ----------
    work
        After the last cut.
    patches
        Of contact, of some of the samples. Plunges remove, but have none: end cutting is not modelled.
    source
        (n,) the sample whose patches hold for each: along many short moves those that hardly differ share them.
    removed
        (n,) m3 taken between the sample before and this one; 0 at the first sample of a move.
    struck
        (n,) rapids that run into material.
    """

    work: Workpiece
    patches: Patches
    source: IntArray
    removed: FloatArray
    struck: BoolArray


def engage(
    stages: Iterable[Workpiece],
    moves: Moves,
    samples: Samples,
    cutters: Mapping[int, Cutter],
    progress: Progress | None = None,
) -> Engagement:
    """The engagement of samples; `stages` as from `workpiece.stages_of` for the moves, `cutters` by tool number.

    A rapid whose tool turns on the way is not looked at.
    """
    count, parts, tell = len(samples), [NO_PATCHES], counter(progress, "engagement")
    source, removed, struck = np.arange(count), np.zeros(count), np.zeros(count, dtype=bool)
    regime = np.zeros(count, dtype=np.int64)  # changes of other quantities on which forces depend
    for column in (samples.tool, samples.feed, samples.spindle):
        regime[1:] += np.nan_to_num(column[1:]) != np.nan_to_num(column[:-1])
    regime, begin = np.cumsum(regime), 0
    last, last_rate = np.zeros(1, dtype=STATION), np.zeros(1)
    last["move"] = -1
    piece: IntArray | None = None
    for work in stages:
        if piece is None:
            tilt, seen = samples_seen(work, samples)
            moving = np.flatnonzero((samples.tangent != 0.0).any(axis=1) & (tilt != TURNING))
            piece = pieces_at(work, samples.move[moving], samples.s[moving])
        end = int(np.searchsorted(piece, work.until)) if work.until < len(work.pieces) else len(moving)
        for rows, stations in blocks_of_stations(work, seen, tilt, cutters, moving[begin:end]):
            patches, own, rate = _contact_along(work, stations, regime[rows])
            rapid = stations["recent"] == len(work.pieces)
            struck[rows], rate[rapid] = rapid & (rate > 0.0), 0.0
            joint, rates = np.concatenate([last, stations]), np.concatenate([last_rate, rate])
            joined = (joint["move"][1:] == joint["move"][:-1]) & ~rapid
            along = partial(stations_between, work, moves, cutters)
            removed[rows] = _volumes(work, along, joint, rates, joined)
            source[rows] = rows[own]
            parts.append(replace(patches, station=rows[patches.station]))
            last, last_rate = stations[-1:], rate[-1:]
            if tell:
                tell(int(rows[-1]) + 1, count)
        begin = end
    struck &= (samples.motion == RAPID) & (samples.s >= _placed(moves, samples))
    return Engagement(work, Patches.joined(parts), source, removed, struck)


def _placed(moves: Moves, samples: Samples) -> float:
    """Path length (m) up to which the program has not yet stated the tool's position in all three axes."""
    named = moves.end[:, :3] != moves.start[:, :3]
    return float(samples.s[samples.move <= named.argmax(axis=0).max()].max(initial=0.0))


def _volumes(
    work: Workpiece,
    along: Callable[[IntArray, FloatArray], AnyArray],
    stations: AnyArray,
    rate: FloatArray,
    joined: BoolArray,
    level: int = 0,
) -> FloatArray:
    """(n - 1,) m3 between n stations, where `joined` (n - 1,); with finer steps where the rate changes."""
    length = np.where(joined, np.diff(stations["path"]), 0.0)
    volume = 0.5 * length * (rate[1:] + rate[:-1])
    if level == len(STEPS):
        return np.asarray(volume)
    change, step = STEPS[level]
    difference, reach = np.abs(np.diff(rate)), stations["reach"][1:]
    steps = np.maximum(np.ceil(length / (step * reach) - 1e-9), 1.0).astype(np.int64)
    changing = (difference > change * np.maximum(rate[1:], rate[:-1])) & (difference * length > SMALL * reach**3)
    rows = np.flatnonzero(changing & (length > STEPS[-1][1] * reach))
    for some in np.array_split(rows, len(rows) * 16 // BLOCK + 1) if len(rows) else ():
        each, number = numbered(steps[some] + 1)
        each = some[each]
        finer = along(stations["move"][each], stations["path"][each] + length[each] * number / steps[each])
        rates = np.where(number == 0, rate[each], rate[each + 1])
        inner = (number > 0) & (number < steps[each])
        rates[inner] = _contact(work, finer[inner])[1]
        parts = _volumes(work, along, finer, rates, np.diff(each) == 0, level + 1)
        volume[some] = np.bincount(each[1:], parts, len(length))[some]
    return np.asarray(volume)


def _contact_along(work: Workpiece, stations: AnyArray, regime: IntArray) -> tuple[Patches, IntArray, FloatArray]:
    """Contact of stations along the path, computed where it changes, and (n,) the station whose contact each shares.

    At every 32nd station, then between those that differ, up to every one. The end of a move and the start of the
    next, which goes on as that ended, count as one.
    """
    turn = np.diff(np.arctan2(stations["ahead_y"], stations["ahead_x"]), prepend=9.0)
    steady = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi) < SAME
    steady &= (np.abs(np.diff(stations["down"], prepend=9.0)) < SAME) & (np.diff(regime, prepend=-1) == 0)
    steady &= ~stations["end_alone"] & (np.diff(work.tilts[stations["move"]], prepend=-9) == 0)
    node = np.cumsum(~(steady & (np.diff(stations["path"], prepend=-np.inf) < TOUCH))) - 1
    first = np.searchsorted(node, np.arange(node[-1] + 1))
    broken = np.append(0, np.cumsum(~steady))[first + 1]
    path, down, source = stations["path"][first], stations["down"][first], np.full(len(first), -1)
    patches, rate, size = NO_PATCHES, np.zeros(len(first)), np.zeros(len(first))
    for stride in STRIDES:
        rows = np.flatnonzero((source < 0) & (np.arange(len(first)) % stride == 0))
        some, rate[rows] = _contact(work, stations[first[rows]])
        size[rows] = np.bincount(some.station, (some.exit - some.entry) * (some.high - some.low), len(rows))
        source[rows] = rows
        patches = Patches.joined([patches, replace(some, station=first[rows[some.station]])])
        begin = np.arange(0, len(first) - stride, stride)
        end = begin + stride
        alike = (broken[begin] == broken[end]) & (path[end] - path[begin] < SPAN * stations["reach"][first[begin]])
        alike &= np.abs(down[end] - down[begin]) < SAME
        for values in (rate, size):
            alike &= np.abs(values[end] - values[begin]) <= ALIKE * np.maximum(values[end], values[begin])
        between = (begin[alike, None] + np.arange(1, stride)).ravel()
        nearest = np.where(np.arange(1, stride) <= stride // 2, begin[alike, None], end[alike, None]).ravel()
        new = source[between] < 0
        source[between[new]] = nearest[new]
        rate[between[new]], size[between[new]] = rate[nearest[new]], size[nearest[new]]
    order = np.argsort(patches.station, kind="stable")
    return patches.take(order), first[source][node], rate[node]


def _contact(work: Workpiece, stations: AnyArray) -> tuple[Patches, FloatArray]:
    """Patches of stations, numbered from 0, and (n,) m2, volume removed per path length by each."""
    rate = _end_area(work, stations)
    corner = stations["reach"] - stations["flat"]
    rows = np.flatnonzero(~stations["end_alone"])
    wall, low = (stations["reach"][rows] - TOUCH)[:, None], corner[rows, None]
    beside = _heights_around(work, stations[rows], wall, np.pi * SIDES[None, :], np.inf, low)
    beyond = (beside[0] > low).any(axis=1)  # the corner
    rows, beside = rows[beyond], (beside[0][beyond], beside[1][beyond])
    borders = _levels(beside, corner[rows, None], stations["longest"][rows, None], 1 if work.has_levels else PARTS)
    reached = np.full(len(stations), 0.5 * np.pi)
    below = np.setdiff1d(np.flatnonzero((corner > 0.0) & ~stations["end_alone"]), rows)
    reached[below] = _reached(work, stations[below], corner[below])
    shares = np.linspace(0.0, 1.0, CORNER_LAYERS + 1) * np.where(reached < LOW, FEWER, 1.0)[:, None]
    edges = corner[:, None] - corner[:, None] * np.cos(reached[:, None] * np.minimum(shares, 1.0))
    parts = []
    for some, levels, round_part in ((np.arange(len(stations)), edges, True), (rows, borders, False)):
        row, layer = np.nonzero((np.diff(levels, axis=1) > 0.0) & ~stations["end_alone"][some, None])
        low, high, own = levels[row, layer], levels[row, layer + 1], stations[some[row]]
        height, span = 0.5 * (low + high), own["reach"] - own["flat"]
        angle = np.arccos(np.clip(1.0 - height / np.where(span > 0.0, span, height), 0.0, 1.0))  # to the axis
        radius = own["flat"] + span * np.sin(angle) - TOUCH
        back = np.zeros(len(row))  # angle by which a descending cutter's front reaches behind the sides
        if round_part:
            steep = own["down"] / np.maximum(own["level"], 1e-12) / np.maximum(np.tan(angle), 1e-12)
            back = np.arcsin(np.clip(steep, -1.0, 1.0))
            ring = -back[:, None] + (np.pi + 2.0 * back)[:, None] * SIDES[::2]
            inside = _cuts(work, own, radius[:, None], ring, height[:, None])
        else:
            ring = np.broadcast_to(np.pi * SIDES, (len(row), AROUND))
            inside = (beside[0][row] > height[:, None]) & (beside[1][row] < height[:, None])
            if work.tilted:  # there may be gaps in the material
                inside = _cuts(work, own, radius[:, None], ring, height[:, None])
        which, entry, exit_ = _arcs(work, own, radius, height, ring, inside, HALVINGS[round_part])
        parts.append(Patches(some[row][which], low[which], high[which], entry, exit_))
    patches = Patches.joined(parts)
    patches = patches.take(np.argsort(patches.station, kind="stable"))
    return patches, rate + np.bincount(patches.station, _rates(stations[patches.station], patches), len(stations))


def _cuts(work: Workpiece, stations: AnyArray, radius: FloatArray, angle: FloatArray, height: FloatArray) -> BoolArray:
    """True where material stands above points of the envelope."""
    x, y, tilt, window = around(stations, radius, angle)
    shape = np.broadcast_shapes(radius.shape, angle.shape)
    z = height + stations["z"].reshape((-1,) + (1,) * (len(shape) - 1))
    return work.standing(np.stack([x, y, np.broadcast_to(z, shape).ravel()]), tilt, window).reshape(shape)


def _heights_around(
    work: Workpiece,
    stations: AnyArray,
    radius: FloatArray,
    angle: FloatArray,
    ceiling: FloatArray | float,
    enough: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Top and underside of the material around each station, m above the tip; points as in `points_around`.

    `ceiling` and `enough`, m above the tip, are the ends of `Workpiece.span`.
    """
    x, y, tilt, window = around(stations, radius, angle)
    whole = np.zeros(np.broadcast_shapes(radius.shape, angle.shape))
    z = stations["z"].reshape((-1,) + (1,) * (whole.ndim - 1))
    low, high = ((whole + (z + height)).ravel() for height in (enough, ceiling))
    bottom, top = work.span(x, y, tilt, (low, high), window)
    return top.reshape(whole.shape) - z, bottom.reshape(whole.shape) - z


def _reached(work: Workpiece, stations: AnyArray, corner: FloatArray) -> FloatArray:
    """(n,) rad between tool axis and normal up to which a corner or a ball is in contact; refined twice."""
    reached, span = np.full(len(stations), 0.5 * np.pi), corner[:, None, None]
    for _ in range(2 if len(stations) else 0):
        rings = reached[:, None, None] * np.linspace(0.0, 1.0, COARSE + 1)[1:, None]
        heights = span - span * np.cos(rings)
        radius = stations["flat"][:, None, None] + span * np.sin(rings) - TOUCH
        ceiling = np.concatenate([heights[:, 1:], heights[:, -1:]], axis=1)  # of the next ring, whose inner one this is
        top = _heights_around(work, stations, radius, np.pi * SIDES[None, None, ::4], ceiling, 0.0)[0]
        inner = np.concatenate([top[:, :1], top[:, :-1]], axis=1)
        highest = np.clip(np.minimum(np.maximum(top, inner), heights).max(axis=(1, 2)), 0.0, corner)
        reached = np.arccos(1.0 - highest / corner)
    return reached


def _levels(around: tuple[FloatArray, FloatArray], corner: FloatArray, longest: FloatArray, parts: int) -> FloatArray:
    """(n, LEVELS * parts + 1) m above the tip, borders of layers in which heights (n, k) around the cylinder are equal.

    From the corner or the underside of the stock: all, or evenly many of more.
    """
    top, bottom = around
    base = np.maximum(np.clip(bottom, 0.0, None).min(axis=1, keepdims=True), corner)
    heights = np.concatenate([base, np.maximum(np.minimum(top, longest), base)], axis=1)
    below = np.where((top > bottom) & (bottom > base + TOUCH), np.clip(bottom, base, longest), base)
    if (below > base).any():
        heights = np.concatenate([heights, below], axis=1)
    heights = np.sort(heights, axis=1)
    rank = np.zeros(heights.shape, dtype=np.int64)
    rank[:, 1:] = np.cumsum(np.diff(heights, axis=1) > PLATEAU, axis=1)
    levels = np.full((len(heights), LEVELS + 1), -np.inf)
    row, column = np.nonzero(rank <= LEVELS)
    levels[row, rank[row, column]] = heights[row, column]
    levels[:, 0] = heights[:, 0]
    many = rank[:, -1] > LEVELS
    levels[many] = heights[many][:, np.round(np.linspace(0, heights.shape[1] - 1, LEVELS + 1)).astype(np.int64)]
    levels = np.maximum.accumulate(levels, axis=1)
    finer = levels[:, :-1, None] + np.diff(levels, axis=1)[:, :, None] * np.arange(parts) / parts
    return np.concatenate([finer.reshape(len(levels), LEVELS * parts), levels[:, -1:]], axis=1)


def _arcs(
    work: Workpiece,
    stations: AnyArray,
    radius: FloatArray,
    height: FloatArray,
    ring: FloatArray,
    inside: BoolArray,
    halvings: int,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Row, entry and exit of each arc in the material, in [0, 2 pi]; ends bisected between points of the ring."""
    padded = np.pad(inside, ((0, 0), (1, 1)))
    row, start = np.nonzero(padded[:, 1:-1] & ~padded[:, :-2])
    stop = np.nonzero(padded[:, 1:-1] & ~padded[:, 2:])[1]
    both, out, within = np.append(row, row), np.append(start - 1, stop + 1), np.append(start, stop)
    bracket = np.stack([ring[both, np.clip(out, 0, ring.shape[1] - 1)], ring[both, within]])
    entry, exit_ = np.split(_ends(work, stations[both], radius[both], height[both], bracket, halvings), 2)
    wide = exit_ - entry > NARROW
    row, entry, exit_ = row[wide], entry[wide], exit_[wide]
    # Behind the left side: an arc across 0 becomes two arcs.
    across = np.flatnonzero(entry < 0.0)
    row = np.concatenate([row, row[across]])
    behind = np.minimum(exit_[across], 0.0) + 2.0 * np.pi
    exit_ = np.concatenate([exit_, behind])
    entry = np.concatenate([np.maximum(entry, 0.0), entry[across] + 2.0 * np.pi])
    order = np.argsort(row, kind="stable")
    order = order[(exit_ - entry)[order] > 0.0]
    return row[order], entry[order], exit_[order]


def _ends(
    work: Workpiece, stations: AnyArray, radius: FloatArray, height: FloatArray, bracket: FloatArray, halvings: int
) -> FloatArray:
    """(k,) rad where a ring leaves the material in a bracket (2, k) from outside to inside; equal: the ring's end."""
    ends: FloatArray = bracket[1].copy()
    moving = np.flatnonzero(bracket[0] != bracket[1])
    some, r, z, (a, b) = stations[moving], radius[moving], height[moving], bracket[:, moving]
    for _ in range(halvings):
        middle = 0.5 * (a + b)
        inside = _cuts(work, some, r, middle, z)
        a, b = np.where(inside, a, middle), np.where(inside, middle, b)
    ends[moving] = 0.5 * (a + b)
    return ends


def _rates(stations: AnyArray, patches: Patches) -> FloatArray:
    """(p,) m2 of each patch: the motion along the normal, integrated over its area (r dz / sin kappa dphi)."""
    corner = stations["reach"] - stations["flat"]
    safe = np.where(corner > 0.0, corner, 1.0)
    rounded = patches.low < corner
    first, second = (np.arccos(np.clip(1.0 - z / safe, 0.0, 1.0)) for z in (patches.low, patches.high))
    area = (second - first - np.sin(second) * np.cos(second) + np.sin(first) * np.cos(first)) * 0.5 * corner**2
    sideways = np.where(rounded, area, 0.0) + (patches.high - patches.low) * np.where(
        rounded, stations["flat"], stations["reach"]
    )
    outer, inner = (stations["flat"] + corner * np.sin(angle) for angle in (second, first))
    below = np.where(rounded, 0.5 * (outer**2 - inner**2), 0.0)
    downward = below * (patches.exit - patches.entry)
    turned, aside = np.cos(patches.entry) - np.cos(patches.exit), np.sin(patches.exit) - np.sin(patches.entry)
    beside = 0.5 * stations["reach"] * ((patches.high - corner) ** 2 - (patches.low - corner) ** 2)
    swing = stations["swing_ahead"] * turned + stations["swing_left"] * aside
    swing *= np.where(rounded, stations["flat"] * below, beside)
    return np.asarray(stations["level"] * turned * sideways + stations["down"] * downward + swing)


def _end_area(work: Workpiece, stations: AnyArray) -> FloatArray:
    """(n,) m2 removed per path length by the flat end of a descending cutter; for a plunge or a rapid by its whole end.

    Counted over a spiral of even points (Vogel 1979), which turns along the path: its errors cancel.
    """
    area = np.zeros(len(stations))
    swings = (stations["swing_ahead"] != 0.0) | (stations["swing_left"] != 0.0)
    rows = np.flatnonzero(stations["end_alone"] | (((stations["down"] > 0.0) | swings) & (stations["flat"] > 0.0)))
    some, number = stations[rows], np.arange(END_POINTS)
    widest = np.where(some["end_alone"], some["reach"], some["flat"])
    radius = widest[:, None] * np.sqrt((number + 0.5) / END_POINTS)[None, :]
    angle = np.pi * (3.0 - np.sqrt(5.0)) * number[None, :] + (some["path"] / np.maximum(some["reach"], TOUCH))[:, None]
    height = rise(some["reach"][:, None], some["flat"][:, None], radius) + TOUCH
    cut = _cuts(work, some, radius, angle, height)
    ahead, left = (some[name][:, None] for name in ("swing_ahead", "swing_left"))
    fall = some["down"][:, None] + radius * (np.sin(angle) * ahead + np.cos(angle) * left)
    fall = np.where((some["recent"] == len(work.pieces))[:, None], 1.0, np.maximum(fall, 0.0))
    area[rows] = np.pi * widest**2 * (cut * fall).mean(axis=1)
    return area
