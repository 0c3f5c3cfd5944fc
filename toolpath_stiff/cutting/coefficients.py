"""Cutting force coefficients with their covariance: from the list of materials, or as given."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document, json_number
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_bytes
from toolpath_stiff.toml_reader import TomlReader, is_number, is_text, shortened
from toolpath_stiff.units import (
    m_from_um,
    n_per_m_from_n_per_mm,
    n_per_mm2_from_pa,
    n_per_mm_from_n_per_m,
    pa_from_n_per_mm2,
    um_from_m,
)

SYMBOLS = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
SHOWN = np.array([n_per_mm2_from_pa(1.0)] * 3 + [n_per_mm_from_n_per_m(1.0)] * 3)  # N/mm2 and N/mm per SI
SPREAD = 0.3  # relative standard deviation where none is stated: of one aluminium, published ones spread by a factor 2
UNKNOWN = (0.3, 1.0)  # standard deviation of what is not known, shares of Ktc and Kte: the size of radial ones
TAPER, TAPERS_UM = 1e-6, (1e-3, 10.0)  # m of chip over which the force at the edge sets in: assumed, so that none jumps
STRONGEST = 1e5  # N/mm2, N/mm: twenty times a nickel alloy
KEYS = ("material", "origin", "cutting_N_per_mm2", "edge_N_per_mm", "covariance", "spread_percent", "thinnest_chip_um",
        "thickest_chip_um", "edge_sets_in_um")  # fmt: skip
Fault = Callable[[str, str, str], InputError]  # of a key: what is wrong, what was expected


@dataclass(frozen=True)
class Coefficients:
    """Force on an edge per height of cut, tangential, radial and axial: cutting x chip thickness + edge.

    Altintas, Manufacturing Automation, 2nd ed., chapter 2.

    Attributes
    ----------
    cutting, edge
        (3,) N/m2 and (3,) N/m: t, r, a.
    covariance
        (6, 6) of both in this order.
    material, origin
        In words.
    thinnest, thickest
        m, feeds per tooth of the records that they rest on; nan where none are known.
    taper
        m of chip over which the force at the edge sets in.
    """

    cutting: FloatArray
    edge: FloatArray
    covariance: FloatArray
    material: str = ""
    origin: str = ""
    thinnest: float = np.nan
    thickest: float = np.nan
    taper: float = TAPER

    @property
    def values(self) -> FloatArray:
        """(6,) cutting, then edge."""
        return np.concatenate([self.cutting, self.edge])

    @property
    def deviation(self) -> FloatArray:
        """(6,) standard deviations."""
        return np.sqrt(np.diagonal(self.covariance))

    def document(self) -> Document:
        """The coefficients in shop units, as in a setup file."""
        shown = [json_number(value, 9) for value in self.values * SHOWN]
        covariance = self.covariance * SHOWN * SHOWN[:, None]
        return {
            "material": self.material,
            "origin": self.origin,
            "cutting_N_per_mm2": shown[:3],
            "edge_N_per_mm": shown[3:],
            "covariance": [[json_number(value, 9) for value in row] for row in covariance.tolist()],
            "thinnest_chip_um": json_number(um_from_m(self.thinnest)),
            "thickest_chip_um": json_number(um_from_m(self.thickest)),
            **({} if self.taper == TAPER else {"edge_sets_in_um": json_number(um_from_m(self.taper))}),
        }


@cache
def materials() -> dict[str, Coefficients]:
    """Name -> coefficients of the materials that come with the package."""
    reader = TomlReader.read(Path(__file__).parent.parent / "data" / "materials.toml", "materials")

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return reader.error(mistake, expected)

    return {name: coefficients_from(table, fault) for name, table in reader.data.items()}


def material(name: str) -> Coefficients:
    """Coefficients of a material, named in any spelling. Raises `InputError`."""
    known = {key.casefold(): value for key, value in materials().items()}
    if name.casefold() not in known:
        hint = "measure slots at several feeds and let `tps forces` make them, or write them into the setup file"
        raise InputError(f"material {name!r} is not known", expected=f"one of {', '.join(materials())}", hint=hint)
    return known[name.casefold()]


def read_coefficients(file: str | Path) -> Coefficients:
    """Coefficients from a JSON file written by `tps forces`. Raises `InputError`."""
    content = read_bytes(file, "coefficients")
    try:
        document = json.loads(content)
        table = document["coefficients"]
    except (ValueError, KeyError, TypeError, RecursionError):
        expected = 'a JSON document with "coefficients", as `tps forces` writes it'
        raise InputError("no coefficients", expected=expected, file=str(file)) from None

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return InputError(f"coefficients.{mistake}", expected=expected, file=str(file))

    if not isinstance(table, dict):
        raise fault("", f"is {shortened(table)}", "a table")
    return coefficients_from(table, fault)


def coefficients_from(table: Document, fault: Fault) -> Coefficients:
    """Coefficients from a file's numbers in shop units.

    Parameters
    ----------
    table
        `cutting_N_per_mm2` and `edge_N_per_mm` (t, r, a; nan where it is not known), `material`, `origin`; their
        `covariance` (6 x 6) or `spread_percent`, else `SPREAD` is assumed and said.
    fault
        Makes the error of a key: where it stands, what it is, what was expected.

    Raises
    ------
    InputError
        What is missing or no such number.
    """
    for key in table:
        if key not in KEYS:
            raise fault(key, f"{key} is not known", ", ".join(KEYS))
    values = np.concatenate([_three(table, "cutting_N_per_mm2", fault), _three(table, "edge_N_per_mm", fault)])
    origin = table.get("origin")
    if not is_text(origin):
        raise fault("origin", f"origin = {origin!r}", "where the coefficients come from, in words")
    remarks = [str(origin)]
    unknown = np.isnan(values)
    if unknown.any():
        names = ", ".join(symbol for symbol, lacks in zip(SYMBOLS, unknown, strict=True) if lacks)
        remarks.append(f"{names} not known: 0 +- {UNKNOWN[0]:g} Ktc and {UNKNOWN[1]:g} Kte assumed")
    size = np.repeat(values[[0, 3]] * UNKNOWN, 3)
    values = np.where(unknown, 0.0, values)
    covariance = _covariance(table, values, fault)
    if covariance is None:
        spread = table.get("spread_percent", 100.0 * SPREAD)
        if not is_number(spread) or not 0.0 <= spread <= 200.0:
            raise fault("spread_percent", f"spread_percent = {spread!r}", "0 to 200 %, a standard deviation")
        # One common deviation: in a harder batch all coefficients are higher.
        covariance = np.outer(values, values) * (spread / 100.0) ** 2
        if "spread_percent" not in table:
            remarks.append(f"standard deviation of {100.0 * SPREAD:g} % assumed")
    covariance = covariance + np.diag(np.where(unknown, size, 0.0) ** 2)
    taper, (least, most) = table.get("edge_sets_in_um"), TAPERS_UM
    if taper is None:
        taper = um_from_m(TAPER)
        remarks.append(f"the force at the edge sets in over {taper:g} um of chip (edge_sets_in_um assumed)")
    elif not is_number(taper) or not least <= taper <= most:
        raise fault("edge_sets_in_um", f"edge_sets_in_um = {shortened(taper)}", f"{least:g} to {most:g} um of chip")
    chips = [table.get(key) for key in ("thinnest_chip_um", "thickest_chip_um")]
    thinnest, thickest = (m_from_um(float(chip)) if is_number(chip) else np.nan for chip in chips)
    return Coefficients(
        cutting=pa_from_n_per_mm2(values[:3]),
        edge=n_per_m_from_n_per_mm(values[3:]),
        covariance=covariance / SHOWN / SHOWN[:, None],
        material=str(table.get("material", "")),
        origin="; ".join(remarks),
        thinnest=thinnest,
        thickest=thickest,
        taper=m_from_um(taper),
    )


def _three(table: Document, key: str, fault: Fault) -> FloatArray:
    """The t, r and a values; the first is required and positive."""
    numbers = table.get(key)
    expected = f"[t, r, a], t from 0 to {STRONGEST:g}, r and a within +-{STRONGEST:g} or nan"
    if not isinstance(numbers, list) or len(numbers) != 3 or not all(map(is_number, numbers)):
        raise fault(key, f"{key} = {shortened(numbers)}", expected)
    three = np.array(numbers, dtype=float)
    lowest = 0.0 if key.startswith("edge") else 1.0
    if not lowest <= three[0] <= STRONGEST or (np.abs(three[1:]) > STRONGEST).any():
        raise fault(key, f"{key} = {shortened(numbers)}", expected)
    return three


def _covariance(table: Document, values: FloatArray, fault: Fault) -> FloatArray | None:
    """(6, 6) covariance in shop units as given; None if not given."""
    rows = table.get("covariance")
    if rows is None:
        return None
    if "spread_percent" in table:
        raise fault("spread_percent", "spread_percent beside a covariance", "one of them")
    try:
        covariance = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        covariance = np.zeros(0)
    sound = covariance.shape == (6, 6) and np.isfinite(covariance).all() and np.allclose(covariance, covariance.T)
    if not sound or np.linalg.eigvalsh(covariance)[0] < -1e-6 * np.trace(covariance):
        raise fault("covariance", f"covariance = {shortened(rows)}", "6 rows of 6 numbers, a covariance")
    return covariance
