"""Rows of a measurement file: one measured stiffness each, every cell read and judged, in SI.

A file is either long (one row a reading) or wide like the paper's Table 1 (one row a point, `measured_x_N_per_mm` and
so on). A bad row is named with its line; all bad rows of a file are reported together.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.loops import loop_of
from toolpath_stiff.readings.mapping import DATE, check_heading
from toolpath_stiff.stiffness.measuring_loop import TIP, MeasuringLoop
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_mm, m_from_um, n_per_m_from_n_per_mm, rad_from_deg

Parsed = TypeVar("Parsed")


LOOP_COLUMNS = ("sd_um", "strut_force_N", "length_mm")  # of a measurement file, for loops beside the tip alone


AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


POSITION = ("x_mm", "y_mm", "z_mm")


ANGLES = ("a_deg", "b_deg", "c_deg")


VECTOR = ("dx", "dy", "dz")


LABELS = ("setup", "clamp", "repeat", "point", "loop")


WIDE = tuple(f"measured_{axis}_N_per_mm" for axis in "xyz")


WIDE_MODEL = tuple(f"modeled_{axis}_N_per_mm" for axis in "xyz")


OPTIONAL = ("force_N", "sd_N_per_mm", *LABELS, "time_min", "tool_extension_mm", "temperature_C")


COLUMNS = Columns(
    numbers=(
        *POSITION, *ANGLES, *VECTOR, "stiffness_N_per_mm", "displacement_um", "force_N", "sd_N_per_mm", "time_min",
        "tool_extension_mm", "temperature_C", *LOOP_COLUMNS, *WIDE, *WIDE_MODEL,
    ),
    texts=("direction", *LABELS, DATE),
)  # fmt: skip


KNOWN = (
    *POSITION, *ANGLES, "direction", *VECTOR, "stiffness_N_per_mm", "displacement_um", *OPTIONAL, DATE,
    *LOOP_COLUMNS,
)  # fmt: skip


# N/mm: no machine is softer than 0.1 N/um or stiffer than 10 kN/um; beyond, the unit is not N/mm.
SOFTEST, STIFFEST = 1e2, 1e7


BOUNDS = {
    **dict.fromkeys((*POSITION, "tool_extension_mm"), (-1e5, 1e5)),
    **dict.fromkeys(ANGLES, (-360.0, 360.0)),
    **dict.fromkeys(("stiffness_N_per_mm", *WIDE), (SOFTEST, STIFFEST)),
    "sd_N_per_mm": (1e-6, STIFFEST),
    "force_N": (1e-3, 1e7),
    "displacement_um": (1e-3, 1e6),
    "time_min": (0.0, 1e6),
    "temperature_C": (-50.0, 200.0),
    "sd_um": (1e-4, 1e4),
    "strut_force_N": (-1e7, 1e7),
    "length_mm": (1.0, 1e5),
}


# Of a loop beside the tip, which may read nothing, or backwards.
LOOP_BOUNDS = {"stiffness_N_per_mm": (-1e12, 1e12), "displacement_um": (-1e6, 1e6)}


LEAST_FORCE = 1e-3  # N, of either sign


SOFTEST_ALONE, STIFFEST_ALONE = 1e5, 1e10  # N/mm; beyond, the unit of a strut measured alone is wrong


LIKE_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


AGREEMENT = 0.01  # a stiffness printed beside force and displacement must be their quotient, rounding allowed


@dataclass(frozen=True)
class Row:
    """One reading. SI; a cell that is absent or empty is nan or "".

    Attributes
    ----------
    position, angles
        m; roll, pitch, yaw in rad.
    direction
        Unit vector of force and displacement.
    force
        N, nan if not given.
    sd
        N/m; of a loop beside the tip m/N.
    time, temperature, tool_extension
        s, degrees C, m.
    labels
        `LABELS` -> text; `loop` by its own name, "" for the tip's.
    file, line
        Where it was read.
    extra
        Further numeric columns, as they stand.
    date
        As in the file; a date of ISO 8601.
    stiffness
        N/m, of a reading of the tip.
    compliance
        m/N per load, of a loop beside the tip.
    length, side
        m of a strut measured alone; 1, or -1 under compression.
    """

    position: tuple[float, ...]
    angles: tuple[float, ...]
    direction: tuple[float, ...]
    force: float
    sd: float
    time: float
    temperature: float
    tool_extension: float
    labels: Mapping[str, str]
    file: str
    line: int
    extra: Mapping[str, float]
    date: str
    stiffness: float = math.nan
    compliance: float = math.nan
    length: float = math.nan
    side: float = 1.0

    @property
    def of_tip(self) -> bool:
        """Whether the indicator read between tool and work."""
        return not self.labels["loop"]


@dataclass(frozen=True)
class RowFile:
    """Rows of a file, the known columns that it has, and what was not used, in words."""

    rows: tuple[Row, ...]
    columns: frozenset[str]
    notes: tuple[str, ...]


def read_rows(table: Table, planned: bool = False) -> RowFile:
    """Rows of a measurement file.

    Parameters
    ----------
    table
        As `tables.read_table` reads it with `COLUMNS`.
    planned
        Whether the stiffness may be left empty (a plan of measurements).

    Raises
    ------
    InputError
        No rows, columns missing, unknown or repeated.
    InputErrors
        Bad rows, all of them.
    """
    file, heading, line = table.file, list(table.heading), table.heading_line
    if "" in heading:
        raise MeasurementError("a column without a name", file=file, line=line)
    long = {"direction", *VECTOR, "stiffness_N_per_mm", "displacement_um"}
    if {*WIDE} & {*heading} and long & {*heading}:
        fault = "columns of the wide layout beside those of the long one"
        raise MeasurementError(fault, hint="use one of the two", file=file, line=line)
    known = (*KNOWN, *WIDE, *WIDE_MODEL)
    check_heading(table, known, _needed(heading, planned))
    if not table.rows:
        expected = "one row a measured stiffness"
        raise MeasurementError("no rows below the heading", expected=expected, file=file, line=line)
    further = [name for name in heading if name not in known and _all_numbers(table, heading.index(name))]
    notes = [*table.notes]
    notes += [f"{file}: column {name} holds text and is not used" for name in heading if name not in (*known, *further)]
    if any(name in WIDE_MODEL for name in heading):
        notes.append(f"{file}: the printed model values (modeled_x_N_per_mm and so on) are not used")
    parsed, errors = parsed_rows(table, lambda line, record: _rows_of(record, further, file, line, planned))
    rows = [row for rows in parsed for row in rows]
    errors += duplicates(rows)
    if errors:
        raise InputErrors(sorted(errors, key=lambda error: error.line or 0))
    return RowFile(tuple(rows), frozenset(name for name in heading if name in KNOWN), tuple(notes))


def parsed_rows(table: Table, parse: Callable[[int, dict[str, str]], Parsed]) -> tuple[list[Parsed], list[InputError]]:
    """What `parse` makes of each row's line and record, and the errors of the others."""
    parsed: list[Parsed] = []
    errors: list[InputError] = []
    for line, cells in table.rows:
        try:
            parsed.append(parse(line, table.record(cells)))
        except InputError as error:
            errors.append(error.in_line(table.file, line))
    return parsed, errors


