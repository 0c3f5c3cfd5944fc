"""Figures of the diagnosis benchmark: shares with Wilson intervals, means, medians, each against its bar."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean, median, stdev
from typing import Any

Record = dict[str, Any]

NORMAL_95 = NormalDist().inv_cdf(0.975)
# Repeat noise and clamping of the rig's cases, as one reading's standard deviation, percent; times the mean absolute
# value of a standard normal, sqrt(2 / pi) = 0.80: the mean error that scatter alone leaves.
SCATTER_PERCENT = math.hypot(2.0, 1.0)
FLOOR_PERCENT = 0.80 * SCATTER_PERCENT
FLOOR_RATIO = 1.3
# Detectability of the smallest effects that the rig draws (`toolpath_stiff.rig.effects.DETECTABLE`); one whose largest
# size of 30 % stays below cannot be seen in the layout.
JUST_SEEN = 3.9


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
    """One line of the table of bars.

    Attributes
    ----------
    layout, what
        Of which cases, and what was counted.
    value, interval
        As text.
    bar
        As text; "" where the issue sets none.
    cleared
        None where there is no bar.
    """

    layout: str
    what: str
    value: str
    interval: str
    bar: str
    cleared: bool | None

    @property
    def line(self) -> str:
        """A row of markdown."""
        verdict = {None: "", True: "pass", False: "**FAIL**"}[self.cleared]
        return f"| {self.layout} | {self.what} | {self.value} | {self.interval} | {self.bar} | {verdict} |"


def share(
    layout: str, what: str, hits: Sequence[bool], at_least: float | None = None, at_most: float | None = None
) -> Figure:
    """A share of cases; cleared by the figure itself, not by an end of its interval."""
    count, of = sum(hits), len(hits)
    low, high = wilson(count, of)
    bars = [f"at least {100 * at_least:g} %"] if at_least is not None else []
    bars += [f"at most {100 * at_most:g} %"] if at_most is not None else []
    if at_least is not None and at_most is not None:
        bars = [f"{100 * at_least:g} to {100 * at_most:g} %"]
    cleared = None
    if bars and of:
        value = count / of
        cleared = (at_least is None or value >= at_least) and (at_most is None or value <= at_most)
    figure = f"{100 * count / of:.1f} % ({count} of {of})" if of else "no cases"
    return Figure(layout, what, figure, f"{100 * low:.1f} to {100 * high:.1f} %", bars[0] if bars else "", cleared)


def mean(layout: str, what: str, values: Sequence[float], at_most: float | None = None) -> Figure:
    """A mean with its normal 95 % interval."""
    if not values:
        return Figure(layout, what, "no cases", "", "" if at_most is None else f"at most {at_most:g}", None)
    middle = fmean(values)
    reach = NORMAL_95 * stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.inf
    bar = "" if at_most is None else f"at most {at_most:g}"
    cleared = None if at_most is None else middle <= at_most
    return Figure(layout, what, f"{middle:.2f}", f"{middle - reach:.2f} to {middle + reach:.2f}", bar, cleared)


def middle_of(layout: str, what: str, values: Sequence[float], at_most: float | None = None, unit: str = "") -> Figure:
    """A median with the 95 % interval between order statistics (normal approximation of the sign test)."""
    if not values:
        return Figure(layout, what, "no cases", "", "" if at_most is None else f"at most {at_most:g}", None)
    ordered, n = sorted(values), len(values)
    reach = NORMAL_95 * math.sqrt(n) / 2.0
    low, high = max(math.floor(n / 2 - reach), 0), min(math.ceil(n / 2 + reach), n - 1)
    value = median(ordered)
    bar = "" if at_most is None else f"at most {at_most:g}{unit}"
    cleared = None if at_most is None else value <= at_most
    return Figure(layout, what, f"{value:.2f}{unit}", f"{ordered[low]:.2f} to {ordered[high]:.2f}{unit}", bar, cleared)


# -- of one record -----------------------------------------------------------------------------------------------------


def truth_of(record: Record) -> str:
    """The one hidden effect."""
    return str(record["truth"][0])


def holds_truth(record: Record) -> bool:
    """Whether all that was hidden is in `plausible`; `none` where nothing was."""
    return set(record["truth"] or ["none"]) <= set(record["plausible"])


def named(record: Record) -> bool:
    """`identified`, and exactly what was hidden."""
    return record["verdict"] == "identified" and set(record["plausible"]) == set(record["truth"])


def misnamed(record: Record) -> bool:
    """`identified`, and not exactly what was hidden: also where a second effect is named beside the right one."""
    return record["verdict"] == "identified" and not named(record)


def floor_ratio(record: Record) -> float:
    """Held-out mean error of the right effect over what scatter alone leaves."""
    held = record.get("held_out_percent")
    return math.inf if held is None else held / FLOOR_PERCENT


# -- bars --------------------------------------------------------------------------------------------------------------


def figures(records: Sequence[Record]) -> list[Figure]:
    """Every figure that the issue sets a bar for, and the same of the paper's layout without."""
    found: list[Figure] = []
    for layout in ("tilted", "paper"):
        mine = [r for r in records if r["layout"] == layout]
        if mine:
            found += _of_layout(layout, mine)
    return found + planned_figures([r for r in records if r["group"] == "planned"])


