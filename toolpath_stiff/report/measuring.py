"""Views of raw records reduced to stiffnesses: figures for the terminal, names of files."""

from collections.abc import Callable, Mapping, Sequence

from toolpath_stiff.documents import Document
from toolpath_stiff.files import Content
from toolpath_stiff.readings.raw import Reduction
from toolpath_stiff.readings.raw_rows import loop_entry
from toolpath_stiff.report import folder
from toolpath_stiff.report.history import history_text
from toolpath_stiff.report.tables import ShownTable

DATA: Mapping[str, Callable[[Reduction], Content]] = {}
HEAD = ("loop", ">N/mm", ">force N", ">deflection um", ">lost motion um", ">width um", ">linearity %")


def pictures(reduction: Reduction) -> dict[str, Content]:
    """The loops drawn, and dated struts over their dates."""
    drawn = {name: draw() if callable(draw) else draw for name, draw in folder.files(reduction).items()}
    return {name: content for name, content in drawn.items() if content}


def text(reduction: Reduction) -> str:
    """Figures of the loops and the struts' histories; rows of a table of stiffnesses have no loops to show."""
    recorded = [loop_entry(figures) for figures in reduction.recorded]
    return "\n".join([*_loops(recorded), *history_text(reduction.history, undated=not recorded)]).lstrip("\n")


def _loops(entries: Sequence[Document]) -> list[str]:
    if not entries:
        return []
    names = ("deflection_um", "lost_motion_um", "loop_width_um", "linearity_percent")
    rows = [
        (
            entry["loop"],
            f"{entry['stiffness_N_per_mm']:.0f}",
            "-" if entry["force_N"] is None else f"{entry['force_N']:.0f}",
            *("-" if entry[name] is None else f"{entry[name] + 0.0:.1f}" for name in names),
        )
        for entry in entries
    ]
    return ShownTable(HEAD, rows).lines(0, 0)
