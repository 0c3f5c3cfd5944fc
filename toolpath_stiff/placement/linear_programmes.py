"""Small linear programmes, many at once: some ten unknowns and up to a few thousand rows."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, product

PERTURBATION, TOLERANCE = 1e-10, 1e-10  # of costs; of rows; both are of the order of one
MOST_PIVOTS = 500  # about fifteen are usual
Programme = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]  # cost, matrix, right, low, high


def least_costs(programmes: Sequence[Programme]) -> list[FloatArray | None]:
    """Minimisers x (n,) of `cost` . x in each programme, with `matrix` x <= `right` and `low` <= x <= `high`, finite.

    The dual simplex method in the form of a working set: n rows that hold as equations, at first the bounds that the
    cost leans on; the row that is broken most comes in, the one whose multiplier reaches zero first goes out (Nocedal
    and Wright, Numerical Optimization, 2006, chapter 13, problem 13.6; Lemke 1954). For some ten unknowns and a
    thousand rows it takes a tenth of the time of a general solver, most of which sets up; all programmes, of one n,
    take their steps at once. None where nothing keeps all rows, or no end is found.
    """
    rows, state, working = _set_up(programmes)
    n = state.shape[2] - 1
    leaning = np.array([_leaning(programme[0]) for programme in programmes])
    solutions: list[FloatArray | None] = [None] * len(programmes)
    number, going = np.arange(len(programmes)), np.ones(len(programmes), dtype=bool)
    for pivot in range(MOST_PIVOTS):
        if going.sum() <= 0.6 * len(going):  # finished programmes are dropped, as they cost time
            number, working = number[going], working[going]
            rows, state, leaning = rows[going], state[going], leaning[going]
            going = np.ones(len(number), dtype=bool)
        if not len(going):
            break
        if pivot % 20 == 19:  # recompute what the updates have lost to rounding
            held = np.take_along_axis(rows, working[:, None], axis=2)
            inverse = _inverses(held[:, :n].swapaxes(1, 2))
            state[:, :n, :n], state[:, :n, n] = inverse, -product(inverse, held[:, n, :, None])[..., 0]
            state[:, n + 1, :n] = -product(leaning[:, None], inverse)[:, 0]
        each = np.arange(len(going))
        broken = product(state[:, None, : n + 1, n], rows)[:, 0]
        worst = broken.argmax(axis=1)
        done = going & (broken[each, worst] <= TOLERANCE)
        for i in np.flatnonzero(done):
            solutions[number[i]] = state[i, :n, n].copy()
        change = product(rows[each, :, worst][:, None], state[:, : n + 1])[:, 0]
        share = change[:, :n]
        ratio = np.full(share.shape, np.inf)
        np.divide(np.maximum(state[:, n + 1, :n], 0.0), share, out=ratio, where=share > TOLERANCE)
        out = ratio.argmin(axis=1)
        going = going & ~done & (ratio[each, out] < np.inf)
        working[each[going], out[going]] = worst[going]
        column = state[each, :, out] / np.where(going, change[each, out], np.inf)[:, None]
        change[each, out] -= 1.0
        state -= column[:, :, None] * change[:, None]
    return solutions


def _inverses(matrices: FloatArray) -> FloatArray:
    """(k, n, n) inverses by elimination with pivoting, identical to the last bit on every processor."""
    k, n, _ = matrices.shape
    table = np.concatenate([matrices, np.broadcast_to(np.eye(n), (k, n, n))], axis=2)
    each = np.arange(k)
    for column in range(n):
        pivot = column + np.abs(table[:, column:, column]).argmax(axis=1)
        table[each, column], table[each, pivot] = table[each, pivot], table[each, column]
        table[:, column] /= table[:, column, column, None].copy()
        share = table[:, :, column].copy()
        share[:, column] = 0.0
        table -= share[:, :, None] * table[:, None, column]
    return table[:, :, n:]


def _leaning(cost: FloatArray) -> FloatArray:
    """Costs perturbed so that no two are equal: with equal multipliers the method could cycle."""
    return np.asarray(cost + PERTURBATION * np.arange(1, len(cost) + 1))


def _set_up(programmes: Sequence[Programme]) -> tuple[FloatArray, FloatArray, IntArray]:
    """Initial rows, state and working sets (k, n).

    (x, 1) @ `rows` (k, n + 1, m) says by how much each row is broken, the bounds last. `state` (k, n + 2, n + 1) has
    the inverse of the working set and x beside it; 0 and 1; the multipliers.
    """
    k, n = len(programmes), len(programmes[0][0])
    m = max(len(right) for _, _, right, _, _ in programmes)
    rows, state = np.zeros((k, n + 1, m + 2 * n)), np.zeros((k, n + 2, n + 1))
    rows[:, n], state[:, n, n] = -1.0, 1.0  # padding with rows that nothing can break
    rows[:, :n, m : m + n], rows[:, :n, m + n :] = np.eye(n), -np.eye(n)
    working = np.empty((k, n), dtype=np.int64)
    for i, (cost, matrix, right, low, high) in enumerate(programmes):
        leaning = _leaning(cost)
        up = leaning < 0.0
        rows[i, :n, : len(right)], rows[i, n, : len(right)] = matrix.T, -right
        rows[i, n, m : m + n], rows[i, n, m + n :] = -high, low
        state[i, np.arange(n), np.arange(n)] = np.where(up, 1.0, -1.0)
        state[i, :n, n], state[i, n + 1, :n] = np.where(up, high, low), np.abs(leaning)
        working[i] = m + np.where(up, np.arange(n), np.arange(n, 2 * n))
    return rows, state, working
