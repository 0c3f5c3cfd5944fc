"""Rows of a measurement file: one measured stiffness each, every cell read and checked, in SI.

A bad row is named with its line; all bad rows of a file are reported together.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from toolpath_stiff.column_names import heading_key
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.loops import loop_of
from toolpath_stiff.readings.mapping import DATE, check_needed
from toolpath_stiff.stiffness.measuring_loop import TIP, MeasuringLoop
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_mm, m_from_um, n_per_m_from_n_per_mm, rad_from_deg, s_from_min

Parsed = TypeVar("Parsed")

AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
POSITION = ("x_mm", "y_mm", "z_mm")
ANGLES = ("a_deg", "b_deg", "c_deg")
VECTOR = ("dx", "dy", "dz")
LABELS = ("setup", "clamp", "repeat", "point", "loop")
LOOP_COLUMNS = ("sd_um", "strut_force_N", "length_mm")  # only of loops beside the tip
OPTIONAL = ("force_N", "sd_N_per_mm", *LABELS, "time_min", "tool_extension_mm", "temperature_C")
COLUMNS = Columns(
    numbers=(
        *POSITION, *ANGLES, *VECTOR, "stiffness_N_per_mm", "displacement_um", "force_N", "sd_N_per_mm", "time_min",
        "tool_extension_mm", "temperature_C", *LOOP_COLUMNS,
    ),
    texts=("direction", *LABELS, DATE),
)  # fmt: skip
KNOWN = (*COLUMNS.numbers, *COLUMNS.texts)

# N/mm: no machine is softer than 0.1 N/um or stiffer than 10 kN/um; beyond, the unit is not N/mm.
SOFTEST, STIFFEST = 1e2, 1e7
SOFTEST_ARM = 10.0  # N/mm, of machines of elements: a light arm, stretched (assumed); robots that mill have 100 to 3000
BOUNDS = {
    **dict.fromkeys((*POSITION, "tool_extension_mm"), (-1e5, 1e5)),
    **dict.fromkeys(ANGLES, (-360.0, 360.0)),
    "sd_N_per_mm": (1e-6, STIFFEST),
    "force_N": (1e-3, 1e7),
    "displacement_um": (1e-3, 1e6),
    "time_min": (0.0, 1e6),
    "temperature_C": (-50.0, 200.0),
    "sd_um": (1e-4, 1e4),
    "strut_force_N": (-1e7, 1e7),
    "length_mm": (1.0, 1e5),
}
# Bounds of a loop beside the tip, which may read zero, or backwards.
LOOP_BOUNDS = {"stiffness_N_per_mm": (-1e12, 1e12), "displacement_um": (-1e6, 1e6)}
LEAST_FORCE = 1e-3  # N, of either sign
AGREEMENT = 0.01  # a stiffness printed beside force and displacement must be their quotient, rounding allowed


@dataclass(frozen=True)
class Row:
    """One reading as `Readings` has it. SI; nan or "" for a cell that is absent or empty.

    Attributes
    ----------
    stiffness, sd
        N/m of a reading of the tip; m/N per load of a loop beside it. nan where a plan leaves it empty.
    loop
        By its own name, "" for the tip's.
    extra
        Further numeric columns, as they stand.
    length, side
        m of a strut measured alone; 1, or -1 under compression.
    """

    position: tuple[float, ...]
    angles: tuple[float, ...]
    direction: tuple[float, ...]
    force: float
    sd: float
    tool_extension: float
    time: float
    temperature: float
    setup: str
    loop: str
    repeat: str
    point: str
    clamp: str
    date: str
    file: str
    line: int
    extra: Mapping[str, float]
    stiffness: float = math.nan
    length: float = math.nan
    side: float = 1.0


def refuse_pulls(table: Table) -> None:
    """Raise `InputError` for a table of force vectors, which is neither of stiffnesses nor of raw records."""
    if not {"fx_n", "fy_n", "fz_n", "tension_n"}.isdisjoint(map(heading_key, table.heading)):
        raise MeasurementError(
            "forces as vectors, or by a cable: pulls on a machine of elements",
            hint="compare, diagnose, update and plan read pulls as they are (--machine ROBOT.toml); reduce and the "
            "studio take none",
            file=table.file,
            line=table.heading_line,
        )


def read_rows(table: Table, softest: float = SOFTEST) -> tuple[list[Row], list[str]]:
    """Rows of a measurement file; and remarks on what was not used.

    Parameters
    ----------
    table
        As `tables.read_table` reads it with `COLUMNS`.
    softest
        N/mm that a machine has at least.

    Raises
    ------
    InputError
        No rows, columns missing, unknown or repeated.
    InputErrors
        Bad rows, all of them.
    """
    file, heading, line = table.file, table.heading, table.heading_line
    refuse_pulls(table)
    check_needed(table, _needed(heading), "one row a reading: x_mm,y_mm,z_mm,direction,stiffness_N_per_mm")
    fault = "a column without a name" if "" in heading else "" if table.rows else "no rows below the heading"
    if "direction" in heading and "dx" in heading:
        fault = "two directions: direction, and dx,dy,dz"
    if fault:
        raise MeasurementError(fault, file=file, line=line)
    further = [name for name in heading if name not in KNOWN and _all_numbers(table, heading.index(name))]
    unused = [name for name in heading if name not in (*KNOWN, *further)]
    rows, errors = parsed_rows(table, lambda line, record: _row(record, further, file, line, softest))
    errors += duplicates(rows)
    if errors:
        raise InputErrors(sorted(errors, key=lambda error: error.line or 0))
    return rows, [*table.notes, *(f"{file}: column {name} holds text and is not used" for name in unused)]


def parsed_rows(table: Table, parse: Callable[[int, dict[str, str]], Parsed]) -> tuple[list[Parsed], list[InputError]]:
    """Results of `parse` for each row's line and record, and the errors of the other rows."""
    parsed: list[Parsed] = []
    errors: list[InputError] = []
    for line, cells in table.rows:
        try:
            parsed.append(parse(line, table.record(cells)))
        except InputError as error:
            errors.append(error.in_line(table.file, line))
    return parsed, errors


