"""Rivals that a named explanation must outvote, and the test that it lowers the error at left-out points."""

from collections.abc import Mapping, Sequence

import numpy as np

from toolpath_stiff.inference.candidates import CandidateTable, testable_effects
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect
from toolpath_stiff.inference.hypotheses import tables_of
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.stiffness.contract import SETUP, Effect

INSTRUMENT = "instrument"
UNSEEN = 5e-5  # of a mean error: half of the last digit that is printed


def part_of(effect: Effect) -> str:
    """Link of an effect; an effect of one set-up is a part of its own."""
    return SETUP if SETUP in effect.needs else effect.link


def parts_of(fit: Fit) -> tuple[str, ...]:
    """Links of all effects of a fit, sorted; empty for the model alone."""
    return tuple(sorted(part_of(candidate.effect) for candidate in fit.candidates))


def rivals_of(fit: Fit, fits: Mapping[str, Fit]) -> dict[str, Fit]:
    """Explanations to outvote besides the model alone: those of other parts, and those with fewer of the same effects.

    `fits`: all explanations by name. Of those with more effects, that add to its own part the search has its own price.
    """
    own, names = parts_of(fit), {*fit.names}

    def rival(other: Fit) -> bool:
        if len(other.names) > len(names):
            return {*parts_of(other)}.isdisjoint(own)
        return {*other.names} != names and (parts_of(other) != own or {*other.names} < names)

    return {name: other for name, other in fits.items() if rival(other)}


def rivals_of_law(
    problem: Problem, given: Fit, effects: Sequence[Effect] | None = None, least: float = 0.0
) -> dict[str, Fit]:
    """Effects, those of instruments unless they are named, each fitted beside the file's strut law, by name.

    What a refitted law may stand for: under one load a law that is softer by a share is at the tip the same as a load
    cell that reads too little by it. `least`: log likelihood that they have to gain, linearised.
    """
    if effects is None:
        effects = [effect for effect in testable_effects(problem.predictor)[0] if effect.link == INSTRUMENT]
    tables = {effect.name: tables_of(problem, effect) for effect in effects if effect.name not in given.names}
    gains = {name: [_gain(problem, given, table) for table in some] for name, some in tables.items() if some}
    likely = {name: tables[name][int(np.argmax(some))].candidate for name, some in gains.items() if max(some) >= least}
    return {name: add_effect(problem, given, [candidate], law_free=False) for name, candidate in likely.items()}


def _gain(problem: Problem, fit: Fit, table: CandidateTable) -> float:
    """Gain in log likelihood by a small size of a candidate beside a fit, linearised."""
    columns = -table.columns.T / problem.base_compliance
    pull = fit.scatter.precision.times(columns)
    return 0.5 * float(pull @ fit.residual @ np.linalg.pinv(pull @ columns.T, hermitian=True) @ pull @ fit.residual)


def lowers_error(before: HeldOut, after: HeldOut) -> bool:
    """True if an explanation lowers the mean error at left-out points; one that does not is no answer."""
    return not before.mean_error - after.mean_error <= UNSEEN
