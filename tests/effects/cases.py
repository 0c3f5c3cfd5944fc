"""What the tests of the effects share: machines with one effect, a probe, the paper's 42 readings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.stiffness.cases import nist, table_1_positions
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, load_path

FloatArray = NDArray[np.float64]
CATALOGUE = (
    "spindle_compliance",
    "platform_flexibility",
    "joint_compliance",
    "joint_moment_stiffness",
    "joint_clearance",
    "contact_nonlinearity",
    "strut_law",
    "weak_strut",
    "frame_compliance",
    "table_compliance",
    "setup_compliance",
    "tool_length_error",
    "platform_radius_error",
    "gauge_scale",
    "thermal_drift",
    "tool_bending",
    "frame_sway",
    "joint_offset",
    "indicator_off_tip",
    "load_cell_curvature",
    "stand_compliance",
)

# A user's own effect file.
BENCH_FILE = '''
from toolpath_stiff.stiffness.effects import Effect, Parameter


class Bench(Effect):
    """A compliance that the readings at the right-hand side see."""

    name = "bench"
    title = "bench"
    link = "instrument"
    equation = "c = c_0 x"
    source = "made up"
    parameters = (Parameter("compliance", "nm/N", 1e-9, (0.0, 100.0), (1.0, 10.0), "made up"),)

    def reading(self, stiffness, path, p):
        return stiffness / (1.0 + p["compliance"] * stiffness * (path.position[:, 0] > 0.1))
'''


def neutral_values(effect: Effect) -> dict[str, Any]:
    """SI values at which the effect vanishes, set-up "riser"."""
    return {p.name: "riser" if p.kind == "text" else p.neutral * p.si for p in effect.parameters}


def model_with(name: str = "", machine: Hexapod | None = None, **values: Any) -> StiffnessModel:
    """The NIST machine, or another, with one effect; values that are not given are neutral."""
    extra = []
    if name:
        effect = find_effect(name)
        extra = [ActiveEffect(effect, neutral_values(effect) | values)]
    return build_model(nist() if machine is None else machine, extra=extra)


def readings(
    model: StiffnessModel,
    position: FloatArray,
    direction: FloatArray,
    rotation: FloatArray | None = None,
    force: float = 1000.0,
    setup: Any = None,
    minutes: Any = None,
) -> FloatArray:
    """(n,) N/m as an instrument shows them."""
    n = len(position)
    names = np.broadcast_to(np.array("riser" if setup is None else setup), (n,))
    time = np.broadcast_to(np.asarray(0.0 if minutes is None else minutes, dtype=float) * 60.0, (n,))
    path = load_path(model, position, rotation, force=force, setup=names, time=time, direction=direction)
    stiffness = 1.0 / exact.compliance_along(model, path, direction)
    for active in model.instruments:
        stiffness = active.effect.reading(stiffness, path, active.values)
    return stiffness


def paper_design() -> tuple[FloatArray, FloatArray, NDArray[np.str_]]:
    """The 42 readings of Table 1: positions, directions, set-ups (the upper plane was measured on a riser)."""
    position = np.repeat(table_1_positions(), 3, axis=0)
    return position, np.tile(np.eye(3), (14, 1)), np.where(position[:, 2] > 1.0, "riser", "bare")


def all_effects() -> dict[str, Effect]:
    """The catalogue."""
    known = known_effects()
    return {name: known[name] for name in CATALOGUE}
