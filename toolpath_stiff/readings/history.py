"""Struts measured alone again and again: which of them changed, when, at once or slowly; tension against compression.

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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, TextArray
from toolpath_stiff.readings.dates import date_text
from toolpath_stiff.units import certain

Kind = Literal["step", "drift", "step or drift"]


DateText = Callable[[float], str]


SURE = 0.05  # probability, all struts and places counted, below which a change is told of


DRAWS = 2000  # simulated sets of series


FEWEST_DIFFERENCES = 6  # that are left of all struts, from which the scatter is estimated


TRIMMED = 0.2  # of a strut's differences, at least one


MOUNTING = 0.02  # relative sd from date to date where the data cannot say; assumed: mounting, load cell, indicator


# Relative sd, the same on all dates, of a difference of tension and compression; assumed: load cell, indicator and
# friction are not alike on both sides of zero.
BOTH_SIDES = 0.01


RESOLUTION = 1e-4  # relative; no scatter is believed to be less: rounding of the readings; assumed


SIZE = 0.1  # prior sd of a change of ln stiffness; assumed, for step and drift alike


DECISIVE = 20.0  # ratio of marginal likelihoods, Kass and Raftery's "strong"


A_SIDE = 2  # dates on either side of a step, from `SHORT` dates up


SHORT = 4


WILD = 4.0  # standard deviations from the median of the others, of one date that alone makes a change


CREDIBLE = 0.95


LEAST_TOLD = 1e-4  # probability


DAYS_PER_YEAR = 365.25  # Julian year


@dataclass(frozen=True)
class Readings:
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


class ChangeEntry(TypedDict):
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


class SidesEntry(TypedDict):
    """Tension against compression; `difference_percent` is tension less compression."""

    tension_N_per_mm: float
    compression_N_per_mm: float
    difference_percent: float
    sd_percent: float
    p: float
    text: str


class DateEntry(TypedDict):
    """The mean of one date."""

    date: str
    day: float
    stiffness_N_per_mm: float
    readings: int


class StrutEntry(TypedDict):
    """One strut; `judged_on`: what its dates were compared by, as "secant"; "" of readings that are not raw records."""

    strut: str
    readings: int
    stiffness_N_per_mm: float
    scatter_percent: float | None
    drift_percent_per_year: float | None
    drift_sd_percent_per_year: float | None
    smallest_step_percent: float | None
    dates: list[DateEntry]
    changes: list[ChangeEntry]
    wild_dates: list[str]
    sides: SidesEntry | None
    judged_on: str
    text: str


class HistoryDocument(TypedDict):
    """Struts measured alone over the dates; `struts` is empty where there are none."""

    scatter_percent: float | None
    scatter_from: str
    struts: list[StrutEntry]


NOTHING: HistoryDocument = {"scatter_percent": None, "scatter_from": "", "struts": []}


@dataclass(frozen=True)
class _Series:
    """Means (n,) of ln stiffness on n dates, how many readings each holds, and these about their means."""

    name: str
    day: FloatArray
    mean: FloatArray
    count: NDArray[np.int64]
    about: FloatArray


def history(readings: Readings, sides: Readings | None = None, seed: int = 0) -> HistoryDocument:
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
    >>> found = history(Readings(np.full(12, "strut 3 alone"), day, ln, np.zeros(12)))
    >>> [(one["kind"], one["after"], one["before"]) for one in found["struts"][0]["changes"]]
    [('step', '1970-06-30', '1970-07-30')]
    """
    if not len(readings.strut):
        return NOTHING
    compared = _sides(readings if sides is None else sides)
    series = _series(readings)
    looked_at = [one for one in series if len(one.day) > 1]
    scale = _Scale.of(looked_at, seed)
    struts = [_strut(one, scale, readings) for one in series]
    for one in struts:
        one["sides"] = compared.get(one["strut"])
    written: HistoryDocument = {
        "scatter_percent": 100.0 * scale.sd if looked_at else None,
        "scatter_from": scale.source if looked_at else "",
        "struts": struts,
    }
    return cast(HistoryDocument, certain(written))


