"""Raw records of force and displacement: which of them are one loop, what was set step by step, the shape of a loop.

For its shape (kinks with their force and two slopes, tension against compression, work lost) the way from extreme to
extreme is looked at, deflection y over force F from F_0 on. Three shapes are tried beside the straight line, each
with two compliances c and c':

    sticking      y = a + c d + (c' - c) max(d - 2 F_b, 0), d = |F - F_0|: joints stick after the load has turned,
                  until friction breaks away, at twice the breakaway force F_b on the way back (Masing 1926,
                  Proceedings of the 2nd International Congress of Applied Mechanics, 332)
    kink          y = a + c F + (c' - c) sign(F) max(|F| - F_b, 0): contacts that close (stiffer beyond) or slip
    sides         y = a + c max(F, 0) + c' min(F, 0): tension against compression, as a strut that has lost its preload

One of them stands where it fits better than the straight line by an F test (Seber and Lee 2003, Linear Regression
Analysis, 4.2), its probability multiplied by the number of shapes and forces tried (Bonferroni).

Files of raw records: folders, sheets of a workbook, text with any mark or spaces between cells, LabVIEW, JSON.
"""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError, TableError
from toolpath_stiff.files import decoded, read_bytes
from toolpath_stiff.stiffness.effects.contract import TIP, MeasuringLoop, measuring_loop
from toolpath_stiff.tables import (
    SPREADSHEET_ERROR,
    Columns,
    Grid,
    Table,
    grid_table,
    is_workbook,
    read_table,
    sheet_grid,
    sheet_names,
    split_name,
    text_grid,
    typed,
)
from toolpath_stiff.units import m_from_um, n_per_m_from_n_per_mm
from toolpath_stiff.updating.dates import dates_in, day_of, like_date
from toolpath_stiff.updating.raw_labels import STRUT, strut_label
from toolpath_stiff.updating.raw_layouts import MISSING, Rows, Units, is_number, layouts
from toolpath_stiff.updating.rows import (
    ANGLES,
    DATE,
    LABELS,
    POSITION,
    SOFTEST,
    STIFFEST,
    VECTOR,
    direction_of,
    loop_of,
    number,
    optional_number,
)

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
STIFFNESS = ("stiffness_N_per_mm", "strut_force_N")  # of a table of struts that were reduced elsewhere
FAILED = 0.05  # of the rows of such a table: tests that may have failed, near zero; of more the unit is wrong; assumed
COLUMNS = Columns(
    numbers=(*POSITION, *ANGLES, *VECTOR, "tool_extension_mm", "length_mm", *READINGS, *CONDITIONS, *STIFFNESS),
    texts=("direction", *LABELS, DATE, "strut"),
    converted=True,
)
BENCH = "strut,date,force_N,displacement_um of a strut on a bench"
WHICH = "name the strut in a column, above the heading (`strut: 3`) or in the file's name (strut3_2021-09-16.csv)"
SIGNED = {"force_N": 1e7, "displacement_um": 1e6, "jog_um": 1e6}  # largest magnitude, either sign
NEAR_END = 0.02  # of the range of a force set on a bench: records this close are at its extreme, and averaged
SHARED = 3  # records that a date-time needs to stand for a loop of its own
SAME_JOG = 1e-9  # m: jogs this close are the same step
DAY = len("2024-03-31")
MOST = 200  # records of that way that are looked at singly; of more, runs are averaged: a logger's thousands
FEWEST = 7  # records on the way from extreme to extreme from which a shape is looked for
A_SIDE = 3  # records on each side of a kink
POSITIONS = 4  # of a kink tried between two records
RESOLUTION = 0.05e-6  # m, rms that no line is believed to fit better than; assumed: half a step of 0.1 um
SURE = 0.01  # probability below which chance alone is ruled out
NEARER, FARTHER = 0.15, 0.5  # of an extreme, between which lost motion is read; assumed
APART = 0.01  # of the deflection: lost motion that is told of; assumed, as much as a bench's two sides differ
TELLING = 1.15  # ratio of two slopes from which they are told of
READ = (".csv", ".txt", ".dat", ".asc", ".tsv", ".lvm", ".json", ".xlsx", ".xlsm")  # of a folder
OWN_OUTPUT = "_measurements.csv"
COMMENT = re.compile(r"[ \t]*(?:#|%|//)+[ \t]*")
FOREIGN = {
    b"MATLAB": "a MATLAB file", b"\x89HDF": "an HDF5 file (or MATLAB 7.3)", b"TDSm": "a TDMS file",
    b"MDF ": "an MDF file", b"PAR1": "a Parquet file", b"%PDF": "a PDF",
}  # fmt: skip


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
    """

    place: Mapping[str, str]
    conditions: Mapping[str, float]
    jog: FloatArray | None
    force: FloatArray
    displacement: FloatArray
    line: int
    file: str = ""

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
        rest = [self.place[DATE], *rest] if self.place.get(DATE) else rest
        if self.jog is None:
            return ", ".join([*filter(None, [self.place["loop"], self.place.get("point")]), *rest])
        where = self.place.get("point") or ", ".join(self.place[name] for name in POSITION) + " mm"
        way = self.place.get("direction") or "(" + ", ".join(self.place[name] for name in VECTOR) + ")"
        return ", ".join([where, way, *rest])


class RawRecords(NamedTuple):
    """Loops in the order of their first record, and what reading them left to be said."""

    loops: list[Loop]
    notes: list[str]


def read_raw(table: Table) -> RawRecords:
    """Loops of a file of raw records (`tables.read_table` with `COLUMNS`).

    Raises
    ------
    InputError
        Columns are missing or unknown, or there are no records.
    InputErrors
        Bad records, all of them.
    """
    file = table.file
    unused = _check_heading(list(table.heading), file, table.heading_line)
    if DATE not in table.heading:
        _refuse_unnamed_dates(table, unused)
    notes = [f"{file}: column {name} is not used" for name in unused]
    if not table.rows:
        raise MeasurementError("no records below the heading", file=file, line=table.heading_line)
    groups: dict[tuple[str, ...], list[Record]] = {}
    names = [name for name in PLACE if name != DATE and (name in table.heading or name == "loop")]
    errors, lost = [], []
    for line, cells in table.rows:
        try:
            record = table.record(cells)
            if _is_lost(record):
                lost.append(line)
                continue
            values = _values(record)
        except InputError as error:
            errors.append(MeasurementError(error.found, expected=error.expected, hint=error.hint, file=file, line=line))
            continue
        if DATE in record and not record[DATE]:
            errors.append(MeasurementError("no date", expected="one in every record", file=file, line=line))
        key = (*(record.get(name, "") for name in names), record.get(DATE, "")[:DAY])
        groups.setdefault(key, []).append((line, record, values))
    if errors:
        raise InputErrors(errors)
    if lost:
        if not groups:
            raise MeasurementError("no record has both a force and a displacement", file=file, line=lost[0])
        many = f"{len(lost)} records" if len(lost) > 1 else "a record"
        notes.append(f"{file}: {many} without force or displacement passed over, from line {lost[0]}")
    found = [_loop(one, file) for records in groups.values() for one in _by_time(records)]
    return RawRecords(sorted(found, key=lambda loop: loop.line), notes)


def _refuse_unnamed_dates(table: Table, unused: list[str]) -> None:
    """A column of dates by another name: without it the records of all dates would be one loop."""
    for name in unused:
        cells = {row[table.heading.index(name)] for _, row in table.rows if len(row) == len(table.heading)}
        if len(cells) > 1 and all(like_date(cell) for cell in cells):
            raise MeasurementError(
                f"column {name!r} holds several dates, and there is no column date",
                expected="date, so that the records of each are a loop of their own",
                hint=f"rename {name} to date",
                file=table.file,
                line=table.heading_line,
            )


def is_table(table: Table) -> bool:
    """Whether the rows are stiffnesses of struts that were reduced elsewhere."""
    return STIFFNESS[0] in table.heading and "displacement_um" not in table.heading


def read_stiffnesses(table: Table) -> tuple[RawRecords, list[tuple[float, float]]]:
    """Struts alone of a table of stiffnesses: loops without records, and of each N/m and N (nan where not given).

    A few rows with a stiffness near zero are failed tests: they are left out, with a note.

    Raises
    ------
    InputError, InputErrors
        Rows that are not of a strut alone, have no stiffness or none that could be; all of them.
    """
    heading, errors = table.heading, []
    if "strut" not in heading and "loop" not in heading:
        raise MeasurementError(
            "stiffnesses without a column strut",
            expected="strut,date,stiffness_N_per_mm of struts alone, or raw records",
            hint="readings of the tip need no reduction: `tps compare` takes them",
            file=table.file,
            line=table.heading_line,
        )
    known = ("strut", *LABELS, DATE, "length_mm", *STIFFNESS)
    notes = [f"{table.file}: column {name} is not used" for name in heading if name not in known]
    loops, figures, failed = [], [], []
    for line, cells in table.rows:
        try:
            record = table.record(cells)
            if _loop_named(record).kind != "alone":
                raise MeasurementError("a row of no strut", expected="strut 1 to 6")
            day_of(record.get(DATE, ""))
            optional_number(record, "length_mm")
            if abs(number(record, STIFFNESS[0], (-STIFFEST, STIFFEST))) < SOFTEST:
                failed.append((line, record[STIFFNESS[0]]))
                continue
            own = n_per_m_from_n_per_mm(number(record, STIFFNESS[0])), optional_number(record, STIFFNESS[1])
        except InputError as error:
            errors.append(
                MeasurementError(error.found, expected=error.expected, hint=error.hint, file=table.file, line=line)
            )
            continue
        none = np.empty(0)
        place = {name: record[name] for name in PLACE if record.get(name)}
        loops.append(Loop(place, {}, None, none, none, line, table.file))
        figures.append(own)
    many = f"{len(failed)} of {len(table.rows)} rows with a stiffness within {SOFTEST:g} N/mm of zero"
    if len(failed) > FAILED * len(table.rows):
        line, cell = failed[0]
        hint = f"is the unit right? At most {100 * FAILED:g} % are left out as failed tests"
        errors.append(MeasurementError(f"{many}, the first {cell}", hint=hint, file=table.file, line=line))
    elif failed:
        notes.append(f"{table.file}: {many} are left out as failed tests, from line {failed[0][0]}")
    if errors:
        raise InputErrors(errors)
    if not loops:
        raise MeasurementError("no rows below the heading", file=table.file, line=table.heading_line)
    return RawRecords(loops, notes), figures


def _is_lost(record: Mapping[str, str]) -> bool:
    """Whether a record of a bench has lost its force or displacement."""
    return not record.get("jog_um") and any(record.get(name, "").lower() in MISSING for name in READINGS[1:])


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


def _check_heading(heading: list[str], file: str, line: int) -> list[str]:
    """Columns that are not used. Raises `InputError` at the first thing that is wrong."""
    known = (*PLACE, *READINGS, *CONDITIONS, "strut")
    unused = [name for name in heading if name and name not in known]
    _refuse_missing(heading, unused, file, line)
    for name in heading:
        if heading.count(name) > 1:
            raise MeasurementError(f"column {name} stands twice", file=file, line=line)
    for name in unused:
        near = next(iter(difflib.get_close_matches(name, known, n=1, cutoff=0.75)), None)
        if near and near not in heading:
            hint = f"did you mean {near}? Otherwise give it another name"
            raise MeasurementError(f"unknown column {name!r}", hint=hint, file=file, line=line)
    if "direction" in heading and any(name in heading for name in VECTOR):
        raise MeasurementError("two directions", expected="direction, or dx,dy,dz", file=file, line=line)
    return unused


def _refuse_missing(heading: list[str], unused: list[str], file: str, line: int) -> None:
    """Raise `InputError` for the first column that is needed and not there."""
    vector = "direction" not in heading
    angles = ANGLES if any(name in heading for name in ANGLES) else ()
    asked = (*POSITION, *angles, *(VECTOR if vector else ("direction",)), *READINGS)
    bench = "strut" in heading or "loop" in heading  # has neither pose nor jog; others say so by record
    if bench or not any(name in heading for name in (*POSITION, "jog_um")):
        asked = (*(() if bench else ("strut",)), *READINGS[1:])
    name = next((name for name in asked if name not in heading), None)
    if name is None:
        return
    near = next(iter(difflib.get_close_matches(name, unused, n=1, cutoff=0.85)), None)
    raise MeasurementError(
        "no direction" if vector and name in VECTOR else f"column {name} is missing",
        expected=f"x_mm,y_mm,z_mm,direction,{','.join(READINGS)}, or {BENCH}",
        hint=f"is it {near!r}?" if near else _to_do(name, unused),
        file=file,
        line=line,
    )


def _to_do(missing: str, unused: list[str]) -> str:
    """What to do about a missing column."""
    parts = [WHICH] if missing == "strut" else []
    if unused:
        parts.append(f"{', '.join(repr(name) for name in unused)} are not known: rename what is meant")
    return "; ".join(parts)


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


def _loop(records: list[Record], file: str) -> Loop:
    line, record, _ = records[0]
    jog, force, displacement, *conditions = np.array([values for _, _, values in records]).T
    return Loop(
        place={name: record[name] for name in PLACE if name in record},
        conditions={n: float(v.mean()) for n, v in zip(CONDITIONS, conditions, strict=True) if not np.isnan(v).any()},
        jog=None if np.isnan(jog).any() else m_from_um(jog),
        force=force,
        displacement=m_from_um(displacement),
        line=line,
        file=file,
    )


@dataclass(frozen=True)
class Shape:
    """What stands out of a straight line. SI; nan where nothing does.

    Attributes
    ----------
    kind
        "sticking", "kink", "sides", or "" where a straight line will do.
    force
        N, the breakaway force, or where the kink is; nan of sides.
    first, second
        N/m: below and above that force; under tension (positive force) and compression.
    lost
        J, the work that the loop takes and does not give back: the area that its records enclose.
    """

    kind: str = ""
    force: float = np.nan
    first: float = np.nan
    second: float = np.nan
    lost: float = np.nan

    def __str__(self) -> str:
        """A sentence with N and N/mm; "" where a straight line will do."""
        one, other = (f"{1e-3 * slope:,.0f} N/mm" for slope in (self.first, self.second))
        if self.kind == "sticking":
            return (
                f"sticks after the load has turned and breaks away at {self.force:.3g} N: {one} before, {other} after"
            )
        if self.kind == "kink":
            what = "closes" if self.first < self.second else "slips"
            return f"{what} at {self.force:.3g} N: {one} below, {other} above"
        if self.kind == "sides":
            side = "softer" if self.first < self.second else "stiffer"
            return f"{side} in tension than in compression: {one} against {other}"
        return ""


def shape_of(force: FloatArray, deflection: FloatArray, ways: Sequence[slice], width: float = 0.0) -> Shape:
    """The shape of a loop.

    Parameters
    ----------
    force, deflection
        (m,) N and m, the records in their order; tension is positive.
    ways
        The way from extreme to extreme; of a closed cycle the way back as well, which tells friction, where both ways
        curve apart, from two sides or a kink, where they go together.
    width
        m, of the loop. Of one way alone, sides that differ by less are not told of.
    """
    lost = _work_lost(force, deflection)
    f, y, which = _averaged(force, deflection, ways)
    if len(f) < FEWEST or f.max() <= 0.0 or f.min() >= 0.0:
        return Shape(lost=lost)
    constants = [(which == i).astype(float) for i in range(len(ways))]
    tried = [("sides", np.nan, np.maximum(f, 0.0), np.minimum(f, 0.0)), *_sticking(f, which), *_kinks(f)]
    of_sides: Shape | None = None
    straight = _left([f], y, constants)[0]
    best, chance, squares = Shape(lost=lost), SURE, {"": straight}
    least: dict[str, float] = {}
    for kind, at, one, other in tried:
        left, found_slopes = _left([one, other], y, constants)
        first, second = found_slopes[-2:]
        slopes = (abs(1.0 / first), abs(1.0 / second)) if first * second > 0.0 else (0.0, 0.0)
        if left >= least.get(kind, np.inf) or not max(slopes) >= TELLING * min(slopes) > 0.0:
            continue  # of one kind, what leaves more is the likelier chance
        apart = abs(first - second) * min(float(f.max()), -float(f.min()))
        if kind == "sides" and len(ways) == 1 and apart < width:
            continue
        least[kind] = left
        # A kink's force is fitted, too: one more figure than its two slopes.
        more = 1 if kind == "sides" else 2
        found = _chance(straight, left, more, len(f) - len(ways) - 1 - more) * len(tried)
        if found < chance:
            best, chance, squares[kind] = Shape(kind, at, slopes[0], slopes[1], lost), found, left
            of_sides = best if kind == "sides" else of_sides
    # On one way alone, sticking that breaks away near zero force looks like two sides, which has no force to fit.
    if of_sides is not None and best is not of_sides:
        gain = _chance(squares["sides"], squares[best.kind], 1, len(f) - len(ways) - 3) * len(tried)
        best = best if gain < SURE else of_sides
    return best


def sides_of(force: FloatArray, deflection: FloatArray, drift: bool = False, gap: bool = False) -> tuple[float, float]:
    """Stiffness in N/m under tension (positive force) and under compression; nan without `A_SIDE` records of both.

    Slopes of two straight lines that meet at zero force, by least squares over all records; with `drift`, of closed
    cycles, beside a deflection that goes on steadily from record to record; with `gap`, of those beyond it, beside a
    jump at zero force.
    """
    if min(len(np.unique(force[force > 0.0])), len(np.unique(force[force < 0.0]))) < A_SIDE:
        return np.nan, np.nan
    order = np.arange(len(force), dtype=float)
    if gap:  # nobody knows to which side of it a record within belongs
        beyond = (force >= NEARER * force.max()) | (force <= NEARER * force.min())
        force, deflection, order = force[beyond], deflection[beyond], order[beyond]
    others = [np.ones_like(force)] + [order] * drift + [np.sign(force)] * gap
    pulled, pushed = _left([np.maximum(force, 0.0), np.minimum(force, 0.0)], deflection, others)[1][-2:]
    return (1.0 / float(pulled), 1.0 / float(pushed)) if min(pulled, pushed) > 0.0 else (np.nan, np.nan)


class Play(NamedTuple):
    """Lost motion of closed cycles in m, nan without records of both sides, and whether it is more than chance."""

    size: float
    shown: bool


def play_of(force: FloatArray, deflection: FloatArray, way: FloatArray) -> Play:
    """How far the straight lines of the two sides stand apart at zero force, read just beyond a gap that has closed.

    The lines lie between `NEARER` and `FARTHER` of each extreme: closer in a gap may still be open, farther out joints
    that stick after the turn make both sides stiffer, which looks like a gap. Friction moves the two ways apart by an
    even function of the force (Masing 1926): a constant and a square are fitted beside the lines, and a steady drift.
    Shown is what an F test at 1 % finds and what is `APART` of the deflection, as less does not blur a stiffness.

    Parameters
    ----------
    force, deflection, way
        (m,) N, tension positive; m; 1 and -1 on successive ways from extreme to extreme.
    """
    high, low = float(force.max()), float(force.min())
    share = np.where(force > 0.0, force / high, force / low) if low < 0.0 < high else np.zeros_like(force)
    inside = (share >= NEARER) & (share <= FARTHER)
    f, y = force[inside], deflection[inside]
    if min(len(np.unique(f[f > 0.0])), len(np.unique(f[f < 0.0]))) < A_SIDE:
        return Play(np.nan, False)
    lines = [np.maximum(f, 0.0), np.minimum(f, 0.0)]
    friction = way[inside, None] * np.stack([np.ones_like(f), f**2], axis=1)
    others = [np.ones_like(f), np.flatnonzero(inside).astype(float), *friction.T]
    before = _left(lines, y, others)[0]
    after, found = _left([np.sign(f), *lines], y, others)
    size = 2.0 * float(found[-3])
    telling = size >= APART * float(np.ptp(deflection))
    return Play(size, telling and _chance(before, after, 1, len(f) - len(others) - 3) < SURE)


def _averaged(
    force: FloatArray, deflection: FloatArray, ways: Sequence[slice]
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Force, deflection and number of its way, at most `MOST` values of all ways, means of runs."""
    most = MOST // len(ways)
    found: list[list[FloatArray]] = []
    for way in ways:
        both = [force[way], deflection[way]]
        if len(both[0]) > most:
            both = [np.array([run.mean() for run in np.array_split(one, most)]) for one in both]
        found.append(both)
    which = np.repeat(np.arange(len(ways)), [len(one) for one, _ in found])
    return np.concatenate([one for one, _ in found]), np.concatenate([other for _, other in found]), which


