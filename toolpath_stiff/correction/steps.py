"""The steps of an update: a fit with its errors, and how far the data support an effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.diagnosis.rows import FittedSize, interval, percent_of, rounded_errors
from toolpath_stiff.documents import Document, json_number
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import HeldOut, held_out, of_readings
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.machine.model import StrutLaw
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m


@dataclass(frozen=True)
class LawEnd:
    """The strut law at one length, N/um; of a constant law at every length, which is None then."""

    length_mm: float | None
    stiffness: float | None
    sd: float | None


@dataclass(frozen=True)
class LadderStep:
    """One rung of the ladder: its fit to all readings, its errors over those of the tip.

    Attributes
    ----------
    name, fit
        What it is called; its fit, that of loops beside the tip included.
    held
        Of the m readings of the tip at left-out points.
    tip, along
        (n,) which readings these are; (m,) their directions.
    """

    name: str
    fit: Fit
    held: HeldOut
    tip: NDArray[np.bool_]
    along: NDArray[np.str_]

    @classmethod
    def of(cls, name: str, fit: Fit, data: Readings, held: HeldOut | None = None) -> LadderStep:
        """Of a fit to these data; `held`: its residuals at left-out points, where they are known."""
        left_out = held_out(fit, data.point) if held is None else held
        return cls(name, fit, left_out.of_readings(data.tip), data.tip, np.asarray(directions(data.of_tip)))

    @property
    def residual(self) -> FloatArray:
        """(m,) ln measured - ln modelled of the tip."""
        return self.fit.residual[self.tip]

    @property
    def error(self) -> float:
        """Mean of |modelled - measured| / measured over the readings of the tip."""
        return float(of_readings(self.fit, self.tip).errors.mean())

    @property
    def title(self) -> str:
        """Its effects, "with a + b"; its name where it has none."""
        return f"with {' + '.join(self.fit.names)}" if self.fit.names else self.name

    @property
    def by_direction(self) -> dict[str, Document]:
        """Direction of the load -> readings and their errors, per cent."""
        return {
            name: {
                "readings": int((self.along == name).sum()),
                **rounded_errors(self.residual[self.along == name]),
                "held_out_error_percent": percent_of(float(self.held.errors[self.along == name].mean())),
            }
            for name in np.unique(self.along).tolist()
        }

    def law_ends(self, given: StrutLaw, widening: float) -> list[LawEnd]:
        """The strut law at its lengths; no standard deviations where it was kept."""
        law = scaled_law(given, self.fit.law)
        count = len(law.parameters)  # of a constant law one, which belongs to no length
        deviations = widening * np.sqrt(np.maximum(np.diag(self.fit.covariance)[:count], 0.0))
        ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))[:count]
        return [
            LawEnd(
                None if law.constant else json_number(float(mm_from_m(length)), 7),
                json_number(n_per_um_from_n_per_m(stiffness)),
                json_number(n_per_um_from_n_per_m(stiffness) * float(deviation), 3) if self.fit.law_free else None,
            )
            for (length, stiffness), deviation in zip(ends, deviations, strict=True)
        ]

    def sizes(self, widening: float) -> dict[str, dict[str, FittedSize | str | int]]:
        """Effect -> key -> what it acts on, or value, unit and 95 % interval."""
        sizes: dict[str, dict[str, FittedSize | str | int]] = {}
        fit, index = self.fit, 0
        for candidate, values in zip(fit.candidates, fit.sizes, strict=True):
            entry = sizes[candidate.name] = {key: value for key, value in candidate.choice if value not in ("", 0)}
            for component, size in zip(candidate.components, values.tolist(), strict=True):
                ends = interval(fit, index, component, size)
                if index in fit.free:
                    reach = NORMAL_95 * widening * fit.deviation(index)
                    ends = max(size - reach, component.bounds[0]), min(size + reach, component.bounds[1])
                si = component.parameter.si
                low, high = (json_number(value) for value in sorted(component.value(end) / si for end in ends))
                value = json_number(component.value(size) / si)
                entry[component.parameter.key] = FittedSize(value, component.parameter.unit, (low, high))
                index += 1
        return sizes


@dataclass(frozen=True)
class Support:
    """How far the data support an effect.

    Attributes
    ----------
    effect
        Its name.
    gain_in_se
        Fall of the error at left-out points over its standard error; nan where nothing can be left out.
    error, held_out_error
        Mean errors with it, in sample and at left-out points.
    likelihood_gain, threshold
        Twice the log likelihood gained, in units of the scatter that remains; what chance alone reaches.
    reasons
        What is against it, sentences; none if it is supported.
    """

    effect: str
    gain_in_se: float
    error: float
    held_out_error: float
    likelihood_gain: float
    threshold: float
    reasons: tuple[str, ...]

    @property
    def supported(self) -> bool:
        """True where nothing speaks against it."""
        return not self.reasons


def dispersion(fit: Fit) -> float:
    """Weighted squares of a fit over their degrees of freedom, at least 1."""
    squares = float(fit.scatter.precision.squares(fit.residual))
    fitted = len(fit.free) + (2 if fit.law_free else 0)
    return max(1.0, squares / max(len(fit.residual) - fitted, 1))
