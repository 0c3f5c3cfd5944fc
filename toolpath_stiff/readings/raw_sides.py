"""The two sides of a loop of raw records: stiffness in tension and in compression, and lost motion between them."""

import math

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.readings.strut_series import chance_of_t

A_SIDE = 3  # forces on each side of zero
RESOLUTION = 0.05e-6  # m, rms that no line is believed to fit better than; assumed: half a step of 0.1 um
SURE = 0.01  # probability below which chance alone is ruled out
NEARER, FARTHER = 0.15, 0.5  # of an extreme, between which lost motion is read; assumed
APART = 0.01  # of the deflection: lost motion that is told of; assumed, as much as a bench's two sides differ


def sides_of(force: FloatArray, deflection: FloatArray, drift: bool = False, gap: bool = False) -> tuple[float, float]:
    """Stiffness in N/m under tension (positive force) and under compression; nan without `A_SIDE` records of both.

    Slopes of two straight lines that meet at zero force, by least squares over all records; with `drift`, of closed
    cycles, beside a deflection that goes on steadily from record to record; with `gap`, of those beyond it, beside a
    jump at zero force.
    """
    if not _both_sides(force):
        return np.nan, np.nan
    order = np.arange(len(force), dtype=float)
    if gap:  # nobody knows to which side of it a record within belongs
        beyond = (force >= NEARER * force.max()) | (force <= NEARER * force.min())
        force, deflection, order = force[beyond], deflection[beyond], order[beyond]
    others = [np.ones_like(force)] + [order] * drift + [np.sign(force)] * gap
    pulled, pushed = _fitted([*others, *_lines(force)], deflection)[1][-2:]
    return (1.0 / float(pulled), 1.0 / float(pushed)) if min(pulled, pushed) > 0.0 else (np.nan, np.nan)


def play_of(force: FloatArray, deflection: FloatArray, way: FloatArray) -> tuple[float, bool]:
    """How far the straight lines of the two sides stand apart at zero force, m, and whether it is more than chance.

    The lines lie between `NEARER` and `FARTHER` of each extreme: closer in a gap may still be open, farther out joints
    that stick after the turn make both sides stiffer, which looks like a gap. Friction moves the two ways apart by an
    even function of the force (Masing 1926): a constant and a square are fitted beside the lines, and a steady drift.
    Shown is what a t test at 1 % finds and what is `APART` of the deflection, as less does not blur a stiffness.

    Parameters
    ----------
    force, deflection, way
        (m,) N, tension positive; m; 1 and -1 on successive ways from extreme to extreme, of closed cycles.

    Returns
    -------
    nan and False without records of both sides.
    """
    high, low = float(force.max()), float(force.min())
    share = np.where(force > 0.0, force / high, force / low) if low < 0.0 < high else np.zeros_like(force)
    inside = (share >= NEARER) & (share <= FARTHER)
    f, y = force[inside], deflection[inside]
    if not _both_sides(f):
        return np.nan, False
    friction = way[inside, None] * np.stack([np.ones_like(f), f**2], axis=1)
    columns = [np.ones_like(f), np.flatnonzero(inside).astype(float), *friction.T, *_lines(f)]
    before = _fitted(columns, y)[0]
    after, coefficients = _fitted([*columns, np.sign(f)], y)
    size, freedom = 2.0 * float(coefficients[-1]), len(f) - len(columns) - 1
    if freedom < 1 or size < APART * float(np.ptp(deflection)):
        return size, False
    after = max(after, freedom * RESOLUTION**2)
    return size, chance_of_t(math.sqrt(max(before - after, 0.0) / (after / freedom)), freedom) < SURE


def _both_sides(force: FloatArray) -> bool:
    return min(len(np.unique(force[force > 0.0])), len(np.unique(force[force < 0.0]))) >= A_SIDE


def _lines(force: FloatArray) -> list[FloatArray]:
    return [np.maximum(force, 0.0), np.minimum(force, 0.0)]


def _fitted(columns: list[FloatArray], y: FloatArray) -> tuple[float, FloatArray]:
    """Squares that least squares leave, and the coefficients."""
    design = np.stack(columns, axis=1)
    scale = np.abs(design).max(axis=0)
    coefficients = np.linalg.lstsq(design / scale, y, rcond=None)[0] / scale
    return float(((y - design @ coefficients) ** 2).sum()), coefficients
