"""Forces round a corner radius or a ball: slices of the edge, summed by Gauss's rule over kappa.

kappa is the angle between the tool's axis and the normal of its envelope: 0 at the tip, 90 degrees where the cylinder
begins. The length of an edge is counted along the envelope, as along the cylinder by its height, where coefficients are
identified. Engin, Altintas, International Journal of Machine Tools and Manufacture 41 (2001) 2195.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.cutting.chips import flute_gaps
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.patches import Patches

SLICES, ANGLES = 6, 12  # nodes: the sines within a patch to nine digits
TURN = 2.0 * np.pi


def torus_responses(
    patches: Patches, cutter: Cutter, feed: FloatArray, lag: FloatArray, angle: FloatArray, taper: float
) -> FloatArray:
    """(p, a, 3, 6) forces per coefficient of each patch at angles (p, a) of flute 0; all flutes.

    `feed` (p, 2) m per tooth along x and z, `lag` (p,) rad/m, `taper` m.
    """
    total = np.zeros((*angle.shape, 3, 6))
    low, high, entry, leave = (
        values[:, None] for values in (patches.low, patches.high, patches.entry, patches.exit)
    )
    slope, radius = lag[:, None], cutter.corner_radius
    largest = np.where(slope > 0.0, low, high)  # the height where the angle of the edge is largest
    nodes, weights = np.polynomial.legendre.leggauss(SLICES)
    for flute, gaps in enumerate(flute_gaps(cutter)):
        tip = angle + TURN * flute / cutter.flutes
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
    """(p, 3, 6) mean forces over a turn per coefficient of each patch."""
    nodes, weights = (values.ravel() for values in np.meshgrid(*[np.polynomial.legendre.leggauss(SLICES)[0]] * 1))
    raise NotImplementedError(nodes, weights)
