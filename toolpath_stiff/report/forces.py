"""Coefficients fitted to records of forces: as text, names of files."""

from collections.abc import Callable, Mapping

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.cutting.coefficients import SHOWN, SYMBOLS
from toolpath_stiff.files import Content
from toolpath_stiff.readings.forces import AXES, CoefficientFit
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.units import um_from_m

UNITS = ("N/mm2",) * 3 + ("N/mm",) * 3


def text(fit: CoefficientFit) -> str:
    """Coefficients with their intervals, how far the slots are off, run-out, what the records do not tell."""
    values, half = fit.coefficients.values * SHOWN, fit.coefficients.deviation * SHOWN * fit.reach
    rows = [
        (symbol, f"{value:.4g}", f"+- {reach:.2g}" if known else "not determined", unit)
        for symbol, value, reach, known, unit in zip(SYMBOLS, values, half, fit.determined, UNITS, strict=True)
    ]
    name = f"{fit.coefficients.material}: " if fit.coefficients.material else ""
    lines = [f"{name}{len(fit.records)} slots, coefficients with intervals of 95 %", ""]
    lines += ShownTable(("coefficient", ">value", ">95 %", "unit"), rows).lines(2)
    off = [f"{_largest(column)} N along {axis}" for axis, column in zip(AXES, (fit.force - fit.fitted).T, strict=True)]
    left = [f"{_largest(column)} N along {axis}" for axis, column in zip(AXES, fit.left_out.T, strict=True)]
    lines += ["", f"  largest residual          {', '.join(off)}"]
    lines += [f"  a feed left out is off by {', '.join(left)}"]
    if fit.cutter.flutes > 1:
        low, high = (um_from_m(float(end)) for end in (fit.run_out.min(), fit.run_out.max()))
        lines += [f"  run-out, by what differs from tooth to tooth: {low:.1f} to {high:.1f} um"]
    return "\n".join([*lines, "", "  the records do not tell", *(f"    {sentence}" for sentence in fit.silent)])


def _largest(column: np.ndarray) -> str:
    return f"{np.nanmax(np.abs(column)):.2g}" if np.isfinite(column).any() else "-"


def forces_csv(fit: CoefficientFit) -> str:
    """One row a record."""
    columns = fit.columns()
    return csv_text(columns, zip(*columns.values(), strict=True))


DATA: Mapping[str, Callable[[CoefficientFit], Content]] = {
    "forces.json": CoefficientFit.to_json,
    "forces.csv": forces_csv,
}
