"""Error of the surface that a cutter leaves: its deflection at the moment when an edge makes the surface.

A wall is made at height z when an edge passes it there (0 or 180 degrees), by the force of all slices that cut at that
moment: not by the mean force (Kline, DeVor, Shareef, Journal of Engineering for Industry 104 (1982) 272; Budak,
Altintas, International Journal of Machine Tools and Manufacture 34 (1994) 1141). A floor is passed twice, ahead and
behind, and the lower pass counts; a ball or a corner radius makes a point of the surface where its normal is that of
the surface.

Errors count along the normal of the surface, out of the part: + material left, - cut too deep. With run-out the radius
counts to the flute that stands out farthest, as where a tool is measured turning. The deflection is quasi-static and
that of the tip; the chip is not thinner for it.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray, product
from toolpath_stiff.cutting.chips import flute_radii
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.forces import EACH, forces_of_sets
from toolpath_stiff.cutting.patches import TURN, Contact

HEIGHTS = 9  # on a wall, both ends included, at which its error is computed
STRIPS = 5  # of a floor
Passes = tuple[FloatArray, ...]  # errors (n, h) m, their slopes (n, h, 6) over the coefficients, forces (n, h, 3) N


def shares() -> tuple[FloatArray, FloatArray]:
    """Heights (HEIGHTS,) as shares of a wall, from its lower to its upper end, and their weights in a mean.

    Gauss and Lobatto's nodes (Abramowitz, Stegun, Handbook of Mathematical Functions, 25.4.32).
    """
    legendre = np.polynomial.legendre.Legendre.basis(HEIGHTS - 1)
    nodes = np.concatenate([[-1.0], np.sort(legendre.deriv().roots().real), [1.0]])
    weights = 2.0 / (HEIGHTS * (HEIGHTS - 1) * legendre(nodes) ** 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def wall_error(
    contact: Contact, compliance: FloatArray, walls: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, 2, HEIGHTS) m, error of the walls left and right of n stations, from lower to upper end.

    Parameters
    ----------
    contact
        At the stations.
    compliance
        (n, 3, 3) m/N of tip and cutter in the station's frame.
    walls
        (n, 2, 2) m: of the left and right wall the lowest and highest point above the tip; nan where there is none.

    Returns
    -------
    tuple of FloatArray
        Errors, nan where there is no wall; (n, 2) m, standard deviation of their mean over the height that comes from
        the coefficients; (n, 2, 3) N, force on the tool while the wall is made, mean over its height.
    """
    error, deviation, force = (np.full((len(walls), 2, *shape), np.nan) for shape in ((HEIGHTS,), (), (3,)))
    nodes, weights = shares()
    for side, (angle, outward) in enumerate(((0.0, -1.0), (np.pi, 1.0))):
        cut = np.flatnonzero(np.isfinite(walls[:, side]).all(axis=1))
        low, high = walls[cut, side, :, None].swapaxes(0, 1)
        heights = low + (high - low) * nodes
        normal = np.broadcast_to([0.0, outward, 0.0], (*heights.shape, 3))
        chosen = contact.of(cut)
        tip = _tip_angle(chosen, np.full_like(heights, angle), heights)
        error[cut, side], slope, acting = _errors(chosen, tip, product(normal, compliance[cut]))
        deviation[cut, side] = _deviation((slope * weights[:, None]).sum(axis=1), contact.coefficients)
        force[cut, side] = (acting * weights[:, None]).sum(axis=1)
    return error, deviation, force


