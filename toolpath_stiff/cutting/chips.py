"""Chip thickness at each flute, with run-out, and its integrals over the angle of the edge.

Flutes are numbered in the order in which they pass: flute j stands 2 pi j / N behind flute 0, and, with a run-out rho,
R + rho cos(lambda + 2 pi j / N) from the axis (Kline, DeVor, International Journal of Machine Tool Design and Research
23 (1983) 123). It cuts what the m flutes before it left, so that the chip is

    h_j = max(0, min over m of m u + R_j - R_(j-m)),    u = f sin(phi),

a line of u by pieces. The force at the edge acts wherever there is a chip; it sets in over a first micrometre.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.cutting.cutters import Cutter


def flute_gaps(cutter: Cutter) -> FloatArray:
    """(flutes, flutes) m by which flute j projects beyond the one m = 1 ... flutes before it."""
    flutes = cutter.flutes
    radius = flute_radii(cutter)
    before = (np.arange(flutes)[:, None] - np.arange(1, flutes + 1)) % flutes
    return np.asarray(radius[:, None] - radius[before])


def flute_laws(cutter: Cutter) -> list[tuple[FloatArray, int]]:
    """Gaps of each kind of flute, and the number of flutes with them: all alike without run-out."""
    gaps = flute_gaps(cutter)
    return [(row, 1) for row in gaps] if cutter.run_out else [(gaps[0], cutter.flutes)]


def flute_radii(cutter: Cutter) -> FloatArray:
    """(flutes,) m by which each flute projects beyond the cutter's radius."""
    return np.asarray(
        cutter.run_out * np.cos(cutter.run_out_angle + 2.0 * np.pi * np.arange(cutter.flutes) / cutter.flutes)
    )


def chip_pieces(gaps: FloatArray, taper: float) -> FloatArray:
    """(q, 5) pieces of a flute's chip: u at which each begins, chip a u + b, share of the edge force c u + d.

    `gaps`: (flutes,) of the flute; `taper`: m of chip over which the force at the edge sets in.
    """
    steps = np.arange(1.0, len(gaps) + 1.0)
    i, j = np.triu_indices(len(gaps), 1)
    bends = np.concatenate([(gaps[i] - gaps[j]) / (steps[j] - steps[i]), -gaps / steps, (taper - gaps) / steps])
    starts = np.unique(np.concatenate([[0.0], bends[bends > 0.0]]))
    rows: list[tuple[float, ...]] = []
    for start, u in zip(starts, np.append(0.5 * (starts[1:] + starts[:-1]), starts[-1] + 1.0), strict=True):
        m = int(np.argmin(steps * u + gaps))
        a, b = (steps[m], gaps[m]) if steps[m] * u + gaps[m] > 0.0 else (0.0, 0.0)
        c, d = (a / taper, b / taper) if a * u + b < taper else (0.0, float(a > 0.0))
        if not rows or rows[-1][1:] != (a, b, c, d):
            rows.append((start, a, b, c, d))
    return np.array(rows)


def chip_integrals(angle: FloatArray, feed: FloatArray, pieces: FloatArray) -> FloatArray:
    """Integrals over the angle of the edge, from 0 on, of h cos, h sin, h, w cos, w sin, w.

    h is the chip, w the share of the force at the edge; closed antiderivatives of the pieces, which are the same before
    and behind 90 degrees. Behind 180 degrees there is no chip.

    Parameters
    ----------
    angle
        (p, a) rad, 0 to 2 pi.
    feed
        (p,) m per tooth, more than 0.
    pieces
        (q, 5) of `chip_pieces`.

    Returns
    -------
    FloatArray
        (6, p, a) m rad and rad.
    """
    angle = np.minimum(angle, np.pi)
    behind = angle > 0.5 * np.pi
    turned = np.where(behind, np.pi - angle, angle)
    part = _to_quarter(turned, feed[:, None], pieces)
    whole = _to_quarter(np.full((len(feed), 1), 0.5 * np.pi), feed[:, None], pieces)
    for even in (1, 2, 4, 5):  # integrals of h cos and w cos up to phi and up to pi - phi are equal
        part[even] = np.where(behind, 2.0 * whole[even] - part[even], part[even])
    return part


def _to_quarter(angle: FloatArray, feed: FloatArray, pieces: FloatArray) -> FloatArray:
    """The integrals of `chip_integrals` for angles up to 90 degrees."""
    sine, cosine = np.sin(angle), np.cos(angle)
    total = np.zeros((6, *angle.shape))
    with np.errstate(over="ignore"):
        lows = [np.minimum(start / feed, 1.0) for start in pieces[:, 0]]
    for low, high, (_, a, b, c, d) in zip(lows, [*lows[1:], np.ones_like(feed)], pieces, strict=True):
        low_cosine, low_angle = np.sqrt(1.0 - low * low), np.arcsin(low)
        if len(pieces) == 1:
            s, cos, phi = sine, cosine, angle
        else:
            s = np.minimum(np.maximum(sine, low), high)
            cos = np.minimum(np.maximum(cosine, np.sqrt(1.0 - high * high)), low_cosine)
            phi = np.minimum(np.maximum(angle, low_angle), np.arcsin(high))
        turn = phi - low_angle  # integrals of 1, cos, sin, sin cos, sin^2 from the piece's start to the angle
        cosines, sines = s - low, low_cosine - cos
        mixed = 0.5 * (s + low) * cosines
        squares = 0.5 * (turn - s * cos + low * low_cosine)
        for row, slope, level in ((0, a * feed, b), (3, c * feed, d)):
            if level:
                total[row] += level * cosines
                total[row + 1] += level * sines
                total[row + 2] += level * turn
            if slope.any():
                total[row] += slope * mixed
                total[row + 1] += slope * squares
                total[row + 2] += slope * sines
    return total
