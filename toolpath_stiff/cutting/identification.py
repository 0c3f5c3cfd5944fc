"""Cutting force coefficients from mean forces in slots at several feeds, by least squares.

Mean forces are linear in the coefficients (`forces.mean_forces_of_sets`; of a flat end mill the straight lines over
the feed of Altintas, Manufacturing Automation, 2nd ed., section 2.8.1). Each direction of force has its own scatter.
"""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, product
from toolpath_stiff.cutting.coefficients import UNKNOWN, Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.forces import EACH, mean_forces_of_sets
from toolpath_stiff.cutting.patches import Contact, Patches
from toolpath_stiff.errors import MeasurementError

LEAST_SCATTER = 1e-6  # of the largest force: no dynamometer reads finer
SURE = 0.975  # quantile of Student's t: intervals of 95 %
SOUGHT = Coefficients(np.zeros(3), np.zeros(3), np.zeros((6, 6)), taper=0.0)  # no taper: straight lines over the feed


def slot(cutter: Cutter, feed: float, depth: float, coefficients: Coefficients = SOUGHT) -> Contact:
    """The contact in a slot of given depth (m) at a feed (m per tooth)."""
    one = np.ones(1)
    patches = Patches(np.arange(1), 0.0 * one, depth * one, 0.0 * one, np.pi * one)
    return Contact(patches, cutter, coefficients, np.array([[feed, 0.0]]), one)


def slot_responses(cutter: Cutter, feed: FloatArray, depth: FloatArray, angle: FloatArray | None = None) -> FloatArray:
    """(n, 3, 6) mean forces per coefficient in slots of depths (n,) m at feeds (n,) m per tooth.

    Run-out points to angles (n,) rad, as each record begins elsewhere in the turn; unless given, as the cutter says.
    """
    angles = np.full(len(feed), cutter.run_out_angle) if angle is None else angle
    rows = zip(feed.tolist(), depth.tolist(), angles.tolist(), strict=True)
    slots = [slot(replace(cutter, run_out_angle=to), fed, deep) for fed, deep, to in rows]
    return np.concatenate([mean_forces_of_sets(contact, EACH) for contact in slots])


def least_squares(response: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(6,) coefficients, (6, 6) covariance, (6,) True if determined by the forces; the others are 0 +- `UNKNOWN`.

    Parameters
    ----------
    response
        (n, 3, 6) mean forces per coefficient.
    force
        (n, 3) N on the tool; nan in a direction that was not recorded.

    Raises
    ------
    MeasurementError
        The forces do not tell the coefficients apart.
    """
    recorded = np.isfinite(force).all(axis=0)
    design = response[:, recorded]
    determined = np.abs(design).max(axis=(0, 1)) > 0.0
    design, measured = design[..., determined], force[:, recorded]
    freedom = len(force) - 2  # each a straight line, with two parameters
    deviation = np.ones(measured.shape[1])
    size = np.sqrt((design**2).sum(axis=(0, 1)))  # of columns: N per N/m2 beside N per N/m
    for _ in range(2):  # the first fit gives the scatter of each direction, the second is weighted by it
        rows = (design / size / deviation[:, None]).reshape(-1, determined.sum())
        solved, _, rank, _ = np.linalg.lstsq(rows, (measured / deviation).ravel(), rcond=1e-12)
        if rank < determined.sum() or freedom < 1 or not measured.any():
            raise MeasurementError(
                "these slots do not tell the coefficients apart",
                expected="slots at 3 different feeds or more, forces along x, y and, of a corner radius, z",
            )
        values = np.asarray(solved / size, dtype=float)
        residual = measured - product(design, values[:, None])[..., 0]
        deviation = np.sqrt((residual**2).sum(axis=0) / freedom)
        deviation = np.maximum(deviation, LEAST_SCATTER * np.abs(measured).max())
    coefficients, covariance = np.zeros(6), np.zeros((6, 6))
    coefficients[determined] = values
    rows = (design / size / deviation[:, None]).reshape(-1, determined.sum())
    covariance[np.ix_(determined, determined)] = np.linalg.inv(rows.T @ rows) / size / size[:, None]
    unknown = np.repeat(coefficients[[0, 3]] * UNKNOWN, 3)
    covariance[np.diag_indices(6)] += np.where(determined, 0.0, unknown) ** 2
    return coefficients, covariance, determined


def left_out(response: FloatArray, force: FloatArray, feed: FloatArray) -> FloatArray:
    """(n, 3) N, measured force minus the prediction from slots at all other feeds; nan if these do not suffice."""
    off = np.full(force.shape, np.nan)
    for value in np.unique(feed):
        chosen = feed == value
        if len(np.unique(feed[~chosen])) > 2:
            coefficients, _, _ = least_squares(response[~chosen], force[~chosen])
            off[chosen] = force[chosen] - product(response[chosen], coefficients[:, None])[..., 0]
    return off
