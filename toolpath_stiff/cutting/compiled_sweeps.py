"""The heights of `sweeps.heights_above` and their least over the pieces of a cell, point by point, compiled with numba.

Import this module only through `workpiece`: numba comes with it. Why it pays: a piece that cannot lie below what others
have left is passed over without a look at it, which arrays cannot.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, untyped-decorator"
# ruff: noqa: D103 - `sweeps` says what they are

import math

import numba

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
def height_above(piece, x, y, slack):
    dx, dy = x - piece[X], y - piece[Y]
    arc, unit, spoke, reach, extent = piece[TURN] != 0.0, 1.0, 0.0, piece[REACH], piece[EXTENT]
    if arc:
        angle = piece[TURN] * (math.atan2(dy, dx) - piece[HEADING])
        along = (angle - 0.5 * extent + math.pi) % (2.0 * math.pi) - math.pi + 0.5 * extent
        place = min(max(along, 0.0), extent)
        radius, distance = piece[RADIUS] + piece[GROWTH] * place, math.hypot(dx, dy)
        beside, spoke = abs(distance - radius), distance * radius
        unit = math.sqrt(max(spoke, 1e-18))
        across = 4.0 * spoke * math.sin(0.5 * (place - along)) ** 2
    else:
        along, beside = dx * piece[COS] + dy * piece[SIN], abs(dx * piece[SIN] - dy * piece[COS])
        place = min(max(along, 0.0), extent)
        across = (place - along) ** 2
    distance = math.sqrt(beside * beside + across)
    if not distance <= reach - slack:
        return math.inf
    if piece[SLOPE] != 0.0:
        down = down_slope(abs(piece[SLOPE]) / unit, beside, reach, piece[FLAT])
        if arc:
            down = 2.0 * unit * math.asin(min(down / (2.0 * unit), 1.0))
        place = min(max(along - math.copysign(down / unit, piece[SLOPE]), 0.0), extent)
        across = 4.0 * spoke * math.sin(0.5 * (place - along)) ** 2 if arc else (place - along) ** 2
        distance = min(math.sqrt(beside * beside + across), reach)
    corner, inset = reach - piece[FLAT], max(distance - piece[FLAT], 0.0)
    rise = corner - math.sqrt(max(corner * corner - inset * inset, 0.0))
    return piece[Z] + piece[SLOPE] * place + rise + slack


@loop
def lowest(pieces, key, below, x, y, low, high, slack_from, slack, clear, top, owner):
    """Lower `top` and set `owner`, as `Workpiece.tops` has them."""
    for i in range(len(x)):
        best, last = math.inf, -1
        for entry in range(high[i] - 1, low[i] - 1, -1):
            if below[entry] >= best:
                continue
            piece = key[entry] % len(pieces)
            height = height_above(pieces[piece], x[i], y[i], slack if piece >= slack_from[i] else 0.0)
            if height < best:
                last = piece if height < best - clear else last
                best = height
        if best <= top[i] + clear:
            owner[i] = last
        top[i] = min(top[i], best)