Tried = tuple[str, float, FloatArray, FloatArray]


def _sticking(force: FloatArray, which: NDArray[np.int64]) -> list[Tried]:
    """Kinks on the ways back from an extreme: what lies before them, and after them."""
    starts = np.array([force[which == i][0] for i in range(which[-1] + 1)])
    ends = np.array([force[which == i][-1] for i in range(which[-1] + 1)])
    sign = np.sign(ends - starts)[which]
    way = np.abs(force - starts[which])
    steps = np.sort(way)
    forces = _between(np.unique(steps[A_SIDE - 1 : 1 - A_SIDE]))
    return [("sticking", 0.5 * at, sign * np.minimum(way, at), sign * np.maximum(way - at, 0.0)) for at in forces]


def _kinks(force: FloatArray) -> list[Tried]:
    """Kinks alike on both sides of zero: what lies below them, and above them."""
    found: list[Tried] = []
    for at in _between(np.unique(np.abs(force))):
        below = np.clip(force, -at, at)
        if min((np.abs(force) < at).sum(), (np.abs(force) > at).sum()) >= A_SIDE:
            found.append(("kink", at, below, force - below))
    return found


def _between(steps: FloatArray) -> list[float]:
    """Forces between rising steps, `POSITIONS` in each gap: a kink seldom lies where a record was taken."""
    shares = (np.arange(POSITIONS) + 0.5) / POSITIONS
    return sorted({float(at) for at in (steps[:-1, None] + np.diff(steps)[:, None] * shares).ravel()})


