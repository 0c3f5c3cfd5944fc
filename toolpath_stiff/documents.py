"""Results as plain data: dataclasses in the form that JSON takes, numbers in the form that is written."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

# Sums run in another order on another CPU, and searches stop within a tolerance: digits beyond these are not certain.
# Of any figure of a document that rests on a search: two CPUs differ in the tenth. Decimals at most: what is left of a
# difference of like figures has fewer digits that are certain.
CERTAIN, DECIMALS = 7, 8
DIGITS = 5  # significant digits of a fitted figure
Document = Mapping[str, Any]  # what a JSON file holds, or a part of it, by the file's own keys


def to_dict(value: Any) -> Any:
    """Plain data of a result: dataclasses become dictionaries, fields in order; numpy becomes Python; None is kept."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_dict(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: to_dict(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_dict(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value  # of numpy, which is not imported for it


def records(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of columns (arrays or lists of equal length), each a dictionary by column name."""
    values = (to_dict(column) for column in columns.values())
    return [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]


def without_nan(value: Any) -> Any:
    """Plain data with None in place of every float that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def certain(value: Any) -> Any:
    """Plain data with floats rounded to `CERTAIN` digits and `DECIMALS` decimals, in percent, mm, N, degrees."""
    if isinstance(value, float):
        return float(f"{round(value, DECIMALS):.{CERTAIN}g}") + 0.0
    if isinstance(value, dict):
        return {key: certain(part) for key, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{field.name: certain(getattr(value, field.name)) for field in fields(value)})
    return [certain(part) for part in value] if isinstance(value, list | tuple) else value


def number(value: float | None, digits: int = 0) -> str:
    """A figure with thin spaces between thousands ("45 123"); "-" if there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    text = f"{value:,.{digits}f}".replace(",", " ")
    return text.replace("-", "", 1) if float(text.replace(" ", "")) == 0.0 else text


def json_number(value: float, digits: int = DIGITS) -> float | None:
    """A float rounded to significant digits; None if JSON cannot hold it."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
