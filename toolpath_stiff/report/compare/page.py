"""The results of a comparison with measurements: page, files and text."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import Variable, directions, planes
from toolpath_stiff.comparison.summary import ComparisonSummary, GroupErrors
from toolpath_stiff.files import Content
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.compare.load_path import load_path_png
from toolpath_stiff.report.compare.machine import machine_png
from toolpath_stiff.report.compare.pictures import measured_modelled_png, planes_png, strips_png
from toolpath_stiff.report.compare.variables import variables_png
from toolpath_stiff.report.history import history_section, history_text
from toolpath_stiff.report.loops import loops_section, loops_text
from toolpath_stiff.report.pages import bullets, markup, picture, readings_page, section, table
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

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


PICTURES = {
    "measured_modelled.png": measured_modelled_png,
    "planes.png": planes_png,
    "machine.png": machine_png,
    "strips.png": strips_png,
    "variables.png": variables_png,
    "load_path.png": load_path_png,
}


def compare_html(comparison: Comparison, pictures: Mapping[str, bytes]) -> str:
    """The page's text, the pictures within."""
    summary = comparison.summary
    base, refit = summary.baseline, summary.baseline.strut_law_refitted
    findings = summary.findings
    sections = [
        section("Findings", _findings(summary)),
        picture("measured_modelled.png", pictures, QUESTIONS),
        section("Errors by direction, plane and set-up", _errors(summary)),
        *(picture(f"{name}.png", pictures, QUESTIONS) for name in ("planes", "machine", "strips")),
        section("Readings far off", _far_off(summary)),
        *loops_section(summary.loops),
        *history_section(summary.history),
        picture("variables.png", pictures, QUESTIONS),
        section("Checks without a model", _model_free(summary)),
        picture("load_path.png", pictures, QUESTIONS),
        section("All patterns looked for", _tests(summary)),
        section("How much readings scatter", _noise(summary)),
        section("Not tested", bullets(summary.not_tested)),
        section("Assumptions", bullets([*summary.assumptions, *summary.notes])),
    ]
    mean = f"{base.mean_abs_error_percent:.2f} %"
    headline = findings[0].text if findings else f"{mean} off in the mean as given, without a pattern"
    figures = [
        (mean, "mean |modelled - measured| / measured, as given"),
        *([(f"{refit.mean_abs_error_percent:.2f} %", "the same, strut law refitted")] if refit else []),
        (f"{base.bias_percent:+.1f} %", f"bias: {DEVIATION}, {MINUS_IS_SOFTER}"),
        (f"{base.rms_percent:.1f} %", "rms error"),
        (f"{_by_noise(base.scatter_rms_percent, '.1f')} %", "rms that scatter alone would leave"),
        (f"{_by_noise(base.explained_by_scatter_percent, '.0f')} %", "of the mean square is scatter"),
    ]
    question = "Where does the model fail?"
    return readings_page("Comparison", "compare", comparison.document, question, headline, figures, sections)


def _by_noise(figures: Mapping[str, float], form: str) -> str:
    return " to ".join(f"{figure:{form}}" for figure in figures.values())


def _findings(summary: ComparisonSummary) -> Markup:
    """Findings with their probabilities."""
    if not summary.findings:
        return markup("<p>{}</p>", "No pattern stands out from scatter.")
    rows = []
    for finding in summary.findings:
        alike = ", ".join(finding.indistinguishable_from) or "-"
        rows.append(("finding", [finding.text, f"{finding.statistic:+.1f}", f"{finding.p_adjusted:.2g}", alike]))
    return table(("finding", "t", "p, corrected", "looks the same in these data"), rows, (1, 2))


def groups(summary: ComparisonSummary) -> list[tuple[str, GroupErrors]]:
    """All readings, and those by direction, plane and set-up where there are several; planes need no title."""
    rows: list[tuple[str, GroupErrors]] = [("all readings", summary.baseline)]
    levels: list[tuple[str, Mapping[str, GroupErrors]]] = [
        ("direction", summary.by_direction),
        ("", summary.by_plane),
        ("set-up", summary.by_setup),
    ]
    for title, by in levels:
        if len(by) > 1:
            rows += [(f"{title} {plain(name) or '(none)'}".strip(), errors) for name, errors in by.items()]
    return rows


