"""`profile.png`: stiffness along the path."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.report.figure import (
    DPI,
    INK,
    MUTED,
    PLUNGE_SLATE,
    POINTS,
    SECOND_ORANGE,
    UNREACHABLE_RED,
    new_figure,
    picture,
)
from toolpath_stiff.report.painting import add_heading, add_legend, label_places
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path

    from toolpath_stiff.analysis.results import Analysis


WIDTH, HEIGHT = 14.0, 6.2  # inches
LEFT, RIGHT, TOP, BOTTOM = 1.05, 0.45, 1.45, 0.75
STRIP = 0.22  # height of the operations above the frame
OPERATION_COLOURS = ("#ebeff4", "#d9e0e8")  # in turn
NAME_SIZE, DIGIT, INSET = 8.5, 5.0, 4.0  # points; pixels that the narrowest number needs; pixels before a name
CURVE_BLUE = "#2b59c3"
BAND_LABEL = "95 % of the fitted parameters"
MOST_TOOL_LABELS, MOST_TOOL_LINES = 14, 60
MOST_ARROWS = 200  # of plunges beyond the axis; more would be a row of arrowheads
MOST_OPERATIONS = 200  # boxes above the frame; more would be narrower than seven pixels


@picture
def profile_picture(analysis: Analysis, *, show_plunges: bool = False) -> Figure:
    """Stiffness against path length, as PNG; on the other machine a second curve; the required level, red below it.

    With `show_plunges` the axis holds the plunges beside the headline, and they belong to the curve; else they are
    grey, and arrows say where they leave the axis.
    """
    strip = STRIP if 1 < len(analysis.operations.rows) <= MOST_OPERATIONS else 0.0
    figure = new_figure(WIDTH, HEIGHT)
    frame = HEIGHT - TOP - BOTTOM - strip
    axes = figure.add_axes((LEFT / WIDTH, BOTTOM / HEIGHT, 1.0 - (LEFT + RIGHT) / WIDTH, frame / HEIGHT))
    s, k = profile_curve(analysis, show_plunges)
    band = profile_band(analysis, show_plunges)
    _set_limits(axes, analysis, band, show_plunges)
    _shade(axes, s, ~analysis.samples.cutting, "#eef1f4", "rapid")
    _shade(axes, s, analysis.out_of_reach, "#f6c9c9", "out of reach")
    columns = int(axes.get_window_extent().width)
    if (other := analysis.on_other) is not None:
        s2, k2 = profile_curve(other, show_plunges)
        keep = extremes_by_column(s2, k2, columns)
        name = shortened(plain(other.machine.name), 30)
        axes.plot(s2[keep], k2[keep], color=SECOND_ORANGE, linewidth=1.3, label=name, zorder=3)
        _draw_plunges(axes, other, columns, SECOND_ORANGE, show_plunges, "_")
    if band is not None:
        _draw_band(axes, s, band, columns)
    keep = extremes_by_column(s, k, columns)
    name = shortened(plain(analysis.machine.name), 30)
    axes.plot(s[keep], k[keep], color=CURVE_BLUE, linewidth=1.3, label=name, zorder=4)
    _draw_plunges(axes, analysis, columns, PLUNGE_SLATE, show_plunges, "plunges")
    _levels(axes, analysis)
    _tool_changes(axes, analysis)
    if strip:
        _operations(axes, analysis, strip / frame)
    _line_numbers(axes, analysis, 1.0 + strip / frame)
    places = analysis.weakest_rows
    spots = [(float(s[row]), float(k[row])) for row in places]
    label_places(axes, spots, [f"line {analysis.samples.line[row]}" for row in places], below=True)
    _legend(figure, axes)
    add_heading(figure, analysis)
    return figure


def profile_curve(analysis: Analysis, with_plunges: bool = True) -> tuple[FloatArray, FloatArray]:
    """Path length in mm and stiffness in N/mm of every sample; nan on rapids and out of reach.

    Without `with_plunges` also nan on the plunges beside the headline.
    """
    stiffness = n_per_mm_from_n_per_m(analysis.at.stiffness)
    drawn = analysis.samples.cutting & (with_plunges | ~analysis.set_aside)
    return mm_from_m(analysis.samples.s), np.where(drawn, stiffness, np.nan)


def _draw_plunges(axes: Axes, analysis: Analysis, columns: int, colour: str, show_plunges: bool, label: str) -> None:
    """The plunges that the curve leaves out: thin lines, and arrows at the edge of the axes that they leave.

    A `label` that begins with "_" does not enter the legend (matplotlib's rule).
    """
    if show_plunges or not analysis.set_aside.any():
        return
    s = mm_from_m(analysis.samples.s)
    k = np.where(analysis.set_aside, n_per_mm_from_n_per_m(analysis.at.stiffness), np.nan)
    keep = extremes_by_column(s, k, columns)
    low, high = axes.get_ylim()
    above, below = k > high, k < low
    marker = "^" if above.any() else "v" if below.any() else "none"  # in the legend: of what is seen of them
    axes.plot(s[keep], k[keep], color=colour, linewidth=1.3, linestyle=(0, (2, 1)), zorder=3.5)
    axes.plot([], [], color=colour, linewidth=1.3, linestyle=(0, (2, 1)), marker=marker, markersize=5, label=label)
    for beyond, edge, tail in ((above, 1.0, -20.0), (below, 0.0, 20.0)):
        start, stop = _runs(beyond)
        middles = ((s[start] + s[stop]) / 2.0)[:MOST_ARROWS]
        axes.plot(
            middles, np.full(len(middles), edge), linestyle="none", marker=_arrow(tail), markersize=2.0 * abs(tail),
            color=colour, markeredgewidth=1.1, transform=axes.get_xaxis_transform(), clip_on=False, zorder=6,
        )  # fmt: skip


def _arrow(tail: float) -> Path:
    """A marker whose tip is the place: from `tail`, points above it, to a filled head."""
    from matplotlib.path import Path

    head = np.sign(tail) * 7.0
    points = [(0.0, tail), (0.0, head), (-2.8, head), (0.0, 0.0), (2.8, head), (0.0, head), (0.0, tail)]
    return Path(points, [Path.MOVETO, *[Path.LINETO] * 5, Path.CLOSEPOLY])


def _runs(rows: BoolArray) -> tuple[IntArray, IntArray]:
    """First and last row of every run in which `rows` holds."""
    edges = np.diff(np.concatenate([[0], rows.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1


def profile_band(analysis: Analysis, with_plunges: bool = True) -> tuple[FloatArray, FloatArray] | None:
    """Lower and upper end of the 95 % band of every sample in N/mm, nan as in `profile_curve`; None without a band."""
    band = analysis.parameter_band
    if band is None:
        return None
    _, k = profile_curve(analysis, with_plunges)
    reach = defaults.NORMAL_95 * n_per_mm_from_n_per_m(band.deviation)
    return k - reach, k + reach


def _draw_band(axes: Axes, s: FloatArray, band: tuple[FloatArray, FloatArray], columns: int) -> None:
    low, high = band
    # Rows that keep the extremes of both edges: a band drawn on either's rows alone would cut the other's.
    keep = np.union1d(extremes_by_column(s, low, columns), extremes_by_column(s, high, columns))
    axes.fill_between(
        s[keep], low[keep], high[keep], color=CURVE_BLUE, alpha=0.18, linewidth=0, zorder=3, label=BAND_LABEL
    )


def extremes_by_column(x: FloatArray, y: FloatArray, columns: int) -> IntArray:
    """Rows that draw the same picture as all of them on `columns` pixels, in order.

    Of every run of rows in one column of pixels the first, the last, the lowest and the highest are kept, so no
    extreme is lost; of a run of nan the first, which keeps the gap. x ascends.
    """
    if len(x) <= 4 * columns:
        return np.arange(len(x))
    span = float(x[-1] - x[0])
    column = np.zeros(len(x), dtype=np.int64) if span == 0.0 else ((x - x[0]) / span * columns).astype(np.int64)
    missing = np.isnan(y)
    fresh = np.concatenate([[True], (np.diff(column) != 0) | (missing[1:] != missing[:-1])])
    first = np.flatnonzero(fresh)
    last = np.append(first[1:], len(x)) - 1
    run = np.cumsum(fresh) - 1
    lowest = np.flatnonzero(y == np.minimum.reduceat(y, first)[run])
    highest = np.flatnonzero(y == np.maximum.reduceat(y, first)[run])
    lowest = lowest[np.diff(run[lowest], prepend=-1) != 0]  # the first of equals
    highest = highest[np.diff(run[highest], append=-1) != 0]  # the last of equals
    kept = np.concatenate([first, last, lowest, highest])
    rows = np.unique(kept)
    return np.asarray(rows[~missing[rows] | fresh[rows]])


def _set_limits(axes: Axes, analysis: Analysis, band: tuple[FloatArray, FloatArray] | None, show_plunges: bool) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    machines = [analysis, *([analysis.on_other] if analysis.on_other else [])]
    curves = [*(profile_curve(machine, show_plunges)[1] for machine in machines), *(band or ())]
    low, high = float(min(np.nanmin(k) for k in curves)), float(max(np.nanmax(k) for k in curves))
    if analysis.required is not None:
        level = n_per_mm_from_n_per_m(analysis.required)
        low, high = min(low, level), max(high, level)
    pad = max(0.12 * (high - low), 0.005 * high)
    axes.set_ylim(max(low - pad, 0.0), high + pad)
    end = mm_from_m(float(analysis.samples.s[-1]))
    axes.set_xlim(0.0, end or 1.0)
    axes.set_xlabel("path length, mm (rapids included)")
    axes.set_ylabel("stiffness along the load, N/mm")
    axes.xaxis.set_major_locator(MaxNLocator(12, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 0 if end > 20 else 2)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 0 if high - low > 5 else 2)))
    axes.grid(axis="x", visible=False)


def _shade(axes: Axes, s: FloatArray, rows: BoolArray, colour: str, label: str) -> None:
    """Shade the spans of path in which `rows` holds."""
    start, stop = _runs(rows)
    if not len(start):
        return
    low, high = axes.get_ylim()
    spans = [(float(s[i]), float(s[j] - s[i])) for i, j in zip(start, stop, strict=True)]
    axes.broken_barh(spans, (low, high - low), facecolor=colour, edgecolor="none", label=label, zorder=1)


def _levels(axes: Axes, analysis: Analysis) -> None:
    mean = stiffness_figures(analysis, analysis.headline)["mean_N_per_mm"]
    if mean is not None:
        axes.axhline(mean, color=INK, linewidth=1.0, linestyle=(0, (6, 3)), zorder=5, label=f"mean {number(mean)} N/mm")
    if analysis.required is None:
        return
    level = n_per_mm_from_n_per_m(analysis.required)
    axes.axhline(level, color=UNREACHABLE_RED, linewidth=1.3, zorder=5, label=f"required {number(level)} N/mm")


def _tool_changes(axes: Axes, analysis: Analysis) -> None:
    """A dotted line where another tool takes over, while they can be told apart; labels while they are few."""
    samples = analysis.samples
    changes = np.flatnonzero(np.diff(samples.tool) != 0) + 1
    if not 0 < len(changes) <= MOST_TOOL_LINES:
        return
    s = mm_from_m(samples.s[changes])
    axes.vlines(s, 0, 1, transform=axes.get_xaxis_transform(), color=MUTED, linewidth=0.9, linestyle=":", zorder=2)
    if len(changes) > MOST_TOOL_LABELS:
        return
    for where, row in zip(s, changes, strict=True):
        axes.annotate(
            f"T{samples.tool[row]}",
            (float(where), 0.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(4, 5),
            textcoords="offset points",
            fontsize=9,
            color=MUTED,
        )


def _operations(axes: Axes, analysis: Analysis, height: float) -> None:
    """Named boxes above the frame, `height` of its height; lines where they begin, while these can be told apart."""
    rows = analysis.operations.rows
    first = np.searchsorted(analysis.samples.move, [row.first_move for row in rows])
    edges = mm_from_m(np.append(analysis.samples.s[first], analysis.samples.s[-1]))
    spans = list(zip(edges[:-1].tolist(), np.diff(edges).tolist(), strict=True))
    across = axes.get_xaxis_transform()
    if len(rows) <= MOST_TOOL_LINES:
        axes.vlines(edges[1:-1], 0, 1, transform=across, color=MUTED, linewidth=0.9, linestyle=":", zorder=2)
    for which, colour in enumerate(OPERATION_COLOURS):
        axes.broken_barh(
            spans[which::2],
            (1.0, height),
            facecolor=colour,
            edgecolor="none",
            transform=across,
            clip_on=False,
            zorder=2,
        )
    pixels = float(axes.get_window_extent().width) / float(edges[-1] or 1.0)
    inset = INSET / DPI * POINTS
    for row, (start, length) in zip(rows, spans, strict=True):
        text = _fitting(f"{row.number} {plain(row.name)}", str(row.number), length * pixels - 2.0 * INSET)
        if text:
            axes.annotate(
                text, (start, 1.0 + height / 2.0), (inset, 0.0), xycoords=across, textcoords="offset points",
                fontsize=NAME_SIZE, va="center", zorder=6, annotation_clip=False,
            )  # fmt: skip


def _fitting(text: str, least: str, room: float) -> str:
    """The text cut to `room` pixels; `least` if next to nothing of it would be left, or nothing at all."""
    from matplotlib.font_manager import FontProperties

    agg: Any = importlib.import_module("matplotlib.backends.backend_agg")  # its own types are wanting

    # Typesetting a long name is slow; what is beyond one character a pixel never fits.
    text = shortened(text, max(int(room), len(least)))
    renderer, font = agg.RendererAgg(1, 1, DPI), FontProperties(size=NAME_SIZE)

    def fits(words: str) -> bool:
        return float(renderer.get_text_width_height_descent(words, font, ismath=False)[0]) <= room

    if room < DIGIT or not fits(least):
        return ""
    if fits(text):
        return text
    low, high = len(least) + 4, len(text)  # a name of four letters and less tells nothing
    if high <= low or not fits(shortened(text, low)):
        return least
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(shortened(text, middle)) else (low, middle)
    return shortened(text, low)


def _line_numbers(axes: Axes, analysis: Analysis, height: float) -> None:
    """Program lines above the frame, at `height` of its height, where the ticks below fall."""
    from matplotlib.markers import TICKUP

    end = float(analysis.samples.s[-1])
    where = np.linspace(0.0, end, 13)[:-1] + end / 24.0
    rows = np.minimum(np.searchsorted(analysis.samples.s, where), len(analysis.samples) - 1)
    across = axes.get_xaxis_transform()
    places = mm_from_m(where)
    axes.plot(
        places, np.full(len(places), height), linestyle="none", marker=TICKUP, markersize=3.5, color=MUTED,
        markeredgewidth=0.8, transform=across, clip_on=False, zorder=2,
    )  # fmt: skip
    words: dict[str, Any] = {
        "fontsize": 9.0,
        "color": MUTED,
        "ha": "center",
        "textcoords": "offset points",
        "annotation_clip": False,
    }
    for place, row in zip(places.tolist(), rows.tolist(), strict=True):
        axes.annotate(str(analysis.samples.line[row]), (place, height), (0.0, 7.0), xycoords=across, **words)
    axes.annotate("program line", (0.5, height), (0.0, 20.0), xycoords="axes fraction", **words)


def _legend(figure: Figure, axes: Axes) -> None:
    keys = list(zip(*axes.get_legend_handles_labels(), strict=True))
    corner = 1.0 - RIGHT / WIDTH, 1.0 - 0.25 / HEIGHT
    add_legend(
        figure, keys, corner, loc="upper right", ncols=len(keys) or 1, fontsize=9.5, columnspacing=1.4, handlelength=1.8
    )
