"""Kinematics against hand cases, laws, and the paper's strut lengths; forward kinematics undoes inverse kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine, packaged_machines
from toolpath_stiff.machine.kinematics import (
    forward_kinematics,
    joint_angles,
    singularity_index,
    solve_struts,
    solve_struts_at,
)
from toolpath_stiff.machine.limits import Extremes, machine_limits, reach
from toolpath_stiff.machine.model import Hexapod, Limits, StrutLaw
from toolpath_stiff.rotations import rotation_about_z, rotation_matrices

NIST = load_machine("nist")
small = st.floats(-0.35, 0.35)
poses = st.tuples(small, small, st.floats(0.35, 1.25), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.3, 0.3))


def simple_machine() -> Hexapod:
    """Three pairs of struts at right angles: lengths and angles can be read off."""
    frame = np.array([[0, 0, 2.0], [0, 1, 2.0], [-2.0, 0, 0], [-2.0, 0, 1], [0, 2.0, 0], [1, 2.0, 0]])
    platform = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 0, 0], [1, 0, 0.0]])
    law = StrutLaw(1, 1e7, 3, 1e7)
    return Hexapod(name="simple", title="", source="", frame_joints=frame, platform_joints=platform,
                   reference_tool_length=0.1, strut_law=law)  # fmt: skip


def test_lengths_and_directions_by_hand():
    struts = solve_struts(simple_machine(), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(struts.lengths[0], 2.0)
    np.testing.assert_allclose(struts.directions[0, 0], [0, 0, -1])
    np.testing.assert_allclose(struts.directions[0, 2], [1, 0, 0])
    moved = solve_struts(simple_machine(), [1.5, 0.0, 0.0]).lengths[0]
    np.testing.assert_allclose(moved[:4], [2.5, 2.5, 3.5, 3.5])


def test_mean_strut_lengths_on_the_axis_are_the_papers():
    for z, length in ((1.268225, 2.5616), (0.353225, 3.2132)):  # m; printed in the paper, never fitted
        assert solve_struts(NIST, [0, 0, z]).lengths.mean() == pytest.approx(length, abs=5e-5)


def test_paper_pose_of_figure_2():
    lengths = solve_struts_at(NIST, [-0.3, 0.3, 0.3, np.deg2rad(-30), 0, 0]).lengths
    assert lengths.min() == pytest.approx(3.096, abs=5e-4) and lengths.max() == pytest.approx(3.582, abs=5e-4)


@given(poses, st.floats(-3, 3))
def test_turning_machine_and_pose_together_changes_no_length(pose, turn):
    about_z = rotation_about_z(turn)
    rotation = rotation_matrices(pose[3:])
    turned = NIST.with_changes(frame_joints=NIST.frame_joints @ about_z.T)
    one = solve_struts(NIST, pose[:3], rotation).lengths
    two = solve_struts(turned, about_z @ np.array(pose[:3]), about_z @ rotation).lengths
    np.testing.assert_allclose(one, two, rtol=1e-13)


@given(poses)
def test_symmetry_of_120_degrees_moves_the_struts_on(pose):
    third = rotation_about_z(2 * np.pi / 3)
    rotation = rotation_matrices(pose[3:])
    one = solve_struts(NIST, pose[:3], rotation).lengths[0]
    two = solve_struts(NIST, third @ np.array(pose[:3]), third @ rotation @ third.T).lengths[0]
    np.testing.assert_allclose(np.roll(one, 2), two, rtol=1e-12)


@given(poses)
def test_jacobian_is_the_derivative_of_the_lengths(pose):
    rotation = rotation_matrices(pose[3:])
    jacobian = solve_struts(NIST, pose[:3], rotation).jacobian[0]
    h = 1e-6  # m and rad: the error of central differences is of the order h^2, of rounding 1e-16 / h
    for k in range(6):
        twist = h * np.eye(6)[k]
        turn = rotation_matrices([twist[3:], -twist[3:]])  # one axis at a time: no order to mind
        plus = solve_struts(NIST, pose[:3] + twist[:3], turn[0] @ rotation).lengths[0]
        minus = solve_struts(NIST, pose[:3] - twist[:3], turn[1] @ rotation).lengths[0]
        np.testing.assert_allclose((plus - minus) / (2 * h), jacobian[:, k], atol=1e-8)


def test_joint_angles_vanish_at_the_neutral_pose_and_follow_a_pure_roll():
    neutral = solve_struts_at(NIST, NIST.limits.neutral_pose)
    frame, platform = joint_angles(NIST, neutral)
    np.testing.assert_allclose([frame, platform], 0.0, atol=1e-12)
    # A roll about the tip moves the joints by their arm, so the platform's swing is about the roll itself.
    turn = rotation_matrices([[0.1, 0, 0]])
    _, platform = joint_angles(NIST, solve_struts(NIST, NIST.limits.neutral_pose[:3], turn), turn)
    assert platform.max() < 0.13 and platform.min() > 0.0


def test_margins_count_from_the_limit_in_spans():
    limits = Limits(strut_length=(1.0, 3.0), workspace=np.array([[-1, -1, -1], [1, 1, 1.0]]))
    machine = simple_machine().with_changes(limits=limits)
    stand = reach(
        machine, [[0, 0, 0], [0.9, 0, 0], [1.2, 0, 0]], solve_struts(machine, [[0, 0, 0], [0.9, 0, 0], [1.2, 0, 0]])
    )
    assert stand.margin == pytest.approx([0.5, 0.05, -0.1])  # struts at 2 of 1 to 3; x 0.1 from 1; x 0.2 beyond, of 2
    assert stand.limits[stand.limit[1]].name in ("workspace x max", "strut3 max length", "strut4 max length")
    assert stand.reachable.tolist() == [True, True, False]
    assert "beyond" in stand.describe(2) and "200.000 mm" in stand.describe(2)


def test_limits_that_do_not_exist_are_not_listed():
    assert len(machine_limits(simple_machine())) == 6 + 1  # six shortest lengths of 0, and the singularity
    assert len(machine_limits(NIST)) == 12 + 12 + 6 + 1


def test_singularity_index_is_one_at_the_neutral_pose_and_zero_at_a_singular_one():
    assert singularity_index(NIST, solve_struts_at(NIST, NIST.limits.neutral_pose))[0] == pytest.approx(1.0)
    # With both joints of a vertex in one point, a yaw of 90 degrees on the axis is singular (Fichter 1986).
    vertices = 0.5 * (NIST.frame_joints[::2] + NIST.frame_joints[1::2])
    octahedral = NIST.with_changes(frame_joints=np.repeat(vertices, 2, axis=0))
    struts = solve_struts(octahedral, [0, 0, 0.8], rotation_about_z(np.pi / 2))
    assert singularity_index(octahedral, struts)[0] < 1e-12
    stand = reach(octahedral, [[0, 0, 0.8]], struts, rotation_about_z(np.array([np.pi / 2])))
    assert not stand.reachable[0]


@settings(max_examples=60, deadline=None)
@given(st.lists(poses, min_size=1, max_size=5))
def test_forward_kinematics_undoes_inverse_kinematics(several):
    wanted = np.array(several)
    lengths = solve_struts_at(NIST, wanted).lengths
    found = forward_kinematics(NIST, lengths)
    np.testing.assert_allclose(solve_struts_at(NIST, found).lengths, lengths, atol=1e-11)
    np.testing.assert_allclose(found[:, :3], wanted[:, :3], atol=1e-9)
    np.testing.assert_allclose(rotation_matrices(found[:, 3:]), rotation_matrices(wanted[:, 3:]), atol=1e-9)


def test_forward_kinematics_takes_a_tool_for_each_row():
    position, tools = np.array([[0.1, -0.05, 0.8], [0.0, 0.1, 0.7], [-0.1, 0.0, 0.9]]), np.array([np.nan, 0.4, 0.55])
    lengths = solve_struts(NIST, position, tool_length=tools).lengths
    found = forward_kinematics(NIST, lengths, tool_length=tools)
    np.testing.assert_allclose(found, np.concatenate([position, np.zeros((3, 3))], axis=1), atol=1e-9)


@pytest.mark.parametrize("name", list(packaged_machines()))
def test_forward_kinematics_of_every_machine_from_a_near_start(name):
    machine = load_machine(name)
    pose = np.array(machine.default_origin) + np.array([0.02, -0.03, 0.02, 0.05, -0.04, 0.03])
    found = forward_kinematics(machine, solve_struts_at(machine, pose).lengths)
    np.testing.assert_allclose(found[0], pose, atol=1e-9)


def test_forward_kinematics_refuses_lengths_that_no_pose_has():
    good = solve_struts_at(NIST, NIST.limits.neutral_pose).lengths[0]
    with pytest.raises(InputError, match=r"row 2: no pose"):
        forward_kinematics(NIST, [good, [0.1, 9, 0.1, 9, 0.1, 9]])


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -1.0])
def test_forward_kinematics_blames_the_row_that_is_bad(value):
    good = solve_struts_at(NIST, [0.1, 0.1, 0.7, 0.1, 0.05, 0.0]).lengths[0]
    with pytest.raises(InputError, match=r"row 2: no pose"):
        forward_kinematics(NIST, [good, np.full(6, value)])


def test_forward_kinematics_with_another_tool():
    position = np.array([[0.05, 0.02, 0.7]])
    lengths = solve_struts(NIST, position, tool_length=0.3).lengths
    np.testing.assert_allclose(forward_kinematics(NIST, lengths, tool_length=0.3)[0, :3], position[0], atol=1e-9)


@pytest.mark.parametrize("tool", [np.nan, 0.25])
@pytest.mark.parametrize("tilted", [False, True])
def test_extremes_say_what_reach_says(tilted, tool):
    """Margins from lengths and determinants that are known, against every joint's angle by Kahan's formula."""
    rng = np.random.default_rng(8)
    position = np.column_stack([rng.uniform(-0.6, 0.6, (2000, 2)), rng.uniform(0.1, 1.6, 2000)])  # and out of reach
    turn = rotation_matrices(rng.uniform(-0.3, 0.3, (2000, 3))) if tilted else None
    columns = None if turn is None else np.ascontiguousarray(turn.reshape(-1, 9).T)
    for machine in (NIST, NIST.with_changes(limits=Limits(frame_joint_angle=0.3)), simple_machine()):
        struts = solve_struts(machine, position, turn, tool)
        determinant = np.abs(np.linalg.det(struts.jacobian))
        wanted = reach(machine, position, struts, turn)
        known = (np.ascontiguousarray(position.T), np.ascontiguousarray(struts.lengths.T), determinant, columns, tool)
        found, sure = Extremes(machine, *known).reach()
        assert sure.mean() > 0.5 and (sure | (wanted.value < 0.21)).all()  # 0.2 rad has a cosine of 0.98
        np.testing.assert_allclose(found.margin[sure], wanted.margin[sure], rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(found.value[sure], wanted.value[sure], rtol=1e-13)
        np.testing.assert_array_equal(found.limit[sure], wanted.limit[sure])
        np.testing.assert_array_equal(found.reachable, wanted.reachable)
        np.testing.assert_allclose(Extremes(machine, *known).margin, wanted.margin, rtol=1e-7, atol=1e-7)


def test_extremes_leave_an_angle_near_zero_to_the_exact_formula():
    """At the neutral pose all angles are zero, of which a cosine of 1 knows eight digits."""
    machine = NIST.with_changes(limits=Limits(neutral_pose=(0.0, 0.0, 0.8, 0.0, 0.0, 0.0), frame_joint_angle=1e-3))
    tip = np.array([[0.0, 0.0, 0.8], [1e-3, 0.0, 0.8]])
    struts = solve_struts(machine, tip)
    determinant = np.abs(np.linalg.det(struts.jacobian))
    lengths = np.ascontiguousarray(struts.lengths.T)
    _, sure = Extremes(machine, tip.T, lengths, determinant, None, np.nan).reach()
    assert not sure.any()
