"""Candidates: each effect of the catalogue with the elements it may act on, and its compliance as a function of size.

A candidate is an effect with a choice (which strut, which set-up). Its compliance is added to that of the base model,
c = c_0(law) + delta(size): exact for whatever gives way in series, a good local description of the rest. The model
itself is evaluated at some sizes only; the searches and bootstraps run on the interpolated `delta`. What is reported is
refitted with the model itself afterwards.

Sizes count from the neutral value: `value - neutral`, or `1 / value` where neutral is an infinite stiffness.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any, Self

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.contract import ELEMENT, Effect, Parameter
from toolpath_stiff.stiffness.effects.joint_offset import JointOffset

SMALLEST, LARGEST = 2e-3, 0.7  # rms change of ln stiffness between which sizes are tabulated
POINTS = 9  # sizes a sign
CROWDED = 2.5  # power by which knots crowd towards large sizes: delta / size is constant at first and bends later
MOST_COMPONENTS = 4  # effects with more real parameters are tried in full and one by one only
MOST_TRIALS = 12  # trials for a size that makes a small change
INVISIBLE = 1e-7  # rms change of ln stiffness below which a choice has no effect on these data
Knots = tuple[FloatArray, FloatArray]  # ln size (g,), delta / size (g, n)
Delta = Callable[[float], FloatArray | None]  # size -> (n,) m/N added; None where the model has no answer


@dataclass(frozen=True)
class Component:
    """One real parameter of an effect, as a size from its neutral value.

    Attributes
    ----------
    parameter
        The parameter; values are its SI values.
    inverse
        Whether the size is 1 / value.
    bounds
        (low, high) of the size, one of them 0 or 0 between them.
    """

    parameter: Parameter
    inverse: bool
    bounds: tuple[float, float]

    @classmethod
    def of(cls, parameter: Parameter) -> Self:
        """The component of a real parameter."""
        low, high = (value * parameter.si for value in parameter.bounds)
        if np.isinf(parameter.neutral):
            return cls(parameter, True, (0.0 if np.isinf(high) else 1.0 / high, 1.0 / low if low > 0.0 else np.inf))
        neutral = parameter.neutral * parameter.si
        return cls(parameter, False, (low - neutral, high - neutral))

    def value(self, size: float) -> float:
        """SI value of the parameter."""
        if self.inverse:
            return np.inf if size == 0.0 else 1.0 / size
        return self.parameter.neutral * self.parameter.si + size

    def size(self, value: float) -> float:
        """Size of an SI value: the inverse of `value`."""
        if self.inverse:
            return 0.0 if np.isinf(value) else 1.0 / value
        return value - self.parameter.neutral * self.parameter.si

    @property
    def signs(self) -> tuple[float, ...]:
        """Directions in which the size may go from 0."""
        return tuple(sign for sign, bound in zip((-1.0, 1.0), self.bounds, strict=True) if sign * bound > 0.0)

    def reach(self, sign: float) -> float:
        """Largest size in a direction, as a positive number."""
        return abs(self.bounds[0] if sign < 0.0 else self.bounds[1])

    def allows(self, size: float) -> bool:
        """True if a nonzero size lies within its bounds."""
        sign = float(np.sign(size))
        return sign in self.signs and abs(size) <= self.reach(sign)

    def typical(self) -> tuple[float, float]:
        """Smallest and largest usual size, as positive numbers; 0 and inf if none is stated."""
        low, high = self.parameter.typical
        ends = [abs(self.size(end * self.parameter.si)) if end or not self.inverse else np.inf for end in (low, high)]
        return 0.0 if low < self.parameter.neutral < high else min(ends), max(ends)


@dataclass(frozen=True)
class Candidate:
    """An effect with the elements it acts on.

    Attributes
    ----------
    effect, choice
        The effect; values of its discrete parameters.
    components
        Its real parameters.
    """

    effect: Effect
    choice: tuple[tuple[str, Any], ...]
    components: tuple[Component, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    def active(self, sizes: Sequence[float] | FloatArray) -> ActiveEffect:
        """The effect with these sizes (p,)."""
        values = {c.parameter.name: c.value(float(s)) for c, s in zip(self.components, sizes, strict=True)}
        return ActiveEffect(self.effect, dict(self.choice) | values)

    @property
    def label(self) -> str:
        """Name and choice of the effect, for people."""
        chosen = ", ".join(choice_text(key, value) for key, value in self.choice if value not in ("", 0))
        return f"{self.name} ({chosen})" if chosen else self.name

    def subsets(self) -> Iterator[tuple[int, ...]]:
        """Sets of components that may differ from neutral together."""
        count = len(self.components)
        some = (count,) if self.effect.vector else (1, count)
        for size in range(1, count + 1) if count <= MOST_COMPONENTS and not self.effect.vector else some:
            yield from combinations(range(count), size)


def testable_effects(predictor: Predictor) -> tuple[tuple[Effect, ...], dict[str, tuple[str, ...]]]:
    """Effects of the catalogue and of the user's files, not yet in the machine, that the data can test.

    And those that they cannot, with the columns that are missing.
    """
    known = known_effects(predictor.effect_files)
    present = {active.effect.name for active in (*predictor.base.effects, *predictor.base.instruments)}
    cannot = predictor.data.cannot_test(known.values())
    return tuple(e for name, e in known.items() if name not in cannot and name not in present), cannot


def choice_text(key: str, value: Any) -> str:
    """A choice in words: "strut 3", "direction Z"; the catalogue numbers directions 1, 2, 3."""
    if key == "direction" and value in (1, 2, 3):
        return f"direction {'XYZ'[value - 1]}"
    return f"{key} {value}"


def candidates_of(effect: Effect, data: Readings | Pulls, elements: Sequence[str] = ()) -> list[Candidate]:
    """Candidates of an effect, one for each choice. Of several discrete parameters only one leaves its default.

    `elements`: those of the machine that it may act on.
    """
    real = tuple(Component.of(parameter) for parameter in effect.parameters if not parameter.discrete)
    discrete = [parameter for parameter in effect.parameters if parameter.discrete]
    if not discrete:
        return [Candidate(effect, (), real)] if real else []
    alone, setups = len(discrete) == 1, sorted(set(data.setup.tolist()) - {""})
    defaults: dict[str, str | int] = {parameter.name: "" if parameter.kind == "text" else 0 for parameter in discrete}
    choices: list[dict[str, str | int]] = []
    for parameter in discrete:
        if parameter.kind != "text":
            low, high = (int(bound) for bound in parameter.bounds)
            choices += [{parameter.name: value} for value in range(low, high + 1) if alone or value != 0]
        elif parameter.name == ELEMENT:
            choices += [{ELEMENT: name} for name in elements]
        elif alone or len(setups) > 1:  # a single set-up covers all readings, as other choices do
            choices += [{parameter.name: name} for name in setups]
    return [Candidate(effect, tuple((defaults | choice).items()), real) for choice in choices]


def spline(knots: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Positions (...,) -> (..., n): the cubic spline through values (g, n) at knots (g,) in rising order.

    Twice continuously differentiable, a single cubic over each two end pieces and beyond ("not-a-knot": de Boor 1978, A
    Practical Guide to Splines, chapter IV): powers, and from each further knot on a cubic more.
    """
    start, reach = knots[0], knots[-1] - knots[0]
    further = (knots[2:-2] - start) / reach

    def columns(positions: FloatArray) -> FloatArray:
        x = ((positions - start) / reach)[..., None]
        powers = x ** np.arange(min(4, len(knots)))
        return np.concatenate([powers, np.maximum(x - further, 0.0) ** 3], axis=-1)

    weights = np.linalg.solve(columns(knots), values)
    return lambda positions: np.asarray(columns(positions) @ weights)


