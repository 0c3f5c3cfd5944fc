"""Views of an update: page and text."""

from collections.abc import Mapping
from textwrap import fill

import numpy as np

from toolpath_stiff.correction.result import FORCED, NOTHING, REFUSED, UPDATED, Update
from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.diagnosis.examination import FittedSize, percent_of
from toolpath_stiff.documents import number
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.pages import Section, hints, page_of, readings_head
from toolpath_stiff.report.residuals import residual_rows
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, WIDTH, counted, machine_text, percent, plain
from toolpath_stiff.units import n_per_mm_from_n_per_m

VERDICTS = {
    UPDATED: "The machine is updated",
    REFUSED: "Refused: the data do not support it",
    FORCED: "Added by force",
    NOTHING: "Nothing to add",
}
PAGE = "report.html"
LADDER_REMARK = (
    "From the machine file as given over its refitted strut law to the last model. What counts is the error at "
    "left-out points, which the fit has not seen. A fit weighs readings by their scatter, so that a step can raise "
    "this mean. "
    "Effects that only together lower it are one step. An error below the noise floor is chance."
)
# Picture -> the question that it answers, and how to read it.
QUESTIONS = {
    "before_after.png": (
        "Did the error fall, and what remains?",
        f"{DEVIATION}, {MINUS_IS_SOFTER} (red); blue: stiffer; both halves on one colour scale. A pattern that remains "
        "is something else that the model lacks.",
    ),
}


def page(update: Update, drawn: Mapping[str, bytes]) -> str:
    """The page, with the pictures in it."""
    document, provenance = update.document, update.provenance
    record = [
        f"command: {provenance['command']}",
        f"SHA-256 of the data: {provenance['data_sha256']}",
        f"machine file: {document['machine_file'] or 'none written'}",
    ]
    sections: list[Section] = [
        ("What does each step do to the error?", _ladder(update), LADDER_REMARK),
        *QUESTIONS,
        ("Errors by direction", _by_direction(update), f"Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."),
        ("What was fitted", _fitted(update)),
        ("Do the data support it?", support_table(update)),
        ("What to do next", hints(update.next)),
        ("Where it comes from", record),
        ("Assumptions", [*document["assumptions"], *document["notes"]]),
    ]
    head = readings_head("update", document, VERDICTS[update.verdict], _headline(update), _figures(update))
    return page_of(head, sections, drawn, QUESTIONS)


def _headline(update: Update) -> str:
    given, findings = f"Mean error {_percent(update.steps[0].error)} as given", update.steps[-1].fit.findings
    if update.verdict == NOTHING:
        return f"{given}, and nothing to add"
    if findings and update.verdict in (UPDATED, FORCED):
        cause = "; ".join(findings)
        return cause[0].upper() + cause[1:] + (" (described, not confirmed)" if update.described else "")
    return f"{given}, {_percent(update.steps[-1].error)} after"


def _figures(update: Update) -> list[tuple[str, str]]:
    last, figures = update.steps[-1], [(_percent(update.steps[0].error), "mean error as given")]
    figures.append((_percent(update.refitted.error), "mean error, strut law refitted"))
    if last.fit.names or update.search:
        figures.append((_percent(last.error), f"mean error {last.title}" if last.fit.names else last.name))
    figures.append((_percent(last.held.mean_error), "the same at left-out points"))
    figures.append((percent(update.noise.floor_percent, 2), "would be left by scatter alone"))
    return figures


def _result(update: Update) -> LadderStep:
    """Resulting model: the last step, or the machine file as given if nothing is added."""
    return update.steps[0 if update.verdict == NOTHING else -1]


def _by_direction(update: Update) -> ShownTable:
    first, last = update.steps[0].by_direction, _result(update).by_direction
    rows = [
        (
            name,
            before["readings"],
            percent(before["mean_abs_error_percent"], 2),
            percent(last[name]["mean_abs_error_percent"], 2),
            percent(last[name]["held_out_error_percent"], 2),
            f"{before['bias_percent']:+.1f} %",
            f"{last[name]['bias_percent']:+.1f} %",
        )
        for name, before in first.items()
    ]
    figures = (">as given", ">after", ">after, left out", ">bias as given", ">bias after")
    return ShownTable(("direction", ">readings", *figures), rows)


