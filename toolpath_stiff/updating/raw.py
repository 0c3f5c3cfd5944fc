"""Raw records of a stiffness test (ASME B5.54): force and displacement while the machine is jogged against a gauge.

The machine is jogged from zero to one extreme, to the other, and back to zero (the paper: 0, +200, -200, 0 um in steps
of 100 um), restrained by a force gauge; indicators read how far it really moved. With the jog y, the force F and the
displacement D read by the indicator, the deflection is y - D, and the paper's equation 12 is its secant between the
extremes:

    k = (F(+0.2 mm) - F(-0.2 mm)) / (0.4 mm - (D(+0.2 mm) - D(-0.2 mm)))
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.tables import Columns, Table, read_table
from toolpath_stiff.units import certain, m_from_um, n_per_mm_from_n_per_m, um_from_m
from toolpath_stiff.updating.raw_shape import Shape, shape_of
from toolpath_stiff.updating.rows import (
    ANGLES,
    LABELS,
    POSITION,
    SOFTEST,
    STIFFEST,
    VECTOR,
    direction_of,
    number,
    optional_number,
)

FloatArray = NDArray[np.float64]

READINGS = ("jog_um", "force_N", "displacement_um")
PLACE = (*POSITION, *ANGLES, "direction", *VECTOR, *LABELS, "tool_extension_mm")  # what one loop has in common
CONDITIONS = ("time_min", "temperature_C")
COLUMNS = Columns(
    numbers=(*POSITION, *ANGLES, *VECTOR, "tool_extension_mm", *READINGS, *CONDITIONS), texts=("direction", *LABELS)
)
SIGNED = {"force_N": 1e7, "displacement_um": 1e6, "jog_um": 1e6}  # largest magnitude, either sign
SAME_JOG = 1e-9  # m: jogs this close are the same step
FIGURES = ("lost_motion_um", "loop_width_um", "linearity_percent", "closure_um")


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
        (m,) m, N, m, along the direction.
    line
        Line of the first record.
    """

    place: Mapping[str, str]
    conditions: Mapping[str, float]
    jog: FloatArray
    force: FloatArray
    displacement: FloatArray
    line: int

    @property
    def deflection(self) -> FloatArray:
        """(m,) m, what the machine gave way: jog less displacement."""
        return self.jog - self.displacement

    @property
    def title(self) -> str:
        """Point or position, direction, set-up, repeat: whatever is there."""
        where = self.place.get("point") or ", ".join(self.place[name] for name in POSITION) + " mm"
        way = self.place.get("direction") or "(" + ", ".join(self.place[name] for name in VECTOR) + ")"
        rest = [f"{name} {self.place[name]}" for name in ("setup", "clamp", "repeat") if self.place.get(name)]
        return ", ".join([where, way, *rest])


@dataclass(frozen=True)
class LoopFigures:
    """What a loop says. SI; nan where it has too few records.

    Attributes
    ----------
    stiffness
        N/m, the paper's equation 12.
    force
        N, half the difference of the forces at the extremes.
    deflection
        m, between the extremes. Errors of jog and indicator count in proportion to it.
    lost_motion
        m, distance at zero force between the straight lines through the records of the two sides.
    loop_width
        m, largest difference in deflection at one force between going and coming.
    linearity
        Largest departure of the deflection from the secant on the way from extreme to extreme, as a share of the
        deflection between them.
    closure
        m, deflection at the end less that at the beginning.
    shape
        Kinks, two slopes, work lost.
    """

    stiffness: float
    force: float
    deflection: float
    lost_motion: float
    loop_width: float
    linearity: float
    closure: float
    shape: Shape


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
    groups: dict[tuple[str, ...], list[tuple[int, dict[str, str], list[float]]]] = {}
    errors = []
    for line, cells in table.rows:
        try:
            record = table.record(cells)
            for name in (*POSITION, *(angle for angle in ANGLES if angle in record)):
                number(record, name)
            direction_of(record)
            optional_number(record, "tool_extension_mm")
            values = [_signed(record, name) for name in READINGS]
            values += [optional_number(record, name) for name in CONDITIONS]
        except InputError as error:
            errors.append(MeasurementError(error.found, expected=error.expected, hint=error.hint, file=file, line=line))
            continue
        key = tuple(record.get(name, "") for name in PLACE)
        groups.setdefault(key, []).append((line, record, values))
    if errors:
        raise InputErrors(errors)
    return [_loop(records) for records in groups.values()]


