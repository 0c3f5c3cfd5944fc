"""Effects that readings cannot tell apart: canonical correlations of their signatures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import json_number
from toolpath_stiff.inference.covariances import inverse_root
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.hypotheses import Family

CONFOUNDED = 0.95  # canonical correlation above which two effects cannot be told apart by these data
SEPARATE = 1e-10  # share of an effect's information below which a combination of its components is not seen


@dataclass(frozen=True)
class Confounding:
    """Largest canonical correlation of any two effects' signatures.

    Attributes
    ----------
    names
        Effects, ordered so that those of one set stand together.
    matrix
        (m, m) from 0 to 1.
    sets
        Sets of two and more effects, linked by correlations above `CONFOUNDED`.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    sets: tuple[tuple[str, ...], ...]

    @property
    def rounded(self) -> list[list[float | None]]:
        """The matrix to three digits, as documents and pictures have it."""
        return [[json_number(value, 3) for value in row] for row in self.matrix.tolist()]


def confounding(problem: Problem, families: Sequence[Family]) -> Confounding:
    """The confounding of effects on these data; for an effect with choices, that of its worst choice."""
    names = sorted(family.name for family in families)
    precision = problem.sight.projected
    bases: dict[str, list[tuple[FloatArray, FloatArray]]] = {name: [] for name in names}  # rows, and times precision
    for family in families:
        for table in family.tables:
            rows = (table.columns / problem.base_compliance[:, None]).T
            weighted = precision.times(rows)
            squares = (rows * weighted).sum(axis=1)
            kept = squares > 1e-18 * squares.max()
            if kept.any():
                root = inverse_root(weighted[kept] @ rows[kept].T, SEPARATE)
                bases[family.name].append((root.T @ rows[kept], root.T @ weighted[kept]))
    matrix = np.eye(len(names))
    for i, first in enumerate(names):
        for j, second in enumerate(names[:i]):
            matrix[i, j] = matrix[j, i] = max(
                (float(np.linalg.norm(a @ b.T, 2)) for a, _ in bases[first] for _, b in bases[second]), default=0.0
            )
    matrix = np.clip(matrix, 0.0, 1.0)
    linked = np.linalg.matrix_power((matrix > CONFOUNDED) * 1.0, max(len(names), 1)) > 0.0  # however long the way
    sets = sorted({tuple(np.flatnonzero(row).tolist()) for row in linked})
    # Sets first, each as a block; then the rest, every one next to what it resembles most.
    order = [i for group in sorted(sets, key=lambda group: (-len(group), group)) for i in group]
    return Confounding(
        tuple(names[i] for i in order),
        matrix[np.ix_(order, order)],
        tuple(tuple(names[i] for i in group) for group in sets if len(group) > 1),
    )
