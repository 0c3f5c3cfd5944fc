"""The results of a comparison with measurements: page, files and text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import directions, planes
from toolpath_stiff.files import Content
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.compare.machine import machine_png
from toolpath_stiff.report.compare.pictures import measured_modelled_png, planes_png, strips_png
from toolpath_stiff.report.compare.variables import load_path_png, variables_png
from toolpath_stiff.report.history import history_section, history_text
from toolpath_stiff.report.loops import loops_section, loops_text
from toolpath_stiff.report.pages import bullets, markup, picture, readings_page, section, table
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.comparison.document import ComparisonDocument, Figures


# Picture -> the question that it answers, and how it is read.
QUESTIONS = {
    "measured_modelled.png": (
        "How wrong is the model, biased or scattered?",
        "A cloud beside the line is a bias; as wide as its bars, scatter; one direction off alone points to a gauge, "
        "a table or a spindle.",
    ),
    "planes.png": (
        "Z against X and Y? Upper against lower plane?",
        "Standard errors hold the scatter of readings, clampings and struts, and what scatters more than these from "
        "place to place. They are taken one by one; the findings above are corrected for looking at many places.",
    ),
    "machine.png": (
        "Where does the model fail? Alike all around, or on one side?",
        "Three times the same around the axis: geometry or the law of all struts. One side only: one strut, one joint, "
        "the table, or a cable.",
    ),
    "strips.png": (
        "Drift, a bad clamping, one bad reading?",
        "A slope is drift, a step is a clamping, a lone bar is a reading to take again.",
    ),
    "variables.png": (
        "Which variable is missing?",
        "The strongest first. A trend in one direction of load alone says more than one in all: compare with what "
        "every effect of the catalogue would do with tps diagnose.",
    ),
    "load_path.png": (
        "Which link takes what share of the compliance?",
        "A missing compliance must fit between the model's bar and the measured one; a link that takes little "
        "cannot be the cause unless it is badly wrong.",
    ),
}


MOST_ROWS = 40  # of patterns; all are in compare.json


MOST_FAR_OFF = 20


def compare_pictures(found: Comparison) -> dict[str, bytes]:
    """All pictures, by file name."""
    return {
        "measured_modelled.png": measured_modelled_png(found),
        "planes.png": planes_png(found),
        "machine.png": machine_png(found),
        "strips.png": strips_png(found),
        "variables.png": variables_png(found),
        "load_path.png": load_path_png(found),
    }


def compare_html(found: Comparison, pictures: Mapping[str, bytes]) -> str:
    """The page's text, the pictures within."""
    document = found.document
    sections = [
        section("Findings" if document["findings"] else "No pattern stands out from scatter", _findings(document)),
        picture("measured_modelled.png", pictures, QUESTIONS),
        section("Errors by direction, plane and set-up", _errors(document)),
        picture("planes.png", pictures, QUESTIONS),
        picture("machine.png", pictures, QUESTIONS),
        picture("strips.png", pictures, QUESTIONS),
        section("Readings far off", _far_off(document)),
        *loops_section(document["loops"]),
        *history_section(document["history"]),
        picture("variables.png", pictures, QUESTIONS),
        section("Checks without a model", _model_free(document)),
        picture("load_path.png", pictures, QUESTIONS),
        section("All patterns looked for", _tests(document)),
        section("How much readings scatter", _noise(document)),
        section("Not tested", bullets(document["not_tested"])),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    question = "Where does the model fail?"
    return readings_page("Comparison", "compare", document, question, _headline(document), _figures(document), sections)


def _headline(document: ComparisonDocument) -> str:
    """The strongest finding, or that there is none."""
    if document["findings"]:
        return str(document["findings"][0]["text"])
    return f"{document['baseline']['mean_abs_error_percent']:.2f} % off in the mean as given, without a pattern"


def _figures(document: ComparisonDocument) -> list[tuple[str, str]]:
    """The few figures that say it all."""
    base, noise = document["baseline"], document["noise"]
    refit = base["strut_law_refitted"]
    scatter = " to ".join(f"{base['scatter_rms_percent'][one['name']]:.1f}" for one in noise)
    share = " to ".join(f"{base['explained_by_scatter_percent'][one['name']]:.0f}" for one in noise)
    return [
        (f"{base['mean_abs_error_percent']:.2f} %", "mean |modelled - measured| / measured, as given"),
        *([(f"{refit['mean_abs_error_percent']:.2f} %", "the same, strut law refitted")] if refit else []),
        (f"{base['bias_percent']:+.1f} %", f"bias: {DEVIATION}, {MINUS_IS_SOFTER}"),
        (f"{base['rms_percent']:.1f} %", "rms error"),
        (f"{scatter} %", "rms that scatter alone would leave"),
        (f"{share} %", "of the mean square is scatter"),
    ]


def _findings(document: ComparisonDocument) -> Markup:
    """Findings with their probabilities, or the strongest hints."""
    if not document["findings"]:
        hints = [("out", (*_said(one), _alike(one))) for one in document["hints"]]
        return table(("the strongest hints", "t", "p, corrected", "looks the same in these data"), hints, (1, 2))
    rows = []
    for one in document["findings"]:
        after = one.get("after_strut_law_refit")
        rows.append(("finding", (*_said(one), f"{after['p_adjusted']:.2g}" if after else "-", _alike(one))))
    head = ("finding", "t", "p, corrected", "p if the strut law is refitted", "looks the same in these data")
    return table(head, rows, range(1, 4))


def _said(one: Mapping[str, Any]) -> tuple[str, str, str]:
    return one["text"], f"{one['statistic']:+.1f}", f"{one['p_adjusted']:.2g}"


def _alike(one: Mapping[str, Any]) -> str:
    return ", ".join(one["indistinguishable_from"]) or "-"


def _groups(document: ComparisonDocument) -> list[tuple[str, Mapping[str, Figures]]]:
    """Readings by direction, plane and set-up; planes have a name that needs no title."""
    return [("direction", document["by_direction"]), ("", document["by_plane"]), ("set-up", document["by_setup"])]


def _errors(document: ComparisonDocument) -> Markup:
    """Errors by direction, plane and set-up, beside those of scatter alone."""
    levels: list[tuple[str, Figures]] = [("all readings", document["baseline"])]
    for title, by in _groups(document):
        if len(by) > 1:
            levels += [(f"{title} {name or '(none)'}".strip(), figures) for name, figures in by.items()]
    names = [one["name"] for one in document["noise"]]
    rows = [
        (
            "",
            (
                name,
                str(one["readings"]),
                f"{one['mean_abs_error_percent']:.2f} %",
                f"{one['bias_percent']:+.1f} %",
                f"{one['rms_percent']:.1f} %",
                *(f"{one['scatter_rms_percent'][noise]:.1f} %" for noise in names),
            ),
        )
        for name, one in levels
    ]
    head = ["", "readings", "mean error", "bias", "rms", *(f"rms of scatter alone ({name})" for name in names)]
    remark = f"Machine file as given. Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, rows, range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _far_off(document: ComparisonDocument) -> Markup:
    rows = [
        (
            "",
            (
                f"{one['file']}:{one['line']}",
                one["direction"],
                one["point"],
                f"{one['deviation_percent']:+.0f} %",
                f"{one['standard_deviations']:+.1f}",
            ),
        )
        for one in document["outliers"][:MOST_FAR_OFF]
    ]
    head = ("line", "direction", "point", "with the findings taken out", "standard deviations")
    return table(head, rows, (3, 4))


def _model_free(document: ComparisonDocument) -> Markup:
    """Checks that need no stiffness model, and why others cannot be made."""
    found = document["model_free"]
    rows = [
        (
            "" if one["holds"] else "finding",
            (one["check"], one["text"], f"{one['statistic']:+.1f}", f"{one['p_adjusted']:.2g}"),
        )
        for one in found["checks"]
    ]
    rows += [("out", (one["check"], f"not checked: {one['reason']}", "", "")) for one in found["cannot_check"]]
    return table(("principle", "result", "t", "p, corrected"), rows, (2, 3))


def _tests(document: ComparisonDocument) -> Markup:
    """The strongest patterns, each on its own."""
    tests = document["tests"]
    rows = [
        (
            "",
            (
                one["pattern"],
                one["kind"],
                str(one["readings"]),
                f"{one['statistic']:+.1f}",
                f"{one['p_adjusted']:.2g}",
            ),
        )
        for one in tests[:MOST_ROWS]
    ]
    listed = table(("pattern", "kind", "readings", "t", "p, corrected"), rows, (2, 3, 4))
    if not listed:
        return Markup()
    remark = f"{len(tests)} patterns were looked for, each on its own here"
    remark += f"; the strongest {MOST_ROWS} are shown, all are in compare.json." if len(tests) > MOST_ROWS else "."
    return markup("<details><summary>{}</summary>{}</details>", remark, listed)


def _noise(document: ComparisonDocument) -> Markup:
    base = document["baseline"]
    rows = [
        (
            "",
            (
                one["name"],
                f"{one['repeat_percent']:.2g} %",
                f"{one['clamping_percent']:.2g} %",
                f"{one['strut_spread_percent']:.2g} %",
                f"{base['excess_scatter_percent'][one['name']]:.2g} %",
                f"{base['probability'][one['name']]:.2g}",
                one["origin"],
            ),
        )
        for one in document["noise"]
    ]
    head = ("noise", "reading", "clamping", "struts", "beyond it, place to place", "p of residuals this large",
            "origin")  # fmt: skip
    return table(head, rows, range(1, 6))


MOST_NAMED = 5  # readings far off, on the terminal


def text(found: Comparison) -> str:
    """Errors, findings, checks, in lines, and the commands that go on from here."""
    document = found.document
    lines = [document["text"], ""]
    lines += _table(document)
    base, refit = document["baseline"], document["baseline"]["strut_law_refitted"]
    if refit:
        gain = round(base["mean_abs_error_percent"] - refit["mean_abs_error_percent"], 2)
        law = " / ".join(f"{stiffness:.1f}" for stiffness in refit["strut_law"]["N_per_um"])
        lines += [
            "",
            f"strut law refitted: {refit['mean_abs_error_percent']:.2f} % mean error, "
            f"{refit['bias_percent']:+.1f} % bias, rms {refit['rms_percent']:.1f} % "
            f"({law} N/um)" + ("" if gain > 0.0 else ": nothing gained"),
        ]
    lines += ["", "findings"]
    lines += [f"  {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["findings"]]
    if not document["findings"]:
        lines.append("  none: no pattern stands out from scatter. The strongest hints:")
        lines += [f"  - {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["hints"]]
    for one in document["findings"]:
        if one["indistinguishable_from"]:
            others = ", ".join(one["indistinguishable_from"])
            lines.append(f"  ({plain(one['pattern'])} looks the same here as: {plain(others)})")
    lines += loops_text(document["loops"])
    lines += history_text(document["history"])
    lines += ["", "checks without a model"]
    lines += [f"  {plain(one['text'])}" for one in document["model_free"]["checks"]]
    lines += [f"  {one['check']}: {one['reason']}" for one in document["model_free"]["cannot_check"]]
    if document["outliers"]:
        lines += ["", "readings far off"]
        lines += [
            f"  {plain(one['file'])}:{one['line']}: {one['direction']} at point {plain(one['point'])}, "
            f"{one['deviation_percent']:+.0f} % with the findings taken out "
            f"({one['standard_deviations']:+.1f} standard deviations)"
            for one in document["outliers"][:MOST_NAMED]
        ]
        if len(document["outliers"]) > MOST_NAMED:
            lines.append(f"  and {len(document['outliers']) - MOST_NAMED} more, in compare.json")
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    shown = [line for i, line in enumerate(lines) if line or lines[i - 1 : i] != [""]]
    return "\n".join(["\n".join(shown).rstrip(), "", *document["next"]])


def _table(document: ComparisonDocument) -> list[str]:
    """Errors by direction, plane and set-up."""
    rows: list[tuple[str, Figures]] = [("all readings", document["baseline"])]
    for title, levels in _groups(document):
        if len(levels) > 1:
            rows += [(f"{title} {plain(name) or '(none)'}".strip(), figures) for name, figures in levels.items()]
    noise = document["noise"][-1]["name"]
    width = max(len(name) for name, _ in rows)
    head = f"{'':<{width}}  readings  mean error   bias    rms  scatter alone"
    lines = ["machine file as given; bias: mean of " + f"{DEVIATION}, {MINUS_IS_SOFTER}", head]
    return lines + [
        f"{name:<{width}}  {one['readings']:>8}  {one['mean_abs_error_percent']:>8.2f} % {one['bias_percent']:>+6.1f} "
        f"{one['rms_percent']:>6.1f}  {one['scatter_rms_percent'][noise]:>9.1f} rms"
        for name, one in rows
    ]


def _with_unit(name: str, unit: str) -> str:
    """A heading: "tilt_deg", unless the name says the unit already."""
    suffix = unit.replace("/", "_per_").replace("%", "percent")
    return name if name.endswith(suffix) else f"{name}_{suffix}"


def residuals_csv(found: Comparison) -> str:
    """One row a reading: measured, modelled, deviation, scatter, every variable that residuals were held against."""
    data = found.data
    own = [one for one in found.numbers if one.name not in ("x", "y", "height", "order")]
    head = [
        "file", "line", "point", "setup", "clamp", "plane", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg",
        "c_deg", "dx", "dy", "dz", "measured_N_per_mm", "modelled_N_per_mm", "deviation_percent", "scatter_percent",
        *(_with_unit(one.name, one.unit) for one in own),
    ]  # fmt: skip
    along, where = directions(data), planes(data)
    rows = []
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = float(n_per_mm_from_n_per_m(np.exp(found.log_model[i])))
        rows.append(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], data.clamp[i], where[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose),
                f"{measured:.1f}", f"{modelled:.1f}", f"{float(deviation_percent(found.residual[i])):.3f}",
                f"{100.0 * found.scatter[i]:.3f}",
                *("" if np.isnan(one.values[i]) else f"{one.values[i]:.6g}" for one in own),
            ]
        )  # fmt: skip
    return csv_text(head, rows)


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("compare.json", "residuals.csv")
    pictures = ("measured_modelled.png", "strips.png", "planes.png", "machine.png", "variables.png", "load_path.png")
    return (*data, "report.html", *pictures) if plots else data


def files(found: Comparison, *, plots: bool = True) -> dict[str, Content]:
    """Everything as JSON, one row a reading, and with `plots` pictures and page."""
    contents: dict[str, Content] = {
        "compare.json": found.to_json(),
        "residuals.csv": residuals_csv(found),
    }
    if plots:
        pictures = compare_pictures(found)
        contents |= {**pictures, "report.html": compare_html(found, pictures)}
    return contents
