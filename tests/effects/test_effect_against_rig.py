"""The catalogue against the rig: a displacement method with nodes, kinematics and machine reader of its own.

They share the physics by name and no code (`test_layers.py` forbids it), so that agreement is not of one's own making.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.cases import all_effects, model_with
from tests.stiffness.cases import nist
from toolpath_stiff.readings.measurements import model_stiffness, read_measurements
from toolpath_stiff.rig.campaigns import tilted_campaign
from toolpath_stiff.rig.case import rows_of
from toolpath_stiff.rig.effects import with_effect
from toolpath_stiff.rig.hidden import HiddenMachine, readings
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.model import StiffnessModel, build_model

SIZES = {
    "spindle_compliance": {"radial": 5.0, "axial": 2.0},
    "platform_flexibility": {"bar_stiffness": 3e8},
    "joint_compliance": {"compliance": 3.0},
    "joint_moment_stiffness": {"strut": 0, "stiffness": 4e5},
    "joint_clearance": {"lost_motion": 2.0},
    "contact_nonlinearity": {"compliance": 3.0},
    "strut_law": {"curvature": 10.0},
    "weak_strut": {"strut": 3, "factor": 0.7},
    "frame_compliance": {"vertex": 2, "radial": 6.0, "vertical": 4.0},
    "table_compliance": {"x": 3.0, "y": 2.0, "z": 1.0, "rocking": 2.0},
    "setup_compliance": {"setup": "riser", "x": 3.0, "y": 2.0, "z": 1.0},
    "tool_length_error": {"error": 20.0},
    "platform_radius_error": {"error": 2.0},
    "gauge_scale": {"direction": 3, "setup": "", "scale": 8.0},
    "thermal_drift": {"rate": 0.02},
    "tool_bending": {"compliance": 4.0},
    "frame_sway": {"sideways": 3.0, "vertical": 2.0, "rocking": 1.5},
    "joint_offset": {"joint": 9, "x": 4.0, "y": -3.0, "z": 6.0},
}
# What the rig says without the effect's name: a cantilever, a table alike in X and Y, a joint of the third strut moved.
HIDDEN = {
    "tool_bending": HiddenMachine(spindle=(4e-9, 0.0), overhang_exponent=3.0),
    "frame_sway": HiddenMachine(table=np.array([3e-9, 3e-9, 2e-9]), rocking=1.5e-9),
    "joint_offset": HiddenMachine(platform_errors=np.outer(np.arange(6) == 2, [4e-3, -3e-3, 6e-3])),
}
# Relative. Node springs and rigid penalties cost the assembly some digits, no more.
EXACT = 1e-6


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """The rig's tilted layout: its own rows, and the same read back from a measurement file."""
    nominal = load_nominal("nist")
    table = tilted_campaign(nominal, np.random.default_rng(5))
    columns = {**table, "stiffness_N_per_mm": ["50000"] * len(table["direction"])}
    lines = [",".join(columns)] + [",".join(str(cell) for cell in row) for row in zip(*columns.values(), strict=True)]
    file = tmp_path_factory.mktemp("rig") / "campaign.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return nominal, rows_of(table), read_measurements(file, nist())


def ours(name: str) -> StiffnessModel:
    effect = all_effects()[name]
    values = {p.name: SIZES[name][p.name] * (p.si if not p.discrete else 1) for p in effect.parameters}
    return build_model(nist(), extra=[ActiveEffect(effect, values)])


def test_without_an_effect(campaign):
    nominal, rows, data = campaign
    assert model_stiffness(model_with(), data) == pytest.approx(readings(nominal, HiddenMachine(), rows), rel=EXACT)


@pytest.mark.parametrize("name", SIZES)
def test_the_same_effect_in_both(campaign, name):
    nominal, rows, data = campaign
    hidden = HIDDEN.get(name) or with_effect(HiddenMachine(), name, SIZES[name])
    expected = readings(nominal, hidden, rows)
    found = model_stiffness(ours(name), data)
    plain = readings(nominal, HiddenMachine(), rows)
    assert np.abs(expected / plain - 1.0).max() > 5e-3  # it is there
    assert np.abs(found / expected - 1.0).max() < EXACT
