"""Residuals on the machine: every pose a glyph with one signed bar a direction, from above and from the side."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox, DrawingArea
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import directions, plane_heights_mm, planes
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.colours import DIRECTIONS, GRID, INK, MUTED
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.report.words import DEVIATION
from toolpath_stiff.units import mm_from_m

BAR, GAP = 5.0, 1.0  # points, width of a bar and space between two
TALLEST = 30.0  # points, of the largest residual
MERGED = 0.03  # of the picture's width: poses closer than this in the view share a glyph
LEFT, PANEL, WIDEST, NARROWEST = 0.8, 4.2, 15.0, 11.6  # inches: margin, a square panel, the picture


def machine(comparison: Comparison) -> Figure:
    """Glyphs on the machine from above, plane by plane, and from the front and the right."""
    data, where = comparison.data, planes(comparison.data)
    heights = plane_heights_mm(data)
    order = [*reversed(heights)]
    largest = _largest(comparison)
    width = min(max(LEFT + PANEL * len(order), NARROWEST), WIDEST)
    pitch = min((width - LEFT) / len(order), PANEL)
    figure = new_figure(
        width, 1.55 + pitch + 4.1, "Where does the model fail? Alike all around, or on one side?",
        f"{DEVIATION}: bar down: softer than modelled, up: stiffer; the tallest is {largest:.0f} %; "
        "poses that fall together in a view: their mean",
    )  # fmt: skip
    for i, plane in enumerate(order):
        axes = panel(figure, LEFT + i * pitch, 4.75, pitch - 0.45, pitch - 0.45)
        _from_above(axes, comparison)
        axes.set_title("from above" if len(order) == 1 else _plane_title(plane, heights[plane]), fontsize=10)
        axes.set_xlabel("X mm", fontsize=9)
        axes.set_ylabel("" if i else "Y mm", fontsize=9)
        _glyphs(axes, comparison, mm_from_m(data.position[:, :2]), where == plane, largest)
    half = (width - LEFT) / 2.0
    for across, name in enumerate("XY"):
        axes = panel(figure, LEFT + across * half, 0.55, half - 0.45, 3.3)
        axes.set_xlim(*mm_from_m(_margins(data.position[:, across], 0.18)))
        axes.set_ylim(*mm_from_m(_margins(data.position[:, 2], 0.26)))
        axes.tick_params(labelsize=8)
        axes.set_title(f"from the {('front', 'right')[across]}", fontsize=10)
        axes.set_xlabel(f"{name} mm", fontsize=9)
        axes.set_ylabel("" if across else "Z mm", fontsize=9)
        _glyphs(axes, comparison, mm_from_m(data.position[:, [across, 2]]), where != "", largest)
    direction_key(figure, comparison)
    return figure


def direction_key(figure: Figure, comparison: Comparison) -> None:
    """The directions of the readings in their colours, in the upper right corner."""
    width, height = figure.get_size_inches()
    present = [axis for axis in DIRECTIONS if (directions(comparison.data) == axis).any()]
    style: Look = {"size": 11, "weight": "bold", "ha": "right"}
    for i, axis in enumerate(reversed(present)):
        place = 1.0 - (0.4 + 0.5 * i) / width, 1.0 - 0.4 / height
        figure.text(*place, f"\u25cf {axis}", color=DIRECTIONS[axis], **style)


def near_rows(comparison: Comparison) -> NDArray[np.bool_]:
    """(n,) readings that are not far off."""
    near = np.ones(len(comparison.residual), dtype=bool)
    near[[reading.reading - 1 for reading in comparison.summary.outliers]] = False
    return near


def _plane_title(plane: str, z_mm: float) -> str:
    """A plane and its height, unless its name says it."""
    return plane if "=" in plane else f"{plane}, {'mean ' if 'third' in plane else ''}z {z_mm:.0f} mm"


def _margins(values: FloatArray, share: float) -> FloatArray:
    """Range of values with a share of it on both sides, m."""
    low, high = float(values.min()), float(values.max())
    pad = share * max(high - low, 0.15)
    return np.array([low - pad, high + pad])


def _largest(comparison: Comparison) -> float:
    """Residual of the tallest bar, %: few extreme readings do not take the contrast."""
    size = np.abs(deviation_percent(comparison.residual))
    near = near_rows(comparison)
    return max(float(np.quantile(size[near] if near.any() else size, 0.98)), 0.5)


def _from_above(axes: Axes, comparison: Comparison) -> None:
    """The machine's axis in the middle, the directions of the frame's joints, numbered, and circles of distance."""
    half = 1.36 * max(float(np.abs(comparison.data.position[:, :2]).max()), 0.1)
    axes.set_xlim(*mm_from_m(np.array([-half, half])))
    axes.set_ylim(*mm_from_m(np.array([-half, half])))
    axes.set_aspect("equal")
    axes.grid(visible=False)
    for share in (0.37, 0.74):
        axes.add_patch(Circle((0.0, 0.0), mm_from_m(share * half), fc="none", ec=GRID, lw=1.0, zorder=0))
    frame = comparison.predictor.base.machine.frame_joints[:, :2]
    azimuths = np.round(np.degrees(np.arctan2(frame[:, 1], frame[:, 0])), 1)
    for azimuth in np.unique(azimuths):
        direction = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))])
        axes.plot(*mm_from_m(np.outer(direction, [0.0, 0.8 * half])), color=GRID, lw=1.0, zorder=0)
        name = "+".join(str(i + 1) for i in np.flatnonzero(azimuths == azimuth))
        x, y = mm_from_m(0.9 * half * direction)
        axes.annotate(name, (x, y), ha="center", va="center", fontsize=7.5, color=MUTED, zorder=0.5)
    axes.plot(0.0, 0.0, "+", color=MUTED, ms=9, zorder=0.5)
    axes.tick_params(labelsize=8)


def _glyphs(axes: Axes, comparison: Comparison, flat: FloatArray, rows: NDArray[np.bool_], largest: float) -> None:
    """One glyph a place in the view (n, 2) mm."""
    along = directions(comparison.data)
    shown = [axis for axis in DIRECTIONS if (along == axis).any()]
    cells = np.round(flat / (MERGED * abs(np.subtract(*axes.get_xlim())))).astype(int)
    wide, middle = (BAR + GAP) * len(shown), TALLEST + 4.0
    for cell in np.unique(cells[rows], axis=0):
        here = rows & (cells == cell).all(axis=1)
        area = DrawingArea(wide, 2.0 * middle)
        area.add_artist(Rectangle((-1.0, middle - 0.5), wide + 1.0, 1.0, fc=INK, ec="none"))
        for j, axis in enumerate(shown):
            if (chosen := here & (along == axis)).any():
                size = float(deviation_percent(comparison.residual[chosen].mean()))
                tall, place = float(np.clip(size / largest, -1.15, 1.15)) * TALLEST, (j * (BAR + GAP), middle)
                area.add_artist(Rectangle(place, BAR, tall, fc=DIRECTIONS[axis], ec="none", alpha=0.9))
        box = AnnotationBbox(area, tuple(flat[here].mean(axis=0)), frameon=False, pad=0.0, zorder=4)
        axes.add_artist(box)
