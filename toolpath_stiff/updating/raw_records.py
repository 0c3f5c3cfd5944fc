"""Raw records of force and displacement, read: which of them are one loop, and what was set step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.stiffness.effects.measuring_loop import TIP, MeasuringLoop, measuring_loop
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_um
from toolpath_stiff.updating.dates import day_of
from toolpath_stiff.updating.loops import loop_of
from toolpath_stiff.updating.rows import (
    ANGLES,
    DATE,
    LABELS,
    POSITION,
    VECTOR,
    direction_of,
    number,
    optional_number,
)

FloatArray = NDArray[np.float64]
Record = tuple[int, dict[str, str], list[float]]  # line, cells, readings and conditions

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
COLUMNS = Columns(
    numbers=(*POSITION, *ANGLES, *VECTOR, "tool_extension_mm", "length_mm", *READINGS, *CONDITIONS),
    texts=("direction", *LABELS, DATE, "strut"),
)
SIGNED = {"force_N": 1e7, "displacement_um": 1e6, "jog_um": 1e6}  # largest magnitude, either sign
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
    line
        Line of the first record.
    """

    place: Mapping[str, str]
    conditions: Mapping[str, float]
    jog: FloatArray | None
    force: FloatArray
    displacement: FloatArray
    line: int

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

    def part(self, records: slice) -> Loop:
        """The same test, of some of its records."""
        jog = None if self.jog is None else self.jog[records]
        return replace(self, jog=jog, force=self.force[records], displacement=self.displacement[records])

    @property
    def title(self) -> str:
        """Point or position, direction, set-up, repeat: whatever is there."""
        rest = [f"{name} {self.place[name]}" for name in ("setup", "clamp", "repeat") if self.place.get(name)]
        rest = [self.place[DATE], *rest] if self.place.get(DATE) else rest
        if self.jog is None:
            return ", ".join([*filter(None, [self.place["loop"], self.place.get("point")]), *rest])
        where = self.place.get("point") or ", ".join(self.place[name] for name in POSITION) + " mm"
        way = self.place.get("direction") or "(" + ", ".join(self.place[name] for name in VECTOR) + ")"
        return ", ".join([where, way, *rest])


def read_raw(table: Table) -> list[Loop]:
    """Loops of a file of raw records (`tables.read_table` with `COLUMNS`), in the order of their first record.

    Raises
    ------
    InputError
        Columns are missing or unknown, or there are no records.
    InputErrors
        Bad records, all of them.
    """
    file = table.file
    _check_heading(list(table.heading), file, table.heading_line)
    if not table.rows:
        raise MeasurementError("no records below the heading", file=file, line=table.heading_line)
    groups: dict[tuple[str, ...], list[Record]] = {}
    errors = []
    for line, cells in table.rows:
        try:
            record = table.record(cells)
            values = _values(record)
        except InputError as error:
            errors.append(MeasurementError(error.found, expected=error.expected, hint=error.hint, file=file, line=line))
            continue
        if DATE in record and not record[DATE]:
            errors.append(MeasurementError("no date", expected="one in every record", file=file, line=line))
        key = (*(record.get(name, "") for name in PLACE if name != DATE), record.get(DATE, "")[:DAY])
        groups.setdefault(key, []).append((line, record, values))
    if errors:
        raise InputErrors(errors)
    found = [_loop(one) for records in groups.values() for one in _by_time(records)]
    return sorted(found, key=lambda loop: loop.line)


def _values(record: dict[str, str]) -> list[float]:
    """Jog (nan on a bench), force, displacement, conditions of a record; names its strut. Raises `InputError`."""
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
    return values + [optional_number(record, name) for name in CONDITIONS]


def _loop_named(record: dict[str, str]) -> MeasuringLoop:
    """The loop of a record; `strut` 3 is the loop "strut 3 alone", and the record says so afterwards."""
    loop = loop_of(record.get("loop", ""))
    if record.get("strut"):
        own = measuring_loop(f"strut {record['strut'].lower().removeprefix('strut')} alone")
        if own is None:
            raise MeasurementError(f"strut {record['strut']!r}", expected="1 to 6")
        if loop not in (TIP, own):
            raise MeasurementError(f"strut {record['strut']} and loop {loop}", expected="one of them")
        loop = own
    if loop.kind == "alone":
        record["loop"] = str(loop)
    return loop


def _by_time(records: list[Record]) -> list[list[Record]]:
    """Records of one day by their date-times, if these are of whole loops; a logger's clock that runs on is not."""
    times: dict[str, list[Record]] = {}
    for one in records:
        times.setdefault(one[1].get(DATE, ""), []).append(one)
    return list(times.values()) if min(map(len, times.values())) >= SHARED else [records]


def _check_heading(heading: list[str], file: str, line: int) -> None:
    for name in heading:
        if name not in (*PLACE, *READINGS, *CONDITIONS, "strut"):
            raise MeasurementError(
                f"unknown column {name!r}",
                expected=f"some of {', '.join((*PLACE, *READINGS, *CONDITIONS))}",
                file=file,
                line=line,
            )
        if heading.count(name) > 1:
            raise MeasurementError(f"column {name} stands twice", file=file, line=line)
    vector = "direction" not in heading
    angles = ANGLES if any(name in heading for name in ANGLES) else ()
    asked = (*POSITION, *angles, *(VECTOR if vector else ("direction",)), *READINGS)
    if "strut" in heading or "loop" in heading:  # a strut on a bench has neither pose nor jog; others say so by record
        asked = READINGS[1:]
    for name in asked:
        if name not in heading:
            found = "no direction" if vector and name in VECTOR else f"column {name} is missing"
            raise MeasurementError(
                found, expected=f"x_mm,y_mm,z_mm,direction,{','.join(READINGS)}", file=file, line=line
            )
    if not vector and any(name in heading for name in VECTOR):
        raise MeasurementError("two directions", expected="direction, or dx,dy,dz", file=file, line=line)


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


def _loop(records: list[Record]) -> Loop:
    line, record, _ = records[0]
    jog, force, displacement, *conditions = np.array([values for _, _, values in records]).T
    return Loop(
        place={name: record[name] for name in PLACE if name in record},
        conditions={n: float(v.mean()) for n, v in zip(CONDITIONS, conditions, strict=True) if not np.isnan(v).any()},
        jog=None if np.isnan(jog).any() else m_from_um(jog),
        force=force,
        displacement=m_from_um(displacement),
        line=line,
    )
