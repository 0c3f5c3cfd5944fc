"""`report.html`: one file with path, profile, program and tables; nothing is loaded from anywhere.

The path is drawn on a 2-D canvas by our own script (assets/): it needs no graphics driver, prints, and adds 30 kB where
a plotting library would add megabytes. Everything that comes from the program or a file name is escaped: in tables by
the templates, in the script's data as JSON without `<`, `>`, `&`; the script writes it as text, never as HTML; and a
content security policy lets only our own script run.
"""

import base64
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.documents import Document, number
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.report import analysis_tables as words
from toolpath_stiff.report.curves import beyond_scale, cutting_box, extremes_by_column, profile_curve, scale_limits
from toolpath_stiff.report.cut import cut_tables
from toolpath_stiff.report.pages import Part, markup, part, render
from toolpath_stiff.report.scene import machine_scene
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m

SCRIPTS = ("stage.js", "elements.js", "viewer.js", "solids.js", "machine.js", "profile.js", "listing.js", "analysis.js")


def page(analysis: Analysis, drawn: Mapping[str, bytes]) -> Iterator[str]:
    """The page in pieces of text."""
    summary, rows = analysis.to_dict(), page_rows(analysis)
    data = _data(analysis, rows)
    machine, load = f"machine {summary['machine']}", f"load {summary['load']}, {summary['force_N']:g} N"
    return render(
        "analysis.html",
        styles=["viewer.css", "analysis.css"],
        scripts=SCRIPTS if analysis.cut is None else (*SCRIPTS, "part.js"),
        cut=analysis.cut is not None,
        shown=data,
        number=number,
        analysis=analysis,
        data=data,
        title=f"{summary['program']}: stiffness along the path",
        program=summary["program"],
        heading=" · ".join([machine, load, words.headline_text(summary, " · ")]),
        warnings=summary["warnings"],
        note=_thinned_note(data["count"], len(analysis.samples)),
        tables=_tables(analysis, data["weakest"], rows),
    )


def _thinned_note(shown: int, samples: int) -> str:
    if shown == samples:
        return ""
    return (
        f"The drawing holds {number(shown)} of the {number(samples)} samples, the highest and lowest "
        "stiffness of every stretch among them; the tables are of all."
    )


def _tables(analysis: Analysis, weakest: Sequence[int], rows: IntArray) -> list[tuple[str, Markup, bool]]:
    """Title, content and True if wide, of each table; `weakest` of the page's `rows`: the weakest places."""
    summary, other = analysis.to_dict(), analysis.on_other
    operations, unsupported = summary["per_operation"], summary["unsupported"]
    more = words.and_more(operations, words.MOST_ROWS, "operations")
    more_words = words.and_more(unsupported, words.MOST_ROWS, "words")
    ignored = [
        (f"{entry['line']}:{entry['column']}", markup("<code>{}</code>", entry["word"]), entry["reason"])
        for entry in unsupported[: words.MOST_ROWS]
    ]
    figures = [
        *words.facts(summary),
        ("deflection", f"mean {number(summary['mean_deflection_um'], 2)} um along the load, under the force assumed"),
        ("effects", ", ".join(summary["effects"]) or "none acts"),
    ]
    tables: list[tuple[str, Sequence[Part], bool]] = [
        ("Tools", [words.tool_table(summary["per_tool"])], True),
        ("Operations", [words.operation_table(operations), *more] if len(operations) > 1 else [], True),
        ("Figures", [ShownTable((), figures)], False),
        ("Weakest places", [_places(summary["weakest_places"], weakest)], False),
        ("Required stiffness", [*words.required(analysis)] if "required" in summary else [], False),
        *cut_tables(analysis, rows),
        ("Comparison", [words.comparison(summary, other.to_dict())] if other is not None else [], False),
        ("Assumptions", [summary["assumptions"]], False),
        ("Read, but not acted upon", [ShownTable(("line:column", "word", "why"), ignored), *more_words], False),
    ]
    shown = ((title, Markup().join(map(part, parts)), wide) for title, parts, wide in tables)
    return [entry for entry in shown if entry[1]]


def _places(places: Sequence[Document], weakest: Sequence[int]) -> ShownTable:
    button = '<button type="button" class="place" data-line="{}" data-sample="{}">line {}</button>'
    rows = [
        (
            markup(button, place["line"], row, place["line"]),
            number(place["stiffness_N_per_mm"]),
            words.position(place, 2),
            markup("<code>{}</code>", place["text"]),
        )
        for place, row in zip(places, weakest, strict=True)
    ]
    return ShownTable(("", ">N/mm", "position mm", "program"), rows)


MOST_QUADS = 8_000  # of walls and of floors on the page
MOST_SAMPLES = 200_000  # on the page: some 5 MB; the tables are always of all samples
OTHER_COLUMNS = 4000  # columns of pixels to which the other machine's curve is thinned
NONE = 65535  # stands for a missing value
OUT_OF_REACH, PLUNGE = 8, 16  # flags beside the motion


