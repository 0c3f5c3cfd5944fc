"""Series of a strut's stiffness over dates: how far they scatter, and which steps and drifts are more than that.

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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, TextArray
from toolpath_stiff.readings.dates import date_text

Kind = Literal["step", "drift", "step or drift"]


SURE = 0.05  # probability, all struts and places counted, below which a change is told of


DRAWS = 2000  # simulated sets of series


FEWEST_DIFFERENCES = 6  # that are left of all struts, from which the scatter is estimated


TRIMMED = 0.2  # of a strut's differences, at least one


MOUNTING = 0.02  # relative sd from date to date where the data cannot say; assumed: mounting, load cell, indicator


RESOLUTION = 1e-4  # relative; no scatter is believed to be less: rounding of the readings; assumed


SIZE = 0.1  # prior sd of a change of ln stiffness; assumed, for step and drift alike


DECISIVE = 20.0  # ratio of marginal likelihoods, Kass and Raftery's "strong"


A_SIDE = 2  # dates on either side of a step, from `SHORT` dates up


SHORT = 4


WILD = 4.0  # standard deviations from the median of the others, of one date that alone makes a change


CREDIBLE = 0.95


DAYS_PER_YEAR = 365.25  # Julian year


@dataclass(frozen=True)
class StrutReadings:
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
    dates
        Day -> its text, where that is less than a day: a year or a month.
    """

    strut: TextArray
    day: FloatArray
    log_stiffness: FloatArray
    side: FloatArray
    dates: Mapping[float, str] = field(default_factory=dict)

    def text(self, day: float) -> str:
        """A date as it was given."""
        return self.dates.get(float(day)) or date_text(day)


@dataclass(frozen=True)
class Series:
    """Means (n,) of ln stiffness on n dates, how many readings each holds, and these about their means."""

    name: str
    day: FloatArray
    mean: FloatArray
    count: NDArray[np.int64]
    about: FloatArray

    @classmethod
    def of(cls, name: str, day: FloatArray, ln: FloatArray) -> Series:
        """A series of the dated readings; of undated ones alone, without dates."""
        dates, which = np.unique(day[np.isfinite(day)], return_inverse=True)
        dated = ln[np.isfinite(day)]
        count = np.bincount(which, minlength=len(dates))
        mean = np.bincount(which, dated, len(dates)) / np.maximum(count, 1)
        return cls(name, dates, mean, count, dated - mean[which])

    def slope(self, sd: float) -> tuple[float, float]:
        """Of ln stiffness, a year, with its sd."""
        return _slope(self.day, self.mean, sd)


class Change(NamedTuple):
    """A change of ln stiffness: its kind, the days between which it lies, from and to what, the sd of the difference.

    `p` is its probability in mere noise; `slope` that of a drift, a year.
    """

    kind: Kind
    days: tuple[float, float]
    ends: tuple[float, float]
    sd: float
    p: float
    slope: float | None = None


def chance_of_t(ratio: float, freedom: float) -> float:
    """Probability that Student's |t| is so large by chance."""
    from scipy.special import stdtr

    return 2.0 * float(stdtr(freedom, -ratio))


def series_of(readings: StrutReadings) -> list[Series]:
    """One a strut; where tension and compression never share a date, one a side."""
    series = []
    for name in sorted(set(readings.strut.tolist())):
        rows = readings.strut == name
        day, ln, side = np.floor(readings.day[rows]), readings.log_stiffness[rows].copy(), readings.side[rows]
        groups = {"": np.ones(len(day), dtype=bool)}
        if (side > 0.0).any() and (side < 0.0).any():
            both = [d for d in np.unique(day) if {1.0, -1.0} <= set(side[day == d].tolist())]
            if both:
                apart = [ln[(day == d) & (side > 0)].mean() - ln[(day == d) & (side < 0)].mean() for d in both]
                ln -= 0.5 * side * float(np.mean(apart))
            elif np.isfinite(day).any():
                groups = {" in tension": side >= 0.0, " in compression": side < 0.0}
        series += [Series.of(f"{name}{title}", day[chosen], ln[chosen]) for title, chosen in groups.items()]
    return series


