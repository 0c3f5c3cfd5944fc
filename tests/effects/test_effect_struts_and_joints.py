"""Struts and joints against closed forms on a machine that can be worked by hand, and against rotations measured."""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.cases import model_with, readings
from tests.stiffness.cases import nist, orthogonal_hexapod, random_poses
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.model import StrutLaw
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.model import load_path

TIP = np.zeros((3, 3))
AXES = np.eye(3)
STRUT = np.array([10e6, 20e6, 30e6])  # N/m, each of the two struts along X, Y, Z of the orthogonal hexapod


def on_axes(name: str, force: float = 1000.0, **values):
    return readings(model_with(name, orthogonal_hexapod(), **values), TIP, AXES, force=force)


def test_joint_compliance_in_two_equal_struts():
    c = 5e-9
    assert on_axes("joint_compliance", compliance=c) == pytest.approx(2.0 / (1.0 / STRUT + c), rel=1e-12)


@pytest.mark.parametrize("force", [100.0, 1000.0, 8000.0])
def test_clearance_is_lost_once_whatever_the_load(force):
    """Both struts of an axis take up their gap, so that the tip loses g and then moves by F / 2k."""
    gap = 3e-6
    expected = force / (gap + force / (2.0 * STRUT))
    assert on_axes("joint_clearance", force, lost_motion=gap) == pytest.approx(expected, rel=1e-9)


def test_contact_at_its_reference_force_and_at_eight_times_it():
    c = 10e-9
    at_500 = 1.0 / on_axes("contact_nonlinearity", 1000.0, compliance=c) - 0.5 / STRUT  # 500 N in each strut
    at_4000 = 1.0 / on_axes("contact_nonlinearity", 8000.0, compliance=c) - 0.5 / STRUT
    assert at_500 == pytest.approx(np.full(3, c / 2.0), rel=1e-9)
    assert at_4000 == pytest.approx(np.full(3, c / 4.0), rel=1e-9)


def test_contact_is_hertz():
    """Against Hertz' approach of a steel ball in a socket, R = 0.2 m, E* = 115 GPa, at any force."""
    for force in (200.0, 500.0, 3000.0):
        approach = (9.0 * force**2 / (16.0 * 0.2 * 115e9**2)) ** (1.0 / 3.0)
        at_500 = (9.0 * 500.0**2 / (16.0 * 0.2 * 115e9**2)) ** (1.0 / 3.0) / 500.0
        added = 1.0 / on_axes("contact_nonlinearity", 2.0 * force, compliance=at_500)[0] - 0.5 / STRUT[0]
        assert added == pytest.approx(0.5 * approach / force, rel=1e-9)
        assert at_500 == pytest.approx(7.5e-9, rel=0.01)  # the figure that its parameter quotes


def test_load_dependent_effects_vanish_or_fade_under_large_loads():
    plain = on_axes("")
    small, large = (on_axes("joint_clearance", force, lost_motion=2e-6) for force in (200.0, 1e6))
    assert (small < large).all() and large == pytest.approx(plain, rel=1e-3)


def test_one_weak_strut_of_two():
    expected = np.array([4.0 / (1.0 / STRUT[0] + 1.0 / (0.4 * STRUT[0])), 2.0 * STRUT[1], 2.0 * STRUT[2]])
    assert on_axes("weak_strut", strut=2, factor=0.4) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("strut", range(1, 7))
def test_a_weak_strut_mirrors_into_the_next_leg(strut):
    """Strut s at a pose is strut s + 2 at the pose turned by 120 degrees."""
    position = np.array([[0.2, 0.1, 0.8]])
    turn = rotation_matrices([0.0, 0.0, 2.0 * np.pi / 3.0])
    along = np.array([[0.6, 0.0, 0.8]])
    after = (strut + 1) % 6 + 1
    here = readings(model_with("weak_strut", strut=strut, factor=0.5), position, along)
    there = readings(model_with("weak_strut", strut=after, factor=0.5), position @ turn.T, along @ turn.T)
    assert here == pytest.approx(there, rel=1e-9)


def test_the_strut_law_is_untouched_at_its_two_lengths_and_e_to_the_q_between():
    machine = orthogonal_hexapod()  # struts of 1, 2, 3 m; the law is given at 1 and 3 m
    found = readings(model_with("strut_law", machine, curvature=0.1), TIP, AXES)
    assert found == pytest.approx(2.0 * STRUT * np.exp([0.0, 0.1, 0.0]), rel=1e-12)


def test_compliance_linear_in_length_is_the_quoted_curvature():
    """The typical curvature is that of a strut whose compliance, not stiffness, is linear: within 0.4 % between."""
    law = StrutLaw(2.5616, 46.5e6, 3.2132, 32.5e6)
    length = np.linspace(law.length_1, law.length_2, 9)
    share = (length - law.length_1) / (law.length_2 - law.length_1)
    linear_compliance = 1.0 / ((1.0 - share) / law.stiffness_1 + share / law.stiffness_2)
    middle = linear_compliance[4] / law.stiffness(length[4:5])[0]
    assert middle == pytest.approx(1.0 - 0.031, abs=0.0005)
    curved = law.stiffness(length) * middle ** (1.0 - (2.0 * share - 1.0) ** 2)
    assert curved == pytest.approx(linear_compliance, rel=0.004)


def swing_energy(machine, position, rotation, twist, strut):
    """Sum of squared angles by which the struts, or one, swing against frame and platform under a small twist."""
    before = solve_struts(machine, position, rotation)
    turned = rotation_about(twist[3:]) @ rotation
    after = solve_struts(machine, position + twist[:3], turned)
    against_frame = angle(before.directions, after.directions)
    against_platform = angle(before.directions @ rotation, after.directions @ turned)
    each = (against_frame**2 + against_platform**2).reshape(6)
    return float(each[strut - 1] if strut else each.sum())


def rotation_about(vector):
    size = np.linalg.norm(vector)
    if size == 0.0:
        return np.eye(3)
    x, y, z = vector / size
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(size) * cross + (1.0 - np.cos(size)) * cross @ cross


def angle(first, second):
    return np.arctan2(np.linalg.norm(np.cross(first, second), axis=-1), (first * second).sum(axis=-1))


@pytest.mark.parametrize("strut", [0, 2, 6])
def test_joint_moment_stiffness_from_measured_swings(strut):
    """The 6 x 6 of the effect against angles between strut axes before and after finite small motions."""
    machine = nist()
    positions, rotations = random_poses(4, 11)
    model = model_with("joint_moment_stiffness", stiffness=1.0, strut=strut)
    parallel = exact.assemble_links(model, load_path(model, positions, rotations))[1]
    step = 1e-5  # angles of 1e-5 are exact to 1e-11 in arctan2, and second-order terms are 1e-5 of the first
    for i in range(4):
        for twist in np.random.default_rng(i).normal(size=(8, 6)) * step:
            both_ways = (
                sum(swing_energy(machine, positions[i], rotations[i], sign * twist, strut) for sign in (1, -1)) / 2
            )
            assert twist @ parallel[i] @ twist == pytest.approx(both_ways, rel=1e-6)


def test_pin_joints_are_the_limit_and_stiff_joints_beat_the_beam_figures():
    """4 E I / L of steel struts, 3 m long: the typical sizes that the parameter quotes."""
    for diameter, expected in ((0.05, 0.84e5), (0.06, 1.75e5), (0.08, 5.5e5)):
        inertia = np.pi * diameter**4 / 64.0
        assert 4.0 * 206e9 * inertia / 3.0 == pytest.approx(expected, rel=0.01)
