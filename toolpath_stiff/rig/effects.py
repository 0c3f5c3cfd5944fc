"""The effects of the catalogue as the rig hides them: parameters in shop units, and their draw.

Names, units and bounds are those of the issue that ordered the catalogue, so that a claim can be scored; the
mechanics behind them is in `structure` and `hidden`. `strength` runs from 0 (nothing) to 1 (the bound).
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from toolpath_stiff.rig.draws import Draw, Shape, drawn, nothing, signed, whole
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.unknown import Unknown
from toolpath_stiff.rig.unknowns import OUTSIDE
from toolpath_stiff.units import m_from_mm, m_from_um, per_s_from_per_min

NM_PER_N = 1e-9  # m/N in nm/N

# Largest compliances that are tried, nm/N: far beyond 30 % of a tip that gives 8 to 31 nm/N.
SOFT = 60.0
Grow = Callable[[float, Shape], Shape]


def _shares(*names: str) -> Draw:
    """Draw of relative sizes of several components: one is 1, each other is absent in a third of the cases."""

    def draw(rng: Generator, vertices: int, setups: list[str]) -> Shape:
        weights = np.where(rng.random(len(names)) < 1.0 / 3.0, 0.0, rng.uniform(0.2, 1.0, len(names)))
        weights[rng.integers(len(names))] = 1.0
        return dict(zip(names, weights.tolist(), strict=True))

    return draw


def _vertex(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    """Draw of vertices: all alike in half of the cases, otherwise a single one."""
    return {"vertex": 0 if rng.random() < 0.5 else int(rng.integers(1, vertices + 1))}


def _gauge_shape(rng: Generator, vertices: int, setups: list[str]) -> Shape:
    """Draw of the direction or set-up whose readings are scaled."""
    target = str(rng.choice(["X", "Y", "Z", *(setups if len(setups) > 1 else [])]))
    axis = target in ("X", "Y", "Z")
    direction = {"direction": "XYZ".index(target) + 1 if axis else 0, "setup": "" if axis else target}
    return direction | signed(rng)


def _scaled(limit: float, *names: str) -> Grow:
    """Parameters proportional to the strength and to the share or sign in the shape, plus the shape's other entries."""

    def grow(strength: float, shape: Shape) -> Shape:
        shares = {**dict.fromkeys(names, shape.get("sign", 1.0)), **shape}
        sizes = {name: limit * strength * float(shares[name]) for name in names}
        return {key: value for key, value in shape.items() if key != "sign"} | sizes

    return grow


@dataclass(frozen=True)
class Hideable:
    """An effect of the catalogue.

    Attributes
    ----------
    change
        What its parameters, by the catalogue's names and in shop units, change of a machine.
    grow
        The parameters at a strength in (0, 1].
    shape
        What is drawn beside the strength: which strut, which axis, which sign, which proportions.
    columns
        Columns that a measurement file needs to show it.
    """

    change: Callable[[HiddenMachine, Shape], Shape]
    grow: Grow
    shape: Draw = nothing
    columns: tuple[str, ...] = ()


