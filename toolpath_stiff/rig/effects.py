"""The effects of the catalogue as the rig hides them: parameters in shop units, and their draw.

Names, units and bounds are those of the issue that ordered the catalogue, so that a claim can be scored; the
mechanics behind them is in `structure` and `hidden`. `strength` runs from 0 (nothing) to 1 (the bound).
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from toolpath_stiff.rig.draws import Shape
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.unknown import Unknown
from toolpath_stiff.rig.unknowns import OUTSIDE
from toolpath_stiff.units import m_from_mm, m_from_um, per_s_from_per_min

NM_PER_N = 1e-9  # m/N in nm/N

# Largest compliances that are tried, nm/N: far beyond 30 % of a tip that gives 8 to 31 nm/N.
SOFT = 60.0
Draw = Callable[[Generator, int, list[str]], Shape]  # of how many vertices the frame has, which set-ups there are


def _no_shape(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    return {}


def _sign(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def _shares(*names: str) -> Draw:
    """Relative sizes of several components: one is 1, each other one is absent in a third of the cases."""

    def draw(rng: Generator, vertices: int, setups: list[str]) -> Shape:
        weights = np.where(rng.random(len(names)) < 1.0 / 3.0, 0.0, rng.uniform(0.2, 1.0, len(names)))
        weights[rng.integers(len(names))] = 1.0
        return dict(zip(names, weights.tolist(), strict=True))

    return draw


def _frame_shape(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    shares = _shares("radial", "vertical")(rng, vertices, setups)
    # All vertices alike in half of the cases, else a single one.
    return {"vertex": 0 if rng.random() < 0.5 else int(rng.integers(1, vertices + 1)), **shares}


def _setup_shape(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    shares = _shares(*"xyz")(rng, vertices, setups)
    return {"setup": str(rng.choice(setups)), **shares}


def _gauge_shape(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    """The direction or the set-up whose readings are scaled."""
    target = str(rng.choice(["X", "Y", "Z", *(setups if len(setups) > 1 else [])]))
    axis = target in ("X", "Y", "Z")
    direction = {"direction": "XYZ".index(target) + 1 if axis else 0, "setup": "" if axis else target}
    return direction | _sign(rng, vertices, setups)


Grow = Callable[[float, Shape], Shape]


def _scaled(name: str, limit: float, *kept: str) -> Grow:
    """One parameter in proportion to the strength, with the sign of its shape, beside what is kept of that."""
    return lambda strength, shape: {
        **{key: shape[key] for key in kept}, name: limit * strength * float(shape.get("sign", 1.0))
    }  # fmt: skip


def _soft(*names: str, kept: tuple[str, ...] = ()) -> Grow:
    """Compliances in proportion to the strength and to their shares."""
    return lambda strength, shape: {
        **{key: shape[key] for key in kept}, **{name: SOFT * strength * shape[name] for name in names}
    }  # fmt: skip


@dataclass(frozen=True)
class Hideable:
    """An effect of the catalogue.

    Attributes
    ----------
    change
        What its parameters, by the catalogue's names and in shop units, change of a machine.
    grow
        The parameters at a strength in (0, 1].
    draw
        What is drawn beside the strength: which strut, which axis, which sign, which proportions.
    columns
        Columns that a measurement file needs to show it.
    """

    change: Callable[[HiddenMachine, Shape], Shape]
    grow: Grow
    draw: Draw = _no_shape
    columns: tuple[str, ...] = ()


CATALOGUE: dict[str, Hideable] = {
    "spindle_compliance": Hideable(
        lambda h, p: {"spindle": (p["radial"] * NM_PER_N, p["axial"] * NM_PER_N)},
        _soft("radial", "axial"), _shares("radial", "axial"),
    ),
    "platform_flexibility": Hideable(
        lambda h, p: {"bars": p["bar_stiffness"]}, lambda strength, _: {"bar_stiffness": 1e8 / strength}
    ),
    "joint_compliance": Hideable(lambda h, p: {"joint": p["compliance"] * NM_PER_N}, _scaled("compliance", SOFT)),
    "joint_moment_stiffness": Hideable(lambda h, p: {"moment": p["stiffness"]}, _scaled("stiffness", 2e6)),
    "joint_clearance": Hideable(
        lambda h, p: {"clearance": m_from_um(p["lost_motion"])}, _scaled("lost_motion", 50.0), columns=("force_N",)
    ),
    "contact_nonlinearity": Hideable(
        lambda h, p: {"hertz": p["compliance"] * NM_PER_N}, _scaled("compliance", SOFT), columns=("force_N",)
    ),
    "strut_law": Hideable(lambda h, p: {"curvature": p["curvature"] / 100.0}, _scaled("curvature", 40.0), _sign),
    "weak_strut": Hideable(
        lambda h, p: {"strut_factors": np.where(np.arange(1, 7) == p["strut"], p["factor"], 1.0) * h.strut_factors},
        lambda strength, shape: {"strut": shape["strut"], "factor": 1.0 - 0.7 * strength},
        lambda rng, *_: {"strut": int(rng.integers(1, 7))},
    ),
    "frame_compliance": Hideable(
        lambda h, p: {"vertices": np.where(
            (np.arange(1, 7) == p["vertex"])[:, None] | (p["vertex"] == 0),
            np.array([p["radial"], p["vertical"]]) * NM_PER_N, 0.0,
        )},
        _soft("radial", "vertical", kept=("vertex",)), _frame_shape,
    ),
    "table_compliance": Hideable(
        lambda h, p: {"table": np.array([p[axis] for axis in "xyz"]) * NM_PER_N, "rocking": p["rocking"] * NM_PER_N},
        _soft(*"xyz", "rocking"), _shares(*"xyz", "rocking"),
    ),
    "setup_compliance": Hideable(
        lambda h, p: {"setup": p["setup"], "setup_compliance": np.array([p[axis] for axis in "xyz"]) * NM_PER_N},
        _soft(*"xyz", kept=("setup",)), _setup_shape,
    ),
    "tool_length_error": Hideable(lambda h, p: {"tip_error": m_from_mm(p["error"])}, _scaled("error", 60.0), _sign),
    "platform_radius_error": Hideable(
        lambda h, p: {"radius_error": m_from_mm(p["error"])}, _scaled("error", 60.0), _sign
    ),
    "gauge_scale": Hideable(
        lambda h, p: {
            "gauge_target": p["setup"] or "XYZ"[p["direction"] - 1], "gauge_factor": 1.0 + p["scale"] / 100.0
        },
        _scaled("scale", 20.0, "direction", "setup"), _gauge_shape,
    ),
    "thermal_drift": Hideable(
        lambda h, p: {"drift": per_s_from_per_min(m_from_um(p["rate"]))}, _scaled("rate", 20.0), _sign, ("time_min",)
    ),
}  # fmt: skip

BEYOND = {*OUTSIDE, *(name for name, fault in FAULTS.items() if not fault.names)}  # what the catalogue has no name for


def draw_shape(name: str, rng: Generator, vertices: int, setups: list[str]) -> Shape:
    """What is drawn of anything that can be hidden, beside its strength."""
    if name in CATALOGUE:
        return CATALOGUE[name].draw(rng, vertices, setups)
    return (FAULTS[name] if name in FAULTS else OUTSIDE[name]).shape(rng)


def at_strength(name: str, shape: Shape, strength: float) -> Shape:
    """Shape in shop units, by the catalogue's names, for a strength in (0, 1]."""
    if name in CATALOGUE:
        return CATALOGUE[name].grow(strength, shape)
    limit = (FAULTS[name] if name in FAULTS else OUTSIDE[name]).limit
    return _scaled("size", limit, *(key for key in shape if key != "sign"))(strength, shape)


def with_effect(hidden: HiddenMachine, name: str, parameters: Shape) -> HiddenMachine:
    """The machine with one more effect; parameters in shop units by the catalogue's names."""
    if name in CATALOGUE:
        return dataclasses.replace(hidden, **CATALOGUE[name].change(hidden, parameters))
    if name in FAULTS:
        return dataclasses.replace(hidden, **FAULTS[name].change(hidden, parameters))
    return dataclasses.replace(hidden, unknown=Unknown(name, parameters["size"], dict(parameters)))
