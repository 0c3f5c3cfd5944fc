"""`index.html`: many programs on one page, each a bar on one scale of stiffness, with a link to its report.

The bars stand in the table itself, so that they are sorted with it. They are drawn here; the page's script only sorts.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple
from urllib.parse import quote

from toolpath_stiff.defaults import VERSION
from toolpath_stiff.documents import Document, number
from toolpath_stiff.files import Content
from toolpath_stiff.report.analysis_tables import ONLY_PLUNGES
from toolpath_stiff.report.batch.outcomes import ProgramOutcome, good_and_failed, summary_csv
from toolpath_stiff.report.batch.programs import RESERVED
from toolpath_stiff.report.pages import markup, render
from toolpath_stiff.report.words import counted, duration, plain, shortened

INDEX, SUMMARY = RESERVED
TEXT = 40  # characters of a program's line that are shown
TICKS = 5  # of the scale, about
MOST_LABELS = 4  # on the scale, or they would touch on a narrow page
DRAWN = ("min_N_per_mm", "max_N_per_mm", "required_N_per_mm", "compare_mean_N_per_mm")
PLUNGES_HINT = "mean of the cuts along the tool axis, which the other figures leave out unless nothing else is cut"
BELOW = "lines below the required stiffness"
OTHER_MEAN, CHANGE = "mean on the other machine, N/mm", "how much higher the mean is on the other machine"
HOW_TO_READ = (
    "Each bar runs from the lowest to the highest stiffness along the load on the cutting moves, all on one scale. "
    "Click a heading to sort, again to reverse, once more for the order given."
)


def batch_page(outcomes: Sequence[ProgramOutcome]) -> str:
    """Text of the page, in the order of `outcomes`; links are relative to the folder of all reports."""
    good, failed = good_and_failed(outcomes)
    every = counted(len(outcomes), "program")
    table = _table(good)
    pieces = render(
        "batch.html",
        styles=["sections.css", "batch.css"],
        scripts=["batch.js"] if table else [],
        title=f"Stiffness of {every}",
        verdict=f"{number(len(failed))} of {every} failed" if failed else f"{every} analyzed",
        headline=_headline(good),
        text="Every program that could be analyzed has its own report: its name opens it." if good else "",
        about="   ·   ".join(_about(good)),
        figures=_totals(good, failed),
        warnings=[],
        failures=[outcome.reason for outcome in failed],
        table=table,
        footer=f"toolpath_stiff {VERSION}. Stiffness is that of the tool tip along the load.",
        verdict_class="unexplained" if failed else "",
    )
    return "".join(pieces)


def _headline(good: Sequence[ProgramOutcome]) -> str:
    known = [outcome for outcome in good if outcome.figure("min_N_per_mm") is not None]
    if not known:
        return "No stiffness to compare"
    weakest = min(known, key=lambda outcome: float(outcome.figure("min_N_per_mm")))
    lowest, line = weakest.number("min_N_per_mm"), weakest.figure("weakest_line")
    return f"Weakest: {lowest} N/mm in line {line} of {weakest.name}"


def _about(good: Sequence[ProgramOutcome]) -> list[str]:
    if not good:
        return []
    first = good[0].figures
    parts = [f"machine {first['machine']}", f"load {first['load']}, {first['force_N']:g} N"]
    if (other := first.get("compare_machine")) is not None:
        parts.append(f"compared with machine {other}")
    if (required := first.get("required_N_per_mm")) is not None:
        parts.append(f"required {number(required)} N/mm")
    return parts


def _totals(good: Sequence[ProgramOutcome], failed: Sequence[ProgramOutcome]) -> list[tuple[str, str]]:
    length, time = (sum(outcome.figures[name] for outcome in good) for name in ("cutting_length_mm", "time_s"))
    partial = sum(outcome.status == "partial" for outcome in good)
    below = sum(bool(outcome.figure("lines_below_required")) for outcome in good)
    totals = [
        (True, number(len(good)), "analyzed"),
        (failed, number(len(failed)), "failed"),
        (good, f"{number(length / 1e3, 1)} m", "cutting length"),
        (good, duration(time), "time"),
        (partial, number(partial), "with samples out of reach"),
        (below, number(below), "below the required stiffness"),
    ]
    return [(figure, title) for shown, figure, title in totals if shown]


@dataclass(frozen=True)
class StiffnessScale:
    """Common scale of stiffness for all bars, N/mm: its ends, which are ticks, and the ticks."""

    low: float
    high: float
    ticks: tuple[float, ...]
    required: float | None

    def at(self, value: float) -> float:
        """Position of a value, in percent of the width."""
        return 100.0 * (value - self.low) / (self.high - self.low)


def _scale(good: Sequence[ProgramOutcome]) -> StiffnessScale | None:
    """Scale that spans the bars and the required level; None without bars.

    Programs that only plunge set it if there are no others.
    """
    known = [outcome for outcome in good if outcome.figure("min_N_per_mm") is not None]
    if not known:
        return None
    across = [outcome for outcome in known if not outcome.plunges_only] or known
    values = [float(end) for outcome in across for name in DRAWN if (end := outcome.figure(name)) is not None]
    low, high = min(values), max(values)
    if high - low < 1e-6 * high:
        low, high = 0.9 * low, 1.1 * high
    least = (high - low) / TICKS
    power = 10.0 ** math.floor(math.log10(least))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least * (1.0 - 1e-9))
    ticks = tuple(i * step for i in range(math.floor(low / step), math.ceil(high / step) + 1))
    return StiffnessScale(ticks[0], ticks[-1], ticks, good[0].figure("required_N_per_mm"))


def _bar(outcome: ProgramOutcome, scale: StiffnessScale) -> Document:
    """Drawing of a program: span (kind, place and width) and lines, in per cent of the width."""
    low, mean, high, other = (outcome.figure(f"{name}_N_per_mm") for name in ("min", "mean", "max", "compare_mean"))
    lines, span = [("tick", tick) for tick in scale.ticks], None
    if low is not None and low <= scale.high and high >= scale.low:  # figures of plunges may lie beyond
        kind = f"span{' plunge' * outcome.plunges_only}{' below' * bool(outcome.figure('lines_below_required'))}"
        span = (kind, scale.at(low), max(scale.at(high) - scale.at(low), 0.4))
        lines.append(("mean", mean))
    lines += [(kind, value) for kind, value in (("other", other), ("required", scale.required)) if value is not None]
    return {"span": span, "lines": [(kind, scale.at(value)) for kind, value in lines]}


Cell = tuple[str, Any]  # sort key, and content


class Column(NamedTuple):
    """A heading (a line feed divides it), the class of its cells ("num" is also sorted as numbers), its cells.

    `hint` is more about it for whoever points at the heading.
    """

    title: str
    kind: str
    cell: Callable[[ProgramOutcome], Cell]
    hint: str = ""


def _figure(title: str, name: str, hint: str = "", digits: int = 0, flag: bool = False) -> Column:
    """Column of a figure; of a count that should be zero, with a flag where it is not."""

    def cell(outcome: ProgramOutcome) -> Cell:
        shown = outcome.number(name, digits)
        flagged = flag and outcome.figure(name)
        return _sorted_by(outcome, name), markup('<span class="flag">{}</span>', shown) if flagged else shown

    return Column(title, "num", cell, hint)


def _sorted_by(outcome: ProgramOutcome, name: str) -> str:
    figure = outcome.figure(name)
    return "" if figure is None else repr(figure)


def _table(good: Sequence[ProgramOutcome]) -> Document | None:
    scale = _scale(good)
    if scale is None:
        return None
    other = good[0].figure("compare_machine")
    plunging = any(outcome.figure("plunge_mean_N_per_mm") is not None for outcome in good)
    columns: list[Column] = [
        Column("program", "", _link),
        Column("", "bar", lambda outcome: ("", _bar(outcome, scale))),
        _figure("min\nN/mm", "min_N_per_mm", "lowest on a cutting move"),
        _figure("mean\nN/mm", "mean_N_per_mm", "by cutting length"),
        _figure("max\nN/mm", "max_N_per_mm"),
        _figure("range\nN/mm", "range_N_per_mm"),
        *([Column("plunges\nN/mm", "num", _plunges, PLUNGES_HINT)] if plunging else []),
        *([_figure("lines\nbelow", "lines_below_required", BELOW, flag=True)] if scale.required is not None else []),
        *([_figure("other\nmean", "compare_mean_N_per_mm", OTHER_MEAN)] if other is not None else []),
        *([_figure("change\n%", "compare_mean_difference_percent", CHANGE, 1)] if other is not None else []),
        Column("weakest line", "num text", _place),
        _figure("cutting\nmm", "cutting_length_mm", digits=1),
        Column("time", "num", lambda outcome: (_sorted_by(outcome, "time_s"), duration(outcome.figure("time_s")))),
        _figure("out of\nreach", "out_of_reach_samples", "cutting samples that were left out", flag=True),
        _figure("warn-\nings", "warnings", "in the program's own report", flag=True),
    ]
    key = [
        ("span", "lowest to highest, N/mm"),
        ("mean", "mean"),
        *([("other", f"mean on the other machine, {other}")] if other is not None else []),
        *([("required", "required"), ("span below", "below it somewhere")] if scale.required is not None else []),
    ]
    return {
        "how": HOW_TO_READ,
        "key": key,
        "columns": columns,
        "axis": [(scale.at(tick), number(tick)) for tick in scale.ticks[:: 1 + (len(scale.ticks) > MOST_LABELS)]],
        "rows": [[column.cell(outcome) for column in columns] for outcome in good],
    }


def _link(outcome: ProgramOutcome) -> Cell:
    """Name of a program, linked to its report. Names need not be UTF-8, nor free of characters special in addresses."""
    address = quote(os.fsencode(outcome.opens))
    return outcome.name, markup('<a href="{}" title="{}">{}</a>', address, outcome.file, outcome.name)


def _plunges(outcome: ProgramOutcome) -> Cell:
    """Mean of the plunges; if a program only plunges, all other figures are theirs already."""
    shown = ONLY_PLUNGES if outcome.plunges_only else outcome.number("plunge_mean_N_per_mm")
    return _sorted_by(outcome, "plunge_mean_N_per_mm"), shown


def _place(outcome: ProgramOutcome) -> Cell:
    line = outcome.figure("weakest_line")
    if line is None:
        return "", "-"
    text = plain(outcome.figure("weakest_text"))
    return repr(line), markup('{} <code title="{}">{}</code>', line, text, shortened(text, TEXT))


def files(outcomes: Sequence[ProgramOutcome]) -> dict[str, Content]:
    """Overview of many programs: page and table."""
    return {INDEX: batch_page(outcomes), SUMMARY: summary_csv(outcomes)}
