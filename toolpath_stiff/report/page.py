"""`report.html`: one file with path, profile, program and tables; nothing is loaded from anywhere.

The path is drawn on a 2-D canvas by our own script (assets/): it needs no graphics driver, prints, and adds 30 kB where
a plotting library would add megabytes. Everything that comes from the program or a file name is escaped: in tables by
`html.escape`, in the script's data as JSON without `<`, `>`, `&`; the script writes it as text, never as HTML; and a
content security policy lets only our own script run.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from toolpath_stiff.report.page_data import page_data
from toolpath_stiff.report.page_tables import page_tables
from toolpath_stiff.report.template import asset, filled, script_hash, style
from toolpath_stiff.report.wording import headline_text, number, plain

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis

SCRIPTS = ("path_data.js", "path_view.js", "profile_view.js", "listing.js", "operations.js")


def page(
    analysis: Analysis,
    summary: Mapping[str, Any],
    *,
    required: float | None = None,
    other: Analysis | None = None,
    show_plunges: bool = False,
) -> str:
    """The page as text.

    Parameters
    ----------
    analysis
        What to show.
    summary
        As in `summary.json`, for the tables.
    required
        N/m: drawn in the profile.
    other
        The same program on another machine: a second curve.
    show_plunges
        How the switch stands that lets plunges set the axis and the colour scale.
    """
    data = page_data(analysis, required, other)
    script = '\n"use strict";\n(() => {\n' + "".join(asset(name) for name in SCRIPTS) + "})();\n"
    program = html.escape(plain(str(summary["program"])))
    return filled(
        asset("report.html"),
        {
            "title": f"{program}: stiffness along the path",
            "program": program,
            "heading": html.escape(_heading(summary)),
            "style": style("report.css"),
            "script": script,
            "script_hash": script_hash(script),
            "data": json_for_script(data),
            "plunges_shown": " checked" if show_plunges else "",
            "warnings": "\n".join(f'<p class="warning">{html.escape(plain(w))}</p>' for w in summary["warnings"]),
            "note": _thinned_note(data["count"], len(analysis.samples)),
            "tables": page_tables(summary, data["weakest"]),
            "version": html.escape(str(summary["version"])),
        },
    )


def json_for_script(value: Any) -> str:
    """JSON that can stand inside a script element: nothing in it ends the element, or a line of JavaScript."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    # A lone surrogate (a byte that was no text) cannot be written as UTF-8, and browsers stumble over it.
    return re.sub("[\ud800-\udfff]", "\N{REPLACEMENT CHARACTER}", text)


def _heading(summary: Mapping[str, Any]) -> str:
    return (
        f"machine {plain(str(summary['machine']))} · load {summary['load']}, {summary['force_N']:g} N · "
        f"{headline_text(summary, ' · ')}"
    )


def _thinned_note(shown: int, samples: int) -> str:
    if shown == samples:
        return ""
    return (
        f'<p class="muted">The drawing holds {number(shown)} of the {number(samples)} samples, the highest and lowest '
        "stiffness of every stretch among them; the tables are of all.</p>"
    )
