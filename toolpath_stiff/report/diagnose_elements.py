"""A diagnosis of a machine of elements in words, and its files."""

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.diagnosis.on_elements import NRAD, ElementDiagnosis
from toolpath_stiff.report.tables import ShownTable

MOST = 8  # explanations on the terminal


def text(result: ElementDiagnosis) -> str:
    """Verdict, errors, the likeliest explanations, the joints fitted alone."""
    count, poses = len(result.pulls), int(result.pulls.pose.max()) + 1
    lines = [
        f"{result.model.machine.title}: {result.verdict}",
        f"{count} readings at {poses} poses; noise: {result.noise}",
        f"error as given {result.error_percent(result.model.predicted):.1f} % of the displacements (rms), chi-square "
        f"{result.chi_square:.0f} of {count} readings",
        *(f"  {result.words(row)}" for row in result.plausible),
    ]
    rows = [(row.label, f"{row.chi_square:.0f}", result.words(row)) for row in result.ranked[:MOST]]
    lines += ["", *ShownTable(("effect, fitted alone", ">chi-square", "finding"), rows).lines()]
    if result.joints:
        values = ", ".join(f"{name} {NRAD * c:.0f}" for name, c in zip(result.joints, result.torsion, strict=True))
        lines += ["", f"torsion of the joints fitted in place of the file's, nrad/(N m): {values}"]
        lines.append(f"error of these at poses left out of the fit {result.error_percent(result.said):.1f} %")
    return "\n".join(lines)


def residuals_csv(result: ElementDiagnosis) -> str:
    """`residuals.csv`: one row a reading."""
    columns = result.columns()
    return csv_text(list(columns), zip(*(list(column) for column in columns.values()), strict=True))


def fitted_toml(result: ElementDiagnosis) -> str:
    """`fitted.toml`: the machine file with the fitted torsions, or why there is none."""
    return (
        result.fitted_text or "# Not written: the torsions fitted predict left-out poses no better than the file's.\n"
    )


DATA = {"diagnose.json": ElementDiagnosis.to_json, "residuals.csv": residuals_csv, "fitted.toml": fitted_toml}
