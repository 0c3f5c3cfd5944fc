"""Figures of an analysis in words: the same on the terminal, in the pictures and on the pages."""

from __future__ import annotations

from toolpath_stiff.analysis.document import compare_summaries
from toolpath_stiff.analysis.loads import PLUNGES_ONLY
from toolpath_stiff.analysis.statistics import FIGURES
from toolpath_stiff.documents import Document
from toolpath_stiff.units import number

# Who read a program, for headings (`Program.interpreter`).
READERS = {"builtin": "the built-in reader", "linuxcnc": "LinuxCNC's interpreter (rs274)"}
ONLY_PLUNGES = "only plunges"  # beside a program, a tool or an operation


def figures_in_words(figures: Document) -> list[str]:
    """Mean, smallest, largest, range and deflection, in the order of `FIGURES`."""
    return [number(figures[name], 2 if name.endswith("_um") else 0) for name in FIGURES]


def place_words(place: Document, decimals: int) -> str:
    """The position of a weakest place, with the angles where there are any: "X10.00 Y0.00 Z-2.00"."""
    axes = "xyzabc" if any(place[f"{axis}_deg"] for axis in "abc") else "xyz"
    values = [place[f"{axis}_mm" if axis in "xyz" else f"{axis}_deg"] for axis in axes]
    return " ".join(f"{axis.upper()}{value:.{decimals}f}" for axis, value in zip(axes, values, strict=True))


def compared_rows(
    summary: Document, other: Document, titles: tuple[str, ...], plunges_title: str
) -> tuple[list[list[str]], list[list[str]]]:
    """Two machines side by side, the difference in percent of the first: the figures, and the plunges where there are.

    `other` is a summary or the entry `compare` of one; `titles` are those of `FIGURES`.
    """
    compared = other if "difference_percent" in other else compare_summaries(summary, other)
    changes = [*compared["difference_percent"].values(), compared["plunges_difference_percent"]]
    shown = ["-" if change is None else f"{change:+.1f} %" for change in changes]
    columns = (titles, figures_in_words(summary), figures_in_words(other), shown[:-1])
    plunges = [plunges_beside(figures) for figures in (summary, other)]
    means = [number(figures["mean_N_per_mm"] if figures else None) for figures in plunges]
    beside = [[plunges_title, *means, shown[-1]]] if any(plunges) else []
    return [list(row) for row in zip(*columns, strict=True)], beside


def span_of(figures: Document) -> str:
    """Lowest and highest stiffness of a block of figures: "122 988 to 123 770"."""
    return f"{number(figures['min_N_per_mm'])} to {number(figures['max_N_per_mm'])}"


def headline_text(figures: Document, between: str) -> str:
    """Mean and range for a heading, and what they are about where that is not every cut; `between` the parts."""
    text = f"mean {number(figures['mean_N_per_mm'])} N/mm ({span_of(figures)})"
    if only_plunges(figures):
        return f"{text}, {ONLY_PLUNGES}"
    plunges = plunges_beside(figures)
    if plunges is None:
        return text
    return f"{text} across the tool axis{between}plunges {number(plunges['mean_N_per_mm'])} N/mm ({span_of(plunges)})"


def plunges_beside(figures: Document) -> Document | None:
    """The plunges that the headline figures leave out; None where there are none, or where there is nothing else."""
    plunges: Document | None = figures["plunges"]
    return None if only_plunges(figures) else plunges


def length_in_moves(plunges: Document) -> str:
    """How much is plunged: "20.0 mm in 3 moves"."""
    return f"{number(plunges['length_mm'], 1)} mm in {number(plunges['moves'])} move{'s' * (plunges['moves'] != 1)}"


def only_plunges(figures: Document) -> bool:
    """True where the figures of a program, a tool or an operation are those of plunges, for it does nothing else."""
    return bool(figures.get("headline") == PLUNGES_ONLY)
