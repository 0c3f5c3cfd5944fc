"""Pulls: displacements of a machine of elements under known forces, as vectors or along a dial; also stiffnesses.

A row is a pull: where the machine stands (pose of the tip, or values of its joints, or both, held against each other),
the force on the tool (its vector, or the tension of a cable and the pulley that it runs to), what moved (components, or
a dial's reading). All in base axes, components also in axes turned against these (roll, pitch, yaw); where the force
acts and what is read may lie off the tip, in tip axes.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.readings.mapping import check_needed, mapped_table, unused
from toolpath_stiff.readings.measurements import lacking_columns, read_measurements
from toolpath_stiff.readings.rows import (
    ANGLES,
    COLUMNS,
    POSITION,
    VECTOR,
    direction_of,
    number,
    optional_number,
    parsed_rows,
)
from toolpath_stiff.readings.standing import standing
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.tables import Columns, Table
from toolpath_stiff.units import m_from_mm, m_from_um, rad_from_deg

FORCE, MOVED, DIAL = ("fx_N", "fy_N", "fz_N"), ("ux_um", "uy_um", "uz_um"), ("dial_x", "dial_y", "dial_z")
MOMENT = ("mx_Nm", "my_Nm", "mz_Nm")  # about the tip, beside the force
TENSION, CABLE = "tension_N", ("cable_x_mm", "cable_y_mm", "cable_z_mm")
PULL, TARGET = (tuple(f"{what}_d{axis}_mm" for axis in "xyz") for what in ("pull", "target"))
FORCE_AXES, MOVED_AXES = (tuple(f"{what}_axes_{axis}_deg" for axis in "abc") for what in ("force", "sensor"))
USED = "direction", "force_N", "displacement_um", "sd_um", "repeat"  # beside vectors
FRAMES = "force_axes", "sensor_axes"  # of the components, of `AXES`
AXES = "base", "tip", "work"  # the tip's own at each row; the axes of poses, those of [work] of the machine file
NOT_READ = ("nan", "n/a", "na", "-")  # cells that count as empty
FARTHEST = -1e6, 1e6  # um, of a dial
SMALLEST = m_from_um(1e-3)  # least displacement by which others are scaled
ALONG = 0.99  # cosine between dial and force from which a reading never vanishes: F d^T C d, C positive definite


@dataclass(frozen=True)
class Pulls(ArrayColumns):
    """m readings of displacements. SI, base axes.

    Attributes
    ----------
    stance
        How the machine stands at each.
    wrench
        (m, 6) N and N m, force and its moment about the tip.
    along
        (m, 6) what a reading takes of the tip's twist: the unit vector, and its moment about the tip from the target.
    value, sd
        (m,) m; sd is nan where nobody says.
    pose
        (m,) number of the distinct pose.
    file, line, component
        (m,) where it was read; "x", "y", "z" or "dial".
    notes
        What was assumed or not used; for the report.
    """

    stance: Stance
    wrench: FloatArray
    along: FloatArray
    value: FloatArray
    sd: FloatArray
    pose: IntArray
    file: TextArray
    line: IntArray
    component: TextArray
    notes: tuple[str, ...] = ()
    missing: ClassVar[tuple[str, ...]] = ("setup", "time_min", "temperature_C", "tool_extension_mm", "sd_N_per_mm")

    def __len__(self) -> int:
        return len(self.value)

    @cached_property
    def pull(self) -> IntArray:
        """(m,) number of the pull (the row) that each reading belongs to."""
        return np.unique(np.char.add(self.file, self.line.astype(str)), return_inverse=True)[1].reshape(-1)

    @cached_property
    def size(self) -> FloatArray:
        """(m,) m, length of the displacement whose component each reading is."""
        return np.asarray(np.maximum(np.sqrt(np.bincount(self.pull, self.value**2))[self.pull], self.least))

    @cached_property
    def least(self) -> FloatArray:
        """(m,) m that a displacement has at least: the tip moves where a dial aside of the force reads next to nothing.

        There it is what such a force moves on average along all such dials, root mean squares.
        """
        force = np.linalg.norm(self.wrench[:, :3], axis=1)
        along = np.abs((self.wrench[:, :3] * self.direction).sum(axis=1))
        aside = (np.bincount(self.pull)[self.pull] == 1) & (along < ALONG * force)
        usual = np.sqrt(np.mean((self.value[aside] / force[aside]) ** 2)) if aside.any() else 0.0
        return np.asarray(np.maximum(np.where(aside, usual * force, 0.0), SMALLEST))

    def vectors(self, values: FloatArray) -> FloatArray:
        """(pulls, 3) vectors in base axes from values (m,) of the components read."""
        total = np.zeros((int(self.pull.max()) + 1, 3))
        np.add.at(total, self.pull, values[:, None] * self.direction)
        return total

    @property
    def setup(self) -> TextArray:
        """(m,) "": no set-up is named."""
        return np.full(len(self), "")

    @property
    def point(self) -> TextArray:
        """(m,) label of the pose."""
        return self.pose.astype(str)

    @property
    def tip(self) -> BoolArray:
        """(m,) True: every reading is of the tip."""
        return np.ones(len(self), dtype=bool)

    @property
    def of_tip(self) -> "Pulls":
        """The readings of the tip: all."""
        return self

    @property
    def direction(self) -> FloatArray:
        """(m, 3) direction in which each was read."""
        return self.along[:, :3]

    def cannot_test(self, effects: Iterable[Effect]) -> dict[str, tuple[str, ...]]:
        """Effects that pulls cannot test -> columns that are missing for them."""
        return lacking_columns(effects, self.missing)


def read_pulls(files: Sequence[str], machine: MachineTool, mapping: Mapped = None) -> Pulls:
    """Pulls on a machine of elements, or its stiffnesses as pulls. Raises `InputError`, `InputErrors`."""
    joints, rows, notes = _joint_columns(machine), list[_Pull](), list[str]()
    used = {*_further(machine), *FRAMES, *POSITION, *ANGLES, *VECTOR, *USED}
    tables = pull_tables(files, machine, mapping)
    if not tables:
        return _of_stiffnesses(files, machine, mapping)
    if len(tables) < len(files):
        raise MeasurementError("pulls beside stiffnesses", hint="give one kind of files at a time")
    for table in tables:
        _check_columns(table, machine)
        loaded = replace(table, rows=tuple(row for row in table.rows if not _empty(table.record(row[1]))))
        of_file, errors = parsed_rows(loaded, partial(_Pull.of, table.file, joints))
        if errors:
            raise InputErrors(errors)
        rows += of_file
        empty = len(table.rows) - len(loaded.rows)
        notes += [
            *table.notes,
            *([f"{table.file}: {empty} rows of no force, or without a reading, are skipped"] if empty else []),
            *unused(table, used),
        ]
    if not rows:
        raise MeasurementError(
            "nothing read in any row", expected="pulls below the heading", file=tables[0].file, line=1
        )
    return _of_rows(rows, machine, notes)


def pull_tables(files: Sequence[str], machine: MachineTool, mapping: Mapped = None) -> list[Table]:
    """Tables of the files that give forces as vectors or by cables; the others give stiffnesses along directions."""
    known = Columns((*COLUMNS.numbers, *_further(machine)), (*COLUMNS.texts, *FRAMES))
    tables = [mapped_table(name, "measurements", known, mapping) for name in files]
    further = {*FORCE, TENSION, *_joint_columns(machine)}
    return [table for table in tables if not further.isdisjoint(table.heading)]


def _check_columns(table: Table, machine: MachineTool) -> None:
    """Refuse a table that lacks poses or all joints, forces, or displacements."""
    if not {*POSITION} <= {*table.heading}:
        missing = [named for named in _names_of_joints(machine) if {*named}.isdisjoint(table.heading)]
        check_needed(table, [by_number for _, by_number in missing], f"all joints, or {', '.join(POSITION)}")
    pulley = [TENSION, *CABLE]
    if {*FORCE, "force_N"}.isdisjoint(table.heading):
        needed = pulley if TENSION in table.heading else FORCE
        check_needed(table, needed, f"{', '.join(FORCE)}; or {', '.join(pulley)}")
    if {*MOVED, "displacement_um"}.isdisjoint(table.heading):
        check_needed(table, MOVED, f"{', '.join(MOVED)}; or displacement_um along {', '.join(DIAL)}")


@dataclass(frozen=True)
class _Pull:
    """One row, SI; nan for an empty cell or an absent column."""

    pose: tuple[float, ...]
    joints: tuple[float, ...]
    force: tuple[float, ...]
    moment: tuple[float, ...]
    tension: float
    pulley: tuple[float, ...]
    moved: tuple[tuple[str, tuple[float, ...], float], ...]
    pull: tuple[float, ...]
    target: tuple[float, ...]
    frames: tuple[int, ...]  # of `FRAMES` the numbers among `AXES`
    sd: float
    file: str
    line: int

    @classmethod
    def of(cls, file: str, joints: Mapping[str, tuple[int, bool]], line: int, record: Mapping[str, str]) -> "_Pull":
        """Pull from a row of a file. Raises `MeasurementError`."""
        record = {name: "" if cell.strip().lower() in NOT_READ else cell for name, cell in record.items()}

        def mm(names: Sequence[str]) -> tuple[float, ...]:
            return tuple(m_from_mm(optional_number(record, name, 0.0)) for name in names)

        values = [np.nan] * (1 + max(i for i, _ in joints.values()))
        for name, (i, linear) in joints.items():
            if record.get(name):
                values[i] = m_from_mm(number(record, name)) if linear else rad_from_deg(number(record, name))
        placed = all(record.get(name) for name in POSITION)
        if not placed and np.isnan(values).any():
            expected = f"{', '.join(POSITION)}; or {', '.join(joints)}"
            raise MeasurementError("neither a pose nor all joints", expected=expected)
        blank = 0.0 if any(record.get(name) for name in ANGLES) else np.nan
        angles = tuple(rad_from_deg(optional_number(record, name, blank)) for name in ANGLES)
        tension, vector = optional_number(record, TENSION), any(record.get(name) for name in FORCE)
        components = np.array([_component(record, name) if vector else np.nan for name in FORCE])
        along = direction_of(record) if record.get("force_N") and not vector and np.isnan(tension) else None
        if along is not None:  # force and displacement along one direction
            vector, components = True, number(record, "force_N") * np.array(along)
        turn = _turn(record, FORCE_AXES)
        force, moment = (tuple((turn @ v).tolist()) for v in (components, [_component(record, m) for m in MOMENT]))
        pulled = any(force) if vector else tension > 0.0 and record.get(CABLE[0])
        if not pulled or (vector and not np.isnan(tension)):
            raise MeasurementError("no force", expected=f"{', '.join(FORCE)}; or {TENSION} and {', '.join(CABLE)}")
        axes = zip("xyz", _turn(record, MOVED_AXES).T.tolist(), MOVED, strict=True)
        moved = [(c, tuple(axis), m_from_um(number(record, name))) for c, axis, name in axes if record.get(name)]
        if record.get("displacement_um") and (record.get(DIAL[0]) or along is not None):
            dial = np.array([number(record, name) for name in DIAL] if along is None else along)
            reading = m_from_um(number(record, "displacement_um", FARTHEST))
            moved.append(("dial", tuple(dial / np.linalg.norm(dial)), reading))
        if not any(value for *_, value in moved):
            expected = f"{', '.join(MOVED)}; or displacement_um along {', '.join(DIAL)}"
            raise MeasurementError("nothing read", expected=expected)
        pose = (*mm(POSITION), *angles) if placed else (np.nan,) * 6
        pulley, sd = mm(CABLE), m_from_um(optional_number(record, "sd_um"))
        frames = [record.get(name) or AXES[0] for name in FRAMES]
        if strange := [frame for frame in frames if frame not in AXES]:
            raise MeasurementError(f"axes {strange[0]}", expected=f"one of {', '.join(AXES)}")
        return cls(
            pose, tuple(values), force, moment, tension, pulley, tuple(moved), mm(PULL), mm(TARGET),
            tuple(map(AXES.index, frames)), sd, file, line,
        )  # fmt: skip


def _empty(record: Mapping[str, str]) -> bool:
    """True if a row states no motion under no force, the origin of the readings, or nothing was read."""
    force, moved = (
        [record.get(name, "").strip() for name in names]
        for names in ((*FORCE, TENSION, "force_N"), (*MOVED, "displacement_um"))
    )
    unread = all(cell.lower() in ("", *NOT_READ) for cell in moved)
    return any(force) and (unread or set("".join(force + moved)) <= set("+-.0"))


def _component(record: Mapping[str, str], name: str) -> float:
    """A component of a load; 0 if the file has no such column."""
    return number(record, name) if name in record else 0.0


def _turn(record: Mapping[str, str], names: Sequence[str]) -> FloatArray:
    """(3, 3) axes in which components are given, as columns in base axes."""
    angles = [rad_from_deg(optional_number(record, name, 0.0)) for name in names]
    return np.asarray(rotation_matrices(np.array(angles)))


def _names_of_joints(machine: MachineTool) -> list[tuple[str, str]]:
    """Column names for a joint's value: `joint_J1_deg`, `joint_1_deg`."""
    kinds = zip(machine.joint_names, machine.joint_kinds, strict=True)
    both = [(name.replace(" ", "_"), "mm" if kind == "linear" else "deg") for name, kind in kinds]
    return [(f"joint_{name}_{unit}", f"joint_{i}_{unit}") for i, (name, unit) in enumerate(both, 1)]