def _of_layout(layout: str, records: Sequence[Record]) -> list[Figure]:
    def of(group: str) -> list[Record]:
        return [r for r in records if r["group"] == group]

    barred = layout == "tilted"

    def bar(value: float) -> float | None:
        return value if barred else None

    def each(what: str, group: str, test: Callable[[Record], bool], **bars: float | None) -> Figure:
        return share(layout, what, [test(r) for r in of(group)], **bars)

    one = of("one")
    checks = [check for r in one if r.get("choice_right") for check in r["parameters"]]
    ratios = [floor_ratio(r) for r in one]
    seen = [r for r in one if r["effects"][0]["detectability"] >= JUST_SEEN]
    in_plausible = "one hidden: the truth is in `plausible`"
    return [
        each(in_plausible, "one", holds_truth, at_least=0.95),
        mean(layout, "one hidden: mean size of `plausible`", [float(len(r["plausible"])) for r in one],
             1.6 if barred else 4.0),
        each("one hidden: first place right", "one", lambda r: r["first"] == truth_of(r), at_least=bar(0.90)),
        each("one hidden: `identified` and right", "one", named, at_least=bar(0.85)),
        share(layout, f"the same, of those with a detectability of {JUST_SEEN:g} or more", [named(r) for r in seen]),
        each("one hidden: `identified` and wrong", "one", misnamed, at_most=bar(0.05)),
        each("one hidden: `unexplained`", "one", lambda r: r["verdict"] == "unexplained", at_most=bar(0.10)),
        each("none hidden: anything but `adequate`", "none", lambda r: r["verdict"] != "adequate", at_most=bar(0.10)),
        each("outside the catalogue: `unexplained`", "outside", lambda r: r["verdict"] == "unexplained",
             at_least=bar(0.80)),
        middle_of(layout, "one hidden: held-out error of the right effect over the noise floor, median", ratios,
                  bar(FLOOR_RATIO)),
        share(layout, f"one hidden: that ratio is at most {FLOOR_RATIO:g}", [r <= FLOOR_RATIO for r in ratios]),
        share(layout, "95 % intervals of the right effect's parameters hold the truth", [c["holds"] for c in checks],
              at_least=bar(0.92), at_most=bar(0.98)),
    ]  # fmt: skip


def planned_figures(records: Sequence[Record]) -> list[Figure]:
    """What further poses do for the ambiguous cases that tip stiffness can settle."""
    can = [r for r in records if r.get("settleable")]
    found = []
    for n in (6, 4, 2):
        for label in ("planned", "random"):
            hits = [r[f"{label}_{n}"][2] for r in can]
            bar = 0.80 if (n, label) == (6, "planned") else None
            found.append(share("tilted", f"ambiguous, settleable: settled by {n} {label} poses", hits, at_least=bar))
    if can:
        expected = sum(r["forecast"] for r in can)
        found.append(
            Figure(
                "tilted",
                "ambiguous, settleable: the plans' own forecast of the share that six poses settle",
                f"{100 * expected / len(can):.1f} % ({expected:.1f} of {len(can)})",
                "",
                "",
                None,
            )
        )
        totals = [sum(r[f"{label}_{n}"][2] for r in can for n in (2, 4, 6)) for label in ("planned", "random")]
        found.append(
            Figure(
                "tilted",
                "ambiguous, settleable: cases settled after 2, 4 and 6 poses together, planned and random",
                f"{totals[0]} and {totals[1]}",
                "",
                "planned more",
                totals[0] > totals[1],
            )
        )
    return found
