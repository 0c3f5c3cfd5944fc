"""What the missing thing looks like: its section of the page, and its picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from toolpath_stiff.documents import Document
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.explanations import figure_of, percent, probability_text, significant
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
    new_figure,
)
from toolpath_stiff.report.pages import markup, table
from toolpath_stiff.report.words import MINUS_IS_SOFTER, plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from toolpath_stiff.portrait.portrait import Portrait
    from toolpath_stiff.readings.measurements import Measurements


AXES = "XYZ"


COLOURS = (BLUE, SECOND_ORANGE, MUTED, RAPID_GREY)


MOST_BARS = 8


def portrait_section(document: Document) -> Markup:
    """The portrait in words, its terms, and what else would look the same; nothing where there is none."""
    portrait = document["portrait"]
    if not portrait:
        return Markup()
    body = markup("<p>{}</p>", portrait["text"])
    rows = [("", [*_row(one), "1"]) for one in portrait["terms"]]
    rows[1:] = [("", [*cells[:-1], "beside it"]) for _, cells in rows[1:]]
    rows[:1] = [("plausible", [*cells[:-1], "leading"]) for _, cells in rows[:1]]
    rows += [
        ("", [*_row(one), f"instead, {probability_text(figure_of(one, 'probability'))}"])
        for one in portrait["indistinguishable"]
    ]
    if not rows:
        return body
    head = ("what gives way", "link", "varies with", "size (95 % interval)", "change of stiffness", "part")
    return body + table(head, rows, (4,))


def _row(one: Document) -> list[str]:
    low, high = (significant(end, 3) for end in one["interval"])
    size = f"{significant(one['size'], 3)} {one['unit']} ({low} to {high})"
    return [
        str(one["words"]), str(one["link"]), f"{one['variable']} ({one['shape']})", size,
        percent(figure_of(one, "rms_percent")),
    ]  # fmt: skip


def portrait_png(document: Document, data: Measurements, portrait: Portrait | None) -> Drawing | None:
    """PNG: what is left of the readings over what the leading term varies with; how surely it is which link."""
    if portrait is None or not portrait.terms or portrait.before is None or portrait.after is None:
        return None
    entry = document["portrait"]
    assert entry is not None
    with house_style():
        figure = new_figure(14.0, 5.4)
        figure.text(0.25 / 14.0, 1.0 - 0.4 / 5.4, "What does the missing thing look like?", fontsize=14, weight="bold")
        note = shortened(plain(f"leading: {entry['terms'][0]['words']}"), 150)
        figure.text(0.25 / 14.0, 1.0 - 0.68 / 5.4, note, fontsize=9.5, color=MUTED)
        left, right = figure.add_axes((0.055, 0.115, 0.56, 0.685)), figure.add_axes((0.765, 0.115, 0.2, 0.685))
        _points(left, data, portrait)
        _bars(right, entry["links"], entry["variables"])
        return drawing(figure)


def _points(axes: Axes, data: Measurements, portrait: Portrait) -> None:
    """Every reading before (hollow) and after (dots), over the variable or, of a constant, over the term's change."""
    from toolpath_stiff.portrait.words import variable_label

    assert portrait.before is not None and portrait.after is not None and portrait.signature is not None
    label, si = variable_label(portrait.terms[0].term)
    across = portrait.values
    if across is None:
        across, label, si = np.expm1(portrait.signature), "change of stiffness by the leading term, %", 0.01
    across = across / si
    before, after = deviation_percent(portrait.before), deviation_percent(portrait.after)
    for k, rows in enumerate(_by_direction(data)):
        if not rows.any():
            continue
        name = f"along {AXES[k]}" if k < 3 else "oblique"
        axes.plot(across[rows], before[rows], "o", mfc="none", mec=COLOURS[k], ms=5.5, mew=1.1, zorder=3, label=name)
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


def _by_direction(data: Measurements) -> list[NDArray[np.bool_]]:
    """Readings along X, Y, Z, and others."""
    along = [np.abs(data.direction[:, k]) > 0.999 for k in range(3)]
    return [*along, ~np.any(along, axis=0)]


def _bars(axes: Axes, links: Sequence[Document], variables: Sequence[Document]) -> None:
    """Probabilities of links and variables."""
    rows = [(str(one["link"]), one["probability"], BLUE) for one in links]
    rows += [(str(one["variable"]), one["probability"], SECOND_ORANGE) for one in variables]
    if not links:
        rows.insert(0, ("link cannot be told", 0.0, BLUE))
    rows = rows[:MOST_BARS]
    axes.barh(range(len(rows)), [value or 0.0 for _, value, _ in rows], height=0.55, color=[c for *_, c in rows])
    for y, (_, value, _) in enumerate(rows):
        axes.annotate(
            probability_text(value), (value or 0.0, y), xytext=(4, 0), textcoords="offset points", va="center", size=9
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
