"""Figures on blind cases: shares with Wilson intervals, means, medians, each against its bar."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist, median
from typing import Any

from scipy.stats import binomtest

from benchmarks.pages import table

Record = dict[str, Any]

NORMAL_95 = NormalDist().inv_cdf(0.975)


def wilson(count: int, of: int) -> tuple[float, float]:
    """95 % interval of a share.

    Score interval without continuity correction (Wilson 1927, Journal of the American Statistical Association 22, 209).
    """
    return tuple(binomtest(count, of).proportion_ci(method="wilson")) if of else (0.0, 1.0)


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


def middle_of(layout: str, what: str, values: Sequence[float], at_most: float | None = None, unit: str = "") -> Figure:
    """A median with the 95 % interval between order statistics (normal approximation of the sign test)."""
    bar = "" if at_most is None else f"at most {at_most:g}{unit}"
    if not values:
        return Figure(layout, what, "no cases", "", bar, None)
    ordered, n, middle = sorted(values), len(values), median(values)
    reach = NORMAL_95 * math.sqrt(n) / 2.0
    low, high = max(math.floor(n / 2 - reach), 0), max(min(math.ceil(n / 2 + reach), n - 1), 0)
    ends = f"{ordered[low]:.2f} to {ordered[high]:.2f}{unit}"
    return Figure(layout, what, f"{middle:.2f}{unit}", ends, bar, None if at_most is None else middle <= at_most)


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
