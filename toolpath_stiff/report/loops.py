"""Readings of indicators beside the tip: on pages and on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from markupsafe import Markup

from toolpath_stiff.report.pages import markup, section, table
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    from toolpath_stiff.comparison.loop_readings import BesideTip


MOST_ROWS = 40  # on a page; all are in the document


def loops_section(loops: BesideTip) -> list[Markup]:
    """The section of a page, by loop, then reading by reading; none without such readings."""
    if not loops.by_loop:
        return []
    means = [
        (
            mean.loop,
            str(mean.readings),
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
    head = ("loop", "readings", "read, nm/N", "modelled, nm/N", "off, nm/N", "standard deviations")
    titles = ("line", "loop", "direction", "point", "read, nm/N", "modelled, nm/N", "standard deviations")
    remark = (
        "Displacement between the indicator's two points per load at the tip; of a strut alone, per force in it. By "
        "loop in the mean, counted in the direction in which the struts of the machine file would move it."
    )
    body = table(head, [("", row) for row in means], range(1, 6)) + markup('<p class="muted">{}</p>', remark)
    return [section("Indicators beside the tip", body + table(titles, [("", row) for row in readings], (4, 5, 6)))]


def loops_text(loops: BesideTip) -> list[str]:
    """Lines for the terminal; none without such readings."""
    return (
        ["", "indicators beside the tip", *(f"  {plain(mean.text)}" for mean in loops.by_loop)] if loops.by_loop else []
    )
