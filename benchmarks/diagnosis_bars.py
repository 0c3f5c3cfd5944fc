"""Figures of the diagnosis benchmark, each against its bar."""

import math
from collections.abc import Callable, Sequence

from benchmarks.bars import JUST_SEEN, Figure, Record, holds_truth, mean, middle_of, misnamed, named, share, truth_of

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
    return [
        figure
        for layout in ("tilted", "paper")
        if (mine := [r for r in records if r["layout"] == layout])
        for figure in _of_layout(layout, mine)
    ]


def _of_layout(layout: str, records: Sequence[Record]) -> list[Figure]:
    barred = layout == "tilted"
    one = [r for r in records if r["group"] == "one"]
    checks = [check["holds"] for r in one if r.get("choice_right") for check in r["parameters"]]
    ratios = [floor_ratio(r) for r in one]
    seen = [named(r) for r in one if r["effects"][0]["detectability"] >= JUST_SEEN]

    def bar(value: float) -> float | None:
        return value if barred else None

    def each(what: str, group: str, test: Callable[[Record], bool], **bars: float | None) -> Figure:
        return share(layout, what, [test(r) for r in records if r["group"] == group], **bars)

    def unexplained(record: Record) -> bool:
        return bool(record["verdict"] == "unexplained")

    return [
        each("one hidden: the truth is in `plausible`", "one", holds_truth, at_least=0.95),
        mean(layout, "one hidden: mean size of `plausible`", [float(len(r["plausible"])) for r in one],
             1.6 if barred else 4.0),
        each("one hidden: first place right", "one", lambda r: r["first"] == truth_of(r), at_least=bar(0.90)),
        each("one hidden: `identified` and right", "one", named, at_least=bar(0.85)),
        share(layout, f"the same, of those with a detectability of {JUST_SEEN:g} or more", seen),
        each("one hidden: `identified` and wrong", "one", misnamed, at_most=bar(0.05)),
        each("one hidden: `unexplained`", "one", unexplained, at_most=bar(0.10)),
        each("none hidden: anything but `adequate`", "none", lambda r: r["verdict"] != "adequate", at_most=bar(0.10)),
        each("outside the catalogue: `unexplained`", "outside", unexplained, at_least=bar(0.80)),
        middle_of(layout, "one hidden: held-out error of the right effect over the noise floor, median", ratios,
                  bar(FLOOR_RATIO)),
        share(layout, f"one hidden: that ratio is at most {FLOOR_RATIO:g}", [r <= FLOOR_RATIO for r in ratios]),
        share(layout, "95 % intervals of the right effect's parameters hold the truth", checks, at_least=bar(0.92),
              at_most=bar(0.98)),
    ]  # fmt: skip