def _series(readings: Readings) -> list[_Series]:
    """One a strut; where tension and compression never share a date, one a side."""
    found = []
    for name in sorted(set(readings.strut.tolist())):
        own = readings.strut == name
        day, ln, side = np.floor(readings.day[own]), readings.log_stiffness[own].copy(), readings.side[own]
        groups = {"": np.ones(len(day), dtype=bool)}
        if (side > 0.0).any() and (side < 0.0).any():
            both = [d for d in np.unique(day) if {1.0, -1.0} <= set(side[day == d].tolist())]
            if both:
                apart = [ln[(day == d) & (side > 0)].mean() - ln[(day == d) & (side < 0)].mean() for d in both]
                ln -= 0.5 * side * float(np.mean(apart))
            elif np.isfinite(day).any():
                groups = {" in tension": side >= 0.0, " in compression": side < 0.0}
        found += [_dated(f"{name}{title}", day[rows], ln[rows]) for title, rows in groups.items()]
    return found


def _dated(name: str, day: FloatArray, ln: FloatArray) -> _Series:
    """A series of the dated readings; of undated ones alone, without dates."""
    dates, which = np.unique(day[np.isfinite(day)], return_inverse=True)
    dated = ln[np.isfinite(day)]
    count = np.bincount(which, minlength=len(dates))
    mean = np.bincount(which, dated, len(dates)) / np.maximum(count, 1)
    return _Series(name, dates, mean, count, dated - mean[which])


def _trimmed(steps: FloatArray) -> FloatArray:
    """(..., kept) squares of differences of successive dates, without the largest."""
    squares = np.sort(0.5 * steps**2, axis=-1)
    return squares[..., : squares.shape[-1] - max(1, round(TRIMMED * squares.shape[-1]))]


@dataclass(frozen=True)
class _Scale:
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
    def of(cls, series: list[_Series], seed: int) -> _Scale:
        """Of all series together."""
        if not series:
            return cls(MOUNTING, "", np.zeros(1))
        rng = np.random.default_rng(seed)
        peak, squares, kept = np.zeros(DRAWS), np.zeros(DRAWS), 0
        for one in series:
            noise = rng.standard_normal((DRAWS, len(one.day)))
            peak = np.maximum(peak, np.abs(noise @ _contrasts(one.day)).max(axis=1))
            left = _trimmed(np.diff(noise, axis=1))
            squares, kept = squares + left.sum(axis=1), kept + left.shape[1]
        repeat = _repeat_sd(series)
        of_mean = repeat / np.sqrt(np.mean(np.concatenate([one.count for one in series])))
        if kept < FEWEST_DIFFERENCES:
            sd = float(np.hypot(MOUNTING, of_mean))
            return cls(sd, f"{100 * MOUNTING:g} % from date to date assumed: too few dates to tell", np.sort(peak))
        scale = np.sqrt(squares / kept)
        usual = float(np.median(scale))  # what leaving out the largest makes of a sd of 1
        own = sum(float(_trimmed(np.diff(one.mean)).sum()) for one in series)
        sd = max(np.sqrt(own / kept) / usual, of_mean, RESOLUTION)
        return cls(float(sd), "differences of successive dates", np.sort(peak / scale * usual))

    def probability(self, ratio: float) -> float:
        """That mere noise shows so large a |t| somewhere (Davison and Hinkley 1997, 4.2.3)."""
        above = len(self.largest) - int(np.searchsorted(self.largest, ratio))
        return (1 + above) / (1 + len(self.largest))

    @property
    def limit(self) -> float:
        """|t| from which a change is told of."""
        return float(np.quantile(self.largest, 1.0 - SURE))


