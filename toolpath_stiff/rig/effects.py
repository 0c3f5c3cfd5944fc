"""The effects of the catalogue as the rig hides them: parameters in shop units, their draw, and their size.

Names, units and bounds are those of the issue that ordered the catalogue, so that a claim can be scored; the
mechanics behind them is in `structure` and `hidden`. `strength` runs from 0 (nothing) to 1 (the bound).

The size of an effect is the root mean square change of the readings' logarithm. It is drawn log-uniform from just
detectable on that campaign (`DETECTABLE`) to 30 %, as far as the effect's bounds allow.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, Oddity, readings
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.unknown import Unknown
from toolpath_stiff.rig.unknowns import UNKNOWNS
from toolpath_stiff.units import m_from_mm, m_from_um, per_s_from_per_min

Parameters = dict[str, Any]
NM_PER_N = 1e-9  # m/N in nm/N

# Largest compliances that are tried, nm/N: far beyond 30 % of a tip that gives 8 to 31 nm/N.
SOFT = 60.0


# Sizes at strength 1: ratios, or m/N where the oddity is a compliance.
ODDITY_LIMITS = {
    "loose_preload": SOFT * NM_PER_N,
    "cracked_bed": SOFT * NM_PER_N,
    "saddle_overhang": SOFT * NM_PER_N,
    "screw_pitch_error": 0.8,
    "ball_screw_torsion": 1.0,
    "strut_crosstalk": 0.95,
    "cable_drag": 0.5,
    "warming_leg": 1.0,
    "joint_friction": 1.0,
}

LARGEST = 0.30  # rms change of ln stiffness
UNKNOWN_SIZES = (0.04, 0.15)  # rms change of ln stiffness that an unknown is drawn with, log-uniform
LARGEST_SINGLE = 1.0  # change of one reading: whoever reads nearly three times the others throws it away (assumed)
# Whitened length of an effect's signature, beside strut law and nuisances, that is found with 80 % power at 5 %
# among some twenty candidates: z(1 - 0.0025/2) + z(0.8) = 3.02 + 0.84 (normal quantiles, Bonferroni).
DETECTABLE = 3.9
FREE_LAW = 1.0  # prior sd of the logarithms of the two strut stiffnesses: free, next to 2 % noise


def _signs(rng: Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _weights(rng: Generator, count: int) -> list[float]:
    """Relative sizes of several components: one is 1, each other one is absent in a third of the cases."""
    weights = np.where(rng.random(count) < 1.0 / 3.0, 0.0, rng.uniform(0.2, 1.0, count))
    weights[rng.integers(count)] = 1.0
    return [float(w) for w in weights]


def draw_shape(name: str, rng: Generator, vertices: int, setups: list[str]) -> Parameters:
    """What is drawn beside the strength: which strut, which axis, which sign, which proportions."""
    match name:
        case "spindle_compliance":
            radial, axial = _weights(rng, 2)
            return {"radial": radial, "axial": axial}
        case "frame_compliance":
            radial, vertical = _weights(rng, 2)
            # All vertices alike in half of the cases, else a single one.
            vertex = 0 if rng.random() < 0.5 else int(rng.integers(1, vertices + 1))
            return {"vertex": vertex, "radial": radial, "vertical": vertical}
        case "table_compliance":
            x, y, z, rocking = _weights(rng, 4)
            return {"x": x, "y": y, "z": z, "rocking": rocking}
        case "setup_compliance":
            x, y, z = _weights(rng, 3)
            return {"setup": str(rng.choice(setups)), "x": x, "y": y, "z": z}
        case "weak_strut":
            return {"strut": int(rng.integers(1, 7))}
        case "gauge_scale":
            target = str(rng.choice(["X", "Y", "Z", *(setups if len(setups) > 1 else [])]))
            return {"target": target, "sign": _signs(rng)}
        case "strut_law" | "tool_length_error" | "platform_radius_error" | "thermal_drift":
            return {"sign": _signs(rng)}
        case "screw_pitch_error":
            return {"wavelength": float(rng.uniform(0.08, 0.4)), "phase": float(rng.uniform(0.0, 2.0 * np.pi))}
        case "warming_leg":
            return {"strut": int(rng.integers(0, 6))}
        case "cable_drag" | "strut_crosstalk":
            return {"sign": _signs(rng)}
        case _:
            return UNKNOWNS[name].shape(rng) if name in UNKNOWNS else {}


def at_strength(name: str, shape: Mapping[str, Any], strength: float) -> Parameters:
    """Parameters in shop units, by the catalogue's names, for a strength in (0, 1]."""
    soft, sign = SOFT * strength, float(shape.get("sign", 1.0))
    match name:
        case "spindle_compliance":
            return {"radial": soft * shape["radial"], "axial": soft * shape["axial"]}
        case "platform_flexibility":
            return {"bar_stiffness": 1e8 / strength}
        case "joint_compliance" | "contact_nonlinearity":
            return {"compliance": soft}
        case "joint_moment_stiffness":
            return {"stiffness": 2e6 * strength}
        case "joint_clearance":
            return {"lost_motion": 50.0 * strength}
        case "strut_law":
            return {"curvature": 40.0 * strength * sign}
        case "weak_strut":
            return {"strut": shape["strut"], "factor": 1.0 - 0.7 * strength}
        case "frame_compliance":
            return {"vertex": shape["vertex"], "radial": soft * shape["radial"], "vertical": soft * shape["vertical"]}
        case "table_compliance":
            return {**{axis: soft * shape[axis] for axis in "xyz"}, "rocking": soft * shape["rocking"]}
        case "setup_compliance":
            return {"setup": shape["setup"], **{axis: soft * shape[axis] for axis in "xyz"}}
        case "tool_length_error" | "platform_radius_error":
            return {"error": 60.0 * strength * sign}
        case "gauge_scale":
            return {**_gauge_target(shape["target"]), "scale": 20.0 * strength * sign}
        case "thermal_drift":
            return {"rate": 20.0 * strength * sign}
        case _:
            drawn = {key: value for key, value in shape.items() if key != "sign"}
            limit = UNKNOWNS[name].limit if name in UNKNOWNS else ODDITY_LIMITS[name]
            return {**drawn, "size": limit * strength * sign}


