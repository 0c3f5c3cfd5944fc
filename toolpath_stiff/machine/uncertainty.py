"""`[uncertainty]` of a machine file, checked: which parameters were fitted, and how well they are known."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import EffectEntry, StrutLaw, Uncertainty
from toolpath_stiff.machine.schema import MachineToml, as_array

KEYS = ("parameters", "sd", "correlation")
NOT_NEGATIVE = -1e-8  # smallest eigenvalue of a correlation matrix that rounding in a file may leave


def read_uncertainty(toml: MachineToml, law: StrutLaw, entries: Sequence[EffectEntry]) -> Uncertainty | None:
    """The section of a file with this strut law and these effects; None where there is none. Raises `InputError`."""

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return toml.fault("uncertainty", key, mistake, expected)

    table = toml.data.get("uncertainty")
    if table is None:
        return None
    if not isinstance(table, dict):
        raise fault("", f" = {table!r}", "a section [uncertainty]")
    for key in table:
        if key not in KEYS:
            raise fault(key, ": unknown key", f"one of {', '.join(KEYS)}")
    for key in KEYS:
        if key not in table:
            raise fault(key, " is missing", "parameters, sd and correlation")
    names, known = table["parameters"], [*law.parameters, *(f"{e.name}.{key}" for e in entries for key in e.parameters)]
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
    return Uncertainty(tuple(names), sd, correlation)


def _is_correlation(matrix: FloatArray) -> bool:
    return bool(
        np.isfinite(matrix).all()
        and np.allclose(np.diag(matrix), 1.0, rtol=0.0, atol=1e-9)
        and np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9)
        and np.linalg.eigvalsh(matrix)[0] >= NOT_NEGATIVE
    )