def _left(columns: list[FloatArray], y: FloatArray, others: list[FloatArray]) -> tuple[float, FloatArray]:
    """Squares that least squares leave beside the others, and the coefficients, theirs first."""
    design = np.stack([*others, *columns], axis=1)
    scale = np.abs(design).max(axis=0)
    found = np.linalg.lstsq(design / scale, y, rcond=None)[0] / scale
    return float(((y - design @ found) ** 2).sum()), found


def _chance(before: float, after: float, more: int, freedom: int) -> float:
    """Probability that so large a fall of the squares is chance."""
    from scipy.special import fdtrc

    if freedom < 1 or before <= after:
        return 1.0
    after = max(after, freedom * RESOLUTION**2)
    return float(fdtrc(more, freedom, max(before - after, 0.0) / more / (after / freedom)))


def _work_lost(force: FloatArray, deflection: FloatArray) -> float:
    """Area that the records enclose, the last joined to the first (Gauss's formula)."""
    if len(force) < 4:
        return float("nan")
    return float(abs(0.5 * (force * np.roll(deflection, -1) - np.roll(force, -1) * deflection).sum()))


def raw_tables(names: Sequence[str], columns: Columns, units: Units) -> list[Table]:
    """Tables of raw records of files and folders, every sheet of a workbook, every block of a sheet.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read, or its cells can be read in two ways; a folder without one.
    """
    return [table for name in names for file in _files(name) for table in _file_tables(file, columns, units)]


