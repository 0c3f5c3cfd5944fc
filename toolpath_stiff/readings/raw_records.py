"""Raw records of force and displacement, read: which of them are one loop, and what was set step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_names import heading_key, same_quantity, unit_of
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.loops import loop_of
from toolpath_stiff.readings.mapping import DATE, check_heading
from toolpath_stiff.readings.rows import (
    ANGLES,
    LABELS,
    POSITION,
    SOFTEST,
    STIFFEST,
    VECTOR,
    direction_of,
    number,
    optional_number,
    parsed_rows,
)
from toolpath_stiff.stiffness.measuring_loop import TIP, MeasuringLoop, measuring_loop
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_um, n_per_m_from_n_per_mm

READINGS = ("jog_um", "force_N", "displacement_um")


PLACE = (
    *POSITION,
    *ANGLES,
    "direction",
    *VECTOR,
    *LABELS,
    "tool_extension_mm",
    "length_mm",
    DATE,
)  # what one loop has in common


CONDITIONS = ("time_min", "temperature_C")


STIFFNESS = ("stiffness_N_per_mm", "strut_force_N")  # of a table of struts that were reduced elsewhere


FAILED = 0.05  # of the rows of such a table: tests that may have failed, near zero; of more the unit is wrong; assumed


SERIAL = "serial"  # number of the strut: another one is another part


KNOWN = (*PLACE, *READINGS, *CONDITIONS, "strut", SERIAL)


MISSING = ("", "-", "--", "---", "nan", "n/a", "na", "null", "none", "#n/a")  # what is written for a lost reading


COLUMNS = Columns(
    numbers=(*POSITION, *ANGLES, *VECTOR, "tool_extension_mm", "length_mm", *READINGS, *CONDITIONS, *STIFFNESS),
    texts=("direction", *LABELS, DATE, "strut", SERIAL),
)


BENCH = "strut,date,force_N,displacement_um of a strut on a bench"


SIGNED = {"force_N": 1e7, "displacement_um": 1e6, "jog_um": 1e6}  # largest magnitude, either sign


ONE_SIDE = 0.05  # of the range: a force set on a bench that goes less far to the other side is of one side


NEAR_END = 0.02  # of the range of a force set on a bench: records this close are at its extreme, and averaged


SHARED = 3  # records that a date-time needs to stand for a loop of its own


SAME_JOG = 1e-9  # m: jogs this close are the same step


DAY = len("2024-03-31")


@dataclass(frozen=True)
class Loop:
    """One test: records in the order in which they were taken. SI.

    Attributes
    ----------
    place
        Column -> text of what the records have in common: pose, direction, labels.
    conditions
        Column -> mean of time and temperature, in the file's unit.
    jog, force, displacement
        (m,) m, N, m, along the direction. `jog` is None of a strut on a bench.
    line, file
        Line of the first record, and of which file.
    serial
        Number of the part, where the file has it.
    """

    place: Mapping[str, str]
    conditions: Mapping[str, float]
    jog: FloatArray | None
    force: FloatArray
    displacement: FloatArray
    line: int
    file: str = ""
    serial: str = ""

    @property
    def deflection(self) -> FloatArray:
        """(m,) m, what the machine gave way: jog less displacement; on a bench the displacement itself."""
        return self.displacement if self.jog is None else self.jog - self.displacement

    @property
    def drive(self) -> FloatArray:
        """(m,) what was set step by step: the jog in m; on a bench the force in N."""
        return self.force if self.jog is None else self.jog

    @property
    def same(self) -> float:
        """How close two records' `drive` is at one step."""
        return NEAR_END * float(np.ptp(self.force)) if self.jog is None else SAME_JOG

    @property
    def strut(self) -> str:
        """The strut that was measured alone, as "strut 3 alone"."""
        return self.place.get("loop", "")

    @property
    def date(self) -> str:
        """As in the file; "" without one."""
        return self.place.get(DATE, "")

    @property
    def side(self) -> float:
        """1 of a bench record under tension alone, -1 under compression alone, 0 of any other loop."""
        if self.jog is not None or not len(self.force):
            return 0.0
        least = ONE_SIDE * float(np.ptp(self.force))
        return 1.0 if self.force.min() >= -least else -1.0 if self.force.max() <= least else 0.0

    @property
    def resolution(self) -> float:
        """m, the smallest step between two different readings of the indicator."""
        steps = np.diff(np.unique(self.displacement))
        return float(steps.min()) if len(steps) else 0.0

    def part(self, records: slice) -> Loop:
        """The same test, of some of its records."""
        jog = None if self.jog is None else self.jog[records]
        return replace(self, jog=jog, force=self.force[records], displacement=self.displacement[records])

    @property
    def title(self) -> str:
        """Point or position, direction, set-up, repeat: whatever is there."""
        rest = [f"{name} {self.place[name]}" for name in ("setup", "clamp", "repeat") if self.place.get(name)]
        where, way = self.strut, self.place.get("point", "")
        if self.jog is not None:
            where = way or ", ".join(self.place[name] for name in POSITION) + " mm"
            way = self.place.get("direction") or "(" + ", ".join(self.place[name] for name in VECTOR) + ")"
        return ", ".join(filter(None, [where, way, self.date, *rest]))


