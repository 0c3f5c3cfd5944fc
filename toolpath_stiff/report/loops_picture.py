"""Force over deflection of every loop of a stiffness test, with the secant that gives its stiffness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.report.figure import INK, MUTED, SECOND_ORANGE, house_style, new_figure, png_bytes
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

if TYPE_CHECKING:
    from toolpath_stiff.updating.raw import Loop, LoopFigures

COLUMNS = 4
MOST = 60  # loops in one picture; further ones are counted in its heading


def loops_png(loops: Sequence[Loop], figures: Sequence[LoopFigures], title: str) -> bytes:
    """One small diagram a loop, in the order of the file, as PNG."""
    shown = min(len(loops), MOST)
    columns = min(COLUMNS, shown)
    rows = math.ceil(shown / columns)
    with house_style():
        figure = new_figure(max(6.0, 3.4 * columns), 2.9 * rows + 0.9)
        more = f"; the first {MOST} of {len(loops)} loops" if len(loops) > MOST else ""
        figure.suptitle(f"{title}: force over deflection{more}", x=0.02, ha="left", weight="bold", color=INK)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax, loop, one in zip(axes, loops, figures, strict=False):
            deflection = um_from_m(loop.deflection)
            ends = [int(np.argmin(loop.jog)), int(np.argmax(loop.jog))]
            ax.plot(deflection[ends], loop.force[ends], color=SECOND_ORANGE, linewidth=1.6, label="secant")
            ax.plot(deflection, loop.force, color=MUTED, linewidth=1.0, marker="o", markersize=3.5)
            ax.set_title(loop.title, fontsize=8.5)
            ax.text(
                0.04,
                0.95,
                f"{n_per_mm_from_n_per_m(one.stiffness):,.0f} N/mm",
                transform=ax.transAxes,
                va="top",
                fontsize=9,
                color=SECOND_ORANGE,
            )
            ax.set_xlabel("deflection in \u00b5m", fontsize=8)
            ax.set_ylabel("force in N", fontsize=8)
            ax.tick_params(labelsize=8)
        for ax in axes[shown:]:
            ax.set_axis_off()
        height = figure.get_size_inches()[1]
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.35 / height))
        return png_bytes(figure)
