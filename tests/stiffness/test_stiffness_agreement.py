"""The exact route against the 25-element reference, the reference against OpenSees, and the laws of both."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stiffness import opensees, reference
from tests.stiffness.cases import compliance_of_wrenches, nist, random_poses, wrench_compliance
from toolpath_stiff.rotations import rotation_about_z
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.core import BLOCK, tip_compliance
from toolpath_stiff.stiffness.model import build_model, load_path

# The reference loses about 4e-23 (N/m)^-1 times the bar stiffness to cancellation, 4e-11 at 1e12 N/m.
AGREEMENT = 1e-9


def relative(first: np.ndarray, second: np.ndarray) -> float:
    """Largest difference of two compliances relative to the largest entry, per block of like units."""
    worst = 0.0
    for rows in (slice(0, 3), slice(3, 6)):
        for columns in (slice(0, 3), slice(3, 6)):
            one, other = first[..., rows, columns], second[..., rows, columns]
            if one.size:
                worst = max(worst, np.abs(one - other).max() / np.abs(other).max())
    return worst


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    tilt=st.floats(0.0, 30.0),
    log_bars=st.floats(8.0, 12.0),
    tool_mm=st.floats(0.0, 350.0),
)
def test_both_routes_agree_for_forces_and_moments(seed, tilt, log_bars, tool_mm):
    machine = nist(10.0**log_bars)
    position, rotation = random_poses(1, seed, tilt)
    length = tool_mm / 1e3
    with_tool = machine.with_changes(platform_joints=machine.platform_joints_for(length))
    model = build_model(machine)
    path = load_path(model, position, rotation, length)
    tip = reference.tip_compliance(with_tool, position[0], rotation[0])
    assert relative(exact.tip_compliance(model, path)[0], tip) < AGREEMENT
    wrench = wrench_compliance(with_tool, position[0], rotation[0])
    assert relative(compliance_of_wrenches(model, path)[0], wrench) < AGREEMENT


def test_tools_of_several_lengths_in_one_batch():
    machine = nist(1e9)
    position, rotation = random_poses(6, 3)
    lengths = np.array([np.nan, 0.1, 0.25, 0.1, np.nan, 0.15])
    batch = tip_compliance(build_model(machine), position, rotation, lengths)
    for i, length in enumerate(lengths):
        one = machine.with_changes(platform_joints=machine.platform_joints_for(length))
        assert relative(batch[i], reference.tip_compliance(one, position[i], rotation[i])) < AGREEMENT


def test_a_block_boundary_and_no_poses_at_all():
    model = build_model(nist(1e10))
    position, rotation = random_poses(BLOCK + 3, 4)
    whole = tip_compliance(model, position, rotation)
    assert np.array_equal(whole[BLOCK:], tip_compliance(model, position[BLOCK:], rotation[BLOCK:]))
    assert tip_compliance(model, np.empty((0, 3)), np.empty((0, 3, 3))).shape == (0, 3, 3)
    assert exact.compliance_along(model, load_path(model, np.empty((0, 3))), np.empty((0, 3))).shape == (0,)


def test_opensees_agrees_with_the_reference():
    """The 25 bars built again, by hand, in OpenSees."""
    pytest.importorskip("openseespy.opensees")
    machine = nist(1e10)
    for tip, turn in zip(*random_poses(8, 5), strict=True):
        # Both solve the same ill-conditioned system (bars 200 times stiffer than struts): 1e-10 is rounding.
        plain = reference.tip_compliance(machine, tip, turn)
        assert relative(plain, opensees.compliance(machine, tip, turn, 1e10)) < 1e-10


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), tilt=st.floats(0.0, 30.0), bars=st.sampled_from([np.inf, 1e9]))
def test_120_degree_symmetry(seed, tilt, bars):
    """Turning path and tool axis by 120 degrees turns the compliance: R' = Rz R Rz^-1."""
    model = build_model(nist(bars))
    position, rotation = random_poses(4, seed, tilt)
    turn = rotation_about_z(2.0 * np.pi / 3.0)
    first = tip_compliance(model, position, rotation)
    second = tip_compliance(model, position @ turn.T, turn @ rotation @ turn.T)
    assert relative(second, turn @ first @ turn.T) < 1e-12


def test_other_turns_are_no_symmetry():
    """Negative control: the machine is no body of revolution, so 90 degrees must show."""
    model = build_model(nist())
    position, rotation = random_poses(4, 6)
    turn = rotation_about_z(np.pi / 2.0)
    second = tip_compliance(model, position @ turn.T, turn @ rotation @ turn.T)
    assert relative(second, turn @ tip_compliance(model, position, rotation) @ turn.T) > 1e-2


@pytest.mark.parametrize("bars", [np.inf, 1e9])
def test_compliance_is_symmetric_and_positive_definite(bars):
    """Betti's reciprocity, before `exact` averages rounding away, and energy above zero for every wrench."""
    model = build_model(nist(bars))
    path = load_path(model, *random_poses(50, 7))
    twists, _ = exact.respond(path, *exact.assemble_links(model, path), np.broadcast_to(np.eye(6), (50, 6, 6)))
    assert relative(twists, np.swapaxes(twists, 1, 2)) < 1e-10  # cond(J), about 1e3, times a few rounding errors
    assert np.linalg.eigvalsh(compliance_of_wrenches(model, path)).min() > 0.0


def test_more_compliance_in_the_bars_is_more_at_the_tip():
    """Rayleigh: softening any member cannot stiffen the structure, in no direction."""
    position, rotation = random_poses(30, 8)
    soft, stiff = (tip_compliance(build_model(nist(k)), position, rotation) for k in (1e9, 1e10))
    assert np.linalg.eigvalsh(soft - stiff).min() > 0.0
