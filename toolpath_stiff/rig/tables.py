"""Measurement files as the rig writes them, and plans (measurement files with the stiffness left empty) as it reads."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.files import read_text
from toolpath_stiff.rig.campaign import AXES, DEFAULT_SETUP, POSE, Table
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.units import m_from_mm, rad_from_deg

# Column -> lowest and highest value that makes sense, and the value of an empty cell (None: a number is needed).
NUMBERS: dict[str, tuple[float, float, float | None]] = {
    **dict.fromkeys(POSE[:3], (-1e5, 1e5, None)),
    **dict.fromkeys(POSE[3:], (-360.0, 360.0, 0.0)),
    **dict.fromkeys(("dx", "dy", "dz"), (-1e3, 1e3, None)),
    "force_N": (1e-3, 1e6, 1000.0),
    "time_min": (0.0, 1e5, 0.0),
    "tool_extension_mm": (-1e4, 1e4, 0.0),
    "temperature_C": (-50.0, 100.0, 20.0),
}
WHOLE = ("clamp",)
LABELS = ("repeat", "point")  # any text
WORDS = ("setup", "loop")
RESULTS = ("stiffness_N_per_mm", "sd_N_per_mm")
TIP_LOOPS = ("", "tip")  # the rig's only indicator: tool tip against workpiece


def csv_text(table: Mapping[str, Any]) -> str:
    """The table as CSV; numbers as short as they are exact to ten digits."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table)
    for row in zip(*table.values(), strict=True):
        writer.writerow([value if isinstance(value, str) else f"{value + 0.0:.10g}" for value in row])
    return stream.getvalue()


def read_plan(file: str, nominal: Nominal) -> Table:
    """Table of a plan; stiffness and its sd may be there, empty or not, and are left out.

    Raises
    ------
    InputError, InputErrors
        Not a table of poses; or every bad cell and unreachable pose, named.
    """
    lines = [row for row in enumerate(csv.reader(io.StringIO(read_text(file, "the plan"))), 1) if any(row[1])]
    if len(lines) < 2:
        raise InputError("no poses", expected="a heading (x_mm,y_mm,z_mm,direction ...) and rows", file=file)
    (first, heading), body = lines[0], lines[1:]
    heading = [name.strip() for name in heading]
    _check_heading(heading, file, first)
    errors: list[InputError] = []
    table: Table = {}
    for column, name in enumerate(heading):
        if name in RESULTS:
            continue
        values = []
        for line, row in body:
            cell = row[column].strip() if column < len(row) else ""
            try:
                values.append(_value(name, cell))
            except ValueError as error:
                errors.append(InputError(f"{name} {cell!r}", expected=str(error), file=file, line=line))
        table[name] = values if name in (*LABELS, *WORDS, "direction") else np.array(values)
    if errors:
        raise InputErrors(errors)
    _check_rows(table, [line for line, _ in body], nominal, file)
    table.pop("loop", None)
    return table


def _check_heading(heading: list[str], file: str, line: int) -> None:
    known = (*NUMBERS, *WHOLE, *LABELS, *WORDS, *RESULTS, "direction")
    for name in heading:
        if name not in known or heading.count(name) > 1:
            wrong = "unknown column" if name not in known else "column given twice:"
            raise InputError(f"{wrong} {name!r}", expected=", ".join(known), file=file, line=line)
    vectors = [name for name in ("dx", "dy", "dz") if name in heading]
    if ("direction" in heading) == bool(vectors) or len(vectors) not in (0, 3):
        raise InputError("directions unclear", expected="either direction or dx,dy,dz", file=file, line=line)
    for name in POSE[:3]:
        if name not in heading:
            raise InputError(f"column {name} is missing", expected="x_mm,y_mm,z_mm", file=file, line=line)


def _value(name: str, cell: str) -> float | int | str:
    """The value of a cell; ValueError says what was expected."""
    if name == "direction":
        if cell not in AXES:
            raise ValueError("X, Y or Z")
        return cell
    if name == "loop":
        if cell not in TIP_LOOPS:
            raise ValueError("an empty cell or 'tip': the rig has its indicator at the tool tip alone")
        return cell
    if name in LABELS:
        return cell
    if name == "setup":
        return cell or DEFAULT_SETUP
    if name in WHOLE:
        if not cell.isdecimal():
            raise ValueError("a whole number")
        return int(cell)
    low, high, default = NUMBERS[name]
    if not cell and default is not None:
        return default
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise ValueError(f"a number from {low:g} to {high:g}")
    return value


def _check_rows(table: Table, lines: list[int], nominal: Nominal, file: str) -> None:
    """Directions that are none and poses that the machine cannot take."""
    count = len(lines)
    poses = np.column_stack([table.get(name, np.zeros(count)) for name in POSE])
    extension = m_from_mm(np.asarray(table.get("tool_extension_mm", np.zeros(count))))
    reached = reachable(nominal, m_from_mm(poses[:, :3]), rad_from_deg(poses[:, 3:]), extension)
    errors = [
        InputError(f"machine {nominal.name} cannot reach this pose", file=file, line=line)
        for line, good in zip(lines, reached, strict=True)
        if not good
    ]
    if "dx" in table:
        length = np.linalg.norm([table[name] for name in ("dx", "dy", "dz")], axis=0)
        errors += [
            InputError("a direction of no length", expected="dx, dy, dz not all 0", file=file, line=line)
            for line, size in zip(lines, length, strict=True)
            if size < 1e-9
        ]
    if errors:
        raise InputErrors(errors)
