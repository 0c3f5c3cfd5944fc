"""`index.html`: many programs on one page, each a bar on one scale of stiffness, with a link to its report.

The bars stand in the table itself, so that they are sorted with it. They are drawn here; the page's script only sorts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from markupsafe import Markup

from toolpath_stiff.defaults import VERSION
from toolpath_stiff.files import Content
from toolpath_stiff.report.batch.programs import RESERVED, _figure, summary_csv
from toolpath_stiff.report.pages import markup, render
from toolpath_stiff.report.words import ONLY_PLUNGES, counted, duration, only_plunges, plain, shortened
from toolpath_stiff.units import number

if TYPE_CHECKING:
    from toolpath_stiff.report.batch.programs import Outcome


INDEX, SUMMARY = RESERVED


TEXT = 40  # characters of a program's line that are shown


TICKS = 5  # of the scale, about


MOST_LABELS = 4  # on the scale, or they would touch on a narrow page


DRAWN = ("min_N_per_mm", "max_N_per_mm", "required_N_per_mm", "compare_mean_N_per_mm")


PLUNGES = ("plunge_min_N_per_mm", "plunge_max_N_per_mm")


PLUNGES_ASIDE = "Plunges along the tool axis have a column of their own; bars and scale are of all other cuts."


PLUNGES_HINT = "mean of the cuts along the tool axis, which the other figures leave out unless nothing else is cut"


OTHER_MEAN, CHANGE = "mean on the other machine, N/mm", "how much higher the mean is on the other machine"


HOW_TO_READ = (
    "Each bar runs from the lowest to the highest stiffness along the load on the cutting moves, all on one scale. "
    "Click a heading to sort, again to reverse, once more for the order given."
)


def batch_page(outcomes: Sequence[Outcome]) -> str:
    """The page's text, in the order of `outcomes`; links are relative to the folder of all reports."""
    good = [one for one in outcomes if one.figures is not None]
    failed = [one for one in outcomes if one.figures is None]
    table = _table(good)
    return render(
        "batch.html",
        styles=["sections.css", "batch.css"],
        scripts=["batch.js"] if table else [],
        title=f"Stiffness of {counted(len(outcomes), 'program')}",
        verdict=_verdict(good, failed),
        headline=_headline(good),
        text="Every program that could be analyzed has its own report: its name opens it." if good else "",
        about="   ·   ".join(_about(good)),
        figures=_totals(good, failed),
        warnings=[],
        failures=[one.reason for one in failed],
        table=table,
        footer=f"toolpath_stiff {VERSION}. Stiffness is that of the tool tip along the load.",
        verdict_class="unexplained" if failed else "",
    )


def _verdict(good: Sequence[Outcome], failed: Sequence[Outcome]) -> str:
    if failed:
        return f"{number(len(failed))} of {counted(len(good) + len(failed), 'program')} failed"
    return f"{counted(len(good), 'program')} analyzed"


def _headline(good: Sequence[Outcome]) -> str:
    known = [one for one in good if _figure(one, "min_N_per_mm") is not None]
    if not known:
        return "No stiffness to compare"
    weakest = min(known, key=lambda one: float(_figure(one, "min_N_per_mm")))
    lowest = number(_figure(weakest, "min_N_per_mm"))
    return f"Weakest: {lowest} N/mm in line {_figure(weakest, 'weakest_line')} of {weakest.name}"


def _about(good: Sequence[Outcome]) -> list[str]:
    """What all programs have in common."""
    if not good:
        return []
    first = good[0].figures or {}
    parts = [f"machine {first['machine']}", f"load {first['load']}, {first['force_N']:g} N"]
    if (other := first.get("compare_machine")) is not None:
        parts.append(f"compared with machine {other}")
    if (required := first.get("required_N_per_mm")) is not None:
        parts.append(f"required {number(required)} N/mm")
    return parts


def _totals(good: Sequence[Outcome], failed: Sequence[Outcome]) -> list[tuple[str, str]]:
    found = [(number(len(good)), "analyzed")]
    if failed:
        found.append((number(len(failed)), "failed"))
    if good:
        found.append((f"{number(sum(_figure(one, 'cutting_length_mm') for one in good) / 1e3, 1)} m", "cutting length"))
        found.append((duration(sum(_figure(one, "time_s") for one in good)), "time"))
    if partial := sum(one.status == "partial" for one in good):
        found.append((number(partial), "with samples out of reach"))
    if below := sum(bool(_figure(one, "lines_below_required")) for one in good):
        found.append((number(below), "below the required stiffness"))
    return found


