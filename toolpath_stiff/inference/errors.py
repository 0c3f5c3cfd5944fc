"""Errors of a model over some readings, in figures and words."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray

AS_GIVEN, LAW_REFITTED = "as given", "strut law refitted"


def deviation_percent(residual: FloatArray) -> FloatArray:
    """(measured - modelled) / modelled in per cent from ln(measured / modelled); negative: softer than modelled."""
    return np.asarray(100.0 * np.expm1(residual))


def error_figures(residual: FloatArray) -> dict[str, float]:
    """Errors of a model in per cent from residuals ln(measured / modelled).

    Mean and rms of |modelled - measured| / measured, as the paper counts it; `bias_percent` is the mean of
    (measured - modelled) / modelled, minus: softer than modelled.
    """
    error = np.expm1(-residual)
    return {
        "mean_abs_error_percent": 100.0 * float(np.abs(error).mean()),
        "bias_percent": float(deviation_percent(residual).mean()),
        "rms_percent": 100.0 * float(np.sqrt((error**2).mean())),
    }


def errors_text(as_given: float, refitted: float | None, rest: Sequence[tuple[str, float]] = ()) -> str:
    """Mean errors (%) step by step: "as given 4.60 %, strut law refitted 3.73 %, with weak_strut 2.32 %"."""
    law = [] if refitted is None else [(LAW_REFITTED, refitted)]
    return ", ".join(f"{name} {value:.2f} %" for name, value in [(AS_GIVEN, as_given), *law, *rest])


def scatter_text(floor: float, error: float, guess: str = "") -> str:
    """Words on the part of a mean error (%) that is scatter, or that it is unknown if a `guess` exceeds the error."""
    if guess and floor > error:
        return f"these data do not tell how much of it is scatter (the {guess} guess alone would leave {floor:.2f} %)"
    return f"scatter alone leaves {floor:.2f} %" + (f" ({guess} guess)" if guess else "")


def raised_text(as_given: float, refitted: float) -> str:
    """Sentence on why refitting the strut law raised the mean error (%); "" if it did not."""
    if f"{refitted:.2f}" == f"{as_given:.2f}" or not refitted > as_given:
        return ""
    return (
        f"refitting the strut law raises the mean error from {as_given:.2f} to {refitted:.2f} %: it makes the readings "
        "likelier, which trusts those less that scatter more or lie far off; the mean error counts all alike"
    )
