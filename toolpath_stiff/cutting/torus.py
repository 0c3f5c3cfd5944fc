"""Forces round a corner radius or a ball: slices of the edge, summed by Gauss's rule over kappa.

kappa is the angle between the tool's axis and the normal of its envelope: 0 at the tip, 90 degrees where the cylinder
begins. The length of an edge is counted along the envelope, as along the cylinder by its height, where coefficients are
identified. Engin, Altintas, International Journal of Machine Tools and Manufacture 41 (2001) 2195.

Contacts of n stations are as `seen_clockwise` gives them; forces those of k sets of coefficients, `values` (6, k).
"""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, numbered
from toolpath_stiff.cutting.chips import flute_gaps, flute_laws
from toolpath_stiff.cutting.patches import TURN, Contact, Patches

WIDEST = 0.4  # rad of kappa in a layer: three nodes give the sines in it to eight digits
# Gauss and Legendre's nodes and weights, shares of a layer (Abramowitz and Stegun 1964, 25.4.30).
NODES = [(0.5 - 0.15**0.5, 5 / 18), (0.5, 4 / 9), (0.5 + 0.15**0.5, 5 / 18)]
ANGLES = 8  # nodes of an arc: up to a half turn to nine digits


def torus_mean(contact: Contact, values: FloatArray) -> FloatArray:
    """(n, 3, k) forces, mean over a revolution."""
    layers, radius, taper = _layers(contact), contact.cutter.corner_radius, contact.coefficients.taper
    nodes, weights = np.polynomial.legendre.leggauss(ANGLES)
    layer, arc = np.repeat(np.arange(len(layers.low)), ANGLES), layers.exit - layers.entry
    across = _direction((layers.entry[:, None] + arc[:, None] * (0.5 + 0.5 * nodes)).ravel())
    share = ((layers.high - layers.low)[:, None] * 0.5 * arc[:, None] * weights / TURN).ravel()
    station = layers.station[layer]
    motion = np.take(_motion(contact), station, axis=1)
    total = np.zeros((len(contact.feed), 3, values.shape[1]))
    for node, weight in NODES:
        kappa = layers.low + node * (layers.high - layers.low)
        normal = np.take(_direction(kappa), layer, axis=1)
        for gaps, flutes in flute_laws(contact.cutter):
            length = flutes * weight * radius * share
            force = _edge_forces(across, normal, length, motion, np.append(taper, gaps), values)
            total += _summed(force, station, len(total))
    return total


def torus_forces(contact: Contact, angle: FloatArray, values: FloatArray) -> FloatArray:
    """(n, a, 3, k) forces of all flutes, with flute 0 at angles (n, a)."""
    layers, motion, cutter = _layers(contact), _motion(contact), contact.cutter
    slope, radius, count = contact.lag[layers.station][:, None], cutter.corner_radius, angle.shape[1]
    low, high = (radius * (1.0 - np.cos(kappa))[:, None] for kappa in (layers.low, layers.high))
    entry, leave = layers.entry[:, None], layers.exit[:, None]
    largest = np.where(slope > 0.0, low, high)  # the height where the angle of the edge is largest
    total = np.zeros((angle.size, 3, values.shape[1]))
    for flute, gaps in enumerate(flute_gaps(cutter)):
        tip = angle[layers.station] - TURN * flute / cutter.flutes
        tip -= TURN * np.floor((tip - slope * largest) / TURN)
        for turn in (0.0, TURN):
            first, last = (tip + turn - leave) / slope, (tip + turn - entry) / slope
            first, last = np.maximum(np.minimum(first, last), low), np.minimum(np.maximum(first, last), high)
            layer, column = np.nonzero(last > first)
            ends = np.arccos(np.clip(1.0 - np.stack([first, last])[:, layer, column] / radius, -1.0, 1.0))
            station = layers.station[layer]
            for node, weight in NODES:
                kappa = ends[0] + node * (ends[1] - ends[0])
                normal, length = _direction(kappa), weight * radius * (ends[1] - ends[0])
                phi = tip[layer, column] - slope[layer, 0] * radius * (1.0 - normal[1])
                law = np.append(contact.coefficients.taper, gaps)
                force = _edge_forces(_direction(phi), normal, length, np.take(motion, station, axis=1), law, values)
                total += _summed(force, station * count + column, len(total))
    return total.reshape(*angle.shape, *total.shape[1:])


def _layers(contact: Contact) -> Patches:
    """Patches on the corner in layers of kappa, from `low` to `high`; in level motion an edge cuts only ahead."""
    radius = contact.cutter.corner_radius
    patches = contact.below(radius)
    first, last = (np.arccos(1.0 - height / radius) for height in (patches.low, patches.high))
    count = np.ceil((last - first) / WIDEST).astype(np.int64)
    row, place = numbered(count)
    width = (last - first)[row] / count[row]
    end = np.where(contact.feed[patches.station, 1] == 0.0, np.pi, TURN)
    ahead = replace(patches, entry=np.minimum(patches.entry, end), exit=np.minimum(patches.exit, end)).take(row)
    return replace(ahead, low=first[row] + place * width, high=first[row] + (place + 1) * width)


def _edge_forces(
    across: FloatArray, normal: FloatArray, length: FloatArray, motion: FloatArray, law: FloatArray, values: FloatArray
) -> FloatArray:
    """(3, k, q) forces on slices of an edge with the given lengths.

    Parameters
    ----------
    across, normal
        (2, q) sine and cosine of the angle of the edge, and of kappa.
    motion
        (3, q) m per tooth along x and z, hand.
    law
        (1 + flutes,) m of taper, then how far the flute stands out beyond those before it.
    """
    (sine, cosine), (out, up) = across, normal
    # Perpendicular to the envelope; a ramp's feed along z cuts at the lower end, ahead and behind.
    chip = motion[0] * sine * out - motion[1] * up
    if law[1:].any():
        chip = np.minimum.reduce([m * chip + gap * out for m, gap in enumerate(law[1:], 1)])
    chip = np.maximum(chip, 0.0)
    edge = length * (np.minimum(chip / law[0], 1.0) if law[0] else chip > 0.0)
    chip *= length
    tangential, radial, axial = (values[i, :, None] * chip + values[i + 3, :, None] * edge for i in range(3))
    axial *= motion[2]
    outward = radial * out + axial * up
    force = np.empty((3, *outward.shape))
    force[0] = -tangential * cosine - outward * sine
    force[1] = tangential * sine - outward * cosine
    force[2] = radial * up - axial * out
    return force


def _direction(angle: FloatArray) -> FloatArray:
    """(2, q) sine and cosine of angles."""
    return np.stack([np.sin(angle), np.cos(angle)])


def _motion(contact: Contact) -> FloatArray:
    """(3, n) the `motion` of `_edge_forces`."""
    return np.stack([*contact.feed.T, np.sign(contact.lag)])


def _summed(forces: FloatArray, place: IntArray, count: int) -> FloatArray:
    """(count, 3, k) sums of forces (3, k, q) by their `place` (q,)."""
    sums = np.zeros((count, *forces.shape[:2]))
    for row, column in np.ndindex(*forces.shape[:2]):
        sums[:, row, column] = np.bincount(place, forces[row, column], minlength=count)
    return sums