class CandidateTable:
    """`delta`, (n,) m/N that a candidate adds to the compliance at each reading, as a function of its sizes.

    One component: tabulated over its size and interpolated (delta / size over ln size, which is almost constant).
    Several: linear in each, from one size of each.

    Attributes
    ----------
    candidate
        The candidate.
    columns
        (n, p) m/N per unit of size, small sizes.
    knots
        Sign -> (ln size (g,), delta / size (g, n)); worked out when it is first asked for: columns often suffice.
    """

    def __init__(self, candidate: Candidate, columns: FloatArray, knots: Callable[[], dict[float, Knots]]) -> None:
        self.candidate, self.columns, self._knots = candidate, columns, knots

    @cached_property
    def knots(self) -> dict[float, Knots]:
        """Tabulated sizes of each sign."""
        return self._knots()

    @cached_property
    def _splines(self) -> dict[float, Callable[[FloatArray], FloatArray]]:
        return {sign: spline(logs, ratio) for sign, (logs, ratio) in self.knots.items()}

    def delta(self, sizes: FloatArray) -> FloatArray:
        """(..., n) for sizes (..., p)."""
        size, out = sizes[..., 0], np.asarray(sizes @ self.columns.T)  # linear on a side without knots
        for sign, course in self._splines.items():
            logs = self.knots[sign][0]
            where = size * sign > 0.0
            if where.any():
                position = np.clip(np.log(np.abs(size[where])), logs[0], logs[-1])
                out[where] = course(position) * size[where][..., None]
        return out

    def slope(self, sizes: FloatArray) -> FloatArray:
        """(n, p) d delta / d size at sizes (p,)."""
        size = float(sizes[0])
        if not self.knots or size == 0.0:
            return self.columns
        step = 1e-4 * max(abs(size), 1e-12)
        ends = self.delta(np.array([[size + step], [size - step]]))
        return np.asarray((ends[0] - ends[1])[:, None] / (2.0 * step))


