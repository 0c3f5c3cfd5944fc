"""From fits, probabilities and gates to a verdict.

Two gates. Absolute: a hypothesis must leave residuals that its own noise explains. Relative: among those that do, the
posterior probabilities decide; only a name far ahead of all others is given as the answer.

adequate      nothing is missing that these data could show
identified    one effect (or one pair) explains the data, far likelier than any other
ambiguous     several explain them, and none is far likelier than the others
unexplained   something is missing, and nothing in the catalogue accounts for it
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.effects.contract import Effect
from toolpath_stiff.updating.inference.evidence import Problem, Score
from toolpath_stiff.updating.inference.fits import Fit, refine
from toolpath_stiff.updating.inference.gates import Gate, Simulator, absolute_gate, discrepancy_forms
from toolpath_stiff.updating.inference.hypotheses import (
    Family,
    Pair,
    discrepancy_evidence,
    probabilities,
    score_families,
    score_pairs,
    signatures,
)
from toolpath_stiff.updating.inference.noise import Noise

FloatArray = NDArray[np.float64]

NONE = "none"
OUTSIDE = "outside the catalogue"
# What is expected before anything is measured; assumed. Whoever measures has a reason, but most machines are sound.
PRIOR_NONE, PRIOR_SINGLES, PRIOR_PAIRS, PRIOR_OUTSIDE = 0.30, 0.50, 0.10, 0.10
FALSE_ALARM = 0.05  # of the base model's gate
ADEQUATE = 0.005  # below this probability an explanation does not explain the data
NAMED = 0.90  # probability from which a single name is the answer
HELD = 0.95  # probability that the plausible set adds up to where it is not a single name
STANDS = 0.05  # probability from which something outside the catalogue, or another pair, is not ruled out
TESTED = 4  # candidates, besides all those that matter, that go through the absolute gate
FAR = 8.0  # log evidence behind the best adequate candidate at which the others cannot matter
SURVIVES = 3.0  # log evidence by which a pair must beat each of its members alone
# Odds below which a second effect is not considered where one suffices: "positive" evidence begins at 3 (Kass and
# Raftery 1995, Bayes factors).
POSITIVE = 3.0


@dataclass(frozen=True)
class Judgement:
    """What the data say under one noise model.

    Attributes
    ----------
    verdict
        See above.
    explanations
        Hypotheses, the most likely first, that hold the truth with 95 % probability: effects, `none`, "a + b".
    problem, noise
        Data and scatter.
    base, base_gate
        The model with its strut law refitted, and its absolute test.
    families
        All effects, most likely first.
    gates, fits
        Effect (or "a + b") -> its absolute test and final fit, where they were made.
    pairs
        Pairs tried, most likely first.
    probability
        Hypothesis -> posterior probability: effects, `none`, "a + b", `OUTSIDE`. Hypotheses that fail the absolute gate
        have none unless nothing passes.
    form
        The form of discrepancy that stands out, in words; "" if none was looked for.
    """

    verdict: str
    explanations: tuple[str, ...]
    problem: Problem
    noise: Noise
    base: Score
    base_gate: Gate
    families: tuple[Family, ...]
    gates: dict[str, Gate]
    fits: dict[str, Fit]
    pairs: tuple[Pair, ...]
    probability: dict[str, float]
    form: str

    @property
    def plausible(self) -> tuple[str, ...]:
        """Names of the effects in `explanations`, each once."""
        return tuple(dict.fromkeys(name for one in self.explanations for name in one.split(" + ")))

    def family(self, name: str) -> Family:
        """The family of an effect."""
        return next(family for family in self.families if family.name == name)


def judge(problem: Problem, noise: Noise, effects: Sequence[Effect], seed: int) -> Judgement:
    """Search all candidates, test them, and come to a verdict under one noise model."""
    base = problem.score_base()
    families = score_families(problem, effects, base)
    forms = discrepancy_forms(problem.predictor)
    simulator = Simulator.of(noise, problem.covariance, seed)
    # With the law's prior, as in the simulations: a law dragged far by what is missing is no fit.
    gain = max((2.0 * (f.best.log_posterior - base.log_posterior) for f in families if f.best), default=0.0)
    base_gate = absolute_gate(
        problem, base.residual, base.jacobian, simulator, forms, signatures(problem, families), gain
    )
    work = _Work(problem, noise, base, families, forms, simulator)
    if base_gate.probability > FALSE_ALARM:
        posterior = work.posterior(none=True, names=[f.name for f in families])
        likely = _smallest_set(posterior)
        likely = likely if NONE in likely else (*likely, NONE)
        return work.judgement("adequate", likely, noise, base_gate, posterior, "")
    # The base model stays in the running if only the gain of the best candidate counts against it, not its residuals.
    none_stands = min(base_gate.squares_probability, base_gate.structure_probability) > ADEQUATE
    names = work.adequate_singles(none_stands)
    if names:
        posterior = work.posterior(none_stands, names, work.adequate_pairs(names[0]))
        if sum(weight for name, weight in posterior.items() if " + " in name) < POSITIVE * posterior[names[0]]:
            posterior = work.posterior(none_stands, names)
        likely = _smallest_set(posterior)
        verdict = "identified" if max(posterior.values()) >= NAMED else "ambiguous"
        if posterior[NONE] > 0.5:  # what counts against the model is likelier chance than any effect
            verdict = "adequate"
        return work.judgement(verdict, likely, noise, base_gate, posterior, "")
    return work.beyond_singles(noise, base_gate)


def _smallest_set(posterior: dict[str, float]) -> tuple[str, ...]:
    """The one hypothesis that holds `NAMED`, else the fewest that hold `HELD`."""
    ranked = sorted(posterior.items(), key=lambda item: (-item[1], item[0]))
    if ranked and ranked[0][1] >= NAMED:
        return (ranked[0][0],)
    found: list[str] = []
    held = 0.0
    for name, weight in ranked:
        if held >= HELD or weight <= 0.0:
            break
        found.append(name)
        held += weight
    return tuple(found)


class _Work:
    """What one judgement passes from step to step."""

    def __init__(
        self,
        problem: Problem,
        noise: Noise,
        base: Score,
        families: list[Family],
        forms: dict[str, FloatArray],
        simulator: Simulator,
    ) -> None:
        self.problem, self.noise, self.base, self.families = problem, noise, base, families
        self.forms, self.simulator = forms, simulator
        self.gates: dict[str, Gate] = {}
        self.fits: dict[str, Fit] = {}
        self.pairs: list[Pair] = []

    def gate(self, name: str, score: Score) -> Gate:
        """The absolute test of a fit, made once, with the model itself."""
        if name not in self.gates:
            fit = self.fits[name] = refine(self.problem, score)
            self.gates[name] = absolute_gate(self.problem, fit.residual, fit.jacobian, self.simulator, self.forms)
        return self.gates[name]

    def evidence(self, log_evidence: float, score: Score) -> float:
        """Log evidence when the size of the noise is itself known to `noise.freedom` degrees of freedom only.

        Integrated over it, the normal likelihood exp(-q / 2) of the weighted squares q of n readings becomes Student's,
        (1 + q / freedom)^(-(freedom + n) / 2): many readings that fit badly say as much of the noise as of the model.
        """
        freedom, n = self.noise.freedom, len(score.residual)
        if not np.isfinite(freedom):
            return log_evidence
        squares = -2.0 * score.log_likelihood - self.problem.scatter.log_determinant
        return log_evidence + 0.5 * squares - 0.5 * (freedom + n) * float(np.log1p(max(squares, 0.0) / freedom))

    def posterior(self, none: bool, names: Sequence[str], pairs: Sequence[Pair] = ()) -> dict[str, float]:
        """Probabilities of the base model (if it stands), of single effects and of pairs; 0 for all others."""
        evidence = {f.name: self.evidence(f.log_evidence, f.best or self.base) for f in self.families}
        evidence |= {pair.name: self.evidence(pair.log_evidence, pair.score) for pair in pairs}
        prior = {name: PRIOR_SINGLES / max(len(self.families), 1) for name in names}
        prior |= {pair.name: self.pair_prior for pair in pairs}
        return probabilities(
            {NONE: self.evidence(self.base.log_evidence, self.base)} | evidence,
            prior | ({NONE: PRIOR_NONE} if none else {}),
        )

    def adequate_singles(self, none_stands: bool) -> list[str]:
        """Effects that pass the absolute gate, among all that could matter."""
        offered = [f for f in self.families if f.best is not None]
        if not offered:
            return []
        top = -np.inf
        passed: list[str] = []
        for count, family in enumerate(offered):
            assert family.best is not None
            if count >= TESTED and (not passed or family.log_evidence < top - FAR):
                break
            if self.gate(family.name, family.best).probability > ADEQUATE:
                top = top if passed else family.log_evidence
                passed.append(family.name)
        return passed

    @property
    def pair_prior(self) -> float:
        """Prior probability of one pair."""
        return PRIOR_PAIRS / max(len(self.families) * (len(self.families) - 1) // 2, 1)

    def adequate_pairs(self, start: str = "") -> list[Pair]:
        """Pairs that pass the absolute gate and beat each member alone; of the best singles, or of one that stands."""
        starts = [f for f in self.families if f.name == start] or self.families
        self.pairs = score_pairs(self.problem, self.families, starts)
        singles = {f.name: f.log_evidence for f in self.families}
        return [
            pair
            for pair in self.pairs[:TESTED]
            if pair.log_evidence > max(singles[member] for member in pair.names) + SURVIVES
            and self.gate(pair.name, pair.score).probability > ADEQUATE
        ]

    def beyond_singles(self, noise: Noise, base_gate: Gate) -> Judgement:
        """No single effect will do: two, or something else."""
        offered = [f for f in self.families if f.best is not None]
        pairs = self.adequate_pairs()
        outside, form = -np.inf, ""
        for score in (self.base, *(f.best for f in offered[:2] if f.best is not None)):
            evidence, words = discrepancy_evidence(self.problem, score, self.forms)
            if evidence > outside:
                outside, form = evidence, words
        evidences = {OUTSIDE: outside} | {pair.name: pair.log_evidence for pair in pairs}
        prior = {OUTSIDE: PRIOR_OUTSIDE} | {pair.name: self.pair_prior for pair in pairs}
        posterior = probabilities(evidences, prior)
        if posterior[OUTSIDE] >= STANDS or len(posterior) == 1:
            return self.judgement("unexplained", (), noise, base_gate, posterior, form)
        posterior.pop(OUTSIDE)
        likely = [name for name, weight in posterior.items() if weight > STANDS]
        verdict = "identified" if len(likely) == 1 else "ambiguous"
        return self.judgement(verdict, _smallest_set(posterior), noise, base_gate, posterior, form)

    def judgement(
        self,
        verdict: str,
        explanations: tuple[str, ...],
        noise: Noise,
        base_gate: Gate,
        posterior: dict[str, float],
        form: str,
    ) -> Judgement:
        return Judgement(
            verdict, explanations, self.problem, noise, self.base, base_gate, tuple(self.families), self.gates,
            self.fits, tuple(self.pairs), posterior, form,
        )  # fmt: skip