@dataclass(frozen=True)
class Scale:
    """One scale of stiffness for all bars, N/mm: its ends, which are ticks, and the ticks."""

    low: float
    high: float
    ticks: tuple[float, ...]
    required: float | None

    def at(self, value: float) -> str:
        """Place of a value, in percent of the width."""
        return f"{100.0 * (value - self.low) / (self.high - self.low):.2f}%"


Cell = tuple[str, str | list[Markup]]  # what it is sorted by; what it shows, drawings without and with the plunges


Scales = tuple[Scale, Scale | None]  # without and with the plunges; None where nothing plunges


def _scale(good: Sequence[Outcome], with_plunges: bool = False) -> Scale | None:
    """A scale that holds the bars and the required level; None where there is no bar.

    Programs that only plunge set it if there are no others, or `with_plunges`, as the plunges of all then do.
    """
    if not any(_figure(one, "min_N_per_mm") is not None for one in good):
        return None
    across = [one for one in good if not _only_plunges(one) and _figure(one, "min_N_per_mm") is not None]
    names = (*DRAWN, *PLUNGES) if with_plunges else DRAWN
    ends = [_figure(one, name) for one in (good if with_plunges or not across else across) for name in names]
    values = [float(end) for end in ends if end is not None]
    low, high = min(values), max(values)
    if high - low < 1e-6 * high:
        low, high = 0.9 * low, 1.1 * high
    step = _round_step((high - low) / TICKS)
    first, last = math.floor(low / step), math.ceil(high / step)
    required = _figure(good[0], "required_N_per_mm")
    return Scale(first * step, last * step, tuple(i * step for i in range(first, last + 1)), required)


