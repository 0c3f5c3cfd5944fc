"""A stated noise held against what the readings leave: that it is too large or too small, and by how much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.gates import Forms, Gate, absolute_gate, simulate
from toolpath_stiff.inference.noise import Noise

TOO_QUIET = 0.005  # share of simulated campaigns that scatter as little or less


TOO_LOUD = 0.025  # share of those that scatter as much or more, where nothing explains it


ROUNDS = 3  # of the search for the noise that the readings show


LARGEST_FACTOR = 10.0


ENOUGH = 0.05  # probability of the base model's gate, as in the verdict


def noise_doubt(problem: Problem, noise: Noise, gate: Gate, verdict: str, seed: int) -> tuple[str, float]:
    """That a stated noise does not fit the readings, in a sentence, and how many times as large it would have to be.

    "" and 1 where it may be right. Too large where the model leaves less than such a noise would. Too small where no
    explanation stands, or none is likelier than chance and the squares are as large in few campaigns, but the model
    alone would stand under a larger noise: its residuals then have the size alone against them, and no pattern.
    """
    if noise.name != "stated":
        return "", 1.0
    size = 100.0 * noise.typical
    if float((gate.simulated <= gate.squares).mean()) < TOO_QUIET:
        factor = float(np.sqrt(gate.squares / np.median(gate.simulated)))
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
        gate = _gate_at(problem, noise, factor, seed)
    if gate.probability <= ENOUGH:
        return "", 1.0
    return (
        f"the stated noise of {size:.2g} % may be too small: were it {factor:.2g} times as large, {factor * size:.2g} "
        "%, the model alone would explain the readings; repeat a few readings, re-clamped, and leave it to them"
    ), factor


def _gate_at(problem: Problem, noise: Noise, factor: float, seed: int) -> Gate:
    """The absolute test of the model alone under a noise `factor` times as large."""
    larger = replace(noise, repeat=factor * noise.repeat, clamping=factor * noise.clamping)
    scaled = Problem.of(problem.predictor, larger)
    base = scaled.score_base()
    forms = Forms(discrepancy_forms(problem.predictor), scaled.scatter.precision)
    draws = simulate(larger, scaled.scatter.covariance, seed)
    return absolute_gate(scaled, base.residual, base.jacobian, draws, forms)