def _needed(heading: list[str], planned: bool) -> tuple[str, ...]:
    """Columns that the layout of a heading needs: three angles and three components of a direction, or none."""
    groups = tuple(name for group in (ANGLES, VECTOR) if not {*group}.isdisjoint(heading) for name in group)
    if not {*WIDE}.isdisjoint(heading):
        return (*POSITION, *WIDE, *groups)
    bench = "loop" in heading  # a strut on a bench has neither place nor direction
    loaded = "displacement_um" in heading and ("force_N" in heading or "strut_force_N" in heading)
    return (
        *(() if bench else POSITION),
        *groups,
        *(() if bench or VECTOR[0] in heading else ("direction",)),
        *(() if planned or loaded else ("stiffness_N_per_mm",)),
    )


def _all_numbers(table: Table, column: int) -> bool:
    try:
        return all(math.isfinite(float(cells[column])) for _, cells in table.rows)
    except (ValueError, IndexError):
        return False


def _rows_of(record: Mapping[str, str], further: list[str], file: str, line: int, planned: bool) -> list[Row]:
    """The one reading of a long row, the three of a wide one."""
    loop = loop_of(record.get("loop", ""))
    date = record.get(DATE, "")
    day_of(date)  # refuses what is no date
    # A strut on a bench has no pose.
    poseless = loop.kind == "alone" and not any(record.get(name) for name in (*POSITION, *ANGLES))
    row = Row(
        position=(math.nan,) * 3 if poseless else tuple(m_from_mm(number(record, name)) for name in POSITION),
        angles=(math.nan,) * 3 if poseless else tuple(_angle(record, name) for name in ANGLES),
        direction=(),
        force=optional_number(record, "force_N"),
        sd=n_per_m_from_n_per_mm(optional_number(record, "sd_N_per_mm")),
        time=60.0 * optional_number(record, "time_min"),
        temperature=optional_number(record, "temperature_C"),
        tool_extension=m_from_mm(optional_number(record, "tool_extension_mm")),
        labels={name: record.get(name, "") for name in LABELS} | {"loop": "" if loop == TIP else str(loop)},
        file=file,
        line=line,
        extra={name: float(record[name]) for name in further},
        date=date,
    )
    if loop != TIP:
        on_bench = poseless or (loop.kind == "alone" and bool(record.get("length_mm")))
        absent = on_bench and not record.get("direction", "Z" if VECTOR[0] in record else "")
        return [
            replace(_beside_tip(row, record, loop, planned), direction=AXES["Z"] if absent else direction_of(record))
        ]
    if WIDE[0] in record:
        values = [number(record, name) for name in WIDE]
        stiffnesses: list[tuple[tuple[float, ...], float]] = list(zip(AXES.values(), values, strict=True))
    else:
        stiffnesses = [(direction_of(record), _stiffness(record, row.force, planned))]
    return [replace(row, direction=axis, stiffness=n_per_m_from_n_per_mm(value)) for axis, value in stiffnesses]


