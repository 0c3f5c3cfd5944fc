"""The scatter of the readings as matrices, with wild readings found out fit by fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.noise import Noise

FloatArray = NDArray[np.float64]

MOST_WILD = 0.05  # share of readings that may be taken for wild
NEVER = 1e12  # price of a wild reading where there are none


@dataclass(frozen=True)
class Scatter:
    """The noise as matrices, with some readings taken for wild.

    Attributes
    ----------
    inverse
        (n, n) inverse covariance of ln readings.
    log_determinant
        Of the covariance.
    widening
        (n,) variance that a wild reading adds.
    price
        Minus the log odds of a reading being wild.
    wild
        Readings taken for wild.
    """

    inverse: FloatArray
    log_determinant: float
    widening: FloatArray
    price: float
    wild: tuple[int, ...] = ()

    @classmethod
    def of(cls, noise: Noise, covariance: FloatArray) -> Scatter:
        """From a noise model and its covariance (n, n)."""
        from scipy.linalg import cho_factor, cho_solve

        factor = cho_factor(covariance, lower=True)
        inverse = cho_solve(factor, np.eye(len(covariance)))
        widening = (noise.outlier_width**2 - 1.0) * noise.repeat**2
        price = np.log((1.0 - noise.outliers) / noise.outliers) if noise.outliers > 0.0 else NEVER
        return cls(0.5 * (inverse + inverse.T), float(2.0 * np.log(np.diag(factor[0])).sum()), widening, float(price))

    def with_wild(self, residual: FloatArray) -> Scatter:
        """With those readings taken for wild whose widening pays its price at these residuals (n,)."""
        inverse, determinant, wild = self.inverse.copy(), self.log_determinant, list(self.wild)
        pull = inverse @ residual
        for _ in range(int(MOST_WILD * len(residual)) + 1):
            own = 1.0 + self.widening * np.diag(inverse)
            gain = self.widening * pull**2 / own - np.log(own) - 2.0 * self.price
            gain[wild] = -np.inf
            row = int(np.argmax(gain))
            if gain[row] <= 0.0:
                break
            column = inverse[:, row].copy()
            inverse -= np.outer(column, column) * (self.widening[row] / own[row])
            pull = pull - column * (self.widening[row] * pull[row] / own[row])
            determinant += float(np.log(own[row]))
            wild.append(row)
        return Scatter(inverse, determinant, self.widening, self.price, tuple(wild))

    def log_likelihood(self, residual: FloatArray) -> FloatArray:
        """(...,) of residuals (..., n), the price of wild readings included, without the constant n ln(2 pi) / 2."""
        squared = np.einsum("...i,...i->...", residual @ self.inverse, residual)
        return np.asarray(-0.5 * (squared + self.log_determinant) - len(self.wild) * self.price)