def _repeat_sd(series: list[_Series]) -> float:
    """Relative sd of one reading within its date, of all struts together; 0 without repeats."""
    squares = sum(float((one.about**2).sum()) for one in series)
    freedom = sum(int((one.count - 1).sum()) for one in series)
    return (squares / freedom) ** 0.5 if freedom else 0.0


def _places(n: int) -> range:
    """Numbers of dates before a step."""
    side = A_SIDE if n >= SHORT else 1
    return range(side, n - side + 1)


def _shapes(day: FloatArray) -> FloatArray:
    """(n, m): every step as 0 and 1, and last the drift from 0 to 1, less their means."""
    order = np.arange(len(day))
    shapes = [(order >= at).astype(float) for at in _places(len(day))]
    shapes.append((day - day[0]) / (day[-1] - day[0]))
    found = np.stack(shapes, axis=1)
    return np.asarray(found - found.mean(axis=0))


def _contrasts(day: FloatArray) -> FloatArray:
    """The same of length 1: their products with standard normal noise are standard normal."""
    shapes = _shapes(day)
    return np.asarray(shapes / np.linalg.norm(shapes, axis=0))


def _changes(day: FloatArray, ln: FloatArray, scale: _Scale, text: DateText) -> tuple[list[ChangeEntry], list[float]]:
    """Changes of a series in the order of time, and dates that stand out alone."""
    if len(day) < 2:
        return [], []
    ratios = np.abs(ln @ _contrasts(day)) / scale.sd
    p = scale.probability(float(ratios.max()))
    if p >= SURE:
        return [], []
    lone = _lone(day, ln, scale)
    if lone is not None:
        keep = np.arange(len(day)) != lone
        found, wild = _changes(day[keep], ln[keep], scale, text)
        return found, sorted([float(day[lone]), *wild])
    step, drift = _evidence(day, ln, scale.sd)
    peak = float(step.max())
    weights = np.exp(step - peak)
    odds = peak + float(np.log(weights.mean())) - drift
    if odds < np.log(DECISIVE):
        kind: Kind = "drift" if -odds >= np.log(DECISIVE) else "step or drift"
        return [_drift(day, ln, scale.sd, p, kind, text)], []
    places = np.array(_places(len(day)))
    at = int(places[int(np.argmax(step))])
    before, wild_before = _changes(day[:at], ln[:at], scale, text)
    after, wild_after = _changes(day[at:], ln[at:], scale, text)
    one = _step(day, ln, at, places[_credible(weights)], scale.sd, p, text)
    return [*before, one, *after], [*wild_before, *wild_after]


def _lone(day: FloatArray, ln: FloatArray, scale: _Scale) -> int | None:
    """The date without which nothing is left to tell of, if it lies far from the others."""
    if len(day) < SHORT:
        return None
    far = np.abs(ln - np.median(ln)) / scale.sd
    i = int(np.argmax(far))
    keep = np.arange(len(day)) != i
    if far[i] < WILD:
        return None
    rest = np.abs(ln[keep] @ _contrasts(day[keep])).max() / scale.sd
    return i if scale.probability(float(rest)) >= SURE else None


def _evidence(day: FloatArray, ln: FloatArray, sd: float) -> tuple[FloatArray, float]:
    """Log marginal likelihood of every step and of the drift over that of no change; size normal with sd `SIZE`."""
    shapes = _shapes(day)
    squares = (shapes**2).sum(axis=0)
    gain = squares * (SIZE / sd) ** 2
    found = 0.5 * (ln @ shapes) ** 2 / squares / sd**2 * gain / (1.0 + gain) - 0.5 * np.log1p(gain)
    return found[:-1], float(found[-1])


def _credible(weights: FloatArray) -> NDArray[np.int64]:
    """The fewest places that hold 95 % of the probability, all places alike beforehand; rising."""
    order = np.argsort(-weights, kind="stable")
    held = np.cumsum(weights[order]) / weights.sum()
    return np.sort(order[: int(np.searchsorted(held, CREDIBLE)) + 1])