def _files(name: str) -> list[str]:
    """A file, or those of a folder and the folders in it, in the order of their names."""
    if not Path(name).is_dir():
        return [name]
    found = sorted(p for p in Path(name).rglob("*") if p.suffix.lower() in READ and not p.name.startswith((".", "~")))
    files = [str(path) for path in found if path.is_file() and not path.name.endswith(OWN_OUTPUT)]
    if not files:
        raise TableError("a folder without records", expected=f"files {', '.join(READ)}", file=name)
    return files


def _file_tables(path: str, columns: Columns, units: Units) -> list[Table]:
    workbook, sheet = split_name(path)
    content = read_bytes(workbook, "raw records")
    for start, what in FOREIGN.items():
        if content.startswith(start):
            raise TableError(what, expected="text, JSON or .xlsx", hint="export the channels as CSV", file=path)
    found: list[Table] = []
    if is_workbook(content):
        names = [sheet] if sheet else sheet_names(content, workbook)
        passed = []
        for name in names:
            told = len(names) > 1 or sheet or STRUT.search(name) or dates_in(name) or strut_label(name)
            grid = sheet_grid(content, workbook, name)
            own = layouts(grid, f"{workbook}#{name}" if told else path, columns, units)
            found += own
            passed += [] if own else [name]
        if found and passed:
            notes = (f"{workbook}: no records in the sheets {', '.join(passed)}", *found[0].notes)
            found[0] = replace(found[0], notes=notes)
        return found or [read_table(path, "raw records", columns)]
    text = decoded(content)
    if text.lstrip().startswith(("{", "[")):
        return _json_tables(text, path, columns, units)
    grid, comments = _text_cells(text, path, columns)
    return layouts(grid, path, columns, units, comments) or [_whole(grid, comments, path, columns)]


