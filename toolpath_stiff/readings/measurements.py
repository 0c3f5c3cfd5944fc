"""Measured stiffnesses as columns, SI, with the model's prediction of each."""

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from importlib import resources
from itertools import count
from pathlib import Path
from typing import Any, Self

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import AnyArray, ArrayColumns, BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.column_names import Mapped, parted
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.model import Hexapod, MachineTool, as_hexapod
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.loops import INDICATOR_SD, LOAD_SHARE, WIDEST, LoopColumns, offsets
from toolpath_stiff.readings.mapping import mapped_table
from toolpath_stiff.readings.measured_poses import pose_warnings
from toolpath_stiff.readings.rows import (
    ANGLES,
    COLUMNS,
    OPTIONAL,
    POSITION,
    SOFTEST,
    SOFTEST_ARM,
    VECTOR,
    Row,
    duplicates,
    read_rows,
)
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import element_sum, exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect, LoadPath
from toolpath_stiff.stiffness.loop_response import loop_compliance
from toolpath_stiff.stiffness.model import StiffnessModel, load_path
from toolpath_stiff.tables import Columns, Table, parse_table
from toolpath_stiff.units import deg_from_rad, min_from_s, mm_from_m, n_per_mm_from_n_per_m

NIST_TABLE_1 = "nist-table1"
RISER_ABOVE_MM = 1000.0  # of the paper's two planes, 353 and 1268 mm, Figure 6 shows the upper one on a riser


@dataclass(frozen=True)
class Readings(ArrayColumns):
    """n measured stiffnesses. SI; nan or "" where a reading does not state a value.

    Attributes
    ----------
    position
        (n, 3) m, programmed tool tip.
    angles
        (n, 3) rad, roll, pitch, yaw.
    direction
        (n, 3) unit vectors of force and displacement.
    stiffness
        (n,) N/m; nan where a plan leaves it empty. Of a loop beside the tip that of the loop in series with its offset
        (`readings.loops`): what is compared.
    force
        (n,) N, `defaults.FORCE` where not given.
    sd
        (n,) N/m, total standard deviation of one reading.
    tool_extension
        (n,) m, longer than the machine's reference tool.
    time, temperature
        (n,) s since the indicator was zeroed; degrees C.
    setup, loop, repeat
        (n,) as in the file.
    point
        (n,) label of the point: as given, else one label a pose.
    clamp
        (n,) label of the clamping, whose rows move together: file and clamp as given, else point and set-up.
    file, line
        (n,) where each was read.
    extra
        Further numeric columns -> (n,).
    missing
        Optional columns that are absent, or empty in some row, so that nothing can be told from them.
    notes, warnings
        What was assumed or not used; what is doubtful. For the report.
    beside
        Which readings are of loops beside the tip, and how these are compared; None where there are none.
    date
        (n,) as in the file, "" where a reading has none.
    """

    position: FloatArray
    angles: FloatArray
    direction: FloatArray
    stiffness: FloatArray
    force: FloatArray
    sd: FloatArray
    tool_extension: FloatArray
    time: FloatArray
    temperature: FloatArray
    setup: TextArray
    loop: TextArray
    repeat: TextArray
    point: TextArray
    clamp: TextArray
    file: TextArray
    line: IntArray
    extra: Mapping[str, FloatArray]
    missing: tuple[str, ...]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    beside: LoopColumns | None = None
    date: TextArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    @property
    def tip(self) -> BoolArray:
        """(n,) True for readings of the tool tip against the work."""
        return np.ones(len(self), dtype=bool) if self.beside is None else ~self.beside.beside

    @property
    def of_tip(self) -> Self:
        """The readings of the tip alone."""
        return self if self.beside is None else self.select(self.tip)

    @property
    def compliance(self) -> FloatArray:
        """(n,) m/N as read: displacement over load, whatever the loop."""
        joined = 1.0 / self.stiffness
        return joined if self.beside is None else self.beside.alone(joined)

    @cached_property
    def rotation(self) -> FloatArray:
        """(n, 3, 3) orientation of the platform."""
        return rotation_matrices(self.angles)

    @property
    def day(self) -> FloatArray | None:
        """(n,) days since the first of the dates; nan where a reading has none. None where no reading has."""
        if self.date is None or not self.date.any():
            return None
        days = np.array([day_of(text) for text in self.date.tolist()])
        return np.asarray(days - np.nanmin(days))

    @cached_property
    def poses(self) -> tuple[IntArray, IntArray]:
        """(p,) one row of each distinct pose and tool, and (n,) the number of each reading's pose."""
        columns = np.concatenate([self.position, self.angles, self.tool_extension[:, None]], axis=1)
        _, first, which = np.unique(columns, axis=0, return_index=True, return_inverse=True)
        return first, which.reshape(-1)

    def select(self, rows: AnyArray) -> Self:
        """Readings of some rows, by mask or index."""
        extra = {name: values[rows] for name, values in self.extra.items()}
        beside = self.beside.select(rows) if self.beside is not None and self.beside.beside[rows].any() else None
        return replace(self.take(rows), extra=extra, beside=beside)

    def cannot_test(self, effects: Iterable[Effect]) -> dict[str, tuple[str, ...]]:
        """Effects that these data cannot test -> columns that are missing for them."""
        return lacking_columns(effects, self.missing)


