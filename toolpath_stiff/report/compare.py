"""Views of a comparison with measurements: page, text, and residuals as a table."""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import Variable, directions, planes
from toolpath_stiff.comparison.summary import ComparisonSummary, GroupErrors
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.loops import loops_section, loops_text
from toolpath_stiff.report.pages import Section, page_of, readings_head
from toolpath_stiff.report.residuals import residual_rows
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, plain
from toolpath_stiff.units import n_per_mm_from_n_per_m

# Picture -> the question that it answers, and how to read it.
QUESTIONS = {
    "measured_modelled.png": (
        "How wrong is the model, biased or scattered?",
        "A cloud beside the line is a bias; as wide as its bars, scatter; one direction off alone points to a gauge, "
        "a table or a spindle.",
    ),
    "machine.png": (
        "Where does the model fail? Alike all around, or on one side?",
        "Three times the same around the axis: geometry or the law of all struts. One side only: one strut, one joint, "
        "the table, or a cable.",
    ),
    "variables.png": (
        "Which variable is missing?",
        "The strongest first; residuals.csv has all. A trend in one direction of load alone says more than one in all: "
        "compare with what every effect of the catalogue would do with tps diagnose.",
    ),
}

PAGE = "report.html"
LOAD_PATH_REMARK = (
    "Of the machine file, mean over the measured poses. A missing compliance must fit between the model and what was "
    "measured; a link that takes little cannot be the cause unless it is badly wrong."
)
MOST_FAR_OFF, MOST_NAMED = 20, 5  # readings far off, on the page and on the terminal
BIAS = f"mean of {DEVIATION}, {MINUS_IS_SOFTER}"


def page(comparison: Comparison, drawn: Mapping[str, bytes]) -> str:
    """The page, with the pictures in it."""
    summary = comparison.summary
    base, refit = summary.baseline, summary.baseline.strut_law_refitted
    findings = summary.findings
    mean = f"{base.mean_abs_error_percent:.2f} %"
    figures = [
        (mean, "mean |modelled - measured| / measured, as given"),
        *([(f"{refit.mean_abs_error_percent:.2f} %", "the same, strut law refitted")] if refit else []),
        (f"{base.bias_percent:+.1f} %", f"bias: {DEVIATION}, {MINUS_IS_SOFTER}"),
        (f"{base.rms_percent:.1f} %", "rms error"),
        (f"{_by_noise(base.scatter_rms_percent, '.1f')} %", "rms that scatter alone would leave"),
        (f"{_by_noise(base.explained_by_scatter_percent, '.0f')} %", "of the mean square is scatter"),
    ]
    headline = findings[0].text if findings else f"{mean} off in the mean as given, without a pattern"
    head = readings_head("compare", comparison.document, "Where does the model fail?", headline, figures)
    sections: list[Section] = [
        ("Findings", _findings(summary)),
        "measured_modelled.png",
        ("Errors by direction, plane and set-up", errors(summary, True), f"Machine file as given. Bias: {BIAS}."),
        "machine.png",
        ("Readings far off", far_off(summary, MOST_FAR_OFF)),
        loops_section(summary.loops),
        "variables.png",
        ("Checks without a model", _model_free(summary)),
        ("Which link takes what share of the compliance?", _load_path(comparison), LOAD_PATH_REMARK),
        ("How much readings scatter", _noise(summary)),
        ("Not tested", summary.not_tested),
        ("Assumptions", [*summary.assumptions, *summary.notes]),
    ]
    return page_of(head, sections, drawn, QUESTIONS)


def _by_noise(figures: Mapping[str, float], form: str) -> str:
    return " to ".join(f"{figure:{form}}" for figure in figures.values())


def _findings(summary: ComparisonSummary) -> ShownTable:
    rows = [
        (row.text, f"{row.statistic:+.1f}", f"{row.p_adjusted:.2g}", ", ".join(row.indistinguishable_from) or "-")
        for row in summary.findings
    ]
    kinds = ["finding"] * len(rows) if rows else ["out"]
    none = [("No pattern stands out from scatter", "-", "-", "-")]
    return ShownTable(("finding", ">t", ">p, corrected", "looks the same in these data"), rows or none, kinds)


def _load_path(comparison: Comparison) -> ShownTable:
    nm_per_N = 1e9 * np.array([*comparison.shares.values()])  # a row a link, a column an axis
    sums = nm_per_N.sum(axis=0)
    links = (zip(parts, sums, strict=True) for parts in nm_per_N)
    rows = [[f"{part:.1f} nm/N, {100.0 * part / whole:.0f} %" for part, whole in parts] for parts in links]
    rows.append([f"{whole:.1f} nm/N" for whole in sums])
    rows.append([_measured(comparison, axis, whole) for axis, whole in zip("XYZ", sums, strict=True)])
    names = (*comparison.shares, "the model in all", "measured")
    shown = [[name, *row] for name, row in zip(names, rows, strict=True)]
    return ShownTable(("link", ">along X", ">along Y", ">along Z"), shown)


def _measured(comparison: Comparison, axis: str, modelled: float) -> str:
    """Mean compliance along an axis at the readings along it, as far off the model's as these are."""
    rows = directions(comparison.data) == axis
    if not rows.any():
        return "-"
    ratio = np.mean(1.0 / comparison.data.stiffness[rows]) / np.mean(np.exp(-comparison.log_model[rows]))
    return f"{ratio * modelled:.1f} nm/N"


