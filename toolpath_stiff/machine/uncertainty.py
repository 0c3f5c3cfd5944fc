"""`[uncertainty]` of a machine file, checked: fitted parameters, and their uncertainty."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.error_model import GEOMETRY, ErrorModel, coordinates
from toolpath_stiff.machine.model import EffectEntry, Uncertainty
from toolpath_stiff.machine.schema import MachineToml, as_array
from toolpath_stiff.units import m_from_mm, rad_from_deg

KEYS, ERRORS = ("parameters", "sd", "correlation"), "errors"
# Key of [uncertainty.errors] -> number of dimensions, what is expected.
ERROR_KEYS = {
    "loadings": (2, "a row of {columns} numbers or more for each parameter"),
    "struts_percent": (0, "a number, 0 or more"),
    "joints_mm": (0, "a number, 0 or more"),
    "form_percent": (1, "two numbers, the second no smaller, 0 or more: at the measured places, away from them"),
    "places_mm_deg": (2, "rows of six numbers: x, y, z in mm, roll, pitch, yaw in degrees"),
}
NOT_NEGATIVE = -1e-8  # smallest eigenvalue of a correlation matrix that rounding in a file may cause


def read_uncertainty(
    toml: MachineToml, parameters: Sequence[str], entries: Sequence[EffectEntry]
) -> Uncertainty | None:
    """Section of a file with these parameters and effects; None if there is none. Raises `InputError`."""

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return toml.fault("uncertainty", key, mistake, expected)

    table = toml.data.get("uncertainty")
    if table is None:
        return None
    if not isinstance(table, dict):
        raise fault("", f" = {table!r}", "a section [uncertainty]")
    for key in table:
        if key not in (*KEYS, ERRORS):
            raise fault(key, ": unknown key", f"one of {', '.join(KEYS)}, [uncertainty.{ERRORS}]")
    for key in KEYS:
        if key not in table:
            raise fault(key, " is missing", "parameters, sd and correlation")
    names, known = table["parameters"], [*parameters, *(f"{e.name}.{key}" for e in entries for key in e.parameters)]
    if not isinstance(names, list) or not names or len(set(map(str, names))) != len(names):
        raise fault("parameters", f" = {names!r}", "a list of parameters, each once")
    for name in names:
        if name not in known:
            raise fault("parameters", f": {name!r} is not a parameter of this file", f"one of {', '.join(known)}")
    count, sd, correlation = len(names), as_array(table["sd"]), as_array(table["correlation"])
    if sd is None or sd.shape != (count,) or not (np.isfinite(sd) & (sd >= 0.0)).all():
        raise fault("sd", "", f"{count} numbers, 0 or more, one a parameter")
    if correlation is None or correlation.shape != (count, count) or not _is_correlation(correlation):
        expected = f"{count} rows of {count} numbers: symmetric, ones on the diagonal, a correlation"
        raise fault("correlation", "", expected)
    return Uncertainty(tuple(names), sd, correlation, _read_errors(toml, table.get(ERRORS), count))


def _read_errors(toml: MachineToml, table: object, parameters: int) -> ErrorModel | None:
    """`[uncertainty.errors]`; None if there is none. Raises `InputError`."""
    section = f"uncertainty.{ERRORS}"
    if table is None:
        return None
    if not isinstance(table, dict) or {*table} != {*ERROR_KEYS}:
        keys = ", ".join(table) if isinstance(table, dict) else repr(table)
        raise toml.fault(section, "", f" holds {keys or 'nothing'}", f"{', '.join(ERROR_KEYS)}, each once")
    values: dict[str, FloatArray] = {}
    for key, (dimensions, expected) in ERROR_KEYS.items():
        value = as_array(table[key])
        if value is None or value.ndim != dimensions or not _fits(key, value, parameters):
            raise toml.fault(section, key, "", expected.format(columns=GEOMETRY))
        values[key] = value
    near, away = (0.01 * values["form_percent"]).tolist()
    position, angles = np.hsplit(values["places_mm_deg"], 2)
    places = coordinates(m_from_mm(position), rad_from_deg(angles))
    struts, joints = 0.01 * float(values["struts_percent"]), m_from_mm(float(values["joints_mm"]))
    return ErrorModel(values["loadings"], struts, joints, near, away, places)


def _is_correlation(matrix: FloatArray) -> bool:
    return bool(
        np.isfinite(matrix).all()
        and np.allclose(np.diag(matrix), 1.0, rtol=0.0, atol=1e-9)
        and np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9)
        and np.linalg.eigvalsh(matrix)[0] >= NOT_NEGATIVE
    )


def _fits(key: str, value: FloatArray, parameters: int) -> bool:
    """True if an array of `ERROR_KEYS` has the required size and no impossible number."""
    if not np.isfinite(value).all():
        return False
    if key == "loadings":
        return len(value) == parameters and value.shape[1] >= GEOMETRY
    if key == "places_mm_deg":
        return value.size > 0 and value.shape[1] == 6
    return bool((value >= 0.0).all()) and (key != "form_percent" or (len(value) == 2 and value[0] <= value[1]))
