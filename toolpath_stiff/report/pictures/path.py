"""`path.png`: the path from above, the front and the side, coloured by stiffness."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, numbered
from toolpath_stiff.documents import number
from toolpath_stiff.report.colours import CLASSES, GREY, INK, MUTED, RED, SLATE, STIFFNESS
from toolpath_stiff.report.curves import beyond_scale, cutting_box, scale_limits
from toolpath_stiff.report.pictures.labels import add_heading, add_legend, label_places
from toolpath_stiff.report.pictures.style import POINTS, Look, new_figure, panel
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

WIDTH, MOST_HEIGHT = 14.0, 11.0  # inches
LEFT, RIGHT, TOP, BOTTOM, BETWEEN = 0.95, 0.45, 1.35, 0.75, 1.05  # inches around and between the views
MOST_POINTS = 500_000  # most points drawn one by one; beyond, stretches of the path are drawn
UNREACHABLE, PLUNGE = -1, CLASSES  # without a colour of the scale; a lower class wins where segments are joined
STROKE = 1.5  # points
TITLE = 6.0  # points above a view
POINT = 0.05  # length of the pointed end, beyond which there are values, over the colour scale's
THINNEST = 0.38  # a view's shorter side, of the longest: a flat part still gets a readable side view


def path(analysis: Analysis) -> Figure:
    """Three views of the path.

    Top (XY), below it front (XZ), beside that the view from +X (YZ), all at one scale and aligned as on a drawing,
    in machine coordinates. The views frame the cutting moves; rapids may leave them. Stiffer segments are drawn
    first: a weak one is never hidden beneath. Plunges beside the headline are grey and end in a dot, which is all
    that is seen of them from above.
    """
    samples, limits = analysis.samples, scale_limits(analysis)
    points, strokes, lines = _coloured_lines(analysis, limits, colormaps[STIFFNESS](np.linspace(0.0, 1.0, CLASSES)))
    middle, span = _frame(*cutting_box(samples))
    figure, views, corner = _lay_out(span)
    places = analysis.weakest_rows
    for axes, (across, up, title) in zip(
        views, ((0, 1, "XY  top"), (0, 2, "XZ  front"), (1, 2, "YZ  side, from +X")), strict=True
    ):
        box = axes.get_position()
        figure.text(box.x0, box.y1 + TITLE / POINTS / figure.get_figheight(), title, size=11.0, weight="bold")
        _set_up(axes, across, up, middle, span)
        seen = points[:, [across, up]]
        shown = _thinned(seen, strokes, axes)
        curves, colours = [_polyline(seen, rows) for rows, _ in shown], [colour for _, colour in shown]
        axes.add_collection(
            LineCollection(curves, colors=colours, linewidths=STROKE, capstyle="round", zorder=3), autolim=False
        )
        for xyz, style in lines:
            axes.plot(xyz[:, across], xyz[:, up], **style)
        spots = [(float(x), float(y)) for x, y in mm_from_m(samples.position[places][:, [across, up]])]
        label_places(axes, spots, [f"line {samples.line[row]}" for row in places])
    add_heading(figure, analysis)
    _legend(figure, corner, analysis, limits)
    return figure


def _coloured_lines(
    analysis: Analysis, limits: tuple[float, float], colours: FloatArray
) -> tuple[FloatArray, list[tuple[IntArray, Any]], list[tuple[FloatArray, Look]]]:
    """Points of the path; segments and colour of each class, in drawing order; points and style of other lines."""
    # A corner is two samples at one point: one is enough, and keeps the line through it whole.
    samples, stiffness = analysis.samples, analysis.at.stiffness
    moved = np.flatnonzero(np.logical_or.reduce([axis[1:] != axis[:-1] for axis in samples.position.T]))
    points = mm_from_m(samples.position[np.append(moved, moved[-1] + 1 if len(moved) else 0)])
    rapid = ~samples.cutting[moved + 1]
    classes = segment_classes(n_per_mm_from_n_per_m(0.5 * (stiffness[moved] + stiffness[moved + 1])), limits)
    classes[analysis.set_aside[moved + 1]] = PLUNGE
    if len(points) > MOST_POINTS:
        points, rapid, classes = _merged(points, rapid, classes)
    strokes = [
        (rows, colours[which])
        for which in range(CLASSES - 1, -1, -1)
        if len(rows := np.flatnonzero(~rapid & (classes == which)))
    ]
    others: list[tuple[FloatArray, Look]] = []

    def add(rows: BoolArray, **style: object) -> None:
        if rows.any():
            others.append((_polyline(points, np.flatnonzero(rows)), style))

    add(rapid, color=GREY, linewidth=0.8, linestyle=(0, (5, 4)), zorder=2)
    plunge = ~rapid & (classes == PLUNGE)
    add(plunge, color=SLATE, linewidth=STROKE, zorder=2.5, solid_capstyle="round")
    if plunge.any():
        ends = points[1:][plunge & ~np.append(plunge[1:], False)]
        others.append((ends, {"color": SLATE, "linestyle": "none", "marker": ".", "markersize": 6, "zorder": 3.5}))
    add(~rapid & (classes == UNREACHABLE), color=RED, linewidth=2.2, zorder=4)
    return points, strokes, others


def _merged(points: FloatArray, rapid: BoolArray, classes: IntArray) -> tuple[FloatArray, BoolArray, IntArray]:
    """Segments joined over equal stretches of the path, each in its weakest class; the outline keeps the ends.

    A stretch of such a path is a pixel or two long, and matplotlib would hold three copies of every point.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.cumsum(steps) - steps
    stretch = np.floor(along / (along[-1] / MOST_POINTS)).astype(np.int64)
    new = (np.diff(stretch) != 0) | (np.diff(rapid) != 0)
    first = np.concatenate([[0], np.flatnonzero(new) + 1])
    return np.concatenate([points[first], points[-1:]]), rapid[first], np.minimum.reduceat(classes, first)


