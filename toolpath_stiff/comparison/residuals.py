"""What residuals are held against: every column of the data, and every quantity that the model does not use.

A `Variable` is numbers (height, time, force), a `Label` is names (set-up, clamping, plane). Planes are groups of
heights, zones are distances from the machine's axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, TextArray
from toolpath_stiff.comparison.structure import SIGNIFICANT, FoundPattern, Pattern
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.stiffness.contract import about
from toolpath_stiff.units import deg_from_rad, min_from_s, mm_from_m, n_per_mm_from_n_per_m, um_from_m

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
        ("time_min", Variable("time_min", "the time since zeroing", "min", min_from_s(data.time))),
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


FEWEST = 2  # readings in a level; a single one is a reading, not a pattern


CURVED = ("order", "time_min", "height", "mean_strut_length")  # variables whose curvature is looked for too


ALL = "all"


NOUGHT = 0.3  # of a course's change: a residual below is nothing beside it


SHARE = "share_of_strut_"  # of the compliance; the strut's number follows


def patterns(data: Measurements, numbers: list[Variable], names: list[Label]) -> list[Pattern]:
    """Everything that is looked for in n residuals; patterns equal to one before are only named with it."""
    kept: dict[bytes, list[Pattern]] = {}
    for one in _candidates(data, numbers, names):
        centred = one.values - one.values.mean() if one.kind != "level" else one.values
        size = float(np.linalg.norm(centred))
        if size > 1e-9:
            key = np.round(centred / size * np.sign(centred[np.argmax(np.abs(centred))]), 7) + 0.0
            kept.setdefault(key.tobytes(), []).append(one)
    return [replace(first, same=tuple(one.name for one in others)) for first, *others in kept.values()]


def _candidates(data: Measurements, numbers: list[Variable], names: list[Label]) -> Iterator[Pattern]:
    along = directions(data)
    whole = np.ones(len(data), dtype=bool)
    groups = {ALL: whole}
    if len(set(along.tolist())) > 1:
        groups |= {str(axis): along == axis for axis in np.unique(along)}
    for group, rows in groups.items():
        if rows.sum() >= FEWEST or group == ALL:
            yield _level("everywhere", group, rows, "")
    for label in names:
        for group, rows in groups.items() if label.by_direction else [(ALL, whole)]:
            for level in np.unique(label.values):
                yield from _level_if(f"{label.name} {level}", group, rows & (label.values == level), label.words(level))
    by_name = {label.name: label for label in names}
    if "plane" in by_name and "zone" in by_name:
        yield from _cells(by_name["plane"], by_name["zone"], groups)
    for variable in numbers:
        for group, rows in groups.items():
            yield from _slopes(variable, group, rows)


def _cells(plane: Label, zone: Label, groups: dict[str, BoolArray]) -> Iterator[Pattern]:
    for group, rows in groups.items():
        for here in np.unique(zone.values):
            for level in np.unique(plane.values):
                chosen = rows & (plane.values == level) & (zone.values == here)
                yield from _level_if(f"zone {here}, plane {level}", group, chosen, f"{here} {plane.words(level)}")


def _level_if(variable: str, group: str, rows: BoolArray, place: str) -> Iterator[Pattern]:
    if rows.sum() >= FEWEST:
        yield _level(variable, group, rows, place)


def _level(variable: str, group: str, rows: BoolArray, place: str) -> Pattern:
    return Pattern(f"{group}: {variable}", variable, group, "level", rows.astype(float), rows, place)


def _slopes(variable: Variable, group: str, rows: BoolArray) -> Iterator[Pattern]:
    known = rows & np.isfinite(variable.values)
    if not varies(variable.values[known]):
        return
    x = np.where(known, variable.values, 0.0)
    x = np.where(known, x - x[known].mean(), 0.0) / float(x[known].std())
    yield Pattern(f"{group}: {variable.name}", variable.name, group, "slope", x, known, variable.title)
    if variable.name in CURVED and len(np.unique(np.round(x[known], 9))) >= 4:
        bent = np.where(known, x**2, 0.0)
        slope = np.stack([known.astype(float), x], axis=1)
        bent = bent - slope @ np.linalg.lstsq(slope, bent, rcond=None)[0]
        yield Pattern(f"{group}: {variable.name} squared", variable.name, group, "curve", bent, known, variable.title)


def sentence(
    found: FoundPattern, pattern: Pattern, numbers: dict[str, Variable], residual: FloatArray, first: bool
) -> tuple[str, float]:
    """A finding in words, and its size in per cent: of a level the readings' mean, of a slope the change end to end.

    `first`: nothing was found before it, so that what it says is what the readings show as they are.
    """
    who = {ALL: "all directions", "oblique": "oblique directions"}.get(pattern.direction, f"along {pattern.direction}")
    mean, count = float(residual[pattern.rows].mean()), int(pattern.rows.sum())
    readings = f"{count} reading{'' if count == 1 else 's'}"
    if pattern.kind == "level":
        return _level_words(found, pattern, who, mean, readings, first)
    x = pattern.values[pattern.rows]
    values = numbers[pattern.variable].values[pattern.rows]
    if pattern.kind == "curve":
        middle, ends = found.coefficient * float(x.min()), found.coefficient * float(x.max())
        size = percent(middle - ends)
        how = "stiffer" if middle > ends else "softer"
        return (
            f"{_capital(who)} {how} against the model at middling values of {pattern.place} than at its extremes, by "
            f"{abs(size):.2g} % ({readings})"
        ), size
    low, high = int(np.argmin(values)), int(np.argmax(values))
    first_end, last_end = mean + found.coefficient * float(x[low]), mean + found.coefficient * float(x[high])
    size = percent(last_end - first_end)
    unit = f" {numbers[pattern.variable].unit}".rstrip()
    text = (
        f"{who} {'stiffer' if size > 0 else 'softer'} against the model as {pattern.place} grows, from "
        f"{signed(percent(first_end))} at {_short(values[low], values)}{unit} to {signed(percent(last_end))} at "
        f"{_short(values[high], values)}{unit} ({readings})"
    )
    sure = found.p_adjusted < SIGNIFICANT
    cause = (
        _as_if(pattern, first_end, last_end, float(values[low]) / 100.0, float(values[high]) / 100.0) if sure else ""
    )
    return (f"{cause}: {text}" if cause else _capital(text)), size


def _as_if(pattern: Pattern, first: float, last: float, low: float, high: float) -> str:
    """Which strut of what stiffness would make such a course from its low to its high share of the compliance, or "".

    A strut's stiffness times f adds share (1 / f - 1) to the compliance, and nothing where the share is nothing.
    """
    if not pattern.variable.startswith(SHARE) or pattern.direction != ALL or high <= low:
        return ""
    change = last - first
    without = first - change * low / (high - low)
    softer = 1.0 + float(np.expm1(-change)) / (high - low)
    if softer <= 0.0 or abs(without) > NOUGHT * abs(change):
        return ""
    off = 100.0 * (1.0 / softer - 1.0)
    strut = pattern.variable.removeprefix(SHARE)
    return f"As if strut {strut} were about {about(off)} % too {'soft' if off < 0.0 else 'stiff'}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _short(value: float, values: FloatArray) -> str:
    """A value to three digits; 0 where it is nothing beside the others."""
    if abs(value) < 1e-3 * float(np.abs(values).max()):
        return "0"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def _level_words(
    found: FoundPattern, pattern: Pattern, who: str, mean: float, readings: str, first: bool
) -> tuple[str, float]:
    place = f" {pattern.place}" if pattern.place else " everywhere" if pattern.direction == ALL else ""
    size, own = percent(mean), percent(found.coefficient)
    whole = f"{abs(size):.2g} % {_side(size)} than modelled"
    if first or (mean * found.coefficient > 0 and abs(mean) > 0.5 * abs(found.coefficient)):
        return f"{_capital(who)} {whole}{place} ({readings})", size
    return (
        f"{_capital(who)} {abs(own):.2g} % {_side(own)}{place} than the findings above explain: {whole} ({readings})"
    ), own


def _side(change: float) -> str:
    return "softer" if change < 0.0 else "stiffer"


def percent(log_ratio: float) -> float:
    """A logarithm of a ratio as a change in per cent."""
    return float(100.0 * np.expm1(log_ratio))


def signed(value: float) -> str:
    """A size in per cent with its sign."""
    return f"{value:+.2g} %"
