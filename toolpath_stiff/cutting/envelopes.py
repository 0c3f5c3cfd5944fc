r"""Height that a piece of the path leaves above a point, and the least over many pieces, on arrays or compiled.

The surface that a piece leaves above a point is the lowest height of the cutter's envelope while its axis passes:
z0 + m s + p(d(s)) least over s, where p is the profile of the cutter's end, d(s) the distance of the point from the
axis. Level pieces have it at the nearest point of the path, others down the slope from there, where the normal of the
envelope is square to the motion. On an arc these lengths are taken along the circle through the point.

The formulas take arrays or numbers, and so the loops over them run where numba compiles them (`compiled`).
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray

CLEAR = 1e-9  # m, height by which a piece must lie below another to outdo it
ROUNDED = 1e-12  # m: a contact shallower than this removes nothing, in any frame
NEWTON, SETTLED = 12, 1e-9  # steps at most, the last as a share of sin^2 kappa: heights to 1e-9 m
FLATTEST = 1e-6  # slope; smaller ones change heights by less than a nanometre
Index = tuple[IntArray, IntArray, IntArray, FloatArray]
Grid = tuple[FloatArray, float, tuple[int, int]]  # corner (3,) and size of cells, m; cells along y and z


def foot(part: AnyArray, x: FloatArray, y: FloatArray, arc: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Place on the whole line or circle of a piece nearest to a point, the distance to it, and a third value.

    This is the square of the unit of the place, m2, at the point; of lines 0.
    """
    dx, dy, extent = x - part["x"], y - part["y"], part["extent"]
    if not arc:
        return dx * part["cos"] + dy * part["sin"], np.abs(dx * part["sin"] - dy * part["cos"]), 0.0 * dx
    angle = part["turn"] * (np.arctan2(dy, dx) - part["heading"])
    along = (angle - 0.5 * extent + np.pi) % (2.0 * np.pi) - np.pi + 0.5 * extent
    radius, spoke = part["radius"] + part["growth"] * within(along, extent), np.sqrt(dx * dx + dy * dy)
    return along, np.abs(spoke - radius), np.maximum(spoke * radius, 1e-18)


def within(along: FloatArray, extent: FloatArray) -> FloatArray:
    """The place on a piece nearest to a place on its whole line or circle."""
    return np.minimum(np.maximum(along, 0.0), extent)


def distance(beside: FloatArray, away: FloatArray, spoke: FloatArray, arc: bool) -> FloatArray:
    """Distance (m) from a point to the tool axis at a place that is `away` from the point's foot."""
    across = 4.0 * spoke * np.sin(0.5 * away) ** 2 if arc else away**2
    whole: FloatArray = np.sqrt(beside**2 + across)
    return whole


def rise(reach: FloatArray, flat: FloatArray, beside: FloatArray) -> FloatArray:
    """Height (m) of the cutter's end above its tip at a distance from the axis of up to its radius."""
    corner, inset = reach - flat, np.maximum(beside - flat, 0.0)
    height: FloatArray = corner - np.sqrt(np.maximum(corner * corner - inset * inset, 0.0))
    return height


def down_slope(
    slope: FloatArray, beside: FloatArray, reach: FloatArray, flat: FloatArray, bull: bool = True
) -> FloatArray:
    """Distance (m) down a slope (> 0) from the nearest point to the envelope's lowest; `beside` at most the radius.

    kappa, between axis and normal, solves (a + r sin kappa)^2 (1 - m^2 cot^2 kappa) = d^2: cos^2 of it by Newton's
    rule, from a start that is right for a flat end and for a ball.
    """
    slope = np.maximum(slope, FLATTEST)
    corner, room = reach - flat, np.maximum(1.0 - (beside / reach) ** 2, 0.0)
    square = room / (room + slope * slope + (1.0 - room) * corner / reach)
    for _ in range(NEWTON if bull else 0):
        sine = np.sqrt(1.0 - square)
        out, rest = flat + corner * sine, 1.0 - slope * slope * square / (1.0 - square)
        change = out * corner / sine * rest + (out * slope / (1.0 - square)) ** 2
        step = square + (out * out * rest - beside * beside) / change
        step = np.minimum(np.maximum(step, 0.0), room / (room + slope * slope)) - square
        square = square + step
        if np.all(np.abs(step) < SETTLED * (1.0 - square)):  # one after the other, where it is compiled
            break
    return slope * (flat + corner * np.sqrt(1.0 - square)) * np.sqrt(square / (1.0 - square))


def height_above(
    part: AnyArray, along: FloatArray, beside: FloatArray, spoke: FloatArray, arc: bool, sloped: bool, bull: bool = True
) -> FloatArray:
    """Lowest height (m) of the cutter's envelope above a point within its reach, given the point's foot."""
    place = along
    if sloped:
        unit = np.sqrt(spoke) if arc else 1.0 + 0.0 * along
        down = down_slope(np.abs(part["slope"]) / unit, beside, part["reach"], part["flat"], bull) / unit
        if arc:
            down = 2.0 * np.arcsin(np.minimum(0.5 * down, 1.0))  # from chord to arc length
        place = along - np.sign(part["slope"]) * down
    place = within(place, part["extent"])
    from_axis = np.minimum(distance(beside, place - along, spoke, arc), part["reach"])
    return part["z"] + part["slope"] * place + rise(part["reach"], part["flat"], from_axis)


