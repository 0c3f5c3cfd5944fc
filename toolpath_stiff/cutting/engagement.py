"""Engagement: where the cutter's envelope meets what stands before it, and how much it takes.

Tested on rings around the envelope, one for each layer of height: a point of the front (where the motion has a part
along the outward normal) is in the material if this stands above it after all pieces before the station's. Where that
changes along a ring, the step is halved until it is exact: so a wall stands where the path that made it put it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.stations import BLOCK, STATION, TOUCH, blocks_of_stations, heights_around, stations_along
from toolpath_stiff.cutting.workpiece import Workpiece
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.results import Progress, counter

AROUND = 33  # points of a ring, denser at the sides, where a light cut is
LEVELS, CORNER_LAYERS = 12, 6  # layers of the cylinder; of a corner or ball
COARSE = 3  # rings that look how high a corner or ball cuts
END_POINTS = 200  # of the end of a cutter that descends
HALVINGS, SECANTS = 14, 6  # of up to 9 degrees: 1e-5 rad; in turn with halvings
# Stations that share a contact: turn, rad, and tilt of the feed from one to the next; relative difference of rate and
# size of the contacts at the ends of a stretch, which has so many radii at most; stations that it may have.
SAME, ALIKE, SPAN, STRIDES = 0.05, 0.03, 0.6, (8, 4, 2, 1)
NARROW = 1e-4  # rad, arcs below are rounding
PLATEAU = 1e-6  # m: heights closer than this are a level
# Relative change of the rate of removal between two stations that is looked into, and the steps for it in radii: the
# rate begins as a root where a cutter enters.
SMALL = 2e-5  # cubes of the radius, volumes that are not looked into
STEPS = ((0.05, 0.05), (0.1, 0.01), (0.1, 0.002))

NO_PATCHES = Patches(np.zeros(0, dtype=np.int64), *[np.zeros(0)] * 4)
SIDES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, AROUND))  # shares of a ring


def engage(
    work: Workpiece,
    moves: Moves,
    samples: Samples,
    cutters: Mapping[int, Cutter],
    progress: Progress | None = None,
) -> Iterator[tuple[slice, Patches, FloatArray]]:
    """Blocks of samples with their patches of contact and the volume removed since the sample before.

    Parameters
    ----------
    work, moves, samples
        In the set-up frame: `workpiece_of` the moves as read, and their samples without a placement.
        `Patches.station` is a row of `samples`.
    cutters
        By number of the tool.

    Yields
    ------
    Rows of `samples`, in order and together all; patches; (rows,) m3 taken between the sample before and this one,
    0 for rapids and at the first sample of a move. Plunges remove, but have no patches: end cutting is not modelled.
    """
    last: AnyArray = np.zeros(1, dtype=STATION)
    last["move"], last_rate, begin = -1, np.zeros(1), 0
    along, tell = partial(stations_along, work, moves, cutters), counter(progress, "engagement")
    for rows, stations in blocks_of_stations(work, moves, samples, cutters):
        patches, rate = _contact_along(work, stations)
        end = int(rows[-1]) + 1
        removed = np.zeros(end - begin)
        joint, rates = np.concatenate([last, stations]), np.concatenate([last_rate, rate])
        removed[rows - begin] = _volumes(work, along, joint, rates, joint["move"][1:] == joint["move"][:-1])
        yield slice(begin, end), replace(patches, station=rows[patches.station]), removed
        last, last_rate, begin = stations[-1:], rate[-1:], end
        if tell:
            tell(begin, len(samples))
    if begin < len(samples):
        yield slice(begin, len(samples)), NO_PATCHES, np.zeros(len(samples) - begin)


def _volumes(
    work: Workpiece,
    along: Callable[[IntArray, FloatArray], AnyArray],
    stations: AnyArray,
    rate: FloatArray,
    joined: BoolArray,
    level: int = 0,
) -> FloatArray:
    """(n - 1,) m3 between n stations, where `joined` (n - 1,); in ever finer steps where the rate changes."""
    length, share = np.where(joined, np.diff(stations["path"]), 0.0), np.diff(stations["share"])
    volume = 0.5 * length * (rate[1:] + rate[:-1])
    if level == len(STEPS):
        return np.asarray(volume)
    change, step = STEPS[level]
    difference, reach = np.abs(np.diff(rate)), stations["reach"][1:]
    steps = np.maximum(np.ceil(length / (step * reach) - 1e-9), 1.0).astype(np.int64)
    changing = (difference > change * np.maximum(rate[1:], rate[:-1])) & (difference * length > SMALL * reach**3)
    rows = np.flatnonzero(changing & (length > STEPS[-1][1] * reach))
    for some in np.array_split(rows, len(rows) * 16 // BLOCK + 1):
        each = np.repeat(some, steps[some] + 1)
        number = np.arange(len(each)) - np.repeat(np.cumsum(steps[some] + 1) - steps[some] - 1, steps[some] + 1)
        finer = along(stations["move"][each], stations["share"][each] + share[each] * number / steps[each])
        rates = np.where(number == 0, rate[each], rate[each + 1])
        inner = (number > 0) & (number < steps[each])
        rates[inner] = _contact(work, finer[inner])[1]
        parts = _volumes(work, along, finer, rates, np.diff(each) == 0, level + 1)
        volume[some] = np.bincount(each[1:], parts, len(length))[some]
    return np.asarray(volume)


def _contact_along(work: Workpiece, stations: AnyArray) -> tuple[Patches, FloatArray]:
    """`_contact` of stations in the order of the path, where it changes; what stays alike is turned with the feed.

    At every eighth station, then between those that differ, up to every one. The end of a move and the start of the
    next, which goes on as that ended, count as one.
    """
    turn = np.diff(np.arctan2(stations["ahead_y"], stations["ahead_x"]), prepend=9.0)
    steady = (
        (np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi) < SAME)
        & (np.abs(np.diff(stations["down"], prepend=9.0)) < SAME)
        & ~stations["plunge"]
    )
    gap = np.diff(stations["path"], prepend=-np.inf)
    node = np.cumsum(~(steady & (gap < TOUCH))) - 1
    first = np.searchsorted(node, np.arange(node[-1] + 1 if len(node) else 0))
    broken = np.append(0, np.cumsum(~steady | (np.diff(stations["reach"], prepend=0.0) != 0.0)))[first + 1]
    path, source = stations["path"][first], np.full(len(first), -1)
    patches, rate, size = NO_PATCHES, np.zeros(len(first)), np.zeros(len(first))
    for stride in STRIDES:
        rows = np.flatnonzero((source < 0) & (np.arange(len(first)) % stride == 0))
        some, rate[rows] = _contact(work, stations[first[rows]])
        size[rows] = np.bincount(some.station, (some.exit - some.entry) * (some.high - some.low), len(rows))
        source[rows] = rows
        patches = Patches.joined([patches, replace(some, station=rows[some.station])])
        begin = np.arange(0, len(first) - stride, stride)
        end = begin + stride
        alike = (broken[begin] == broken[end]) & (path[end] - path[begin] < SPAN * stations["reach"][first[begin]])
        for values in (rate, size):
            alike &= np.abs(values[end] - values[begin]) <= ALIKE * np.maximum(values[end], values[begin])
        between = (begin[alike, None] + np.arange(1, stride)).ravel()
        nearest = np.where(np.arange(1, stride) <= stride // 2, begin[alike, None], end[alike, None]).ravel()
        new = source[between] < 0
        source[between[new]] = nearest[new]
        rate[between[new]], size[between[new]] = rate[nearest[new]], size[nearest[new]]
    order = np.argsort(patches.station, kind="stable")
    return _turned(patches.take(order), stations, first[source][node], source[node]), rate[node]


def _turned(patches: Patches, stations: AnyArray, origin: IntArray, source: IntArray) -> Patches:
    """Patches of all stations from those of others, whose rows are `origin` and whose patches have station `source`."""
    low, high = (np.searchsorted(patches.station, source, side) for side in ("left", "right"))
    counts = high - low
    station = np.repeat(np.arange(len(stations)), counts)
    patches = patches.take(np.arange(len(station)) + np.repeat(low - np.cumsum(counts) + counts, counts))
    heading = np.arctan2(stations["ahead_y"], stations["ahead_x"])
    by = np.where(origin == np.arange(len(stations)), 0.0, heading - heading[origin])
    by = (by[station] + np.pi) % (2.0 * np.pi) - np.pi
    entry, exit_ = (
        np.where((ends > 0.0) & (ends < np.pi), np.clip(ends + by, 0.0, np.pi), ends)
        for ends in (patches.entry, patches.exit)
    )
    return Patches(station, patches.low, patches.high, entry, exit_).take(exit_ - entry > NARROW)


def _contact(work: Workpiece, stations: AnyArray) -> tuple[Patches, FloatArray]:
    """Patches of stations, numbered from 0, and (n,) m2 the volume that each removes per length of path."""
    rate = _end_area(work, stations) * np.maximum(stations["down"], 0.0)
    corner = stations["reach"] - stations["flat"]
    reached = _reached(work, stations, corner)
    edges = corner[:, None] - corner[:, None] * np.cos(reached[:, None] * np.linspace(0.0, 1.0, CORNER_LAYERS + 1))
    rows = np.flatnonzero(reached > 0.5 * np.pi - 1e-6)  # on the cylinder above the corner, or a flat end's
    around = heights_around(work, stations[rows], (stations["reach"][rows] - TOUCH)[:, None], np.pi * SIDES[None, :])
    borders = _levels(around, corner[rows, None], stations["longest"][rows, None])
    parts = []
    for some, levels, smooth in ((np.arange(len(stations)), edges, True), (rows, borders, False)):
        row, layer = np.nonzero((np.diff(levels, axis=1) > 0.0) & ~stations["plunge"][some, None])
        low, high, at_each = levels[row, layer], levels[row, layer + 1], stations[some[row]]
        height, span = 0.5 * (low + high), at_each["reach"] - at_each["flat"]
        angle = np.arccos(np.clip(1.0 - height / np.where(span > 0.0, span, height), 0.0, 1.0))  # to the axis
        radius = at_each["flat"] + span * np.sin(angle) - TOUCH
        steep = at_each["down"] / np.maximum(at_each["level"], 1e-12) / np.maximum(np.tan(angle), 1e-12)
        back = np.arcsin(np.clip(steep if smooth else np.zeros(len(row)), -1.0, 1.0))
        ring = -back[:, None] + (np.pi + 2.0 * back)[:, None] * SIDES[:: 2 if smooth else 1]
        if smooth:
            inside = _above(work, at_each, radius[:, None], ring, height[:, None]) > 0.0
        else:
            inside = (around[0][row] > height[:, None]) & (around[1][row] < height[:, None])
        which, entry, exit_ = _arcs(work, at_each, radius, height, ring, inside, smooth)
        parts.append(Patches(some[row][which], low[which], high[which], entry, exit_))
    patches = Patches.joined(parts)
    rate += np.bincount(patches.station, _rates(stations[patches.station], patches), len(stations))
    return _merged(patches, stations), rate


def _above(
    work: Workpiece, stations: AnyArray, radius: FloatArray, angle: FloatArray, height: FloatArray
) -> FloatArray:
    """M of material above points of the envelope; below 0: none there."""
    top, bottom = heights_around(work, stations, radius, angle)
    return np.asarray(np.where(bottom < height, np.maximum(top - height, -1.0), -1.0))


def _reached(work: Workpiece, stations: AnyArray, corner: FloatArray) -> FloatArray:
    """(n,) rad between axis and normal, up to where a corner or a ball is in contact: narrowed down twice."""
    reached = np.full(len(stations), 0.5 * np.pi)
    rows = np.flatnonzero((corner > 0.0) & ~stations["plunge"])
    some, span = stations[rows], corner[rows, None, None]
    for _ in range(2 if len(rows) else 0):
        rings = reached[rows, None, None] * np.linspace(0.0, 1.0, COARSE + 1)[1:, None]
        heights = span - span * np.cos(rings)
        radius = some["flat"][:, None, None] + span * np.sin(rings) - TOUCH
        top = heights_around(work, some, radius, np.pi * SIDES[None, None, ::4])[0]
        inner = np.concatenate([top[:, :1], top[:, :-1]], axis=1)
        highest = np.clip(np.minimum(np.maximum(top, inner), heights).max(axis=(1, 2)), 0.0, corner[rows])
        reached[rows] = np.arccos(1.0 - highest / corner[rows])
    return reached


def _levels(around: tuple[FloatArray, FloatArray], corner: FloatArray, longest: FloatArray) -> FloatArray:
    """(n, LEVELS + 1) m above the tip, borders of layers in which heights (n, k) around the cylinder do not change.

    From the corner or the underside of the stock: all, or evenly many of more.
    """
    top, bottom = around
    base = np.maximum(np.clip(bottom, 0.0, None).min(axis=1, keepdims=True), corner)
    heights = np.concatenate([base, np.maximum(np.minimum(top, longest), base)], axis=1)
    heights = np.sort(heights, axis=1)
    rank = np.zeros(heights.shape, dtype=np.int64)
    rank[:, 1:] = np.cumsum(np.diff(heights, axis=1) > PLATEAU, axis=1)
    levels = np.full((len(heights), LEVELS + 1), -np.inf)
    row, column = np.nonzero(rank <= LEVELS)
    levels[row, rank[row, column]] = heights[row, column]
    levels[:, 0] = heights[:, 0]
    many = rank[:, -1] > LEVELS
    levels[many] = heights[many][:, np.round(np.linspace(0, heights.shape[1] - 1, LEVELS + 1)).astype(np.int64)]
    return np.asarray(np.maximum.accumulate(levels, axis=1))


def _arcs(
    work: Workpiece,
    stations: AnyArray,
    radius: FloatArray,
    height: FloatArray,
    ring: FloatArray,
    inside: BoolArray,
    smooth: bool,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Row, entry and exit of each arc in the material, in [0, 2 pi]; its ends by halving between points of the ring."""
    padded = np.pad(inside, ((0, 0), (1, 1)))
    row, start = np.nonzero(padded[:, 1:-1] & ~padded[:, :-2])
    stop = np.nonzero(padded[:, 1:-1] & ~padded[:, 2:])[1]
    points = ring.shape[1]
    ends = []
    for out, within in ((start - 1, start), (stop + 1, stop)):
        bracket = np.stack([ring[row, np.clip(out, 0, points - 1)], ring[row, within]])
        ends.append(_ends(work, stations[row], radius[row], height[row], bracket, smooth))
    wide = ends[1] - ends[0] > NARROW
    row, entry, exit_ = row[wide], ends[0][wide], ends[1][wide]
    # Behind the left side: an arc across 0 is two.
    across = np.flatnonzero(entry < 0.0)
    row = np.concatenate([row, row[across]])
    behind = np.minimum(exit_[across], 0.0) + 2.0 * np.pi
    exit_ = np.concatenate([exit_, behind])
    entry = np.concatenate([np.maximum(entry, 0.0), entry[across] + 2.0 * np.pi])
    order = np.argsort(row, kind="stable")
    order = order[(exit_ - entry)[order] > 0.0]
    return row[order], entry[order], exit_[order]


