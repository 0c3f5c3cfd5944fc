"""Names of columns: however a heading is spelled, which column it means, and in which unit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from functools import cache
from typing import Annotated

from toolpath_stiff.options import Option

# What --columns says, or column -> theirs; of every function that reads measurements or raw records.
Mapped = Annotated[
    str | Mapping[str, str] | None,
    Option(
        "--columns",
        "MAPPING",
        help='Columns that files call otherwise: "stiffness=stiff_mean:N/um, date=day:DD.MM.YYYY, setup==bare" '
        "(default: as FILE.columns.toml beside a file says).",
    ),
]

# Units of one quantity and their sizes (BIPM: The International System of Units, 9th ed.; inch, pound-force and
# kilogram-force: NIST Special Publication 811:2008, B.8, exact).
SIZES: tuple[Mapping[str, str], ...] = (
    {"nm": "1e-9", "um": "1e-6", "mm": "1e-3", "cm": "0.01", "m": "1", "in": "0.0254", "mil": "2.54e-5"},
    {"N": "1", "kN": "1000", "daN": "10", "kgf": "9.80665", "lbf": "4.4482216152605"},
    {"s": "1", "min": "60", "h": "3600"},
    {"deg": "1", "rad": "57.29577951308232087679815", "mrad": "0.05729577951308232087679815"},
    {
        "N/m": "1", "N/mm": "1000", "N/um": "1e6", "kN/mm": "1e6", "kN/um": "1e9", "MN/m": "1e6", "kgf/mm": "9806.65",
        "lbf/in": "175.1268352464763779527559",
    },
    {"C": "1"},
)  # fmt: skip
SAME_TOKEN = {"degc": "c", "degrees": "deg", "minutes": "min", "micron": "um", "microns": "um", "inch": "in"}


def heading_key(name: str) -> str:
    """A heading without case, brackets, spaces and signs: `Stiffness [N/mm]` and `stiffness_N_per_mm` are one."""
    text = unicodedata.normalize("NFKC", name.replace("°", "deg").replace("º", "deg")).casefold()
    tokens = re.findall(r"[^\W_]+|%", text.replace("μ", "u").replace("/", " per "))
    return "_".join(SAME_TOKEN.get(token, token) for token in tokens)


UNITS = {heading_key(unit): unit for sizes in SIZES for unit in sizes}  # key -> as it is written
NO_UNITS = frozenset(("%", "k", "f"))  # that stand where a unit may stand, and are none of ours


@cache
def parted(key: str) -> tuple[str, str]:
    """Quantity and unit of a key, the longest unit that it ends in; "" where it has none."""
    ends = (unit for unit in sorted(UNITS, key=len, reverse=True) if key.endswith(f"_{unit}"))
    unit = next(ends, "")
    return (key[: -len(unit) - 1], unit) if unit else (key, "")


def keys(names: Iterable[str]) -> dict[str, str]:
    """Key -> name of every column."""
    return {heading_key(name): name for name in names}


def meant(key: str, known: Mapping[str, str]) -> str | None:
    """The known column that a heading with no unit, or with another one, means."""
    for other, name in known.items():
        quantity, unit = parted(other)
        if unit and (key == quantity or parted(key)[0] == quantity):
            return name
    return None


def unit_of(name: str) -> str:
    """The unit that a column's name carries, as it is written; "" where it has none."""
    return UNITS.get(parted(heading_key(name))[1], "")


def same_quantity(unit: str, other: str) -> bool:
    """Whether numbers in one unit can be converted to the other."""
    return any(unit in sizes and other in sizes for sizes in SIZES)


def converted(cell: str, unit: str, wanted: str) -> str:
    """A number in another unit, without a rounding where the ratio is decimal; other cells as they are."""
    if unit == wanted:
        return cell
    sizes = next(sizes for sizes in SIZES if unit in sizes)
    try:
        return str(Decimal(cell) * Decimal(sizes[unit]) / Decimal(sizes[wanted]))
    except InvalidOperation:
        return cell
