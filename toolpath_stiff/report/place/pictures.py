"""Pictures of a placement: the front, both profiles, the workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis.grid import map_stiffness
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.placement.result import Placement
from toolpath_stiff.placement.rows import FIGURES
from toolpath_stiff.report.axes import colour_scale, heading, in_thousands
from toolpath_stiff.report.figure import BLUE, COLOUR_MAP, INK, SECOND_ORANGE, new_figure, picture
from toolpath_stiff.report.profile import profile_curve
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AROUND = 0.06  # m of the workspace shown about the paths


@picture
def front_picture(placed: Placement) -> Figure:
    """PNG of range against mean, coloured by the weakest place: the front, the chosen placement, the present one."""
    best, before = placed.chosen, placed.present
    figure = new_figure(9.0, 6.2)
    axes = figure.add_axes((0.12, 0.12, 0.7, 0.69))
    mean, spread, weakest = ([getattr(row, key) for row in placed.front] for key in FIGURES.values())
    everything = [*weakest, *([before.min_N_per_mm] if before else [])]
    scale = {"vmin": min(everything), "vmax": max(*everything, min(everything) * (1.0 + 1e-6))}
    dots = axes.scatter(mean, spread, s=34, c=weakest, cmap=COLOUR_MAP, ec=INK, lw=0.4, zorder=2, **scale)
    dots.set_label("front: no placement is better in all three")
    which = f"{'picked' if placed.picked else 'recommended'}, number {best.number}"
    ring: dict[str, Any] = {"ms": 16, "mfc": "none", "mec": SECOND_ORANGE, "mew": 2.5}
    axes.plot(best.mean_N_per_mm, best.range_N_per_mm, "o", label=which, **ring)
    if before:
        axes.scatter(
            [before.mean_N_per_mm], [before.range_N_per_mm], marker="s", s=90, c=[before.min_N_per_mm],
            cmap=COLOUR_MAP, ec=INK, lw=1.8, zorder=3, label="present placement", **scale,
        )  # fmt: skip
    axes.margins(0.08)
    axes.set_xlabel("mean stiffness, N/mm (more is better)")
    axes.set_ylabel("range of stiffness, N/mm (less is better)")
    in_thousands(axes.xaxis, axes.yaxis)
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncol=3, fontsize=9)
    colour_scale(figure, dots, (0.845, 0.12, 0.022, 0.69), "weakest place, N/mm (more is better)")
    text = f"machine {machine_text(placed.machine_stated)}   ·   load {placed.best.load}"
    text += f"   ·   objective {placed.task.rules.objective}"
    heading(figure, 0.12, 0.94, f"Placements of {plain(placed.best.program.name)}", 0.045, text)
    return figure


@picture
def profiles_picture(best: Analysis, before: Analysis | None) -> Figure:
    """PNG of stiffness along the path, before and after, on one axis, which plunges do not set."""
    figure = new_figure(12.0, 5.0)
    axes = figure.add_axes((0.08, 0.13, 0.89, 0.7))
    counted, plunges = [np.zeros(0)], [np.zeros(0)]
    for analysis, colour, label in ((before, "#9aa5b1", "present"), (best, BLUE, "chosen")):
        if analysis is not None:
            axes.plot(*profile_curve(analysis, with_plunges=False), color=colour, lw=1.5, label=label)
            counted.append(n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.headline]))
            plunges.append(n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.set_aside]))
    values, beside = np.concatenate(counted), np.concatenate(plunges)
    low, high = float(values.min()), float(values.max())
    room = max(0.06 * (high - low), 1e-3 * high)
    axes.set_ylim(low - room, high + room)
    axes.set_xlabel("path length, mm (rapids included)")
    axes.set_ylabel("stiffness along the load, N/mm")
    in_thousands(axes.yaxis)
    axes.legend(frameon=False, ncol=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    text = f"{number(beside.min())} to {number(beside.max())} N/mm" if len(beside) else ""
    text = f"plunges along the tool axis are left out: {text}" if text else ""
    heading(figure, 0.08, 0.91, "Stiffness along the path, before and after", 0.05, text)
    return figure


@picture
def workspace_picture(best: Analysis, before: Analysis | None) -> Figure:
    """PNG of the radial stiffness at the chosen height, with the path before and after."""
    cuts = [None if a is None else a.samples.position[a.samples.cutting] for a in (before, best)]
    points = np.concatenate([cut[:, :2] for cut in cuts if cut is not None])
    low, high = points.min(axis=0) - AROUND, points.max(axis=0) + AROUND
    height = float(np.average(best.samples.position[best.samples.cutting, 2]))
    around = map_stiffness(best.model, (low[0], high[0]), (low[1], high[1]), [height], Load("radial"))
    figure = new_figure(8.6, 7.6)
    axes = figure.add_axes((0.1, 0.09, 0.72, 0.78))
    mesh = axes.pcolormesh(
        mm_from_m(around.x), mm_from_m(around.y), n_per_mm_from_n_per_m(around.stiffness[0]), cmap=COLOUR_MAP,
        shading="gouraud", rasterized=True,
    )  # fmt: skip
    for cut, colour, label in zip(cuts, ("white", SECOND_ORANGE), ("present", "chosen"), strict=True):
        if cut is not None:
            axes.plot(*mm_from_m(cut[:, :2]).T, color=colour, lw=1.4, label=label)
    axes.set_aspect("equal")
    axes.set_facecolor("#eceff3")
    axes.grid(visible=False)
    axes.set_xlabel("X mm")
    axes.set_ylabel("Y mm")
    axes.legend(loc="upper right", facecolor="#616e7c", labelcolor="white")
    colour_scale(figure, mesh, (0.85, 0.15, 0.025, 0.66), "radial stiffness, N/mm")
    heading(figure, 0.1, 0.93, f"Workspace at z = {mm_from_m(height):.0f} mm, path before and after")
    return figure
