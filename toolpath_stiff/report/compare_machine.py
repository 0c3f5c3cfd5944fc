"""Residuals on the machine: every pose a glyph with one signed bar a direction, from above and from the side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.report.compare_pictures import RESIDUAL_AXIS, heading, in_percent
from toolpath_stiff.report.figure import GRID, INK, MUTED, house_style, new_figure, png_bytes
from toolpath_stiff.report.update_pictures import DIRECTION_COLOURS
from toolpath_stiff.units import mm_from_m
from toolpath_stiff.updating.residual_variables import directions, planes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from toolpath_stiff.updating.compare import Comparison

FloatArray = NDArray[np.float64]
Place = tuple[float, float, float, float]  # x, y, width, height

BAR, GAP = 5.0, 1.0  # points, width of a bar and space between two
TALLEST = 30.0  # points, of the largest residual
MERGED = 0.03  # of the picture's width: poses closer than this in the view share a glyph
SEEN = 0.5  # m of the machine shown about the poses at most


def machine_png(found: Comparison) -> bytes:
    """PNG: glyphs on the machine from above, plane by plane, and from the front and the right."""
    data = found.data
    where = planes(data)
    order = [*reversed(found.document["by_plane"])]
    along = directions(data)
    axes_shown = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    largest = _largest(found)
    columns = max(len(order), 2)
    with house_style():
        side, width = 3.35, 0.75 + 3.55 * columns
        width = max(width, 8.6)
        height = 1.25 + side + 0.75 + 3.9
        figure = new_figure(width, height)
        pitch = (width - 0.75) / columns
        reach = _reach(data.position[:, :2])
        for i, plane in enumerate(order):
            place = (0.75 + i * pitch * columns / len(order), 3.9 + 0.75, min(pitch, 3.55) - 0.35, side - 0.15)
            axes = figure.add_axes(_relative(place, width, height))
            _from_above(axes, found, where == plane, reach)
            z = found.document["by_plane"][plane]["z_mm"]
            name = "from above" if len(order) == 1 else plane
            axes.set_title(f"{name}, z {z:.0f} mm" if "=" not in name else name, fontsize=10)
            axes.set_xlabel("X mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Y mm", fontsize=9)
            _glyphs(axes, found, mm_from_m(data.position[:, :2]), where == plane, axes_shown, largest)
        half = (width - 0.75) / 2.0
        for i, across in enumerate((0, 1)):
            axes = figure.add_axes(_relative((0.75 + i * half, 0.55, half - 0.4, 3.3), width, height))
            _from_side(axes, found, across)
            axes.set_title(f"from the {'front' if across == 0 else 'right'}", fontsize=10)
            axes.set_xlabel(f"{'XY'[across]} mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Z mm", fontsize=9)
            flat = mm_from_m(data.position[:, [across, 2]])
            _glyphs(axes, found, flat, np.ones(len(data), dtype=bool), axes_shown, largest)
        heading(
            figure,
            "Where does the model fail? Alike all around, or on one side?",
            f"{RESIDUAL_AXIS}: bar up, stiffer than modelled; bar down, softer; the tallest is {largest:.0f} %. "
            "Poses that fall together in a view: their mean",
        )
        _key(figure, axes_shown, width, height)
        return png_bytes(figure)


def _relative(place: Place, width: float, height: float) -> Place:
    x, y, w, h = place
    return x / width, y / height, w / width, h / height


def _key(figure: Any, axes_shown: list[str], width: float, height: float) -> None:
    for i, axis in enumerate(axes_shown):
        x, y = (0.35 + 0.55 * i) / width, 1.0 - 0.93 / height
        figure.text(x, y, "\u25ae " + axis, color=DIRECTION_COLOURS[axis], size=11, weight="bold")


def _largest(found: Comparison) -> float:
    """Residual of the tallest bar, %: few extreme readings do not take the contrast."""
    return max(float(np.quantile(np.abs(in_percent(found.residual)), 0.98)), 0.5)


def _reach(flat: FloatArray) -> tuple[FloatArray, float]:
    """Centre and half width of a square view of points (n, 2), m."""
    low, high = flat.min(axis=0), flat.max(axis=0)
    return (low + high) / 2.0, 0.62 * max(float((high - low).max()), 0.1)


def _from_above(axes: Axes, found: Comparison, rows: NDArray[np.bool_], reach: tuple[FloatArray, float]) -> None:
    """The machine's axis, the poles of the joints' azimuths, circles of distance."""
    centre, half = reach
    axes.set_xlim(*mm_from_m(np.array([centre[0] - half, centre[0] + half])))
    axes.set_ylim(*mm_from_m(np.array([centre[1] - half, centre[1] + half])))
    axes.set_aspect("equal")
    axes.grid(visible=False)
    frame = found.predictor.base.machine.frame_joints
    for i, (x, y) in enumerate(frame[:, :2]):
        direction = np.array([x, y]) / max(float(np.hypot(x, y)), 1e-9)
        axes.plot(*np.outer([0.0, 1e5], direction).T, color=GRID, lw=1.0, zorder=0)
        edge = 0.9 * mm_from_m(half) / max(float(np.abs(direction).max()), 1e-9)
        at = edge * direction
        if abs(at[0] - mm_from_m(centre[0])) < mm_from_m(half) and abs(at[1] - mm_from_m(centre[1])) < mm_from_m(half):
            axes.annotate(str(i + 1), tuple(at), ha="center", va="center", fontsize=7.5, color=MUTED, zorder=0.5)
    axes.plot(0.0, 0.0, "+", color=MUTED, ms=9, zorder=0.5)
    axes.tick_params(labelsize=8)


def _from_side(axes: Axes, found: Comparison, across: int) -> None:
    """Struts of the mean measured pose, faint, behind the poses."""
    data = found.data
    flat = data.position[:, [across, 2]]
    low, high = flat.min(axis=0), flat.max(axis=0)
    pad = 0.18 * np.maximum(high - low, 0.15)
    axes.set_xlim(*mm_from_m(np.array([low[0] - pad[0], high[0] + pad[0]])))
    axes.set_ylim(*mm_from_m(np.array([low[1] - 1.4 * pad[1], high[1] + 1.4 * pad[1]])))
    axes.grid(visible=False)
    machine = found.predictor.base.machine
    tip = np.array([[0.0, 0.0, float(high[1])]])
    joints = (tip + solve_struts(machine, tip).arms[0])[:, [across, 2]]
    for i in range(6):
        ends = np.stack([joints[i], machine.frame_joints[i, [across, 2]]])
        axes.plot(*mm_from_m(ends).T, color=GRID, lw=1.6, zorder=0)
    order = np.argsort(joints[:, 0], kind="stable")
    axes.plot(*mm_from_m(joints[order]).T, color="#cbd2d9", lw=1.6, zorder=0)
    axes.tick_params(labelsize=8)


def _glyphs(
    axes: Axes, found: Comparison, flat: FloatArray, rows: NDArray[np.bool_], axes_shown: list[str], largest: float
) -> None:
    """One glyph a place in the view (n, 2) mm."""
    from matplotlib.offsetbox import AnnotationBbox, DrawingArea
    from matplotlib.patches import Rectangle

    along = directions(found.data)
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
            size = float(in_percent(found.residual[chosen].mean()))
            tall = float(np.clip(size / largest, -1.15, 1.15)) * TALLEST
            area.add_artist(
                Rectangle((j * (BAR + GAP), middle), BAR, tall, fc=DIRECTION_COLOURS[axis], ec="none", alpha=0.9)
            )
        box = AnnotationBbox(area, tuple(flat[here].mean(axis=0)), frameon=False, pad=0.0, zorder=4)
        axes.add_artist(box)