def _joint_columns(machine: MachineTool) -> dict[str, tuple[int, bool]]:
    """Column -> number of the joint, and True if it is linear."""
    return {name: (i, name.endswith("mm")) for i, names in enumerate(_names_of_joints(machine)) for name in names}


def _further(machine: MachineTool) -> tuple[str, ...]:
    """Columns of pulls besides those of stiffnesses."""
    loads = (*FORCE, *MOMENT, *FORCE_AXES, TENSION, *CABLE, *PULL)
    return (*loads, *MOVED, *MOVED_AXES, *DIAL, *TARGET, *_joint_columns(machine))


def _of_rows(rows: Sequence[_Pull], machine: MachineTool, notes: Sequence[str]) -> Pulls:
    """Pulls from rows, the machine at each row's pose or joints; one reading for each component read."""
    pose, joints = np.array([row.pose for row in rows]), np.array([row.joints for row in rows])
    stance, assumed = standing(machine, pose, joints, [(row.file, row.line) for row in rows])
    turn = stance.axes
    pull, target = (np.einsum("nij,nj->ni", turn, [getattr(row, name) for row in rows]) for name in ("pull", "target"))
    cable = np.array([row.pulley for row in rows]) - stance.position - pull
    by_cable = np.array([[row.tension] for row in rows]) * cable / np.linalg.norm(cable, axis=1, keepdims=True)
    base = np.broadcast_to(np.eye(3), turn.shape)
    every = np.stack([base, turn, base if stance.work_axes is None else stance.work_axes])
    of_force, of_sensor = (every[[row.frames[i] for row in rows], range(len(rows))] for i in range(len(FRAMES)))
    given, moment = (
        np.einsum("nij,nj->ni", of_force, [getattr(r, name) for r in rows]) for name in ("force", "moment")
    )
    force = np.where(np.isnan(given), by_cable, given)
    which = np.repeat(np.arange(len(rows)), [len(row.moved) for row in rows])
    direction = np.einsum("nij,nj->ni", of_sensor[which], [axis for row in rows for _, axis, _ in row.moved])
    distinct = np.unique(np.round(np.nan_to_num(np.hstack([stance.joints, stance.position]), nan=-1.0), 6), axis=0,
                         return_inverse=True)[1].reshape(-1)  # fmt: skip
    return Pulls(
        stance=stance.take(which),
        wrench=np.hstack([force, np.cross(pull, force) + moment])[which],
        along=np.hstack([direction, np.cross(target[which], direction)]),
        value=np.array([value for row in rows for *_, value in row.moved]),
        sd=np.array([row.sd for row in rows])[which],
        pose=distinct[which],
        file=np.array([row.file for row in rows])[which],
        line=np.array([row.line for row in rows])[which],
        component=np.array([name for row in rows for name, *_ in row.moved]),
        notes=tuple(dict.fromkeys([*notes, *assumed])),
    )


def _of_stiffnesses(files: Sequence[str], machine: MachineTool, mapping: Mapped) -> Pulls:
    """Force over displacement along a direction, as pulls by that force read with a dial along it."""
    data = read_measurements(files, machine, columns=mapping)
    wrench, along = (np.hstack([part, np.zeros((len(data), 3))]) for part in (data.direction * data.force[:, None],
                                                                             data.direction))  # fmt: skip
    stance = machine.solve(data.position, data.rotation, data.tool_extension + machine.reference_tool_length)
    value = data.force / data.stiffness
    return Pulls(stance, wrench, along, value, value * data.sd / data.stiffness, data.poses[1], data.file, data.line,
                 np.full(len(data), "dial"))  # fmt: skip
