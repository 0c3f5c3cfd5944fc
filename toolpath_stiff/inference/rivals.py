"""Rivals that a named explanation must outvote, and the test that it lowers the error at left-out points."""

from collections.abc import Mapping, Sequence

import numpy as np

from toolpath_stiff.inference.candidates import CandidateTable, testable_effects
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect
from toolpath_stiff.inference.hypotheses import tables_of
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.inference.votes import SMALL
from toolpath_stiff.stiffness.contract import SETUP, Effect

INSTRUMENT = "instrument"
# Effects that carry the tip's whole force to the floor as one body on springs (`contract.body_on_springs`).
ONE_BODY = ("table_compliance", "frame_sway")
# Effects in series with every strut, which a wrong strut law may stand for; all but the first under one load only.
SERIES = ("joint_compliance", "contact_nonlinearity", "joint_clearance")
TWINS = 0.05  # votes below which two explanations are the same to these readings
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


def rivals_of_law(problem: Problem, given: Fit, machine: Sequence[str] = ()) -> dict[str, Fit]:
    """Instrument effects, and the `machine` effects named, each fitted beside the file's strut law, by name.

    What a refitted law may stand for: under one load a law that is softer by a share is at the tip the same as a load
    cell that reads too little by it.
    """
    effects = [e for e in testable_effects(problem.predictor)[0] if e.link == INSTRUMENT or e.name in machine]
    tables = {e.name: tables_of(problem, e) for e in effects if e.name not in given.names}
    gains = {name: [_gain(problem, given, table) for table in some] for name, some in tables.items()}
    likely = {name: some[int(np.argmax(gains[name]))].candidate for name, some in tables.items() if some}
    return {name: add_effect(problem, given, [candidate], law_free=False) for name, candidate in likely.items()}


def _gain(problem: Problem, fit: Fit, table: CandidateTable) -> float:
    """Gain in twice the log likelihood by a small size of a candidate beside a fit, linearised."""
    columns = -table.columns.T / problem.base_compliance
    pull = fit.scatter.precision.times(columns)
    return float(pull @ fit.residual @ np.linalg.pinv(pull @ columns.T, hermitian=True) @ pull @ fit.residual)


def place_of(effect: Effect) -> str:
    """Place where a user would look for an effect: its link; of instruments and geometry, the effect itself."""
    if effect.name in ONE_BODY:
        return "body on springs"
    return effect.name if effect.link in (INSTRUMENT, "geometry") else part_of(effect)


def entries(problem: Problem, fits: Mapping[str, Fit], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Explanations grouped where they sit at the same places and votes on these readings could not tell them apart.

    In the order of `names`; one that is in no `fits` stands alone. The votes between two that differ by d in whitened
    residuals come to d^2 / 2 where one of them is true. A refitted law sits where `SERIES` does beside the file's; what
    stands in place of an explanation's refitted law is an open end of that explanation and none beside it.
    """
    groups: list[tuple[str, ...]] = []
    for name in names:
        for k, (first, *_) in enumerate(groups):
            if name in fits and first in fits and _alike(problem, fits[name], fits[first]):
                groups[k] = (*groups[k], name)
                break
        else:
            groups.append((name,))
    return groups


def _alike(problem: Problem, fit: Fit, other: Fit) -> bool:
    def places(fit: Fit) -> list[str]:
        return sorted(place_of(c.effect) for c in fit.candidates if fit.law_free or c.name not in SERIES)

    if other.names and {*other.names} < {*fit.names} and other.law_free > fit.law_free:
        return True
    apart = float(problem.scatter.precision.squares(fit.residual - other.residual))
    twins = TWINS if fit.candidates and other.candidates else 0.0
    return 0.5 * apart <= (SMALL if places(fit) == places(other) else twins)


def lowers_error(before: HeldOut, after: HeldOut) -> bool:
    """True if an explanation lowers the mean error at left-out points; one that does not is no answer."""
    return not before.mean_error - after.mean_error <= UNSEEN