class RawRecord(NamedTuple):
    """One record: its line, its cells, and jog, force, displacement and conditions."""

    line: int
    cells: dict[str, str]
    values: list[float]


def read_raw(table: Table) -> tuple[list[Loop], list[str]]:
    """Loops of a file of raw records (`tables.read_table` with `COLUMNS`), by their first record; and remarks.

    Raises
    ------
    InputError
        Columns are missing or unknown, or there are no records.
    InputErrors
        Bad records, all of them.
    """
    file, heading, line = table.file, table.heading, table.heading_line
    check_heading(table, KNOWN, _needed(heading), f"x_mm,y_mm,z_mm,direction,{','.join(READINGS)}, or {BENCH}")
    notes = [f"{file}: column {name} is not used" for name in heading if name and name not in KNOWN]
    if not table.rows:
        raise MeasurementError("no records below the heading", file=file, line=line)
    parsed, errors = parsed_rows(table, _record)
    if errors:
        raise InputErrors(errors)
    records = [record for record in parsed if record.values]
    lost = [record.line for record in parsed if not record.values]
    if not records:
        raise MeasurementError("no record has both a force and a displacement", file=file, line=lost[0])
    if lost:
        many = f"{len(lost)} records" if len(lost) > 1 else "a record"
        notes.append(f"{file}: {many} without force or displacement passed over, from line {lost[0]}")
    groups: dict[tuple[str, ...], list[RawRecord]] = {}
    names = [name for name in PLACE if name != DATE and (name in heading or name == "loop")]
    for record in records:
        key = (*(record.cells.get(name, "") for name in names), record.cells.get(DATE, "")[:DAY])
        groups.setdefault(key, []).append(record)
    loops = [_loop(part, file) for group in groups.values() for part in _by_time(group)]
    return sorted(loops, key=lambda loop: loop.line), notes


def is_table(table: Table) -> bool:
    """Whether the rows are stiffnesses of struts that were reduced elsewhere."""
    stated = {*table.heading, *(doubt.name for doubt in table.doubts)}
    return STIFFNESS[0] in stated and "displacement_um" not in stated


class KnownStiffness(NamedTuple):
    """A strut alone without records, N/m, and N (nan where not given)."""

    loop: Loop
    stiffness: float
    force: float


def read_stiffnesses(table: Table) -> tuple[list[KnownStiffness], list[str]]:
    """Struts alone of a table of stiffnesses; and remarks.

    A few rows with a stiffness near zero are failed tests: they are left out, with a note.

    Raises
    ------
    InputError, InputErrors
        Rows that are not of a strut alone, have no stiffness or none that could be; all of them.
    """
    heading, file = table.heading, table.file
    known = ("strut", SERIAL, *LABELS, DATE, "length_mm", *STIFFNESS)
    layouts = "strut,date,stiffness_N_per_mm of struts alone (readings of the tip need no reduction), or raw records"
    check_heading(table, known, (STIFFNESS[0],) if "loop" in heading else ("strut", STIFFNESS[0]), layouts)
    notes = [f"{file}: column {name} is not used" for name in heading if name not in known]

    def strut(line: int, record: dict[str, str]) -> KnownStiffness:
        if _loop_named(record).kind != "alone":
            raise MeasurementError("a row of no strut", expected="strut 1 to 6")
        day_of(record.get(DATE, ""))
        optional_number(record, "length_mm")
        failed = abs(number(record, STIFFNESS[0], (-STIFFEST, STIFFEST))) < SOFTEST
        stiffness = math.nan if failed else n_per_m_from_n_per_mm(number(record, STIFFNESS[0]))
        place, none = {name: record[name] for name in PLACE if record.get(name)}, np.empty(0)
        loop = Loop(place, {}, None, none, none, line, file, record.get(SERIAL, ""))
        return KnownStiffness(loop, stiffness, math.nan if failed else optional_number(record, STIFFNESS[1]))

    struts, errors = parsed_rows(table, strut)
    failed = [row.loop.line for row in struts if math.isnan(row.stiffness)]
    many = f"{len(failed)} of {len(table.rows)} rows with a stiffness within {SOFTEST:g} N/mm of zero"
    if len(failed) > FAILED * len(table.rows):
        first = next(table.record(cells) for line, cells in table.rows if line == failed[0])[STIFFNESS[0]]
        hint = f"is the unit right? At most {100 * FAILED:g} % are left out as failed tests"
        errors.append(MeasurementError(f"{many}, the first {first}", hint=hint, file=file, line=failed[0]))
    elif failed:
        notes.append(f"{file}: {many} are left out as failed tests, from line {failed[0]}")
    if errors:
        raise InputErrors(errors)
    if len(failed) == len(struts):
        raise MeasurementError("no rows below the heading", file=file, line=table.heading_line)
    return [row for row in struts if not math.isnan(row.stiffness)], notes