def _needed(heading: Sequence[str]) -> tuple[str, ...]:
    """Columns that a heading needs: three angles and three components of a direction, or none of them."""
    groups = tuple(name for group in (ANGLES, VECTOR) if not {*group}.isdisjoint(heading) for name in group)
    bench = "loop" in heading  # a strut on a bench has neither pose nor direction
    loaded = "displacement_um" in heading and ("force_N" in heading or "strut_force_N" in heading)
    return (
        *(() if bench else POSITION),
        *groups,
        *(() if bench or VECTOR[0] in heading else ("direction",)),
        *(() if loaded else ("stiffness_N_per_mm",)),
    )


def _all_numbers(table: Table, column: int) -> bool:
    try:
        return all(math.isfinite(float(cells[column])) for _, cells in table.rows)
    except (ValueError, IndexError):
        return False


def _row(record: Mapping[str, str], further: Sequence[str], file: str, line: int, softest: float) -> Row:
    loop = loop_of(record.get("loop", ""))
    day_of(record.get(DATE, ""))  # raises for a text that is no date
    # A strut on a bench has neither pose nor direction.
    poseless = loop.kind == "alone" and not any(record.get(name) for name in (*POSITION, *ANGLES))
    undirected = loop.kind == "alone" and not (record.get("direction") or VECTOR[0] in record)
    texts: Any = {name: record.get(name, "") for name in (*LABELS, DATE)} | {"loop": "" if loop == TIP else str(loop)}
    row = Row(
        position=(math.nan,) * 3 if poseless else tuple(m_from_mm(number(record, name)) for name in POSITION),
        angles=(math.nan,) * 3 if poseless else tuple(_angle(record, name) for name in ANGLES),
        direction=AXES["Z"] if undirected else direction_of(record),
        force=optional_number(record, "force_N"),
        sd=n_per_m_from_n_per_mm(optional_number(record, "sd_N_per_mm")),
        time=s_from_min(optional_number(record, "time_min")),
        temperature=optional_number(record, "temperature_C"),
        tool_extension=m_from_mm(optional_number(record, "tool_extension_mm")),
        **texts,
        file=file,
        line=line,
        extra={name: float(record[name]) for name in further},
    )
    if loop != TIP:
        return _beside_tip(row, record, loop)
    return replace(row, stiffness=n_per_m_from_n_per_mm(_stiffness(record, row.force, softest)))


def _angle(record: Mapping[str, str], name: str) -> float:
    return rad_from_deg(number(record, name)) if name in record else 0.0


