"""Figures on blind cases: shares with Wilson intervals, means, medians, each against its bar."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean, median, stdev
from typing import Any

from benchmarks.pages import table

Record = dict[str, Any]

NORMAL_95 = NormalDist().inv_cdf(0.975)


def wilson(count: int, of: int) -> tuple[float, float]:
    """95 % interval of a share.

    Score interval without continuity correction (Wilson 1927, Journal of the American Statistical Association 22, 209).
    """
    if of < 1:
        return 0.0, 1.0
    share, squared = count / of, NORMAL_95**2
    middle = (share + squared / (2 * of)) / (1.0 + squared / of)
    reach = NORMAL_95 / (1.0 + squared / of) * math.sqrt(share * (1.0 - share) / of + squared / (4 * of**2))
    # At a share of 0 or 1 the end is exact; rounding must not leave it a hair off.
    return (0.0 if count == 0 else middle - reach), (1.0 if count == of else middle + reach)


@dataclass(frozen=True)
class Figure:
    """One line of the table of bars, as text: of which cases, what was counted; `bar` "" and `cleared` None if none."""

    layout: str
    what: str
    value: str
    interval: str
    bar: str
    cleared: bool | None


def share(
    layout: str, what: str, hits: Sequence[bool], at_least: float | None = None, at_most: float | None = None
) -> Figure:
    """A share of cases; cleared by the figure itself, not by an end of its interval."""
    count, of = sum(hits), len(hits)
    low, high = wilson(count, of)
    least, most = (None if end is None else f"{100 * end:g}" for end in (at_least, at_most))
    bar = f"at least {least} %" if least else f"at most {most} %" if most else ""
    if least and most:
        bar = f"{least} to {most} %"
    cleared = None
    if bar and of:
        cleared = (at_least is None or count / of >= at_least) and (at_most is None or count / of <= at_most)
    value = f"{100 * count / of:.1f} % ({count} of {of})" if of else "no cases"
    return Figure(layout, what, value, f"{100 * low:.1f} to {100 * high:.1f} %", bar, cleared)


def mean(layout: str, what: str, values: Sequence[float], at_most: float | None = None) -> Figure:
    """A mean with its normal 95 % interval."""
    reach = NORMAL_95 * stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.inf
    middle = fmean(values) if values else math.nan
    return _at_most(layout, what, middle, (middle - reach, middle + reach), at_most, "")


def middle_of(layout: str, what: str, values: Sequence[float], at_most: float | None = None, unit: str = "") -> Figure:
    """A median with the 95 % interval between order statistics (normal approximation of the sign test)."""
    ordered, n = sorted(values) or [math.nan], len(values)
    reach = NORMAL_95 * math.sqrt(n) / 2.0
    low, high = max(math.floor(n / 2 - reach), 0), max(min(math.ceil(n / 2 + reach), n - 1), 0)
    return _at_most(layout, what, median(ordered), (ordered[low], ordered[high]), at_most, unit)


def _at_most(
    layout: str, what: str, value: float, interval: tuple[float, float], most: float | None, unit: str
) -> Figure:
    bar = "" if most is None else f"at most {most:g}{unit}"
    if math.isnan(value):
        return Figure(layout, what, "no cases", "", bar, None)
    ends = f"{interval[0]:.2f} to {interval[1]:.2f}{unit}"
    return Figure(layout, what, f"{value:.2f}{unit}", ends, bar, None if most is None else value <= most)


def bars_table(figures: Sequence[Figure]) -> list[str]:
    """The table of figures with their bars."""
    marks = {None: "", True: "pass", False: "**FAIL**"}
    rows = [(f.layout, f.what, f.value, f.interval, f.bar, marks[f.cleared]) for f in figures]
    return table("layout | figure | value | 95 % interval | bar | ", rows)


def summary(figures: Sequence[Figure]) -> str:
    """What fails, in a sentence."""
    failed = [f"{figure.layout}: {figure.what}, {figure.value}" for figure in figures if figure.cleared is False]
    count = sum(figure.cleared is not None for figure in figures)
    if not failed:
        return f"All {count} bars are cleared."
    return f"{len(failed)} of {count} bars are not cleared. " + "; ".join(failed) + "."


def holds_truth(record: Record) -> bool:
    """Whether all that was hidden is in `plausible`; `none` where nothing was."""
    return set(record["truth"] or ["none"]) <= set(record["plausible"])


def named(record: Record) -> bool:
    """`identified`, and exactly what was hidden."""
    return record["verdict"] == "identified" and set(record["plausible"]) == set(record["truth"])