def _errors(summary: ComparisonSummary) -> Markup:
    """Errors by direction, plane and set-up, beside those of scatter alone."""
    rows = [
        (
            "",
            [
                name,
                str(errors.readings),
                f"{errors.mean_abs_error_percent:.2f} %",
                f"{errors.bias_percent:+.1f} %",
                f"{errors.rms_percent:.1f} %",
                *(f"{errors.scatter_rms_percent[noise.name]:.1f} %" for noise in summary.noise),
            ],
        )
        for name, errors in groups(summary)
    ]
    scatter = (f"rms of scatter alone ({noise.name})" for noise in summary.noise)
    head = ["", "readings", "mean error", "bias", "rms", *scatter]
    remark = f"Machine file as given. Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, rows, range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _far_off(summary: ComparisonSummary) -> Markup:
    rows = [
        (
            "",
            [
                f"{reading.file}:{reading.line}",
                reading.direction,
                reading.point,
                f"{reading.deviation_percent:+.0f} %",
                f"{reading.standard_deviations:+.1f}",
            ],
        )
        for reading in summary.outliers[:MOST_FAR_OFF]
    ]
    head = ("line", "direction", "point", "with the findings taken out", "standard deviations")
    return table(head, rows, (3, 4))


def _model_free(summary: ComparisonSummary) -> Markup:
    """Checks that need no stiffness model, and why others cannot be made."""
    rows = [
        (
            "" if check.holds else "finding",
            [check.check, check.text, f"{check.statistic:+.1f}", f"{check.p_adjusted:.2g}"],
        )
        for check in summary.model_free.checks
    ]
    cannot = summary.model_free.cannot_check
    rows += [("out", [check.check, f"not checked: {check.reason}", "", ""]) for check in cannot]
    return table(("principle", "result", "t", "p, corrected"), rows, (2, 3))


def _tests(summary: ComparisonSummary) -> Markup:
    """The strongest patterns, each on its own."""
    count = len(summary.tests)
    rows = [
        ("", [test.pattern, test.kind, str(test.readings), f"{test.statistic:+.1f}", f"{test.p_adjusted:.2g}"])
        for test in summary.tests[:MOST_ROWS]
    ]
    if not rows:
        return Markup()
    remark = f"{count} patterns were looked for, each on its own here"
    remark += f"; the strongest {MOST_ROWS} are shown, all are in compare.json." if count > MOST_ROWS else "."
    listed = table(("pattern", "kind", "readings", "t", "p, corrected"), rows, (2, 3, 4))
    return markup("<details><summary>{}</summary>{}</details>", remark, listed)


def _noise(summary: ComparisonSummary) -> Markup:
    base = summary.baseline
    rows = [
        (
            "",
            [
                noise.name,
                f"{noise.repeat_percent:.2g} %",
                f"{noise.clamping_percent:.2g} %",
                f"{noise.strut_spread_percent:.2g} %",
                f"{base.excess_scatter_percent[noise.name]:.2g} %",
                f"{base.probability[noise.name]:.2g}",
                noise.origin,
            ],
        )
        for noise in summary.noise
    ]
    head = ("noise", "reading", "clamping", "struts", "beyond it, place to place", "p of residuals this large",
            "origin")  # fmt: skip
    return table(head, rows, range(1, 6))


MOST_NAMED = 5  # readings far off, on the terminal


def text(comparison: Comparison) -> str:
    """Errors, findings, checks, in lines, and the commands that go on from here."""
    summary = comparison.summary
    lines = [summary.text, "", *_table(summary), *_refitted(summary), "", "findings"]
    lines += [f"  {plain(hint.text)} (p = {hint.p_adjusted:.2g})" for hint in summary.findings]
    if not summary.findings:
        lines.append("  none: no pattern stands out from scatter")
    for hint in summary.findings:
        if hint.indistinguishable_from:
            others = ", ".join(hint.indistinguishable_from)
            lines.append(f"  ({plain(hint.pattern)} looks the same here as: {plain(others)})")
    lines += [*loops_text(summary.loops), *history_text(summary.history), "", "checks without a model"]
    lines += [f"  {plain(check.text)}" for check in summary.model_free.checks]
    lines += [f"  {check.check}: {check.reason}" for check in summary.model_free.cannot_check]
    if summary.outliers:
        lines += ["", "readings far off"]
        lines += [
            f"  {plain(reading.file)}:{reading.line}: {reading.direction} at point {plain(reading.point)}, "
            f"{reading.deviation_percent:+.0f} % with the findings taken out "
            f"({reading.standard_deviations:+.1f} standard deviations)"
            for reading in summary.outliers[:MOST_NAMED]
        ]
        if len(summary.outliers) > MOST_NAMED:
            lines.append(f"  and {len(summary.outliers) - MOST_NAMED} more, in compare.json")
    lines += ["", *(f"warning: {plain(text)}" for text in summary.warnings)]
    lines += [f"note: {plain(text)}" for text in summary.notes]
    shown = [line for i, line in enumerate(lines) if line or lines[i - 1 : i] != [""]]
    return "\n".join(["\n".join(shown).rstrip(), "", *summary.next])