def _step(
    day: FloatArray, ln: FloatArray, at: int, places: NDArray[np.int64], sd: float, p: float, text: DateText
) -> ChangeEntry:
    """A step with its largest likelihood before date `at`, somewhere at `places`."""
    one, other = float(ln[:at].mean()), float(ln[at:].mean())
    error = sd * (1.0 / at + 1.0 / (len(day) - at)) ** 0.5
    ends = text(day[int(places[0]) - 1]), text(day[int(places[-1])])
    return _change("step", ends, (one, other), error, p, None)


def _drift(day: FloatArray, ln: FloatArray, sd: float, p: float, kind: Kind, text: DateText) -> ChangeEntry:
    """A drift over the series."""
    years = (day - day.mean()) / DAYS_PER_YEAR
    slope, error = _slope(day, ln, sd)
    ends = float(ln.mean() + slope * years[0]), float(ln.mean() + slope * years[-1])
    return _change(kind, (text(day[0]), text(day[-1])), ends, error * float(np.ptp(years)), p, slope)


def _slope(day: FloatArray, ln: FloatArray, sd: float) -> tuple[float, float]:
    """Of ln stiffness, a year, with its sd."""
    years = (day - day.mean()) / DAYS_PER_YEAR
    return float(years @ ln / (years @ years)), float(sd / (years @ years) ** 0.5)


def _change(
    kind: Kind, dates: tuple[str, str], ends: tuple[float, float], error: float, p: float, slope: float | None
) -> ChangeEntry:
    size = ends[1] - ends[0]
    share, low, high = (100.0 * float(np.expm1(v)) for v in (size, size - 1.96 * error, size + 1.96 * error))
    first, last = (1e-3 * float(np.exp(end)) for end in ends)
    way = "softer" if share < 0.0 else "stiffer"
    if kind == "step":
        text = f"became {abs(share):.2g} % {way} between {dates[0]} and {dates[1]} (95 %)"
    elif kind == "drift":
        text = f"grew {way} by {100 * abs(np.expm1(slope or 0.0)):.2g} % a year from {dates[0]} to {dates[1]}"
    else:
        text = f"became {abs(share):.2g} % {way} between {dates[0]} and {dates[1]}; at once or slowly is not told"
    return {
        "kind": kind, "after": dates[0], "before": dates[1], "change_percent": share, "low_percent": low,
        "high_percent": high, "percent_per_year": None if slope is None else 100.0 * float(np.expm1(slope)),
        "from_N_per_mm": first, "to_N_per_mm": last, "p": p,
        "text": f"{text}: {first:,.0f} to {last:,.0f} N/mm ({_chance_text(p)})",
    }  # fmt: skip


def _chance_text(p: float) -> str:
    """Further digits than simulations have would say nothing."""
    return f"p = {p:.2g}" if p >= LEAST_TOLD else f"p < {LEAST_TOLD:g}"


