"""Strut forces under a load of given size where a stiffness parallel to the struts shares it.

Equilibrium alone fixes the forces of six pinned struts. Joints that resist turning take a part of the load, and how
large that part is depends on how far each strut gives, which for gaps and contacts depends on its force. With
e_i(F_i) = s_i(F_i) F_i the stretch of strut i, s_i the secant compliance that the effects state, the forces minimise
the complementary energy (Crotti-Engesser: the sum of int e_i dF_i, plus that of the parallel stiffness), whose gradient
is the incompatibility

    g(F) = e(F) + Q_ff F + Q_fw w - J x,      K x = w - J^T F.

It is convex, because a strut gives more under more force, and its gradient has kinks (a strut at the edge of its gap).
Whole steps of Newton's method settle most poses; where they cycle between the kinks, steps with an exact line search,
which converge on such functions from everywhere, come first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

WHOLE_STEPS, MOST_STEPS, LINE_STEPS = 25, 200, 40
SETTLED = 1e-8  # of the load: the tip's compliance is then certain to some 1e-8 of itself
DIFFERENCE = 1e-9  # of the load, for the tangent: well below what settles, or the edge of a gap would be straddled
LEAST_TANGENT = 1e-3  # of the secant: a strut whose stretch does not grow with its force would be infinitely stiff
FLAT = 0.1  # of its slope at the start, to which a line search brings the slope of the energy
FAINT = 1e-7  # of the struts' stiffness: added to the parallel one in the search alone, so that it can be inverted


@dataclass(frozen=True)
class SharedLoad:
    """The problem at n poses.

    Attributes
    ----------
    compliance
        Strut forces (k, 6) N at the poses of an index (k,) to the secant compliances (k, 6) m/N of the struts, and
        what couples them with each other and with the tip's wrench, [Q_ff, Q_fw] (k, 6, 12).
    jacobian, parallel
        (n, 6, 6); (n, 6, 6) stiffness parallel to the struts.
    wrench
        (n, 6) N and N m.
    force
        (n,) N, size of the load.
    """

    compliance: Callable[[FloatArray, IntArray], tuple[FloatArray, FloatArray]]
    jacobian: FloatArray
    parallel: FloatArray
    wrench: FloatArray
    force: FloatArray

    def tangent(self, forces: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, 6) de_i/dF_i, and the compliances at these forces."""
        step = DIFFERENCE * self.force[rows, None]
        here, form = self.compliance(forces, rows)
        beyond = np.where(forces < 0.0, forces - step, forces + step)
        slope = (self.compliance(beyond, rows)[0] * beyond - here * forces) / (beyond - forces)
        return np.maximum(slope, LEAST_TANGENT * here), here, form


def settle(load: SharedLoad, first: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Strut forces that agree with the compliances that they cause.

    Parameters
    ----------
    load
        The problem at n poses.
    first
        (n, 6) N to begin with.

    Returns
    -------
    forces, settled
        (n, 6) N, and (n,) whether they stay.
    """
    forces = np.array(first)
    rest = _whole_steps(load, forces, np.arange(len(forces)))
    _line_searches(load, forces, rest)
    rest = _whole_steps(load, forces, rest)
    settled = np.ones(len(forces), dtype=bool)
    settled[rest] = False
    return forces, settled


def _whole_steps(load: SharedLoad, forces: FloatArray, rows: IntArray) -> IntArray:
    """Newton's method at some poses, in place; the rows that have not settled.

    With e_i = t_i F_i + o_i, t the tangent and o_i = (s_i - t_i) F_i from the last forces, the system is linear. Where
    its forces stay e_i = s_i F_i holds, whatever the tangent was.
    """
    eye = np.eye(6)
    for _ in range(WHOLE_STEPS):
        if not len(rows):
            break
        before, jacobian = forces[rows], load.jacobian[rows]
        transposed = np.swapaxes(jacobian, 1, 2)
        tangent, here, form = load.tangent(before, rows)
        longer = _times(form[..., 6:], load.wrench[rows]) + (here - tangent) * before
        struts = tangent[..., None] * eye + form[..., :6]
        stiffened = np.linalg.solve(struts, np.concatenate([jacobian, longer[..., None]], axis=-1))
        system = transposed @ stiffened[..., :6] + load.parallel[rows]
        motion = _solved(system, load.wrench[rows] + _times(transposed, stiffened[..., 6]))
        found = _times(stiffened[..., :6], motion) - stiffened[..., 6]
        moved = np.abs(found - before).max(axis=1) / load.force[rows]
        # Between tension and compression of a strut lies its gap, where it is idle.
        crossing = (found * before < 0.0) & (moved > SETTLED)[:, None]
        forces[rows] = np.where(crossing, 0.0, found)
        rows = rows[moved > SETTLED]
    return rows


def _line_searches(load: SharedLoad, forces: FloatArray, rows: IntArray) -> None:
    """Newton's method with an exact line search at some poses, in place, to near the least energy."""
    shared, moved = _parallel_alone(load, rows)  # compliance of the parallel stiffness as the struts see it
    for _ in range(MOST_STEPS):
        if not len(rows):
            break
        before = forces[rows]
        gradient = partial(_incompatibility, load, rows, shared, moved)
        tangent, _, form = load.tangent(before, rows)
        step = -_solved(tangent[..., None] * np.eye(6) + form[..., :6] + shared, gradient(before))
        forces[rows] = before + _length(gradient, before, step)[:, None] * step
        going = np.abs(step).max(axis=1) > 1e-3 * SETTLED * load.force[rows]
        rows, shared, moved = rows[going], shared[going], moved[going]


def _parallel_alone(load: SharedLoad, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """J K^-1 J^T (k, 6, 6) and J K^-1 w (k, 6): strut stretches as the parallel stiffness alone would have them."""
    jacobian = load.jacobian[rows]
    transposed = np.swapaxes(jacobian, 1, 2)
    strut, _ = load.compliance(np.repeat(load.force[rows, None], 6, axis=1), rows)
    faint = FAINT * transposed @ (jacobian / strut[..., None])
    flexible = jacobian @ np.linalg.inv(load.parallel[rows] + faint)
    return flexible @ transposed, _times(flexible, load.wrench[rows])


def _incompatibility(
    load: SharedLoad, rows: IntArray, shared: FloatArray, moved: FloatArray, forces: FloatArray
) -> FloatArray:
    """(k, 6) m, the gradient g of the complementary energy."""
    strut, form = load.compliance(forces, rows)
    both = np.concatenate([forces, load.wrench[rows]], axis=1)
    return np.asarray(strut * forces + _times(form, both) + _times(shared, forces) - moved)


def _length(gradient: Callable[[FloatArray], FloatArray], forces: FloatArray, step: FloatArray) -> FloatArray:
    """(n,) how much of each step to go: to where the energy falls no further along it, at most all of it."""

    def slope(share: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ni,ni->n", gradient(forces + share[:, None] * step), step))

    low, high = np.zeros(len(forces)), np.ones(len(forces))
    goal = FLAT * np.abs(slope(low))
    share, found = high.copy(), slope(high)
    for _ in range(LINE_STEPS):
        rising, falling = found > goal, (found < -goal) & (share < 1.0)
        if not (rising | falling).any():
            break
        high, low = np.where(rising, share, high), np.where(falling, share, low)
        share = np.where(rising | falling, 0.5 * (low + high), share)
        found = slope(share)
    return share


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nij,nj->ni", matrix, vector))


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