def _ends(
    work: Workpiece, stations: AnyArray, radius: FloatArray, height: FloatArray, bracket: FloatArray, smooth: bool
) -> FloatArray:
    """(k,) rad, where a ring leaves the material within a bracket (2, k) from outside to within; equal: the ring's end.

    By halving, as a wall has no slope; in turn with the secant where surfaces are smooth.
    """
    ends: FloatArray = bracket[1].copy()
    moving = np.flatnonzero(bracket[0] != bracket[1])
    some, r, z, (a, b) = stations[moving], radius[moving], height[moving], bracket[:, moving]
    outside, within = np.full((2, len(moving)), np.nan)
    for step in range(SECANTS if smooth else HALVINGS):
        share = _secant(outside, within) if smooth and step % 2 else np.full(len(moving), 0.5)
        middle = a + np.clip(share, 0.05, 0.95) * (b - a)
        above = _above(work, some, r, middle, z)
        inside = above > 0.0
        a, b = np.where(inside, a, middle), np.where(inside, middle, b)
        outside, within = np.where(inside, outside, above), np.where(inside, above, within)
    ends[moving] = a + (_secant(outside, within) if smooth else np.full(len(moving), 0.5)) * (b - a)
    return ends


def _secant(outside: FloatArray, within: FloatArray) -> FloatArray:
    """Share of a bracket where a line through the values at its ends, below and above 0, crosses 0; nan: not known."""
    share = outside / (outside - within)
    return np.asarray(np.where(np.isnan(share), 0.5, share))


