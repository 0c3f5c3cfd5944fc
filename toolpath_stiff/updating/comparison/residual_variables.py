"""What residuals are held against: every column of the data, and every quantity that the model does not use.

A `Variable` is numbers (height, time, force), a `Label` is names (set-up, clamping, plane). Planes are groups of
heights, zones are distances from the machine's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m
from toolpath_stiff.updating.inference.predict import Predictor
from toolpath_stiff.updating.readings.measurements import Measurements

FloatArray = NDArray[np.float64]
TextArray = NDArray[np.str_]

AXIS_ALIGNED = 0.999  # |cosine| from which a direction counts as X, Y or Z
SAME_PLANE = 0.005  # m, heights closer than this are one plane
MOST_PLANES = 5  # beyond, heights are put into three bands of equally many readings
ON_AXIS, NEAR_AXIS = 0.1, 0.6  # of the largest distance from the axis: limits of the zones
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
class Label:
    """Names, one a reading: `text` turns a level into words such as "with set-up riser"."""

    name: str
    text: str
    values: TextArray
    by_direction: bool

    def words(self, level: str) -> str:
        """The level in a sentence."""
        return self.text.format(level)


def directions(data: Measurements) -> TextArray:
    """(n,) "X", "Y", "Z" or "oblique"."""
    axis = np.argmax(np.abs(data.direction), axis=1)
    along = np.abs(data.direction)[np.arange(len(data)), axis] >= AXIS_ALIGNED
    return np.where(along, np.array(["X", "Y", "Z"])[axis], "oblique")


def planes(data: Measurements) -> TextArray:
    """(n,) name of each reading's plane: heights in groups, or in three bands if there are many."""
    z = data.position[:, 2]
    order = np.argsort(z, kind="stable")
    group = np.zeros(len(z), dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(np.diff(z[order]) > SAME_PLANE)])
    count = int(group.max()) + 1
    if count > MOST_PLANES:
        edges = np.quantile(z, [1.0 / 3.0, 2.0 / 3.0])
        return np.array(["lower third", "middle third", "upper third"])[np.searchsorted(edges, z, side="left")]
    if count == 1:
        return np.full(len(z), "only plane")
    named = {2: ("lower plane", "upper plane"), 3: ("lower plane", "middle plane", "upper plane")}
    heights = [f"plane at z = {mm_from_m(float(z[group == g].mean())):.0f} mm" for g in range(count)]
    return np.array(named.get(count, heights))[group]


def radius(data: Measurements) -> FloatArray:
    """(n,) m from the machine's axis."""
    return np.hypot(data.position[:, 0], data.position[:, 1])


def zones(data: Measurements) -> TextArray:
    """(n,) "on the axis", "near the axis" or "far from the axis"; "" where all are on it."""
    r = radius(data)
    largest = float(r.max())
    if largest < SAME_PLANE:
        return np.full(len(r), "", dtype="<U18")
    share = r / largest
    names = np.where(share > NEAR_AXIS, "far from the axis", "near the axis")
    return np.where(share <= ON_AXIS, "on the axis", names)


