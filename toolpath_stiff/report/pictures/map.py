"""Picture of a stiffness map: every slice, on one colour scale."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.analysis.grid import StiffnessMap
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import number
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.report.colours import INK, NOWHERE, RED, STIFFNESS
from toolpath_stiff.report.map import heading
from toolpath_stiff.report.pictures.style import colour_scale, new_figure, panel
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

CONTOURS = 9
ACROSS = 3  # panels in a row
LEFT, BOTTOM, TOP, RIGHT = 0.75, 0.6, 1.05, 1.5  # inches around the panels
RIM = 0.9  # share of the way to the edge at which a joint beyond it is named
TOGETHER = 0.05  # of half a panel: joints closer than this are named together
LABEL = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.2}


def stiffness_map(planes: StiffnessMap) -> Figure:
    """All slices, on one colour scale."""
    slices = len(planes.z)
    rows = -(-slices // ACROSS)
    columns = -(-slices // rows)  # rows filled evenly: four slices make two and two
    wide = float(np.ptp(planes.x)) / float(np.ptp(planes.y))
    side = 7.6 if slices == 1 else 4.6
    width, height = columns * side * min(wide, 1.6) + 1.9, rows * side + 1.5
    stiffness = n_per_mm_from_n_per_m(planes.stiffness)
    low, high = float(np.nanmin(stiffness)), float(np.nanmax(stiffness))
    note = "   ·   ".join([*heading(planes), f"{number(low)} to {number(high)} N/mm"])
    figure = new_figure(width, height, f"Stiffness map, load {planes.load}", note, LEFT)
    grid = figure.add_gridspec(
        rows, columns, left=LEFT / width, right=1 - RIGHT / width, bottom=BOTTOM / height, top=1 - TOP / height,
        wspace=0.15, hspace=0.14,
    )  # fmt: skip
    drawn = None
    for i in range(slices):
        axes = figure.add_subplot(grid[i // columns, i % columns])
        drawn = _slice(axes, planes, i, stiffness[i], low, high)
        below, first = i + columns >= slices, i % columns == 0
        axes.set(xlabel="X mm" if below else "", ylabel="Y mm" if first else "")
        axes.tick_params(labelbottom=below, labelleft=first)
    colour_scale(
        drawn, panel(figure, width - 1.2, BOTTOM, 0.2, height - BOTTOM - TOP), "stiffness along the load, N/mm"
    )
    return figure


def _slice(axes: Axes, planes: StiffnessMap, i: int, stiffness: FloatArray, low: float, high: float) -> Any:
    x, y = mm_from_m(planes.x), mm_from_m(planes.y)
    mesh = axes.pcolormesh(x, y, stiffness, cmap=STIFFNESS, vmin=low, vmax=high, shading="gouraud")
    if not planes.reachable[i].all() and planes.reachable[i].any():
        axes.contour(x, y, planes.reachable[i].astype(float), levels=[0.5], colors=RED, linewidths=1.5)
    axes.set(facecolor=NOWHERE, xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), aspect="equal")
    axes.grid(visible=False)
    axes.set_title(f"z = {mm_from_m(planes.z[i]):g} mm", fontsize=10)
    if isinstance(planes.model.machine, Hexapod):
        _directions(axes, mm_from_m(planes.model.machine.frame_joints[:, :2]))
    if np.nanmax(stiffness) > np.nanmin(stiffness):
        axes.contour(x, y, stiffness, levels=CONTOURS, colors="white", linewidths=0.7, alpha=0.9)
    return mesh


def _directions(axes: Axes, joints: FloatArray) -> None:
    """Mark and name the frame joints of the struts; those beyond the edge at the rim, with an arrow."""
    middle, half = (0.5 * np.array([b + s * a for a, b in (axes.get_xlim(), axes.get_ylim())]) for s in (1.0, -1.0))
    beyond = np.max(np.abs(joints - middle) / half, axis=1)  # above 1 outside
    places = np.where(beyond[:, None] > 1.0, middle + RIM * (joints - middle) / beyond[:, None], joints)
    near = np.all(np.abs(places[:, None] - places) < TOGETHER * half, axis=2)
    for struts in (np.flatnonzero(row) for i, row in enumerate(near) if not row[:i].any()):
        place = places[struts[0]]
        text = f"strut{'s' if len(struts) > 1 else ''} {', '.join(str(i + 1) for i in struts)}"
        if beyond[struts[0]] > 1.0:
            arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.4}
            axes.annotate("", middle + (place - middle) / RIM, place, arrowprops=arrow)
        else:
            axes.plot(*place, "^", color=INK, ms=6)
        side, level = np.sign(np.round((place - middle) / half)) if beyond[struts[0]] > 1.0 else (-1.0, -1.0)
        axes.annotate(
            text, place, (-4.0 * side, -4.0 * level), textcoords="offset points", fontsize=7, color=INK, bbox=LABEL,
            ha=("left", "center", "right")[int(side) + 1], va=("bottom", "center", "top")[int(level) + 1],
        )  # fmt: skip


PICTURES = {"map.png": stiffness_map}