def _whole(grid: Grid, comments: frozenset[int], path: str, columns: Columns) -> Table:
    """A table of no layout of a bench; its comments are none of it."""
    return grid_table(replace(grid, rows=[row for row in grid.rows if row[0] not in comments]), path, columns)


def _text_cells(text: str, path: str, columns: Columns) -> tuple[Grid, frozenset[int]]:
    """Cells of a text file, and which lines were comments: these without their mark, but no numbers put aside so."""
    lines, comments = text.splitlines(), set()
    for i, line in enumerate(lines):
        mark = COMMENT.match(line)
        if mark and not SPREADSHEET_ERROR.match(line.strip()):
            rest = line[mark.end() :]
            lines[i] = "" if re.match(r"[+-]?[\d.]", rest) else rest.replace('"', "")
            comments.add(i + 1)
    filled = [line for line in lines if line.strip()]
    # A mark in most lines that cannot stand in a number; commas can.
    usual = (mark for mark in ";\t" if sum(mark in line for line in filled) > 0.5 * len(filled))
    declared = re.match(r"\ufeff?sep=", text, re.IGNORECASE)
    separator = "" if declared else next(usual, "")
    grid = _by_spaces(lines) or text_grid("\n".join(lines), path, columns, separator)
    return grid, frozenset(comments)


