"""Residuals and the variables they are tested against: columns of the data, and quantities that the model ignores.

A `Variable` is numbers (height, time, force), `ReadingNames` are names (set-up, clamping, plane). Planes are groups of
heights, zones are distances from the machine's axis.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.analysis.evaluation import joint_columns
from toolpath_stiff.arrays import BoolArray, FloatArray, TextArray
from toolpath_stiff.comparison.structure import Pattern
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import Readings, model_stiffness
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.units import deg_from_rad, min_from_s, mm_from_m, n_per_mm_from_n_per_m, um_from_m

AXIS_ALIGNED = 0.999  # |cosine| from which a direction counts as X, Y or Z
SAME_PLANE = 0.005  # m, heights closer than this are one plane
MOST_PLANES = 5  # beyond, heights are put into three bands of equally many readings
# Number of planes -> their names, the lowest first; more planes are named by height.
PLANES = {
    1: ("only plane",),
    2: ("lower plane", "upper plane"),
    3: ("lower plane", "middle plane", "upper plane"),
}
ON_AXIS, NEAR_AXIS = 0.1, 0.6  # of the largest distance from the axis: limits of the zones
FEWEST = 2  # readings in a level; a single reading is not a pattern
CURVED = ("order", "time_min", "height", "mean_strut_length")  # variables whose curvature is looked for too
ALL = "all"
MOST_LEVELS = 100  # of a label: beyond, its levels are not tested one by one


@dataclass(frozen=True)
class Variable:
    """Numbers, one a reading.

    Attributes
    ----------
    name
        Short name, for files.
    title
        As a sentence needs it: "the height".
    unit
        Unit of `values`, a shop unit; may be empty.
    values
        (n,), nan where a reading has none.
    """

    name: str
    title: str
    unit: str
    values: FloatArray


@dataclass(frozen=True)
class ReadingNames:
    """Labels, one a reading; `text` turns a level into words such as "with set-up riser"."""

    name: str
    text: str
    values: TextArray
    by_direction: bool


def modelled(predictor: Predictor) -> FloatArray:
    """(n,) ln(N/m) that the model predicts for the readings. Raises `InputError` where it has no stiffness."""
    data, log_model = predictor.data, predictor.log_stiffness()
    bad = np.flatnonzero(~np.isfinite(log_model))
    if len(bad):
        model_stiffness(predictor.base, data)  # names the effect, if one leaves no stiffness, and the pose
        raise InputError(
            "the model has no stiffness for this reading",
            hint="check the pose and the machine file's effects",
            file=str(data.file[bad[0]]),
            line=int(data.line[bad[0]]),
        )
    return log_model


def directions(data: Readings | Pulls) -> TextArray:
    """(n,) "X", "Y", "Z" or "oblique"."""
    axis = np.argmax(np.abs(data.direction), axis=1)
    along = np.abs(data.direction)[np.arange(len(data)), axis] >= AXIS_ALIGNED
    return np.where(along, np.array(["X", "Y", "Z"])[axis], "oblique")


def planes(data: Readings) -> TextArray:
    """(n,) name of each reading's plane: heights in groups, or in three bands if there are many."""
    z = data.position[:, 2]
    order = np.argsort(z, kind="stable")
    group = np.zeros(len(z), dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(np.diff(z[order]) > SAME_PLANE)])
    count = int(group.max()) + 1
    if count > MOST_PLANES:
        edges = np.quantile(z, [1.0 / 3.0, 2.0 / 3.0])
        return np.array(["lower third", "middle third", "upper third"])[np.searchsorted(edges, z, side="left")]
    heights = [f"plane at z = {mm_from_m(float(z[group == g].mean())):.0f} mm" for g in range(count)]
    return np.array(PLANES.get(count, heights))[group]


def plane_heights_mm(data: Readings) -> dict[str, float]:
    """Mean height of each plane's readings, mm; the lowest first."""
    where, z = planes(data), mm_from_m(data.position[:, 2])
    return dict(sorted(((str(p), float(z[where == p].mean())) for p in np.unique(where)), key=lambda plane: plane[1]))


def radius(data: Readings) -> FloatArray:
    """(n,) m from the machine's axis."""
    return np.hypot(data.position[:, 0], data.position[:, 1])


