"""Raw records reduced to stiffnesses: figures for the terminal, names of files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from toolpath_stiff.documents import Document
from toolpath_stiff.files import Content
from toolpath_stiff.readings.raw import Reduction
from toolpath_stiff.report.history import dated, history_text
from toolpath_stiff.report.tables import Table
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

DATA: Mapping[str, Callable[[Reduction], Content]] = {}
HEAD = ("loop", ">N/mm", ">force N", ">deflection um", ">lost motion um", ">width um", ">linearity %", ">closure um")


def pictures(reduction: Reduction) -> Mapping[str, Content | Callable[[], Content]]:
    """The loops drawn, and dated struts over their dates."""
    there = {"loops.png": bool(reduction.recorded), "history.png": dated(reduction.history)}
    return folder.files(reduction, omit=[name for name in there if not there[name]])


def text(reduction: Reduction) -> str:
    """The figures of the loops and the struts' histories; rows of a table of stiffnesses say nothing themselves."""
    recorded = reduction.recorded
    history = history_text(reduction.history, undated=not recorded)
    return "\n".join([*_loops(recorded), *history]).lstrip("\n")


def _loops(entries: Sequence[Document]) -> list[str]:
    """A line a loop, then what their shapes say."""
    if not entries:
        return []
    names = ("deflection_um", "lost_motion_um", "loop_width_um", "linearity_percent", "closure_um")
    rows = [
        (
            entry["loop"],
            f"{entry['stiffness_N_per_mm']:.0f}",
            "-" if entry["force_N"] is None else f"{entry['force_N']:.0f}",
            *("-" if entry[name] is None else f"{entry[name] + 0.0:.1f}" for name in names),
        )
        for entry in entries
    ]
    shapes = [f"{entry['loop']}: {entry['shape']['text']}" for entry in entries if entry["shape"]["text"]]
    return Table(HEAD, rows).lines(0, 0) + shapes


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