def _angle(record: Mapping[str, str], name: str) -> float:
    return rad_from_deg(number(record, name)) if name in record else 0.0


def _beside_tip(row: Row, record: Mapping[str, str], loop: MeasuringLoop, planned: bool) -> Row:
    """A row with what an indicator beside the tip read.

    Raises
    ------
    InputError
        There is no reading, or two that disagree, or one that cannot be.
    """
    if record.get("sd_N_per_mm"):
        raise MeasurementError(f"sd_N_per_mm in a row of loop {loop}", expected="sd_um, of displacement_um")
    sd, own_force, length = (optional_number(record, name) for name in LOOP_COLUMNS)
    stiffness, moved = (
        number(record, name, bounds) if record.get(name) else math.nan for name, bounds in LOOP_BOUNDS.items()
    )
    if stiffness == 0.0:
        raise MeasurementError("stiffness_N_per_mm = 0", expected="displacement_um, where a loop reads it")
    alone = loop.kind == "alone"
    if not alone and not (math.isnan(own_force) and math.isnan(length)):
        raise MeasurementError(f"strut_force_N or length_mm in a row of loop {loop}", expected="loop strut 1 alone")
    force = own_force if alone and not math.isnan(own_force) else row.force
    if abs(force) < LEAST_FORCE:
        raise MeasurementError(f"strut_force_N = {force:g}", expected="a force: tension positive, compression negative")
    if math.isnan(moved) == math.isnan(stiffness) and not (planned and math.isnan(moved)):
        both = "neither displacement_um nor" if math.isnan(moved) else "displacement_um and"
        raise MeasurementError(f"loop {loop}: {both} stiffness_N_per_mm", expected="one of them")
    if not math.isnan(moved) and math.isnan(force):
        raise MeasurementError(f"loop {loop}: displacement_um without its load", expected="force_N")
    compliance = m_from_um(moved) / force if math.isnan(stiffness) else 1e-3 / stiffness
    # A sign of the direction turns what does not read along the load.
    if record.get("direction", "").startswith("-") and not (loop.along_load or alone):
        compliance = -compliance
    if alone and not (planned or 1.0 / STIFFEST_ALONE <= compliance <= 1.0 / SOFTEST_ALONE):
        raise MeasurementError(
            f"loop {loop}: {1e9 * compliance:.4g} nm/N",
            expected=f"{1e9 / STIFFEST_ALONE:g} to {1e9 / SOFTEST_ALONE:g} nm/N; longer under tension is positive",
        )
    size, side = abs(force), math.copysign(1.0, force)
    sd = m_from_um(sd) / size
    return replace(row, force=size, sd=sd, compliance=compliance, length=1e-3 * length, side=side)