def _check_heading(heading: list[str], file: str, line: int) -> None:
    for name in heading:
        if name not in (*PLACE, *READINGS, *CONDITIONS):
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
    for name in (*POSITION, *angles, *(VECTOR if vector else ("direction",)), *READINGS):
        if name not in heading:
            found = "no direction" if vector and name in VECTOR else f"column {name} is missing"
            raise MeasurementError(
                found, expected=f"x_mm,y_mm,z_mm,direction,{','.join(READINGS)}", file=file, line=line
            )
    if not vector and any(name in heading for name in VECTOR):
        raise MeasurementError("two directions", expected="direction, or dx,dy,dz", file=file, line=line)


def _signed(record: Mapping[str, str], name: str) -> float:
    try:
        value = float(record[name])
    except ValueError:
        value = math.nan
    if not abs(value) <= SIGNED[name]:
        raise MeasurementError(f"{name} = {record[name]!r}", expected=f"a number within +-{SIGNED[name]:g}")
    return value


def _loop(records: list[tuple[int, dict[str, str], list[float]]]) -> Loop:
    line, record, _ = records[0]
    jog, force, displacement, *conditions = np.array([values for _, _, values in records]).T
    return Loop(
        place={name: record[name] for name in PLACE if name in record},
        conditions={n: float(v.mean()) for n, v in zip(CONDITIONS, conditions, strict=True) if not np.isnan(v).any()},
        jog=m_from_um(jog),
        force=force,
        displacement=m_from_um(displacement),
        line=line,
    )


def reduce_loop(loop: Loop, file: str = "") -> LoopFigures:
    """Stiffness by the paper's equation 12, and what the loop says about play, friction and linearity.

    Raises
    ------
    InputError
        The loop does not reach both sides, or gives no stiffness that could be.
    """
    where = {"file": file or None, "line": loop.line}
    high, low = float(loop.jog.max()), float(loop.jog.min())
    if not (low < -SAME_JOG and high > SAME_JOG):
        raise MeasurementError(
            f"{loop.title}: jogged from {um_from_m(low):g} to {um_from_m(high):g} um",
            expected="extremes on both sides of zero, as 0, +200, -200, 0 um",
            **where,  # type: ignore[arg-type]
        )
    at_high, at_low = np.abs(loop.jog - high) < SAME_JOG, np.abs(loop.jog - low) < SAME_JOG
    force = float(loop.force[at_high].mean() - loop.force[at_low].mean())
    moved = float(loop.displacement[at_high].mean() - loop.displacement[at_low].mean())
    deflection = (high - low) - moved
    stiffness = force / deflection if deflection else math.inf
    if not SOFTEST <= n_per_mm_from_n_per_m(stiffness) <= STIFFEST:
        raise MeasurementError(
            f"{loop.title}: {force:g} N over a deflection of {um_from_m(deflection):g} um",
            expected=f"{SOFTEST:g} to {STIFFEST:g} N/mm",
            hint="force, jog and displacement count positive the same way; displacement is what the indicator read",
            **where,  # type: ignore[arg-type]
        )
    return LoopFigures(
        stiffness=stiffness,
        force=force / 2.0,
        deflection=deflection,
        lost_motion=_lost_motion(loop, high, low),
        loop_width=_loop_width(loop),
        linearity=_linearity(loop, deflection),
        closure=float(loop.deflection[-1] - loop.deflection[0]),
        shape=shape_of(loop.force, loop.deflection, _main_pass(loop)),
    )


def _lost_motion(loop: Loop, high: float, low: float) -> float:
    """Straight lines through the outer half of each side, both passes; their distance at zero force."""
    at_zero = []
    for outer in (loop.jog >= 0.5 * high - SAME_JOG, loop.jog <= 0.5 * low + SAME_JOG):
        force, deflection = loop.force[outer], loop.deflection[outer]
        if np.ptp(loop.jog[outer]) < SAME_JOG or np.ptp(force) == 0.0:
            return math.nan
        centred = force - force.mean()
        slope = (centred @ deflection) / (centred @ centred)
        at_zero.append(float(deflection.mean() - slope * force.mean()))
    return at_zero[0] - at_zero[1]


def _main_pass(loop: Loop) -> slice:
    """The records from one extreme to the other, whichever comes first."""
    ends = sorted((int(np.argmax(loop.jog)), int(np.argmin(loop.jog))))
    return slice(ends[0], ends[1] + 1)


def _loop_width(loop: Loop) -> float:
    """The way from extreme to extreme against the way there and the way back, at the forces of the latter."""
    main = _main_pass(loop)
    order = np.argsort(loop.force[main], kind="stable")
    force, deflection = loop.force[main][order], loop.deflection[main][order]
    other = np.r_[0 : main.start, main.stop : len(loop.jog)].astype(int)
    other = other[(loop.force[other] >= force[0]) & (loop.force[other] <= force[-1])]
    if not len(other):
        return math.nan
    return float(np.abs(loop.deflection[other] - np.interp(loop.force[other], force, deflection)).max())