def _gauge_target(target: str) -> Parameters:
    """The direction or the set-up whose readings are scaled."""
    axis = target in ("X", "Y", "Z")
    return {"direction": "XYZ".index(target) + 1 if axis else 0, "setup": "" if axis else target}


Change = Callable[[HiddenMachine, Mapping[str, Any]], dict[str, Any]]

CATALOGUE: dict[str, Change] = {
    "spindle_compliance": lambda h, p: {"spindle": (p["radial"] * NM_PER_N, p["axial"] * NM_PER_N)},
    "platform_flexibility": lambda h, p: {"bars": p["bar_stiffness"]},
    "joint_compliance": lambda h, p: {"joint": p["compliance"] * NM_PER_N},
    "joint_moment_stiffness": lambda h, p: {"moment": p["stiffness"]},
    "joint_clearance": lambda h, p: {"clearance": m_from_um(p["lost_motion"])},
    "contact_nonlinearity": lambda h, p: {"hertz": p["compliance"] * NM_PER_N},
    "strut_law": lambda h, p: {"curvature": p["curvature"] / 100.0},
    "weak_strut": lambda h, p: {
        "strut_factors": np.where(np.arange(1, 7) == p["strut"], p["factor"], 1.0) * h.strut_factors
    },
    "frame_compliance": lambda h, p: {
        "vertices": np.where(
            (np.arange(1, 7) == p["vertex"])[:, None] | (p["vertex"] == 0),
            np.array([p["radial"], p["vertical"]]) * NM_PER_N,
            0.0,
        )
    },
    "table_compliance": lambda h, p: {
        "table": np.array([p["x"], p["y"], p["z"]]) * NM_PER_N,
        "rocking": p["rocking"] * NM_PER_N,
    },
    "setup_compliance": lambda h, p: {
        "setup": p["setup"],
        "setup_compliance": np.array([p["x"], p["y"], p["z"]]) * NM_PER_N,
    },
    "tool_length_error": lambda h, p: {"tip_error": m_from_mm(p["error"])},
    "platform_radius_error": lambda h, p: {"radius_error": m_from_mm(p["error"])},
    "gauge_scale": lambda h, p: {
        "gauge_target": p["setup"] or "XYZ"[p["direction"] - 1],
        "gauge_factor": 1.0 + p["scale"] / 100.0,
    },
    "thermal_drift": lambda h, p: {"drift": per_s_from_per_min(m_from_um(p["rate"]))},
}


