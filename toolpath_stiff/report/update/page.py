"""The results of an update: page, files and text."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
from markupsafe import Markup

from toolpath_stiff.correction.document import residuals_csv
from toolpath_stiff.correction.outcome import FORCED, NOTHING, REFUSED, UPDATED
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.steps import LadderStep, LawEnd
from toolpath_stiff.correction.strut_law import bar_curve_csv
from toolpath_stiff.diagnosis.rows import FittedSize, percent_of
from toolpath_stiff.files import Content
from toolpath_stiff.report.pages import bullets, hint_list, markup, picture, readings_page, section, table
from toolpath_stiff.report.residuals import before_after_png
from toolpath_stiff.report.update.pictures import error_ladder_png, figure3_png
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, counted, machine_text, percent, plain
from toolpath_stiff.units import number

VERDICTS = {
    UPDATED: "The machine is updated",
    REFUSED: "Refused: the data do not support it",
    FORCED: "Added by force",
    NOTHING: "Nothing to add",
}


# Picture -> the question that it answers, and how it is read.
QUESTIONS = {
    "ladder.png": (
        "What does each step do to the error?",
        "From the machine file as given over its refitted strut law to the last model. What counts is the error at "
        "left-out points, which the fit has not seen. A fit weighs readings by their scatter, so that a step can raise "
        "this mean. Effects that only together lower it are one step. Bars: standard error of the step; an error below "
        "the noise floor is chance.",
    ),
    "before_after.png": (
        "Did the error fall, and what remains?",
        f"{DEVIATION}, {MINUS_IS_SOFTER} (red); blue: stiffer; both halves on one colour scale. A pattern that remains "
        "is something else that the model lacks.",
    ),
    "figure3.png": (
        "How stiff must the platform be taken?",
        "The paper: above 1e10 N/m a stiffer platform changes nothing. With the strut law refitted for each, "
        "the curve is all but flat: these readings cannot tell a soft platform from soft struts.",
    ),
}


WIDTH = 110


MACHINE_FILE = "machine.toml"


def update_html(update: Update, pictures: Mapping[str, bytes]) -> str:
    """The page's text, the pictures within."""
    document, provenance = update.document, update.provenance
    record = [
        f"command: {provenance['command']}",
        f"SHA-256 of the data: {provenance['data_sha256']}",
        f"machine file: {document['machine_file'] or 'none written'}",
    ]
    sections = [
        *(picture(name, pictures, QUESTIONS) for name in QUESTIONS),
        section("Errors by direction", _by_direction(update)),
        section("What was fitted", _fitted(update)),
        section("Do the data support it?", _support(update)),
        section("What to do next", hint_list(update.next)),
        section("Where it comes from", bullets(record)),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    verdict, figures = VERDICTS[update.verdict], _figures(update)
    return readings_page("Update", "update", document, verdict, _headline(update), figures, sections)


def _headline(update: Update) -> str:
    given, findings = f"Mean error {_percent(update.steps[0].error)} as given", update.steps[-1].fit.findings
    if update.verdict == NOTHING:
        return f"{given}, and nothing to add"
    if findings and update.verdict in (UPDATED, FORCED):
        cause = "; ".join(findings)
        return cause[0].upper() + cause[1:] + (" (described, not confirmed)" if update.described else "")
    return f"{given}, {_percent(update.steps[-1].error)} after"


def _figures(update: Update) -> list[tuple[str, str]]:
    last, by_likelihood = update.steps[-1], update.task.objective == "likelihood"
    figures = [(_percent(update.steps[0].error), "mean error as given")]
    if by_likelihood:
        figures.append((_percent(update.refitted.error), "mean error, strut law refitted"))
    if last.fit.names or not by_likelihood:
        figures.append((_percent(last.error), f"mean error {last.title}" if last.fit.names else last.name))
    figures.append((_percent(last.held.mean_error), "the same at left-out points"))
    figures.append((percent(update.noise.floor_percent, 2), "would be left by scatter alone"))
    return figures


def _result(update: Update) -> LadderStep:
    """The model that comes out: the last step, the machine file as given where nothing is added."""
    return update.steps[0 if update.verdict == NOTHING else -1]


def _by_direction(update: Update) -> Markup:
    first, last = update.steps[0].by_direction, _result(update).by_direction
    rows = [
        (
            name,
            str(before["readings"]),
            percent(before["mean_abs_error_percent"], 2),
            percent(last[name]["mean_abs_error_percent"], 2),
            percent(last[name]["held_out_error_percent"], 2),
            f"{before['bias_percent']:+.1f} %",
            f"{last[name]['bias_percent']:+.1f} %",
        )
        for name, before in first.items()
    ]
    head = ("direction", "readings", "as given", "after", "after, left out", "bias as given", "bias after")
    remark = f"Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, [("", row) for row in rows], range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _length(end: LawEnd) -> str:
    """The strut length at which a stiffness of the law is meant."""
    return "at every length" if end.length_mm is None else f"at {end.length_mm:.1f} mm"


def _fitted(update: Update) -> Markup:
    step = _result(update)
    rows = [
        ("strut law", _length(end), f"{end.stiffness:.2f} N/um", f"sd {end.sd:.2g} N/um")
        for end in step.law_ends(update.task.machine.strut_law, update.widening)
        if end.sd is not None
    ]
    for effect, entry in step.sizes(update.widening).items():
        for key, value in entry.items():
            if isinstance(value, FittedSize):
                low, high = map(_value, value.interval)
                rows.append((effect, key, f"{_value(value.value)} {value.unit}", f"{low} to {high}"))
            else:
                rows.append((effect, key, str(value), "chosen"))
    return table(("effect", "parameter", "value", "95 % interval, or sd"), [("", row) for row in rows], (2, 3))


def _support(update: Update) -> Markup:
    rows = [
        (
            support.effect,
            "yes" if support.supported else "no",
            f"{support.gain_in_se:+.1f} se" if np.isfinite(support.gain_in_se) else "-",
            f"{number(support.likelihood_gain, 1)} (chance: {number(support.threshold, 1)})",
            "; ".join(support.reasons),
        )
        for support in (*update.supports, *update.turned_down)
    ]
    head = ("effect", "supported", "fall at left-out points", "gain in twice the log likelihood", "what is against it")
    return table(head, [("", row) for row in rows], (2, 3))


def _percent(share: float) -> str:
    return percent(percent_of(share), 2)


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def text(update: Update) -> str:
    """Ladder, errors by direction before and after, parameters, what was turned down."""
    document = update.document
    lines = [
        f"data     {counted(document['readings'], 'reading')} of {', '.join(map(plain, update.task.files))}, "
        f"machine {machine_text(document)}",
        fill(f"result   {update.verdict.upper()}. {plain(document['text'])}", WIDTH, subsequent_indent=" " * 9),
        "",
        *_ladder(update),
        "",
        *_direction_lines(update),
    ]
    if parameters := _parameters(update):
        lines += ["", *parameters]
    if update.turned_down:
        lines += ["", "tried and not added"]
        for support in update.turned_down:
            lines.append(fill(f"  {support.effect}: {'; '.join(support.reasons)}", WIDTH, subsequent_indent=" " * 4))
    lines += [""] + [f"warning: {plain(warning)}" for warning in document["warnings"]]
    lines += [f"note: {plain(note)}" for note in document["notes"]]
    return "\n".join(lines).rstrip()


def _ladder(update: Update) -> list[str]:
    width = max(len(step.name) for step in update.steps)
    lines = [f"{'':<{width}}  error %  left out %  gain/SE"]
    for step in update.document["steps"]:
        lines.append(
            f"{plain(step['name']):<{width}}  {step['mean_abs_error_percent']:>7.2f}  "
            f"{_figure(step['held_out_error_percent'], 10)}  {_figure(step.get('held_out_gain_in_se'), 7, 1)}"
        )
    floor = f"{'noise floor':<{width}}  {update.noise.floor_percent:>7.2f}"
    return [*lines, f"{floor}  ({plain(update.noise.origin)})"]


def _direction_lines(update: Update) -> list[str]:
    last = _result(update).by_direction
    return ["direction  readings  as given %  after %  left out %"] + [
        f"{name:<9}  {before['readings']:>8}  {before['mean_abs_error_percent']:>10.2f}  "
        f"{last[name]['mean_abs_error_percent']:>7.2f}  {_figure(last[name]['held_out_error_percent'], 10)}"
        for name, before in update.steps[0].by_direction.items()
    ]


def _parameters(update: Update) -> list[str]:
    step, lines = _result(update), []
    ends = step.law_ends(update.task.machine.strut_law, update.widening)
    if step.fit.law_free:
        law = " and ".join(f"{end.stiffness:.1f} +- {end.sd:.1f} N/um {_length(end)}" for end in ends)
        lines.append(f"strut law  {law}")
    for effect, entry in step.sizes(update.widening).items():
        for key, size in entry.items():
            if isinstance(size, FittedSize):  # what it acts on stands in the ladder
                low, high = map(_value, size.interval)
                lines.append(f"{effect}  {key} = {_value(size.value)}   95 %: {low} to {high}")
    return lines


def _figure(value: float | None, width: int, digits: int = 2) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:>{width}.{digits}f}"


