"""How well parameters of a machine are known that were fitted to measurements: `[uncertainty]` of a machine file.

Standard deviations in the units of the file's own keys, and correlations: strut law and effects share the blame for
what a reading shows, so that the one is known better once the other is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import EffectEntry, Machine

FloatArray = NDArray[np.float64]

STRUT_LAW = ("strut_law.stiffness_1_N_per_um", "strut_law.stiffness_2_N_per_um")
NOT_NEGATIVE = -1e-8  # smallest eigenvalue of a correlation matrix that rounding in a file may leave


@dataclass(frozen=True)
class Uncertainty:
    """Joint uncertainty of p fitted parameters.

    Attributes
    ----------
    names
        `STRUT_LAW`, or an effect's name and the key of its parameter: `spindle_compliance.radial_nm_per_N`.
    sd
        (p,) standard deviations in the units of the keys.
    correlation
        (p, p).
    """

    names: tuple[str, ...]
    sd: FloatArray
    correlation: FloatArray

    @classmethod
    def of(cls, names: Sequence[str], covariance: FloatArray) -> Uncertainty:
        """From a covariance (p, p) in the units of the keys."""
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        scale = np.where(sd > 0.0, sd, 1.0)
        correlation = np.clip(covariance / np.outer(scale, scale), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        return cls(tuple(names), sd, correlation)

    @property
    def covariance(self) -> FloatArray:
        """(p, p) in the units of the keys."""
        return np.asarray(np.outer(self.sd, self.sd) * self.correlation)

    def without(self, names: Sequence[str]) -> Uncertainty:
        """The same without some parameters."""
        kept = [i for i, name in enumerate(self.names) if name not in names]
        return Uncertainty(tuple(self.names[i] for i in kept), self.sd[kept], self.correlation[np.ix_(kept, kept)])

    def beside(self, other: Uncertainty) -> Uncertainty:
        """Both, independent of each other."""
        count = len(self.names)
        correlation = np.eye(count + len(other.names))
        correlation[:count, :count] = self.correlation
        correlation[count:, count:] = other.correlation
        return Uncertainty(self.names + other.names, np.concatenate([self.sd, other.sd]), correlation)


def with_parameter(machine: Machine, name: str, change: float) -> Machine:
    """The machine with `change` added to one of its fitted parameters, in the unit of the key.

    Raises `InputError` if the machine has no such parameter.
    """
    if name in STRUT_LAW:
        law = machine.strut_law
        values = [law.stiffness_1, law.stiffness_2]
        values[STRUT_LAW.index(name)] += change * 1e6
        return machine.with_changes(strut_law=replace(law, stiffness_1=values[0], stiffness_2=values[1]))
    owner, _, key = name.partition(".")
    for kind in ("effects", "instruments"):
        entries = list(getattr(machine, kind))
        for i, entry in enumerate(entries):
            if entry.name == owner and key in entry.parameters:
                moved = {**entry.parameters, key: entry.parameters[key] + change}
                entries[i] = replace(entry, parameters=moved)
                return machine.with_changes(**{kind: tuple(entries)})
    raise InputError(f"machine {machine.name} has no parameter {name!r}")


def read_uncertainty(
    table: Any, entries: Sequence[EffectEntry], fail: Callable[[str, str, str], InputError]
) -> Uncertainty | None:
    """`[uncertainty]` of a machine file, checked; None where there is none.

    `fail(key, found, expected)` makes the error that names file and line.
    """
    if table is None:
        return None
    if not isinstance(table, Mapping):
        raise fail("", f" = {table!r}", "a section [uncertainty]")
    keys = ("parameters", "sd", "correlation")
    for key in table:
        if key not in keys:
            raise fail(key, ": unknown key", f"one of {', '.join(keys)}")
    for key in keys:
        if key not in table:
            raise fail(key, " is missing", "parameters, sd and correlation")
    known = list(STRUT_LAW) + [f"{entry.name}.{key}" for entry in entries for key in entry.parameters]
    names = table["parameters"]
    if not isinstance(names, list) or not names or len(set(map(str, names))) != len(names):
        raise fail("parameters", f" = {names!r}", "a list of parameters, each once")
    for name in names:
        if name not in known:
            raise fail("parameters", f": {name!r} is not a parameter of this file", f"one of {', '.join(known)}")
    sd, correlation = _numbers(table["sd"]), _numbers(table["correlation"])
    count = len(names)
    if sd is None or sd.shape != (count,) or not (np.isfinite(sd).all() and (sd >= 0.0).all()):
        raise fail("sd", "", f"{count} numbers, 0 or more, one a parameter")
    if correlation is None or correlation.shape != (count, count) or not _is_correlation(correlation):
        raise fail(
            "correlation", "", f"{count} rows of {count} numbers: symmetric, ones on the diagonal, a correlation"
        )
    return Uncertainty(tuple(names), sd, correlation)


def _numbers(raw: Any) -> FloatArray | None:
    try:
        array = np.array(raw, dtype=float)
    except (ValueError, TypeError):
        return None
    return array


def _is_correlation(matrix: FloatArray) -> bool:
    return bool(
        np.isfinite(matrix).all()
        and np.allclose(np.diag(matrix), 1.0, rtol=0.0, atol=1e-9)
        and np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9)
        and np.linalg.eigvalsh(matrix)[0] >= NOT_NEGATIVE
    )
