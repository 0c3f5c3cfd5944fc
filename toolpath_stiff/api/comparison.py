"""The machine as its file has it, against measurements."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.compare import compare as compare_readings
from toolpath_stiff.hints import hint
from toolpath_stiff.options import checked
from toolpath_stiff.results import Progress, teller

if TYPE_CHECKING:
    pass


from toolpath_stiff.api.measurements import Data, NoisePercent, Question, Seed, StrutSpread


@checked
def compare(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> Comparison:
    """See where the model fails: the machine as its file has it, against measurements.

    Parameters
    ----------
    data, machine
        The machine; measurements, or the files that hold them.
    columns
        Which columns the files call otherwise: "stiffness=stiff_mean:N/um", or such a dict.
    noise_percent
        Standard deviation of one reading, re-clamping included; or of the reading alone and of a clamping. Unless
        given, from repeats, else from the column sd_N_per_mm, else a low and a high guess.
    strut_spread_percent
        Standard deviation of the struts' stiffness.
    seed
        Of every random draw.
    progress
        Called with what is being done.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; the model has no stiffness at a measured pose.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.compare("nist-table1", "nist", noise_percent=5)
    <Comparison: nist, mean error 9.62 %>
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    teller(progress)("comparing")
    comparison = compare_readings(question.model, question.readings, **question.common)
    following = hint("which effect would explain it", question.request.command("diagnose"))
    return replace(comparison, inputs=question.inputs, summary=replace(comparison.summary, next=(following,)))