def _strut(one: _Series, scale: _Scale, readings: Readings) -> StrutEntry:
    """What is said of one strut."""
    n = len(one.day)
    own = readings.strut == one.name
    ln = one.mean if n else readings.log_stiffness[own]
    changes, wild = _changes(one.day, one.mean, scale, readings.text)
    slope, error = _slope(one.day, one.mean, scale.sd) if n > 1 else (np.nan, np.nan)
    least = scale.limit * scale.sd * (1.0 / (n // 2) + 1.0 / (n - n // 2)) ** 0.5 if n > 1 else np.nan
    dates: list[DateEntry] = [
        {"date": readings.text(d), "day": float(d - one.day[0]), "stiffness_N_per_mm": 1e-3 * float(np.exp(m)),
         "readings": int(c)}
        for d, m, c in zip(one.day, one.mean, one.count, strict=True)
    ]  # fmt: skip
    short = one.name.replace(" alone", "")
    said = [f"{short} {change['text']}" for change in changes]
    said += [f"{short}: {readings.text(d)} stands out alone: measure again" for d in wild]
    if n > 1 and not changes:
        said.append(
            f"{short}: no change found in {n} dates; a step of {100 * np.expm1(least):.2g} % halfway would show"
        )
    return {
        "strut": one.name,
        "readings": int(one.count.sum()) if n else int(own.sum()),
        "stiffness_N_per_mm": 1e-3 * float(np.exp(ln.mean())),
        "scatter_percent": 100.0 * float(ln.std(ddof=1)) if len(ln) > 1 else None,
        "drift_percent_per_year": 100.0 * slope if n > 1 else None,
        "drift_sd_percent_per_year": 100.0 * error if n > 1 else None,
        "smallest_step_percent": 100.0 * float(np.expm1(least)) if n > 1 else None,
        "dates": dates, "changes": changes, "wild_dates": [readings.text(d) for d in wild], "sides": None,
        "judged_on": "",
        "text": "; ".join(said),
    }  # fmt: skip


def _sides(readings: Readings) -> dict[str, SidesEntry]:
    """Strut -> tension against compression, of those measured under both: the mean of dates' differences."""
    from scipy.stats import t as student

    found: dict[str, tuple[FloatArray, float, float]] = {}
    for name in sorted(set(readings.strut.tolist())):
        own = readings.strut == name
        # Readings without a date are a group of their own.
        day = np.nan_to_num(np.floor(readings.day[own]), nan=-np.inf)
        ln, side = readings.log_stiffness[own], readings.side[own]
        pulled, pushed = side > 0.0, side < 0.0
        if not (pulled.any() and pushed.any()):
            continue
        both = [d for d in np.unique(day) if (pulled & (day == d)).any() and (pushed & (day == d)).any()]
        if both:
            apart = np.array([ln[pulled & (day == d)].mean() - ln[pushed & (day == d)].mean() for d in both])
        else:
            apart = np.array([ln[pulled].mean() - ln[pushed].mean()])
        found[name] = apart, float(ln[pulled].mean()), float(ln[pushed].mean())
    freedom = sum(len(apart) - 1 for apart, _, _ in found.values())
    if freedom >= FEWEST_DIFFERENCES:
        squares = sum(float(((apart - apart.mean()) ** 2).sum()) for apart, _, _ in found.values())
        one = max((squares / freedom) ** 0.5, RESOLUTION)
    else:
        one, freedom = MOUNTING * 2.0**0.5, 10**6
    entries = {}
    for name, (apart, pull, push) in found.items():
        error = float(np.hypot(one / len(apart) ** 0.5, BOTH_SIDES))
        p = min(1.0, len(found) * 2.0 * float(student.sf(abs(apart.mean()) / error, freedom)))
        entries[name] = _side_entry(name.replace(" alone", ""), float(apart.mean()), 0.5 * (pull + push), error, p)
    return entries


def _side_entry(name: str, apart: float, middle: float, error: float, p: float) -> SidesEntry:
    tension, compression = (1e-3 * float(np.exp(middle + sign * 0.5 * apart)) for sign in (1.0, -1.0))
    share = 100.0 * float(np.expm1(apart))
    numbers = f"{tension:,.0f} against {compression:,.0f} N/mm"
    if p < SURE:
        way = "softer" if share < 0.0 else "stiffer"
        text = f"{name} is {abs(share):.2g} % {way} in tension than in compression: {numbers} ({_chance_text(p)})"
    else:
        text = f"{name} is alike in tension and compression: {numbers}"
    return {
        "tension_N_per_mm": tension, "compression_N_per_mm": compression, "difference_percent": share,
        "sd_percent": 100.0 * error, "p": p, "text": text,
    }  # fmt: skip


def history_lines(document: HistoryDocument) -> Sequence[str]:
    """The sentences, strut by strut: changes or none, and tension against compression where they differ."""
    found = []
    for one in document["struts"]:
        found += [one["text"]] if one["text"] else []
        found += [one["sides"]["text"]] if one["sides"] and one["sides"]["p"] < SURE else []
    return found
