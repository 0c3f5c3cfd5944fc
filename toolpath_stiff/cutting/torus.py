"""Forces round a corner radius or a ball: slices of the edge, summed by Gauss's rule over kappa.

kappa is the angle between the tool's axis and the normal of its envelope: 0 at the tip, 90 degrees where the cylinder
begins. The length of an edge is counted along the envelope, as along the cylinder by its height, where coefficients are
identified. Engin, Altintas, International Journal of Machine Tools and Manufacture 41 (2001) 2195.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.cutting.chips import flute_gaps, flute_laws
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.patches import Patches

SLICES, ANGLES = 6, 12  # nodes: the sines within a patch to nine digits
FINE = 24  # nodes of height with run-out or on a ramp, where the chip may begin or bend within the patch
TURN = 2.0 * np.pi


def torus_responses(
    patches: Patches, cutter: Cutter, feed: FloatArray, lag: FloatArray, angle: FloatArray, taper: float
) -> FloatArray:
    """(p, a, 3, 6) forces per coefficient of each patch at angles (p, a) of flute 0; all flutes.

    `feed` (p, 2) m per tooth along x and z, `lag` (p,) rad/m, `taper` m.
    """
    total = np.zeros((*angle.shape, 3, 6))
    low, high, (entry, leave) = patches.low[:, None], patches.high[:, None], _arc(patches, feed)
    slope, radius = lag[:, None], cutter.corner_radius
    largest = np.where(slope > 0.0, low, high)  # the height where the angle of the edge is largest
    nodes, weights = np.polynomial.legendre.leggauss(FINE if cutter.run_out or feed[:, 1].any() else SLICES)
    for flute, gaps in enumerate(flute_gaps(cutter)):
        tip = angle - TURN * flute / cutter.flutes
        tip = tip - TURN * np.floor((tip - slope * largest) / TURN)
        for turn in (0.0, TURN):
            ends = np.sort([(tip + turn - leave) / slope, (tip + turn - entry) / slope], axis=0)
            ends = np.clip(ends, low, high)
            if not (ends[1] > ends[0]).any():
                continue
            first, last = np.arccos(np.clip(1.0 - ends / radius, -1.0, 1.0))
            half, middle = 0.5 * (last - first), 0.5 * (last + first)
            for node, weight in zip(nodes, weights, strict=True):
                kappa = middle + half * node
                phi = tip - slope * radius * (1.0 - np.cos(kappa))
                _add_slices(total, phi, kappa, weight * half * radius, _chip(phi, kappa, feed, gaps), taper)
    return total


def mean_torus_responses(patches: Patches, cutter: Cutter, feed: FloatArray, taper: float) -> FloatArray:
    """(p, 3, 6) mean forces over a turn per coefficient of each patch; arguments as `torus_responses`."""
    first, last = (np.arccos(1.0 - height / cutter.corner_radius) for height in (patches.low, patches.high))
    nodes, weights = np.polynomial.legendre.leggauss(ANGLES)
    entry, leave = _arc(patches, feed)
    phi = 0.5 * (entry + leave) + 0.5 * (leave - entry) * nodes
    share = 0.5 * (leave - entry) * weights / TURN
    total = np.zeros((*phi.shape, 3, 6))
    for node, weight in zip(*np.polynomial.legendre.leggauss(SLICES), strict=True):
        kappa = np.broadcast_to((0.5 * (first + last) + 0.5 * (last - first) * node)[:, None], phi.shape)
        length = share * (0.5 * weight * cutter.corner_radius * (last - first))[:, None]
        for gaps, count in flute_laws(cutter):
            _add_slices(total, phi, kappa, count * length, _chip(phi, kappa, feed, gaps), taper)
    return np.asarray(total.sum(axis=1))


def _arc(patches: Patches, feed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(p, 1) rad, where edges may cut from and to: on the level only ahead of the axis."""
    end = np.where(feed[:, 1] == 0.0, np.pi, TURN)
    return np.minimum(patches.entry, end)[:, None], np.minimum(patches.exit, end)[:, None]


def _chip(phi: FloatArray, kappa: FloatArray, feed: FloatArray, gaps: FloatArray) -> FloatArray:
    """(p, a) m, the chip square to the envelope; the feed along z of a ramp cuts at the lower end, ahead and behind."""
    u = feed[:, :1] * np.sin(phi) * np.sin(kappa) - feed[:, 1:] * np.cos(kappa)
    if not gaps.any():
        return np.maximum(u, 0.0)
    chips = [m * u + gap * np.sin(kappa) for m, gap in enumerate(gaps, 1)]
    return np.asarray(np.maximum(np.minimum.reduce(chips), 0.0))


def _add_slices(
    total: FloatArray, phi: FloatArray, kappa: FloatArray, length: FloatArray, chip: FloatArray, taper: float
) -> None:
    """Add forces per coefficient of slices (p, a) of an edge of such lengths, in place."""
    edge = np.minimum(chip / taper, 1.0) if taper else (chip > 0.0).astype(float)
    sine, cosine, out, up = np.sin(phi), np.cos(phi), np.sin(kappa), np.cos(kappa)
    for column, weight in ((0, chip * length), (3, edge * length)):
        along, across = weight * sine, weight * cosine
        total[..., 0, column] -= across
        total[..., 1, column] += along
        total[..., 0, column + 1] -= along * out
        total[..., 1, column + 1] -= across * out
        total[..., 2, column + 1] += weight * up
        total[..., 0, column + 2] -= along * up
        total[..., 1, column + 2] -= across * up
        total[..., 2, column + 2] -= weight * out
