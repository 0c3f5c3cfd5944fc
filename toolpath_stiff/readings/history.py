"""Struts measured alone again and again: which changed, when, at once or slowly; tension against compression."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import certain
from toolpath_stiff.readings.strut_series import (
    FEWEST_DIFFERENCES,
    MOUNTING,
    RESOLUTION,
    SURE,
    Change,
    DateScatter,
    Kind,
    Series,
    StrutReadings,
    chance_of_t,
    changes_of,
    series_of,
)

# Relative sd, the same on all dates, of a difference of tension and compression; assumed: load cell, indicator and
# friction are not alike on both sides of zero.
BOTH_SIDES = 0.01


LEAST_TOLD = 1e-4  # probability: further digits than simulations have would say nothing


@dataclass(frozen=True)
class StrutChange:
    """A change of a strut; of a step the dates are those between which it lies (95 %)."""

    kind: Kind
    after: str
    before: str
    change_percent: float
    low_percent: float
    high_percent: float
    percent_per_year: float | None
    from_N_per_mm: float
    to_N_per_mm: float
    p: float
    text: str


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
class DateMean:
    """The mean of one date."""

    date: str
    day: float
    stiffness_N_per_mm: float
    readings: int


@dataclass(frozen=True)
class StrutOverTime:
    """One strut; `judged_on`: what its dates were compared by, as "secant"; "" of readings that are not raw records."""

    strut: str
    readings: int
    stiffness_N_per_mm: float
    scatter_percent: float | None
    drift_percent_per_year: float | None
    drift_sd_percent_per_year: float | None
    smallest_step_percent: float | None
    dates: list[DateMean]
    changes: list[StrutChange]
    wild_dates: list[str]
    sides: StrutSides | None
    judged_on: str
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
        texts = [
            (strut.text, strut.sides.text if strut.sides and strut.sides.p < SURE else "") for strut in self.struts
        ]
        return [text for both in texts for text in both if text]


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
    dated = [strut for strut in series if len(strut.day) > 1]
    scatter = DateScatter.of(dated, seed)
    struts = [_strut(strut, scatter, readings, compared.get(strut.name)) for strut in series]
    written: StrutHistory = certain(
        StrutHistory(100.0 * scatter.sd if dated else None, scatter.source if dated else "", struts)
    )
    return written


def _strut(series: Series, scatter: DateScatter, readings: StrutReadings, sides: StrutSides | None) -> StrutOverTime:
    """What is said of one strut."""
    n, name = len(series.day), series.name.replace(" alone", "")
    rows = readings.strut == series.name
    ln = series.mean if n else readings.log_stiffness[rows]
    raw_changes, wild = changes_of(series.day, series.mean, scatter)
    changes = [_change(change, readings.text) for change in raw_changes]
    sentences = [f"{name} {change.text}" for change in changes]
    sentences += [f"{name}: {readings.text(day)} stands out alone: measure again" for day in wild]
    slope = sd = least = None
    if n > 1:
        slope, sd = (100.0 * figure for figure in series.slope(scatter.sd))
        least = 100.0 * float(np.expm1(scatter.smallest_step(n)))
        if not changes:
            sentences.append(f"{name}: no change found in {n} dates; a step of {least:.2g} % halfway would show")
    return StrutOverTime(
        strut=series.name,
        readings=int(series.count.sum()) if n else int(rows.sum()),
        stiffness_N_per_mm=_n_per_mm(ln.mean()),
        scatter_percent=100.0 * float(ln.std(ddof=1)) if len(ln) > 1 else None,
        drift_percent_per_year=slope,
        drift_sd_percent_per_year=sd,
        smallest_step_percent=least,
        dates=[
            DateMean(readings.text(day), float(day - series.day[0]), _n_per_mm(mean), int(count))
            for day, mean, count in zip(series.day, series.mean, series.count, strict=True)
        ],
        changes=changes,
        wild_dates=[readings.text(day) for day in wild],
        sides=sides,
        judged_on="",
        text="; ".join(sentences),
    )


def _n_per_mm(ln: float) -> float:
    return 1e-3 * float(np.exp(ln))


def _change(change: Change, text: Callable[[float], str]) -> StrutChange:
    """A change in words; `text` writes a day."""
    size = change.ends[1] - change.ends[0]
    share, low, high = (100.0 * float(np.expm1(v)) for v in (size, size - 1.96 * change.sd, size + 1.96 * change.sd))
    (after, before), (first, last) = map(text, change.days), map(_n_per_mm, change.ends)
    a_year = None if change.slope is None else 100.0 * float(np.expm1(change.slope))
    way = "softer" if share < 0.0 else "stiffer"
    if change.kind == "drift":
        words = f"grew {way} by {abs(a_year or 0.0):.2g} % a year from {after} to {before}"
    else:
        words = f"became {abs(share):.2g} % {way} between {after} and {before}"
        words += " (95 %)" if change.kind == "step" else "; at once or slowly is not told"
    words += f": {first:,.0f} to {last:,.0f} N/mm ({_chance_text(change.p)})"
    return StrutChange(change.kind, after, before, share, low, high, a_year, first, last, change.p, words)


def _chance_text(p: float) -> str:
    return f"p = {p:.2g}" if p >= LEAST_TOLD else f"p < {LEAST_TOLD:g}"


def _sides(readings: StrutReadings) -> dict[str, StrutSides]:
    """Strut -> tension against compression, of those measured under both: the mean of dates' differences."""
    compared: dict[str, tuple[FloatArray, float]] = {}  # differences, and ln stiffness in the middle
    for name in sorted(set(readings.strut.tolist())):
        rows = readings.strut == name
        # Readings without a date are a group of their own.
        day = np.nan_to_num(np.floor(readings.day[rows]), nan=-np.inf)
        ln, side = readings.log_stiffness[rows], readings.side[rows]
        pulled, pushed = side > 0.0, side < 0.0
        if not (pulled.any() and pushed.any()):
            continue
        both = [d for d in np.unique(day) if (pulled & (day == d)).any() and (pushed & (day == d)).any()]
        groups = [day == d for d in both] or [np.ones(len(day), dtype=bool)]
        apart = np.array([ln[pulled & group].mean() - ln[pushed & group].mean() for group in groups])
        compared[name] = apart, 0.5 * (float(ln[pulled].mean()) + float(ln[pushed].mean()))
    freedom = sum(len(apart) - 1 for apart, _ in compared.values())
    if freedom >= FEWEST_DIFFERENCES:
        squares = sum(float(((apart - apart.mean()) ** 2).sum()) for apart, _ in compared.values())
        of_date = max((squares / freedom) ** 0.5, RESOLUTION)
    else:
        of_date, freedom = MOUNTING * 2.0**0.5, 10**6
    entries = {}
    for name, (apart, middle) in compared.items():
        sd, mean = float(np.hypot(of_date / len(apart) ** 0.5, BOTH_SIDES)), float(apart.mean())
        p = min(1.0, len(compared) * chance_of_t(abs(mean) / sd, freedom))
        tension, compression = (_n_per_mm(middle + sign * 0.5 * mean) for sign in (1.0, -1.0))
        share, strut = 100.0 * float(np.expm1(mean)), name.replace(" alone", "")
        numbers = f"{tension:,.0f} against {compression:,.0f} N/mm"
        text = f"{strut} is alike in tension and compression: {numbers}"
        if p < SURE:
            way = f"{abs(share):.2g} % {'softer' if share < 0.0 else 'stiffer'}"
            text = f"{strut} is {way} in tension than in compression: {numbers} ({_chance_text(p)})"
        entries[name] = StrutSides(tension, compression, share, 100.0 * sd, p, text)
    return entries
