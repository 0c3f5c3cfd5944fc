"""Pictures of a diagnosis: what the missing thing looks like, what the data cannot tell apart, before and after."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.inference.errors import LAW_REFITTED, deviation_percent
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.portrait.words import term_words, variable_label
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.colours import BLUE, DIRECTIONS, FAINT, INK, ORANGE
from toolpath_stiff.report.explanations import probability_text
from toolpath_stiff.report.pictures.before_after import Fits, before_after
from toolpath_stiff.report.pictures.ladder import ladder
from toolpath_stiff.report.pictures.style import new_figure, open_frame, panel
from toolpath_stiff.report.words import RESIDUAL_AXIS, plain, shortened
from toolpath_stiff.units import json_number

MOST_BARS = 8


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
    axes.set(xlabel=label, ylabel=RESIDUAL_AXIS)
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
    axes.set(ylim=(max(len(rows), 5) - 0.5, -0.5), xlim=(0.0, 1.15))
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])
    axes.set_title("which link (blue), what it varies with (orange)", size=9.5, loc="right", weight="normal")
    axes.grid(visible=False, axis="y")
    open_frame(axes, "left")
    axes.tick_params(axis="y", length=0)


def fits(diagnosis: Diagnosis) -> Figure:
    """Where the model fails, and what is left with the best explanation."""
    base, best = diagnosis.rows.refitted, None if diagnosis.verdict == "adequate" else diagnosis.rows.best
    word = "best of the catalogue:" if diagnosis.verdict == "unexplained" else "with"
    return before_after(
        Fits(
            diagnosis.data,
            diagnosis.as_given.residual,
            diagnosis.after,
            f"{word} {plain(best.label)}" if best else LAW_REFITTED,
            (best or base).held_out_error_percent,
            base.mean_abs_error_percent if best else None,
        )
    )


PICTURES = {"ladder.png": ladder, "portrait.png": looks, "before_after.png": fits}