def with_effect(hidden: HiddenMachine, name: str, parameters: Mapping[str, Any]) -> HiddenMachine:
    """The machine with one more effect; parameters in shop units by the catalogue's names."""
    if name in CATALOGUE:
        return dataclasses.replace(hidden, **CATALOGUE[name](hidden, parameters))
    if name in UNKNOWNS:
        return dataclasses.replace(hidden, unknown=Unknown(name, parameters["size"], dict(parameters)))
    return dataclasses.replace(hidden, oddity=Oddity(kind=name, **parameters))


class Scale:
    """How large an effect shows on one campaign, and its strength for a wanted size."""

    def __init__(self, nominal: Nominal, rows: Rows, clamps: IntArray, nuisances: Nuisances) -> None:
        self.nominal, self.rows = nominal, rows
        self.vertices = int(nominal.vertices.max()) + 1
        self.setups = sorted(set(rows.setup.tolist()))
        self.base = np.log(readings(nominal, HiddenMachine(), rows))
        self.covariance = Covariance(clamps, _spread(self, nuisances), nuisances)

    def change(self, machine: HiddenMachine) -> FloatArray:
        """(n,) change of ln stiffness; infinite beyond `LARGEST_SINGLE`, or where an indicator would run backwards."""
        shown = readings(self.nominal, machine, self.rows)
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(shown)
        change = np.where(np.isfinite(logs), logs - self.base, math.inf)
        return np.where(np.abs(change) <= LARGEST_SINGLE, change, math.inf)

    def draw(self, name: str, size: float | None, rng: Generator) -> tuple[dict[str, Any], dict[str, float]]:
        """Parameters, and their size and detectability."""
        shape = draw_shape(name, rng, self.vertices, self.setups)
        fraction = rng.random()
        strength, change = self._reach(name, shape, 0.03)
        rms, seen = _rms(change), self._detectability(change)
        if size is None:
            # To first order both grow in proportion to the strength.
            smallest, largest = min(max(rms * DETECTABLE / max(seen, 1e-12), 1e-4), LARGEST), LARGEST
            if name in UNKNOWNS:
                smallest, largest = UNKNOWN_SIZES
            size = smallest * (largest / smallest) ** fraction
        strength, change = self._reach(name, shape, size, start=strength)
        parameters = {
            key: float(f"{value:.4g}") if isinstance(value, float) else value
            for key, value in at_strength(name, shape, strength).items()
        }
        # The digits beyond are the processor's.
        figures = {"size": _rms(change), "detectability": self._detectability(change)}
        return parameters, {key: float(f"{value:.6g}") for key, value in figures.items()}

    def _reach(self, name: str, shape: Mapping[str, Any], size: float, start: float = 0.02) -> tuple[float, FloatArray]:
        """Strength in (0, 1] at which the rms change is `size` within 2 %, and that change; 1 if no strength does.

        The change grows about in proportion to the strength, so scaling the strength by what is missing converges.
        """
        low, high, strength = 0.0, math.inf, start
        change = np.zeros(len(self.base))
        for _ in range(25):
            change = self.change(with_effect(HiddenMachine(), name, at_strength(name, shape, strength)))
            rms = _rms(change)
            if abs(rms - size) <= 0.02 * size or (rms < size and strength == 1.0):
                break
            low, high = (strength, high) if rms < size else (low, strength)
            wanted = min(strength * size / rms, 1.0) if 0.0 < rms < math.inf else 0.5 * strength
            # A step that leaves the bracket is replaced by halving the bracket.
            strength = wanted if low < wanted < high else 0.5 * (low + min(high, 1.0))
        return strength, change

    def _detectability(self, change: FloatArray) -> float:
        return self.covariance.length(change) if np.isfinite(change).all() else math.inf