def names(plots: bool = True, *, machine: bool = True, figure3: bool = False) -> tuple[str, ...]:
    """Names of the files that `files` makes; `figure3`: those of the paper's Figure 3 too."""
    data = ["update.json", "residuals.csv", *([MACHINE_FILE] if machine else []), *(["figure3.csv"] if figure3 else [])]
    shown = [*(["figure3.png"] if figure3 else []), "ladder.png", "before_after.png", "report.html"]
    return tuple(data + (shown if plots else []))


def files(update: Update, *, plots: bool = True, machine: bool = True) -> dict[str, Content]:
    """The document as JSON, one row a reading, the machine file, and with `plots` pictures and page."""
    contents: dict[str, Content] = {"update.json": update.to_json(), "residuals.csv": residuals_csv(update)}
    if machine and update.accepted:
        contents[MACHINE_FILE] = update.machine_text()
    if update.bars is not None:
        contents["figure3.csv"] = bar_curve_csv(update.bars)
    return contents | (_pictures(update) if plots else {})


def _pictures(update: Update) -> dict[str, Content]:
    first, last = update.steps[0], update.steps[-1]
    pictures: dict[str, bytes] = {} if update.bars is None else {"figure3.png": figure3_png(update.bars)}
    pictures["ladder.png"] = error_ladder_png(update)
    pictures["before_after.png"] = before_after_png(
        update.task.data.of_tip, first.residual, last.residual, last.title,
        update.document["steps"][-1]["held_out_error_percent"], 100.0 * update.refitted.error,
    )  # fmt: skip
    return {**pictures, "report.html": update_html(update, pictures)}