def zones(data: Readings) -> TextArray:
    """(n,) "on the axis", "near the axis" or "far from the axis"; "" if all readings are on it."""
    r = radius(data)
    if float(r.max()) < SAME_PLANE:
        return np.full(len(r), "", dtype="<U18")
    share = r / r.max()
    names = np.where(share > NEAR_AXIS, "far from the axis", "near the axis")
    return np.where(share <= ON_AXIS, "on the axis", names)


def variables(predictor: Predictor, log_model: FloatArray) -> list[Variable]:
    """Variables to test the residuals of n readings against; only those that vary.

    `log_model` (n,): ln(N/m) that the model says.
    """
    data = predictor.data
    turn, position = data.rotation, mm_from_m(data.position)
    azimuth = np.where(radius(data) > SAME_PLANE, 3.0 * np.arctan2(position[:, 1], position[:, 0]), np.nan)
    known = [
        Variable("order", "the reading's place in the measuring order", "", np.arange(1.0, len(data) + 1.0)),
        Variable("height", "the height", "mm", position[:, 2]),
        Variable("x", "X", "mm", position[:, 0]),
        Variable("y", "Y", "mm", position[:, 1]),
        Variable("radius", "the distance from the axis", "mm", mm_from_m(radius(data))),
        Variable("cos_3_azimuth", "the cosine of 3 x azimuth", "", np.cos(azimuth)),
        Variable("sin_3_azimuth", "the sine of 3 x azimuth", "", np.sin(azimuth)),
        Variable("tilt", "the tilt", "deg", deg_from_rad(np.arccos(np.clip(turn[:, 2, 2], -1.0, 1.0)))),
        *(
            Variable(f"{name}_angle", f"the {name} angle", "deg", deg_from_rad(data.angles[:, i]))
            for i, name in enumerate(("roll", "pitch", "yaw"))
        ),
        Variable(
            "along_tool",
            "the load's alignment with the tool axis",
            "",
            np.einsum("ni,ni->n", data.direction, turn[:, :, 2]) ** 2,
        ),
        Variable("vertical_share", "the load's vertical share", "", data.direction[:, 2] ** 2),
        *_of_elements(predictor),
        Variable("model_stiffness", "the modelled stiffness", "N/mm", n_per_mm_from_n_per_m(np.exp(log_model))),
        Variable("deflection", "the modelled deflection", "um", um_from_m(data.force / np.exp(log_model))),
    ]
    columns = [
        Variable("force_N", "the force", "N", data.force),
        Variable("time_min", "the time since zeroing", "min", min_from_s(data.time)),
        Variable("temperature_C", "the temperature", "C", data.temperature),
        Variable("tool_extension_mm", "the tool's extra length", "mm", mm_from_m(data.tool_extension)),
    ]
    in_some_rows = ("time_min", "temperature_C")
    known += [column for column in columns if column.name not in data.missing or column.name in in_some_rows]
    known += [Variable(name, f"column {name}", "", values) for name, values in data.extra.items()]
    return [variable for variable in known if varies(variable.values)]


def _of_elements(predictor: Predictor) -> Iterator[Variable]:
    """Joint values or strut lengths, and the share of each element in the compliance, as variables."""
    machine, path = predictor.base.machine, predictor.full_path
    if isinstance(machine, Hexapod):
        lengths, names = mm_from_m(predictor.strut_lengths()), [f"strut {i}" for i in range(1, 7)]
        yield Variable("mean_strut_length", "the mean strut length", "mm", lengths.mean(axis=1))
        yield Variable("max_strut_length", "the longest strut's length", "mm", lengths.max(axis=1))
        yield Variable("min_strut_length", "the shortest strut's length", "mm", lengths.min(axis=1))
    else:
        names = [element.name for element in machine.elements]
        joints = zip(machine.joint_names, joint_columns(machine, path.stance.joints).items(), strict=True)
        for name, (column, values) in joints:
            yield Variable(column, f"the value of {name}", column.rpartition("_")[2], values)
    for name, share in zip(names, 100.0 * predictor.strut_columns().T, strict=True):
        column = f"share_of_{name.replace(' ', '_')}"
        yield Variable(column, f"the share of {name} in the compliance", "%", np.ascontiguousarray(share))


def varies(values: FloatArray) -> bool:
    """True if at least three numbers are finite and they are not all equal."""
    known = values[np.isfinite(values)]
    return len(known) >= 3 and float(np.ptp(known)) > 1e-9 * max(float(np.abs(known).max()), 1e-12)


