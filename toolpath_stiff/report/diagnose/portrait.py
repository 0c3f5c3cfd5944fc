"""What the missing thing looks like: its section of the page, and its picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.portrait.portrait import Portrait, Sized
from toolpath_stiff.portrait.words import portrait_text, term_words, variable_label
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.diagnose.pictures import titled_figure
from toolpath_stiff.report.explanations import probability_text
from toolpath_stiff.report.figure import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    RAPID_GREY,
    SECOND_ORANGE,
    Drawing,
    drawing,
    house_style,
)
from toolpath_stiff.report.pages import markup, table
from toolpath_stiff.report.words import MINUS_IS_SOFTER, percent, plain, shortened, significant
from toolpath_stiff.units import json_number

if TYPE_CHECKING:
    from matplotlib.axes import Axes


COLOURS = {"along X": BLUE, "along Y": SECOND_ORANGE, "along Z": MUTED, "oblique": RAPID_GREY}


MOST_BARS = 8


def portrait_section(portrait: Portrait | None) -> Markup:
    """The portrait in words, its terms, and what else would look the same; nothing where there is none."""
    if portrait is None:
        return Markup()
    rows = [("", [*_cells(sized), "beside it"]) for sized in portrait.terms]
    rows[:1] = [("plausible", [*cells[:-1], "leading"]) for _, cells in rows[:1]]
    for sized in portrait.alike:
        instead = probability_text(json_number(sized.probability or 0.0, 3))
        rows.append(("", [*_cells(sized), f"instead, {instead}"]))
    head = ("what gives way", "link", "varies with", "size (95 % interval)", "change of stiffness", "part")
    return markup("<p>{}</p>", portrait_text(portrait)) + table(head, rows, (4,))


def _cells(sized: Sized) -> list[str]:
    term = sized.term
    size, low, high = (significant(json_number(value / term.si)) for value in (term.size, *sized.interval))
    change = percent(json_number(100.0 * sized.rms, 3))
    kind = f"{term.variable} ({term.shape})"
    return [term_words(term), term.link, kind, f"{size} {term.unit} ({low} to {high})", change]


def portrait_png(portrait: Portrait | None, data: Readings) -> Drawing | None:
    """PNG: what is left of the readings over what the leading term varies with; how surely it is which link."""
    if portrait is None or not portrait.terms:
        return None
    with house_style():
        note = shortened(plain(f"leading: {term_words(portrait.terms[0].term)}"), 150)
        figure = titled_figure(5.4, "What does the missing thing look like?", note)
        left, right = figure.add_axes((0.055, 0.115, 0.56, 0.685)), figure.add_axes((0.765, 0.115, 0.2, 0.685))
        _points(left, data, portrait)
        _bars(right, portrait)
        return drawing(figure)


def _points(axes: Axes, data: Readings, portrait: Portrait) -> None:
    """Every reading before (hollow) and after (dots), over the variable or, of a constant, over the term's change."""
    assert portrait.before is not None and portrait.after is not None and portrait.signature is not None
    label, si = variable_label(portrait.terms[0].term)
    across = portrait.values
    if across is None:
        across, label, si = np.expm1(portrait.signature), "change of stiffness by the leading term, %", 0.01
    across = across / si
    before, after = deviation_percent(portrait.before), deviation_percent(portrait.after)
    along = np.abs(data.direction) > 0.999
    for (name, colour), rows in zip(COLOURS.items(), [*along.T, ~along.any(axis=1)], strict=True):
        if rows.any():
            axes.plot(across[rows], before[rows], "o", mfc="none", mec=colour, ms=5.5, mew=1.1, zorder=3, label=name)
    axes.plot(across, after, ".", color=FAINT, ms=4, zorder=2, label="left with the description")
    axes.axhline(0.0, color=INK, lw=0.8, zorder=1)
    axes.set_xlabel(label)
    axes.set_ylabel("(measured - modelled) / modelled, %")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, fontsize=9, frameon=False)
    axes.annotate(
        MINUS_IS_SOFTER, (0.0, 1.0), xycoords="axes fraction", xytext=(0, 5), textcoords="offset points", size=9,
        color=MUTED,
    )  # fmt: skip
    axes.spines[["top", "right"]].set_visible(False)


def _bars(axes: Axes, portrait: Portrait) -> None:
    """Probabilities of links and variables."""
    rows = [(name, weight, BLUE) for name, weight in portrait.links or (("link cannot be told", 0.0),)]
    rows += [(name, weight, SECOND_ORANGE) for name, weight in portrait.variables]
    rows = [(name, json_number(weight, 3) or 0.0, colour) for name, weight, colour in rows[:MOST_BARS]]
    axes.barh(range(len(rows)), [value for _, value, _ in rows], height=0.55, color=[colour for *_, colour in rows])
    for y, (_, value, _) in enumerate(rows):
        axes.annotate(
            probability_text(value), (value, y), xytext=(4, 0), textcoords="offset points", va="center", size=9
        )
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows], color=INK)
    axes.set_ylim(max(len(rows), 5) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.15)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])
    axes.set_title(
        "which link (blue), what it varies with (orange)", size=9.5, loc="right", color=MUTED, weight="normal"
    )
    axes.grid(visible=False, axis="y")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
