"""Forces on a cutter from where it touches the stock: at an angle of the spindle, their mean and peak over a turn.

All is linear in the six coefficients (tangential, radial, axial; of the chip and of the edge): with `EACH` as sets of
values forces come per coefficient. Along the cylinder of a cutter the integral over the height is one over the angle,
as a flute lags by tan(helix) / R, and has a closed antiderivative (`chips`); round a corner radius or a ball it is
taken by Gauss's rule (`torus`). Altintas, Manufacturing Automation, 2nd ed., chapter 2; Budak, Altintas, Armarego,
Journal of Manufacturing Science and Engineering 118 (1996) 216; Engin, Altintas, International Journal of Machine
Tools and Manufacture 41 (2001) 2195.

Frame: x along the horizontal feed, y to its left, z along the tool, up. Angles count clockwise seen from above from the
left of the feed. Forces act on the tool. A spindle that turns the other way (M4) is the mirror image across the feed;
inside this room such stations are computed mirrored.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.cutting.chips import chip_integrals, chip_pieces, flute_laws
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.torus import torus_around, torus_forces, torus_mean

BLOCK, ROUND_BLOCK = 2048, 128  # stations computed at once: their arrays stay in the processor's cache
PEAK_STEPS = 24  # angles of a tooth's pitch among which the peak is looked for: within 1 % of it
LEAST_LAG = 1e-3  # rad/m: straight flutes lag by this, some microradians over a cut, which spares the limit
TURN = 2.0 * np.pi
EACH = np.eye(6)  # sets of coefficients of which one is 1


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
    force, values = np.zeros((len(feed), 3)), coefficients.values[:, None]
    for block, part in blocks(patches, cutter, len(feed)):
        mean = mean_forces_of_sets(part, cutter, feed[block], turning[block], coefficients.taper, values)
        force[block] = _sideways(mean, turning[block])
    return force


def peak_force(
    patches: Patches, cutter: Cutter, coefficients: Coefficients, feed: FloatArray, turning: FloatArray
) -> FloatArray:
    """(n, 3) N on the tool: of each component the value of largest size in a turn. Arguments as `mean_force`."""
    peaks, values = np.zeros((len(feed), 3)), coefficients.values[:, None]
    pitches = cutter.flutes if cutter.run_out else 1
    steps = PEAK_STEPS * pitches
    angle = TURN * pitches / cutter.flutes * np.arange(steps) / steps
    for block, part in blocks(patches, cutter, len(feed)):
        seen, lag = _seen_clockwise(part, cutter, feed[block], turning[block])
        angles = np.broadcast_to(angle, (len(lag), steps))
        force = _cylinder_forces(seen, cutter, feed[block], lag, angles, coefficients.taper, values)
        if cutter.corner_radius:
            corner = _below(seen, cutter.corner_radius)
            force += torus_around(corner, cutter, feed[block], lag, coefficients.taper, values, steps)
        force = _sideways(force, turning[block, None])
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
    values = coefficients.values[:, None]
    return _sideways(
        forces_of_sets(patches, cutter, feed, turning, angle, coefficients.taper, values), turning[:, None]
    )


def _sideways(force: FloatArray, turning: FloatArray) -> FloatArray:
    """(..., 3) of forces (..., 3, 1) computed mirrored, in the stations' frame."""
    force[..., 1, 0] *= turning
    return force[..., 0]


def forces_of_sets(
    patches: Patches,
    cutter: Cutter,
    feed: FloatArray,
    turning: FloatArray,
    angle: FloatArray,
    taper: float,
    values: FloatArray,
) -> FloatArray:
    """(n, a, 3, k) forces at angles (n, a) of k sets of coefficients, values (6, k).

    Mirrored across the feed where the spindle turns counter-clockwise.
    """
    patches, lag = _seen_clockwise(patches, cutter, feed, turning)
    force = _cylinder_forces(patches, cutter, feed, lag, angle, taper, values)
    if cutter.corner_radius:
        force += torus_forces(_below(patches, cutter.corner_radius), cutter, feed, lag, angle, taper, values)
    return force


def mean_forces_of_sets(
    patches: Patches, cutter: Cutter, feed: FloatArray, turning: FloatArray, taper: float, values: FloatArray
) -> FloatArray:
    """(n, 3, k) mean forces over a turn of k sets of coefficients, values (6, k); mirrored as `forces_of_sets`."""
    patches, lag = _seen_clockwise(patches, cutter, feed, turning)
    straight = _above(patches, cutter.corner_radius)
    rows, arcs = straight.station, np.stack([straight.entry, straight.exit], axis=1)
    moments = np.zeros((6, len(rows), 1))
    for gaps, count in flute_laws(cutter):
        integrals = chip_integrals(arcs, feed[rows, 0], chip_pieces(gaps, taper))
        moments += count * (integrals[..., 1:] - integrals[..., :1])
    moments *= ((straight.high - straight.low) / TURN)[:, None]
    force = _of_moments(_per_station(moments, rows, len(feed)), lag, values)[:, 0]
    if cutter.corner_radius:
        force += torus_mean(_below(patches, cutter.corner_radius), cutter, feed, lag, taper, values)
    return force


