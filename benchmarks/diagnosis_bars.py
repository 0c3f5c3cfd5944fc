"""Figures of the diagnosis benchmark, each against its bar."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from benchmarks.bars import (
    JUST_SEEN,
    Figure,
    Record,
    holds_truth,
    mean,
    middle_of,
    misnamed,
    named,
    share,
    truth_of,
)  # fmt: skip

# Repeat noise and clamping of the rig's cases, as one reading's standard deviation, percent; times the mean absolute
# value of a standard normal, sqrt(2 / pi) = 0.80: the mean error that scatter alone leaves.
SCATTER_PERCENT = math.hypot(2.0, 1.0)
FLOOR_PERCENT = 0.80 * SCATTER_PERCENT
FLOOR_RATIO = 1.3


def floor_ratio(record: Record) -> float:
    """Held-out mean error of the right effect over what scatter alone leaves."""
    held = record.get("held_out_percent")
    return math.inf if held is None else held / FLOOR_PERCENT


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