def _beside_tip(row: Row, record: Mapping[str, str], loop: MeasuringLoop) -> Row:
    """Row with the reading of an indicator beside the tip.

    Raises
    ------
    InputError
        There is no reading, or two that disagree, or one that cannot be.
    """
    alone = loop.kind == "alone"
    sd, own_force, length = (optional_number(record, name) for name in LOOP_COLUMNS)
    others = ("sd_N_per_mm",) if alone else ("sd_N_per_mm", "strut_force_N", "length_mm")
    wrong = next((name for name in others if record.get(name)), "")
    if wrong:
        expected = "sd_um, of displacement_um" if wrong == "sd_N_per_mm" else "loop strut 1 alone"
        raise MeasurementError(f"{wrong} in a row of loop {loop}", expected=expected)
    force = own_force if alone and not math.isnan(own_force) else row.force
    if abs(force) < LEAST_FORCE:
        raise MeasurementError(f"strut_force_N = {force:g}", expected="a force: tension positive, compression negative")
    given = [name for name in LOOP_BOUNDS if record.get(name)]
    values = [number(record, name, LOOP_BOUNDS[name]) for name in given]
    lacking = math.isnan(force) if given == ["displacement_um"] else given != ["stiffness_N_per_mm"] or not values[0]
    if lacking:
        raise MeasurementError(
            f"loop {loop}: no reading", expected="displacement_um with force_N, or else stiffness_N_per_mm, not 0"
        )
    compliance = m_from_um(values[0]) / force if given == ["displacement_um"] else 1e-3 / values[0]
    # A signed direction reverses a reading that is not taken along the load.
    if record.get("direction", "").startswith("-") and not (loop.along_load or alone):
        compliance = -compliance
    if alone and not 1e-3 / STIFFEST <= compliance <= 1e-3 / SOFTEST:
        expected = f"{1e6 / STIFFEST:g} to {1e6 / SOFTEST:g} nm/N; longer under tension is positive"
        raise MeasurementError(f"loop {loop}: {1e9 * compliance:.4g} nm/N", expected=expected)
    return replace(
        row,
        force=abs(force),
        sd=m_from_um(sd) / abs(force),
        stiffness=compliance,
        length=m_from_mm(length),
        side=math.copysign(1.0, force),
    )


def _stiffness(record: Mapping[str, str], force: float, softest: float) -> float:
    """N/mm of a reading of the tip."""
    given = record.get("stiffness_N_per_mm")
    printed = number(record, "stiffness_N_per_mm", (softest, STIFFEST)) if given else math.nan
    displacement = optional_number(record, "displacement_um")
    quotient = force / (displacement / 1e3)  # N/mm
    if math.isnan(printed) and math.isnan(quotient):
        raise MeasurementError("no stiffness", expected="stiffness_N_per_mm, or force_N and displacement_um")
    if abs(quotient - printed) > AGREEMENT * printed or quotient < softest or quotient > STIFFEST:
        raise MeasurementError(
            f"{force:g} N over {displacement:g} um, force over displacement, is {quotient:.6g} N/mm",
            expected=f"the stiffness that is given, {softest:g} to {STIFFEST:g} N/mm; is the unit right?",
        )
    return quotient if math.isnan(printed) else printed


def direction_of(record: Mapping[str, str]) -> tuple[float, ...]:
    """Unit vector of `direction`, or of dx, dy, dz."""
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
        value = math.nan if "_" in text else float(text)  # Python's "1_000" is not a number in a table
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MeasurementError(f"{name} = {text!r}", expected="a finite number, without thousands separators")
    low, high = bounds or BOUNDS.get(name, (-math.inf, math.inf))
    if not low <= value <= high:
        raise MeasurementError(f"{name} = {text}", expected=f"{low:g} to {high:g}; is the unit right?")
    return value


def optional_number(record: Mapping[str, str], name: str, blank: float = math.nan) -> float:
    """A number; `blank` if the column is absent or the cell empty."""
    return number(record, name) if record.get(name) else blank


def duplicates(rows: list[Row]) -> list[InputError]:
    """Errors for rows that repeat an earlier one: all cells equal or, within a file, the same repeat number."""
    first: dict[str, Row] = {}
    errors: list[InputError] = []
    for row in rows:
        cells = replace(row, temperature=math.nan, extra={}, file="", line=0)
        cells = cells if row.loop else replace(cells, sd=math.nan, stiffness=math.nan)
        # Compared by repr, as nan differs from itself but its text does not.
        keys = [repr((cells, row.stiffness)), *([repr((cells, row.file))] if row.repeat else [])]
        earlier = next((first[key] for key in keys if key in first), None)
        first |= {key: row for key in keys if key not in first}
        if earlier is not None:
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
