"""Pictures of a placement: the front, both profiles, and the workspace with the path before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.poses import map_stiffness
from toolpath_stiff.placement.document import FIGURES
from toolpath_stiff.report.figure import COLOUR_MAP, INK, MUTED, SECOND_ORANGE, house_style, new_figure, png_bytes
from toolpath_stiff.report.profile_picture import profile_curve
from toolpath_stiff.report.wording import machine_text, number, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

BLUE = "#2457a6"
AROUND = 0.06  # m of the workspace shown about the paths


def front_picture(summary: dict[str, Any]) -> bytes:
    """PNG of range against mean, coloured by the weakest place: the front, the chosen placement, the present one."""
    front, best, before = summary["front"], summary["chosen"], summary["before"]
    with house_style():
        figure = new_figure(9.0, 6.2)
        axes = figure.add_axes((0.12, 0.12, 0.7, 0.69))
        mean, spread, weakest = ([row[key] for row in front] for key in FIGURES.values())
        everything = [*weakest, *([before["min_N_per_mm"]] if before else [])]
        scale = {"vmin": min(everything), "vmax": max(*everything, min(everything) * (1.0 + 1e-6))}
        dots = axes.scatter(mean, spread, s=34, c=weakest, cmap=COLOUR_MAP, ec=INK, lw=0.4, zorder=2, **scale)
        dots.set_label("front: no placement is better in all three")
        axes.plot(
            best["mean_N_per_mm"],
            best["range_N_per_mm"],
            "o",
            ms=16,
            mfc="none",
            mec=SECOND_ORANGE,
            mew=2.5,
            label=f"{'picked' if summary['picked'] else 'recommended'}, number {best['number']}",
        )
        if before:
            axes.scatter(
                [before["mean_N_per_mm"]], [before["range_N_per_mm"]], marker="s", s=90, c=[before["min_N_per_mm"]],
                cmap=COLOUR_MAP, ec=INK, lw=1.8, zorder=3, label="present placement", **scale,
            )  # fmt: skip
        axes.margins(0.08)
        axes.set_xlabel("mean stiffness, N/mm (more is better)")
        axes.set_ylabel("range of stiffness, N/mm (less is better)")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncol=3, fontsize=9)
        bar = figure.add_axes((0.845, 0.12, 0.022, 0.69))
        figure.colorbar(dots, cax=bar, label="weakest place, N/mm (more is better)")
        bar.yaxis.set_major_formatter(lambda value, _: number(value))
        bar.grid(visible=False)
        title = f"Placements of {plain(summary['program'])}"
        figure.text(0.12, 0.94, title, fontsize=14, weight="bold")
        text = f"machine {machine_text(summary)}   ·   load {summary['load']}   ·   objective {summary['objective']}"
        figure.text(0.12, 0.895, text, fontsize=10, color=MUTED)
        return png_bytes(figure)


def profiles_picture(best: Analysis, before: Analysis | None) -> bytes:
    """PNG of stiffness along the path, before and after, on one axis, which plunges do not set."""
    with house_style():
        figure = new_figure(12.0, 5.0)
        axes = figure.add_axes((0.08, 0.13, 0.89, 0.7))
        ends: list[float] = []
        plunges: list[float] = []
        for analysis, colour, label in ((before, "#9aa5b1", "present"), (best, BLUE, "chosen")):
            if analysis is not None:
                s, stiffness = profile_curve(analysis, with_plunges=False)
                axes.plot(s, stiffness, color=colour, lw=1.5, label=label)
                values = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.headline])
                ends += [float(values.min()), float(values.max())]
                beside = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.set_aside])
                plunges += [float(beside.min()), float(beside.max())] if len(beside) else []
        room = max(0.06 * (max(ends) - min(ends)), 1e-3 * max(ends))
        axes.set_ylim(min(ends) - room, max(ends) + room)
        axes.set_xlabel("path length, mm (rapids included)")
        axes.set_ylabel("stiffness along the load, N/mm")
        axes.yaxis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, ncol=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        figure.text(0.08, 0.91, "Stiffness along the path, before and after", fontsize=14, weight="bold")
        if plunges:
            text = f"plunges along the tool axis are left out: {number(min(plunges))} to {number(max(plunges))} N/mm"
            figure.text(0.08, 0.86, text, fontsize=10, color=MUTED)
        return png_bytes(figure)


def workspace_picture(best: Analysis, before: Analysis | None) -> bytes:
    """PNG of the radial stiffness at the chosen height, with the path before and after."""
    paths = [a for a in (before, best) if a is not None]
    points = np.concatenate([a.samples.position[a.samples.cutting, :2] for a in paths])
    low, high = points.min(axis=0) - AROUND, points.max(axis=0) + AROUND
    height = float(np.average(best.samples.position[best.samples.cutting, 2]))
    found = map_stiffness(best.model, (low[0], high[0]), (low[1], high[1]), [height], Load("radial"))
    with house_style():
        figure = new_figure(8.6, 7.6)
        axes = figure.add_axes((0.1, 0.09, 0.72, 0.78))
        mesh = axes.pcolormesh(
            mm_from_m(found.x), mm_from_m(found.y), n_per_mm_from_n_per_m(found.stiffness[0]), cmap=COLOUR_MAP,
            shading="gouraud", rasterized=True,
        )  # fmt: skip
        for analysis, colour, label in ((before, "white", "present"), (best, SECOND_ORANGE, "chosen")):
            if analysis is not None:
                x, y = mm_from_m(analysis.samples.position[analysis.samples.cutting, :2]).T
                axes.plot(x, y, color=colour, lw=1.4, label=label)
        axes.set_aspect("equal")
        axes.set_facecolor("#eceff3")
        axes.grid(visible=False)
        axes.set_xlabel("X mm")
        axes.set_ylabel("Y mm")
        axes.legend(loc="upper right", facecolor="#616e7c", labelcolor="white")
        bar = figure.add_axes((0.85, 0.15, 0.025, 0.66))
        figure.colorbar(mesh, cax=bar, label="radial stiffness, N/mm")
        bar.yaxis.set_major_formatter(lambda value, _: number(value))
        bar.grid(visible=False)
        title = f"Workspace at z = {mm_from_m(height):.0f} mm, path before and after"
        figure.text(0.1, 0.93, title, fontsize=14, weight="bold")
        return png_bytes(figure)
