"""Forms of a discrepancy that no effect describes: covariances, and a few features of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.error_model import RANGE_ANGLE, RANGE_POSITION, coordinates

# Correlation lengths of a smooth discrepancy; assumed: a few turns of a screw, a third of a campaign.
RANGE_LENGTH, RANGE_ORDER = 0.05, 0.3
# Most features of a form, and of the form with one a point and direction: faster variation is left out.
MOST_FEATURES, MOST_POINTS = 300, 2000
FORMS = ("forms of discrepancy",)


def discrepancy_forms(predictor: Predictor) -> dict[str, FloatArray]:
    """Form of a discrepancy in words -> features (n, r) of its covariance; only forms that vary.

    Worked out once for a set of readings, and kept in `predictor.tables` under `FORMS`.
    """
    if FORMS not in predictor.tables:
        predictor.tables[FORMS] = {
            words: kernel.features(MOST_POINTS if words == POINT_TO_POINT else MOST_FEATURES)
            for words, kernel in _kernels(predictor).items()
            if kernel.varies
        }
    forms: dict[str, FloatArray] = predictor.tables[FORMS]
    return forms


POINT_TO_POINT = "from point to point, different by direction"


def _kernels(predictor: Predictor) -> dict[str, Kernel]:
    """Every form in words -> its covariance."""
    data = predictor.data
    same_direction = linear_kernel(data.direction, 2)
    near = gaussian_kernel(coordinates(data.position, data.angles))
    place = np.concatenate([_centred(data.position / RANGE_POSITION), _centred(data.angles / RANGE_ANGLE)], axis=1)
    linear = linear_kernel(place)
    in_order = gaussian_kernel(np.linspace(0.0, 1.0, len(data))[:, None] / RANGE_ORDER)
    share = predictor.strut_columns()
    struts, lengths = linear_kernel(share), predictor.strut_lengths() / RANGE_LENGTH
    forms = {
        "smooth over the workspace": near,
        "smooth over the workspace, different by direction": near * same_direction,
        "linear over the workspace, different by direction": linear * same_direction,
        "curved over the workspace, different by direction": linear_kernel(place, 2) * same_direction,
        # By point: the same pose and tool, in all repeats.
        POINT_TO_POINT: same_kernel(data.point) * same_direction,
        "in the course of the campaign": in_order,
        "in the course of the campaign, different by direction": in_order * same_direction,
        "in the course of the campaign, over the workspace": in_order * linear * same_direction,
        "of single struts in the course of the campaign": struts * in_order,
        # Each strut's own variation, weighted by the strut's share of the compliance.
        "of single struts with their length": Kernel(
            lambda i: (share * share[i] * np.exp(-0.5 * (lengths - lengths[i]) ** 2)).sum(axis=1),
            (share**2).sum(axis=1),
        ),
        "of struts in tension against compression": linear_kernel(share * np.sign(predictor.strut_forces())),
        "of single struts over the workspace": struts * near,
    }
    columns = {"with the load": np.log(data.force), "with the tool length": data.tool_extension}
    if "time_min" not in data.missing:
        columns["with the time since zeroing"] = data.time
    if "temperature_C" not in data.missing:
        columns["with the temperature"] = data.temperature
    columns |= {f"with the column {name}": column for name, column in data.extra.items()}
    for words, column in columns.items():
        if np.isfinite(column).all() and np.ptp(column) > 0.0:
            product = linear_kernel(_centred(column[:, None] / float(np.ptp(column))))
            forms[words] = product
            forms[f"{words}, different by direction"] = product * same_direction
            forms[f"{words}, over the workspace"] = product * near * same_direction
    if len(set(data.setup.tolist())) > 1:
        forms["between set-ups, different by direction"] = same_kernel(data.setup) * same_direction
    return forms


def _centred(x: FloatArray) -> FloatArray:
    return np.asarray(x - x.mean(axis=0))


LEFT = 1e-10  # share of a covariance's variance that its features may leave


@dataclass(frozen=True)
class Kernel:
    """A covariance of n readings, given by its columns `column(i)` (n,) and its `diagonal` (n,)."""

    column: Callable[[int], FloatArray]
    diagonal: FloatArray

    def __mul__(self, other: Kernel) -> Kernel:
        """Elementwise product, which is a covariance too (Schur's product theorem)."""
        return Kernel(lambda i: self.column(i) * other.column(i), self.diagonal * other.diagonal)

    @property
    def varies(self) -> bool:
        """True if it is finite and not the same number throughout."""
        values, scale = np.concatenate([self.column(0), self.diagonal]), float(self.diagonal.mean())
        off = np.abs(values - self.diagonal[0]).max()
        return bool(np.isfinite(values).all() and scale > 1e-12 and off > 1e-9 * scale)

    def features(self, most: int) -> FloatArray:
        """(n, r) L with L L^T the covariance, scaled to a mean diagonal of 1.

        By Cholesky's factorisation with complete pivoting: features of the readings that are known least come first
        (Higham 2002, Accuracy and Stability of Numerical Algorithms, 10.3).
        """
        scale = float(self.diagonal.mean())
        left = self.diagonal / scale
        rows = np.empty((min(most, len(left)), len(left)))
        for r in range(len(rows)):
            pivot = int(np.argmax(left))
            if left.sum() <= LEFT * len(left) or left[pivot] <= 0.0:
                return rows[:r].T
            known = np.flatnonzero(rows[:r, pivot])  # few if only readings of one point correlate
            before = rows[:r] if len(known) == r else rows[known]
            rows[r] = (self.column(pivot) / scale - before[:, pivot] @ before) / np.sqrt(left[pivot])
            left = np.maximum(left - rows[r] ** 2, 0.0)
            left[pivot] = 0.0
        return rows.T


def gaussian_kernel(x: FloatArray) -> Kernel:
    """Smooth kernel in x (n, k), whose range is 1."""
    return Kernel(lambda i: np.exp(-0.5 * ((x - x[i]) ** 2).sum(axis=1)), np.ones(len(x)))


def linear_kernel(x: FloatArray, power: int = 1) -> Kernel:
    """Kernel linear in x (n, k), or a power of it."""
    return Kernel(lambda i: (x @ x[i]) ** power, (x**2).sum(axis=1) ** power)


def same_kernel(labels: AnyArray) -> Kernel:
    """Kernel that is 1 between readings with the same label (n,), otherwise 0."""
    return Kernel(lambda i: (labels == labels[i]).astype(float), np.ones(len(labels)))
