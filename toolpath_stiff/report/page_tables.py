"""The tables of the page, as HTML with everything escaped; they are there without JavaScript too."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from toolpath_stiff.report.comparison import FIGURES
from toolpath_stiff.report.wording import (
    ONLY_PLUNGES,
    READERS,
    duration,
    length_in_moves,
    number,
    only_plunges,
    plain,
    plunges_beside,
    shortened,
    span_of,
)

TITLES = ("mean N/mm", "min N/mm", "max N/mm", "range N/mm", "mean deflection um")
PLUNGES_TITLE = "plunges N/mm"
MOST_ROWS = 200  # of lines below the required stiffness; all are in summary.json


def page_tables(summary: Mapping[str, Any], weakest: Sequence[int]) -> str:
    """Figures, weakest places, tools, operations, required level, comparison, assumptions, words not acted upon.

    `weakest` holds the page's rows of the weakest places.
    """
    sections = [
        ("Tools", _tools(summary["per_tool"]), True),
        *((("Operations", _operations(summary["per_operation"]), True),) if len(summary["per_operation"]) > 1 else ()),
        ("Figures", _figures(summary), False),
        ("Weakest places", _places(summary["weakest_places"], weakest), False),
    ]
    if "required" in summary:
        sections.append(("Required stiffness", _required(summary["required"]), False))
    if "compare" in summary:
        sections.append(("Comparison", _comparison(summary), False))
    sections.append(("Assumptions", _bullets(summary["assumptions"]), False))
    if summary["unsupported"]:
        sections.append(("Read, but not acted upon", _unsupported(summary["unsupported"]), False))
    return "\n".join(
        f"<section{' class=wide' if wide else ''}><h2>{title}</h2>{body}</section>" for title, body, wide in sections
    )


def _text(value: object) -> str:
    return html.escape(plain(str(value)))


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int]) -> str:
    """A table of cells that are HTML already; the columns `numeric` are aligned to the right."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f"<{tag}{' class=num' if i in numeric else ''}>{cell}</{tag}>" for i, cell in enumerate(row))

    heading = f"<thead><tr>{cells('th', head)}</tr></thead>" if head else ""
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table>{heading}<tbody>{body}</tbody></table>"


def _figures(summary: Mapping[str, Any]) -> str:
    origin = " ".join(f"{axis}{v:.10g}" for axis, v in zip("XYZABC", summary["origin_mm_deg"], strict=True))
    rows = [
        (title[0].upper() + title[1:], number(summary[name], 2 if name.endswith("_um") else 0))
        for title, name in zip(TITLES, FIGURES, strict=True)
    ]
    rows += _plunges(summary)
    rows += [
        ("Cutting length mm", number(summary["cutting_length_mm"], 1)),
        ("Rapid length mm", number(summary["rapid_length_mm"], 1)),
        ("Time", duration(summary["time_s"])),
        ("Samples", f"{number(summary['samples'])}, at most {summary['step_mm']:g} mm apart"),
        ("Program zero (G54) mm, deg", f"{origin} ({summary['origin_source']})"),
        ("Program read by", READERS[summary["interpreter"]]),
        *([("Posted for", f"{summary['kinematics']}; tool tip and axis recovered")] if summary["kinematics"] else []),
        ("Effects that act", ", ".join(summary["effects"]) or "none"),
        *([("Set-up", str(summary["setup"]))] if summary.get("setup") else []),
        ("Outside the strut law", f"{summary['extrapolated_share']:.1%} of the cutting samples"),
        ("Out of reach", f"{number(summary['out_of_reach_samples'])} cutting samples"),
        ("Nearest limit", f"line {summary['min_margin_line']}: {summary['min_margin_limit']}"),
    ]
    return _table((), [(_text(name), _text(value)) for name, value in rows], ())


