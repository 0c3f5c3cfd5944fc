"""What was fitted, and how well it is known, in a machine file."""

from __future__ import annotations

import numpy as np
import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.machine.model import STRUT_LAW, EffectEntry, Uncertainty
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.stiffness.model import build_model, with_parameter_moved

RADIAL = "spindle_compliance.radial_nm_per_N"
COVARIANCE = np.array([[0.25, 0.03, -0.04], [0.03, 0.16, 0.01], [-0.04, 0.01, 0.09]])


@pytest.fixture(scope="module")
def updated():
    provenance = {"data": ['a "quoted" file.csv'], "sha256": ["00ff"], "error_before_percent": 9.625}
    entry = EffectEntry("spindle_compliance", {"radial_nm_per_N": 5.25, "axial_nm_per_N": 0.0}, provenance)
    machine = load_machine("nist")
    return machine.with_changes(
        effects=(entry,),
        uncertainty=Uncertainty.of([*STRUT_LAW, RADIAL], COVARIANCE),
        origins={**machine.origins, "strut_law": "fitted"},
    )


def test_written_and_read_back(updated):
    again = parse_machine(machine_toml(updated))
    assert again.effects == updated.effects
    assert again.uncertainty.names == (*STRUT_LAW, RADIAL)
    # Files carry 14 digits.
    assert again.uncertainty.covariance == pytest.approx(COVARIANCE, rel=1e-12)
    assert again.origins["strut_law"] == "fitted"
    assert machine_toml(again) == machine_toml(updated)


def test_a_parameter_moved(updated):
    model = build_model(updated)
    moved = with_parameter_moved(model, RADIAL, 0.5)
    assert moved.effects[0].values == pytest.approx({"radial": 5.75e-9, "axial": 0.0})
    stiffer = with_parameter_moved(model, STRUT_LAW[1], 2.0).machine
    assert stiffer.strut_law.stiffness_2 == pytest.approx(34.5e6)
    assert stiffer.strut_law.stiffness_1 == updated.strut_law.stiffness_1
    with pytest.raises(InputError, match="no parameter"):
        with_parameter_moved(model, "weak_strut.factor", 0.1)


def test_joined_and_parted(updated):
    both = updated.uncertainty.beside(Uncertainty.of(["weak_strut.factor"], np.array([[0.01]])))
    assert both.covariance[:3, :3] == pytest.approx(COVARIANCE)
    assert (both.covariance[3, :3] == 0.0).all() and both.sd[3] == pytest.approx(0.1)
    left = both.without(STRUT_LAW)
    assert left.names == (RADIAL, "weak_strut.factor")
    assert left.covariance == pytest.approx(np.diag([0.09, 0.01]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"spindle_compliance.radial_nm_per_N"', '"spindle_compliance.radius"', "is not a parameter of this file"),
        (
            'parameters = ["strut_law.stiffness_1_N_per_um", ',
            'parameters = ["strut_law.stiffness_2_N_per_um", ',
            "once",
        ),
        ("sd = [0.5", "sd = [-0.5", "at least 0"),
        ("sd = [0.5", "sd = [nan", "at least 0"),
        ("sd = [0.5, ", "sd = [", "3 numbers"),
        ("[1.0, 0.15,", "[1.0, 0.25,", "symmetric"),
        ("[uncertainty]\n", "[uncertainty]\nkind = 1\n", "unknown key"),
        ("correlation = ", "correlations = ", "unknown key"),
    ],
)
def test_wrong_uncertainties_are_named(updated, old, new, message):
    text = machine_toml(updated)
    assert old in text
    with pytest.raises(InputError, match=message) as caught:
        parse_machine(text.replace(old, new), file="mine.toml")
    assert caught.value.file == "mine.toml" and caught.value.line is not None


def test_a_correlation_that_cannot_be(updated):
    impossible = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    bad = Uncertainty(updated.uncertainty.names, np.ones(3), impossible)
    with pytest.raises(InputError, match="correlation"):
        parse_machine(machine_toml(updated.with_changes(uncertainty=bad)))
