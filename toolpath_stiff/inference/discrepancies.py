"""Forms that a discrepancy may take which no effect describes."""

from __future__ import annotations

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.kernels import Kernel, gaussian_kernel, linear_kernel, same_kernel
from toolpath_stiff.inference.prediction import Predictor

# Ranges over which a smooth discrepancy stays alike; assumed: about half a workspace, half a tilting range, a few
# turns of a screw, a third of a campaign.
RANGE_POSITION, RANGE_ANGLE, RANGE_LENGTH, RANGE_ORDER = 0.25, np.radians(15.0), 0.05, 0.3


# Features of a form, and of the one that has one for each point and direction: what varies faster is left out.
MOST_FEATURES, MOST_POINTS = 300, 2000


def discrepancy_forms(predictor: Predictor) -> dict[str, FloatArray]:
    """What a discrepancy may look like, in words -> features (n, r) of its covariance; only forms that vary.

    Worked out once for a set of readings.
    """
    key = ("forms of discrepancy",)
    if key not in predictor.tables:
        kernels = {words: kernel for words, kernel in _kernels(predictor).items() if kernel.varies}
        predictor.tables[key] = {
            words: kernel.features(MOST_POINTS if words == POINT_TO_POINT else MOST_FEATURES)
            for words, kernel in kernels.items()
        }
    forms: dict[str, FloatArray] = predictor.tables[key]
    return forms


POINT_TO_POINT = "from point to point, different by direction"


def _kernels(predictor: Predictor) -> dict[str, Kernel]:
    """Every form in words, and its covariance."""
    data = predictor.data
    same_direction = linear_kernel(data.direction, 2)
    near = gaussian_kernel(np.concatenate([data.position / RANGE_POSITION, data.angles / RANGE_ANGLE], axis=1))
    place = np.concatenate([_centred(data.position / RANGE_POSITION), _centred(data.angles / RANGE_ANGLE)], axis=1)
    linear = linear_kernel(place)
    in_order = gaussian_kernel(np.linspace(0.0, 1.0, len(data))[:, None] / RANGE_ORDER)
    share = predictor.strut_columns()
    struts = linear_kernel(share)
    forms = {
        "smooth over the workspace": near,
        "smooth over the workspace, different by direction": near * same_direction,
        "linear over the workspace, different by direction": linear * same_direction,
        "curved over the workspace, different by direction": linear_kernel(place, 2) * same_direction,
        # Point by point: the same pose and tool, whatever the repeat.
        POINT_TO_POINT: same_kernel(data.point) * same_direction,
        "in the course of the campaign": in_order,
        "in the course of the campaign, different by direction": in_order * same_direction,
        "in the course of the campaign, over the workspace": in_order * linear * same_direction,
        "of single struts in the course of the campaign": struts * in_order,
        "of single struts with their length": _by_length(share, predictor.strut_lengths() / RANGE_LENGTH),
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
        forms |= _by_column(column, words, same_direction, near)
    if len(set(data.setup.tolist())) > 1:
        forms["between set-ups, different by direction"] = same_kernel(data.setup) * same_direction
    return forms


def _by_length(share: FloatArray, length: FloatArray) -> Kernel:
    """Each strut's own course over its length (n, 6), as far as the strut has a share (n, 6) in the compliance."""
    return Kernel(
        lambda i: (share * share[i] * np.exp(-0.5 * (length - length[i]) ** 2)).sum(axis=1), (share**2).sum(axis=1)
    )


def _by_column(column: FloatArray, words: str, same_direction: Kernel, near: Kernel) -> dict[str, Kernel]:
    if not np.isfinite(column).all() or np.ptp(column) == 0.0:
        return {}
    product = linear_kernel(_centred(column[:, None] / float(np.ptp(column))))
    return {
        words: product,
        f"{words}, different by direction": product * same_direction,
        f"{words}, over the workspace": product * near * same_direction,
    }


def _centred(x: FloatArray) -> FloatArray:
    return np.asarray(x - x.mean(axis=0))
