"""Sentences on patterns found in residuals."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import ALL
from toolpath_stiff.comparison.structure import FoundPattern, Pattern
from toolpath_stiff.stiffness.sizes import about

NOUGHT = 0.3  # share of a slope's change below which a residual counts as zero
SHARE = "share_of_"  # of the compliance; the element's name follows


def sentence(finding: FoundPattern, residual: FloatArray, first: bool) -> tuple[str, float]:
    """Sentence on a finding, and its size in per cent: mean of a level's readings, change from end to end of a slope.

    `first`: nothing was found before it, so that what it says is what the readings show as they are.
    """
    pattern, coefficient = finding.pattern, finding.coefficient
    who = {ALL: "all directions", "oblique": "oblique directions"}.get(pattern.direction, f"along {pattern.direction}")
    mean, count = float(residual[pattern.rows].mean()), int(pattern.rows.sum())
    readings = f"({count} reading{'' if count == 1 else 's'})"
    if pattern.given is None:
        return _level(finding, _capital(who), mean, readings, first)
    x, values = pattern.values[pattern.rows], pattern.given[pattern.rows]
    if pattern.kind == "curve":
        size = percent(coefficient * float(x.min()) - coefficient * float(x.max()))
        return (
            f"{_capital(who)} {_side(size)} against the model at middling values of {pattern.place} than at its "
            f"extremes, by {abs(size):.2g} % {readings}"
        ), size
    ends = [int(np.argmin(values)), int(np.argmax(values))]
    (low, high), (first_end, last_end) = values[ends].tolist(), (mean + coefficient * x[ends]).tolist()
    size, unit, largest = percent(last_end - first_end), f" {pattern.unit}".rstrip(), float(np.abs(values).max())
    text = (
        f"{who} {_side(size)} against the model as {pattern.place} grows, from "
        f"{percent(first_end):+.2g} % at {_short(low, largest)}{unit} to "
        f"{percent(last_end):+.2g} % at {_short(high, largest)}{unit} {readings}"
    )
    cause = _as_if(pattern, first_end, last_end, low / 100.0, high / 100.0)
    return (f"{cause}: {text}" if cause else _capital(text)), size


def _as_if(pattern: Pattern, first: float, last: float, low: float, high: float) -> str:
    """Words on the element whose wrong stiffness would make this slope over its share of the compliance; "" if none.

    An element's stiffness times f adds share (1 / f - 1) to the compliance, and nothing where the share is nothing.
    """
    if not pattern.variable.startswith(SHARE) or pattern.direction != ALL or high <= low:
        return ""
    change = last - first
    softer = 1.0 + float(np.expm1(-change)) / (high - low)
    if softer <= 0.0 or abs(first - change * low / (high - low)) > NOUGHT * abs(change):
        return ""
    off = 100.0 * (1.0 / softer - 1.0)
    element = pattern.variable.removeprefix(SHARE).replace("_", " ")
    return f"As if {element} were about {about(off)} % too {'soft' if off < 0.0 else 'stiff'}"


def _level(finding: FoundPattern, who: str, mean: float, readings: str, first: bool) -> tuple[str, float]:
    pattern, coefficient = finding.pattern, finding.coefficient
    place = f" {pattern.place}" if pattern.place else " everywhere" if pattern.direction == ALL else ""
    size, beside = percent(mean), percent(coefficient)
    whole = f"{abs(size):.2g} % {_side(size)} than modelled"
    if first or (mean * coefficient > 0 and abs(mean) > 0.5 * abs(coefficient)):
        return f"{who} {whole}{place} {readings}", size
    return (
        f"{who} {abs(beside):.2g} % {_side(beside)}{place} than the findings above explain: {whole} {readings}",
        beside,
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _short(value: float, largest: float) -> str:
    """A value to three digits; 0 if it is negligible beside the others."""
    if abs(value) < 1e-3 * largest:
        return "0"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def _side(change: float) -> str:
    return "softer" if change < 0.0 else "stiffer"


def percent(log_ratio: float) -> float:
    """A logarithm of a ratio, as a change in per cent."""
    return float(100.0 * np.expm1(log_ratio))
