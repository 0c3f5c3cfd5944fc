"""Struts measured alone again and again: which changed, when, at once or slowly; tension against compression."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.documents import certain
from toolpath_stiff.readings.dates import date_text
from toolpath_stiff.readings.strut_series import (
    FEWEST_DIFFERENCES,
    MOUNTING,
    RESOLUTION,
    SURE,
    DateScatter,
    StrutChange,
    StrutReadings,
    chance_text,
    changes_of,
    n_per_mm,
    series_of,
    slope_of,
)

# Relative sd, the same on all dates, of a difference of tension and compression; assumed: load cell, indicator and
# friction are not alike on both sides of zero.
BOTH_SIDES = 0.01


@dataclass(frozen=True)
class StrutSides:
    """Tension against compression; `difference_percent` is tension less compression."""

    tension_N_per_mm: float
    compression_N_per_mm: float
    difference_percent: float
    sd_percent: float
    p: float
    text: str


@dataclass(frozen=True)
class StrutOverTime:
    """One strut; `dates`: N/mm in the mean of each."""

    strut: str
    readings: int
    stiffness_N_per_mm: float
    scatter_percent: float | None
    drift_percent_per_year: float | None
    drift_sd_percent_per_year: float | None
    dates: dict[str, float]
    changes: list[StrutChange]
    wild_dates: list[str]
    sides: StrutSides | None
    text: str


@dataclass(frozen=True)
class StrutHistory:
    """Struts measured alone over the dates; `struts` is empty where there are none."""

    scatter_percent: float | None = None
    scatter_from: str = ""
    struts: Sequence[StrutOverTime] = ()

    @property
    def sentences(self) -> list[str]:
        """Strut by strut: changes or none, and tension against compression where they differ."""
        texts = [(strut.text, strut.sides) for strut in self.struts]
        both = [(text, sides.text if sides and sides.p < SURE else "") for text, sides in texts]
        return [text for pair in both for text in pair if text]


def history(readings: StrutReadings, sides: StrutReadings | None = None, seed: int = 0) -> StrutHistory:
    """What readings of struts alone say of time and of the sign of the force.

    Parameters
    ----------
    readings
        n of them, in any order.
    sides
        Those that tell tension from compression, if they are others: slopes of both sides of one record.
    seed
        Of the simulated series.

    Examples
    --------
    >>> day = np.arange(12.0) * 30.0
    >>> ln = np.log(40e6) + np.where(day < 200.0, 0.0, -0.12) + 0.002 * np.sin(7.0 * day)
    >>> struts = history(StrutReadings(np.full(12, "strut 3 alone"), day, ln, np.zeros(12))).struts
    >>> [(change.kind, change.after, change.before) for change in struts[0].changes]
    [('step', '1970-06-30', '1970-07-30')]
    """
    if not len(readings.strut):
        return StrutHistory()
    compared, series = _sides(readings if sides is None else sides), series_of(readings)
    dated = [strut for strut in series.values() if len(strut.dates) > 1]
    scatter = DateScatter.of(dated, seed)
    struts = [_strut(name, strut, scatter, compared.get(name)) for name, strut in series.items()]
    written: StrutHistory = certain(StrutHistory(100.0 * scatter.sd if dated else None, scatter.source, struts))
    return written


def _strut(strut: str, series: StrutReadings, scatter: DateScatter, sides: StrutSides | None) -> StrutOverTime:
    """What is said of one strut."""
    n, name = len(series.dates), strut.replace(" alone", "")
    levels = series.means if n else series.log_stiffness
    changes, wild = changes_of(series.dates, series.means, scatter)
    sentences = [f"{name} {change.text}" for change in changes]
    sentences += [f"{name}: {date_text(day)} stands out alone: measure again" for day in wild]
    slope = sd = None
    if n > 1:
        slope, sd = (100.0 * figure for figure in slope_of(series.dates, series.means, scatter.sd))
        if not changes:
            least = 100.0 * math.expm1(scatter.smallest_step(n))
            sentences.append(f"{name}: no change found in {n} dates; a step of {least:.2g} % halfway would show")
    return StrutOverTime(
        strut=strut,
        readings=sum(map(len, series.of_dates)) if n else len(levels),
        stiffness_N_per_mm=n_per_mm(levels.mean()),
        scatter_percent=100.0 * float(levels.std(ddof=1)) if len(levels) > 1 else None,
        drift_percent_per_year=slope,
        drift_sd_percent_per_year=sd,
        dates={date_text(day): n_per_mm(mean) for day, mean in zip(series.dates, series.means, strict=True)},
        changes=changes,
        wild_dates=[date_text(day) for day in wild],
        sides=sides,
        text="; ".join(sentences),
    )


def _sides(readings: StrutReadings) -> dict[str, StrutSides]:
    """Strut -> tension against compression, of those measured under both: the mean of dates' differences."""
    from scipy.special import stdtr

    apart, middle = {}, {}
    for name, strut in readings.by_strut().items():
        pulled, pushed = (strut.log_stiffness[sign * strut.side > 0.0] for sign in (1.0, -1.0))
        if len(pulled) and len(pushed):
            by_date = strut.sides_apart()
            apart[name] = by_date if len(by_date) else np.array([pulled.mean() - pushed.mean()])
            middle[name] = 0.5 * float(pulled.mean() + pushed.mean())
    sd_of_date, freedom = MOUNTING * 2.0**0.5, 10**6
    differences = sum(len(by_date) - 1 for by_date in apart.values())
    if differences >= FEWEST_DIFFERENCES:
        squares = sum(float(((by_date - by_date.mean()) ** 2).sum()) for by_date in apart.values())
        sd_of_date, freedom = max((squares / differences) ** 0.5, RESOLUTION), differences
    entries = {}
    for name, by_date in apart.items():
        sd, mean = float(np.hypot(sd_of_date / len(by_date) ** 0.5, BOTH_SIDES)), float(by_date.mean())
        p = min(1.0, len(apart) * 2.0 * float(stdtr(freedom, -abs(mean) / sd)))
        tension, compression = (n_per_mm(middle[name] + sign * 0.5 * mean) for sign in (1.0, -1.0))
        numbers = f"{tension:,.0f} against {compression:,.0f} N/mm"
        share, title = 100.0 * math.expm1(mean), name.replace(" alone", "")
        text = f"{title} is alike in tension and compression: {numbers}"
        if p < SURE:
            way = f"{abs(share):.2g} % {'softer' if share < 0.0 else 'stiffer'}"
            text = f"{title} is {way} in tension than in compression: {numbers} ({chance_text(p)})"
        entries[name] = StrutSides(tension, compression, share, 100.0 * sd, p, text)
    return entries
