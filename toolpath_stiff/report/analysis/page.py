"""`report.html`: one file with path, profile, program and tables; nothing is loaded from anywhere.

The path is drawn on a 2-D canvas by our own script (assets/): it needs no graphics driver, prints, and adds 30 kB where
a plotting library would add megabytes. Everything that comes from the program or a file name is escaped: in tables by
the templates, in the script's data as JSON without `<`, `>`, `&`; the script writes it as text, never as HTML; and a
content security policy lets only our own script run.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.report.analysis.path import cutting_box, legend_extend, scale_limits
from toolpath_stiff.report.figure import page_colours
from toolpath_stiff.report.figure_words import (
    ONLY_PLUNGES,
    READERS,
    compared_rows,
    figures_in_words,
    headline_text,
    length_in_moves,
    only_plunges,
    place_words,
    plunges_beside,
    span_of,
)
from toolpath_stiff.report.pages import bullets, markup, render_pieces, table
from toolpath_stiff.report.profile import extremes_by_column, profile_curve
from toolpath_stiff.report.words import duration, plain, shortened
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from toolpath_stiff.analysis.results import Analysis

SCRIPTS = ("stage.js", "viewer.js", "profile.js", "analysis.js")


def page(analysis: Analysis, *, show_plunges: bool = False) -> str:
    """The page as text."""
    return "".join(page_pieces(analysis, show_plunges=show_plunges))


def page_pieces(analysis: Analysis, *, show_plunges: bool = False) -> Iterator[str]:
    """The page in pieces of text; `show_plunges`: how the switch stands that lets plunges set axis and colour scale."""
    summary, data = analysis.to_dict(), page_data(analysis)
    return render_pieces(
        "analysis.html",
        styles=["viewer.css", "analysis.css"],
        scripts=SCRIPTS,
        data=data,
        title=f"{summary['program']}: stiffness along the path",
        program=summary["program"],
        heading=_heading(summary),
        plunges_shown=show_plunges,
        warnings=summary["warnings"],
        note=_thinned_note(data["count"], len(analysis.samples)),
        tables=page_tables(summary, data["weakest"]),
    )


def _heading(summary: Mapping[str, Any]) -> str:
    return (
        f"machine {summary['machine']} · load {summary['load']}, {summary['force_N']:g} N · "
        f"{headline_text(summary, ' · ')}"
    )


def _thinned_note(shown: int, samples: int) -> str:
    if shown == samples:
        return ""
    return (
        f"The drawing holds {number(shown)} of the {number(samples)} samples, the highest and lowest "
        "stiffness of every stretch among them; the tables are of all."
    )


TITLES = ("mean N/mm", "min N/mm", "max N/mm", "range N/mm", "mean deflection um")
PLUNGES_TITLE = "plunges N/mm"
PLACE = '<button type="button" class="place" data-line="{}" data-sample="{}">line {}</button>'
OPERATION = '<button type="button" class="operation" data-operation="{}">{}</button>'
MOST_ROWS = 200  # of lines below the required stiffness; all are in summary.json


def page_tables(summary: Mapping[str, Any], weakest: Sequence[int]) -> list[tuple[str, Markup, bool]]:
    """Title, content and whether it is wide, of each: figures, weakest places, tools, operations and all the rest.

    `weakest` holds the page's rows of the weakest places.
    """
    several = len(summary["per_operation"]) > 1
    tables = [
        ("Tools", _tools(summary["per_tool"]), True),
        ("Operations", _operations(summary["per_operation"]) if several else Markup(), True),
        ("Figures", _figures(summary), False),
        ("Weakest places", _places(summary["weakest_places"], weakest), False),
        ("Required stiffness", _required(summary["required"]) if "required" in summary else Markup(), False),
        ("Comparison", _comparison(summary) if "compare" in summary else Markup(), False),
        ("Assumptions", bullets(summary["assumptions"]), False),
        ("Read, but not acted upon", _unsupported(summary["unsupported"]), False),
    ]
    return [entry for entry in tables if entry[1]]


def _figures(summary: Mapping[str, Any]) -> Markup:
    origin = " ".join(f"{axis}{v:.10g}" for axis, v in zip("XYZABC", summary["origin_mm_deg"], strict=True))
    shown = figures_in_words(summary)
    rows = [(title[0].upper() + title[1:], text) for title, text in zip(TITLES, shown, strict=True)]
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
    return table((), [("", row) for row in rows])


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


def _places(places: Sequence[Mapping[str, Any]], weakest: Sequence[int]) -> Markup:
    rows = []
    for place, row in zip(places, weakest, strict=True):
        button, text = markup(PLACE, place["line"], row, place["line"]), markup("<code>{}</code>", place["text"])
        rows.append(("", (button, number(place["stiffness_N_per_mm"]), place_words(place, 2), text)))
    return table(("", "N/mm", "position mm", "program"), rows, (1,))


def _tools(per_tool: Sequence[Mapping[str, Any]]) -> Markup:
    rows = [
        (
            "",
            (
                f"T{row['tool']}",
                row["remark"],
                "reference" if row["length_mm"] is None else number(row["length_mm"], 2),
                *_part_figures(row),
            ),
        )
        for row in per_tool
    ]
    head = ("tool", "remark", "length mm", "cutting mm", "time", *TITLES, PLUNGES_TITLE, "weakest")
    return table(head, rows, range(2, 11))


def _part_figures(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Length, time, stiffness and weakest place of a tool or an operation."""
    return (
        number(row["cutting_length_mm"], 1),
        duration(row["time_s"]),
        *figures_in_words(row),
        _beside(row),
        _weakest(row["weakest"]),
    )


