"""Picture of records of force and deflection."""

import math

import numpy as np
from matplotlib.figure import Figure

from toolpath_stiff.readings.raw import Reduction
from toolpath_stiff.report.colours import MUTED, ORANGE
from toolpath_stiff.report.pictures.style import new_figure
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

COLUMNS = 4
MOST = 60  # loops in one picture; further ones are counted in its heading


def loops(reduction: Reduction) -> Figure | None:
    """One small diagram a loop, in the order of the file."""
    records = reduction.recorded
    if not records:
        return None
    shown = min(len(records), MOST)
    columns = min(COLUMNS, shown)
    rows = math.ceil(shown / columns)
    more = f"; the first {MOST} of {len(records)} loops" if len(records) > MOST else ""
    height = 2.9 * rows + 0.9
    figure = new_figure(max(6.0, 3.4 * columns), height, f"{reduction.title}: force over deflection{more}")
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


PICTURES = {"loops.png": loops}
