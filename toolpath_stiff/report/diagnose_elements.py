"""A diagnosis of a machine of elements in words, and its files."""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.correction.on_elements import ElementUpdate
from toolpath_stiff.diagnosis.on_elements import NRAD, ElementDiagnosis
from toolpath_stiff.inference.element_fits import chi_square, label_of, question
from toolpath_stiff.report.tables import ShownTable

MOST = 8  # explanations on the terminal
COLUMNS = {"measured_rms_um": "measured rms", "error_rms_um": "error rms", "error_mean_um": "mean error"}


def text(result: ElementDiagnosis) -> str:
    """Verdict, errors, the likeliest explanations, the joints fitted alone."""
    problem, count, poses = result.problem, len(result.pulls), int(result.pulls.pose.max()) + 1
    lines = [
        f"{problem.machine.title}: {count} readings at {poses} poses; noise: {problem.noise.origin}",
        result.sentence,
        *filter(None, [question(problem)]),
        *([f"taken for wild, and not counted: {', '.join(result.wild)}"] if result.wild else []),
    ]
    parts = [(row["component"], *(f"{row[key]:.1f}" for key in COLUMNS)) for row in result.components]
    lines += ["", *ShownTable(("um, as given", *(f">{name}" for name in COLUMNS.values())), parts).lines()]
    rows = [(label_of(fit), f"{chi_square(fit):.0f}", "; ".join(fit.findings)) for fit in result.ranked[:MOST]]
    rows.insert(0, ("none", f"{chi_square(problem.none):.0f}", ""))
    lines += ["", *ShownTable(("effect, fitted alone", ">chi-square", "finding"), rows).lines()]
    if result.joints is not None and np.isfinite(result.left_out).all():
        values = ", ".join(f"{name} {NRAD * value:.0f}" for name, value in result.torsions.items())
        lines += ["", f"torsion of the joints fitted in place of the file's, nrad/(N m): {values}"]
        lines.append(
            f"error of these at poses left out of the fit {result.counted(result.left_out):.1f} %; they leave "
            f"chi-square {chi_square(result.joints):.0f} of {count} readings"
        )
    return "\n".join([*lines, *(f"note: {note}" for note in result.pulls.notes)])


def residuals_csv(result: ElementDiagnosis | ElementUpdate) -> str:
    """`residuals.csv`: one row per reading."""
    return _csv(result.columns())


def _csv(columns: Mapping[str, AnyArray]) -> str:
    return csv_text(list(columns), zip(*(list(column) for column in columns.values()), strict=True))


DATA = {
    "diagnose.json": ElementDiagnosis.to_json,
    "residuals.csv": residuals_csv,
    "vectors.csv": lambda result: _csv(result.vectors()),
}