def _weakest(place: Mapping[str, Any] | None) -> str:
    if place is None:
        return "-"
    return markup('line {} <code class="cut">{}</code>', place["line"], shortened(place["text"], 26))


def _operations(per_operation: Sequence[Mapping[str, Any]]) -> Markup:
    rows = []
    for part, row in enumerate(per_operation[:MOST_ROWS]):
        cells = (
            markup(OPERATION, part, f"{row['operation']} {row['name']}"),
            f"T{row['tool']}" if row["tool"] else "-",
            f"{row['first_line']}-{row['last_line']}",
            *_part_figures(row),
            "-" if row["min_margin"] is None else f"{row['min_margin']:.3f}",
        )
        rows.append(("", cells))
    more = len(per_operation) - len(rows)
    head = ("operation", "tool", "lines", "cutting mm", "time", *TITLES, PLUNGES_TITLE, "weakest", "margin")
    return table(head, rows, (*range(2, 11), 12)) + _and_more(more, " operations in summary.json")


def _required(required: Mapping[str, Any]) -> Markup:
    below = required["below"]
    level = number(required["required_N_per_mm"])
    if not below:
        return markup("<p>Every cutting move has the required {} N/mm.</p>", level)
    more = f", the {MOST_ROWS} weakest of them here" if len(below) > MOST_ROWS else ""
    rows = [("", (f"line {entry['line']}", number(entry["min_N_per_mm"]))) for entry in below[:MOST_ROWS]]
    text = f"{number(len(below))} lines are below the required {level} N/mm{more}:"
    return markup("<p>{}</p>", text) + table(("", "lowest N/mm"), rows, (1,))


def _comparison(summary: Mapping[str, Any]) -> Markup:
    other = summary["compare"]
    figures, plunges = compared_rows(summary, other, TITLES, f"mean of the {PLUNGES_TITLE}")
    rows = [("", row) for row in (*figures, *plunges)]
    return table(("", str(summary["machine"]), str(other["machine"]), "difference"), rows, (1, 2, 3))


def _unsupported(entries: Sequence[Mapping[str, Any]]) -> Markup:
    rows = [
        ("", (f"{entry['line']}:{entry['column']}", markup("<code>{}</code>", entry["word"]), entry["reason"]))
        for entry in entries[:MOST_ROWS]
    ]
    more = len(entries) - len(rows)
    return table(("line:column", "word", "why"), rows) + _and_more(more, "")


def _and_more(count: int, what: str) -> Markup:
    return markup("<p>and {} more{}</p>", count, what) if count > 0 else Markup()


MOST_SAMPLES = 200_000  # on the page: some 5 MB; the tables are always of all samples
OTHER_COLUMNS = 4000  # columns of pixels that the other machine's curve is thinned to
NONE = 65535  # a value that does not exist
OUT_OF_REACH, PLUNGE = 8, 16  # flags beside the motion