def _by_spaces(lines: Sequence[str]) -> Grid | None:
    """Cells of a text with columns of a fixed width, or with spaces between them; None of any other."""
    parted = [line.split() for line in lines]
    numbers = [sum(is_number(c.replace(",", ".")) and c[-1] not in ",;" for c in cells) for cells in parted]
    rows = [i for i, n in enumerate(numbers) if n >= 2 and not re.search(r"[;\t]", lines[i].strip())]
    filled = sum(bool(line.strip()) for line in lines)
    if not rows or len(rows) < 0.5 * filled:
        return None
    width = len(parted[rows[0]])
    found: Rows = []
    for i, line in enumerate(lines):
        wide = re.split(r" {2,}|\t", line.strip())
        cells = parted[i] if numbers[i] >= 2 or (len(parted[i]) == width and len(wide) != width) else wide
        if line.strip():
            found.append((i + 1, [typed(cell) for cell in cells]))
    return Grid(found, " ")


def _json_tables(text: str, path: str, columns: Columns, units: Units) -> list[Table]:
    """Records of JSON: lists of them, or columns as lists, at any depth; names above them count as their head."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TableError(f"no JSON: {error}", file=path) from None
    found: list[Table] = []
    for above, heading, rows in _json_blocks(document, []):
        head = [(0, [line]) for line in above]
        body = [(n, [_json_cell(cell) for cell in row]) for n, row in enumerate(rows, 1)]
        found += layouts(Grid([*head, (0, heading), *body], ""), path, columns, units)
    if not found:
        expected = "records or columns named strut, date, force_N, displacement_um"
        raise TableError("JSON without records", expected=expected, file=path)
    return found


def _json_cell(value: object) -> str:
    return "" if value is None else str(value)


def _json_blocks(value: Any, above: list[str]) -> Iterator[tuple[list[str], list[str], list[list[Any]]]]:
    """Head, heading and rows of every table within a value."""
    if isinstance(value, list):
        if value and all(isinstance(one, dict) and not _holds_more(one) for one in value):
            heading = list(dict.fromkeys(key for one in value for key in one))
            yield above, heading, [[one.get(key) for key in heading] for one in value]
        else:
            for one in value:
                yield from _json_blocks(one, above)
    elif isinstance(value, dict):
        yield from _json_columns(value, above)


def _json_columns(value: dict[str, Any], above: list[str]) -> Iterator[tuple[list[str], list[str], list[list[Any]]]]:
    """The same of an object: lists of one length are the columns of a table."""
    plain = [f"{key}: {one}" for key, one in value.items() if not isinstance(one, dict | list)]
    lists = {k: one for k, one in value.items() if isinstance(one, list) and one and not _holds_more({k: one[0]})}
    if len(lists) > 1 and len({len(one) for one in lists.values()}) == 1:
        yield [*above, *plain], list(lists), [list(row) for row in zip(*lists.values(), strict=True)]
        return
    for key, one in value.items():
        if isinstance(one, dict | list):
            yield from _json_blocks(one, [*above, *plain, _json_head(key)])


def _holds_more(value: Mapping[str, Any]) -> bool:
    return any(isinstance(one, dict | list) for one in value.values())


def _json_head(key: str) -> str:
    """The name of a part as a line of a head."""
    if strut_label(key) and not STRUT.search(key):
        return f"strut {strut_label(key)}"
    return f"date: {key}" if dates_in(key) else key
