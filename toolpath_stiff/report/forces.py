"""Views of coefficients fitted to force records: text and file names."""

from collections.abc import Callable, Mapping

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.cutting.coefficients import SHOWN, SYMBOLS
from toolpath_stiff.files import Content
from toolpath_stiff.readings.forces import AXES, CoefficientFit
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.units import um_from_m

UNITS = ("N/mm2",) * 3 + ("N/mm",) * 3


def text(fit: CoefficientFit) -> str:
    """Coefficients with intervals, errors of the slots, run-out, and what the records do not tell."""
    values, half = fit.coefficients.values * SHOWN, fit.coefficients.deviation * SHOWN * fit.reach
    rows = [
        (symbol, f"{value:.4g}", f"+- {reach:.2g}" if known else "not determined", unit)
        for symbol, value, reach, known, unit in zip(SYMBOLS, values, half, fit.determined, UNITS, strict=True)
    ]
    name = f"{fit.coefficients.material}: " if fit.coefficients.material else ""
    lines = [f"{name}{len(fit.records)} slots, coefficients with intervals of 95 %", ""]
    lines += ShownTable(("coefficient", ">value", ">95 %", "unit"), rows).lines(2)
    lines += ["", f"  largest residual          {_largest(fit.force - fit.fitted)}"]
    lines += [f"  a feed left out is off by {_largest(fit.left_out)}"]
    if np.isfinite(fit.run_out).any():
        low, high = (um_from_m(float(end)) for end in (fit.run_out.min(), fit.run_out.max()))
        lines += [f"  run-out, by what differs from tooth to tooth: {low:.1f} to {high:.1f} um"]
    lines += ["", "  the records do not tell", *(f"    {sentence}" for sentence in fit.silent)]
    return "\n".join([*lines, *(f"note: {note}" for note in fit.notes)])


def _largest(forces: FloatArray) -> str:
    """Largest of forces (n, 3) in each direction that was recorded."""
    sizes = {axis: np.abs(column) for axis, column in zip(AXES, forces.T, strict=True) if np.isfinite(column).any()}
    return ", ".join(f"{np.nanmax(size):.2g} N along {axis}" for axis, size in sizes.items()) or "- (too few feeds)"


def forces_csv(fit: CoefficientFit) -> str:
    """One row per record."""
    columns = fit.columns()
    return csv_text(columns, zip(*columns.values(), strict=True))


DATA: Mapping[str, Callable[[CoefficientFit], Content]] = {
    "forces.json": CoefficientFit.to_json,
    "forces.csv": forces_csv,
}
