"""`[uncertainty]` of a machine file, checked: fitted parameters, and their uncertainty."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.error_model import GEOMETRY, ErrorModel, coordinates
from toolpath_stiff.machine.model import EffectEntry, Uncertainty
from toolpath_stiff.machine.schema import Key, MachineToml, read_section
from toolpath_stiff.units import m_from_mm, rad_from_deg

SECTION, ERRORS = "uncertainty", "errors"
KNOWN = {
    "parameters": Key(text=True, shape=(1,)),
    "sd": Key(shape=(1,), many=True, low=0.0, high=np.inf),
    "correlation": Key(shape=(1, 0), many=True, low=-1.001, high=1.001),
}
STATED = {
    "loadings": Key(shape=(1, 0), many=True, low=-np.inf, high=np.inf),
    "struts_percent": Key(unit="%", low=0.0, high=np.inf),
    "joints_mm": Key(unit="mm", low=0.0, high=np.inf),
    "learned": Key(shape=(1, GEOMETRY), many=True, low=-np.inf, high=np.inf),
    "form_percent": Key(unit="%", shape=(2,), low=0.0, high=np.inf),
    "places_mm_deg": Key(unit="mm, deg", shape=(1, 6), many=True),
}
OF_LOAD = {
    "load_N": Key(unit="N", low=0.0, high=np.inf, open_low=True, required=False),
    "by_load_percent": Key(unit="%", low=0.0, high=np.inf, required=False),
}
NOT_NEGATIVE = -1e-8  # smallest eigenvalue of a correlation matrix that rounding in a file may cause


def read_uncertainty(
    toml: MachineToml, parameters: Sequence[str], entries: Sequence[EffectEntry]
) -> Uncertainty | None:
    """Section of a file with these parameters and effects; None if there is none. Raises `InputError`."""

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return toml.fault(SECTION, key, mistake, expected)

    table = toml.data.get(SECTION)
    if table is None:
        return None
    if not isinstance(table, dict):
        raise fault("", f" = {table!r}", "a section [uncertainty]")
    values = read_section(toml, SECTION, {key: v for key, v in table.items() if key != ERRORS}, KNOWN)
    names, sd, correlation = (values[key] for key in KNOWN)
    known = [*parameters, *(f"{e.name}.{key}" for e in entries for key in e.parameters)]
    for name in names:
        if name not in known:
            raise fault("parameters", f": {name!r} is not a parameter of this file", f"one of {', '.join(known)}")
    count = len(names)
    if sd.shape != (count,):
        raise fault("sd", f": {len(sd)} numbers", f"{count} numbers, one a parameter")
    if correlation.shape != (count, count) or not _is_correlation(correlation):
        expected = f"{count} rows of {count} numbers: symmetric, ones on the diagonal, a correlation"
        raise fault("correlation", "", expected)
    return Uncertainty(names, sd, correlation, _read_errors(toml, table.get(ERRORS), count))


def _read_errors(toml: MachineToml, table: object, parameters: int) -> ErrorModel | None:
    """`[uncertainty.errors]`; None where there is none. Raises `InputError`."""
    section = f"{SECTION}.{ERRORS}"
    if table is None:
        return None
    if not isinstance(table, dict):
        raise toml.fault(section, "", f" = {table!r}", f"a section [{section}]")
    values = read_section(toml, section, table, STATED | OF_LOAD)
    loadings, struts, joints, learned, (near, away), places = (values[key] for key in STATED)
    given = [key for key in OF_LOAD if key in values]
    if len(given) == 1:
        raise toml.fault(section, given[0], " alone", " and ".join(OF_LOAD))
    load, by_load = (values[key] for key in OF_LOAD) if given else (np.inf, 0.0)
    if len(loadings) != parameters or loadings.shape[1] < GEOMETRY:
        raise toml.fault(section, "loadings", "", f"a row of {GEOMETRY} numbers or more for each parameter")
    if away < near:
        raise toml.fault(section, "form_percent", "", "the second no smaller: at the measured places, away from them")
    position, angles = np.hsplit(places, 2)
    places = coordinates(m_from_mm(position), rad_from_deg(angles))
    form = (0.01 * float(near), 0.01 * float(away))
    return ErrorModel(loadings, 0.01 * struts, m_from_mm(joints), *form, places, learned, load, 0.01 * by_load)


def _is_correlation(matrix: FloatArray) -> bool:
    return bool(
        np.allclose(np.diag(matrix), 1.0, rtol=0.0, atol=1e-9)
        and np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9)
        and np.linalg.eigvalsh(matrix)[0] >= NOT_NEGATIVE
    )
