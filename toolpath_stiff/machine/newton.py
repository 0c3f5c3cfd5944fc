"""Newton's method with bounded steps, many poses at a time."""

from collections.abc import Callable

import numpy as np

from toolpath_stiff.arrays import FloatArray

Equations = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
TOLERANCE, MOST_STEPS = 1e-12, 60  # of the residuals, m and rad; steps
DAMPING = 1e-9  # of the squared size of a jacobian: keeps steps finite where it is singular, without slowing others


def newton(equations: Equations, start: FloatArray, largest: FloatArray | float) -> FloatArray:
    """(n, k) unknowns at which residuals vanish, from a start (n, k); nan where it does not converge.

    `equations` gives residuals (n, m) and their slopes (n, m, k); a step is at most `largest`, in all or (k,).
    """
    values = start.copy()
    residual = np.empty((len(start), 0))
    for _ in range(MOST_STEPS):
        residual, slopes = equations(values)
        last = not (np.abs(residual).max(axis=1) > TOLERANCE).any()  # one more step reaches the last digits
        transposed = np.swapaxes(slopes, 1, 2)
        normal = transposed @ slopes
        size = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        normal = normal + DAMPING * (size + DAMPING) * np.eye(start.shape[1])
        step = np.linalg.solve(normal, transposed @ residual[..., None])[..., 0]
        values = values - step / np.maximum(1.0, np.abs(step / largest).max(axis=1))[:, None]
        if last:
            break
    good = np.abs(residual).max(axis=1) < 1e3 * TOLERANCE
    return np.where(good[:, None], values, np.nan)
