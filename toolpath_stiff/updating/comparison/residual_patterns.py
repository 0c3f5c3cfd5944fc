"""The patterns that residuals are searched for, and the sentences about those that are found.

A pattern is one direction of load, or all, and either some of the readings (a plane, a zone, a set-up, a clamping) or
the way they go with a variable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.effects.contract import about
from toolpath_stiff.updating.comparison.residual_structure import SIGNIFICANT, Found, Pattern
from toolpath_stiff.updating.comparison.residual_variables import Label, Variable, directions, varies
from toolpath_stiff.updating.readings.measurements import Measurements

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

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
    found: Found, pattern: Pattern, numbers: dict[str, Variable], residual: FloatArray, first: bool
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
    found: Found, pattern: Pattern, who: str, mean: float, readings: str, first: bool
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
