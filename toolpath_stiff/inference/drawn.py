"""Effects whose form was read off measurements, which those same measurements cannot confirm.

A form that was drawn through residuals fits them; that it does says nothing of other readings. So an effect carries the
marks of the readings that it was drawn from (`Effect.described_from`), and where they are among the readings that are
judged, it is `described`, not `identified`, until the others confirm it. They do if they are predicted better with the
effect than by any explanation without it that was tested, `none` among them: each of their points is left out in turn,
sizes and strut law are fitted to all the rest, and the log probability of what was left out, added up over the points,
must be higher by more than `CONFIRMS`.

A form that says nothing true of new readings, sized by the old ones, loses with them on average; that it gains
`CONFIRMS` all the same has a chance below 1 %: its gain is normal of mean -s^2 / 2 and variance s^2, and
(3 + s^2 / 2) / s is never less than sqrt(6). Where none of the readings is among those that it was drawn from, it is an
effect like any other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray
from toolpath_stiff.documents import Document, json_number
from toolpath_stiff.inference.covariances import Groups
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.inference.noise import Scatter
from toolpath_stiff.readings.measurements import Readings, reading_marks
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.sizes import joined

CONFIRMS = 3.0  # log probability that new readings must gain: odds of 20 to 1, strong evidence (Kass and Raftery 1995)
FEWEST_POINTS = 2  # of new readings: one pose alone cannot confirm a form


@dataclass(frozen=True)
class Drawn:
    """An explanation with effects whose form was read off some of the readings that judge it.

    Attributes
    ----------
    names
        Those effects.
    seen, new
        How many readings they were drawn from, and how many others there are.
    gain, rival
        Log probability of the new readings above that under the best explanation without these effects, and which that
        is; nan and "" where too few points are new.
    """

    names: tuple[str, ...]
    seen: int
    new: int
    gain: float = np.nan
    rival: str = ""

    @property
    def confirmed(self) -> bool:
        """True if the new readings confirm them."""
        return self.gain > CONFIRMS

    @property
    def document(self) -> Document:
        """Entry for `diagnose.json`."""
        return {
            "effects": list(self.names),
            "readings_seen": self.seen,
            "readings_new": self.new,
            "gain": json_number(self.gain, 4),
            "rival": self.rival,
            "confirmed": self.confirmed,
        }

    @property
    def reason(self) -> str:
        """Reason why it is confirmed or not, a sentence without its full stop."""
        form = f"the form of {joined(self.names)} was read off"
        if not self.new:
            return f"{form} these very readings, and that it fits them says nothing of others"
        form += f" {self.seen} of these {self.seen + self.new} readings"
        if np.isnan(self.gain):
            return f"{form}, and the {self.new} others are of fewer than {FEWEST_POINTS} points: too few to confirm it"
        return (
            f"{form}; the {self.new} others {'confirm' if self.confirmed else 'do not confirm'} it: their log "
            f"probability, predicted, is {self.gain:.1f} above {self.rival} (more than {CONFIRMS:g} confirms it)"
        )


def seen_readings(effects: Sequence[Effect], data: Readings) -> BoolArray:
    """(n,) True for readings from which the form of any of these effects was read off."""
    marks = {mark for effect in effects for mark in effect.described_from}
    return np.isin(reading_marks(data), sorted(marks)) if marks else np.zeros(len(data), dtype=bool)


def drawn(fit: Fit, others: Mapping[str, Fit], data: Readings) -> Drawn | None:
    """Status of an explanation whose effects were read off the readings; None if none of them was.

    Parameters
    ----------
    fit
        The explanation.
    others
        Explanations by name, `none` among them; those with effects that were drawn from these readings are passed over.
    data
        The n readings.
    """

    def drawn_here(other: Fit) -> list[Effect]:
        return [c.effect for c in other.candidates if seen_readings([c.effect], data).any()]

    effects = drawn_here(fit)
    if not effects:
        return None
    seen = seen_readings(effects, data)
    standing = Drawn(tuple(effect.name for effect in effects), int(seen.sum()), int((~seen).sum()))
    if len(np.unique(data.point[~seen])) < FEWEST_POINTS:
        return standing
    gains = {
        name: log_predictive(fit, data, seen, other.scatter) - log_predictive(other, data, seen, other.scatter)
        for name, other in others.items()
        if not drawn_here(other)
    }
    rival = min(gains, key=lambda name: gains[name])
    return replace(standing, gain=gains[rival], rival=rival)


def log_predictive(fit: Fit, data: Readings, seen: BoolArray, scatter: Scatter) -> float:
    """Log probability of the readings that are not `seen`, each point left out in turn, up to a constant.

    Given all other readings r_s, the left-out ones are normal: with A the inverse covariance of all residuals r, their
    weighted squares are (A r)_o^T A_oo^-1 (A r)_o (Rasmussen and Williams 2006, Gaussian Processes, A.6).
    """
    labels = np.where(seen, "seen", np.char.add("new ", data.point))
    moves = held_out(replace(fit, scatter=scatter), labels).moves
    precision, squares = scatter.precision, 0.0
    for move, out in zip(moves, Groups.by(labels).members(), strict=True):
        if not seen[out[0]]:
            pull = precision.times(fit.residual - fit.jacobian @ move)[out]
            squares += float(pull @ np.linalg.solve(precision.block(out), pull))
    return -0.5 * squares
