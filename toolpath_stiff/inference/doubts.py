"""Doubts about the data: are they of this machine at all, and does a stated noise fit their scatter."""

import numpy as np

from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.gates import Forms, Gate, absolute_gate, simulate
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.size_priors import EXPECTED

FACTOR = float(np.exp(4.0 * LAW_PRIOR))  # of the median reading to the model: four standard deviations of the strut law
# Correlation of ln measured with ln modelled below which the readings do not follow the model. Hidden effects that
# change the stiffness by 30 % leave 0.8 and more, readings of other machines or in another order 0.3 and less.
FOLLOWS = 0.5
NOTHING = 1e-6  # share of the model's variation below which a difference is rounding
TELLS = EXPECTED[1]  # sd of ln modelled over the readings from which the test is made: as large as the largest effect
FEWEST_FOLLOWING = 6  # readings at mechanically different poses and directions


def question(predictor: Predictor) -> str:
    """Reason to doubt that these are readings of this machine; "" if there is none."""
    tip, asked = predictor.data.tip, "Are these readings of this machine?"
    model, which = predictor.log_stiffness()[tip], np.unique(predictor.distinct[tip], return_inverse=True)[1]
    residual = np.log(predictor.data.stiffness[tip]) - model
    if not np.isfinite(residual).all():
        return ""
    ratio = float(np.exp(np.median(residual)))
    if not 1.0 / FACTOR < ratio < FACTOR:
        times = f"{ratio:.2g} times" if ratio > 1.0 else f"1 / {1.0 / ratio:.2g} of"
        return f"{asked} The median reading is {times} what the model says."
    modelled, off = (np.bincount(which, weights=values) / np.bincount(which) for values in (model, residual))
    if len(modelled) < FEWEST_FOLLOWING or float(modelled.std()) < TELLS:
        return ""
    alike = float((modelled + off).std()) <= NOTHING * float(modelled.std())
    correlation = 0.0 if alike else float(np.corrcoef(modelled, modelled + off)[0, 1])
    if correlation >= FOLLOWS:
        return ""
    return (
        f"{asked} They do not follow the model from pose to pose and direction to direction: the correlation of their "
        f"logarithms is {correlation:.2f}, of this machine it would be {FOLLOWS:g} or more."
    )


TOO_QUIET = 0.005  # share of simulated campaigns that scatter as little or less
TOO_LOUD = 0.025  # share of campaigns that scatter as much or more, if nothing explains it
ROUNDS = 3  # of the search for the noise that the readings show
LARGEST_FACTOR = 10.0
ENOUGH = 0.05  # probability of the base model's gate, as in the verdict


def noise_doubt(problem: Problem, noise: Noise, gate: Gate, verdict: str, seed: int) -> tuple[str, float]:
    """Sentence on a stated noise that does not fit the readings, and the factor by which it would have to grow.

    "" and 1 where it may be right. Too large where the model leaves less than such a noise would. Too small where no
    explanation stands, or none is likelier than chance and the squares are as large in few campaigns, but the model
    alone would stand under a larger noise: its residuals then have the size alone against them, and no pattern.
    """
    if noise.name != "stated":
        return "", 1.0
    size, factor = 100.0 * noise.typical, float(np.sqrt(gate.squares / np.median(gate.simulated)))
    if float((gate.simulated <= gate.squares).mean()) < TOO_QUIET:
        return (
            f"the stated noise of {size:.2g} % is too large: what the model leaves is about {factor:.2g} times what "
            f"such a noise would leave; {factor * size:.2g} % would fit, and small effects would show"
        ), factor
    loud = gate.probability <= ENOUGH and gate.squares_probability <= TOO_LOUD
    if not (verdict == "unexplained" or (verdict == "adequate" and loud)):
        return "", 1.0
    factor = 1.0
    for _ in range(ROUNDS):
        factor *= float(np.sqrt(gate.squares / np.median(gate.simulated)))
        if not 1.0 < factor < LARGEST_FACTOR:
            return "", 1.0
        larger = noise.times(factor)
        scaled = Problem.of(problem.predictor, larger)
        gate = gate_of(scaled, larger, scaled.score_base(), seed)
    if gate.probability <= ENOUGH:
        return "", 1.0
    return (
        f"the stated noise of {size:.2g} % may be too small: were it {factor:.2g} times as large, {factor * size:.2g} "
        "%, the model alone would explain the readings; repeat a few readings, re-clamped, and leave it to them"
    ), factor


def gate_of(problem: Problem, noise: Noise, fit: Fit, seed: int) -> Gate:
    """Absolute test of a fit."""
    draws = simulate(noise, problem.scatter.covariance, seed)
    forms = Forms(discrepancy_forms(problem.predictor), problem.scatter.precision)
    return absolute_gate(problem, fit.residual, fit.jacobian, draws, forms)
