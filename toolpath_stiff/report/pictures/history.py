"""Pictures of struts measured alone, and of records of force and deflection."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.report.colours import MUTED, ORANGE
from toolpath_stiff.report.history import TITLE, dated
from toolpath_stiff.report.pictures.style import new_figure
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

if TYPE_CHECKING:
    from toolpath_stiff.readings.history import StrutHistory, StrutOverTime
    from toolpath_stiff.readings.loop_figures import LoopFigures

COLUMNS = 4
MOST = 60  # loops in one picture; further ones are counted in its heading


def history(struts: StrutHistory) -> Figure | None:
    """Stiffness of each strut over the date, the mean before and after a step, the span in which it lies."""
    if not dated(struts):
        return None
    shown = [strut for strut in struts.struts if len(strut.dates) > 1]
    figure = new_figure(9.0, height := 1.7 * len(shown) + 0.9, f"{TITLE}: N/mm")
    panels = figure.subplots(len(shown), 1, squeeze=False, sharex=True).ravel()
    for axes, strut in zip(panels, shown, strict=True):
        _strut(axes, strut)
    panels[-1].set_xlabel("date")
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.45 / height))
    return figure


def _strut(axes: Axes, strut: StrutOverTime) -> None:
    """One strut: dates as points, changes in orange."""

    def day(text: str) -> Any:  # matplotlib takes dates, its types do not say so
        return date.fromisoformat(text)

    axes.plot([*map(day, strut.dates)], list(strut.dates.values()), "o", color=MUTED, markersize=4.0)
    for change in strut.changes:
        ends = [day(change.after), day(change.before)]
        if change.kind == "step":
            axes.axvspan(*ends, color=ORANGE, alpha=0.25, linewidth=0.0)
        axes.plot(ends, [change.from_N_per_mm, change.to_N_per_mm], color=ORANGE, linewidth=1.6)
    axes.set_title(strut.strut, fontsize=9.0)
    axes.tick_params(labelsize=8)


def loops(records: Sequence[LoopFigures], title: str) -> Figure:
    """One small diagram a loop, in the order of the file."""
    shown = min(len(records), MOST)
    columns = min(COLUMNS, shown)
    rows = math.ceil(shown / columns)
    more = f"; the first {MOST} of {len(records)} loops" if len(records) > MOST else ""
    height = 2.9 * rows + 0.9
    figure = new_figure(max(6.0, 3.4 * columns), height, f"{title}: force over deflection{more}")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, figures in zip(panels, records, strict=False):
        loop = figures.loop
        deflection = um_from_m(loop.deflection)
        ends = [int(np.argmin(loop.drive)), int(np.argmax(loop.drive))]
        axes.plot(deflection[ends], loop.force[ends], color=ORANGE, linewidth=1.6, label="secant")
        axes.plot(deflection, loop.force, color=MUTED, linewidth=1.0, marker="o", markersize=3.5)
        axes.set_title(loop.title, fontsize=8.5)
        stiffness = f"{n_per_mm_from_n_per_m(figures.stiffness):,.0f} N/mm"
        axes.text(0.04, 0.95, stiffness, transform=axes.transAxes, va="top", fontsize=9, color=ORANGE)
        axes.set_xlabel("deflection in \u00b5m", fontsize=8)
        axes.set_ylabel("force in N", fontsize=8)
        axes.tick_params(labelsize=8)
    for axes in panels[shown:]:
        axes.set_axis_off()
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.5 / height))
    return figure