def _thinned(points: FloatArray, strokes: Sequence[tuple[IntArray, Any]], axes: Axes) -> list[tuple[IntArray, Any]]:
    """Strokes without segments that others cover: of those between the same two spots only the last stays.

    `points` (n, 2) are those of a view. Seen from the side, the passes over a surface lie upon each other, and line by
    line they take longer to draw than to compute. A spot is half a pixel wide.
    """
    halves = np.floor(2.0 * axes.transData.transform(points)).astype(np.int64)
    halves -= halves.min(axis=0)
    spot = halves[:, 0] * (halves[:, 1].max() + 1) + halves[:, 1]
    between = np.minimum(spot[1:], spot[:-1]) * (spot.max() + 1) + np.maximum(spot[1:], spot[:-1])
    drawn = np.concatenate([np.empty(0, dtype=np.int64), *(rows for rows, _ in strokes[::-1])])
    shown = np.zeros(len(between), dtype=bool)
    shown[drawn[np.unique(between[drawn], return_index=True)[1]]] = True
    return [(kept, colour) for rows, colour in strokes if len(kept := rows[shown[rows]])]


def _polyline(points: FloatArray, segments: IntArray) -> FloatArray:
    """(m, d) a single line through the segments (i, i + 1), broken by nan where they do not join."""
    breaks = np.flatnonzero(np.diff(segments) != 1) + 1
    order = np.concatenate([[0], breaks, [len(segments)]])
    runs = order[1:] - order[:-1]
    # Each run of k segments takes k + 1 points and a break.
    which, inside = numbered(runs + 2)
    rows = segments[order[:-1]][which] + inside
    line = points[np.minimum(rows, len(points) - 1)]
    line[inside == runs[which] + 1] = np.nan
    return np.asarray(line)