def blocks(patches: Patches, cutter: Cutter, count: int) -> Iterator[tuple[slice, Patches]]:
    """Slices of `count` stations with their patches, whose stations count from 0."""
    size = ROUND_BLOCK if cutter.corner_radius else BLOCK
    for start in range(0, count, size):
        first, last = np.searchsorted(patches.station, [start, start + size])
        part = patches.take(slice(first, last))
        yield slice(start, min(start + size, count)), replace(part, station=part.station - start)


def lag_per_height(cutter: Cutter) -> float:
    """Angle by which a flute lags per height above the tip, rad/m; less than 0 of a left-hand helix."""
    return cutter.hand * max(float(np.tan(cutter.helix)) / cutter.radius, LEAST_LAG)


def _seen_clockwise(
    patches: Patches, cutter: Cutter, feed: FloatArray, turning: FloatArray
) -> tuple[Patches, FloatArray]:
    """Patches of stations that move, mirrored where the spindle turns the other way; lag (n,) rad/m as seen so."""
    moving = feed[patches.station, 0] > 0.0
    if not moving.all():
        patches = patches.take(moving)
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
    return patches, lag_per_height(cutter) * turning


def _above(patches: Patches, height: float) -> Patches:
    """What is above a height, along the cylinder."""
    if not height:
        return patches
    return replace(patches, low=np.maximum(patches.low, height)).take(patches.high > height)


def _below(patches: Patches, height: float) -> Patches:
    """What is below a height, round the corner."""
    return replace(patches, high=np.minimum(patches.high, height)).take(patches.low < height)


def _cylinder_forces(
    patches: Patches,
    cutter: Cutter,
    feed: FloatArray,
    lag: FloatArray,
    angle: FloatArray,
    taper: float,
    values: FloatArray,
) -> FloatArray:
    """(n, a, 3, k) forces along the cylinder, of all flutes: integrals of the chip over the height of each patch."""
    patches = _above(patches, cutter.corner_radius)
    station = patches.station
    entry, leave = np.minimum(patches.entry, np.pi)[:, None], np.minimum(patches.exit, np.pi)[:, None]
    total = np.zeros((6, len(station), angle.shape[1]))
    flute = 0
    for gaps, count in flute_laws(cutter) if len(station) else ():
        pieces = chip_pieces(gaps, taper)
        arc = chip_integrals(np.concatenate([entry, leave], axis=1), feed[station, 0], pieces)
        arc = arc[..., 1:] - arc[..., :1]
        for _ in range(count):
            for sign, height in ((1.0, patches.low), (-1.0, patches.high)):
                phi = angle[station] - (TURN * flute / cutter.flutes + lag[station] * height)[:, None]
                turns = np.floor(phi / TURN)
                phi -= TURN * turns
                total += sign * (chip_integrals(np.clip(phi, entry, leave), feed[station, 0], pieces) + turns * arc)
            flute += 1
    return _of_moments(_per_station(total / lag[station, None], station, len(feed)), lag, values)


def _per_station(values: FloatArray, station: IntArray, count: int) -> FloatArray:
    """(6, n, a) sums of values (6, p, a) over the rows of each station."""
    total = np.zeros((len(values), count, values.shape[2]))
    rows = np.arange(len(station)) - np.searchsorted(station, station)  # of its station
    for row in range(int(rows.max(initial=-1)) + 1):
        chosen = rows == row
        total[:, station[chosen]] += values[:, chosen]
    return total


def _of_moments(moments: FloatArray, lag: FloatArray, values: FloatArray) -> FloatArray:
    """(n, a, 3, k) forces of k sets of coefficients from integrals (6, n, a) of the chip along the cylinder.

    A left-hand helix pushes where a right-hand one draws.
    """
    force = np.zeros((*moments.shape[1:], 3, values.shape[1]))
    for part in (slice(0, 3), slice(3, 6)):  # of the chip and of the edge
        (t, r, a), (cosine, sine, plain) = values[part], moments[part]
        force[..., 0, :] -= cosine[..., None] * t + sine[..., None] * r
        force[..., 1, :] += sine[..., None] * t - cosine[..., None] * r
        force[..., 2, :] -= (plain * np.sign(lag)[:, None])[..., None] * a
    return force