def lacking_columns(effects: Iterable[Effect], missing: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Effects that need missing columns -> these columns."""
    lacking = {effect.name: tuple(c for c in effect.needs if c in missing) for effect in effects}
    return {name: columns for name, columns in lacking.items() if columns}


def read_measurements(
    paths: str | Path | Iterable[str | Path], machine: MachineTool, columns: Mapped = None
) -> Readings:
    """Read measurement files.

    Parameters
    ----------
    paths
        One or several files, CSV or .xlsx (`FILE.xlsx#SHEET`); `nist-table1` is the paper's Table 1.
    machine
        The machine that was measured; its poses are checked against it.
    columns
        Columns that the files name differently, as `mapping` says.

    Raises
    ------
    InputError
        A file cannot be read, or has not the right columns.
    InputErrors
        Bad rows, all of them; poses that are singular or beyond what the machine can be.
    """
    names = list(map(str, [paths] if isinstance(paths, str | Path) else paths))
    if not names:
        raise MeasurementError("no measurements", expected="a CSV file, or nist-table1")
    if twice := [name for i, name in enumerate(names) if name in names[:i]]:
        raise MeasurementError(f"{twice[0]!r} is given twice", hint="name it once")
    rows: list[Row] = []
    notes: list[str] = []
    errors: list[InputError] = []
    for name in names:
        try:
            table = _table_1() if name == NIST_TABLE_1 else mapped_table(name, "measurements", COLUMNS, columns)
            of_file, remarks = read_rows(table, SOFTEST if isinstance(machine, Hexapod) else SOFTEST_ARM)
            rows += of_file
            notes += remarks
        except InputErrors as bad:  # errors of all files are reported together
            errors += bad.errors
    errors = errors or duplicates(rows)
    if errors:
        raise InputErrors(errors)
    data = _columns(rows, notes, machine)
    places = [(row.file, row.line) for row in rows]
    warnings = pose_warnings(machine, data.position, data.angles, data.tool_extension, places)
    return with_offsets(replace(data, warnings=warnings), machine)


def _table_1() -> Table:
    """The paper's Table 1, printed one row per point."""
    text = (resources.files("toolpath_stiff") / "data" / "nist_table1.csv").read_text("utf-8")
    printed = parse_table(text, NIST_TABLE_1, Columns(POSITION))
    rows = tuple(
        (line, (*cells[:3], axis, measured, "riser" if float(cells[2]) > RISER_ABOVE_MM else "no riser"))
        for line, cells in printed.rows
        for axis, measured in zip("XYZ", cells[3:6], strict=True)
    )
    note = "two set-ups, the upper plane on a riser (the paper's Figure 6), the lower without"
    return replace(
        printed,
        heading=(*POSITION, "direction", "stiffness_N_per_mm", "setup"),
        rows=rows,
        remarks=(note,),
    )


def _columns(rows: list[Row], notes: Sequence[str], machine: MachineTool) -> Readings:
    """Readings as columns; those of loops stay in m/N until `with_offsets`."""
    names = {field.name for field in fields(Row)} & {field.name for field in fields(Readings)} - {"extra"}
    columns: dict[str, Any] = {name: np.array([getattr(row, name) for row in rows]) for name in sorted(names)}
    # A strut on a bench has no pose: it gets the machine's neutral one, but keeps its own length.
    pose = np.concatenate([columns["position"], columns["angles"]], axis=1)
    pose = np.where(np.isnan(pose[:, :1]), machine.limits.neutral_pose, pose)
    on_tip, point = columns["loop"] == "", point_names(pose, columns["point"])
    read = {name: columns[parted(name)[0]] for name in OPTIONAL}
    given = {name: of != "" if of.dtype.kind == "U" else ~np.isnan(of) for name, of in read.items()}
    given["sd_N_per_mm"] &= on_tip
    common = set.intersection(*(set(row.extra) for row in rows))
    dropped = sorted({name for row in rows for name in row.extra} - common)
    unknown = sum(bool(np.isnan(row.length) and np.isnan(row.position[0])) for row in rows)
    bench = f"{unknown} readings of struts alone say neither length_mm nor a pose: taken at the neutral pose"
    # Clampings are numbered anew in every file; without a number, a point in a set-up is one clamping.
    clamps = [
        f"{row.file}: clamp {row.clamp}" if row.clamp else f"point {p}, set-up {row.setup}"
        for row, p in zip(rows, point, strict=True)
    ]
    columns |= {
        "position": pose[:, :3],
        "angles": pose[:, 3:],
        "force": np.where(given["force_N"], columns["force"], defaults.FORCE),
        "tool_extension": np.nan_to_num(columns["tool_extension"], nan=0.0),
        "point": point,
        "clamp": np.array(clamps),
    }
    return Readings(
        **columns,
        extra={name: np.array([row.extra[name] for row in rows]) for name in sorted(common)},
        # Set-ups and loops may be unnamed; every other column must be filled for every reading.
        missing=tuple(n for n in OPTIONAL if not (given[n].any() if n in ("setup", "loop") else given[n].all())),
        notes=(
            *notes,
            *_incomplete(given),
            *(f"column {name} is not in every file and is not used" for name in dropped),
            *[bench] * bool(unknown),
        ),
        beside=None if on_tip.all() else LoopColumns.of(columns["loop"].tolist(), np.array([r.length for r in rows])),
    )


def with_offsets(data: Readings, machine: MachineTool, widest: float = WIDEST) -> Readings:
    """Readings whose loop readings, until now m/N with sd in m/N, are stiffnesses with offsets.

    `widest`: relative sd that no loop reading with its offset has more of.
    """
    if data.beside is None:
        return data
    rows, loops = data.beside.beside, data.beside.loops
    read, sd = np.where(rows, data.stiffness, np.nan), np.where(rows, data.sd, np.nan)
    plain = StiffnessModel(as_hexapod(machine, "a reading beside the tip"))
    path = measured_path(plain, data)
    # A joint moves the way its strut does; the plain machine's rigid joints do not show it.
    moving = [replace(loop, kind="strut", where="") if loop.kind == "joint" else loop for loop in loops]
    toward = loop_compliance(plain, path, data.direction, moving, data.beside.which)
    expected = np.where(np.array([loop.kind == "joint" for loop in loops])[data.beside.which], 0.0, toward)
    assumed = int((np.isnan(sd) & rows & ~np.isnan(read)).sum())
    usual = np.hypot(INDICATOR_SD / data.force, LOAD_SHARE * np.where(np.isnan(read), expected, read))
    sd = np.where(np.isnan(sd), usual, sd)
    tip = exact.compliance_along(plain, path, data.direction)
    beside = offsets(data.beside, read, sd, expected, toward, tip, widest)
    stiffness = 1.0 / beside.joined(np.where(rows, read, 1.0))
    note = (
        f"{assumed} readings of loops beside the tip do not say how far they scatter (sd_um): "
        f"{1e6 * INDICATOR_SD:g} um and {100 * LOAD_SHARE:g} % assumed"
    )
    return replace(
        data,
        beside=beside,
        stiffness=np.where(rows, stiffness, data.stiffness),
        sd=np.where(rows, sd * stiffness**2, data.sd),
        # A loop's indicator is not clamped with the tip's gauge: its readings scatter independently.
        clamp=np.where(rows, np.char.add("loop reading ", np.arange(len(data)).astype(str)), data.clamp),
        notes=(*data.notes, note) if assumed else data.notes,
    )


def _incomplete(given: Mapping[str, BoolArray]) -> list[str]:
    """Remarks on columns that some readings leave empty, and on an assumed load."""
    n, notes = len(given["force_N"]), []
    for name, there in given.items():
        lacking = n - int(there.sum())
        if name == "force_N" and lacking:
            notes.append(f"{lacking} of {n} readings do not say at which force: {defaults.FORCE:g} N assumed")
        elif name not in ("setup", "loop") and 0 < lacking < n:
            notes.append(f"column {name} is empty in {lacking} of {n} readings: treated as absent there")
    return notes


def point_names(poses: FloatArray, labels: TextArray, prefix: str = "P", taken: Iterable[str] = ()) -> TextArray:
    """Labels of the points; new ones differ from those taken.

    Readings without one share a label if they share the pose (to 1 um and 1e-6 rad).
    """
    keys, known = [*map(tuple, (np.round(poses, 6) + 0.0).tolist())], {*labels.tolist(), *taken}
    unnamed = dict.fromkeys(key for key, label in zip(keys, labels, strict=True) if not label)
    names = dict(zip(unnamed, (name for n in count(1) if (name := f"{prefix}{n}") not in known), strict=False))
    return np.array([label or names[key] for key, label in zip(keys, labels, strict=True)], dtype=str)


def reading_columns(data: Readings) -> dict[str, AnyArray]:
    """Column -> values of a table of the readings, in the shop's units; empty optional columns are left out."""
    pose = np.concatenate([mm_from_m(data.position), deg_from_rad(data.angles), data.direction], axis=1)
    with np.errstate(divide="ignore"):
        shown = data.stiffness if data.beside is None else 1.0 / data.compliance
    columns = {
        "file": data.file,
        "line": data.line,
        "point": data.point,
        **{name: pose[:, i] for i, name in enumerate((*POSITION, *ANGLES, *VECTOR))},
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(shown),
        "force_N": data.force,
        **({} if data.day is None else {"date": data.date, "day": data.day}),
        "sd_N_per_mm": n_per_mm_from_n_per_m(data.sd),
        "tool_extension_mm": mm_from_m(data.tool_extension),
        "time_min": min_from_s(data.time),
        "temperature_C": data.temperature,
        **{name: getattr(data, name) for name in ("setup", "clamp", "repeat", "loop")},
    }
    missing = {*data.missing} - {"force_N", "point"}  # which are filled in
    return {name: values for name, values in columns.items() if name not in missing}


MARK = 10  # hexadecimal digits of a reading's mark: two of 5,000 readings share one once in 90,000 cases


def reading_marks(data: Readings) -> TextArray:
    """(n,) fingerprint of each reading, whatever the name, order or layout of its file.

    The first `MARK` digits of the SHA-256 of its pose (to 0.01 mm and 0.001 degrees), its direction (without sign) and
    the measured stiffness (to five digits).
    """
    pose = np.concatenate([np.round(mm_from_m(data.position), 2), np.round(deg_from_rad(data.angles), 3)], axis=1)
    axis = np.round(data.direction, 3)
    first = np.take_along_axis(axis, np.argmax(axis != 0.0, axis=1)[:, None], axis=1)
    rows = np.concatenate([pose, axis * np.sign(first)], axis=1) + 0.0  # no -0
    return np.array(
        [
            hashlib.sha256(f"{row} {stiffness:.4e}".encode()).hexdigest()[:MARK]
            for row, stiffness in zip(rows.tolist(), data.stiffness.tolist(), strict=True)
        ],
        dtype=str,
    )


def measured_path(model: StiffnessModel, data: Readings) -> LoadPath:
    """Load path of the measurements, as the model's effects see it; a missing column is None there.

    A pose is solved once, however often it was measured.
    """
    first, which = data.poses
    length = data.tool_extension[first] + model.machine.reference_tool_length
    path = load_path(model, data.position[first], data.rotation[first], length).take(which)
    return replace(
        path,
        stance=path.stance if data.beside is None else data.beside.on_lengths(path.struts),
        force=data.force,
        direction=data.direction,
        setup=None if "setup" in data.missing else data.setup,
        time=None if "time_min" in data.missing else data.time,
        temperature=None if "temperature_C" in data.missing else data.temperature,
    )


def model_stiffness(model: StiffnessModel, data: Readings) -> FloatArray:
    """(n,) N/m that each reading should show by the model, its instruments included.

    Raises
    ------
    InputError
        The strut law leaves a strut no stiffness at a measured pose.
    """
    path = measured_path(model, data)
    stiffness = mechanical_stiffness(model, path, data)
    for active in model.instruments:
        stiffness = shown_by(active, stiffness, path, data)
    return np.asarray(stiffness)


def mechanical_stiffness(
    model: StiffnessModel, path: LoadPath, data: Readings, equilibrium: FloatArray | None = None
) -> FloatArray:
    """(n,) N/m of the machine alone; for loops beside the tip with their offsets, nan if not positive.

    `equilibrium`: strut forces as of `exact.compliance_along`.
    """
    if data.beside is None:
        if isinstance(path.stance, Stance):
            return np.asarray(1.0 / element_sum.compliance_along(model, path, data.direction))
        return np.asarray(1.0 / exact.compliance_along(model, path, data.direction, equilibrium))
    compliance = loop_compliance(model, path, data.direction, data.beside.loops, data.beside.which)
    joined = data.beside.joined(compliance)
    return np.asarray(1.0 / np.where(joined > 0.0, joined, np.nan))


def shown_by(active: ActiveEffect, stiffness: FloatArray, path: LoadPath, data: Readings) -> FloatArray:
    """(n,) N/m that an instrument shows; indicators of loops beside the tip are separate instruments."""
    return np.where(data.tip, active.reading(stiffness, path), stiffness)
