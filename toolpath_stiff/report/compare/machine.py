"""Residuals on the machine: every pose a glyph with one signed bar a direction, from above and from the side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions, plane_heights_mm, planes
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.report.compare.pictures import heading, near_rows
from toolpath_stiff.report.figure import (
    FAINT,
    GRID,
    INK,
    MUTED,
    PALE_RED,
    UNREACHABLE_RED,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.residuals import DIRECTION_COLOURS
from toolpath_stiff.report.words import DEVIATION
from toolpath_stiff.units import mm_from_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.comparison.compare import Comparison


Place = tuple[float, float, float, float]  # x, y, width, height


BAR, GAP = 5.0, 1.0  # points, width of a bar and space between two


TALLEST = 30.0  # points, of the largest residual


MERGED = 0.03  # of the picture's width: poses closer than this in the view share a glyph


LEFT, PANEL, WIDEST, NARROWEST = 0.8, 3.65, 15.0, 8.6  # inches: margin, a square panel, the picture


@drawn
def machine_png(comparison: Comparison) -> Figure:
    """PNG: glyphs on the machine from above, plane by plane, and from the front and the right."""
    data = comparison.data
    where = planes(data)
    heights = plane_heights_mm(data)
    order = [*reversed(heights)]
    along = directions(data)
    axes_shown = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    largest = _largest(comparison)
    with house_style():
        pitch = min(PANEL, WIDEST / (len(order) + 1))
        width = max(LEFT + pitch * (len(order) + 1), NARROWEST)
        pitch = (width - LEFT) / (len(order) + 1)
        height = 1.55 + pitch + 4.1
        figure = new_figure(width, height)
        for i, plane in enumerate(order):
            place = (LEFT + i * pitch, 4.75, pitch - 0.45, pitch - 0.45)
            axes = figure.add_axes(_relative(place, width, height))
            _from_above(axes, comparison)
            z = heights[plane]
            axes.set_title("from above" if len(order) == 1 else _plane_title(plane, z), fontsize=10)
            axes.set_xlabel("X mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Y mm", fontsize=9)
            _glyphs(axes, comparison, mm_from_m(data.position[:, :2]), where == plane, axes_shown, largest)
        place = (LEFT + len(order) * pitch, 4.75, pitch - 0.45, pitch - 0.45)
        _whole_machine(figure.add_axes(_relative(place, width, height)), comparison)
        half = (width - LEFT) / 2.0
        for i, across in enumerate((0, 1)):
            axes = figure.add_axes(_relative((LEFT + i * half, 0.55, half - 0.45, 3.3), width, height))
            axes.set_xlim(*mm_from_m(_margins(data.position[:, across], 0.18)))
            axes.set_ylim(*mm_from_m(_margins(data.position[:, 2], 0.26)))
            axes.tick_params(labelsize=8)
            axes.set_title(f"from the {'front' if across == 0 else 'right'}", fontsize=10)
            axes.set_xlabel(f"{'XY'[across]} mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Z mm", fontsize=9)
            flat = mm_from_m(data.position[:, [across, 2]])
            _glyphs(axes, comparison, flat, np.ones(len(data), dtype=bool), axes_shown, largest)
        heading(
            figure,
            "Where does the model fail? Alike all around, or on one side?",
            f"{DEVIATION}: bar down: softer than modelled, up: stiffer; the tallest is {largest:.0f} %; "
            "poses that fall together in a view: their mean",
        )
        _key(figure, axes_shown, width, height)
        return figure


def _relative(place: Place, width: float, height: float) -> Place:
    x, y, w, h = place
    return x / width, y / height, w / width, h / height


def _plane_title(plane: str, z_mm: float) -> str:
    """A plane and its height, unless its name says it."""
    return plane if "=" in plane else f"{plane}, {'mean ' if 'third' in plane else ''}z {z_mm:.0f} mm"


def _margins(values: FloatArray, share: float) -> FloatArray:
    """Range of values with a share of it on both sides, m."""
    low, high = float(values.min()), float(values.max())
    pad = share * max(high - low, 0.15)
    return np.array([low - pad, high + pad])


def _key(figure: Any, axes_shown: list[str], width: float, height: float) -> None:
    for i, axis in enumerate(axes_shown):
        x, y = (0.35 + 0.55 * i) / width, 1.0 - 0.93 / height
        figure.text(x, y, "\u25ae " + axis, color=DIRECTION_COLOURS[axis], size=11, weight="bold")


def _largest(comparison: Comparison) -> float:
    """Residual of the tallest bar, %: few extreme readings do not take the contrast."""
    size = np.abs(deviation_percent(comparison.residual))
    near = near_rows(comparison)
    return max(float(np.quantile(size[near] if near.any() else size, 0.98)), 0.5)


def _from_above(axes: Axes, comparison: Comparison) -> None:
    """The machine's axis in the middle, the directions of the frame's joints, numbered, and circles of distance."""
    from matplotlib.patches import Circle

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


def _whole_machine(axes: Axes, comparison: Comparison) -> None:
    """Struts and platform with the tool at the middle of the measured poses, which are boxed, from the front."""
    from matplotlib.patches import Rectangle

    machine, position = comparison.predictor.base.machine, comparison.data.position
    low, high = position.min(axis=0), position.max(axis=0)
    tip = ((low + high) / 2.0)[None]
    joints = tip[0] + solve_struts(machine, tip).arms[0]
    for joint, vertex in zip(joints, machine.frame_joints, strict=True):
        axes.plot(*mm_from_m(np.stack([joint, vertex])[:, [0, 2]]).T, color=FAINT, lw=1.6, zorder=1)
        axes.plot(*mm_from_m(vertex[[0, 2]]), "o", color=MUTED, ms=4, zorder=2)
        axes.plot(*mm_from_m(np.stack([joint, tip[0]])[:, [0, 2]]).T, color=MUTED, lw=1.6, zorder=2)
    size = mm_from_m(np.maximum(high - low, 0.06))
    corner = mm_from_m((low + high) / 2.0) - size / 2.0
    axes.add_patch(
        Rectangle((corner[0], corner[2]), size[0], size[2], fc=PALE_RED, ec=UNREACHABLE_RED, lw=1.2, zorder=0.5)
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.tick_params(labelsize=8)
    axes.set_title("the machine, from the front", fontsize=10)
    axes.locator_params(axis="x", nbins=4)
    axes.set_xlabel("X mm; red: measured", fontsize=9)


def _glyphs(
    axes: Axes, comparison: Comparison, flat: FloatArray, rows: NDArray[np.bool_], axes_shown: list[str], largest: float
) -> None:
    """One glyph a place in the view (n, 2) mm."""
    from matplotlib.offsetbox import AnnotationBbox, DrawingArea
    from matplotlib.patches import Rectangle

    along = directions(comparison.data)
    span = abs(axes.get_xlim()[1] - axes.get_xlim()[0])
    cells = np.round(flat / (MERGED * span)).astype(int)
    wide = (BAR + GAP) * len(axes_shown)
    for cell in np.unique(cells[rows], axis=0):
        here = rows & (cells == cell).all(axis=1)
        area = DrawingArea(wide, 2.0 * TALLEST + 8.0)
        middle = TALLEST + 4.0
        area.add_artist(Rectangle((-1.0, middle - 0.5), wide + 1.0, 1.0, fc=INK, ec="none"))
        for j, axis in enumerate(axes_shown):
            chosen = here & (along == axis)
            if not chosen.any():
                continue
            size = float(deviation_percent(comparison.residual[chosen].mean()))
            tall = float(np.clip(size / largest, -1.15, 1.15)) * TALLEST
            area.add_artist(
                Rectangle((j * (BAR + GAP), middle), BAR, tall, fc=DIRECTION_COLOURS[axis], ec="none", alpha=0.9)
            )
        box = AnnotationBbox(area, tuple(flat[here].mean(axis=0)), frameon=False, pad=0.0, zorder=4)
        axes.add_artist(box)
