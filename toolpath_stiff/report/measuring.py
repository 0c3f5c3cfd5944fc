"""Raw records reduced to stiffnesses, in files, figures and pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content
from toolpath_stiff.report.figure import INK, MUTED, SECOND_ORANGE, house_style, new_figure, picture
from toolpath_stiff.report.history import dated, history_png, history_text
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from toolpath_stiff.readings.loop_figures import LoopFigures
    from toolpath_stiff.readings.raw import Reduction


COLUMNS = 4
MOST = 60  # loops in one picture; further ones are counted in its heading


@picture
def loops_png(loops: Sequence[LoopFigures], title: str) -> Figure:
    """One small diagram a loop, in the order of the file, as PNG."""
    shown = min(len(loops), MOST)
    columns = min(COLUMNS, shown)
    rows = math.ceil(shown / columns)
    with house_style():
        figure = new_figure(max(6.0, 3.4 * columns), 2.9 * rows + 0.9)
        more = f"; the first {MOST} of {len(loops)} loops" if len(loops) > MOST else ""
        figure.suptitle(f"{title}: force over deflection{more}", x=0.02, ha="left", weight="bold", color=INK)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax, figures in zip(axes, loops, strict=False):
            loop = figures.loop
            deflection = um_from_m(loop.deflection)
            ends = [int(np.argmin(loop.drive)), int(np.argmax(loop.drive))]
            ax.plot(deflection[ends], loop.force[ends], color=SECOND_ORANGE, linewidth=1.6, label="secant")
            ax.plot(deflection, loop.force, color=MUTED, linewidth=1.0, marker="o", markersize=3.5)
            ax.set_title(loop.title, fontsize=8.5)
            ax.text(
                0.04,
                0.95,
                f"{n_per_mm_from_n_per_m(figures.stiffness):,.0f} N/mm",
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
        return figure


def reduction_figure(reduction: Reduction) -> Figure:
    """Force against deflection of each loop; without records the struts over their dates. Raises `InputError`."""
    if reduction.recorded:
        return loops_png.figure(reduction.recorded, reduction.title)
    if not dated(reduction.history):
        raise InputError("nothing to draw: neither records nor several dates")
    return history_png.figure(reduction.history)


def reduction_pictures(reduction: Reduction, out: Path) -> dict[Path, Content]:
    """The loops drawn, and dated struts over their dates, beside the measurement file `out`."""
    pictures: dict[Path, Content] = {}
    if reduction.recorded:
        pictures[out.with_name(f"{out.stem}_loops.png")] = loops_png(reduction.recorded, reduction.title)
    if dated(reduction.history):
        pictures[out.with_name(f"{out.stem}_history.png")] = history_png(reduction.history)
    return pictures


def reduction_text(reduction: Reduction) -> str:
    """The figures of the loops and the struts' histories; rows of a table of stiffnesses say nothing themselves."""
    recorded = reduction.recorded
    history = history_text(reduction.history, undated=not recorded)
    return "\n".join([loops_text(recorded), *history]) if recorded else "\n".join(history).lstrip("\n")


def loops_text(figures: Sequence[LoopFigures]) -> str:
    """The figures for people: a line a loop."""
    rows: list[tuple[str, ...]] = [
        ("loop", "N/mm", "force N", "deflection um", "lost motion um", "width um", "linearity %", "closure um")
    ]
    for loop in figures:
        lengths = um_from_m(np.array([loop.deflection, loop.lost_motion, loop.loop_width, loop.closure]))
        deflection, lost, width, closure = ("-" if math.isnan(um) else f"{um + 0.0:.1f}" for um in lengths)
        stiffness = f"{n_per_mm_from_n_per_m(loop.stiffness):.0f}"
        linearity = f"{100.0 * loop.linearity:.1f}"
        rows.append((loop.loop.title, stiffness, f"{loop.force:.0f}", deflection, lost, width, linearity, closure))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    )