def _refitted(summary: ComparisonSummary) -> list[str]:
    """What refitting the strut law leaves."""
    base, refit = summary.baseline, summary.baseline.strut_law_refitted
    if refit is None:
        return []
    gain = round(base.mean_abs_error_percent - refit.mean_abs_error_percent, 2)
    law = " / ".join(f"{stiffness:.1f}" for stiffness in refit.N_per_um)
    return [
        "",
        f"strut law refitted: {refit.mean_abs_error_percent:.2f} % mean error, {refit.bias_percent:+.1f} % bias, rms "
        f"{refit.rms_percent:.1f} % ({law} N/um)" + ("" if gain > 0.0 else ": nothing gained"),
    ]


def _table(summary: ComparisonSummary) -> list[str]:
    """Errors by direction, plane and set-up."""
    rows, noise = groups(summary), summary.noise[-1].name
    width = max(len(name) for name, _ in rows)
    return [
        f"machine file as given; bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}",
        f"{'':<{width}}  readings  mean error   bias    rms  scatter alone",
        *(
            f"{name:<{width}}  {errors.readings:>8}  {errors.mean_abs_error_percent:>8.2f} % "
            f"{errors.bias_percent:>+6.1f} {errors.rms_percent:>6.1f}  {errors.scatter_rms_percent[noise]:>9.1f} rms"
            for name, errors in rows
        ),
    ]


def _with_unit(variable: Variable) -> str:
    """A heading: "tilt_deg", unless the name says the unit already."""
    suffix = variable.unit.replace("/", "_per_").replace("%", "percent")
    return variable.name if variable.name.endswith(suffix) else f"{variable.name}_{suffix}"


def residuals_csv(comparison: Comparison) -> str:
    """One row a reading: measured, modelled, deviation, scatter, every variable that residuals were held against."""
    data = comparison.data
    further = [variable for variable in comparison.numbers if variable.name not in ("x", "y", "height", "order")]
    head = [
        "file", "line", "point", "setup", "clamp", "plane", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg",
        "c_deg", "dx", "dy", "dz", "measured_N_per_mm", "modelled_N_per_mm", "deviation_percent", "scatter_percent",
        *map(_with_unit, further),
    ]  # fmt: skip
    along, where = directions(data), planes(data)
    rows = []
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = float(n_per_mm_from_n_per_m(np.exp(comparison.log_model[i])))
        rows.append(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], data.clamp[i], where[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose),
                f"{measured:.1f}", f"{modelled:.1f}", f"{float(deviation_percent(comparison.residual[i])):.3f}",
                f"{100.0 * comparison.scatter[i]:.3f}",
                *("" if np.isnan(variable.values[i]) else f"{variable.values[i]:.6g}" for variable in further),
            ]
        )  # fmt: skip
    return csv_text(head, rows)


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("compare.json", "residuals.csv")
    return (*data, "report.html", *PICTURES) if plots else data


def files(comparison: Comparison, *, plots: bool = True) -> dict[str, Content]:
    """Everything as JSON, one row a reading, and with `plots` pictures and page."""
    contents: dict[str, Content] = {
        "compare.json": comparison.to_json(),
        "residuals.csv": residuals_csv(comparison),
    }
    if plots:
        pictures = {name: draw(comparison) for name, draw in PICTURES.items()}
        contents |= {**pictures, "report.html": compare_html(comparison, pictures)}
    return contents