def _round_step(least: float) -> float:
    """The next step of 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least * (1.0 - 1e-9))


def _axis(scale: Scale) -> Markup:
    shown = scale.ticks[:: 1 if len(scale.ticks) <= MOST_LABELS else 2]
    texts = "".join(f'<text x="{scale.at(tick)}" y="14">{number(tick)}</text>' for tick in shown)
    return Markup(f'<svg height="18" aria-hidden="true">{texts}</svg>')  # numbers and words of our own


def _bar(one: Outcome, scale: Scale, with_plunges: bool = False) -> Markup:
    low, mean, high = (_figure(one, f"{name}_N_per_mm") for name in ("min", "mean", "max"))
    lines = "".join(_line(scale, tick, "tick") for tick in scale.ticks)
    if low is not None and (low > scale.high or high < scale.low):  # only plunges, and these are not on the scale
        words = f"{number(low)} to {number(high)}"
        end, text = ("end", f"{words} →") if low > scale.high else ("start", f"← {words}")
        lines += f'<text class="beyond {end}" x="{"100%" if end == "end" else "0"}" y="15">{text}</text>'
    elif low is not None:
        kind = "span plunge" if _only_plunges(one) else "span"
        lines += _span(scale, low, high, f"{kind} below" if _figure(one, "lines_below_required") else kind)
        lines += _line(scale, mean, "mean", (3, 19))
    if with_plunges and not _only_plunges(one) and (first := _figure(one, PLUNGES[0])) is not None:
        lines += _span(scale, first, _figure(one, PLUNGES[1]), "span plunge")
    if (other := _figure(one, "compare_mean_N_per_mm")) is not None:
        lines += _line(scale, other, "other", (3, 19))
    if scale.required is not None:
        lines += _line(scale, scale.required, "required")
    return Markup(f'<svg height="22" aria-hidden="true">{lines}</svg>')  # numbers and words of our own


def _span(scale: Scale, low: float, high: float, kind: str) -> str:
    left, right = scale.at(low), scale.at(high)
    width = f"{max(float(right[:-1]) - float(left[:-1]), 0.4):.2f}%"
    return f'<rect class="{kind}" x="{left}" width="{width}" y="6" height="10" rx="2"/>'


def _line(scale: Scale, value: float, kind: str, ends: tuple[int, int] = (0, 22)) -> str:
    x = scale.at(value)
    return f'<line class="{kind}" x1="{x}" x2="{x}" y1="{ends[0]}" y2="{ends[1]}"/>'


@dataclass(frozen=True)
class Column:
    """A heading (a line feed divides it), the class of its cells, and more about it for whoever points at it."""

    title: str
    kind: str  # "num" is also sorted as numbers
    hint: str = ""


def _table(good: Sequence[Outcome]) -> dict[str, Any] | None:
    """What the template makes the table of; None where there is nothing to draw."""
    scale = _scale(good)
    if scale is None:
        return None
    compared = _figure(good[0], "compare_machine") is not None
    plunging = any(_figure(one, "plunge_mean_N_per_mm") is not None for one in good)
    beside = plunging and not all(_only_plunges(one) for one in good)
    scales = (scale, _scale(good, with_plunges=True) if beside else None)
    columns = [
        Column("program", ""),
        Column("", "bar"),
        Column("min\nN/mm", "num", "lowest on a cutting move"),
        Column("mean\nN/mm", "num", "by cutting length"),
        Column("max\nN/mm", "num"),
        Column("range\nN/mm", "num"),
        *((Column("plunges\nN/mm", "num", PLUNGES_HINT),) if plunging else ()),
        *((Column("lines\nbelow", "num", "lines below the required stiffness"),) if scale.required is not None else ()),
        *((Column("other\nmean", "num", OTHER_MEAN), Column("change\n%", "num", CHANGE)) if compared else ()),
        Column("weakest line", "num text"),
        Column("cutting\nmm", "num"),
        Column("time", "num"),
        Column("out of\nreach", "num", "cutting samples that were left out"),
        Column("warn-\nings", "num", "in the program's own report"),
    ]
    return {
        "how": f"{HOW_TO_READ} {PLUNGES_ASIDE}" if beside else HOW_TO_READ,
        "key": _key(scale, _figure(good[0], "compare_machine"), beside),
        "switch": beside,
        "columns": columns,
        "axes": [_axis(one) for one in scales if one],
        "rows": [_row(one, scales, compared, plunging) for one in good],
    }


def _key(scale: Scale, other: str | None, plunging: bool) -> list[tuple[str, str]]:
    """Kind of drawing and what it stands for."""
    return [
        ("span", "lowest to highest, N/mm"),
        ("mean", "mean"),
        *([("other", f"mean on the other machine, {other}")] if other is not None else []),
        *([("required", "required"), ("span below", "below it somewhere")] if scale.required is not None else []),
        *([("span plunge", "plunges along the tool axis")] if plunging else []),
    ]


def _row(one: Outcome, scales: Scales, compared: bool, plunging: bool) -> list[Cell]:
    """What each column is sorted by, and what it shows."""
    scale, second = scales
    return [
        (one.name, markup('<a href="{}" title="{}">{}</a>', _link(one.opens), one.file, one.name)),
        ("", [_bar(one, scale), *([_bar(one, second, with_plunges=True)] if second else [])]),
        *(_number(one, f"{name}_N_per_mm") for name in ("min", "mean", "max", "range")),
        *((_plunges(one),) if plunging else ()),
        *((_flagged(one, "lines_below_required"),) if scale.required is not None else ()),
        *(
            (_number(one, "compare_mean_N_per_mm"), _number(one, "compare_mean_difference_percent", 1))
            if compared
            else ()
        ),
        (_value(one, "weakest_line"), _place(one)),
        _number(one, "cutting_length_mm", 1),
        (_value(one, "time_s"), duration(_figure(one, "time_s"))),
        _flagged(one, "out_of_reach_samples"),
        _flagged(one, "warnings"),
    ]


def _plunges(one: Outcome) -> tuple[str, str]:
    """Their mean; of a program that only plunges all other figures are theirs already."""
    value, shown = _number(one, "plunge_mean_N_per_mm")
    return value, ONLY_PLUNGES if _only_plunges(one) else shown


def _only_plunges(one: Outcome) -> bool:
    return only_plunges(one.figures or {})


def _place(one: Outcome) -> str:
    """Number and text of the weakest line."""
    if _figure(one, "weakest_line") is None:
        return "-"
    text = plain(_figure(one, "weakest_text"))
    return markup('{} <code title="{}">{}</code>', _figure(one, "weakest_line"), text, shortened(text, TEXT))


def _number(one: Outcome, name: str, digits: int = 0) -> tuple[str, str]:
    return _value(one, name), number(_figure(one, name), digits)


def _flagged(one: Outcome, name: str) -> tuple[str, str]:
    """A count that had better be zero."""
    value, shown = _number(one, name)
    return value, markup('<span class="flag">{}</span>', shown) if _figure(one, name) else shown


def _value(one: Outcome, name: str) -> str:
    """The figure to sort by; "" where there is none."""
    figure = _figure(one, name)
    return "" if figure is None else repr(figure)


def _link(path: str) -> str:
    """A relative path as an address; names need not be UTF-8, nor free of what addresses take otherwise."""
    return quote(os.fsencode(path))


def names() -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    return INDEX, SUMMARY


def files(outcomes: Sequence[Outcome]) -> dict[str, Content]:
    """The overview of many programs: page and table."""
    return {INDEX: batch_page(outcomes), SUMMARY: summary_csv(outcomes)}
