"""What pulls say of a machine of elements: every effect that adds to a compliance is linear in the displacement.

A reading is y = sum_r c_r (s_r w)(s_r t) + noise, s_r the loads of the elements per wrench, w the pull, t what is read
(unit dummy load; Castigliano). With it every candidate is a column per unit of its size, fitted by non-negative least
squares (Lawson and Hanson 1974, chapter 23) under the noise, and judged by the misfit that is left, which is chi-square
where nothing is missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.machine.elements import SIX
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import effects_of_elements
from toolpath_stiff.stiffness.model import StiffnessModel, path_of_stance

ALIKE = 10.0  # chi-square: an explanation that leaves no more than this beside the best cannot be told from it
GAIN = 16.0  # chi-square that a name must gain over no effect, with some thirty candidates: under 1 in 500 by chance
SHAPES = 10  # values of a parameter that shapes an effect
WRONG = 1e-3  # probability of so large a misfit, below which something else is missing


@dataclass(frozen=True)
class Explanation:
    """An effect of the catalogue, on an element where it names one, fitted alone.

    `sizes` SI by parameter; `chi_square` that it leaves; `columns` (m, k) m per unit of each parameter.
    """

    effect: str
    element: str
    sizes: dict[str, float]
    chi_square: float
    columns: FloatArray

    @property
    def label(self) -> str:
        """Effect and element: "joint_torsion, joint 3"."""
        return ", ".join(filter(None, (self.effect, self.element)))


class PullModel:
    """What a model says to m pulls, and the columns by which it may be wrong."""

    def __init__(self, model: StiffnessModel, pulls: Pulls) -> None:
        self.model, self.pulls, self.machine = model, pulls, model.machine
        seen = model.conditions.columns(len(pulls))
        path = path_of_stance(model, pulls.stance, force=np.linalg.norm(pulls.wrench[:, :3], axis=1), **seen)
        rows = [load.rows(pulls.stance.position) for load in pulls.stance.loads]
        loads = [np.einsum("nri,ni->nr", part, pulls.wrench) for part in rows]
        self.path = replace(path, element_loads=np.concatenate(loads, axis=1))
        self._by_load = [
            load * np.einsum("nri,ni->nr", part, pulls.along) for load, part in zip(loads, rows, strict=True)
        ]
        compliances = [load.compliance for load in pulls.stance.loads]
        self.by_element = np.stack(
            [(part * c).sum(axis=1) for part, c in zip(self._by_load, compliances, strict=True)], axis=1
        )
        self.predicted = self.by_element.sum(axis=1) + sum(self.column_of(active) for active in model.effects)

    def column_of(self, active: ActiveEffect) -> FloatArray:
        """(m,) m that an effect adds to the readings."""
        added = np.zeros(len(self.pulls))
        form, more = active.adds("load_compliance", self.path), active.adds("element_compliance", self.path)
        if form is not None:
            added += np.einsum("ni,nij,nj->n", self.pulls.along, form[:, 6:, 6:], self.pulls.wrench)
        if more is not None:
            added += (more * np.concatenate(self._by_load, axis=1)).sum(axis=1)
        return added

    def torsions(self) -> tuple[list[str], FloatArray]:
        """Names of the joints that turn, and (m, j) m per rad/(N m) of torsion."""
        names, columns = [], []
        for element, part in zip(self.machine.elements, self._by_load, strict=True):
            if element.link == "joints" and element.directions == SIX:
                names.append(element.name)
                columns.append(part[:, 5])
        return names, np.stack(columns, axis=1) if columns else np.empty((len(self.pulls), 0))

    def candidates(self) -> list[tuple[str, str, dict[str, float], list[str], FloatArray]]:
        """Effect, element, what is held, parameters and (m, k) columns per SI unit of each, of what changes anything.

        A parameter that changes nothing by itself shapes what others do: held at values over its typical range.
        """
        rows = []
        for name, effect in effects_of_elements().items():
            real = [p for p in effect.parameters if not p.discrete]
            if effect.is_instrument or any(p.name == "setup" for p in effect.parameters):
                continue
            by_element = len(real) < len(effect.parameters)
            for element in [e.name for e in self.machine.elements] if by_element else [""]:
                on = {"element": element} if element else {}
                if by_element and (effect.link == "joints") != self._turns(element):
                    continue  # of a joint that turns, what joints do; of others all that they give
                none = {p.name: p.neutral * p.si for p in real}
                units = [none | {p.name: 0.5 if p.name == "factor" else 1.0} for p in real]
                alone = [self.column_of(ActiveEffect(effect, on | values)).any() for values in units]
                sized, shapes = (
                    [p.name for p, acts in zip(real, alone, strict=True) if acts == of] for of in (True, False)
                )
                tried = [p.si * np.geomspace(*p.typical, SHAPES) for p in real if p.name in shapes]
                for held in product(*tried) if sized else ():
                    fixed = dict(zip(shapes, map(float, held), strict=True))
                    with_shape = [values | fixed for values, acts in zip(units, alone, strict=True) if acts]
                    columns = [self.column_of(ActiveEffect(effect, on | values)) for values in with_shape]
                    rows.append((name, element, fixed, sized, np.stack(columns, axis=1)))
        return rows

    def _turns(self, name: str) -> bool:
        return any(e.name == name and e.link == "joints" and e.directions == SIX for e in self.machine.elements)


def whitening(model: PullModel, sd: FloatArray, spread: float) -> FloatArray:
    """(m, m) that makes noise of sd (m,) m and elements alike to a relative `spread` independent and of unit size."""
    covariance = np.diag(sd**2) + spread**2 * model.by_element @ model.by_element.T
    return np.linalg.inv(np.linalg.cholesky(covariance))


def explanations(model: PullModel, white: FloatArray) -> tuple[float, list[Explanation]]:
    """Chi-square without any effect; each candidate fitted alone, that with the least misfit first."""
    rest = white @ (model.pulls.value - model.predicted)
    best: dict[tuple[str, str], Explanation] = {}
    for effect, element, held, names, columns in model.candidates():
        size, left = non_negative(white @ columns, rest)
        if (effect, element) not in best or left < best[effect, element].chi_square:
            sizes = held | dict(zip(names, size.tolist(), strict=True))
            best[effect, element] = Explanation(effect, element, sizes, left, columns)
    return float(rest @ rest), sorted(best.values(), key=lambda row: row.chi_square)


def non_negative(columns: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    """(k,) sizes of 0 or more that leave the least squares, and what they leave."""
    from scipy.optimize import nnls

    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    size, left = nnls(columns / scale, values)
    return size / scale, float(left**2)


def left_out(columns: FloatArray, values: FloatArray, fixed: FloatArray, sd: FloatArray, pose: IntArray) -> FloatArray:
    """(m,) what a fit of columns beside the fixed part says of the readings of each pose without these."""
    predicted = np.empty_like(values)
    for number in np.unique(pose):
        here = pose == number
        size, _ = non_negative(columns[~here] / sd[~here, None], (values - fixed)[~here] / sd[~here])
        predicted[here] = fixed[here] + columns[here] @ size
    return predicted


def verdict_of(chi_square: float, rows: Sequence[Explanation], count: int) -> tuple[str, list[Explanation]]:
    """The verdict as a diagnosis of a hexapod has it, and the explanations that it leaves.

    "adequate": nothing is missing that shows; "identified": one; "ambiguous": several, alike; "unexplained": none.
    """
    from scipy.stats import chi2

    best = rows[0]
    if chi_square - best.chi_square < GAIN and chi2.sf(chi_square, count) > WRONG:
        return "adequate", []
    if chi2.sf(best.chi_square, max(count - len(best.sizes), 1)) < WRONG or chi_square - best.chi_square < GAIN:
        return "unexplained", []
    alike = [row for row in rows if row.chi_square - best.chi_square < ALIKE]
    return "identified" if len(alike) == 1 else "ambiguous", alike
