"""Robots from a table of Denavit-Hartenberg rows."""

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.unfilled import JOINTS, SPINDLE, axis_row, file_text, section
from toolpath_stiff.tables import Columns, read_table
from toolpath_stiff.units import m_from_mm, rad_from_deg

DH = ("alpha_deg", "a_mm", "offset_deg", "d_mm")
COLUMNS = Columns((*DH, "min_deg", "max_deg", "min_mm", "max_mm"), ("name", "type"))


def machine_from_dh(file: str, name: str, convention: str) -> tuple[str, list[str]]:
    """A machine file and notes, from a table with one row per joint, base first.

    Columns name, type (R or P), alpha_deg, a_mm, offset_deg (0 unless there), d_mm, and the limits min_deg, max_deg, of
    sliding joints min_mm, max_mm. `convention` is "modified DH" or "standard DH"; rows do not show it.
    Raises `InputError` for cells that are no numbers.
    """
    table = read_table(file, "DH rows", COLUMNS)
    rows = []
    for number, (line, cells) in enumerate(table.rows, 1):
        cell = {key: value for key, value in table.record(cells, line).items() if value}
        linear = cell.get("type", "R").upper() in ("P", "LINEAR")
        unit = "mm" if linear else "deg"
        try:
            values = {key: float(cell.get(key, "0" if key == "offset_deg" else "")) for key in DH}
            limits = np.array([float(cell[f"{end}_{unit}"]) for end in ("min", "max")])
        except (KeyError, ValueError):
            expected = f"numbers in {', '.join(DH)}, min_{unit}, max_{unit}"
            raise InputError(f"joint {', '.join(cells)}", expected=expected, file=file, line=line) from None
        bounds = m_from_mm(limits) if linear else rad_from_deg(limits)
        rows.append(axis_row(cell.get("name", f"J{number}"), linear, values, bounds))
    if not rows:
        raise InputError("no rows", expected=f"a joint a row below {','.join(DH)}", file=file)
    notes = [f"Made from {file}, {convention}. The tool's tip is that of the last row: add [tool] for yours."]
    parts = [section("", {"convention": convention}), *rows, JOINTS, SPINDLE]
    return file_text(name, "serial", f"DH rows of {file}", notes, parts), [*table.notes, *notes]
