"""Pictures, pages and tables; here how figures are written for people: alike on terminal, pictures and pages.

Pages: templates, style sheets and scripts from `assets/`, and the parts that several pages have.

A page is one file that loads nothing. Whatever is put into a template is escaped and cleared of control characters
unless it is `Markup`; a content security policy lets nothing run but the page's own script.

The tables of tools and operations that `tps check` prints: plain text, at most 98 columns.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from toolpath_stiff.analysis.loads import PLUNGES_ONLY
from toolpath_stiff.defaults import VERSION
from toolpath_stiff.hints import parted
from toolpath_stiff.report.figure import Drawing
from toolpath_stiff.stiffness.model import machine_words
from toolpath_stiff.units import number as number

if TYPE_CHECKING:
    from jinja2 import Environment


# Who read a program, for headings (`Program.interpreter`).
READERS = {"builtin": "the built-in reader", "linuxcnc": "LinuxCNC's interpreter (rs274)"}

# Of an analysis, in the order of every table.
FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")

# The sign of every residual that is shown, for axes and legends.
DEVIATION = "(measured - modelled) / modelled"
MINUS_IS_SOFTER = "minus: softer than modelled"
ONLY_PLUNGES = "only plunges"  # beside a program, a tool or an operation
DATA = Markup("<data>")  # where the data of a page go; what is not `Markup` has no such letters in a page
LONG_LIST = 20_000  # entries
Row = tuple[str, Sequence[str]]  # class of the row, its cells: text, or `Markup`
INDENT = 2  # columns to the left of the tables
MOST_ROWS = 40  # all are in --json
CHECK_FIGURES = ("cutting mm", "time", "X", "Y", "Z")


def counted(count: float, thing: str) -> str:
    """So many of a thing: "1 line", "1 405 lines"."""
    return f"{number(count)} {thing}{'' if count == 1 else 's'}"


def span_of(figures: Mapping[str, Any]) -> str:
    """Lowest and highest stiffness of a block of figures: "122 988 to 123 770"."""
    return f"{number(figures['min_N_per_mm'])} to {number(figures['max_N_per_mm'])}"


def headline_text(figures: Mapping[str, Any], between: str) -> str:
    """Mean and range for a heading, and what they are about where that is not every cut; `between` the parts."""
    text = f"mean {number(figures['mean_N_per_mm'])} N/mm ({span_of(figures)})"
    if only_plunges(figures):
        return f"{text}, {ONLY_PLUNGES}"
    plunges = plunges_beside(figures)
    if plunges is None:
        return text
    return f"{text} across the tool axis{between}plunges {number(plunges['mean_N_per_mm'])} N/mm ({span_of(plunges)})"


def plunges_beside(figures: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The plunges that the headline figures leave out; None where there are none, or where there is nothing else."""
    found: Mapping[str, Any] | None = figures["plunges"]
    return None if figures["headline"] == PLUNGES_ONLY else found


def length_in_moves(plunges: Mapping[str, Any]) -> str:
    """How much is plunged: "20.0 mm in 3 moves"."""
    return f"{number(plunges['length_mm'], 1)} mm in {number(plunges['moves'])} move{'s' * (plunges['moves'] != 1)}"


def only_plunges(figures: Mapping[str, Any]) -> bool:
    """Whether the figures of a program, a tool or an operation are those of plunges, for it does nothing else."""
    return bool(figures.get("headline") == PLUNGES_ONLY)


def duration(seconds: float) -> str:
    """Time as h:mm:ss, in seconds below a minute."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def plain(text: str) -> str:
    """Text from a program or a file name without control characters: it cannot steer a terminal."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def shortened(text: str, width: int) -> str:
    """At most `width` characters, the cut marked by three dots."""
    return text if len(text) <= width else text[: max(width - 3, 0)] + "..."


