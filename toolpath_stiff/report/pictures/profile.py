"""`profile.png`: stiffness along the path."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import TICKUP
from matplotlib.ticker import FuncFormatter, MaxNLocator

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.documents import number
from toolpath_stiff.report.colours import INK, MUTED, ORANGE, RED, SLATE
from toolpath_stiff.report.curves import extremes_by_column, profile_band, profile_curve
from toolpath_stiff.report.pictures.labels import add_heading, add_legend, label_places
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

WIDTH, HEIGHT = 14.0, 6.2  # inches
LEFT, RIGHT, TOP, BOTTOM = 1.05, 0.45, 1.45, 0.75
STEPS = (1, 2, 2.5, 5, 10)  # between ticks
CURVE_BLUE = "#2b59c3"
Curve = tuple[FloatArray, FloatArray]  # mm along the path, N/mm


def profile(analysis: Analysis) -> Figure:
    """Stiffness over path length; a second curve for the other machine; the required level, red below it.

    Plunges beside the headline are grey and do not set the axis.
    """
    figure = new_figure(WIDTH, HEIGHT)
    axes = panel(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM)
    s, k = curve = profile_curve(analysis)
    others = [] if analysis.on_other is None else [profile_curve(analysis.on_other)]
    band = profile_band(analysis)
    _set_limits(axes, analysis, [k, *(other[1] for other in others), *(band or ())])
    _shade(axes, s, ~analysis.samples.cutting, "#eef1f4", "rapid")
    _shade(axes, s, analysis.out_of_reach, "#f6c9c9", "out of reach")
    columns = int(axes.get_window_extent().width)
    if analysis.on_other is not None:
        _curve(axes, analysis.on_other, others[0], columns, (ORANGE, ORANGE, 3), "_")
    if band is not None:
        _draw_band(axes, s, band, columns)
    _curve(axes, analysis, curve, columns, (CURVE_BLUE, SLATE, 4), "plunges")
    _levels(axes, analysis)
    _line_numbers(axes, analysis)
    places = analysis.weakest_rows
    spots = [(float(s[row]), float(k[row])) for row in places]
    label_places(axes, spots, [f"line {analysis.samples.line[row]}" for row in places], below=True)
    _legend(figure, axes)
    add_heading(figure, analysis)
    return figure


def _curve(
    axes: Axes, analysis: Analysis, curve: Curve, columns: int, look: tuple[str, str, int], plunges: str
) -> None:
    """Draw the curve of a machine, with the plunges it leaves out as thin lines.

    `look`: colour of the curve and of the plunges, order. `plunges`: their name; one that
    begins with "_" does not enter the legend (matplotlib's rule).
    """
    colour, aside, order = look
    s, k = curve
    keep = extremes_by_column(s, k, columns)
    name = shortened(plain(analysis.machine.name), 30)
    axes.plot(s[keep], k[keep], color=colour, linewidth=1.3, label=name, zorder=order)
    if not analysis.set_aside.any():
        return
    k = np.where(analysis.set_aside, n_per_mm_from_n_per_m(analysis.at.stiffness), np.nan)
    keep = extremes_by_column(s, k, columns)
    style: Look = {"color": aside, "linewidth": 1.3, "linestyle": (0, (2, 1))}
    axes.plot(s[keep], k[keep], zorder=order - 0.5, label=plunges, **style)


def _runs(rows: BoolArray) -> tuple[IntArray, IntArray]:
    """First and last row of every run in which `rows` holds."""
    edges = np.diff(np.concatenate([[0], rows.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1


def _draw_band(axes: Axes, s: FloatArray, band: tuple[FloatArray, FloatArray], columns: int) -> None:
    low, high = band
    # Rows that keep the extremes of both edges: rows of one edge alone would clip the other's.
    keep = np.union1d(extremes_by_column(s, low, columns), extremes_by_column(s, high, columns))
    axes.fill_between(s[keep], low[keep], high[keep], color=CURVE_BLUE, alpha=0.18, lw=0, zorder=3, label="95 % band")


def _set_limits(axes: Axes, analysis: Analysis, curves: Sequence[FloatArray]) -> None:
    low, high = float(min(np.nanmin(k) for k in curves)), float(max(np.nanmax(k) for k in curves))
    if analysis.required is not None:
        level = n_per_mm_from_n_per_m(analysis.required)
        low, high = min(low, level), max(high, level)
    pad = max(0.12 * (high - low), 0.005 * high)
    axes.set_ylim(max(low - pad, 0.0), high + pad)
    end = mm_from_m(float(analysis.samples.s[-1]))
    axes.set(
        xlim=(0.0, end or 1.0), xlabel="path length, mm (rapids included)", ylabel="stiffness along the load, N/mm"
    )
    axes.xaxis.set_major_locator(MaxNLocator(8, steps=STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=STEPS))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 0 if end > 20 else 2)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 0 if high - low > 5 else 2)))
    axes.grid(axis="x", visible=False)


def _shade(axes: Axes, s: FloatArray, rows: BoolArray, colour: str, label: str) -> None:
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
    axes.axhline(level, color=RED, linewidth=1.3, zorder=5, label=f"required {number(level)} N/mm")


def _line_numbers(axes: Axes, analysis: Analysis) -> None:
    end = float(analysis.samples.s[-1])
    where = np.linspace(0.0, end, 11)[:-1] + end / 20.0
    rows = np.minimum(np.searchsorted(analysis.samples.s, where), len(analysis.samples) - 1)
    across = axes.get_xaxis_transform()
    places = mm_from_m(where)
    axes.plot(
        places, np.ones(len(places)), linestyle="none", marker=TICKUP, markersize=3.5, color=MUTED,
        markeredgewidth=0.8, transform=across, clip_on=False, zorder=2,
    )  # fmt: skip
    words: Look = {"fontsize": 9.0, "color": MUTED, "ha": "center", "textcoords": "offset points"}
    for place, row in zip(places.tolist(), rows.tolist(), strict=True):
        axes.annotate(str(analysis.samples.line[row]), (place, 1.0), (0.0, 7.0), xycoords=across, **words)
    axes.annotate("program line", (0.5, 1.0), (0.0, 20.0), xycoords="axes fraction", **words)


def _legend(figure: Figure, axes: Axes) -> None:
    keys = list(zip(*axes.get_legend_handles_labels(), strict=True))
    add_legend(
        figure, keys, (1.0 - RIGHT / WIDTH, 1.0 - 0.25 / HEIGHT), loc="upper right", ncols=len(keys), fontsize=9.5,
        columnspacing=1.4, handlelength=1.8,
    )  # fmt: skip
