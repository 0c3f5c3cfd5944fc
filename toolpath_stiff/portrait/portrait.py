"""A portrait of what is missing: link of the load path, direction, variable it depends on, size.

Where no effect of the catalogue explains the readings, or where the best explanation leaves something, one to three
terms of a dictionary of machine mechanics (`dictionary`, `terms`) are chosen (`selection`) and put in words (`words`).
What else would look the same is said by probabilities over the whole dictionary, summed by link and by variable.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.fits import fit_effects
from toolpath_stiff.inference.gates import simulate
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.portrait.choice import Leading, choose, fewest, summed
from toolpath_stiff.portrait.columns import Ground
from toolpath_stiff.portrait.selection import Description, Selection
from toolpath_stiff.stiffness.terms import Term

MOST_LINKS, MOST_VARIABLES, MOST_ALIKE = 4, 3, 4
SHOWN = 0.03  # probability from which another term is told
FLOOR_DRAWS = 40
MOST_READINGS = 1000  # of more no portrait is drawn: every term of the dictionary is searched on every reading


@dataclass(frozen=True)
class Sized:
    """A term with its size (SI), 95 % interval, rms change of stiffness, and probability."""

    term: Term
    interval: tuple[float, float]
    rms: float
    probability: float | None = None


# Times the noise at left-out points. Simulated campaigns give the noise there to some 5 %; of 65 portraits those that
# stayed above had the wrong link oftener (docs/diagnose.md).
LACKING = 1.3


@dataclass(frozen=True)
class Portrait:
    """Description of what is missing, as far as the readings tell.

    Attributes
    ----------
    terms
        One to three, the leading one first; none where nothing stands out from chance.
    links, variables
        Name -> probability, the likeliest first, the fewest that hold 90 %; empty where more than four links would be
        needed.
    alike
        Other leading terms that fit as well.
    explained
        Share of the weighted squares above noise that the terms take.
    error, held_out_rms, noise_floor
        Mean error with the terms; rms error at left-out points; what noise alone leaves there.
    look_elsewhere
        How often the best of the whole dictionary gains as much by chance.
    before, after, signature
        (n,) residuals of the base and with the terms; change of ln stiffness by the leading term.
    values
        (n,) of the leading term's variable, SI; None where each strut has its own, or it is constant.
    """

    terms: tuple[Sized, ...] = ()
    links: tuple[tuple[str, float], ...] = ()
    variables: tuple[tuple[str, float], ...] = ()
    alike: tuple[Sized, ...] = ()
    explained: float = 0.0
    error: float = np.nan
    held_out_rms: float = np.nan
    noise_floor: float = np.nan
    look_elsewhere: float = 1.0
    before: FloatArray | None = None
    after: FloatArray | None = None
    signature: FloatArray | None = None
    values: FloatArray | None = None

    @property
    def lacking(self) -> bool:
        """True if the terms only stand in for something that the dictionary lacks: they leave more than noise."""
        return bool(self.terms and self.held_out_rms > LACKING * self.noise_floor)


def draw_portrait(problem: Problem, base: Fit, noise: Noise, seed: int) -> Portrait:
    """Describe what a fit leaves unexplained.

    Parameters
    ----------
    problem, noise
        Readings, model and scatter; the noise model behind the scatter.
    base
        The fit that leaves something: the model with its strut law refitted, or the best explanation.
    seed
        Of the simulated campaigns.
    """
    if len(base.residual) > MOST_READINGS:
        return Portrait(look_elsewhere=np.nan, before=base.residual, after=base.residual)
    # Links taken for rigid may be what is missing: they are described here, not counted as scatter.
    noise = replace(noise, rest=0.0)
    problem = Problem.of(problem.predictor, noise)
    kept = fit_effects(problem, base.candidates, base.sizes, (), base.law) if base.candidates else problem.score_base()
    selection = Selection(problem, kept, noise, seed)
    start, points = selection.start, problem.predictor.data.point
    description, leads, chance = choose(selection)
    if description is None:
        return Portrait(
            look_elsewhere=chance, error=float(start.fit.errors.mean()),
            held_out_rms=held_out(start.fit, points).rms, noise_floor=noise_floor(selection, start),
            before=base.residual, after=start.fit.residual,
        )  # fmt: skip
    leading, links = description.terms[0], fewest(summed(leads, lambda term: term.link))
    values = selection.ground.values(leading.variable, leading.column)
    return Portrait(
        terms=tuple(_sized(selection.ground, description, k) for k in range(len(description.terms))),
        links=links if len(links) <= MOST_LINKS else (),
        variables=fewest(summed(leads, lambda term: term.variable))[:MOST_VARIABLES],
        alike=_alike(selection, description, leads),
        explained=_explained(selection, start, description),
        error=float(description.fit.errors.mean()),
        held_out_rms=held_out(description.fit, points).rms,
        noise_floor=noise_floor(selection, description),
        look_elsewhere=chance,
        before=start.fit.residual,
        after=description.fit.residual,
        signature=-np.log1p(np.maximum(leading.size * selection.ground.column(leading) / selection.compliance, -0.9)),
        values=None if values.ndim == 2 or leading.variable in ("constant", "direction") else values,
    )


def _sized(ground: Ground, description: Description, k: int, probability: float | None = None) -> Sized:
    term, scale = description.terms[k], float(description.scale[k])
    low, high = (bound * term.si for bound in term.bounds)
    reach = defaults.NORMAL_95 * float(np.sqrt(max(description.fit.covariance[2 + k, 2 + k], 0.0))) / scale
    interval = max(term.size - reach, low), min(term.size + reach, high)
    return Sized(term, interval, abs(term.size) * scale, probability)


def _alike(selection: Selection, description: Description, leads: Sequence[Leading]) -> tuple[Sized, ...]:
    """Other terms in place of the leading one, the best of each link, place, direction and variable."""
    others = selection.scattered(selection.without(description, 0), description)
    seen = {_kind(description.terms[0])}
    alike: list[Sized] = []
    for term, weight, here in leads:
        if weight < SHOWN or len(alike) == MOST_ALIKE:
            break
        if not here or _kind(term) in seen:
            continue
        seen.add(_kind(term))
        fitted = selection.extended(others, term)
        if fitted.terms[-1].size:
            alike.append(_sized(selection.ground, fitted, len(fitted.terms) - 1, weight))
    return tuple(alike)


def _kind(term: Term) -> tuple[object, ...]:
    return term.link, term.where, term.direction, term.variable


def _explained(selection: Selection, start: Description, description: Description) -> float:
    """Share of the misfit that the terms take, under the description's scatter, so that wild readings count alike."""
    precision, free = description.fit.scatter.precision, len(selection.compliance) - 2
    fixed = selection.described((), start.fit.law, description.fit.scatter)
    before, after = (float(precision.squares(fitted.fit.residual)) for fitted in (fixed, description))
    return float(np.clip((before - after) / max(before - free, 1e-9), 0.0, 1.0)) if before > after else 0.0


def noise_floor(selection: Selection, description: Description) -> float:
    """Rms at left-out points from noise alone: simulated campaigns through the same fit."""
    draws = simulate(selection.noise, selection.problem.scatter.covariance, selection.seed, FLOOR_DRAWS)
    jacobian, precision = description.fit.jacobian, description.fit.scatter.precision
    weighted = precision.times(jacobian.T)
    inverse = np.linalg.pinv(weighted @ jacobian + law_prior(len(weighted)), hermitian=True)
    points = selection.problem.predictor.data.point

    def left_out(draw: FloatArray) -> FloatArray:
        moved = inverse @ (weighted @ draw)
        fit = replace(description.fit, residual=draw - jacobian @ moved, law=moved[:2])
        return held_out(fit, points).residual

    return float(np.sqrt(np.mean([np.mean(left_out(draw) ** 2) for draw in draws])))
