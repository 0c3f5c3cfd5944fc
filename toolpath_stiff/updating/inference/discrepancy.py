"""Forms that a discrepancy between model and readings may take when no effect of the catalogue describes it.

Each form is a covariance between readings, as of a Gaussian process (Kennedy and O'Hagan 2001, Bayesian calibration of
computer models): smooth over the workspace, different by direction, growing with the load, one strut's own affair, and
so on. They say that something is left in the residuals and where, never what.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.predict import Predictor

FloatArray = NDArray[np.float64]

# Ranges over which a smooth discrepancy stays alike; assumed: about half a workspace, half a tilting range, a few
# turns of a screw, a third of a campaign.
RANGE_POSITION, RANGE_ANGLE, RANGE_LENGTH, RANGE_ORDER = 0.25, np.radians(15.0), 0.05, 0.3


def discrepancy_forms(predictor: Predictor) -> dict[str, FloatArray]:
    """What a discrepancy may look like, in words -> covariance (n, n) with mean diagonal 1; only forms that vary."""
    data = predictor.data
    n = len(data)
    same_direction = (data.direction @ data.direction.T) ** 2
    near = np.exp(-0.5 * _squared(data.position / RANGE_POSITION))
    near = near * np.exp(-0.5 * _squared(data.angles / RANGE_ANGLE))
    place = np.concatenate([_centred(data.position / RANGE_POSITION), _centred(data.angles / RANGE_ANGLE)], axis=1)
    linear = place @ place.T
    order = np.linspace(0.0, 1.0, n)[:, None]
    in_order = np.exp(-0.5 * _squared(order / RANGE_ORDER))
    # Point by point: the same pose and tool, whatever the repeat.
    same_point = _same(data.point)
    forms = {
        "smooth over the workspace": near,
        "smooth over the workspace, different by direction": near * same_direction,
        "linear over the workspace, different by direction": linear * same_direction,
        "curved over the workspace, different by direction": linear**2 * same_direction,
        "from point to point, different by direction": same_point * same_direction,
        "in the course of the campaign": in_order,
        "in the course of the campaign, different by direction": in_order * same_direction,
        "in the course of the campaign, over the workspace": in_order * linear * same_direction,
    }
    share = predictor.strut_columns()
    lengths = predictor.strut_lengths()
    sign = np.sign(predictor.strut_forces())
    forms["of single struts in the course of the campaign"] = (share @ share.T) * in_order
    forms["of single struts with their length"] = sum(
        np.outer(share[:, i], share[:, i]) * np.exp(-0.5 * _squared(lengths[:, [i]] / RANGE_LENGTH)) for i in range(6)
    )
    forms["of struts in tension against compression"] = (share * sign) @ (share * sign).T
    forms["of single struts over the workspace"] = (share @ share.T) * near
    for name, words in (("force_N", "with the load"), ("tool_extension_mm", "with the tool length")):
        column = np.log(data.force) if name == "force_N" else data.tool_extension
        forms |= _by_column(column, words, same_direction, near)
    if "time_min" not in data.missing:
        forms |= _by_column(data.time, "with the time since zeroing", same_direction, near)
    if "temperature_C" not in data.missing:
        forms |= _by_column(data.temperature, "with the temperature", same_direction, near)
    for name, column in data.extra.items():
        forms |= _by_column(column, f"with the column {name}", same_direction, near)
    if len(set(data.setup.tolist())) > 1:
        forms["between set-ups, different by direction"] = _same(data.setup) * same_direction
    scaled = {}
    for name, form in forms.items():
        scale = float(np.trace(form)) / n
        if scale > 1e-12 and np.isfinite(form).all() and float(np.abs(form - form[0, 0]).max()) > 1e-9 * scale:
            scaled[name] = form / scale
    return scaled


def _by_column(column: FloatArray, words: str, same_direction: FloatArray, near: FloatArray) -> dict[str, FloatArray]:
    if not np.isfinite(column).all() or np.ptp(column) == 0.0:
        return {}
    centred = _centred(column[:, None] / float(np.ptp(column)))
    product = centred @ centred.T
    return {
        words: product,
        f"{words}, different by direction": product * same_direction,
        f"{words}, over the workspace": product * near * same_direction,
    }


def _squared(x: FloatArray) -> FloatArray:
    """(n, n) squared distances of rows."""
    return np.asarray(((x[:, None, :] - x[None, :, :]) ** 2).sum(axis=-1))


def _centred(x: FloatArray) -> FloatArray:
    return np.asarray(x - x.mean(axis=0))


def _same(labels: NDArray[np.str_]) -> FloatArray:
    return np.asarray(labels[:, None] == labels[None, :], dtype=float)