def groups(summary: ComparisonSummary, each: bool = False) -> list[tuple[str, GroupErrors]]:
    """All readings, and groups by direction, plane and set-up if there are several; planes need no title.

    With `each`, every plane direction by direction too.
    """
    rows: list[tuple[str, GroupErrors]] = [("all readings", summary.baseline)]
    levels: list[tuple[str, Mapping[str, GroupErrors]]] = [
        ("direction", summary.by_direction),
        ("", summary.by_plane),
        ("", summary.by_plane_and_direction if each else {}),
        ("set-up", summary.by_setup),
    ]
    for title, by in levels:
        if len(by) > 1:
            rows += [(f"{title} {plain(name) or '(none)'}".strip(), group) for name, group in by.items()]
    return rows


def errors(summary: ComparisonSummary, each: bool = False) -> ShownTable:
    """Table of errors by direction, plane and set-up, with those of scatter alone."""
    rows = [
        (
            name,
            group.readings,
            f"{group.mean_abs_error_percent:.2f} %",
            f"{group.bias_percent:+.1f} %",
            f"{group.rms_percent:.1f} %",
            *(f"{group.scatter_rms_percent[noise.name]:.1f} %" for noise in summary.noise),
        )
        for name, group in groups(summary, each)
    ]
    scatter = (f">scatter alone, {noise.name}" for noise in summary.noise)
    return ShownTable(("", ">readings", ">mean error", ">bias", ">rms", *scatter), rows)


def far_off(summary: ComparisonSummary, most: int) -> ShownTable:
    """Table of readings far off."""
    rows = [
        (
            f"{reading.file}:{reading.line}",
            reading.direction,
            reading.point,
            f"{reading.deviation_percent:+.0f} %",
            f"{reading.standard_deviations:+.1f}",
        )
        for reading in summary.outliers[:most]
    ]
    return ShownTable(("line", "direction", "point", ">with the findings taken out", ">standard deviations"), rows)


def _model_free(summary: ComparisonSummary) -> ShownTable:
    """Table of checks that need no stiffness model, and why others cannot be made."""
    checks, cannot = summary.model_free, summary.not_checked
    rows = [(check.check, check.text, f"{check.statistic:+.1f}", f"{check.p_adjusted:.2g}") for check in checks]
    rows += [(check, f"not checked: {reason}", "", "") for check, reason in cannot.items()]
    kinds = ["" if check.holds else "finding" for check in checks] + ["out"] * len(cannot)
    return ShownTable(("principle", "result", ">t", ">p, corrected"), rows, kinds)


def _noise(summary: ComparisonSummary) -> ShownTable:
    base = summary.baseline
    rows = [
        (
            noise.name,
            f"{noise.repeat_percent:.2g} %",
            f"{noise.clamping_percent:.2g} %",
            f"{noise.strut_spread_percent:.2g} %",
            f"{base.excess_scatter_percent[noise.name]:.2g} %",
            f"{base.probability[noise.name]:.2g}",
            noise.origin,
        )
        for noise in summary.noise
    ]
    head = (">reading", ">clamping", ">struts", ">beyond it, place to place", ">p of residuals this large", "origin")
    return ShownTable(("noise", *head), rows)


def text(comparison: Comparison) -> str:
    """Errors, findings, checks, line by line, and the commands to go on with."""
    summary = comparison.summary
    lines = [summary.text, "", f"machine file as given; bias: {BIAS}", *errors(summary).lines()]
    lines += ["", "findings"]
    if not summary.findings:
        lines.append("  none: no pattern stands out from scatter")
    lines += [f"  {plain(finding.text)} (p = {finding.p_adjusted:.2g})" for finding in summary.findings]
    for finding in summary.findings:
        if finding.indistinguishable_from:
            others = ", ".join(finding.indistinguishable_from)
            lines.append(f"  ({plain(finding.pattern)} looks the same here as: {plain(others)})")
    lines += [*loops_text(summary.loops), "", "checks without a model"]
    lines += [f"  {plain(check.text)}" for check in summary.model_free]
    lines += [f"  {check}: {reason}" for check, reason in summary.not_checked.items()]
    if summary.outliers:
        lines += ["", "readings far off", *far_off(summary, MOST_NAMED).lines(2)]
        if len(summary.outliers) > MOST_NAMED:
            lines.append(f"  and {len(summary.outliers) - MOST_NAMED} more, in compare.json")
    lines += ["", *(f"warning: {plain(text)}" for text in summary.warnings)]
    lines += [f"note: {plain(text)}" for text in summary.notes]
    shown = [line for i, line in enumerate(lines) if line or lines[i - 1 : i] != [""]]
    return "\n".join(["\n".join(shown).rstrip(), "", *summary.next])


def _with_unit(variable: Variable) -> str:
    """Heading with unit: "tilt_deg", unless the name includes the unit already."""
    suffix = variable.unit.replace("/", "_per_").replace("%", "percent")
    return variable.name if variable.name.endswith(suffix) else f"{variable.name}_{suffix}"


def residuals_csv(comparison: Comparison) -> str:
    """One row per reading: measured, modelled, deviation, scatter, and every variable tested against the residuals."""
    data = comparison.data
    further = [variable for variable in comparison.numbers if variable.name not in ("x", "y", "height", "order")]
    names = {"setup": data.setup, "clamp": data.clamp, "plane": planes(data), "direction": directions(data)}
    figures = {
        "measured_N_per_mm": (n_per_mm_from_n_per_m(data.stiffness), ".1f"),
        "modelled_N_per_mm": (n_per_mm_from_n_per_m(np.exp(comparison.log_model)), ".1f"),
        "deviation_percent": (deviation_percent(comparison.residual), ".3f"),
        "scatter_percent": (100.0 * comparison.scatter, ".3f"),
        **{_with_unit(variable): (variable.values, ".6g") for variable in further},
    }
    return residual_rows(data, names, figures)


DATA = {"compare.json": Comparison.to_json, "residuals.csv": residuals_csv}
