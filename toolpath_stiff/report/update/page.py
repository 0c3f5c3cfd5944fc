"""The results of an update: page, files and text."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from toolpath_stiff.correction.document import residuals_csv
from toolpath_stiff.correction.strut_law import bar_curve_csv
from toolpath_stiff.documents import Document
from toolpath_stiff.files import Content
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.report.pages import bullets, hint_list, markup, picture, readings_page, section, table
from toolpath_stiff.report.residuals import before_after_png
from toolpath_stiff.report.update.pictures import error_ladder_png, figure3_png
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, counted, machine_text, plain
from toolpath_stiff.units import number

if TYPE_CHECKING:
    from toolpath_stiff.correction.document import LawEntry, UpdateDocument
    from toolpath_stiff.correction.ladder import Update
    from toolpath_stiff.correction.strut_law import BarCurve
    from toolpath_stiff.machine.model import Machine


VERDICTS = {
    "updated": "The machine is updated",
    "refused": "Refused: the data do not support it",
    "forced": "Added by force",
    "nothing added": "Nothing to add",
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


def update_html(document: UpdateDocument, pictures: Mapping[str, bytes | str]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        Content of update.json.
    pictures
        File name -> PNG; they are put into the page.
    """
    provenance = document["provenance"]
    record = [
        f"command: {provenance['command']}",
        f"SHA-256 of the data: {provenance['data_sha256']}",
        f"machine file: {document['machine_file'] or 'none written'}",
    ]
    sections = [
        *(picture(name, pictures, QUESTIONS) for name in QUESTIONS),
        section("Errors by direction", _by_direction(document)),
        section("What was fitted", _fitted(document)),
        section("Do the data support it?", _support(document)),
        section("What to do next", hint_list(document.get("next") or [])),
        section("Where it comes from", bullets(record)),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    verdict = VERDICTS[document["verdict"]]
    return readings_page("Update", "update", document, verdict, _headline(document), _figures(document), sections)


def _headline(document: UpdateDocument) -> str:
    first, last = document["steps"][0], document["steps"][-1]
    if document["verdict"] == "nothing added":
        return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, and nothing to add"
    if last["findings"] and document["verdict"] in ("updated", "forced"):
        cause = "; ".join(last["findings"])
        return cause[0].upper() + cause[1:] + (" (described, not confirmed)" if document["described"] else "")
    return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, {last['mean_abs_error_percent']:.2f} % after"


def _figures(document: UpdateDocument) -> list[tuple[str, str]]:
    last = document["steps"][-1]
    found = [(_percent(document["steps"][0]["mean_abs_error_percent"]), "mean error as given")]
    if document["objective"] == "likelihood":
        found.append(
            (_percent(document["strut_law_refitted"]["mean_abs_error_percent"]), "mean error, strut law refitted")
        )
    if last["effects"] or document["objective"] != "likelihood":
        called = f"mean error with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
        found.append((_percent(last["mean_abs_error_percent"]), called))
    found.append((_percent(last["held_out_error_percent"]), "the same at left-out points"))
    found.append((_percent(document["noise_floor_percent"]), "would be left by scatter alone"))
    return found


def _by_direction(document: UpdateDocument) -> Markup:
    first, last = document["steps"][0]["by_direction"], result_step(document)["by_direction"]
    rows = [
        (
            name,
            str(before["readings"]),
            _percent(before["mean_abs_error_percent"]),
            _percent(last[name]["mean_abs_error_percent"]),
            _percent(last[name]["held_out_error_percent"]),
            f"{before['bias_percent']:+.1f} %",
            f"{last[name]['bias_percent']:+.1f} %",
        )
        for name, before in first.items()
    ]
    head = ("direction", "readings", "as given", "after", "after, left out", "bias as given", "bias after")
    remark = f"Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, [("", row) for row in rows], range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _where(end: LawEntry) -> str:
    """At which strut length a stiffness of the law is meant."""
    return "at every length" if end["length_mm"] is None else f"at {end['length_mm']:.1f} mm"


def _fitted(document: UpdateDocument) -> Markup:
    last = result_step(document)
    rows = [
        ("strut law", _where(end), f"{end['stiffness']:.2f} N/um", f"sd {end['sd']:.2g} N/um")
        for end in last["strut_law_N_per_um"]
        if end["sd"] is not None
    ]
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):
                low, high = (_value(end) for end in value["interval"])
                rows.append((effect, key, f"{_value(value['value'])} {value['unit']}", f"{low} to {high}"))
            else:
                rows.append((effect, key, str(value), "chosen"))
    return table(("effect", "parameter", "value", "95 % interval, or sd"), [("", row) for row in rows], (2, 3))


def _support(document: UpdateDocument) -> Markup:
    rows = []
    for one in (*document["support"], *document["rejected"]):
        gain = one["held_out_gain_in_se"]
        rows.append(
            (
                one["effect"],
                "yes" if one["supported"] else "no",
                "-" if gain is None else f"{gain:+.1f} se",
                f"{number(one['likelihood_gain'], 1)} (chance: {number(one['threshold'], 1)})",
                "; ".join(one["reasons"]),
            )
        )
    head = ("effect", "supported", "fall at left-out points", "gain in twice the log likelihood", "what is against it")
    return table(head, [("", row) for row in rows], (2, 3))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} %"


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


WIDTH = 110


MACHINE_FILE = "machine.toml"