_SCALES: dict[tuple[Any, ...], Scale] = {}
SCALES_KEPT = 8


def scale_of(nominal: Nominal, rows: Rows, clamps: IntArray, nuisances: Nuisances) -> Scale:
    """The scale of a campaign; those used last are kept, for many cases are drawn on one campaign."""
    parts = [clamps, *vars(nominal).values(), *vars(rows).values()]
    key = (nuisances, *((part.dtype.str, part.tobytes()) if isinstance(part, np.ndarray) else part for part in parts))
    if key not in _SCALES:
        while len(_SCALES) >= SCALES_KEPT:
            _SCALES.pop(next(iter(_SCALES)))
        _SCALES[key] = Scale(nominal, rows, clamps, nuisances)
    return _SCALES[key]


def _rms(change: FloatArray) -> float:
    return float(np.sqrt(np.mean(change**2)))


class Covariance:
    """Covariance of ln readings: repeat noise, clamping, strut spread, a free strut law.

    The first two are a multiple of the identity and one block of ones a clamp, whose inverse is known; the rest has
    rank 8 and enters by Woodbury's identity, (N + S S^T)^-1 = N^-1 - N^-1 S (1 + S^T N^-1 S)^-1 S^T N^-1.
    """

    def __init__(self, clamps: IntArray, spread: FloatArray, nuisances: Nuisances) -> None:
        self.clamps = clamps
        self.noise = max(nuisances.repeat, 1e-3) ** 2
        share = nuisances.clamping**2
        self.pull = share / (self.noise + np.bincount(clamps) * share)
        self.spread = spread
        self.inner = np.eye(spread.shape[1]) + spread.T @ self._solve_noise(spread)

    def _solve_noise(self, x: FloatArray) -> FloatArray:
        """N^-1 x for x (n, m)."""
        sums = np.zeros((len(self.pull), x.shape[1]))
        np.add.at(sums, self.clamps, x)
        return np.asarray((x - (self.pull[:, None] * sums)[self.clamps]) / self.noise)

    def length(self, x: FloatArray) -> float:
        """Whitened length of x (n,), sqrt(x^T C^-1 x)."""
        solved = self._solve_noise(x[:, None])[:, 0]
        projected = self.spread.T @ solved
        squared = float(x @ solved - projected @ np.linalg.solve(self.inner, projected))
        return math.sqrt(max(squared, 0.0))


def _spread(scale: Scale, nuisances: Nuisances) -> FloatArray:
    """(n, 8) changes of ln readings by one standard deviation of each strut and of the strut law at its two ends.

    (n, 7) of a law with one stiffness; of a law with more than two the points between move with the ends.
    """
    step = 1e-4
    columns = []
    for strut in range(6):
        factors = np.where(np.arange(6) == strut, 1.0 + step, 1.0)
        columns.append(nuisances.strut_spread * scale.change(HiddenMachine(strut_factors=factors)) / step)
    (first, last), lengths = scale.nominal.law_ends, scale.nominal.law_lengths
    toward = (lengths - first) / (last - first)
    for moved in [np.ones(1)] if len(lengths) == 1 else [1.0 - toward, toward]:
        stiffer = scale.nominal.law_stiffnesses * (1.0 + step * moved)
        other = dataclasses.replace(scale.nominal, law_stiffnesses=stiffer)
        columns.append(FREE_LAW * (np.log(readings(other, HiddenMachine(), scale.rows)) - scale.base) / step)
    return np.column_stack(columns)
