"""Steps of an update: a fit with its errors, and the data's support for an effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.diagnosis.examination import FittedSize, fitted_sizes, held_errors, percent_of, rounded_errors
from toolpath_stiff.documents import Document, json_number, to_dict
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import HeldOut, error_falls, gain_in_standard_errors, held_out
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.machine.model import StrutLaw
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m


@dataclass(frozen=True)
class LadderStep:
    """One rung of the ladder: its fit to all readings, its errors over the readings of the tip.

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
    def of(cls, name: str, fit: Fit, data: Readings | Pulls, held: HeldOut | None = None) -> LadderStep:
        """Step made of a fit to data; `held`: its residuals at left-out points, if known."""
        left_out = (held or held_out(fit, data.point)).of_readings(data.tip)
        return cls(name, fit, left_out, data.tip, np.asarray(directions(data.of_tip)))

    @property
    def residual(self) -> FloatArray:
        """(m,) ln measured - ln modelled of the tip."""
        return self.fit.residual[self.tip]

    @property
    def error(self) -> float:
        """Mean of |modelled - measured| / measured over the readings of the tip."""
        return float(np.abs(np.expm1(-self.residual)).mean())

    @property
    def title(self) -> str:
        """The step's effects as "with a + b"; its name if it has none."""
        return f"with {' + '.join(self.fit.names)}" if self.fit.names else self.name

    @property
    def instruments(self) -> Sequence[str]:
        """Names of the step's instrument errors."""
        return [candidate.name for candidate in self.fit.candidates if candidate.effect.is_instrument]

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

    def law_ends(self, given: StrutLaw, widening: float) -> list[Document]:
        """Strut law at its lengths, N/um; None for a constant law's length and for deviations of a law kept."""
        law = scaled_law(given, self.fit.law)
        count = len(law.parameters)  # a constant law has one stiffness, which belongs to no length
        deviations = widening * np.sqrt(np.maximum(np.diag(self.fit.covariance)[:count], 0.0))
        lengths_mm = [None] if law.constant else [float(mm_from_m(x)) for x in (law.length_1, law.length_2)]
        stiffnesses = [n_per_um_from_n_per_m(stiffness) for stiffness in (law.stiffness_1, law.stiffness_2)[:count]]
        return [
            {
                "length_mm": length and json_number(length, 7),
                "stiffness": json_number(k),
                "sd": json_number(k * float(sd), 3) if self.fit.law_free else None,
            }
            for length, k, sd in zip(lengths_mm, stiffnesses, deviations, strict=True)
        ]

    def sizes(self, widening: float) -> dict[str, dict[str, FittedSize | str | int]]:
        """Effect -> key -> the element it acts on, or value, unit and 95 % interval."""
        sizes = fitted_sizes(self.fit, widening=widening)
        return {
            candidate.name: {key: value for key, value in candidate.choice if value not in ("", 0)}
            | sizes[candidate.name]
            for candidate in self.fit.candidates
        }

    def document(self, given: StrutLaw, widening: float, before: LadderStep | None) -> Document:
        """A step as an entry of update.json, with its gain over the step before, if there is one."""
        document = {
            "name": self.name,
            "effects": list(self.fit.names),
            **rounded_errors(self.residual),
            "findings": list(self.fit.findings),
            **held_errors(self.held),
            "by_direction": self.by_direction,
            "strut_law_N_per_um": self.law_ends(given, widening),
            "parameters": to_dict(self.sizes(widening)),
            "outliers": len(self.fit.scatter.wild),
        }
        if before is None:
            return document
        gain, fall = gain_in_standard_errors(before.held, self.held), float(error_falls(before.held, self.held).mean())
        return {
            **document,
            "held_out_gain_in_se": json_number(gain, 3),
            "held_out_se_percent": percent_of(abs(fall / gain), 3) if gain else None,
        }


@dataclass(frozen=True)
class Support:
    """The data's support for an effect, as in update.json.

    Attributes
    ----------
    effect, supported, reasons
        Its name; what is against it, sentences; nothing if it is supported.
    mean_abs_error_percent, held_out_error_percent
        With it, in sample and at left-out points.
    held_out_gain_in_se
        Fall of the error at left-out points over its standard error; None where nothing can be left out.
    likelihood_gain, threshold
        Twice the log likelihood gained, in units of the scatter that remains; what chance alone reaches.
    instruments
        Of an effect of the machine: errors of the instrument that predict left-out poses as well; of one of the
        instrument: effects of the machine.
    """

    effect: str
    supported: bool
    reasons: tuple[str, ...]
    mean_abs_error_percent: float | None
    held_out_error_percent: float | None
    held_out_gain_in_se: float | None
    likelihood_gain: float | None
    threshold: float | None
    instruments: tuple[str, ...] = ()


def dispersion(fit: Fit) -> float:
    """Weighted squares of a fit per degree of freedom, at least 1."""
    squares = float(fit.scatter.precision.squares(fit.residual))
    fitted = len(fit.free) + (2 if fit.law_free else 0)
    return max(1.0, squares / max(len(fit.residual) - fitted, 1))