@dataclass(frozen=True)
class DateScatter:
    """How far means of dates scatter, and how large the largest |t| of mere noise is.

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
    def of(cls, series: Sequence[Series], seed: int) -> DateScatter:
        """Of all series together, each with two dates or more."""
        if not series:
            return cls(MOUNTING, "", np.zeros(1))
        rng = np.random.default_rng(seed)
        peak, squares, kept = np.zeros(DRAWS), np.zeros(DRAWS), 0
        for strut in series:
            noise = rng.standard_normal((DRAWS, len(strut.day)))
            peak = np.maximum(peak, np.abs(noise @ _contrasts(strut.day)).max(axis=1))
            left = _trimmed(np.diff(noise, axis=1))
            squares, kept = squares + left.sum(axis=1), kept + left.shape[1]
        # Of one reading within its date; 0 without repeats.
        freedom = sum(int((strut.count - 1).sum()) for strut in series)
        repeat = (sum(float((strut.about**2).sum()) for strut in series) / freedom) ** 0.5 if freedom else 0.0
        of_mean = repeat / np.sqrt(np.mean(np.concatenate([strut.count for strut in series])))
        if kept < FEWEST_DIFFERENCES:
            sd = float(np.hypot(MOUNTING, of_mean))
            return cls(sd, f"{100 * MOUNTING:g} % from date to date assumed: too few dates to tell", np.sort(peak))
        scale = np.sqrt(squares / kept)
        usual = float(np.median(scale))  # what leaving out the largest makes of a sd of 1
        measured = sum(float(_trimmed(np.diff(strut.mean)).sum()) for strut in series)
        sd = max(np.sqrt(measured / kept) / usual, of_mean, RESOLUTION)
        return cls(float(sd), "differences of successive dates", np.sort(peak / scale * usual))

    def probability(self, ratio: float) -> float:
        """That mere noise shows so large a |t| somewhere (Davison and Hinkley 1997, 4.2.3)."""
        above = len(self.largest) - int(np.searchsorted(self.largest, ratio))
        return (1 + above) / (1 + len(self.largest))

    def smallest_step(self, dates: int) -> float:
        """Step of ln stiffness halfway through so many dates that would be told of."""
        limit = float(np.quantile(self.largest, 1.0 - SURE))
        return limit * self.sd * math.sqrt(1.0 / (dates // 2) + 1.0 / (dates - dates // 2))


def changes_of(day: FloatArray, ln: FloatArray, scatter: DateScatter) -> tuple[list[Change], list[float]]:
    """Changes of a series (n,) in the order of time, and days that stand out alone."""
    if len(day) < 2:
        return [], []
    p = scatter.probability(float(np.abs(ln @ _contrasts(day)).max() / scatter.sd))
    if p >= SURE:
        return [], []
    lone = _lone(day, ln, scatter)
    if lone is not None:
        keep = np.arange(len(day)) != lone
        changes, wild = changes_of(day[keep], ln[keep], scatter)
        return changes, sorted([float(day[lone]), *wild])
    step, drift = _evidence(day, ln, scatter.sd)
    weights = np.exp(step - step.max())
    odds = float(step.max()) + float(np.log(weights.mean())) - drift
    if odds < np.log(DECISIVE):
        years = (day - day.mean()) / DAYS_PER_YEAR
        slope, sd = _slope(day, ln, scatter.sd)
        ends = float(ln.mean() + slope * years[0]), float(ln.mean() + slope * years[-1])
        kind: Kind = "drift" if -odds >= np.log(DECISIVE) else "step or drift"
        days = float(day[0]), float(day[-1])
        return [Change(kind, days, ends, sd * float(np.ptp(years)), p, slope)], []
    places = np.array(_places(len(day)))
    place = int(places[int(np.argmax(step))])
    before, wild_before = changes_of(day[:place], ln[:place], scatter)
    after, wild_after = changes_of(day[place:], ln[place:], scatter)
    # The fewest places that hold 95 % of the probability, all places alike beforehand.
    order = np.argsort(-weights, kind="stable")
    held = np.cumsum(weights[order]) / weights.sum()
    likely = places[np.sort(order[: int(np.searchsorted(held, CREDIBLE)) + 1])]
    change = Change(
        "step",
        (float(day[likely[0] - 1]), float(day[likely[-1]])),
        (float(ln[:place].mean()), float(ln[place:].mean())),
        scatter.sd * (1.0 / place + 1.0 / (len(day) - place)) ** 0.5,
        p,
    )
    return [*before, change, *after], [*wild_before, *wild_after]


def _trimmed(steps: FloatArray) -> FloatArray:
    """(..., kept) squares of differences of successive dates, without the largest."""
    squares = np.sort(0.5 * steps**2, axis=-1)
    return squares[..., : squares.shape[-1] - max(1, round(TRIMMED * squares.shape[-1]))]


def _places(n: int) -> range:
    """Numbers of dates before a step."""
    side = A_SIDE if n >= SHORT else 1
    return range(side, n - side + 1)


def _shapes(day: FloatArray) -> FloatArray:
    """(n, m): every step as 0 and 1, and last the drift from 0 to 1, less their means."""
    order = np.arange(len(day))
    shapes = np.stack(
        [*((order >= place).astype(float) for place in _places(len(day))), (day - day[0]) / (day[-1] - day[0])], axis=1
    )
    return np.asarray(shapes - shapes.mean(axis=0))


def _contrasts(day: FloatArray) -> FloatArray:
    """The same of length 1: their products with standard normal noise are standard normal."""
    shapes = _shapes(day)
    return np.asarray(shapes / np.linalg.norm(shapes, axis=0))


def _lone(day: FloatArray, ln: FloatArray, scatter: DateScatter) -> int | None:
    """The date without which nothing is left to tell of, if it lies far from the others."""
    if len(day) < SHORT:
        return None
    far = np.abs(ln - np.median(ln)) / scatter.sd
    i = int(np.argmax(far))
    keep = np.arange(len(day)) != i
    if far[i] < WILD:
        return None
    rest = np.abs(ln[keep] @ _contrasts(day[keep])).max() / scatter.sd
    return i if scatter.probability(float(rest)) >= SURE else None


def _evidence(day: FloatArray, ln: FloatArray, sd: float) -> tuple[FloatArray, float]:
    """Log marginal likelihood of every step and of the drift over that of no change; size normal with sd `SIZE`."""
    shapes = _shapes(day)
    squares = (shapes**2).sum(axis=0)
    gain = squares * (SIZE / sd) ** 2
    logs = 0.5 * (ln @ shapes) ** 2 / squares / sd**2 * gain / (1.0 + gain) - 0.5 * np.log1p(gain)
    return logs[:-1], float(logs[-1])


def _slope(day: FloatArray, ln: FloatArray, sd: float) -> tuple[float, float]:
    years = (day - day.mean()) / DAYS_PER_YEAR
    return float(years @ ln / (years @ years)), float(sd / (years @ years) ** 0.5)