def labels(data: Readings) -> tuple[list[ReadingNames], list[str]]:
    """Labels to test residuals against, only those with two levels or more; notes about those with too many."""
    prefix = f"{data.file[0]}: " if len(set(data.file.tolist())) == 1 else ""
    clamps = np.array([clamp.removeprefix(prefix) for clamp in data.clamp.tolist()])
    known = [
        ReadingNames("plane", "at the {}", planes(data), True),
        ReadingNames("zone", "{}", zones(data), True),
        ReadingNames("setup", "with set-up {}", data.setup, True),
        ReadingNames("loop", "read {}", data.loop, True),
        ReadingNames("file", "in {}", data.file, True),
        ReadingNames("repeat", "in repeat {}", data.repeat, True),
        ReadingNames("clamp", "in clamping ({})", clamps, False),
        ReadingNames("point", "at point {}", data.point, False),
    ]
    levels = {label.name: len(set(label.values.tolist())) for label in known}
    notes = [f"{name} has {n} levels: not tested one by one" for name, n in levels.items() if n > MOST_LEVELS]
    return [label for label in known if 1 < levels[label.name] <= MOST_LEVELS], notes


def patterns(data: Readings, numbers: list[Variable], names: list[ReadingNames]) -> list[Pattern]:
    """All patterns to look for in n residuals; one equal to an earlier pattern is only named with it."""
    kept: dict[bytes, list[Pattern]] = {}
    for pattern in _candidates(data, numbers, names):
        centred = pattern.values - pattern.values.mean() if pattern.kind != "level" else pattern.values
        size = float(np.linalg.norm(centred))
        if size > 1e-9:
            key = np.round(centred / size * np.sign(centred[np.argmax(np.abs(centred))]), 7) + 0.0
            kept.setdefault(key.tobytes(), []).append(pattern)
    return [replace(first, same=tuple(other.name for other in others)) for first, *others in kept.values()]


def _candidates(data: Readings, numbers: list[Variable], names: list[ReadingNames]) -> Iterator[Pattern]:
    """Levels of the labels and slopes along the variables, over all directions and in each."""
    along, whole = directions(data), np.ones(len(data), dtype=bool)
    axes = np.unique(along).tolist()
    groups = {ALL: whole} | ({axis: along == axis for axis in axes} if len(axes) > 1 else {})
    levels = [("everywhere", group, rows, "") for group, rows in groups.items()]
    for label in names:
        levels += [
            (f"{label.name} {level}", group, rows & (label.values == level), label.text.format(level))
            for group, rows in (groups if label.by_direction else {ALL: whole}).items()
            for level in np.unique(label.values)
        ]
    plane, zone = (next((label for label in names if label.name == name), None) for name in ("plane", "zone"))
    if plane and zone:
        levels += [
            (f"zone {here}, plane {level}", group, rows & (plane.values == level) & (zone.values == here),
             f"{here} {plane.text.format(level)}")
            for group, rows in groups.items()
            for here in np.unique(zone.values)
            for level in np.unique(plane.values)
        ]  # fmt: skip
    for name, group, rows, place in levels:
        if rows.sum() >= FEWEST or (name, group) == ("everywhere", ALL):
            yield Pattern(f"{group}: {name}", name, group, "level", rows.astype(float), rows, place)
    for variable in numbers:
        for group, rows in groups.items():
            yield from _slopes(variable, group, rows)


def _slopes(variable: Variable, group: str, rows: BoolArray) -> Iterator[Pattern]:
    """Straight slope along a variable and, for some variables, a curved one as well."""
    known = rows & np.isfinite(variable.values)
    if not varies(variable.values[known]):
        return
    name, of = f"{group}: {variable.name}", (variable.title, variable.values, variable.unit)
    x = np.where(known, variable.values, 0.0)
    x = np.where(known, x - x[known].mean(), 0.0) / float(x[known].std())
    yield Pattern(name, variable.name, group, "slope", x, known, *of)
    if variable.name in CURVED and len(np.unique(np.round(x[known], 9))) >= 4:
        bent = np.where(known, x**2, 0.0)
        slope = np.stack([known.astype(float), x], axis=1)
        bent = bent - slope @ np.linalg.lstsq(slope, bent, rcond=None)[0]
        yield Pattern(f"{name} squared", variable.name, group, "curve", bent, known, *of)