def floor_error(contact: Contact, compliance: FloatArray, strip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, STRIPS) m, error of the surface below n stations, from right to left across each strip; for a ball (n, 1).

    Parameters
    ----------
    contact, compliance
        As `wall_error`.
    strip
        (n, 2) m to the left of the tip between which what the cutter leaves stays; nan where nothing does. Within
        the flat end of a cutter that is a floor, beyond it the surface that a ball or a corner radius makes.

    Returns
    -------
    tuple of FloatArray
        Errors, nan where no surface stays; (n,) m, standard deviation of their mean that comes from the coefficients.
    """
    corner = contact.cutter.corner_radius
    flat = contact.cutter.flat
    count = STRIPS if flat > 0.0 else 1  # a scallop is narrow, and a ball passes each of its points once
    error, deviation = np.full((len(strip), count), np.nan), np.full(len(strip), np.nan)
    cut = np.flatnonzero(np.isfinite(strip).all(axis=1))
    right, left = strip[cut, :, None].swapaxes(0, 1)
    aside = right + (left - right) * (np.arange(count) + 0.5) / count
    beyond = np.clip(np.abs(aside) - flat, 0.0, corner)
    out = beyond / (corner or 1.0)  # sine of the angle between the tool and the surface's normal
    chosen = contact.of(cut)
    along = np.sqrt(1.0 - out * out) / np.hypot(*chosen.feed.T)[:, None]
    slope = chosen.feed[:, :, None] * along[:, None]
    normal = np.stack([-slope[:, 1], -np.sign(aside) * out, slope[:, 0]], axis=-1)  # perpendicular to a ramp's feed
    pull = product(normal, compliance[cut])
    ahead = np.arccos(np.clip(aside / max(flat, 1e-9), -1.0, 1.0))  # beyond the flat end: beside the axis
    height = corner - np.sqrt(np.maximum(corner**2 - beyond**2, 0.0))
    # On a slope the end passes a point again, higher up: behind the axis when it climbs, ahead when it descends.
    above = 2.0 * np.sqrt(np.maximum(flat**2 - aside**2, 0.0)) * slope[:, 1]
    passes = []
    for angle, higher in ((ahead, -above), (TURN - ahead, above))[:count]:
        errors, *others = _errors(chosen, _tip_angle(chosen, angle, height), pull)
        passes.append((errors + np.maximum(higher, 0.0), *others))
    error[cut], slopes, _ = _lowest(passes)
    deviation[cut] = _deviation(slopes.mean(axis=1), contact.coefficients)
    return error, deviation


def _tip_angle(contact: Contact, angle: FloatArray, height: FloatArray) -> FloatArray:
    """(n, h) rad of flute 0 at the tip when a flute passes angles (n, h) at heights (n, h), as in `forces.force_at`."""
    return np.where(contact.turning[:, None] < 0.0, np.pi - angle, angle) + contact.lag[:, None] * height


def _errors(contact: Contact, tip: FloatArray, pull: FloatArray) -> Passes:
    """The lowest of the passes of all flutes; `pull` (n, h, 3) m/N is the error per force."""
    cutter = contact.cutter
    radii = flute_radii(cutter) if cutter.run_out else np.zeros(1)
    lowest = np.zeros(tip.shape), np.zeros((*tip.shape, 6)), np.zeros((*tip.shape, 3))
    for block, part in contact.blocks():
        passes: list[Passes] = []
        for flute, short in enumerate(radii.max() - radii):
            response = forces_of_sets(part, tip[block] + TURN * flute / cutter.flutes, EACH)
            slope = product(pull[block][..., None, :], response)[..., 0, :]
            force = product(response, contact.coefficients.values[:, None])[..., 0]
            passes.append(((pull[block] * force).sum(axis=-1) + short, slope, force))
        for whole, values in zip(lowest, _lowest(passes), strict=True):
            whole[block] = values
    return lowest


def _lowest(passes: list[Passes]) -> Passes:
    """The pass with the lowest error at each place."""
    lowest = passes[0]
    for other in passes[1:]:
        lower = other[0] < lowest[0]
        lowest = tuple(
            np.where(lower if values.ndim == 2 else lower[..., None], values, old)
            for values, old in zip(other, lowest, strict=True)
        )
    return lowest


def _deviation(slope: FloatArray, coefficients: Coefficients) -> FloatArray:
    """(n,) m, standard deviation from slopes (n, 6): JCGM 100:2008, equation 13."""
    variance = (product(slope, coefficients.covariance) * slope).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