def machine_text(document: Mapping[str, Any]) -> str:
    """The machine of a result for headings, with the effects that act on it and the set-up."""
    return plain(machine_words(document))


WIDTH = 100
LABEL = 14  # columns of the left-hand words
LEAST_NAME = 24  # columns for the number and name of an operation, however wide the figures are


def labelled(label: str, text: str, column: int = LABEL) -> list[str]:
    """An entry of a list on the terminal, wrapped and indented; the label is `column` wide."""
    return textwrap.wrap(
        plain(text),
        WIDTH,
        initial_indent=f"{label:<{column}}  ",
        subsequent_indent=" " * (column + 2),
        break_on_hyphens=False,
    )


def first_column_fitted(rows: list[list[str]], indent: int = 0) -> list[list[str]]:
    """The same with the first column cut to what the others and `indent` leave, but not below `LEAST_NAME`."""
    room = WIDTH - indent - sum(2 + max(len(row[i]) for row in rows) for i in range(1, len(rows[0])))
    return [[shortened(row[0], max(room, LEAST_NAME)), *row[1:]] for row in rows]


def aligned(rows: list[list[str]], left_last: bool = False) -> list[str]:
    """Align: the first column (and the last, if asked) to the left, the others to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    widths[0] = max(widths[0], LABEL)
    left = {0, len(widths) - 1} if left_last else {0}
    return [
        "  ".join(
            f"{c:<{w}}" if i in left else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()[:WIDTH]
        for row in rows
    ]


def render(
    template: str, *, styles: Sequence[str] = (), scripts: Sequence[str] = (), data: Any = None, **values: Any
) -> str:
    """A page.

    Parameters
    ----------
    template
        File in `assets/` that extends `page.html`.
    styles
        Style sheets beyond the one of all pages.
    scripts
        Scripts, which share one scope and are the only ones that may run.
    data
        What they read, as JSON.
    values
        What the template names.
    """
    return "".join(render_pieces(template, styles=styles, scripts=scripts, data=data, **values))


def render_pieces(
    template: str, *, styles: Sequence[str] = (), scripts: Sequence[str] = (), data: Any = None, **values: Any
) -> Iterator[str]:
    """The same in pieces: the data of a long program are most of a page, and stand in memory once."""
    script = '\n"use strict";\n(() => {\n' + "".join(asset(one) for one in scripts) + "})();\n" if scripts else ""
    text = _templates().get_template(template).render(
        style=Markup("".join(asset(one) for one in ("page.css", *styles))),
        script=Markup(script),
        script_hash=script_hash(script),
        data=None if data is None else DATA,
        version=VERSION,
        **values,
    )  # fmt: skip
    before, mark, after = text.partition(DATA)
    yield before
    if mark:
        yield from json_pieces(data)
        yield after


@cache
def _templates() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        loader=FunctionLoader(asset), autoescape=True, undefined=StrictUndefined, finalize=_shown,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def _shown(value: object) -> object:
    """What a template shows of a value: text without control characters, HTML as it is."""
    return value if isinstance(value, Markup) else plain(str(value))


def asset(name: str) -> str:
    """Text of a file in `assets/`."""
    return Path(__file__).with_name("assets").joinpath(name).read_text(encoding="utf-8")


def script_hash(script: str) -> str:
    """The source expression of Content Security Policy Level 3, section 2.3.1."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def json_for_script(value: Any) -> str:
    """JSON that can stand inside a script element: nothing in it ends the element, or a line of JavaScript."""
    return "".join(json_pieces(value))


def json_pieces(value: Any) -> Iterator[str]:
    """The text of `json_for_script` in pieces: the values of an object and the entries of a long list one by one."""
    if isinstance(value, dict) and value:
        before = "{"
        for key, entry in value.items():
            yield f"{before}{_json(str(key))}:"
            yield from json_pieces(entry)
            before = ","
        yield "}"
    elif isinstance(value, list) and len(value) > LONG_LIST:
        before = "["
        for start in range(0, len(value), LONG_LIST):
            yield before + _json(value[start : start + LONG_LIST])[1:-1]
            before = ","
        yield "]"
    else:
        yield _json(value)


