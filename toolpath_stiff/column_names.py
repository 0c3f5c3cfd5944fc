"""Names of columns: which column and which unit a heading means, however it is spelled."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation
from typing import Annotated

from toolpath_stiff.options import Option

# The text of --columns, or column -> the file's heading; an argument of every reader of measurements or raw records.
Mapped = Annotated[
    str | Mapping[str, str] | None,
    Option(
        "--columns",
        "MAPPING",
        help='Columns with other names in the files: "stiffness=stiff_mean:N/um, date=day:DD.MM.YYYY, setup==bare" '
        "(default: as FILE.columns.toml beside a file says).",
    ),
]

# Units of one quantity and their sizes (BIPM: The International System of Units, 9th ed.; inch, pound-force and
# kilogram-force, by which kg on a cable pull: NIST Special Publication 811:2008, B.8, exact).
SIZES: tuple[Mapping[str, str], ...] = (
    {"nm": "1e-9", "um": "1e-6", "mm": "1e-3", "cm": "0.01", "m": "1", "in": "0.0254", "mil": "2.54e-5"},
    {"N": "1", "kN": "1000", "daN": "10", "kgf": "9.80665", "kg": "9.80665", "lbf": "4.4482216152605"},
    {"s": "1", "min": "60", "h": "3600"},
    {"deg": "1", "rad": "57.29577951308232087679815", "mrad": "0.05729577951308232087679815"},
    {
        "N/m": "1", "N/mm": "1000", "N/um": "1e6", "kN/mm": "1e6", "kN/um": "1e9", "MN/m": "1e6", "kgf/mm": "9806.65",
        "lbf/in": "175.1268352464763779527559",
    },
    {"C": "1"},
)  # fmt: skip


def heading_key(name: str) -> str:
    """A heading without case, brackets, spaces and signs, so `Stiffness [N/mm]` equals `stiffness_N_per_mm`."""
    text = unicodedata.normalize("NFKC", name).casefold().replace("μ", "u").replace("°", "deg").replace("/", " per ")
    return "_".join(re.findall(r"[^\W_]+", text))


UNITS = {heading_key(unit): unit for sizes in SIZES for unit in sizes} | {"inch": "in"}  # key -> as it is written


def parted(name: str) -> tuple[str, str]:
    """Quantity (as a key) and unit (as written) of a heading; the unit is "" if it has none."""
    key = heading_key(name)
    unit = max((unit for unit in UNITS if key.endswith(f"_{unit}")), key=len, default="")
    return (key[: -len(unit) - 1], UNITS[unit]) if unit else (key, "")


def same_quantity(unit: str, other: str) -> bool:
    """True if numbers in one unit can be converted to the other."""
    return any(unit in sizes and other in sizes for sizes in SIZES)


def converted(cell: str, unit: str, wanted: str) -> str:
    """A cell's number converted to another unit, exactly where the ratio is decimal; other cells unchanged."""
    sizes = next(sizes for sizes in SIZES if unit in sizes)
    try:
        return str(Decimal(cell) * Decimal(sizes[unit]) / Decimal(sizes[wanted]))
    except InvalidOperation:
        return cell


def columns_option(entries: Sequence[str]) -> str:
    """A mapping of columns as a command-line option to paste."""
    text = ", ".join(entries)
    quote = "'" if '"' in text else '"'
    return f"--columns {quote}{text}{quote} (columns=)"