def _linearity(loop: Loop, deflection: float) -> float:
    main = _main_pass(loop)
    force, read = loop.force[main], loop.deflection[main]
    secant = read[0] + (read[-1] - read[0]) * (force - force[0]) / (force[-1] - force[0])
    return float(np.abs(read - secant).max() / deflection)


@dataclass(frozen=True)
class Reduction:
    """Loops of a file of raw records with what they say, and what reading it left to be said."""

    loops: tuple[Loop, ...]
    figures: tuple[LoopFigures, ...]
    notes: tuple[str, ...]


def reduce(raw: str | Path) -> Reduction:
    """Raw records of force and displacement to measured stiffnesses.

    Parameters
    ----------
    raw
        A file: CSV, or FILE.xlsx[#SHEET].

    Raises
    ------
    InputError
        The file cannot be read, has not the right columns, or no records.
    InputErrors
        Bad records, or loops that give no stiffness, all of them.

    Examples
    --------
    >>> import tempfile
    >>> rows = ["x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um"]
    >>> rows += [f"0,0,800,X,{jog},{40 * jog},{0.2 * jog}" for jog in (0, 200, -200, 0)]
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(chr(10).join(rows)), file.flush()
    ...     found = reduce(file.name)
    >>> document(found)[0]["stiffness_N_per_mm"]
    50000.0
    """
    table = read_table(str(raw), "raw records", COLUMNS)
    loops = read_raw(table)
    return Reduction(tuple(loops), tuple(reduce_loops(loops, str(raw))), tuple(table.notes))


def document(reduction: Reduction) -> list[LoopEntry]:
    """One entry a loop in the shop's units; what a loop cannot say is None."""
    found = []
    for loop, one in zip(reduction.loops, reduction.figures, strict=True):
        numbers = {
            "stiffness_N_per_mm": n_per_mm_from_n_per_m(one.stiffness),
            "force_N": one.force,
            "deflection_um": um_from_m(one.deflection),
            **shop_figures(one),
        }
        shown = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()}
        found.append(cast(LoopEntry, {"loop": loop.title, "line": loop.line, **shown, "shape": _shape(one.shape)}))
    return found


def _shape(shape: Shape) -> ShapeEntry:
    numbers = {
        "force_N": shape.force,
        "first_N_per_mm": n_per_mm_from_n_per_m(shape.first),
        "second_N_per_mm": n_per_mm_from_n_per_m(shape.second),
        "work_lost_mJ": 1e3 * shape.lost,
    }
    shown = {name: certain(value) if math.isfinite(value) else None for name, value in numbers.items()}
    return cast(ShapeEntry, {"kind": shape.kind, **shown, "text": str(shape)})


class ShapeEntry(TypedDict):
    """What stands out of a straight line; see `raw_shape.Shape`."""

    kind: str
    force_N: float | None
    first_N_per_mm: float | None
    second_N_per_mm: float | None
    work_lost_mJ: float | None
    text: str


class LoopEntry(TypedDict):
    """A loop as `tps reduce --json` has it."""

    loop: str
    line: int
    stiffness_N_per_mm: float
    force_N: float
    deflection_um: float
    lost_motion_um: float | None
    loop_width_um: float | None
    linearity_percent: float | None
    closure_um: float | None
    shape: ShapeEntry


def reduce_loops(loops: Iterable[Loop], file: str = "") -> list[LoopFigures]:
    """Figures of every loop. Raises `InputErrors` that name all loops that give none."""
    figures, errors = [], []
    for loop in loops:
        try:
            figures.append(reduce_loop(loop, file))
        except InputError as error:
            errors.append(error)
    if errors:
        raise InputErrors(errors)
    return figures


def shop_figures(figures: LoopFigures) -> dict[str, float]:
    """`FIGURES` in the shop's units."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def measurement_csv(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> str:
    """A measurement file, one row a loop; a figure that some loop lacks is left out as a column."""
    shown = [shop_figures(one) for one in figures]
    there = [name for name in FIGURES if all(math.isfinite(one[name]) for one in shown)]
    place = [name for name in PLACE if name in loops[0].place]
    conditions = [name for name in CONDITIONS if all(name in loop.conditions for loop in loops)]
    rows = []
    for loop, one, own in zip(loops, figures, shown, strict=True):
        cells = [loop.place[name] for name in place]
        cells += [f"{n_per_mm_from_n_per_m(one.stiffness):.1f}", f"{one.force:.2f}"]
        cells += [f"{loop.conditions[name]:.6g}" for name in conditions]
        cells += [f"{own[name] + 0.0:.3f}" for name in there]
        rows.append(cells)
    return csv_text([*place, "stiffness_N_per_mm", "force_N", *conditions, *there], rows)
