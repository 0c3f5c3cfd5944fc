"""What the tests of planning share: rivals fitted to Table 1's design as if one of them were the truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tests.effects.cases import neutral_values
from tests.stiffness.cases import nist
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.least_squares import scaled_inverse
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.planning.forecasts import Rival
from toolpath_stiff.readings.measurements import Readings, read_measurements
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect

FloatArray = NDArray[np.float64]

# Sizes of docs/effects_catalogue.md, "How large they are", in SI from the neutral value.
SIZES: dict[str, list[float]] = {
    "spindle_compliance": [5e-9, 2e-9],
    "table_compliance": [5e-9, 5e-9, 2e-9, 1e-12],
    "frame_compliance": [3e-9, 3e-9],
    "joint_moment_stiffness": [4e5],
    "contact_nonlinearity": [3e-9],
    "joint_clearance": [2e-6],
    "setup_compliance": [3e-9, 1e-10, 1e-10],
    "joint_compliance": [3e-9],
    "strut_law": [0.05],
    "gauge_scale": [0.05],
}
CHOICES: dict[str, dict[str, Any]] = {
    "setup_compliance": {"setup": "riser"},
    "gauge_scale": {"direction": 1, "setup": ""},
}
READING_SD = 0.02


@cache
def table_1_design() -> Readings:
    """The paper's 42 readings, as if their load of 1000 N were known."""
    data = read_measurements("nist-table1", nist())
    return replace(data, missing=tuple(name for name in data.missing if name != "force_N"))


def active(name: str, sizes: FloatArray | list[float]) -> ActiveEffect:
    """An effect with these sizes from neutral."""
    return candidate(name).active(sizes)


def candidate(name: str) -> Candidate:
    """An effect with what it acts on."""
    effect = find_effect(name)
    values = neutral_values(effect) | CHOICES.get(name, {}) | ({"vertex": 0} if name == "frame_compliance" else {})
    choice = tuple((p.name, values[p.name]) for p in effect.parameters if p.discrete)
    return Candidate(effect, choice, tuple(Component.of(p) for p in effect.parameters if not p.discrete))


def rival(name: str, observed: FloatArray) -> Rival:
    """An effect, or `none`, with the strut law refitted to ln k of the design (42,), 2 % noise."""
    predictor = Predictor(nist(), table_1_design())
    start = SIZES.get(name, [])
    scale = np.concatenate([[1.0, 1.0], np.abs(start)])

    def residual(x: FloatArray) -> FloatArray:
        effects = () if name == "none" else (active(name, x[2:] * scale[2:]),)
        return (predictor.log_stiffness(x[:2], effects) - observed) / READING_SD

    found = least_squares(residual, np.concatenate([[0.0, 0.0], np.ones(len(start))]))
    prior = np.diag([1.0 / 0.2**2] * 2 + [0.0] * len(start))
    covariance = scaled_inverse(found.jac.T @ found.jac + prior) * np.outer(scale, scale)
    values = found.x * scale
    candidates, sizes = ((), ()) if name == "none" else ((candidate(name),), (values[2:],))
    return Rival(name, values[:2], candidates, sizes, covariance)


@cache
def rivals(truth: str, other: str) -> tuple[Rival, Rival]:
    """Both fitted to what the truth would show at the design."""
    predictor = Predictor(nist(), table_1_design())
    observed = predictor.log_stiffness((0.0, 0.0), (active(truth, SIZES[truth]),))
    return rival(truth, observed), rival(other, observed)


def read_filled(file: Path, machine: MachineTool) -> Readings:
    """A plan as it is read once it is filled in: 50,000 N/mm in every row."""
    head, *rows = file.read_text("utf-8").splitlines()
    column = head.split(",").index("stiffness_N_per_mm")
    cells = [row.split(",") for row in rows]
    filled = [",".join([*row[:column], "50000", *row[column + 1 :]]) for row in cells]
    file.with_name("filled.csv").write_text("\n".join([head, *filled]), "utf-8")
    return read_measurements(file.with_name("filled.csv"), machine)