def table_of(candidate: Candidate, predictor: Predictor) -> CandidateTable | None:
    """Table of a candidate at the machine file's own strut law, made once for a set of readings."""
    key = (candidate.name, candidate.choice)
    if key not in predictor.tables:
        joint = dict(candidate.choice).get("joint") if isinstance(candidate.effect, JointOffset) else None
        known = None if joint is None else _of_joint(candidate, predictor, joint)
        predictor.tables[key] = known or tabulate(candidate, predictor, np.zeros(2))
    table: CandidateTable | None = predictor.tables[key]
    return table


def _of_joint(candidate: Candidate, predictor: Predictor, joint: int) -> CandidateTable:
    """Table of a displaced joint, from the columns already computed for the nuisance of the joints."""
    logs = predictor.joint_columns[:, 3 * (joint - 1) : 3 * joint]
    return CandidateTable(candidate, -np.exp(-predictor.log_stiffness())[:, None] * logs, dict)


def tabulate(
    candidate: Candidate, predictor: Predictor, law: FloatArray, beside: Sequence[ActiveEffect] = ()
) -> CandidateTable | None:
    """Table of a candidate at a strut law, beside other effects; None if it has no effect on these data."""
    compliance = np.exp(-predictor.log_stiffness(law, beside))

    def along(unit: FloatArray) -> Delta:
        def delta(size: float) -> FloatArray | None:
            logs = predictor.log_stiffness(law, [*beside, candidate.active(size * unit)])
            return None if np.isnan(logs).any() else np.asarray(np.exp(-logs) - compliance)

        return delta

    components = candidate.components
    columns, starts = np.zeros((len(compliance), len(components))), {}
    for j, component in enumerate(components):
        for sign in component.signs:
            delta = along(sign * np.eye(len(components))[j])
            start = _size_for(component, sign, delta, compliance)
            added = None if start is None else delta(start)
            if start is not None and added is not None:
                columns[:, j], starts[sign] = added / (start * sign), start
    if not columns.any():
        return None

    def knots() -> dict[float, Knots]:
        signs = starts.items() if len(components) == 1 else ()
        return {sign: _knots(components[0], sign, start, along(np.ones(1)), compliance) for sign, start in signs}

    return CandidateTable(candidate, columns, knots)


def _rms(delta: FloatArray, compliance: FloatArray) -> float:
    """Rms change of ln stiffness."""
    return float(np.sqrt(np.mean(np.log1p(np.maximum(delta / compliance, -0.999)) ** 2)))


def _size_for(component: Component, sign: float, delta: Delta, compliance: FloatArray) -> float | None:
    """A size at which ln stiffness changes by about `SMALLEST`, or the largest; None if nothing changes."""
    reach = component.reach(sign)
    size = min(max(component.typical()), reach)
    if not np.isfinite(size) or size <= 0.0:
        size = reach if np.isfinite(reach) else 1.0
    for _ in range(MOST_TRIALS):
        added = delta(size)
        if added is None:
            size *= 0.1
            continue
        rms = _rms(added, compliance)
        if rms < INVISIBLE:
            return None
        if 0.3 * SMALLEST < rms < 3.0 * SMALLEST or (rms < SMALLEST and size == reach):
            return size
        size = min(size * SMALLEST / rms, reach)
    return size


def _knots(component: Component, sign: float, start: float, delta: Delta, compliance: FloatArray) -> Knots:
    """Ln sizes and delta / size, from a small size up to a large effect or the bound."""
    end = min(start * LARGEST / SMALLEST, component.reach(sign))
    while end > 1.001 * start:
        added = delta(sign * end)
        if added is not None and _rms(added, compliance) < 2.0:
            break
        end = max(0.7 * end, start)
    share = 1.0 - (1.0 - np.linspace(0.0, 1.0, POINTS)) ** CROWDED
    sizes = start * (max(end, 1.01 * start) / start) ** share
    sizes[-1] = min(sizes[-1], component.reach(sign))
    ratios: list[FloatArray] = []
    for size in sizes:
        added = delta(sign * size)
        if added is None:
            break
        ratios.append(added / (sign * size))
    if len(ratios) < 2:
        return np.log([start, 1.01 * start]), np.array([ratios[0], ratios[0]])
    return np.log(sizes[: len(ratios)]), np.array(ratios)
