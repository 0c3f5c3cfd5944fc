"""The effects of the catalogue as the rig hides them: parameters in shop units, and their draw.

Names, units and bounds are those of the issue that ordered the catalogue, so that a claim can be scored; the
mechanics behind them is in `structure` and `hidden`. A strength runs from 0 (nothing) to 1 (the bound).
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.rig.draws import Change, Draw, Hideable, Shape, drawn, nothing, signed, whole
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.robot import FAULTS as ROBOT_FAULTS
from toolpath_stiff.rig.unknowns import OUTSIDE
from toolpath_stiff.units import m_from_mm, m_from_um, per_s_from_per_min

NM_PER_N = 1e-9  # m/N in nm/N

# Largest compliances that are tried, nm/N: far beyond 30 % of a tip that gives 8 to 31 nm/N.
SOFT = 60.0


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


def _field(
    name: str, parameter: str, limit: float, si: Callable[[Any], Any], shape: Draw = nothing, *needs: str
) -> Hideable:
    """An effect of one parameter, which is a field of the machine in another unit."""
    return Hideable(lambda h, p: {name: si(p[parameter])}, limit, shape, needs, (parameter,))


def _soft(change: Change, *parameters: str, beside: Draw = nothing) -> Hideable:
    """An effect of several compliances, whose proportions are drawn."""
    return Hideable(change, SOFT, drawn(_shares(*parameters), beside), (), parameters)


def _m_per_n(nm_per_n: Any) -> Any:
    return nm_per_n * NM_PER_N


CATALOGUE: dict[str, Hideable] = {
    "spindle_compliance": _soft(
        lambda h, p: {"spindle": (_m_per_n(p["radial"]), _m_per_n(p["axial"]))}, "radial", "axial"
    ),
    "platform_flexibility": Hideable(
        lambda h, p: {"bars": p["bar_stiffness"]}, 1.0, sized=("bar_stiffness",), written=lambda size: 1e8 / size
    ),
    "joint_compliance": _field("joint", "compliance", SOFT, _m_per_n),
    "joint_moment_stiffness": _field("moment", "stiffness", 2e6, float),
    "joint_clearance": _field("clearance", "lost_motion", 50.0, m_from_um, nothing, "force_N"),
    "contact_nonlinearity": _field("hertz", "compliance", SOFT, _m_per_n, nothing, "force_N"),
    "strut_law": _field("curvature", "curvature", 40.0, lambda percent: percent / 100.0, signed),
    "weak_strut": Hideable(
        lambda h, p: {"strut_factors": np.where(np.arange(1, 7) == p["strut"], p["factor"], 1.0) * h.strut_factors},
        0.7, whole("strut", 1, 7), sized=("factor",), written=lambda size: 1.0 - size,
    ),
    "frame_compliance": _soft(
        lambda h, p: {"vertices": np.where(
            (np.arange(1, 7) == p["vertex"])[:, None] | (p["vertex"] == 0),
            _m_per_n(np.array([p["radial"], p["vertical"]])), 0.0,
        )},
        "radial", "vertical", beside=_vertex,
    ),
    "table_compliance": _soft(
        lambda h, p: {"table": _m_per_n(np.array([p[axis] for axis in "xyz"])), "rocking": _m_per_n(p["rocking"])},
        *"xyz", "rocking",
    ),
    "setup_compliance": _soft(
        lambda h, p: {"setup": p["setup"], "setup_compliance": _m_per_n(np.array([p[axis] for axis in "xyz"]))},
        *"xyz", beside=lambda rng, _, setups: {"setup": str(rng.choice(setups))},
    ),
    "tool_length_error": _field("tip_error", "error", 60.0, m_from_mm, signed),
    "platform_radius_error": _field("radius_error", "error", 60.0, m_from_mm, signed),
    "gauge_scale": Hideable(
        lambda h, p: {
            "gauge_target": p["setup"] or "XYZ"[p["direction"] - 1], "gauge_factor": 1.0 + p["scale"] / 100.0
        },
        20.0, _gauge_shape, sized=("scale",),
    ),
    "thermal_drift": _field(
        "drift", "rate", 20.0, lambda um_per_min: per_s_from_per_min(m_from_um(um_per_min)), signed, "time_min"
    ),
}  # fmt: skip

HIDEABLE = CATALOGUE | OUTSIDE | FAULTS | ROBOT_FAULTS
BEYOND = {name for name, kind in HIDEABLE.items() if not kind.names} - {*CATALOGUE}  # it has no name for these


def with_effect(hidden: HiddenMachine, name: str, parameters: Shape) -> HiddenMachine:
    """The machine with one more effect; parameters in shop units, by the catalogue's names."""
    return dataclasses.replace(hidden, **HIDEABLE[name].change(hidden, parameters))
