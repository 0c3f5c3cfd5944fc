"""Pictures of a diagnosis: explanations, portrait of what is missing, before and after."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.diagnosis.examination import Diagnosis, HypothesisRow
from toolpath_stiff.documents import json_number
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED, deviation_percent
from toolpath_stiff.inference.judgement import NONE
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.portrait.words import term_words, variable_label
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.colours import BLUE, CHOSEN, DIRECTIONS, FAINT, GREY, INK, MUTED, ORANGE
from toolpath_stiff.report.explanations import floor_text, leading_rows, probability_text, remark_text, size_texts
from toolpath_stiff.report.pictures.before_after import before_after
from toolpath_stiff.report.pictures.style import Look, new_figure, open_frame, panel
from toolpath_stiff.report.words import RESIDUAL_AXIS, counted, percent, plain, shortened

MOST_BARS = 8
ROW = 0.47  # inch a candidate
PLACES = ((0.14, 13.79), (4.9, 4.34), (9.66, 1.82))  # left edge and width of words, errors, probabilities, inches
BEYOND = 1.7  # multiple of the base model's error at which the ladder's axis ends; arrows stand for more


def ladder(diagnosis: Diagnosis) -> Figure:
    """All explanations with their errors at left-out points and probabilities, the best first.

    As given, strut law refitted, what no effect describes (if it was weighed), then pairs and effects.
    """
    every, standing = diagnosis.rows, len(diagnosis.explanations)
    rows, more = leading_rows(diagnosis)
    rows[2:2] = [every.outside] if every.outside.probability else []
    shaded = f"shaded: {counted(standing, 'explanation')} left standing" if standing else "none left"
    figure = new_figure(
        14.0, 1.75 + ROW * len(rows), "Which effect explains the data, and how surely?",
        f"verdict: {diagnosis.verdict}   ·   {shaded}   ·   bar at a dot: standard error of its fall from the refitted "
        f"strut law   ·   grey: not offered{f'   ·   {more} less likely in diagnose.json' if more else ''}",
    )  # fmt: skip
    height = ROW * len(rows) + 0.03
    words, errors, chances = (panel(figure, left, 0.62, width, height) for left, width in PLACES)
    words.set_axis_off()
    words.set_xlim(0.0, PLACES[0][1])
    for axes in (words, errors, chances):
        axes.set_ylim(len(rows) - 0.5, -0.5)
    for axes in (errors, chances):
        axes.patch.set_visible(False)
        axes.set_yticks([])
        axes.grid(visible=False, axis="y")
        open_frame(axes, "left")
    _words(words, rows)
    _errors(errors, rows, diagnosis)
    _chances(chances, rows)
    return figure


def _words(axes: Axes, rows: Sequence[HypothesisRow]) -> None:
    """Write what each row is to the left of its figures, and how it stands to their right; x in inches."""
    for y, row in enumerate(rows):
        if row.standing:
            axes.axhspan(y - 0.5, y + 0.5, color=CHOSEN, lw=0)
        small = ", ".join(size_texts(row, intervals=False)) or plain(row.title)
        ink, muted = (INK, MUTED) if row.offered else (GREY, GREY)
        weight = "bold" if row.standing else "normal"
        axes.text(0.14, y - 0.16, shortened(plain(row.label), 58), va="center", color=ink, weight=weight)
        axes.text(0.14, y + 0.21, shortened(small, 76), va="center", color=muted, size=8)
        lines = textwrap.wrap(remark_text(row).split(":")[0], 31, max_lines=2, placeholder=" ...")
        axes.text(11.69, y, "\n".join(lines), va="center", size=8.5, color=INK if row.offered else MUTED)


def _errors(axes: Axes, rows: Sequence[HypothesisRow], diagnosis: Diagnosis) -> None:
    base, floor = diagnosis.rows.refitted.held_out_error_percent, json_number(diagnosis.noise.floor_percent) or 0.0
    errors = [error for row in rows for error in (row.held_out_error_percent, row.mean_abs_error_percent)]
    end = 1.08 * max(error for error in errors if error is not None)
    end = max(end if base is None else min(end, BEYOND * base), 1.3 * floor, 1e-6)
    axes.set_xlim(0.0, end)
    lines = [(floor, f"noise floor {floor_text(diagnosis)}", ORANGE, ":")]
    lines += [] if base is None else [(base, f"strut law refitted {percent(base)}", INK, "--")]
    for (value, text, colour, style), side in zip(
        sorted(lines), ("right", "left"), strict=False
    ):  # drawn away from each other
        axes.axvline(value, color=colour, lw=1.3, ls=style, zorder=1)
        place: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "size": 8.5, "ha": side}
        axes.annotate(text, (value, 1.0), xytext=(4 if side == "left" else -4, 3), color=colour, **place)
    for y, row in enumerate(rows):
        colour = BLUE if row.standing else INK if row.name in (AS_GIVEN, NONE) else MUTED
        colour = colour if row.offered else GREY
        within, outside = row.mean_abs_error_percent, row.held_out_error_percent
        if within is not None and within <= end:
            axes.plot(within, y, "|", color=colour, ms=11, mew=1.6, zorder=3)
        if outside is None:
            continue
        if outside > end:
            text = f"{percent(outside)} \N{RIGHTWARDS ARROW}"
            axes.annotate(text, (end, y), ha="right", va="center", size=9, color=colour)
            continue
        axes.plot(outside, y, "o", color=colour, mfc=colour if row.offered else "white", ms=8, zorder=4)
        if base is not None and row.held_out_gain_in_se and base != outside:
            # Standard error of the fall of the held-out error, from the fall in standard errors.
            error = abs((base - outside) / row.held_out_gain_in_se)
            axes.plot([max(outside - error, 0.0), outside + error], [y, y], color=colour, lw=2.0, zorder=3)
    axes.set_xlabel("mean |modelled - measured| / measured, %; dot: left out, tick: in sample", size=9)


def _chances(axes: Axes, rows: Sequence[HypothesisRow]) -> None:
    for y, row in enumerate(rows):
        value = row.probability or 0.0
        axes.barh(y, value, height=0.5, color=BLUE if row.offered else GREY, zorder=2)
        inside = value > 0.6
        look: Look = {"ha": "right", "color": "white"} if inside else {"ha": "left", "color": INK}
        place = value + (-0.03 if inside else 0.03), y
        axes.text(*place, probability_text(row.probability), va="center", size=9, zorder=3, **look)
    _probability_axis(axes, 1.0)
    axes.set_xlabel("probability", size=9)


def _probability_axis(axes: Axes, end: float) -> None:
    axes.set_xlim(0.0, end)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])


def looks(diagnosis: Diagnosis) -> Figure | None:
    """Residuals over the variable of the leading term, and the probability of each link."""
    portrait = diagnosis.portrait
    if portrait is None or not portrait.terms:
        return None
    note = shortened(plain(f"leading: {term_words(portrait.terms[0].term)}"), 150)
    figure = new_figure(14.0, 5.4, "What does the missing thing look like?", note)
    _points(panel(figure, 0.77, 0.62, 7.84, 3.7), diagnosis.data, portrait)
    _bars(panel(figure, 10.71, 0.62, 2.8, 3.7), portrait)
    return figure


def _points(axes: Axes, data: Readings, portrait: Portrait) -> None:
    """Draw each reading before (hollow) and after (dots), over the variable or, if constant, over the term's change."""
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
    rows = [(name, weight, BLUE) for name, weight in portrait.links or (("link cannot be told", 0.0),)]
    rows += [(name, weight, ORANGE) for name, weight in portrait.variables]
    rows = [(name, json_number(weight, 3) or 0.0, colour) for name, weight, colour in rows[:MOST_BARS]]
    axes.barh(range(len(rows)), [value for _, value, _ in rows], height=0.55, color=[colour for *_, colour in rows])
    for y, (_, value, _) in enumerate(rows):
        text = probability_text(value)
        axes.annotate(text, (value, y), xytext=(4, 0), textcoords="offset points", va="center", size=9)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows])
    axes.set_ylim(max(len(rows), 5) - 0.5, -0.5)
    _probability_axis(axes, 1.15)
    axes.set_title("which link (blue), what it varies with (orange)", size=9.5, loc="right", weight="normal")
    axes.grid(visible=False, axis="y")
    open_frame(axes, "left")
    axes.tick_params(axis="y", length=0, labelcolor=INK)


def fits(diagnosis: Diagnosis) -> Figure:
    """Errors of the model, and those left with the best explanation."""
    base, best = diagnosis.rows.refitted, None if diagnosis.verdict == "adequate" else diagnosis.rows.best
    word = "best of the catalogue:" if diagnosis.verdict == "unexplained" else "with"
    last = f"{word} {plain(best.label)}" if best else LAW_REFITTED
    held_out, refitted = (best or base).held_out_error_percent, base.mean_abs_error_percent if best else None
    return before_after(diagnosis.data, (diagnosis.as_given.residual, diagnosis.after), last, held_out, refitted)


PICTURES = {"ladder.png": ladder, "portrait.png": looks, "before_after.png": fits}
