"""Pictures of a diagnosis: what the missing thing looks like, what the data cannot tell apart, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.inference.confounding import Confounding
from toolpath_stiff.inference.errors import LAW_REFITTED, deviation_percent
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.portrait.words import term_words, variable_label
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.colours import BLUE, DIRECTIONS, FAINT, INK, ORANGE
from toolpath_stiff.report.explanations import probability_text
from toolpath_stiff.report.pictures.before_after import Fits, before_after
from toolpath_stiff.report.pictures.ladder import ladder
from toolpath_stiff.report.pictures.style import Look, new_figure, open_frame, panel
from toolpath_stiff.report.words import RESIDUAL_AXIS, plain, shortened
from toolpath_stiff.units import json_number

MOST_BARS = 8
OPAQUE = 0.75  # from here on a cell is dark on a light page, and light on a dark one


def looks(diagnosis: Diagnosis) -> Figure | None:
    """What is left of the readings over what the leading term varies with; how surely it is which link."""
    portrait = diagnosis.portrait
    if portrait is None or not portrait.terms:
        return None
    note = shortened(plain(f"leading: {term_words(portrait.terms[0].term)}"), 150)
    figure = new_figure(14.0, 5.4, "What does the missing thing look like?", note)
    _points(panel(figure, 0.77, 0.62, 7.84, 3.7), diagnosis.data, portrait)
    _bars(panel(figure, 10.71, 0.62, 2.8, 3.7), portrait)
    return figure


def _points(axes: Axes, data: Readings, portrait: Portrait) -> None:
    """Every reading before (hollow) and after (dots), over the variable or, of a constant, over the term's change."""
    assert portrait.before is not None and portrait.after is not None and portrait.signature is not None
    label, si = variable_label(portrait.terms[0].term)
    across = portrait.values
    if across is None:
        across, label, si = np.expm1(portrait.signature), "change of stiffness by the leading term, %", 0.01
    across = across / si
    before, after = deviation_percent(portrait.before), deviation_percent(portrait.after)
    along = directions(data)
    for name, colour in DIRECTIONS.items():
        if (rows := along == name).any():
            label = name if name == "oblique" else f"along {name}"
            axes.plot(across[rows], before[rows], "o", mfc="none", mec=colour, ms=5.5, mew=1.1, zorder=3, label=label)
    axes.plot(across, after, ".", color=FAINT, ms=4, zorder=2, label="left with the description")
    axes.axhline(0.0, color=INK, lw=0.8, zorder=1)
    axes.set_xlabel(label)
    axes.set_ylabel(RESIDUAL_AXIS)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, fontsize=9, frameon=False)
    open_frame(axes)


def _bars(axes: Axes, portrait: Portrait) -> None:
    """Probabilities of links and variables."""
    rows = [(name, weight, BLUE) for name, weight in portrait.links or (("link cannot be told", 0.0),)]
    rows += [(name, weight, ORANGE) for name, weight in portrait.variables]
    rows = [(name, json_number(weight, 3) or 0.0, colour) for name, weight, colour in rows[:MOST_BARS]]
    axes.barh(range(len(rows)), [value for _, value, _ in rows], height=0.55, color=[colour for *_, colour in rows])
    for y, (_, value, _) in enumerate(rows):
        text = probability_text(value)
        axes.annotate(text, (value, y), xytext=(4, 0), textcoords="offset points", va="center", size=9)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows], color=INK)
    axes.set_ylim(max(len(rows), 5) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.15)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])
    axes.set_title("which link (blue), what it varies with (orange)", size=9.5, loc="right", weight="normal")
    axes.grid(visible=False, axis="y")
    open_frame(axes, "left")
    axes.tick_params(axis="y", length=0)


def confounding(diagnosis: Diagnosis) -> Figure:
    """How alike the effects' signatures are on this design; effects that cannot be told apart stand in boxes."""
    names, matrix, sets = confounding_in_order(diagnosis.confounding)
    count = max(len(names), 1)
    width, left, overhang = 14.0, 2.3, 1.25  # inches; the last name leans over the matrix by the overhang
    wide, tall = min(width - left - overhang, 1.6 * count), 0.42 * max(count, 3)
    note = "1: the same after refitting the strut law; boxed: one set"
    figure = new_figure(width, tall + 2.9, "What can these data not tell apart?", note)
    axes = panel(figure, left, 0.3, wide, tall)
    # Blue, the more opaque the more alike: on a dark page the cells of what is unlike are dark.
    cells = np.zeros((*matrix.shape, 4))
    cells[..., :3], cells[..., 3] = to_rgb(BLUE), np.clip(matrix, 0.0, 1.0) ** 1.5
    edges = np.arange(count + 1) - 0.5
    axes.pcolormesh(edges, edges, cells, edgecolors="none")
    axes.set_xlim(-0.5, count - 0.5)
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_xticks(range(len(names)), names, rotation=50, ha="left", rotation_mode="anchor", color=INK, size=9)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(names)), names, color=INK, size=9)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    for (i, j), value in np.ndenumerate(matrix):
        if i != j and value > 0.5:
            text, colour = f"{value:.2f}".replace("0.", ".", 1), "white" if value > OPAQUE else INK
            axes.text(j, i, text, ha="center", va="center", size=9, color=colour)
    box: Look = {"fill": False, "edgecolor": ORANGE, "lw": 2.6, "zorder": 5, "clip_on": False}
    for start, size in sets:
        axes.add_patch(Rectangle((start - 0.5, start - 0.5), size, size, **box))
    return figure


def confounding_in_order(given: Confounding) -> tuple[list[str], FloatArray, list[tuple[int, int]]]:
    """Names and matrix with the sets beside each other, the largest first, and (first place, size) of each set.

    Within a set and after the sets, each effect follows the one that it is most like.
    """
    names = [plain(name) for name in given.names]
    matrix = np.array(given.rounded, dtype=float).reshape(len(names), len(names))
    order: list[int] = []
    boxes = []
    for members in sorted(given.sets, key=len, reverse=True):
        boxes.append((len(order), len(members)))
        order += _chain([given.names.index(member) for member in members], matrix)
    order += _chain([place for place in range(len(names)) if place not in order], matrix)
    return [names[place] for place in order], matrix[np.ix_(order, order)], boxes


def _chain(places: Sequence[int], matrix: FloatArray) -> list[int]:
    """Each next to the one most like it, from the pair that is most alike."""
    left = list(places)
    if len(left) < 3:
        return left
    inside = matrix[np.ix_(left, left)] - np.eye(len(left)) * 2.0
    chain = [left.pop(int(np.argmax(inside.max(axis=1))))]
    while left:
        chain.append(left.pop(int(np.argmax([matrix[chain[-1], place] for place in left]))))
    return chain


def fits(diagnosis: Diagnosis) -> Figure:
    """Where the model fails, and what is left with the best explanation."""
    base, best = diagnosis.rows.refitted, None if diagnosis.verdict == "adequate" else diagnosis.rows.best
    word = "best of the catalogue:" if diagnosis.verdict == "unexplained" else "with"
    return before_after(
        Fits(
            diagnosis.data,
            diagnosis.before,
            diagnosis.after,
            f"{word} {plain(best.label)}" if best else LAW_REFITTED,
            (best or base).held_out_error_percent,
            base.mean_abs_error_percent if best else None,
        )
    )


PICTURES = {"ladder.png": ladder, "portrait.png": looks, "confounding.png": confounding, "before_after.png": fits}
