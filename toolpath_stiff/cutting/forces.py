"""Forces on a cutter from its contact with the stock: at an angle of the spindle, mean and peak over a revolution.

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

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.cutting.chips import chip_integrals, chip_pieces, flute_laws
from toolpath_stiff.cutting.patches import TURN, Contact
from toolpath_stiff.cutting.torus import torus_forces, torus_mean

PEAK_STEPS = 18  # angles from an edge's first touch to its last among which the peak is looked for, besides bends
EACH = np.eye(6)  # six sets of coefficients, each with a single 1


def mean_force(contact: Contact) -> FloatArray:
    """(n, 3) N on the tool, mean over a revolution of the spindle."""
    force, values = np.zeros((len(contact.feed), 3)), contact.coefficients.values[:, None]
    for block, part in contact.blocks():
        force[block] = mean_forces_of_sets(part, values)[..., 0]
    return force


def peak_force(contact: Contact) -> FloatArray:
    """(n, 3) N on the tool: for each component the value of largest size in a revolution."""
    cutter, values = contact.cutter, contact.coefficients.values[:, None]
    peaks = np.zeros((len(contact.feed), 3))
    flutes = TURN * np.arange(cutter.flutes if cutter.run_out else 1)[:, None] / cutter.flutes
    for block, part in contact.blocks():
        angle = (_peak_angles(part)[:, None] + flutes).reshape(len(part.feed), -1)
        force = forces_of_sets(part, angle, values)[..., 0]
        largest = np.abs(force).argmax(axis=1)
        peaks[block] = np.take_along_axis(force, largest[:, None], axis=1)[:, 0]
    return peaks


def _peak_angles(contact: Contact) -> FloatArray:
    """(n, 6 + PEAK_STEPS) rad of a flute: kinks of the force, and angles from its first contact to its last.

    It bends where an end of an edge, or its corner's, passes entry or exit: the peak of a light cut is there.
    """
    patches = contact.seen_clockwise().patches
    angles = np.zeros((len(contact.feed), 6 + PEAK_STEPS))
    if len(patches.station):
        first = np.flatnonzero(np.diff(patches.station, prepend=-1))
        rows = patches.station[first]
        low, entry = (np.minimum.reduceat(ends, first) for ends in (patches.low, patches.entry))
        high, leave = (np.maximum.reduceat(ends, first) for ends in (patches.high, patches.exit))
        heights = np.stack([low, np.clip(contact.cutter.corner_radius, low, high), high], axis=1)
        ends = np.stack([entry, np.minimum(leave, np.pi)], axis=1)
        bends = (contact.lag[rows, None, None] * heights[:, :, None] + ends[:, None]).reshape(-1, 6)
        begin = bends.min(axis=1)
        span = np.minimum(bends.max(axis=1) - begin, TURN / contact.cutter.flutes)
        angles[rows, :6] = bends
        angles[rows, 6:] = begin[:, None] + span[:, None] * (np.arange(PEAK_STEPS) + 0.5) / PEAK_STEPS
    return angles


def force_at(contact: Contact, angle: FloatArray) -> FloatArray:
    """(n, a, 3) N on the tool when flute 0 stands, at the tip, at angles (n, a) rad.

    With a spindle that turns counter-clockwise the angles count counter-clockwise from the right of the feed.
    """
    return forces_of_sets(contact, angle, contact.coefficients.values[:, None])[..., 0]


def forces_of_sets(contact: Contact, angle: FloatArray, values: FloatArray) -> FloatArray:
    """(n, a, 3, k) forces at angles (n, a), as of `force_at`, of k sets of coefficients, values (6, k)."""
    seen = contact.seen_clockwise()
    force = _cylinder_forces(seen, angle, values)
    if contact.cutter.corner_radius:
        force += torus_forces(seen, angle, values)
    force[..., 1, :] *= contact.turning[:, None, None]
    return force


def mean_forces_of_sets(contact: Contact, values: FloatArray) -> FloatArray:
    """(n, 3, k) mean forces over a revolution of k sets of coefficients, values (6, k)."""
    seen = contact.seen_clockwise()
    straight = seen.above(seen.cutter.corner_radius)
    rows, arcs = straight.station, np.stack([straight.entry, straight.exit], axis=1)
    moments = np.zeros((6, len(rows), 1))
    for gaps, count in flute_laws(seen.cutter):
        integrals = chip_integrals(arcs, seen.feed[rows, 0], chip_pieces(gaps, seen.coefficients.taper))
        moments += count * (integrals[..., 1:] - integrals[..., :1])
    moments *= ((straight.high - straight.low) / TURN)[:, None]
    force = _of_moments(_per_station(moments, rows, len(seen.feed)), seen.lag, values)[:, 0]
    if seen.cutter.corner_radius:
        force += torus_mean(seen, values)
    force[:, 1] *= seen.turning[:, None]
    return force


def _cylinder_forces(contact: Contact, angle: FloatArray, values: FloatArray) -> FloatArray:
    """(n, a, 3, k) forces on the cylinder, all flutes: integrals of the chip over the height of each patch."""
    patches, lag = contact.above(contact.cutter.corner_radius), contact.lag
    station, feed = patches.station, contact.feed[patches.station, 0]
    entry, leave = np.minimum(patches.entry, np.pi)[:, None], np.minimum(patches.exit, np.pi)[:, None]
    total = np.zeros((6, len(station), angle.shape[1]))
    flute = 0
    for gaps, count in flute_laws(contact.cutter) if len(station) else ():
        pieces = chip_pieces(gaps, contact.coefficients.taper)
        arc = chip_integrals(np.concatenate([entry, leave], axis=1), feed, pieces)
        arc = arc[..., 1:] - arc[..., :1]
        for _ in range(count):
            for sign, height in ((1.0, patches.low), (-1.0, patches.high)):
                phi = angle[station] - (TURN * flute / contact.cutter.flutes + lag[station] * height)[:, None]
                turns = np.floor(phi / TURN)
                phi -= TURN * turns
                total += sign * (chip_integrals(np.clip(phi, entry, leave), feed, pieces) + turns * arc)
            flute += 1
    return _of_moments(_per_station(total / lag[station, None], station, len(contact.feed)), lag, values)


def _per_station(values: FloatArray, station: IntArray, count: int) -> FloatArray:
    """(6, n, a) sums of values (6, p, a) over the rows of each station."""
    total = np.zeros((len(values), count, values.shape[2]))
    rows = np.arange(len(station)) - np.searchsorted(station, station)  # of its station
    for row in range(int(rows.max(initial=-1)) + 1):
        chosen = rows == row
        total[:, station[chosen]] += values[:, chosen]
    return total


def _of_moments(moments: FloatArray, lag: FloatArray, values: FloatArray) -> FloatArray:
    """(n, a, 3, k) forces for k sets of coefficients from integrals (6, n, a) of the chip along the cylinder.

    A left-hand helix pushes where a right-hand one draws.
    """
    force = np.zeros((*moments.shape[1:], 3, values.shape[1]))
    for part in (slice(0, 3), slice(3, 6)):  # of the chip and of the edge
        (t, r, a), (cosine, sine, plain) = values[part], moments[part]
        force[..., 0, :] -= cosine[..., None] * t + sine[..., None] * r
        force[..., 1, :] += sine[..., None] * t - cosine[..., None] * r
        force[..., 2, :] -= (plain * np.sign(lag)[:, None])[..., None] * a
    return force