CATALOGUE: dict[str, Hideable] = {
    "spindle_compliance": Hideable(
        lambda h, p: {"spindle": (p["radial"] * NM_PER_N, p["axial"] * NM_PER_N)},
        _scaled(SOFT, "radial", "axial"), _shares("radial", "axial"),
    ),
    "platform_flexibility": Hideable(
        lambda h, p: {"bars": p["bar_stiffness"]}, lambda strength, _: {"bar_stiffness": 1e8 / strength}
    ),
    "joint_compliance": Hideable(lambda h, p: {"joint": p["compliance"] * NM_PER_N}, _scaled(SOFT, "compliance")),
    "joint_moment_stiffness": Hideable(lambda h, p: {"moment": p["stiffness"]}, _scaled(2e6, "stiffness")),
    "joint_clearance": Hideable(
        lambda h, p: {"clearance": m_from_um(p["lost_motion"])}, _scaled(50.0, "lost_motion"), columns=("force_N",)
    ),
    "contact_nonlinearity": Hideable(
        lambda h, p: {"hertz": p["compliance"] * NM_PER_N}, _scaled(SOFT, "compliance"), columns=("force_N",)
    ),
    "strut_law": Hideable(lambda h, p: {"curvature": p["curvature"] / 100.0}, _scaled(40.0, "curvature"), signed),
    "weak_strut": Hideable(
        lambda h, p: {"strut_factors": np.where(np.arange(1, 7) == p["strut"], p["factor"], 1.0) * h.strut_factors},
        lambda strength, shape: {"strut": shape["strut"], "factor": 1.0 - 0.7 * strength},
        whole("strut", 1, 7),
    ),
    "frame_compliance": Hideable(
        lambda h, p: {"vertices": np.where(
            (np.arange(1, 7) == p["vertex"])[:, None] | (p["vertex"] == 0),
            np.array([p["radial"], p["vertical"]]) * NM_PER_N, 0.0,
        )},
        _scaled(SOFT, "radial", "vertical"), drawn(_shares("radial", "vertical"), _vertex),
    ),
    "table_compliance": Hideable(
        lambda h, p: {"table": np.array([p[axis] for axis in "xyz"]) * NM_PER_N, "rocking": p["rocking"] * NM_PER_N},
        _scaled(SOFT, *"xyz", "rocking"), _shares(*"xyz", "rocking"),
    ),
    "setup_compliance": Hideable(
        lambda h, p: {"setup": p["setup"], "setup_compliance": np.array([p[axis] for axis in "xyz"]) * NM_PER_N},
        _scaled(SOFT, *"xyz"), drawn(_shares(*"xyz"), lambda rng, _, setups: {"setup": str(rng.choice(setups))}),
    ),
    "tool_length_error": Hideable(lambda h, p: {"tip_error": m_from_mm(p["error"])}, _scaled(60.0, "error"), signed),
    "platform_radius_error": Hideable(
        lambda h, p: {"radius_error": m_from_mm(p["error"])}, _scaled(60.0, "error"), signed
    ),
    "gauge_scale": Hideable(
        lambda h, p: {
            "gauge_target": p["setup"] or "XYZ"[p["direction"] - 1], "gauge_factor": 1.0 + p["scale"] / 100.0
        },
        _scaled(20.0, "scale"), _gauge_shape,
    ),
    "thermal_drift": Hideable(
        lambda h, p: {"drift": per_s_from_per_min(m_from_um(p["rate"]))}, _scaled(20.0, "rate"), signed, ("time_min",)
    ),
}  # fmt: skip

BEYOND = {*OUTSIDE, *(name for name, fault in FAULTS.items() if not fault.names)}  # what the catalogue has no name for


def draw_shape(name: str, rng: Generator, vertices: int, setups: list[str]) -> Shape:
    """Draw everything about a hidden effect but its strength."""
    return (CATALOGUE.get(name) or FAULTS.get(name) or OUTSIDE[name]).shape(rng, vertices, setups)


def at_strength(name: str, shape: Shape, strength: float) -> Shape:
    """Parameters in shop units, by the catalogue's names, of a shape at a strength in (0, 1]."""
    if name in CATALOGUE:
        return CATALOGUE[name].grow(strength, shape)
    return _scaled((FAULTS.get(name) or OUTSIDE[name]).limit, "size")(strength, shape)


def with_effect(hidden: HiddenMachine, name: str, parameters: Shape) -> HiddenMachine:
    """The machine with one more effect; parameters in shop units, by the catalogue's names."""
    if known := CATALOGUE.get(name) or FAULTS.get(name):
        return dataclasses.replace(hidden, **known.change(hidden, parameters))
    return dataclasses.replace(hidden, unknown=Unknown(name, parameters["size"], dict(parameters)))
