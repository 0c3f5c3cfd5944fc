"""Readings of indicators beside the tip: on pages and on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from markupsafe import Markup

from toolpath_stiff.report.pages import markup, section, table
from toolpath_stiff.report.readings import MOST_LOOP_ROWS
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    from toolpath_stiff.comparison.loop_readings import LoopsDocument


def loops_section(loops: LoopsDocument) -> list[Markup]:
    """The section of a page; none without such readings."""
    return [section("Indicators beside the tip", _table(loops))] if loops["by_loop"] else []


def _table(loops: LoopsDocument) -> Markup:
    """By loop, then reading by reading."""
    head = ("loop", "readings", "read, nm/N", "modelled, nm/N", "off, nm/N", "standard deviations")
    rows = [
        (
            "",
            (
                one["loop"],
                str(one["readings"]),
                f"{one['read_nm_per_N']:.2f}",
                f"{one['model_nm_per_N']:.2f}",
                f"{one['off_nm_per_N']:+.2f} +- {one['sd_nm_per_N']:.2f}",
                f"{one['standard_deviations']:+.1f}",
            ),
        )
        for one in loops["by_loop"]
    ]
    single = [
        (
            "",
            (
                f"{one['file']}:{one['line']}",
                one["loop"],
                one["direction"],
                one["point"],
                f"{one['read_nm_per_N']:.2f}",
                f"{one['model_nm_per_N']:.2f}",
                f"{one['standard_deviations']:+.1f}",
            ),
        )
        for one in loops["readings"][:MOST_LOOP_ROWS]
    ]
    titles = ("line", "loop", "direction", "point", "read, nm/N", "modelled, nm/N", "standard deviations")
    remark = (
        "Displacement between the indicator's two points per load at the tip; of a strut alone, per force in it. By "
        "loop in the mean, counted in the direction in which the struts of the machine file would move it."
    )
    return table(head, rows, range(1, 6)) + markup('<p class="muted">{}</p>', remark) + table(titles, single, (4, 5, 6))


def loops_text(loops: LoopsDocument) -> list[str]:
    """Lines for the terminal; none without such readings."""
    if not loops["by_loop"]:
        return []
    return ["", "indicators beside the tip", *(f"  {plain(one['text'])}" for one in loops["by_loop"])]
