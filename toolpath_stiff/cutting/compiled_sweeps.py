"""The heights of `sweeps.heights_above` and their least over the pieces of a cell, point by point, compiled with numba.

Import this module only through `workpiece`: numba comes with it. Why it pays: a piece that cannot lie below what others
have left is passed over without a look at it, which arrays cannot.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, untyped-decorator"
# ruff: noqa: D103 - `sweeps` says what they are

import math

import numba
import numpy as np

from toolpath_stiff.cutting.sweeps import FIELDS

X, Y, Z, TURN, HEADING, COS, SIN, EXTENT, SLOPE, RADIUS, GROWTH, REACH, FLAT = (
    FIELDS.index(name)
    for name in ("x", "y", "z", "turn", "heading", "cos", "sin", "extent", "slope", "radius", "growth", "reach", "flat")
)
inline = numba.njit(forceinline=True, error_model="numpy")


def loop(function):
    """Compile, and keep the result on disk; where no folder can be written, compile in every process anew."""
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # "no locator available"
        return numba.njit(nogil=True, error_model="numpy")(function)


@inline
def down_slope(slope, beside, reach, flat):
    corner = reach - flat
    room = max(reach * reach - beside * beside, 0.0)
    if corner == 0.0:
        return math.sqrt(room)
    if flat == 0.0:
        return math.sqrt(room / (1.0 + 1.0 / (slope * slope)))
    low, high = math.asin(min(max((beside - flat) / corner, 0.0), 1.0)), 0.5 * math.pi
    for _ in range(24):
        angle = 0.5 * (low + high)
        radius = flat + corner * math.sin(angle)
        if math.tan(angle) * math.sqrt(max(radius * radius - beside * beside, 0.0)) > slope * radius:
            high = angle
        else:
            low = angle
    return math.sqrt(max((flat + corner * math.sin(low)) ** 2 - beside * beside, 0.0))


@inline
def foot(piece, x, y):
    """Place along the whole line or circle, place on the piece, distance beside, squared along, square of the unit."""
    dx, dy, extent = x - piece[X], y - piece[Y], piece[EXTENT]
    if piece[TURN] == 0.0:
        along, beside = dx * piece[COS] + dy * piece[SIN], abs(dx * piece[SIN] - dy * piece[COS])
        place = min(max(along, 0.0), extent)
        return along, place, beside, (place - along) ** 2, 0.0
    angle = piece[TURN] * (math.atan2(dy, dx) - piece[HEADING])
    along = (angle - 0.5 * extent + math.pi) % (2.0 * math.pi) - math.pi + 0.5 * extent
    place = min(max(along, 0.0), extent)
    radius, distance = piece[RADIUS] + piece[GROWTH] * place, math.sqrt(dx * dx + dy * dy)
    spoke = distance * radius
    return along, place, abs(distance - radius), 4.0 * spoke * math.sin(0.5 * (place - along)) ** 2, spoke


@inline
def rise(piece, distance):
    corner, inset = piece[REACH] - piece[FLAT], max(distance - piece[FLAT], 0.0)
    return corner - math.sqrt(max(corner * corner - inset * inset, 0.0))


@inline
def height_above(piece, x, y, slack):
    along, place, beside, across, spoke = foot(piece, x, y)
    reach, extent = piece[REACH], piece[EXTENT]
    if beside * beside + across > (reach - slack) ** 2:
        return math.inf
    if piece[SLOPE] != 0.0:
        unit = math.sqrt(max(spoke, 1e-18)) if piece[TURN] != 0.0 else 1.0
        down = down_slope(abs(piece[SLOPE]) / unit, beside, reach, piece[FLAT])
        if piece[TURN] != 0.0:
            down = 2.0 * unit * math.asin(min(down / (2.0 * unit), 1.0))
        place = min(max(along - math.copysign(down / unit, piece[SLOPE]), 0.0), extent)
        across = (place - along) ** 2 if piece[TURN] == 0.0 else 4.0 * spoke * math.sin(0.5 * (place - along)) ** 2
    distance = min(math.sqrt(beside * beside + across), reach)
    return piece[Z] + piece[SLOPE] * place + rise(piece, distance) + slack


@loop
def index_of(pieces, low, high, half, cells):
    """Starts, piece, the first entry that counts after each, and lower bound, as `Workpiece` has them."""
    corner, size, columns, clear = cells
    count = (high[:, 0].max() + 1) * columns
    starts, filled = np.zeros(count + 1, np.int64), np.zeros(count, np.int64)
    piece, counts_from, oldest, below = starts, starts, starts, np.zeros(0)
    for fill in (False, True):
        bound = np.full(count, np.inf)
        for p in range(len(pieces)):
            part = pieces[p]
            bottom = part[Z] + min(part[SLOPE] * part[EXTENT], 0.0)
            for i in range(low[p, 0], high[p, 0] + 1):
                for j in range(low[p, 1], high[p, 1] + 1):
                    x, y = corner[0] + (i + 0.5) * size, corner[1] + (j + 0.5) * size
                    _, place, beside, across, _ = foot(part, x, y)
                    distance, cell = math.sqrt(beside * beside + across), i * columns + j
                    lowest_there = bottom + rise(part, min(max(distance - half, 0.0), part[REACH]))
                    if distance > part[REACH] + half or bound[cell] < lowest_there - clear:
                        continue
                    if distance + half <= part[REACH]:
                        bound[cell] = min(bound[cell], part[Z] + part[SLOPE] * place + rise(part, distance + half))
                    if fill:
                        entry = starts[cell] + filled[cell]
                        piece[entry], below[entry] = p, lowest_there
                        filled[cell] += 1
                        while bound[cell] < below[oldest[cell]] - clear:
                            oldest[cell] += 1
                        counts_from[entry] = oldest[cell]
                    else:
                        starts[cell + 1] += 1
        if not fill:
            starts = np.cumsum(starts)
            piece, counts_from = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.int64)
            below, oldest = np.empty(starts[-1]), starts.copy()
    return starts, piece, counts_from, below


@inline
def first_from(piece, low, high, value):
    """First of the entries low to high whose piece is no less than the value."""
    while low < high:
        middle = (low + high) // 2
        if piece[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@loop
def lowest(pieces, cells, index, points, window, late, result):
    """Lower the tops and set the owners of points in `result`, as `Workpiece.tops` has them."""
    corner, size, columns, clear = cells
    starts, piece, counts_from, below = index
    (x, y), (slack_from, slack), (top, owner) = points, late, result
    for i in range(len(x)):
        column, row = math.floor((y[i] - corner[1]) / size), math.floor((x[i] - corner[0]) / size)
        cell = row * columns + column
        if row < 0 or column < 0 or column >= columns or cell + 1 >= len(starts):
            continue
        low, high = starts[cell], first_from(piece, starts[cell], starts[cell + 1], window[1][i])
        if window[0][i] > 0:
            low = first_from(piece, low, high, window[0][i])
        elif high > low:
            low = max(low, counts_from[high - 1])
        best, last = math.inf, -1
        for entry in range(high - 1, low - 1, -1):
            if below[entry] >= best:
                continue
            smaller = slack if piece[entry] >= slack_from[i] else 0.0
            height = height_above(pieces[piece[entry]], x[i], y[i], smaller)
            if height < best:
                last = piece[entry] if height < best - clear else last
                best = height
        if best <= top[i] + clear:
            owner[i] = last
        top[i] = min(top[i], best)
