"""An update as a page: what was added, how the error fell, why something was turned down. No network.

Everything from a file is escaped, and a content security policy lets the page load nothing and run nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from toolpath_stiff.report.sections import bullets, figures, hint_list, page, picture, section, text_table
from toolpath_stiff.report.update_text import result_step
from toolpath_stiff.report.wording import DEVIATION, MINUS_IS_SOFTER, machine_text, number

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


def update_html(document: Mapping[str, Any], pictures: Mapping[str, bytes | str]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        Content of update.json.
    pictures
        File name -> PNG; they are put into the page.
    """
    files = ", ".join(document["data"])
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
    return page(
        title=f"Update: {files}",
        verdict=VERDICTS[document["verdict"]],
        headline=_headline(document),
        text=document["text"],
        about=[f"{document['readings']} readings", files, f"machine {machine_text(document)}"],
        figures=_figures(document),
        warnings=document["warnings"],
        sections=sections,
        footer=f"tps update, seed {document['seed']}",
    )


def _headline(document: Mapping[str, Any]) -> str:
    first, last = document["steps"][0], document["steps"][-1]
    if document["verdict"] == "nothing added":
        return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, and nothing to add"
    if last["findings"] and document["verdict"] in ("updated", "forced"):
        cause = "; ".join(last["findings"])
        return cause[0].upper() + cause[1:]
    return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, {last['mean_abs_error_percent']:.2f} % after"


def _figures(document: Mapping[str, Any]) -> str:
    key, last = "mean_abs_error_percent", document["steps"][-1]
    found = [(_percent(document["steps"][0][key]), "mean error as given")]
    if document["objective"] == "likelihood":
        found.append((_percent(document["strut_law_refitted"][key]), "mean error, strut law refitted"))
    if last["effects"] or document["objective"] != "likelihood":
        called = f"mean error with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
        found.append((_percent(last[key]), called))
    found.append((_percent(last["held_out_error_percent"]), "the same at left-out points"))
    found.append((_percent(document["noise_floor_percent"]), "would be left by scatter alone"))
    return figures(found)


def _by_direction(document: Mapping[str, Any]) -> str:
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
    return text_table(head, [("", row) for row in rows], range(1, len(head))) + f'<p class="muted">{remark}</p>'


def _fitted(document: Mapping[str, Any]) -> str:
    last = result_step(document)
    rows = [
        ("strut law", f"at {end['length_mm']:.1f} mm", f"{end['stiffness']:.2f} N/um", f"sd {end['sd']:.2g} N/um")
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
    return text_table(("effect", "parameter", "value", "95 % interval, or sd"), [("", row) for row in rows], (2, 3))


def _support(document: Mapping[str, Any]) -> str:
    rows = []
    for one in (*document["support"], *document["turned_down"]):
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
    return text_table(head, [("", row) for row in rows], (2, 3))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} %"


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"