def _stiffness(record: Mapping[str, str], force: float, planned: bool) -> float:
    """N/mm of a reading of the tip; nan of a plan's."""
    printed = optional_number(record, "stiffness_N_per_mm")
    displacement = optional_number(record, "displacement_um")
    quotient = force / (displacement / 1e3)  # N/mm
    if math.isnan(printed) and math.isnan(quotient) and not planned:
        raise MeasurementError("no stiffness", expected="stiffness_N_per_mm, or force_N and displacement_um")
    if abs(quotient - printed) > AGREEMENT * printed:
        raise MeasurementError(
            f"stiffness {printed:g} N/mm, but force over displacement is {quotient:.6g} N/mm",
            hint="correct one of them or leave one out",
        )
    if not math.isnan(quotient) and not SOFTEST <= quotient <= STIFFEST:
        raise MeasurementError(
            f"{force:g} N over {displacement:g} um is {quotient:.4g} N/mm",
            expected=f"{SOFTEST:g} to {STIFFEST:g} N/mm; is the unit right?",
        )
    return quotient if math.isnan(printed) else printed


def direction_of(record: Mapping[str, str]) -> tuple[float, ...]:
    """Unit vector of `direction`, or of dx,dy,dz."""
    if "direction" not in record and VECTOR[0] not in record:
        raise MeasurementError("no direction", expected="direction, or dx,dy,dz")
    if "direction" in record:
        name = record["direction"].upper().removeprefix("+").removeprefix("-")
        if name not in AXES:
            raise MeasurementError(f"direction {record['direction']!r}", expected="X, Y or Z (others as dx,dy,dz)")
        return AXES[name]
    vector = [number(record, name) for name in VECTOR]
    size = math.hypot(*vector)
    if size == 0.0:
        raise MeasurementError("direction 0,0,0", expected="a vector that points somewhere")
    return tuple(component / size for component in vector)


def number(record: Mapping[str, str], name: str, bounds: tuple[float, float] | None = None) -> float:
    """A cell that must hold a finite number within `BOUNDS`, or within these."""
    if name not in record:
        raise MeasurementError(f"no column {name}", expected="x_mm,y_mm,z_mm; only a strut measured alone has no pose")
    text = record[name]
    try:
        value = math.nan if "_" in text else float(text)  # Python's own "1_000" is no number of an office
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        dated = "the spreadsheet has made a date of it" if LIKE_DATE.match(text) else ""
        raise MeasurementError(f"{name} = {text!r}", expected="a finite number", hint=dated)
    low, high = bounds or BOUNDS.get(name, (-math.inf, math.inf))
    if not low <= value <= high:
        doubt = "; is the unit right?" if value > 0.0 else ""
        raise MeasurementError(f"{name} = {text}", expected=f"{low:g} to {high:g}{doubt}")
    return value


def optional_number(record: Mapping[str, str], name: str) -> float:
    """A number, or nan where the column is absent or the cell empty."""
    return number(record, name) if record.get(name) else math.nan


def duplicates(rows: list[Row], across_files: bool = False) -> list[InputError]:
    """Rows that say the same as an earlier one: all cells alike or, within a file, one repeat number twice."""
    first: dict[tuple[str, ...], Row] = {}
    errors: list[InputError] = []
    for row in rows:
        # repr: nan differs from itself, its text does not.
        cells = (row.position, row.angles, row.direction, row.force, row.time, row.tool_extension, row.labels, row.date,
                 row.compliance, row.length, row.side, None if row.of_tip else row.sd)  # fmt: skip
        numbered = bool(row.labels["repeat"]) and not across_files
        earlier = first.setdefault(tuple(map(repr, cells if numbered else (*cells, row.stiffness))), row)
        if earlier is not row:
            place = f" of {earlier.file}" if earlier.file != row.file else ""
            errors.append(
                MeasurementError(
                    f"row repeats line {earlier.line}{place}",
                    hint="number repeated readings in a column repeat, or remove it",
                    line=row.line,
                    file=row.file,
                )
            )
    return errors
