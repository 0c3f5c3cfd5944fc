"""Raw records of force and displacement: reading them, grouping them into loops, finding what was set in steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.loops import loop_of
from toolpath_stiff.readings.mapping import DATE, check_needed, unused
from toolpath_stiff.readings.rows import (
    ANGLES,
    LABELS,
    POSITION,
    VECTOR,
    direction_of,
    number,
    optional_number,
    parsed_rows,
    refuse_pulls,
)
from toolpath_stiff.stiffness.measuring_loop import TIP, MeasuringLoop, measuring_loop
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_um

READINGS = ("jog_um", "force_N", "displacement_um")
LARGEST = (-1e7, 1e7)  # bounds of each number
STIFFNESS = ("stiffness_N_per_mm", "strut_force_N")  # of a table of struts that were reduced elsewhere
# Columns that the records of a loop share.
PLACE = (*POSITION, *ANGLES, "direction", *VECTOR, *LABELS, "tool_extension_mm", "length_mm", DATE)
COLUMNS = Columns(
    numbers=(*POSITION, *ANGLES, *VECTOR, "tool_extension_mm", "length_mm", *READINGS, *STIFFNESS),
    texts=("direction", *LABELS, DATE, "strut"),
)
LOST = ("", "-", "nan", "n/a")  # cells of a lost reading
LAYOUTS = (
    "x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um, or strut,date,force_N,displacement_um of a strut on a "
    "bench, or strut,date,stiffness_N_per_mm of struts alone"
)
ONE_SIDE = 0.05  # share of the range: a bench force that reaches less far to the other side is one-sided
NEAR_END = 0.02  # share of the range of a bench force: records this close to its extreme are averaged there
SAME_JOG = 1e-9  # m: jogs this close are the same step
DAY = len("2024-03-31")

Record = tuple[int, dict[str, str], list[float]]  # line, cells, `READINGS`


@dataclass(frozen=True)
class Loop:
    """One test, its records in the order taken. SI.

    Attributes
    ----------
    place
        Column -> text of what the records have in common: pose, direction, labels.
    jog, force, displacement
        (m,) m, N, m, along the direction. `jog` is None of a strut on a bench.
    line, file
        Line of the first record, and of which file.
    """

    place: Mapping[str, str]
    jog: FloatArray | None
    force: FloatArray
    displacement: FloatArray
    line: int
    file: str = ""

    @property
    def deflection(self) -> FloatArray:
        """(m,) m, give of the machine: jog less displacement; on a bench the displacement itself."""
        return self.displacement if self.jog is None else self.jog - self.displacement

    @property
    def drive(self) -> FloatArray:
        """(m,) quantity set step by step: the jog in m; on a bench the force in N."""
        return self.force if self.jog is None else self.jog

    @property
    def same(self) -> float:
        """Largest difference in `drive` between records of one step."""
        return NEAR_END * float(np.ptp(self.force)) if self.jog is None else SAME_JOG

    @property
    def strut(self) -> str:
        """Strut measured alone, as "strut 3 alone"."""
        return self.place.get("loop", "")

    @property
    def date(self) -> str:
        """Date as in the file; "" if there is none."""
        return self.place.get(DATE, "")

    @property
    def side(self) -> float:
        """1 for a bench record under tension alone, -1 under compression alone, 0 for any other loop."""
        if self.jog is not None or not len(self.force):
            return 0.0
        least = ONE_SIDE * float(np.ptp(self.force))
        return 1.0 if self.force.min() >= -least else -1.0 if self.force.max() <= least else 0.0

    def part(self, records: slice) -> Loop:
        """The test with some of its records only."""
        jog = None if self.jog is None else self.jog[records]
        return replace(self, jog=jog, force=self.force[records], displacement=self.displacement[records])

    @property
    def title(self) -> str:
        """Point or position, direction, set-up, repeat, as far as known."""
        rest = [f"{name} {self.place[name]}" for name in ("setup", "clamp", "repeat") if self.place.get(name)]
        where, way = self.strut, self.place.get("point", "")
        if self.jog is not None:
            where = way or ", ".join(self.place[name] for name in POSITION) + " mm"
            way = self.place.get("direction") or "(" + ", ".join(self.place[name] for name in VECTOR) + ")"
        return ", ".join(filter(None, [where, way, self.date, *rest]))


def read_raw(table: Table) -> tuple[list[Loop], list[str]]:
    """Loops of a file of raw records (`tables.read_table` with `COLUMNS`), in order of first record; and remarks.

    Raises
    ------
    InputError
        Columns are missing or unknown, or there are no records.
    InputErrors
        Bad records, all of them.
    """
    refuse_pulls(table)
    check_needed(table, _needed(table.heading), LAYOUTS)
    parsed, errors = parsed_rows(table, _record)
    if errors:
        raise InputErrors(errors)
    groups: dict[tuple[str, ...], list[Record]] = {}
    lost = []
    for line, cells, values in parsed:
        key = (*(cells.get(name, "") for name in PLACE if name != DATE), cells.get(DATE, "")[:DAY])
        if values:
            groups.setdefault(key, []).append((line, cells, values))
        else:
            lost.append(line)
    if not groups:
        fault = "no records below the heading with a force and a displacement"
        raise MeasurementError(fault, file=table.file, line=table.heading_line)
    notes = unused(table, (*PLACE, *READINGS, "strut"))
    if lost:
        fault = f"{len(lost)} records without force or displacement are skipped, from line {lost[0]}"
        notes.append(f"{table.file}: {fault}")
    loops = [_loop(group, table.file) for group in groups.values()]
    return sorted(loops, key=lambda loop: loop.line), notes


def _needed(heading: Sequence[str]) -> tuple[str, ...]:
    """Columns that records need; a strut on a bench has neither pose nor jog."""
    if "loop" in heading:
        return READINGS[1:]
    if "strut" in heading or not any(name in heading for name in (*POSITION, "jog_um")):
        return ("strut", *READINGS[1:])
    angles = ANGLES if any(name in heading for name in ANGLES) else ()
    direction = VECTOR if any(name in heading for name in VECTOR) else ("direction",)
    return (*POSITION, *angles, *direction, *READINGS)


def _record(line: int, record: dict[str, str]) -> Record:
    """Record with jog (nan on a bench), force and displacement; without values if they were lost."""
    if not record.get("jog_um") and any(record.get(name, "").lower() in LOST for name in READINGS[1:]):
        return line, record, []
    on_bench = strut_or_loop(record).kind == "alone" and not record.get("jog_um")
    if not on_bench:
        for name in (*POSITION, *(angle for angle in ANGLES if angle in record)):
            number(record, name)
        direction_of(record)
    values = [math.nan if on_bench and name == "jog_um" else number(record, name, LARGEST) for name in READINGS]
    return line, record, values


def strut_or_loop(record: dict[str, str]) -> MeasuringLoop:
    """Loop of a record; `strut` 3 becomes the loop "strut 3 alone", also in the record.

    Raises `InputError` for no such strut, and for a date or a length that is none.
    """
    day_of(record.get(DATE, ""))
    if record.get(DATE) == "":
        raise MeasurementError("no date", expected="one in every row")
    for name in ("tool_extension_mm", "length_mm"):
        optional_number(record, name)
    loop = loop_of(record.get("loop", ""))
    if record.get("strut"):
        strut = measuring_loop(f"strut {record['strut'].lower().removeprefix('strut')} alone")
        if strut is None or loop not in (TIP, strut):
            raise MeasurementError(f"strut {record['strut']!r}", expected="1 to 6, and no other loop")
        loop = strut
    if loop.kind == "alone":
        record["loop"] = str(loop)
    return loop


def _loop(records: list[Record], file: str) -> Loop:
    line, cells, _ = records[0]
    jog, force, displacement = np.array([values for _, _, values in records]).T
    return Loop(
        place={name: cells[name] for name in PLACE if name in cells},
        jog=None if np.isnan(jog).any() else m_from_um(jog),
        force=force,
        displacement=m_from_um(displacement),
        line=line,
        file=file,
    )
