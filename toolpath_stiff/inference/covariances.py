"""Covariances of readings without n x n matrices: own scatter, groups that scatter together, a few shared columns.

    V = diag(own) + Z diag(common) Z^T + S^T S,

Z has a column of ones and noughts a group (a clamping, which may scatter more than another), S a row for each nuisance
that all readings share (six struts, 36 coordinates of joints). Everything follows from the blocks C = diag(own) +
Z diag(common) Z^T, whose inverse is known, by

    V^-1  = C^-1 - F^T F,       F = L^-1 S C^-1,   L L^T = 1 + S C^-1 S^T   (Woodbury 1950),
    ln|V| = ln|C| + ln|1 + S C^-1 S^T|                                      (matrix determinant lemma)

(Golub and Van Loan 2013, Matrix Computations, 2.1.4; Harville 1997, Matrix Algebra from a Statistician's Perspective,
18.1 and 18.2). What a least-squares fit leaves of readings has an inverse covariance of the same shape with a few more
rows in F, so that a fit costs as much as there are readings. Readings always run along the last axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray

Rows = IntArray
BLOCK = 512  # rows at a time, of which there may be thousands


@dataclass(frozen=True)
class Groups:
    """Grouped readings: `of` (n,) is the number of each reading's group, from 0 without gaps."""

    of: Rows

    @classmethod
    def by(cls, labels: AnyArray) -> Groups:
        """Groups of readings with equal labels (n,)."""
        return cls(np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64))

    def spread(self, values: float | FloatArray) -> FloatArray:
        """(n,) value of each reading's group, from one value for all groups or from (groups,)."""
        return np.broadcast_to(values, self.count)[self.of]

    @cached_property
    def _order(self) -> Rows:
        return np.argsort(self.of, kind="stable")

    @cached_property
    def _starts(self) -> Rows:
        return np.flatnonzero(np.diff(self.of[self._order], prepend=-1))

    @property
    def count(self) -> int:
        """Number of groups."""
        return len(self._starts)

    @cached_property
    def alone(self) -> bool:
        """True if every reading is a group of its own."""
        return self.count == len(self.of)

    def members(self) -> list[Rows]:
        """Readings of each group."""
        return np.split(self._order, self._starts[1:])

    def by_size(self) -> Iterator[tuple[Rows, Rows]]:
        """Groups of equal size k together: group numbers (m,), their readings (m, k)."""
        members = self.members()
        sizes = np.array([len(group) for group in members])
        for size in np.unique(sizes):
            which = np.flatnonzero(sizes == size)
            yield which, np.array([members[k] for k in which])

    def sums(self, rows: FloatArray) -> FloatArray:
        """(..., groups) sums over the groups of rows (..., n)."""
        return np.asarray(np.add.reduceat(rows[..., self._order], self._starts, axis=-1))