def _fitted(update: Update) -> ShownTable:
    step = _result(update)
    rows = [
        (
            "strut law",
            "at every length" if end["length_mm"] is None else f"at {end['length_mm']:.1f} mm",
            f"{end['stiffness']:.2f} N/um",
            f"sd {end['sd']:.2g} N/um",
        )
        for end in step.law_ends(update.task.machine.strut_law, update.widening)
        if end["sd"] is not None
    ]
    for effect, entry in step.sizes(update.widening).items():
        for key, value in entry.items():
            if isinstance(value, FittedSize):
                low, high = map(_value, value.interval)
                rows.append((effect, key, f"{_value(value.value)} {value.unit}", f"{low} to {high}"))
            else:
                rows.append((effect, key, str(value), "chosen"))
    return ShownTable(("effect", "parameter", ">value", ">95 % interval, or sd"), rows)


def support_table(update: Update) -> ShownTable:
    """Table of the evidence for and against each effect."""
    rows = [
        (
            support.effect,
            "yes" if support.supported else "no",
            "-" if support.held_out_gain_in_se is None else f"{support.held_out_gain_in_se:+.1f} se",
            f"{number(support.likelihood_gain, 1)} (chance: {number(support.threshold, 1)})",
            "; ".join(support.reasons),
        )
        for support in (*update.supports, *update.turned_down)
    ]
    head = ("effect", "supported", ">fall at left-out points", ">gain in twice the log likelihood")
    return ShownTable((*head, "what is against it"), rows)


def residuals_csv(update: Update) -> str:
    """One row per tip reading: measured, modelled as given and after, deviations, also with its point left out."""
    data, given, last = update.task.data.of_tip, update.steps[0].residual, update.last
    measured = n_per_mm_from_n_per_m(data.stiffness)
    wild = np.isin(np.flatnonzero(update.task.data.tip), last.fit.scatter.wild)
    figures = {
        "measured_N_per_mm": (measured, ".1f"),
        "as_given_N_per_mm": (measured * np.exp(-given), ".1f"),
        "after_N_per_mm": (measured * np.exp(-last.residual), ".1f"),
        "as_given_deviation_percent": (deviation_percent(given), ".3f"),
        "after_deviation_percent": (deviation_percent(last.residual), ".3f"),
        "left_out_deviation_percent": (deviation_percent(last.held.residual), ".3f"),
        "wild": (wild.astype(float), ".0f"),
    }
    return residual_rows(data, {"setup": data.setup, "direction": last.along}, figures)


def _ladder(update: Update) -> ShownTable:
    rows = [
        (
            step["name"],
            percent(step["mean_abs_error_percent"], 2),
            percent(step["held_out_error_percent"], 2),
            number(step.get("held_out_gain_in_se"), 1),
        )
        for step in update.document["steps"]
    ]
    rows.append(("noise floor", percent(update.noise.floor_percent, 2), "", ""))
    return ShownTable(("", ">error", ">left out", ">gain/SE"), rows)


def _percent(share: float) -> str:
    return percent(percent_of(share), 2)


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def text(update: Update) -> str:
    """Ladder, errors by direction before and after, parameters, rejected effects."""
    document, fitted = update.document, _fitted(update)
    data = f"{counted(document['readings'], 'reading')} of {', '.join(map(plain, update.task.files))}"
    lines = [
        f"data     {data}, machine {machine_text(document)}",
        fill(f"result   {update.verdict.upper()}. {plain(document['text'])}", WIDTH, subsequent_indent=" " * 9),
        "",
        *_ladder(update).lines(least=0),
        f"noise: {plain(update.noise.origin)}",
        "",
        *_by_direction(update).lines(least=0),
    ]
    lines += ["", *fitted.lines(least=0)] if fitted.rows else []
    if update.turned_down:
        lines += ["", "tried and not added"]
        for support in update.turned_down:
            lines.append(fill(f"  {support.effect}: {'; '.join(support.reasons)}", WIDTH, subsequent_indent=" " * 4))
    lines += [""] + [f"warning: {plain(warning)}" for warning in document["warnings"]]
    lines += [f"note: {plain(note)}" for note in document["notes"]]
    return "\n".join(lines).rstrip()


DATA = {
    "update.json": Update.to_json,
    "residuals.csv": residuals_csv,
    "machine.toml": Update.machine_text,
}