def text(document: UpdateDocument) -> str:
    """Ladder, errors by direction before and after, parameters, what was turned down."""
    lines = [
        f"data     {counted(document['readings'], 'reading')} of {', '.join(map(plain, document['data']))}, "
        f"machine {machine_text(document)}",
        fill(f"result   {document['verdict'].upper()}. {plain(document['text'])}", WIDTH, subsequent_indent=" " * 9),
        "",
        *_ladder(document),
        "",
        *_direction_lines(document),
    ]
    parameters = _parameters(document)
    if parameters:
        lines += ["", *parameters]
    if document["rejected"]:
        lines += ["", "tried and not added"]
        for one in document["rejected"]:
            lines.append(fill(f"  {one['effect']}: {'; '.join(one['reasons'])}", WIDTH, subsequent_indent=" " * 4))
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    return "\n".join(lines).rstrip()


def _ladder(document: UpdateDocument) -> list[str]:
    steps = document["steps"]
    width = max(len(step["name"]) for step in steps)
    found = [f"{'':<{width}}  error %  left out %  gain/SE"]
    for step in steps:
        gain = step.get("held_out_gain_in_se")
        found.append(
            f"{plain(step['name']):<{width}}  {step['mean_abs_error_percent']:>7.2f}  "
            f"{_figure(step['held_out_error_percent'], 10)}  {_figure(gain, 7, 1)}"
        )
    found.append(
        f"{'noise floor':<{width}}  {document['noise_floor_percent']:>7.2f}  ({plain(document['noise']['origin'])})"
    )
    return found


def result_step(document: UpdateDocument) -> Document:
    """The model that comes out: the last step, the machine file as given where nothing is added."""
    return document["steps"][0 if document["verdict"] == "nothing added" else -1]


def _direction_lines(document: UpdateDocument) -> list[str]:
    first, last = document["steps"][0]["by_direction"], result_step(document)["by_direction"]
    found = ["direction  readings  as given %  after %  left out %"]
    for name, before in first.items():
        after = last[name]
        found.append(
            f"{name:<9}  {before['readings']:>8}  {before['mean_abs_error_percent']:>10.2f}  "
            f"{after['mean_abs_error_percent']:>7.2f}  {_figure(after['held_out_error_percent'], 10)}"
        )
    return found


def _parameters(document: UpdateDocument) -> list[str]:
    last = result_step(document)
    found = []
    if last["strut_law_N_per_um"][0]["sd"] is not None:
        ends = " and ".join(
            f"{end['stiffness']:.1f} +- {end['sd']:.1f} N/um {_where(end)}" for end in last["strut_law_N_per_um"]
        )
        found.append(f"strut law  {ends}")
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):  # what it acts on stands in the ladder
                low, high = (_plain_value(end) for end in value["interval"])
                found.append(f"{effect}  {key} = {_plain_value(value['value'])}   95 %: {low} to {high}")
    return found


def _plain_value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def _figure(value: float | None, width: int, digits: int = 2) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:>{width}.{digits}f}"


def names(plots: bool = True, *, machine: bool = True, figure3: bool = False) -> tuple[str, ...]:
    """Names of the files that `files` makes; `figure3`: those of the paper's Figure 3 too."""
    found = ["update.json", "residuals.csv"]
    found += [MACHINE_FILE] if machine else []
    found += ["figure3.csv"] if figure3 else []
    if plots:
        found += [*(["figure3.png"] if figure3 else []), "ladder.png", "before_after.png", "report.html"]
    return tuple(found)


def files(
    update: Update,
    document: UpdateDocument,
    *,
    machine: Machine | None = None,
    bars: BarCurve | None = None,
    plots: bool = True,
) -> dict[str, Content]:
    """`document` as JSON, one row a reading, and with `plots` pictures and page.

    `machine`: the updated one, as `machine.toml`; `bars`: the curve of the paper's Figure 3.
    """
    contents: dict[str, Content] = {
        "update.json": json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(update),
    }
    if machine is not None:
        contents[MACHINE_FILE] = machine_toml(machine, machine_heading(document))
    if bars is not None:
        contents["figure3.csv"] = bar_curve_csv(bars)
    return contents | (_pictures(document, update, bars) if plots else {})


def machine_heading(found: UpdateDocument) -> str:
    """The remark above the machine file that an update writes."""
    provenance = found["provenance"]
    return "\n".join(
        [
            fill(f"Machine {found['machine']}, updated. {found['text']}", 110),
            f"Command: {provenance['command']}",
            f"SHA-256 of the data: {provenance['data_sha256']}",
            "",
        ]
    )


def _pictures(found: UpdateDocument, update: Update, bars: BarCurve | None) -> dict[str, Content]:
    last = found["steps"][-1]
    called = f"with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
    drawn = before_after_png(
        update.data.of_tip, update.steps[0].residual, update.steps[-1].residual, called,
        last["held_out_error_percent"], found["strut_law_refitted"]["mean_abs_error_percent"],
    )  # fmt: skip
    pictures: dict[str, bytes] = {}
    if bars is not None:
        percent = 100.0 * bars.error[:-1], 100.0 * bars.error_refitted[:-1]
        pictures["figure3.png"] = figure3_png(bars.bars[:-1], percent[0], refitted_percent=percent[1])
    pictures |= {
        "ladder.png": error_ladder_png(*ladder(found)),
        "before_after.png": drawn,
    }
    return {**pictures, "report.html": update_html(found, pictures)}


def ladder(found: UpdateDocument) -> tuple[Any, ...]:
    """What `error_ladder_png` takes."""
    turned_down = [{**one, "name": one["effect"]} for one in found["rejected"]]
    floor, question = found["noise_floor_percent"], "What does each step do to the error?"
    return [_rung(step) for step in found["steps"]], floor, question, turned_down


def _rung(step: Document) -> dict[str, Any]:
    """A step with what its effect acts on below the effect's name."""
    choices = re.findall(r"\(([^)]*)\)", step["name"])
    return {**step, "name": re.sub(r" \([^)]*\)", "", step["name"]), "remark": ", ".join(choices)}
