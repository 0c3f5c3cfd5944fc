"""Readings of indicators beside the tip, on pages and on the terminal."""

from collections.abc import Sequence

from toolpath_stiff.comparison.loop_readings import LoopMean
from toolpath_stiff.report.pages import Section
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import plain

REMARK = (
    "Displacement between the indicator's two points per load at the tip; of a strut alone, per force in it. By loop "
    "in the mean, counted in the direction in which the struts of the machine file would move it."
)
TITLES = ("loop", ">readings", ">read, nm/N", ">modelled, nm/N", ">off, nm/N", ">standard deviations")


def loops_section(loops: Sequence[LoopMean]) -> Section:
    """Section of a page, loop by loop."""
    rows = [
        (
            mean.loop,
            mean.readings,
            f"{mean.read_nm_per_N:.2f}",
            f"{mean.model_nm_per_N:.2f}",
            f"{mean.off_nm_per_N:+.2f} +- {mean.sd_nm_per_N:.2f}",
            f"{mean.standard_deviations:+.1f}",
        )
        for mean in loops
    ]
    return "Indicators beside the tip", ShownTable(TITLES, rows), REMARK if loops else ""


def loops_text(loops: Sequence[LoopMean]) -> list[str]:
    """Lines for the terminal; none if there are no such readings."""
    lines = [f"  {plain(mean.text)}" for mean in loops]
    return ["", "indicators beside the tip", *lines] if lines else []