def _record(line: int, record: dict[str, str]) -> RawRecord:
    """A record with jog (nan on a bench), force, displacement and conditions; without values if it has lost them."""
    if not record.get("jog_um") and any(record.get(name, "").lower() in MISSING for name in READINGS[1:]):
        return RawRecord(line, record, [])
    loop = _loop_named(record)
    day_of(record.get(DATE, ""))
    optional_number(record, "tool_extension_mm")
    optional_number(record, "length_mm")
    on_bench = loop.kind == "alone" and not record.get("jog_um")
    names = (*POSITION, *(angle for angle in ANGLES if angle in record))
    if not on_bench or any(record.get(name) for name in names):
        for name in names:
            number(record, name)
    if not on_bench:
        direction_of(record)
    values = [math.nan if on_bench and name == "jog_um" else _signed(record, name) for name in READINGS]
    values += [optional_number(record, name) for name in CONDITIONS]
    if DATE in record and not record[DATE]:
        raise MeasurementError("no date", expected="one in every record")
    return RawRecord(line, record, values)


def _loop_named(record: dict[str, str]) -> MeasuringLoop:
    """The loop of a record; `strut` 3 is the loop "strut 3 alone", and the record says so afterwards."""
    loop = loop_of(record.get("loop", ""))
    if record.get("strut"):
        strut = measuring_loop(f"strut {record['strut'].lower().removeprefix('strut')} alone")
        if strut is None:
            raise MeasurementError(f"strut {record['strut']!r}", expected="1 to 6")
        if loop not in (TIP, strut):
            raise MeasurementError(f"strut {record['strut']} and loop {loop}", expected="one of them")
        loop = strut
    if loop.kind == "alone":
        record["loop"] = str(loop)
    return loop


def _by_time(records: list[RawRecord]) -> list[list[RawRecord]]:
    """Records of one day by their date-times, if these are of whole loops; a logger's clock that runs on is not."""
    times: dict[str, list[RawRecord]] = {}
    for record in records:
        times.setdefault(record.cells.get(DATE, ""), []).append(record)
    return list(times.values()) if min(map(len, times.values())) >= SHARED else [records]


def _needed(heading: Sequence[str]) -> tuple[str, ...]:
    """Columns that records need; a strut on a bench has neither pose nor jog."""
    stiffnesses = (heading_key(name).startswith("stiff") or same_quantity(unit_of(name), "N/mm") for name in heading)
    if any(stiffnesses) and "displacement_um" not in heading:
        return ("strut", STIFFNESS[0])
    if "loop" in heading:
        return READINGS[1:]
    if "strut" in heading or not any(name in heading for name in (*POSITION, "jog_um")):
        return ("strut", *READINGS[1:])
    angles = ANGLES if any(name in heading for name in ANGLES) else ()
    direction = VECTOR if any(name in heading for name in VECTOR) else ("direction",)
    return (*POSITION, *angles, *direction, *READINGS)


def _signed(record: Mapping[str, str], name: str) -> float:
    if name not in record:
        raise MeasurementError(f"no column {name}", expected="it of all but a strut measured alone")
    try:
        value = float(record[name])
    except ValueError:
        value = math.nan
    if not abs(value) <= SIGNED[name]:
        raise MeasurementError(f"{name} = {record[name]!r}", expected=f"a number within +-{SIGNED[name]:g}")
    return value


def _loop(records: list[RawRecord], file: str) -> Loop:
    line, cells, _ = records[0]
    jog, force, displacement, *conditions = np.array([record.values for record in records]).T
    return Loop(
        place={name: cells[name] for name in PLACE if name in cells},
        conditions={n: float(v.mean()) for n, v in zip(CONDITIONS, conditions, strict=True) if not np.isnan(v).any()},
        jog=None if np.isnan(jog).any() else m_from_um(jog),
        force=force,
        displacement=m_from_um(displacement),
        line=line,
        file=file,
        serial=cells.get(SERIAL, ""),
    )
