"""Readings of indicators beside the tip: on pages and on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolpath_stiff.report.tables import Table
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    from toolpath_stiff.comparison.loop_readings import BesideTip
    from toolpath_stiff.report.pages import Section

MOST_ROWS = 40  # on a page; all are in the document
REMARK = (
    "Displacement between the indicator's two points per load at the tip; of a strut alone, per force in it. By loop "
    "in the mean, counted in the direction in which the struts of the machine file would move it."
)


def loops_section(loops: BesideTip) -> Section:
    """The section of a page, by loop, then reading by reading."""
    means = [
        (
            mean.loop,
            mean.readings,
            f"{mean.read_nm_per_N:.2f}",
            f"{mean.model_nm_per_N:.2f}",
            f"{mean.off_nm_per_N:+.2f} +- {mean.sd_nm_per_N:.2f}",
            f"{mean.standard_deviations:+.1f}",
        )
        for mean in loops.by_loop
    ]
    readings = [
        (
            f"{reading.file}:{reading.line}",
            reading.loop,
            reading.direction,
            reading.point,
            f"{reading.read_nm_per_N:.2f}",
            f"{reading.model_nm_per_N:.2f}",
            f"{reading.standard_deviations:+.1f}",
        )
        for reading in loops.readings[:MOST_ROWS]
    ]
    figures = (">read, nm/N", ">modelled, nm/N")
    by_loop = Table(("loop", ">readings", *figures, ">off, nm/N", ">standard deviations"), means)
    each = Table(("line", "loop", "direction", "point", *figures, ">standard deviations"), readings)
    return "Indicators beside the tip", by_loop, REMARK if means else "", each


def loops_text(loops: BesideTip) -> list[str]:
    """Lines for the terminal; none without such readings."""
    lines = [f"  {plain(mean.text)}" for mean in loops.by_loop]
    return ["", "indicators beside the tip", *lines] if lines else []