def _rates(stations: AnyArray, patches: Patches) -> FloatArray:
    """(p,) m2 of each patch: the motion along the normal, over its area (r dz / sin kappa dphi)."""
    corner = stations["reach"] - stations["flat"]
    safe = np.where(corner > 0.0, corner, 1.0)
    rounded = patches.low < corner
    first, second = (np.arccos(np.clip(1.0 - z / safe, 0.0, 1.0)) for z in (patches.low, patches.high))
    area = (second - first - np.sin(second) * np.cos(second) + np.sin(first) * np.cos(first)) * 0.5 * corner**2
    sideways = np.where(rounded, area, 0.0) + (patches.high - patches.low) * np.where(
        rounded, stations["flat"], stations["reach"]
    )
    outer, inner = (stations["flat"] + corner * np.sin(angle) for angle in (second, first))
    downward = np.where(rounded, 0.5 * (outer**2 - inner**2), 0.0) * (patches.exit - patches.entry)
    turned = np.cos(patches.entry) - np.cos(patches.exit)
    return np.asarray(stations["level"] * turned * sideways + stations["down"] * downward)


def _end_area(work: Workpiece, stations: AnyArray) -> FloatArray:
    """(n,) m2 of material under the flat end where the cutter descends; of a plunge under the whole of it.

    Counted over a spiral of even points (Vogel 1979), which turns along the path: its errors cancel.
    """
    area = np.zeros(len(stations))
    rows = np.flatnonzero((stations["down"] > 0.0) & (stations["plunge"] | (stations["flat"] > 0.0)))
    some, number = stations[rows], np.arange(END_POINTS)
    widest, flat = np.where(some["plunge"], some["reach"], some["flat"]), some["flat"][:, None]
    radius = widest[:, None] * np.sqrt((number + 0.5) / END_POINTS)[None, :]
    angle = np.pi * (3.0 - np.sqrt(5.0)) * number[None, :] + (some["path"] / some["reach"])[:, None]
    corner = some["reach"][:, None] - flat
    height = corner - np.sqrt(np.maximum(corner**2 - np.maximum(radius - flat, 0.0) ** 2, 0.0))
    area[rows] = np.pi * widest**2 * (_above(work, some, radius, angle, height) > 0.0).mean(axis=1)
    return area


def _merged(patches: Patches, stations: AnyArray) -> Patches:
    """Patches of neighbouring layers with the same angles as one; none goes across the end of a corner."""
    order = np.lexsort((patches.low, patches.entry.round(6), patches.station))
    patches = patches.take(order)
    corner = (stations["reach"] - stations["flat"])[patches.station]
    same = (np.diff(patches.station) == 0) & (np.abs(patches.low[1:] - patches.high[:-1]) < TOUCH)
    same &= (np.abs(np.diff(patches.entry)) < NARROW) & (np.abs(np.diff(patches.exit)) < NARROW)
    same &= (patches.low[1:] < corner[1:]) == (patches.low[:-1] < corner[1:])
    firsts = np.flatnonzero(np.append(True, ~same)[: len(patches.low)])
    lasts = np.append(firsts[1:], len(patches.low)) - 1 if len(firsts) else firsts
    high = patches.high[lasts]
    patches = patches.take(firsts)
    return Patches(patches.station, patches.low, high, patches.entry, patches.exit)