def _data(analysis: Analysis, rows: IntArray) -> Document:
    """Data of some samples for the page's script: lengths in mm, angles in degrees, stiffness in N/mm.

    Positions are 16-bit fractions of the path's own box (`frame`: a 1 m box gives 0.015 mm), stiffness and margin of
    their own ranges, NONE where there is none.
    """
    samples, evaluation = analysis.samples.take(rows), analysis.at
    plunges, limits = stiffness_figures(analysis, analysis.set_aside), scale_limits(analysis)
    below, above = beyond_scale(analysis, limits)
    points = mm_from_m(samples.position)
    frame = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
    stiffness, stiffness_range = _fractions(n_per_mm_from_n_per_m(evaluation.stiffness[rows]))
    margin, margin_range = _fractions(evaluation.reach.margin[rows])
    kind = samples.motion + OUT_OF_REACH * ~evaluation.reachable[rows] + PLUNGE * analysis.set_aside[rows]
    return {
        "machine": plain(analysis.machine.name),
        "scene": machine_scene(analysis.machine, np.concatenate([samples.position, samples.abc], axis=1)),
        "source": analysis.program.source,
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
        "tools": [[int(i), int(samples.tool[i])] for i in np.flatnonzero(np.diff(samples.tool, prepend=-1))],
        "operations": _operation_starts(analysis, samples.move),
        "weakest": [int(np.searchsorted(rows, row)) for row in analysis.weakest_rows],
        "scale": {"ends": limits, "beyond_low": below, "beyond_high": above},
        "plunges": [plunges["min_N_per_mm"], plunges["max_N_per_mm"]],
        "mean": stiffness_figures(analysis, analysis.headline)["mean_N_per_mm"],
        "required": None if analysis.required is None else n_per_mm_from_n_per_m(analysis.required),
        "other": None if analysis.on_other is None else _other_curve(analysis.on_other),
        **({} if analysis.cut is None else {"part": _part(analysis, rows)}),
    }


def _part(analysis: Analysis, rows: IntArray) -> Document:
    """Finished part in machine coordinates, its error in um, and the page's row of the sample that made each place."""
    from toolpath_stiff.report.surface import error_limit, in_machine, surface_of

    assert analysis.cut is not None
    quads, error, sample = surface_of(analysis.cut, MOST_QUADS)
    corners = mm_from_m(in_machine(quads.reshape(-1, 3), analysis.origin))
    frame = np.stack([corners.min(axis=0), corners.max(axis=0)], axis=1)
    fractions, ends = _fractions(um_from_m(error))
    nearest = np.clip(np.searchsorted(rows, np.maximum(sample, 0)), 0, len(rows) - 1)
    return {
        "corners": _base64(_quantised(corners, frame[:, 0], frame[:, 1], 65535)),
        "frame": frame.tolist(),
        "error": fractions,
        "error_range": ends,
        "limit": um_from_m(error_limit(analysis.cut)),
        "sample": _base64(np.where(sample < 0, -1, nearest).astype("<i4")),
    }


def page_rows(analysis: Analysis) -> IntArray:
    """Rows of the samples on the page: all, or the extremes of equal stretches of rows."""
    n = len(analysis.samples)
    if n <= MOST_SAMPLES:
        return np.arange(n)
    change = np.flatnonzero(np.diff(analysis.samples.motion) != 0)
    ends = np.concatenate([change, change + 1]) if 2 * len(change) < MOST_SAMPLES // 4 else change[:0]
    stiffness = np.where(analysis.samples.cutting, analysis.at.stiffness, np.nan)
    curves = [(stiffness, 6)]  # with one in how many of the page's samples a curve gets a column of pixels
    if analysis.set_aside.any():  # a column's extremes may be plunges, so the headline gets its own columns
        curves = [(np.where(analysis.set_aside, np.nan, stiffness), 8), (stiffness, 24)]
    extremes = [extremes_by_column(np.arange(n, dtype=float), k, MOST_SAMPLES // part) for k, part in curves]
    even = np.linspace(0, n - 1, MOST_SAMPLES // 12).astype(np.int64)  # rapids and gaps keep their shape too
    firsts = np.searchsorted(analysis.samples.move, [row.first_move for row in analysis.operations.rows])
    kept = np.zeros(n, dtype=bool)
    kept[[0, *analysis.weakest_rows]] = True
    for rows in (*extremes, even, ends, firsts, np.maximum(firsts - 1, 0)):
        kept[rows] = True
    return np.flatnonzero(kept)


def _operation_starts(analysis: Analysis, move: IntArray) -> list[list[object]]:
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
    }


def _angles(degrees: FloatArray) -> Document:
    """Roll, pitch and yaw, if any sample has one."""
    if not degrees.any():
        return {"angles": None, "angle_ranges": None}
    packed = [_fractions(column) for column in degrees.T]
    return {"angles": [text for text, _ in packed], "angle_ranges": [ends for _, ends in packed]}


def _fractions(values: FloatArray) -> tuple[str, list[float]]:
    """16-bit fractions of the range of the finite values, in base64, and that range."""
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    fractions = _quantised(np.where(finite, values, low), low, high, NONE - 1)
    return _base64(np.where(finite, fractions, NONE).astype("<u2")), [low, high]


def _quantised(values: FloatArray, low: ArrayLike, high: ArrayLike, steps: int) -> NDArray[np.uint16]:
    span = np.subtract(high, low)
    return np.asarray(np.round(np.subtract(values, low) / np.where(span > 0.0, span, 1.0) * steps)).astype("<u2")


def _base64(array: NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