def _json(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if text.isascii() and not any(character in text for character in "<>&"):  # a long text is searched, not copied
        return text
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    # A lone surrogate (a byte that was no text) cannot be written as UTF-8, and browsers stumble over it.
    return re.sub("[\ud800-\udfff]", "\N{REPLACEMENT CHARACTER}", text)


def markup(template: str, *values: object) -> Markup:
    """A bit of HTML with values in the place of {}: as a template, for what is smaller than one."""
    return Markup(template).format(*(_shown(value) for value in values))


# -- parts -------------------------------------------------------------------------------------------------------------


def _part(name: str, *values: object) -> Markup:
    """What a macro of `parts.html` makes."""
    found: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return found


def section(title: str, body: Markup) -> Markup:
    """A titled section; nothing where there is no body."""
    return _part("section", title, body) if body else Markup()


def bullets(sentences: Sequence[object]) -> Markup:
    """A list; nothing without sentences."""
    return _part("bullets", sentences) if sentences else Markup()


def hint_list(hints: Sequence[object]) -> Markup:
    """As `bullets`, a hint's command set as one, to be copied."""
    return _part("hints", [parted(str(text)) for text in hints]) if hints else Markup()


def picture(name: str, pictures: Mapping[str, bytes | str], questions: Mapping[str, tuple[str, str]]) -> Markup:
    """A picture under the question that it answers, with how it is read; nothing where it was not drawn."""
    content = pictures.get(name)
    if not isinstance(content, bytes):
        return Markup()
    drawn = isinstance(content, Drawing)
    shown = Markup(content.svg) if isinstance(content, Drawing) else base64.b64encode(content).decode("ascii")
    return _part("picture", *questions[name], shown, drawn)


def table(head: Sequence[str], rows: Sequence[Row], numeric: Iterable[int] = ()) -> Markup:
    """A table; the columns `numeric` are aligned to the right. Nothing without rows."""
    return _part("table", head, rows, list(numeric)) if rows else Markup()


def readings_page(
    title: str, command: str, document: Mapping[str, Any], verdict: str, headline: str,
    figures: Iterable[tuple[str, str]], sections: Iterable[Markup],
) -> str:  # fmt: skip
    """The page of a result on readings: text, data, machine, warnings and seed are those of its document."""
    files = ", ".join(document["data"])
    return page(
        title=f"{title}: {files}",
        verdict=verdict,
        headline=headline,
        text=document["text"],
        about=[counted(document["readings"], "reading"), files, f"machine {machine_text(document)}"],
        figures=figures,
        warnings=document["warnings"],
        sections=sections,
        footer=f"tps {command}, seed {document['seed']}",
    )


def page(
    title: str, verdict: str, headline: str, text: str, about: Sequence[str], figures: Iterable[tuple[str, str]],
    warnings: Sequence[str], sections: Iterable[Markup], footer: str, verdict_class: str = "",
) -> str:  # fmt: skip
    """A page of sections below each other; `sections` are HTML, the others text.

    `figures`: the few that say it all, each with what it is.
    """
    return render(
        "sections.html", styles=["sections.css"], title=title, verdict=verdict, headline=headline, text=text,
        about="   ·   ".join(part for part in about if part), figures=list(figures), warnings=warnings,
        sections=[part for part in sections if part], footer=footer, verdict_class=verdict_class,
    )  # fmt: skip


def check_tables(tools: Sequence[Mapping[str, Any]], operations: Sequence[Mapping[str, Any]]) -> list[str]:
    """One row a tool that cuts, one row an operation, with the extents of the cuts; no table of a single row."""
    cutting = [row for row in tools if row["extents_mm"]]
    tables: list[str] = []
    if len(cutting) > 1:
        rows = [[_tool(row) + f" {plain(row['remark'])}".rstrip(), *_figures(row)] for row in cutting]
        tables += _table(["tool", *CHECK_FIGURES], rows)
    if len(operations) > 1:
        shown = operations[:MOST_ROWS]
        digits = len(str(len(shown)))
        rows = [
            [
                f"{row['operation']:>{digits}} {plain(row['name'])}",
                _tool(row),
                f"{row['first_line']}-{row['last_line']}",
                *_figures(row),
            ]
            for row in shown
        ]
        tables += _table(["operation", "tool", "lines", *CHECK_FIGURES], rows)
        if len(operations) > MOST_ROWS:
            tables.append(f"and {len(operations) - MOST_ROWS} more operations in --json")
    return tables


def _tool(row: Mapping[str, Any]) -> str:
    return f"T{row['tool']}" if row["tool"] else "-"


def _figures(row: Mapping[str, Any]) -> list[str]:
    extents = (row["extents_mm"].get(axis) for axis in "xyz")
    return [
        number(row["lengths_mm"]["cutting"], 1),
        duration(row["times_s"]["total"]),
        *("-" if ends is None else f"{number(ends[0], 1)}..{number(ends[1], 1)}" for ends in extents),
    ]


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return aligned(first_column_fitted([head, *rows], INDENT))


def text(document: Mapping[str, Any]) -> str:
    """What `--json` prints, for people."""
    posted = f", posted for {document['kinematics']}" if document["kinematics"] else ""
    lines = [f"{document['program']}, read as {document['dialect']}{posted}"]
    if document["interpreter"] != "builtin":
        lines.append("read by LinuxCNC's interpreter: codes are counted where they stand, modal states are not known")
    if not document["complete"]:
        lines.append("NOT READ TO ITS END AS IT STANDS: figures are those of the blocks that could be read")
    lines.append("\nfindings:")
    for finding in document["findings"]:
        place = f"{finding['line']}:{finding['column']}" if finding["column"] else f"{finding['line'] or '-'}"
        lines.append(f"  {finding['severity']:<7} {place:>9}  {finding['text']}")
    lines += ["  none"] if not document["findings"] else []
    lines.append("\nnot acted upon:")
    for word in document["unsupported"]:
        lines.append(f"  {word['code']:<7} {word['line']}:{word['column']}  {word['text']}")
    lines += ["  nothing"] if not document["unsupported"] else []
    lines.append("\ncodes used (times, first line):")
    lines += [f"  {code['code']:<6} {code['count']:>7}  {code['line']:>7}  {code['text']}" for code in document["used"]]
    lines.append("\nextents of cuts:")
    for unit, key in (("mm", "extents_mm"), ("deg", "extents_deg")):
        lines += [
            f"  {axis.upper()}  {low:10.3f} to {high:10.3f} {unit}" for axis, (low, high) in document[key].items()
        ]
    lines.append("\nlengths and times:")
    for key, length in document["lengths_mm"].items():
        lines.append(f"  {key:<8} {length:12.1f} mm {document['times_s'][key]:10.1f} s")
    if "dwell" in document["times_s"]:
        lines.append(f"  dwell    {'':12}    {document['times_s']['dwell']:10.1f} s")
    if document["fastest_strut"]:
        speed = document["fastest_strut"]
        lines.append(f"  fastest strut in a cut: {speed['mm_per_min']:.0f} mm/min, line {speed['line']}")
    tables = check_tables(document["tools"], document["operations"])
    lines += ["\nextents of cuts in mm, by tool and operation:", *(f"  {line}" for line in tables)] if tables else []
    lines.append("\nmodal state at the start, at the end:")
    for key, value in document["modal_start"].items():
        lines.append(f"  {key:<18} {value:<10} {document['modal_end'][key]}")
    return "\n".join(lines) + "\n"
