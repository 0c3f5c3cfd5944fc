"""Tables of struts measured alone whose stiffnesses were worked out elsewhere: a row a strut and date."""

import math

import numpy as np

from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.mapping import DATE, check_needed
from toolpath_stiff.readings.raw_records import LAYOUTS, PLACE, STIFFNESS, Loop, check_place, strut_or_loop, unused
from toolpath_stiff.readings.rows import LABELS, SOFTEST, STIFFEST, number, optional_number, parsed_rows
from toolpath_stiff.tables import Table
from toolpath_stiff.units import n_per_m_from_n_per_mm

FAILED = 0.05  # of the rows of such a table: tests that may have failed, near zero; of more the unit is wrong; assumed


def read_strut_table(table: Table) -> tuple[list[LoopFigures], list[str]]:
    """Struts alone without records; and remarks.

    A few rows with a stiffness near zero are failed tests: they are left out, with a note.

    Raises
    ------
    InputError, InputErrors
        Rows that are not of a strut alone, have no stiffness or none that could be; all of them.
    """
    check_needed(table, STIFFNESS[:1] if "loop" in table.heading else ("strut", STIFFNESS[0]), LAYOUTS)

    def strut(line: int, record: dict[str, str]) -> LoopFigures:
        if strut_or_loop(record).kind != "alone":
            raise MeasurementError("a row of no strut", expected="strut 1 to 6")
        check_place(record)
        failed = abs(number(record, STIFFNESS[0], (-STIFFEST, STIFFEST))) < SOFTEST
        stiffness = math.nan if failed else n_per_m_from_n_per_mm(number(record, STIFFNESS[0]))
        place = {name: record[name] for name in PLACE if record.get(name)}
        loop = Loop(place, {}, None, np.empty(0), np.empty(0), line, table.file)
        return LoopFigures(loop, stiffness, optional_number(record, STIFFNESS[1]))

    struts, errors = parsed_rows(table, strut)
    failed = [row.loop.line for row in struts if math.isnan(row.stiffness)]
    fault = f"{len(failed)} of {len(table.rows)} rows with a stiffness within {SOFTEST:g} N/mm of zero"
    if len(failed) > FAILED * len(table.rows):
        hint = f"is the unit right? At most {100 * FAILED:g} % are left out as failed tests"
        errors.append(MeasurementError(fault, hint=hint, file=table.file, line=failed[0]))
    if errors:
        raise InputErrors(errors)
    if not struts:
        raise MeasurementError("no rows below the heading", file=table.file, line=table.heading_line)
    notes = unused(table, ("strut", *LABELS, DATE, "length_mm", *STIFFNESS))
    if failed:
        notes.append(f"{table.file}: {fault} are left out as failed tests, from line {failed[0]}")
    return [row for row in struts if not math.isnan(row.stiffness)], notes
