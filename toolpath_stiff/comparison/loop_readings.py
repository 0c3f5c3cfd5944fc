"""Readings of indicators beside the tip, compared with the model: measured and modelled give of each loop."""

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Covariance
from toolpath_stiff.readings.measurements import Readings

STANDS_OUT = 3.0  # standard deviations from which a loop's readings are said to differ from the model


@dataclass(frozen=True)
class LoopMean:
    """Mean of all readings of one loop, nm per N of load at the tip (of a strut alone: of force in it).

    Counted in the direction in which the machine file's struts would move it.
    """

    loop: str
    readings: int
    read_nm_per_N: float
    model_nm_per_N: float
    off_nm_per_N: float
    sd_nm_per_N: float
    standard_deviations: float
    text: str


def beside_tip(data: Readings, log_model: FloatArray, spread: Covariance) -> tuple[LoopMean, ...]:
    """Means of the readings beside the tip, one for each loop.

    Parameters
    ----------
    data
        n readings, of the tip or of loops.
    log_model
        (n,) ln(N/m) that they should show, loops with their offsets.
    spread
        Their covariance; of ln readings.
    """
    beside = data.beside
    if beside is None:
        return ()
    joined = np.exp(-log_model)
    read, model, sd = 1e9 * data.compliance, 1e9 * beside.alone(joined), 1e9 * np.sqrt(spread.diagonal) * joined
    means = []
    for name in dict.fromkeys(data.loop[beside.beside].tolist()):
        of_loop = data.loop == name
        weights = np.where(of_loop, 1.0 / sd**2, 0.0)
        toward = beside.toward * weights / weights.sum()
        error = 1e9 * float(np.sqrt(spread.squares(toward * joined)))
        count, mean, modelled = int(of_loop.sum()), float(toward @ read), float(toward @ model)
        ratio = float(toward @ (read - model)) / error
        text = f"{name}: {mean:.2f} nm/N read in the mean of {count}, {modelled:.2f} nm/N modelled"
        off = f": {abs(ratio):.1f} standard deviations {'more' if ratio > 0.0 else 'less'}"
        text += off if abs(ratio) >= STANDS_OUT else ", which agrees"
        means.append(LoopMean(name, count, mean, modelled, ratio * error, error, ratio, text))
    return tuple(means)