def page_data(analysis: Analysis) -> dict[str, Any]:
    """What the page's script reads: lengths in mm, angles in degrees, stiffness in N/mm.

    Positions are 16-bit fractions of the path's own box (`frame`: a 1 m box gives 0.015 mm), stiffness and margin of
    their own ranges, NONE where there is none.
    """
    rows = page_rows(analysis)
    samples, evaluation = analysis.samples.take(rows), analysis.at
    points = mm_from_m(samples.position)
    frame = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
    stiffness, stiffness_range = _fractions(n_per_mm_from_n_per_m(evaluation.stiffness[rows]))
    margin, margin_range = _fractions(evaluation.reach.margin[rows])
    kind = samples.motion + OUT_OF_REACH * ~evaluation.reachable[rows] + PLUNGE * analysis.set_aside[rows]
    tool_starts = np.flatnonzero(np.diff(samples.tool, prepend=-1) != 0)
    return {
        "machine": plain(analysis.machine.name),
        "source": list(analysis.program.source),
        "count": len(rows),
        "samples": len(analysis.samples),
        "motions": MOTION_NAMES,
        "frame": frame.tolist(),
        "box": np.stack(cutting_box(analysis.samples), axis=1).tolist(),
        "position": _base64(_quantised(points, frame[:, 0], frame[:, 1], 65535)),
        "stiffness": stiffness,
        "stiffness_range": stiffness_range,
        "margin": margin,
        "margin_range": margin_range,
        **_angles(deg_from_rad(samples.abc)),
        "line": _base64(samples.line.astype("<u4")),
        "s": _base64(mm_from_m(samples.s).astype("<f4")),
        "kind": _base64(kind.astype("u1")),
        "tools": [[int(i), int(samples.tool[i])] for i in tool_starts],
        "operations": _operation_starts(analysis, samples.move),
        "weakest": [int(np.searchsorted(rows, row)) for row in analysis.weakest_rows],
        "scale": _scale(analysis, False),
        "scale_with_plunges": _scale(analysis, True) if analysis.set_aside.any() else None,
        "plunges": [stiffness_figures(analysis, analysis.set_aside)[f"{end}_N_per_mm"] for end in ("min", "max")],
        **page_colours(),
        "mean": stiffness_figures(analysis, analysis.headline)["mean_N_per_mm"],
        "required": None if analysis.required is None else n_per_mm_from_n_per_m(analysis.required),
        "other": None if analysis.on_other is None else _other_curve(analysis.on_other),
    }


def _scale(analysis: Analysis, show_plunges: bool) -> dict[str, Any]:
    """Ends of the colour scale, N/mm, and whether values lie beyond them."""
    limits = scale_limits(analysis, show_plunges)
    extend = legend_extend(analysis, limits)
    return {"ends": limits, "beyond_low": extend in ("min", "both"), "beyond_high": extend in ("max", "both")}


def page_rows(analysis: Analysis) -> IntArray:
    """Rows of the samples that the page holds: all of them, or the extremes of equal stretches of rows."""
    n = len(analysis.samples)
    if n <= MOST_SAMPLES:
        return np.arange(n)
    change = np.flatnonzero(np.diff(analysis.samples.motion) != 0)
    ends = np.concatenate([change, change + 1]) if 2 * len(change) < MOST_SAMPLES // 4 else change[:0]
    stiffness = np.where(analysis.samples.cutting, analysis.at.stiffness, np.nan)
    curves = [(stiffness, 6)]  # and the share of the page's samples that a curve gets a column of pixels for
    if analysis.set_aside.any():  # a column's extremes may be plunges: the headline has its own
        curves = [(np.where(analysis.set_aside, np.nan, stiffness), 8), (stiffness, 24)]
    extremes = [extremes_by_column(np.arange(n, dtype=float), k, MOST_SAMPLES // part) for k, part in curves]
    even = np.linspace(0, n - 1, MOST_SAMPLES // 12).astype(np.int64)  # rapids and gaps keep their shape too
    firsts = np.searchsorted(analysis.samples.move, [row.first_move for row in analysis.operations.rows])
    wanted = np.array([0, *analysis.weakest_rows], dtype=np.int64)
    return np.unique(np.concatenate([*extremes, even, ends, wanted, firsts, np.maximum(firsts - 1, 0)]))


def _operation_starts(analysis: Analysis, move: IntArray) -> list[list[Any]]:
    """First row on the page, name and first line of each operation; `move` (n,) of the page's rows."""
    rows = analysis.operations.rows
    firsts = np.searchsorted(move, [row.first_move for row in rows]).tolist()
    return [[first, plain(row.name), row.first_line] for first, row in zip(firsts, rows, strict=True)]


def _other_curve(other: Analysis) -> dict[str, str]:
    s, stiffness = profile_curve(other)
    keep = extremes_by_column(s, stiffness, OTHER_COLUMNS)
    return {
        "machine": plain(other.machine.name),
        "s": _base64(s[keep].astype("<f4")),
        "stiffness": _base64(stiffness[keep].astype("<f4")),
        "plunge": _base64(other.set_aside[keep].astype("u1")),
    }


def _angles(degrees: FloatArray) -> dict[str, Any]:
    """Roll, pitch and yaw, if any sample has one."""
    if not degrees.any():
        return {"angles": None, "angle_ranges": None}
    packed = [_fractions(column) for column in degrees.T]
    return {"angles": [text for text, _ in packed], "angle_ranges": [ends for _, ends in packed]}


def _fractions(values: FloatArray) -> tuple[str, list[float]]:
    """16-bit fractions of the range of the finite values, in base64, and that range."""
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    fractions = _quantised(np.where(finite, values, low), np.float64(low), np.float64(high), NONE - 1)
    return _base64(np.where(finite, fractions, NONE).astype("<u2")), [low, high]


def _quantised(values: FloatArray, low: Any, high: Any, steps: int) -> NDArray[np.uint16]:
    span = np.where(high > low, high - low, 1.0)
    return np.asarray(np.round((values - low) / span * steps)).astype("<u2")


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
