"""Forces on a cutter from where it touches the stock: at an angle of the spindle, their mean and peak over a turn.

All is linear in the six coefficients (tangential, radial, axial; of the chip and of the edge): `responses` are forces
per coefficient. Along the cylinder of a cutter the integral over the height is one over the angle, as a flute lags by
tan(helix) / R, and has a closed antiderivative (`chips`); round a corner radius or a ball it is taken by Gauss's rule
(`torus`). Altintas, Manufacturing Automation, 2nd ed., chapter 2; Budak, Altintas, Armarego, Journal of Manufacturing
Science and Engineering 118 (1996) 216; Engin, Altintas, International Journal of Machine Tools and Manufacture 41
(2001) 2195.

Frame: x along the horizontal feed, y to its left, z along the tool, up. Angles count clockwise seen from above from the
left of the feed. Forces act on the tool. A spindle that turns the other way (M4) is the mirror image across the feed;
inside this room such stations are computed mirrored.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.cutting.chips import chip_integrals, chip_pieces, flute_laws
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.torus import mean_torus_responses, torus_responses

BLOCK = 2048  # stations computed at once: their arrays stay in the processor's cache
PEAK_STEPS = 24  # angles of a tooth's pitch among which the peak is looked for: within 1 % of it
LEAST_LAG = 1e-3  # rad/m: straight flutes lag by this, some microradians over a cut, which spares the limit
TURN = 2.0 * np.pi


def mean_force(
    patches: Patches, cutter: Cutter, coefficients: Coefficients, feed: FloatArray, turning: FloatArray
) -> FloatArray:
    """(n, 3) N on the tool, mean over a turn of the spindle.

    Parameters
    ----------
    patches
        Where the cutter touches the stock at n stations.
    cutter, coefficients
        Of all of them.
    feed
        (n, 2) m per tooth: along x and along z, up positive.
    turning
        (n,) 1 where the spindle turns clockwise (M3), -1 (M4).
    """
    return _force(mean_responses(patches, cutter, feed, turning, coefficients.taper), coefficients, turning)


def peak_force(
    patches: Patches, cutter: Cutter, coefficients: Coefficients, feed: FloatArray, turning: FloatArray
) -> FloatArray:
    """(n, 3) N on the tool: of each component the value of largest size in a turn. Arguments as `mean_force`."""
    peaks = np.zeros((len(feed), 3))
    periods, span = (cutter.flutes, TURN) if cutter.run_out else (1, TURN / cutter.flutes)
    angle = span * np.arange(periods * PEAK_STEPS)[None] / (periods * PEAK_STEPS)
    for block, part in blocks(patches, len(feed)):
        angles = np.repeat(angle, len(feed[block]), axis=0)
        force = force_at(part, cutter, coefficients, feed[block], turning[block], angles)
        largest = np.abs(force).argmax(axis=1)
        peaks[block] = np.take_along_axis(force, largest[:, None], axis=1)[:, 0]
    return peaks


def force_at(
    patches: Patches,
    cutter: Cutter,
    coefficients: Coefficients,
    feed: FloatArray,
    turning: FloatArray,
    angle: FloatArray,
) -> FloatArray:
    """(n, a, 3) N on the tool when flute 0 stands, at the tip, at angles (n, a) rad. Others as `mean_force`.

    With a spindle that turns counter-clockwise the angles count counter-clockwise from the right of the feed.
    """
    response = responses(patches, cutter, feed, turning, angle, coefficients.taper)
    return _force(response, coefficients, turning[:, None])


def _force(response: FloatArray, coefficients: Coefficients, turning: FloatArray) -> FloatArray:
    """Forces (..., 3) from those per coefficient (..., 3, 6); stations that were computed mirrored in their frame."""
    force = product(response, coefficients.values[:, None])[..., 0]
    force[..., 1] *= turning
    return force


def responses(
    patches: Patches, cutter: Cutter, feed: FloatArray, turning: FloatArray, angle: FloatArray, taper: float
) -> FloatArray:
    """(n, a, 3, 6) forces per coefficient at angles (n, a) of flute 0; mirrored where the spindle turns so."""
    patches, lag, hand = _seen_clockwise(patches, cutter, feed, turning)
    total = np.zeros((*angle.shape, 3, 6))
    straight = _above(patches, cutter.corner_radius)
    if len(straight.station):
        rows = straight.station
        moments = _cylinder(straight, cutter, feed[rows, 0], lag[rows], angle[rows], taper)
        _add_moments(total, _per_station(moments, rows, len(feed)))
    if cutter.corner_radius:
        round_part = _below(patches, cutter.corner_radius)
        rows = round_part.station
        parts = torus_responses(round_part, cutter, feed[rows], lag[rows], angle[rows], taper)
        total += _per_station(parts, rows, len(feed), axis=0)
    total[..., (2, 5)] *= hand[:, None, None, None]  # a left-hand helix pushes where a right-hand one draws
    return total


def mean_responses(patches: Patches, cutter: Cutter, feed: FloatArray, turning: FloatArray, taper: float) -> FloatArray:
    """(n, 3, 6) mean forces over a turn per coefficient; mirrored as `responses`."""
    patches, _, hand = _seen_clockwise(patches, cutter, feed, turning)
    total = np.zeros((len(feed), 1, 3, 6))
    straight = _above(patches, cutter.corner_radius)
    rows = straight.station
    arcs = np.stack([straight.entry, straight.exit], axis=1)
    moments = np.zeros((6, len(rows), 1))
    for gaps, count in flute_laws(cutter):
        integrals = chip_integrals(arcs, feed[rows, 0], chip_pieces(gaps, taper))
        moments += count * (integrals[..., 1:] - integrals[..., :1])
    moments *= ((straight.high - straight.low) / TURN)[:, None]
    _add_moments(total, _per_station(moments, rows, len(feed)))
    if cutter.corner_radius:
        round_part = _below(patches, cutter.corner_radius)
        rows = round_part.station
        parts = mean_torus_responses(round_part, cutter, feed[rows], taper)
        total += _per_station(parts[:, None], rows, len(feed), axis=0)
    total[..., (2, 5)] *= hand[:, None, None, None]
    return total[:, 0]


def blocks(patches: Patches, count: int, size: int = BLOCK) -> Iterator[tuple[slice, Patches]]:
    """Slices of `count` stations with their patches, whose stations count from 0."""
    for start in range(0, count, size):
        first, last = np.searchsorted(patches.station, [start, start + size])
        part = patches.take(slice(first, last))
        yield slice(start, min(start + size, count)), replace(part, station=part.station - start)


def lag_per_height(cutter: Cutter) -> float:
    """Angle by which a flute lags per height above the tip, rad/m; less than 0 of a left-hand helix."""
    return cutter.hand * max(float(np.tan(cutter.helix)) / cutter.radius, LEAST_LAG)


def _seen_clockwise(
    patches: Patches, cutter: Cutter, feed: FloatArray, turning: FloatArray
) -> tuple[Patches, FloatArray, FloatArray]:
    """Patches of stations that move, mirrored where the spindle turns the other way; lag (n,), hand (n,) as seen so."""
    moving = feed[patches.station, 0] > 0.0
    if not moving.all():
        patches = patches.take(moving)
    hand = cutter.hand * turning
    other = turning[patches.station] < 0.0
    if other.any():
        width = patches.exit - patches.entry
        entry = np.where(other, (np.pi - patches.exit) % TURN, patches.entry)
        leave = entry + width
        across = leave > TURN + 1e-12
        first = replace(patches, entry=entry, exit=np.minimum(leave, TURN))
        rest = replace(patches, entry=np.zeros_like(entry), exit=leave - TURN).take(across)
        patches = Patches.joined([first, rest])
        patches = patches.take(np.argsort(patches.station, kind="stable"))
    return patches, lag_per_height(cutter) * turning, hand


def _above(patches: Patches, height: float) -> Patches:
    """What is above a height, along the cylinder."""
    if not height:
        return patches
    return replace(patches, low=np.maximum(patches.low, height)).take(patches.high > height)


def _below(patches: Patches, height: float) -> Patches:
    """What is below a height, round the corner."""
    return replace(patches, high=np.minimum(patches.high, height)).take(patches.low < height)


def _cylinder(
    patches: Patches, cutter: Cutter, feed: FloatArray, lag: FloatArray, angle: FloatArray, taper: float
) -> FloatArray:
    """(6, p, a) integrals of the chip over the height of each patch, of all flutes."""
    entry, leave = np.minimum(patches.entry, np.pi)[:, None], np.minimum(patches.exit, np.pi)[:, None]
    total = np.zeros((6, *angle.shape))
    flute = 0
    for gaps, count in flute_laws(cutter):
        pieces = chip_pieces(gaps, taper)
        arc = chip_integrals(np.concatenate([entry, leave], axis=1), feed, pieces)
        arc = arc[..., 1:] - arc[..., :1]
        for _ in range(count):
            for sign, height in ((1.0, patches.low), (-1.0, patches.high)):
                phi = angle - (TURN * flute / cutter.flutes + lag * height)[:, None]
                turns = np.floor(phi / TURN)
                phi -= TURN * turns
                total += sign * (chip_integrals(np.clip(phi, entry, leave), feed, pieces) + turns * arc)
            flute += 1
    return total / lag[:, None]


def _per_station(values: FloatArray, station: IntArray, count: int, axis: int = 1) -> FloatArray:
    """Sums over the rows of each station, rows along an axis."""
    values = np.moveaxis(values, axis, 0)
    total = np.zeros((count, *values.shape[1:]))
    rows = np.arange(len(station)) - np.searchsorted(station, station)  # of its station
    for row in range(int(rows.max(initial=-1)) + 1):
        chosen = rows == row
        total[station[chosen]] += values[chosen]
    return np.moveaxis(total, 0, axis)


def _add_moments(total: FloatArray, moments: FloatArray) -> None:
    """Add forces per coefficient from integrals of the chip along the cylinder, in place."""
    for column, (cosine, sine, plain) in ((0, moments[:3]), (3, moments[3:])):
        total[..., 0, column] -= cosine
        total[..., 1, column] += sine
        total[..., 0, column + 1] -= sine
        total[..., 1, column + 1] -= cosine
        total[..., 2, column + 2] -= plain