def bounds(
    part: AnyArray, x: FloatArray, y: FloatArray, half: float, arc: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Distance (m) of a piece from a cell's middle (diagonal 2 `half`), lower and upper bound of height left there."""
    along, beside, spoke = foot(part, x, y, arc)
    place, reach, flat = within(along, part["extent"]), part["reach"], part["flat"]
    far = distance(beside, place - along, spoke, arc)
    below = part["z"] + np.minimum(part["slope"] * part["extent"], 0.0)
    below += rise(reach, flat, np.minimum(np.maximum(far - half, 0.0), reach))
    return far, below, part["z"] + part["slope"] * place + rise(reach, flat, np.minimum(far + half, reach))


def bound_pairs(pieces: AnyArray, piece: IntArray, x: FloatArray, y: FloatArray, half: float, rows: FloatArray) -> None:
    """Enter `bounds` of pairs of a piece and a cell as rows (3, k)."""
    for e in range(len(piece)):
        part = pieces[piece[e]]
        rows[0, e], rows[1, e], rows[2, e] = bounds(part, x[e], y[e], half, part["turn"] != 0.0)


def first_from(piece: IntArray, low: int, high: int, value: int) -> int:
    """First of the entries from low to high whose piece is not below the value."""
    while low < high:
        middle = (low + high) // 2
        if piece[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


def lower(
    sweeps: tuple[AnyArray, FloatArray],
    grid: tuple[FloatArray, float, int, int],
    index: Index,
    points: tuple[FloatArray, FloatArray, FloatArray, IntArray],
    window: tuple[IntArray, IntArray],
    late: tuple[IntArray, float],
    result: tuple[FloatArray, IntArray],
    enough: FloatArray,
) -> None:
    """Lower the tops and set the owners of points in `result`, as defined by `Workpiece.lowest`.

    The tops come as those of the stock, or lower: what is above them is not looked at. A height below `enough` ends
    the search.
    """
    (corner, size, wide, deep), (starts, piece, counts_from, below) = grid, index
    (pieces, turns), (px, py, pz, tilt), (slack_from, slack), (top, owner) = sweeps, points, late, result
    tilted = len(turns) > 1
    for i in range(len(px)):
        row, column = math.floor((px[i] - corner[0]) / size), math.floor((py[i] - corner[1]) / size)
        layer = math.floor((pz[i] - corner[2]) / size)
        cell = (row * wide + column) * deep + layer
        if row < 0 or not 0 <= column < wide or not 0 <= layer < deep or cell + 1 >= len(starts):
            continue
        low, high = starts[cell], first_from(piece, starts[cell], starts[cell + 1], window[1][i])
        if window[0][i] > 0:
            low = first_from(piece, low, high, window[0][i])
        elif high > low:
            low = max(low, counts_from[high - 1])
        best, last = top[i] + 2.0 * CLEAR, -1
        for entry in range(high - 1, low - 1, -1):
            if below[entry] >= best:
                continue
            part = pieces[piece[entry]]
            arc, smaller = part["turn"] != 0.0, slack if piece[entry] >= slack_from[i] else 0.0
            x, y, z = px[i], py[i], pz[i]
            least: float = part["z"] + min(part["slope"] * part["extent"], 0.0)
            if tilted:
                turn = turns[part["tilt"]]
                if smaller == 0.0 and part["tilt"] != tilt[i]:
                    smaller = -slack
                z = px[i] * turn[0, 2] + py[i] * turn[1, 2] + pz[i] * turn[2, 2]
                if least + smaller - z >= best:
                    continue
                x = px[i] * turn[0, 0] + py[i] * turn[1, 0] + pz[i] * turn[2, 0]
                y = px[i] * turn[0, 1] + py[i] * turn[1, 1] + pz[i] * turn[2, 1]
            least += smaller - z
            along, beside, spoke = foot(part, x, y, arc)
            near = distance(beside, within(along, part["extent"]) - along, spoke, arc)
            if near > part["reach"] - smaller - ROUNDED or least + rise(part["reach"], part["flat"], near) >= best:
                continue
            sloped, bull = part["slope"] != 0.0, 0.0 < part["flat"] < part["reach"]
            height = float(height_above(part, along, beside, spoke, arc, sloped, bull)) + smaller - z
            if height < best:
                last = piece[entry] if height < best - CLEAR else last
                best = height
                if best < enough[i]:
                    break
        if best <= top[i] + CLEAR:
            owner[i] = last
        top[i] = min(top[i], best)


@cache
def compiled() -> tuple[Callable[..., None], Callable[..., None]]:
    """`bound_pairs` and `lower`, compiled; cached on disk if possible. Importing numba takes half a second."""
    import numba

    for formula in (within, foot, distance, rise, down_slope, height_above, bounds, first_from):
        numba.extending.register_jitable(formula)

    def loop(function: Callable[..., None]) -> Callable[..., None]:
        try:
            quick: Callable[..., None] = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
        except RuntimeError:  # "no locator available"
            quick = numba.njit(nogil=True, error_model="numpy")(function)
        return quick

    return loop(bound_pairs), loop(lower)