@dataclass(frozen=True)
class Covariance:
    """Covariance of n readings, V as above.

    Attributes
    ----------
    own_variance
        (n,) variance of each reading's own scatter, more than 0.
    groups, common
        Readings that scatter together, and the variance that they have in common: of all groups, or (groups,).
    shared
        (q, n) by how much one standard deviation of each shared nuisance moves each reading.
    """

    own_variance: FloatArray
    groups: Groups
    common: float | FloatArray
    shared: FloatArray

    def __len__(self) -> int:
        return len(self.own_variance)

    @property
    def diagonal(self) -> FloatArray:
        """(n,) variance of each reading."""
        return np.asarray(self.own_variance + self.groups.spread(self.common) + (self.shared**2).sum(axis=0))

    def squares(self, rows: FloatArray) -> FloatArray:
        """(...,) x V x^T of rows (..., n): variances of these combinations of readings."""
        unshared = (rows**2 * self.own_variance).sum(axis=-1) + (self.common * self.groups.sums(rows) ** 2).sum(axis=-1)
        return np.asarray(unshared + ((rows @ self.shared.T) ** 2).sum(axis=-1))

    def widened(self, rows: Rows, variance: FloatArray) -> Covariance:
        """Covariance with added scatter of some readings' own."""
        own_variance = self.own_variance.copy()
        own_variance[rows] += variance
        return replace(self, own_variance=own_variance)

    def draw(self, rng: np.random.Generator, draws: int) -> FloatArray:
        """(draws, n) normal scatter that readings share, without the scatter of each reading alone."""
        common = (np.sqrt(self.common) * rng.standard_normal((draws, self.groups.count)))[:, self.groups.of]
        return np.asarray(common + rng.standard_normal((draws, len(self.shared))) @ self.shared)

    @property
    def blocks(self) -> Precision:
        """C^-1."""
        none = np.zeros((0, len(self.own_variance)))
        return Precision(self.own_variance, self.groups, self.common, none, none)

    @cached_property
    def precision(self) -> Precision:
        """V^-1."""
        return self._inverted[0]

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant, ln |V|."""
        return self._inverted[1]

    @cached_property
    def _inverted(self) -> tuple[Precision, float]:
        blocks, solved = self.blocks, self.blocks.times(self.shared)
        lower = np.linalg.cholesky(np.eye(len(self.shared)) + solved @ self.shared.T)
        determinant = np.log(self.own_variance).sum() + np.log1p(self.common * blocks.weights).sum()
        determinant += 2.0 * np.log(np.diag(lower)).sum()
        return replace(blocks, factors=np.linalg.solve(lower, solved)), float(determinant)


@dataclass(frozen=True)
class Precision:
    """Inverse covariance of n readings, C^-1 - F^T F as above.

    Attributes
    ----------
    own_variance, groups, common
        The blocks C, as in `Covariance`.
    factors
        F (q, n).
    fitted
        (p, n) X, of what a fit leaves: combinations of its unknowns with P = A - A X^T X A. Their rows X A are the last
        of `factors`.
    """

    own_variance: FloatArray
    groups: Groups
    common: float | FloatArray
    factors: FloatArray
    fitted: FloatArray

    def __len__(self) -> int:
        return len(self.own_variance)

    @cached_property
    def weights(self) -> FloatArray:
        """(groups,) sum of 1 / own over each group."""
        return self.groups.sums(1.0 / self.own_variance)

    @cached_property
    def pull(self) -> FloatArray:
        """(groups,) factor on a group's weighted sum by which each of its readings moves.

        (diag(d) + c 1 1^T)^-1 x = (x - 1 c sum(x / d) / (1 + c sum(1 / d))) / d   (Sherman and Morrison 1950).
        """
        return np.asarray(self.common / (1.0 + self.common * self.weights))

    def _of_blocks(self, rows: FloatArray) -> FloatArray:
        """C^-1 x for rows x (..., n)."""
        if self.groups.alone:
            return rows / (self.own_variance + self.groups.spread(self.common))
        moved = self.pull * self.groups.sums(rows / self.own_variance)
        return np.asarray((rows - moved[..., self.groups.of]) / self.own_variance)

    def times(self, rows: FloatArray) -> FloatArray:
        """(..., n) rows times the matrix."""
        flat = rows.reshape(-1, rows.shape[-1])  # one product, not one for each leading index
        shared = (flat @ self.factors.T) @ self.factors
        return np.asarray(self._of_blocks(rows) - shared.reshape(rows.shape))

    def squares(self, rows: FloatArray) -> FloatArray:
        """(...,) quadratic form of each row (..., n) with itself."""
        flat = rows.reshape(-1, rows.shape[-1])
        squares = np.empty(len(flat))
        for start in range(0, len(flat), BLOCK):
            some = flat[start : start + BLOCK]
            over, shared = some / self.own_variance, some @ self.factors.T
            blocks = np.einsum("in,in->i", some, over) - self.groups.sums(over) ** 2 @ self.pull
            squares[start : start + BLOCK] = blocks - np.einsum("iq,iq->i", shared, shared)
        return squares.reshape(rows.shape[:-1])

    @cached_property
    def diagonal(self) -> FloatArray:
        """(n,) diagonal."""
        blocks = (1.0 - self.pull[self.groups.of] / self.own_variance) / self.own_variance
        return np.asarray(blocks - (self.factors**2).sum(axis=0))

    def block(self, columns: Rows) -> FloatArray:
        """(..., k, k) submatrices of rows and columns `columns` (..., k)."""
        own_variance, of = self.own_variance[columns], self.groups.of[columns]
        factors = np.moveaxis(self.factors[:, columns], 0, -2)
        same = of[..., :, None] == of[..., None, :]
        blocks = np.eye(columns.shape[-1]) - same * (self.pull[of] / own_variance)[..., None, :]
        return np.asarray(blocks / own_variance[..., :, None] - np.swapaxes(factors, -1, -2) @ factors)

    def beside(self, fitted: FloatArray, prior: FloatArray) -> Precision:
        """P = A - A J (J^T A J + prior)^-1 J^T A, for the residuals of a fit with p unknowns.

        `fitted` (p, n): J^T, by how much each unknown moves each reading; `prior` (p, p) information.
        """
        combined = inverse_root(self.times(fitted) @ fitted.T + prior).T @ fitted
        factors = np.concatenate([self.factors, self.times(combined)])
        return replace(self, factors=factors, fitted=np.concatenate([self.fitted, combined]))

    def widened(self, row: int, variance: float) -> tuple[Precision, FloatArray, float]:
        """Precision with added scatter of one reading, and its column (n,) and share: less column x column^T share.

        Share v / (1 + v c_row) of column c for the variance v (Sherman and Morrison 1950).
        """
        group = self.groups.of[row]
        column = -(self.factors[:, row] @ self.factors)
        column -= (self.groups.of == group) * (self.pull[group] / self.own_variance[row]) / self.own_variance
        column[row] += 1.0 / self.own_variance[row]
        share = variance / (1.0 + variance * float(column[row]))
        return replace(self, factors=np.concatenate([self.factors, np.sqrt(share) * column[None]])), column, share


def inverse_root(information: FloatArray, least: float = 1e-15) -> FloatArray:
    """(p, r) R with R R^T the (pseudo-)inverse of an information matrix (p, p) of rows in very different units.

    `least`: share of the largest eigenvalue below which one counts as 0.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > least * values[-1]
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None])
