"""The question whether readings are of this machine at all."""

from __future__ import annotations

import numpy as np

from toolpath_stiff.inference.evidence import LAW_PRIOR
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.size_priors import EXPECTED

FACTOR = float(np.exp(4.0 * LAW_PRIOR))  # of the median reading to the model: four standard deviations of the strut law


# Correlation of ln measured with ln modelled below which the readings do not follow the model. Hidden effects that
# change the stiffness by 30 % leave 0.8 and more, readings of other machines or in another order 0.3 and less.
FOLLOWS = 0.5


NOTHING = 1e-6  # of the model's own variation: less is rounding


TELLS = EXPECTED[1]  # sd of ln modelled over the readings from which it is asked: as large as the largest effect


FEWEST_FOLLOWING = 6  # readings that differ in what mechanics sees


def question(predictor: Predictor) -> str:
    """Whether these are readings of this machine, with the reason to ask; "" where there is none."""
    reason = _unlike(predictor)
    return f"Are these readings of this machine? {reason}." if reason else ""


def _unlike(predictor: Predictor) -> str:
    """In what the readings are unlike the model's, a sentence without its full stop; "" where they may be its own."""
    tip = predictor.data.tip
    model, which = predictor.log_stiffness()[tip], np.unique(predictor.distinct[tip], return_inverse=True)[1]
    residual = np.log(predictor.data.stiffness[tip]) - model
    if not np.isfinite(residual).all():
        return ""
    ratio = float(np.exp(np.median(residual)))
    if not 1.0 / FACTOR < ratio < FACTOR:
        times = f"{ratio:.2g} times" if ratio > 1.0 else f"1 / {1.0 / ratio:.2g} of"
        return f"The median reading is {times} what the model says"
    count = np.bincount(which)
    modelled = np.bincount(which, weights=model) / count
    measured = modelled + np.bincount(which, weights=residual) / count
    if len(count) < FEWEST_FOLLOWING or float(modelled.std()) < TELLS:
        return ""
    spread = float(measured.std())
    centred = (measured - measured.mean()) @ (modelled - modelled.mean()) / len(count)
    correlation = float(centred) / (spread * float(modelled.std())) if spread > NOTHING * float(modelled.std()) else 0.0
    if correlation >= FOLLOWS:
        return ""
    if correlation == 0.0:
        return "The readings are all alike, where the model says that they differ"
    return (
        f"They do not follow the model from pose to pose and direction to direction: the correlation of "
        f"their logarithms is {correlation:.2f}, of this machine it would be {FOLLOWS:g} or more"
    )