def _frame(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    span = (high - low) * 1.12
    return (low + high) / 2.0, np.maximum(span, max(THINNEST * float(span.max()), 1.0))


def _lay_out(span: FloatArray) -> tuple[Figure, list[Axes], tuple[float, float, float, float]]:
    """Figure, the three views at one scale, and the free corner (x, y, width, height in inches)."""
    x, y, z = span
    scale = min(
        (WIDTH - LEFT - RIGHT - BETWEEN) / (x + y),  # inches per mm
        (MOST_HEIGHT - TOP - BOTTOM - BETWEEN) / (y + z),
    )
    height = TOP + BOTTOM + BETWEEN + (y + z) * scale
    left = LEFT + (WIDTH - LEFT - RIGHT - BETWEEN - (x + y) * scale) / 2.0
    figure = new_figure(WIDTH, height)

    upper, second = BOTTOM + z * scale + BETWEEN, left + x * scale + BETWEEN
    views = [
        panel(figure, left, upper, x * scale, y * scale),
        panel(figure, left, BOTTOM, x * scale, z * scale),
        panel(figure, second, BOTTOM, y * scale, z * scale),
    ]
    return figure, views, (second, upper, y * scale, y * scale)


def _set_up(axes: Axes, across: int, up: int, middle: FloatArray, span: FloatArray) -> None:
    names = "XYZ"
    axes.set(
        xlabel=f"{names[across]} mm",
        ylabel=f"{names[up]} mm",
        xlim=(middle[across] - span[across] / 2, middle[across] + span[across] / 2),
        ylim=(middle[up] - span[up] / 2, middle[up] + span[up] / 2),
    )
    box = axes.get_window_extent()
    axes.xaxis.set_major_locator(MaxNLocator(max(2, int(box.width // 85)), steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(box.height // 60)), steps=[1, 2, 2.5, 5, 10]))


def _legend(
    figure: Figure, corner: tuple[float, float, float, float], analysis: Analysis, limits: tuple[float, float]
) -> None:  # fmt: skip
    width, height = figure.get_size_inches()
    x, y, wide, tall = corner
    across, middle = min(wide, 5.0), y + tall / 2.0
    below, above = beyond_scale(analysis, limits)
    figure.colorbar(
        ScalarMappable(Normalize(*limits), colormaps[STIFFNESS].resampled(CLASSES)),
        cax=panel(figure, x, middle + 0.25, across, 0.22),  # the axes include the points at its ends
        orientation="horizontal", extend=("neither", "max", "min", "both")[2 * below + above],
        extendfrac=POINT, label="stiffness along the load, N/mm",
        ticks=MaxNLocator(max(2, int(across / 0.75)), steps=[1, 2, 2.5, 5, 10]),
        format=FuncFormatter(lambda value, _: number(value, 0 if limits[1] - limits[0] > 5 else 2)),
    )  # fmt: skip
    keys: list[tuple[Artist, str]] = []
    if not analysis.samples.cutting.all():
        keys.append((Line2D([], [], color=GREY, linewidth=0.8, linestyle=(0, (5, 4))), "rapid"))
    if analysis.set_aside.any():
        keys.append((Line2D([], [], color=SLATE, linewidth=1.5, marker=".", markersize=6), "plunge"))
    if analysis.out_of_reach.any():
        keys.append((Line2D([], [], color=RED, linewidth=2.2), "out of reach"))
    keys.append((Line2D([], [], linestyle="none", marker="o", ms=8, mfc="none", mec=INK), "weakest places"))
    place = (x - 0.1) / width, (middle - 0.45) / height
    add_legend(figure, keys, place, loc="upper left", ncols=1 if across <= 4.0 else len(keys), labelcolor=MUTED)


def segment_classes(stiffness: FloatArray, limits: tuple[float, float]) -> IntArray:
    """(n,) class 0 to CLASSES - 1 of segments of the path.

    `stiffness` and `limits` in N/mm; values beyond the limits take the end classes; UNREACHABLE where there is none.
    """
    low, high = limits
    missing = np.isnan(stiffness)
    classes = (np.where(missing, low, stiffness) - low) / (high - low) * CLASSES
    return np.where(missing, UNREACHABLE, np.clip(classes.astype(np.int64), 0, CLASSES - 1))