def _plunges(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the figures are about, and those of the plunges beside them."""
    plunges = plunges_beside(summary)
    if plunges is None:
        return [("These are figures of", summary["headline"])]
    place = plunges["weakest"]
    return [
        ("These are figures of", f"cuts {summary['headline']}"),
        ("Plunges along the axis", length_in_moves(plunges)),
        ("Plunges N/mm", f"mean {number(plunges['mean_N_per_mm'])}, {span_of(plunges)}"),
        ("Weakest plunge", f"{number(place['stiffness_N_per_mm'])} N/mm in line {place['line']}: {place['text']}"),
    ]


def _beside(row: Mapping[str, Any]) -> str:
    """Mean of the plunges of a tool or an operation."""
    if only_plunges(row):
        return ONLY_PLUNGES
    plunges = plunges_beside(row)
    return number(plunges["mean_N_per_mm"] if plunges else None)


def _places(places: Sequence[Mapping[str, Any]], weakest: Sequence[int]) -> str:
    rows = []
    for place, row in zip(places, weakest, strict=True):
        where = " ".join(f"{axis.upper()}{place[f'{axis}_mm']:.2f}" for axis in "xyz")
        if any(place[f"{axis}_deg"] for axis in "abc"):
            where += " " + " ".join(f"{axis.upper()}{place[f'{axis}_deg']:.2f}" for axis in "abc")
        button = (
            f'<button type="button" class="place" data-line="{place["line"]}" data-sample="{row}">'
            f"line {place['line']}</button>"
        )
        rows.append((button, number(place["stiffness_N_per_mm"]), where, f"<code>{_text(place['text'])}</code>"))
    return _table(("", "N/mm", "position mm", "program"), rows, (1,))


def _tools(per_tool: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (
            f"T{row['tool']}",
            _text(row["remark"]),
            "reference" if row["length_mm"] is None else number(row["length_mm"], 2),
            number(row["cutting_length_mm"], 1),
            duration(row["time_s"]),
            *(number(row[name], 2 if name.endswith("_um") else 0) for name in FIGURES),
            _beside(row),
            _weakest(row["weakest"]),
        )
        for row in per_tool
    ]
    head = ("tool", "remark", "length mm", "cutting mm", "time", *TITLES, PLUNGES_TITLE, "weakest")
    return _table(head, rows, range(2, 11))


def _weakest(place: Mapping[str, Any] | None) -> str:
    if place is None:
        return "-"
    return f'line {place["line"]} <code class="cut">{_text(shortened(place["text"], 26))}</code>'


def _operations(per_operation: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for part, row in enumerate(per_operation[:MOST_ROWS]):
        name = f"{row['operation']} {_text(row['name'])}"
        rows.append(
            (
                f'<button type="button" class="operation" data-operation="{part}">{name}</button>',
                f"T{row['tool']}" if row["tool"] else "-",
                f"{row['first_line']}-{row['last_line']}",
                number(row["cutting_length_mm"], 1),
                duration(row["time_s"]),
                *(number(row[name], 2 if name.endswith("_um") else 0) for name in FIGURES),
                _beside(row),
                _weakest(row["weakest"]),
                "-" if row["min_margin"] is None else f"{row['min_margin']:.3f}",
            )
        )
    more = len(per_operation) - len(rows)
    head = ("operation", "tool", "lines", "cutting mm", "time", *TITLES, PLUNGES_TITLE, "weakest", "margin")
    return _table(head, rows, (*range(2, 11), 12)) + (
        f"<p>and {more} more operations in summary.json</p>" if more > 0 else ""
    )


def _required(required: Mapping[str, Any]) -> str:
    below = required["below"]
    level = number(required["required_N_per_mm"])
    if not below:
        return f"<p>Every cutting move has the required {level} N/mm.</p>"
    more = f", the {MOST_ROWS} weakest of them here" if len(below) > MOST_ROWS else ""
    rows = [(f"line {entry['line']}", number(entry["min_N_per_mm"])) for entry in below[:MOST_ROWS]]
    return f"<p>{number(len(below))} lines are below the required {level} N/mm{more}:</p>" + _table(
        ("", "lowest N/mm"), rows, (1,)
    )


def _comparison(summary: Mapping[str, Any]) -> str:
    other = summary["compare"]
    rows = []
    for title, name, change in zip(TITLES, FIGURES, other["difference_percent"].values(), strict=True):
        digits = 2 if name.endswith("_um") else 0
        difference = "-" if change is None else f"{change:+.1f} %"
        rows.append((title, number(summary[name], digits), number(other[name], digits), difference))
    plunges = [plunges_beside(one) for one in (summary, other)]
    if any(plunges):
        first, second = (number(one["mean_N_per_mm"] if one else None) for one in plunges)
        change = other["plunges_difference_percent"]
        rows.append((f"mean of the {PLUNGES_TITLE}", first, second, "-" if change is None else f"{change:+.1f} %"))
    return _table(("", _text(summary["machine"]), _text(other["machine"]), "difference"), rows, (1, 2, 3))


def _bullets(sentences: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{_text(sentence)}</li>" for sentence in sentences) + "</ul>"


def _unsupported(entries: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (f"{entry['line']}:{entry['column']}", f"<code>{_text(entry['word'])}</code>", _text(entry["reason"]))
        for entry in entries[:MOST_ROWS]
    ]
    more = len(entries) - len(rows)
    return _table(("line:column", "word", "why"), rows, ()) + (f"<p>and {more} more</p>" if more > 0 else "")
