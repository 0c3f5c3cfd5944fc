"""Struts measured alone repeatedly: which changed, when, suddenly or slowly; tension against compression.

Each strut is a series of ln stiffness over the dates: one mean a date, since what is mounted anew for a date moves all
its readings together. Against a stiffness that stays the same stand a step between two dates (a mean before and one
after, Worsley 1979, Journal of the American Statistical Association 74, 365) and a straight drift. The statistic is the
largest |t| over struts, places of the step and drift; the price of looking at so many is its distribution in series
of mere noise on the same dates, simulated. A step is told from a drift by their marginal likelihoods (Kass and Raftery
1995, Journal of the American Statistical Association 90, 773), one that is found splits its series and both parts are
looked at again.

Scatter from date to date comes from differences of successive dates (von Neumann 1941, Annals of Mathematical
Statistics 12, 367), the largest of each strut left out, so that neither steps nor drift count as scatter; with few
dates it is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, FloatArray, TextArray
from toolpath_stiff.documents import certain
from toolpath_stiff.readings.dates import date_text

SURE = 0.05  # probability, over all struts and places, below which a change is reported
LEAST_TOLD = 1e-4  # smallest probability reported: more digits than the simulations support mean nothing
DRAWS = 2000  # simulated sets of series
FEWEST_DIFFERENCES = 6  # fewest differences, of all struts, from which the scatter is estimated
TRIMMED = 0.2  # of a strut's differences, at least one
MOUNTING = 0.02  # relative sd from date to date where the data cannot say; assumed: mounting, load cell, indicator
RESOLUTION = 1e-4  # relative; no scatter is believed to be less: rounding of the readings; assumed
SIZE = 0.1  # prior sd of a change of ln stiffness; assumed, for step and drift alike
DECISIVE = math.log(20.0)  # log ratio of marginal likelihoods, Kass and Raftery's "strong"
A_SIDE = 2  # dates on either side of a step, from `SHORT` dates up
SHORT = 4
WILD = 4.0  # standard deviations from the median of the others at which one date alone makes a change
CREDIBLE = 0.95
DAYS_PER_YEAR = 365.25  # Julian year
# Relative sd, the same on all dates, of a difference of tension and compression; assumed: load cell, indicator and
# friction are not alike on both sides of zero.
BOTH_SIDES = 0.01


@dataclass(frozen=True)
class StrutReadings(ArrayColumns):
    """n readings of struts alone.

    Attributes
    ----------
    strut
        (n,) which strut, by name.
    day
        (n,) days since 1970-01-01; nan without a date.
    log_stiffness
        (n,) ln(N/m), at one length or reduced to one.
    side
        (n,) 1 of tension, -1 of compression, 0 of both or unknown.
    """

    strut: TextArray
    day: FloatArray
    log_stiffness: FloatArray
    side: FloatArray

    def by_strut(self) -> dict[str, StrutReadings]:
        """Strut -> its readings."""
        return {name: self.take(self.strut == name) for name in sorted(set(self.strut.tolist()))}

    @cached_property
    def dates(self) -> FloatArray:
        """(dates,) days with readings, ascending."""
        return np.unique(np.floor(self.day[np.isfinite(self.day)]))

    @cached_property
    def of_dates(self) -> list[FloatArray]:
        """Ln stiffness of the readings of each date."""
        return [self.log_stiffness[np.floor(self.day) == date] for date in self.dates]

    @cached_property
    def means(self) -> FloatArray:
        """(dates,) mean ln stiffness."""
        return np.array([logs.mean() for logs in self.of_dates])

    def sides_apart(self) -> FloatArray:
        """(dates,) ln stiffness in tension less compression, for each date with both; undated readings are one date."""
        day = np.nan_to_num(np.floor(self.day), nan=-np.inf)
        sides = [[self.log_stiffness[(day == d) & (self.side * s > 0)] for s in (1, -1)] for d in np.unique(day)]
        return np.array([pulled.mean() - pushed.mean() for pulled, pushed in sides if len(pulled) and len(pushed)])


@dataclass(frozen=True)
class StrutChange:
    """A change of a strut: "step", "drift" or "step or drift"; a step lies between the dates (95 %)."""

    kind: str
    after: str
    before: str
    change_percent: float
    low_percent: float
    high_percent: float
    from_N_per_mm: float
    to_N_per_mm: float
    p: float
    text: str

    @classmethod
    def of(
        cls, kind: str, days: Sequence[float], ends: Sequence[float], sd: float, p: float, slope: float = 0.0
    ) -> StrutChange:
        """Change with ln stiffness at both ends and the sd of their difference; `slope` of ln stiffness a year."""
        size = ends[1] - ends[0]
        share, low, high = (100.0 * math.expm1(ln) for ln in (size, size - 1.96 * sd, size + 1.96 * sd))
        (after, before), (first, last) = map(date_text, days), map(n_per_mm, ends)
        way = "softer" if share < 0.0 else "stiffer"
        if kind == "drift":
            words = f"grew {way} by {abs(100.0 * math.expm1(slope)):.2g} % a year from {after} to {before}"
        else:
            words = f"became {abs(share):.2g} % {way} between {after} and {before}"
            words += " (95 %)" if kind == "step" else "; at once or slowly is not told"
        words += f": {first:,.0f} to {last:,.0f} N/mm ({chance_text(p)})"
        return cls(kind, after, before, share, low, high, first, last, p, words)


def n_per_mm(ln: float) -> float:
    """N/mm of a ln(N/m)."""
    return 1e-3 * float(np.exp(ln))


def chance_text(p: float) -> str:
    """A probability in words."""
    return f"p = {p:.2g}" if p >= LEAST_TOLD else f"p < {LEAST_TOLD:g}"


def series_of(readings: StrutReadings) -> dict[str, StrutReadings]:
    """Series of each strut; one for each side where tension and compression never share a date."""
    series = {}
    for name, strut in readings.by_strut().items():
        apart, pulled, pushed = strut.sides_apart(), strut.side > 0.0, strut.side < 0.0
        if len(apart) or not (pulled.any() and pushed.any() and len(strut.dates)):
            mean = 0.5 * strut.side * float(apart.mean()) if len(apart) else 0.0
            series[name] = replace(strut, log_stiffness=strut.log_stiffness - mean)
        else:
            series |= {f"{name} in tension": strut.take(~pushed), f"{name} in compression": strut.take(pushed)}
    return series


@dataclass(frozen=True)
class DateScatter:
    """Scatter of the means of dates, and the distribution of the largest |t| under mere noise.

    Attributes
    ----------
    sd, source
        Relative; where it comes from, in words.
    largest
        (draws,) of simulated sets, rising.
    """

    sd: float
    source: str
    largest: FloatArray

    @classmethod
    def of(cls, series: Sequence[StrutReadings], seed: int) -> DateScatter:
        """Scatter of all series together, each with two dates or more."""
        if not series:
            return cls(MOUNTING, "", np.zeros(1))
        rng = np.random.default_rng(seed)
        peak, squares, kept = np.zeros(DRAWS), np.zeros(DRAWS), 0
        for strut in series:
            noise = rng.standard_normal((DRAWS, len(strut.dates)))
            peak = np.maximum(peak, np.abs(noise @ _contrasts(strut.dates)).max(axis=1))
            left = _trimmed(np.diff(noise, axis=1))
            squares, kept = squares + left.sum(axis=1), kept + left.shape[1]
        # Scatter of one reading within its date; 0 without repeats.
        of_dates = [logs for strut in series for logs in strut.of_dates]
        repeat = sum(float(logs.var()) * len(logs) for logs in of_dates)
        freedom = max(sum(len(logs) - 1 for logs in of_dates), 1)
        of_mean = (repeat / freedom) ** 0.5 / np.mean([len(logs) for logs in of_dates]) ** 0.5
        if kept < FEWEST_DIFFERENCES:
            sd = float(np.hypot(MOUNTING, of_mean))
            return cls(sd, f"{100 * MOUNTING:g} % from date to date assumed: too few dates to tell", np.sort(peak))
        scale = np.sqrt(squares / kept)
        usual = float(np.median(scale))  # sd of 1 as estimated without the largest differences
        measured = sum(float(_trimmed(np.diff(strut.means)).sum()) for strut in series)
        sd = max(np.sqrt(measured / kept) / usual, of_mean, RESOLUTION)
        return cls(float(sd), "differences of successive dates", np.sort(peak / scale * usual))

    def probability(self, day: FloatArray, ln: FloatArray) -> float:
        """Probability that noise alone shows as large a |t| as this series (Davison and Hinkley 1997, 4.2.3)."""
        ratio = float(np.abs(ln @ _contrasts(day)).max() / self.sd)
        return (1 + len(self.largest) - int(np.searchsorted(self.largest, ratio))) / (1 + len(self.largest))

    def smallest_step(self, dates: int) -> float:
        """Smallest detectable step of ln stiffness, halfway through this number of dates."""
        limit = float(np.quantile(self.largest, 1.0 - SURE))
        return limit * self.sd * math.sqrt(1.0 / (dates // 2) + 1.0 / (dates - dates // 2))


def changes_of(day: FloatArray, ln: FloatArray, scatter: DateScatter) -> tuple[list[StrutChange], list[float]]:
    """Changes of a series (n,) in order of time, and days that stand out alone."""
    p = scatter.probability(day, ln) if len(day) > 1 else 1.0
    if p >= SURE:
        return [], []
    lone = _lone(day, ln, scatter)
    if lone is not None:
        changes, wild = changes_of(np.delete(day, lone), np.delete(ln, lone), scatter)
        return changes, sorted([float(day[lone]), *wild])
    step, drift = _evidence(day, ln, scatter.sd)
    weights = np.exp(step - step.max())
    odds = float(step.max()) + float(np.log(weights.mean())) - drift
    if odds < DECISIVE:
        slope, sd = slope_of(day, ln, scatter.sd)
        ends = [float(ln.mean() + slope * (d - day.mean()) / DAYS_PER_YEAR) for d in (day[0], day[-1])]
        kind = "drift" if -odds >= DECISIVE else "step or drift"
        return [StrutChange.of(kind, day[[0, -1]].tolist(), ends, sd * np.ptp(day) / DAYS_PER_YEAR, p, slope)], []
    places = np.array(_places(len(day)))
    place = int(places[np.argmax(step)])
    before, wild_before = changes_of(day[:place], ln[:place], scatter)
    after, wild_after = changes_of(day[place:], ln[place:], scatter)
    # The fewest places that hold 95 % of the probability, with equal priors.
    order = np.argsort(-weights, kind="stable")
    held = np.cumsum(weights[order]) / weights.sum()
    likely = places[np.sort(order[: int(np.searchsorted(held, CREDIBLE)) + 1])]
    days, levels = (day[likely[0] - 1], day[likely[-1]]), (ln[:place].mean(), ln[place:].mean())
    sd = scatter.sd * (1.0 / place + 1.0 / (len(day) - place)) ** 0.5
    return [*before, StrutChange.of("step", days, levels, sd, p), *after], [*wild_before, *wild_after]


def slope_of(day: FloatArray, ln: FloatArray, sd: float) -> tuple[float, float]:
    """Slope of ln stiffness a year, with its sd."""
    years = (day - day.mean()) / DAYS_PER_YEAR
    return float(years @ ln / (years @ years)), float(sd / (years @ years) ** 0.5)


def _trimmed(steps: FloatArray) -> FloatArray:
    """(..., kept) squares of differences of successive dates, without the largest."""
    squares = np.sort(0.5 * steps**2, axis=-1)
    return squares[..., : squares.shape[-1] - max(1, round(TRIMMED * squares.shape[-1]))]


def _places(n: int) -> range:
    """Possible numbers of dates before a step."""
    side = A_SIDE if n >= SHORT else 1
    return range(side, n - side + 1)


def _shapes(day: FloatArray) -> FloatArray:
    """(n, m) shapes less their means: every step as 0 and 1, then the drift from 0 to 1."""
    steps = [(np.arange(len(day)) >= place).astype(float) for place in _places(len(day))]
    shapes = np.stack([*steps, (day - day[0]) / (day[-1] - day[0])], axis=1)
    return np.asarray(shapes - shapes.mean(axis=0))


def _contrasts(day: FloatArray) -> FloatArray:
    """`_shapes` normalised to length 1: their products with standard normal noise are standard normal."""
    shapes = _shapes(day)
    return np.asarray(shapes / np.linalg.norm(shapes, axis=0))


def _lone(day: FloatArray, ln: FloatArray, scatter: DateScatter) -> int | None:
    """Date without which no change is left, if it lies far from the others."""
    far = np.abs(ln - np.median(ln)) / scatter.sd
    i = int(np.argmax(far))
    if len(day) < SHORT or far[i] < WILD:
        return None
    return i if scatter.probability(np.delete(day, i), np.delete(ln, i)) >= SURE else None


def _evidence(day: FloatArray, ln: FloatArray, sd: float) -> tuple[FloatArray, float]:
    """Log marginal likelihood of every step and of the drift over that of no change; size normal with sd `SIZE`."""
    shapes = _shapes(day)
    squares = (shapes**2).sum(axis=0)
    gain = squares * (SIZE / sd) ** 2
    logs = 0.5 * (ln @ shapes) ** 2 / squares / sd**2 * gain / (1.0 + gain) - 0.5 * np.log1p(gain)
    return logs[:-1], float(logs[-1])


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
    """One strut over time; `dates`: mean N/mm of each."""

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
    """Struts measured alone, over the dates; `struts` is empty if there are none."""

    scatter_percent: float | None = None
    scatter_from: str = ""
    struts: Sequence[StrutOverTime] = ()

    @property
    def sentences(self) -> list[str]:
        """Sentences strut by strut: changes or none, and tension against compression where they differ."""
        texts = [(strut.text, strut.sides) for strut in self.struts]
        both = [(text, sides.text if sides and sides.p < SURE else "") for text, sides in texts]
        return [text for pair in both for text in pair if text]


def history(readings: StrutReadings, sides: StrutReadings | None = None, seed: int = 0) -> StrutHistory:
    """Evaluation of readings of struts alone by time and by sign of the force.

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
    """Evaluation of one strut."""
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
    """Strut -> tension against compression, for struts measured under both: mean of the dates' differences."""
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