def variables(predictor: Predictor, log_model: FloatArray) -> list[Variable]:
    """Numbers to hold the residuals of n readings against; only those that vary.

    `log_model` (n,): ln(N/m) that the model says.
    """
    data = predictor.data
    turn = data.rotation
    tilt = np.arccos(np.clip(turn[:, 2, 2], -1.0, 1.0))
    azimuth = np.arctan2(data.position[:, 1], data.position[:, 0])
    lengths = mm_from_m(predictor.strut_lengths())
    share = 100.0 * predictor.strut_columns()
    along_tool = np.einsum("ni,ni->n", data.direction, turn[:, :, 2]) ** 2
    off_axis = radius(data) > SAME_PLANE
    found = [
        Variable("order", "the reading's place in the measuring order", "", np.arange(1.0, len(data) + 1.0)),
        Variable("height", "the height", "mm", mm_from_m(data.position[:, 2])),
        Variable("x", "X", "mm", mm_from_m(data.position[:, 0])),
        Variable("y", "Y", "mm", mm_from_m(data.position[:, 1])),
        Variable("radius", "the distance from the axis", "mm", mm_from_m(radius(data))),
        Variable("cos_3_azimuth", "the cosine of 3 x azimuth", "", np.where(off_axis, np.cos(3 * azimuth), np.nan)),
        Variable("sin_3_azimuth", "the sine of 3 x azimuth", "", np.where(off_axis, np.sin(3 * azimuth), np.nan)),
        Variable("tilt", "the tilt", "deg", deg_from_rad(tilt)),
        *(
            Variable(f"{name}_angle", f"the {name} angle", "deg", deg_from_rad(data.angles[:, i]))
            for i, name in enumerate(("roll", "pitch", "yaw"))
        ),
        Variable("along_tool", "the load's alignment with the tool axis", "", along_tool),
        Variable("vertical_share", "the load's vertical share", "", data.direction[:, 2] ** 2),
        Variable("mean_strut_length", "the mean strut length", "mm", lengths.mean(axis=1)),
        Variable("max_strut_length", "the longest strut's length", "mm", lengths.max(axis=1)),
        Variable("min_strut_length", "the shortest strut's length", "mm", lengths.min(axis=1)),
        *(
            Variable(f"share_of_strut_{i + 1}", f"the share of strut {i + 1} in the compliance", "%", share[:, i])
            for i in range(6)
        ),
        Variable("model_stiffness", "the modelled stiffness", "N/mm", n_per_mm_from_n_per_m(np.exp(log_model))),
        Variable("deflection", "the modelled deflection", "um", um_from_m(data.force / np.exp(log_model))),
    ]
    extension = mm_from_m(data.tool_extension)
    columns = [
        ("force_N", Variable("force_N", "the force", "N", data.force)),
        ("time_min", Variable("time_min", "the time since zeroing", "min", data.time / 60.0)),
        ("temperature_C", Variable("temperature_C", "the temperature", "C", data.temperature)),
        ("tool_extension_mm", Variable("tool_extension_mm", "the tool's extra length", "mm", extension)),
    ]
    found += [variable for column, variable in columns if column not in data.missing]
    if "temperature_C" in data.missing and np.isfinite(data.temperature).any():
        found.append(columns[2][1])
    if "time_min" in data.missing and np.isfinite(data.time).any():
        found.append(columns[1][1])
    found += [Variable(name, f"column {name}", "", values) for name, values in data.extra.items()]
    return [one for one in found if varies(one.values)]


def varies(values: FloatArray) -> bool:
    """Whether at least three finite numbers are there and not all are the same."""
    known = values[np.isfinite(values)]
    return len(known) >= 3 and float(np.ptp(known)) > 1e-9 * max(float(np.abs(known).max()), 1e-12)


def labels(data: Measurements) -> tuple[list[Label], list[str]]:
    """Names to hold residuals against, only those with two levels or more; notes about those with too many."""
    clamp, file = data.clamp, data.file
    if len(set(file.tolist())) == 1:
        prefix = f"{file[0]}: "
        clamp = np.array([name.removeprefix(prefix) for name in clamp.tolist()])
    found = [
        Label("plane", "at the {}", planes(data), True),
        Label("zone", "{}", zones(data), True),
        Label("setup", "with set-up {}", data.setup, True),
        Label("loop", "read {}", data.loop, True),
        Label("file", "in {}", file, True),
        Label("repeat", "in repeat {}", data.repeat, True),
        Label("clamp", "in clamping ({})", clamp, False),
        Label("point", "at point {}", data.point, False),
    ]
    kept, notes = [], []
    for label in found:
        count = len(set(label.values.tolist()))
        if count > MOST_LEVELS:
            notes.append(f"{label.name} has {count} levels: not tested one by one")
        elif count > 1:
            kept.append(label)
    return kept, notes
