"""Programs posted for other machines: forward kinematics against those that others published, and moves on the part."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolpath_stiff.nc.kinematics import PostedKinematics, read_kinematics, roll_pitch, tool_poses
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.toml_reader import TomlReader

TOLERANCE_MM = 1e-3

angles = st.floats(-180.0, 180.0)
lengths = st.floats(-300.0, 300.0)
points = st.tuples(lengths, lengths, lengths)


def kinematics(text: str) -> PostedKinematics:
    toml = TomlReader(text, "control.toml")
    toml.data = {"kinematics": toml.data}
    found = read_kinematics(toml)
    assert found is not None
    return found


def two(kind: str, first: str, second: str, tcp: bool = False, more: str = "") -> PostedKinematics:
    """A kinematics with two axes, their tables in one line each."""
    names = {"head-table": ("head", "table")}.get(kind, ("primary", "secondary"))
    where = 'points = "program"\n' if "table" in kind else ""
    head = f'type = "{kind}"\ntcp = {str(tcp).lower()}\n{where}{more}\n'
    return kinematics(head + "".join(f"[{name}]\n{axis}\n" for name, axis in zip(names, (first, second), strict=True)))


def tip_mm(posted: PostedKinematics, xyz_mm: tuple, abc_deg: tuple, tool_mm: float = math.nan) -> np.ndarray:
    tip, _ = tool_poses(posted, np.array([xyz_mm]) / 1e3, np.radians([abc_deg]), tool_mm / 1e3)
    return np.array(tip[0] * 1e3)


def axis_of(posted: PostedKinematics, abc_deg: tuple) -> np.ndarray:
    return tool_poses(posted, np.zeros((1, 3)), np.radians([abc_deg]), 0.0)[1][0]


# -- LinuxCNC's published kinematics -----------------------------------------------------------------------------------
# From its kinematics modules (github.com/LinuxCNC/linuxcnc): src/emc/kinematics/trtfuncs.c (xyzac-trt-kins,
# xyzbc-trt-kins: R. du Preez), 5axiskins.c and maxkins.c (C. Radek), src/hal/components/xyzab_tdr_kins.comp
# (D. Mueller);
# documented in its manual, "5-Axis Kinematics". Joints to part, mm and degrees; names as there.


def xyzac_trt(x, y, z, a, c, rot, dy, dz, dt):
    sa, ca, sc, cc = math.sin(a), math.cos(a), math.sin(c), math.cos(c)
    x, y, z, dz = x - rot[0], y - rot[1] - dy, z - rot[2] - dz - dt, dz + dt
    return (
        cc * x + sc * ca * y + sc * sa * z + sc * dy + rot[0],
        -sc * x + cc * ca * y + cc * sa * z + cc * dy + rot[1],
        -sa * y + ca * z + dz + rot[2],
    )


def xyzbc_trt(x, y, z, b, c, rot, dx, dz, dt):
    sb, cb, sc, cc = math.sin(b), math.cos(b), math.sin(c), math.cos(c)
    x, y, z, dz = x - rot[0] - dx, y - rot[1], z - rot[2] - dz - dt, dz + dt
    return (
        cc * cb * x + sc * y - cc * sb * z + cc * dx + rot[0],
        -sc * cb * x + cc * y + sc * sb * z - sc * dx + rot[1],
        sb * x + cb * z + dz + rot[2],
    )


def xyzab_tdr(x, y, z, a, b, rot, dz, dt):
    sa, ca, sb, cb = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    x, y, z = x - rot[0], y - rot[1], z - rot[2] - dt
    return (
        cb * x + sb * z + rot[0],
        sa * sb * x + ca * y - cb * sa * z + sa * dz + rot[1],
        -ca * sb * x + sa * y + ca * cb * z - ca * dz + rot[2] + dz + dt,
    )


def bridgemill(x, y, z, b, c, pivot):
    theta, phi = c, math.pi - b
    return (
        x + pivot * math.sin(phi) * math.cos(theta),
        y + pivot * math.sin(phi) * math.sin(theta),
        z + pivot * math.cos(phi) + pivot,
    )


def max_conventional(x, y, z, b, c, pivot):
    x = x - pivot * math.sin(b)
    return (
        x * math.cos(c) - y * math.sin(c),
        x * math.sin(c) + y * math.cos(c),
        z - pivot * math.cos(b) + pivot,
    )


@settings(max_examples=60, deadline=None)
@given(points, angles, angles, points, lengths, lengths, st.floats(0.0, 200.0))
def test_table_table_ac_as_linuxcnc_xyzac_trt(xyz, a, c, rot, dy, dz, tool):
    # Its tables turn by the right hand; joints and part coordinates are both those of the spindle's nose at 0.
    posted = two(
        "table-table",
        f'letter = "A"\nreversed = true\npoint_mm = [0, {rot[1] + dy}, {rot[2] + dz}]',
        f'letter = "C"\nreversed = true\npoint_mm = [{rot[0]}, {rot[1]}, 0]',
    )
    x, y, z = xyzac_trt(*xyz, math.radians(a), math.radians(c), rot, dy, dz, tool)
    found = tip_mm(posted, (xyz[0], xyz[1], xyz[2] - tool), (a, 0.0, c))
    np.testing.assert_allclose(found, (x, y, z - tool), atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(points, angles, angles, points, lengths, lengths, st.floats(0.0, 200.0))
def test_table_table_bc_as_linuxcnc_xyzbc_trt(xyz, b, c, rot, dx, dz, tool):
    posted = two(
        "table-table",
        f'letter = "B"\nreversed = true\npoint_mm = [{rot[0] + dx}, 0, {rot[2] + dz}]',
        f'letter = "C"\nreversed = true\npoint_mm = [{rot[0]}, {rot[1]}, 0]',
    )
    x, y, z = xyzbc_trt(*xyz, math.radians(b), math.radians(c), rot, dx, dz, tool)
    found = tip_mm(posted, (xyz[0], xyz[1], xyz[2] - tool), (0.0, b, c))
    np.testing.assert_allclose(found, (x, y, z - tool), atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(points, angles, angles, points, lengths, st.floats(0.0, 200.0))
def test_table_table_ba_as_linuxcnc_xyzab_tdr(xyz, a, b, rot, dz, tool):
    posted = two(
        "table-table",
        f'letter = "B"\npoint_mm = [{rot[0]}, 0, {rot[2]}]',
        f'letter = "A"\npoint_mm = [0, {rot[1]}, {rot[2] + dz}]',
    )
    x, y, z = xyzab_tdr(*xyz, math.radians(a), math.radians(b), rot, dz, tool)
    found = tip_mm(posted, (xyz[0], xyz[1], xyz[2] - tool), (a, b, 0.0))
    np.testing.assert_allclose(found, (x, y, z - tool), atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(points, angles, angles, st.floats(0.0, 400.0), st.floats(0.0, 200.0))
def test_head_head_cb_as_linuxcnc_5axiskins(xyz, b, c, pivot, tool):
    posted = two(
        "head-head",
        f'letter = "C"\npivot_mm = [0, 0, {pivot}]',
        f'letter = "B"\nreversed = true\npivot_mm = [0, 0, {pivot}]',
    )
    expected = bridgemill(*xyz, math.radians(b), math.radians(c), pivot + tool)
    np.testing.assert_allclose(tip_mm(posted, xyz, (0.0, b, c), tool), expected, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(points, angles, angles, st.floats(0.0, 400.0), st.floats(0.0, 200.0))
def test_head_table_bc_as_linuxcnc_maxkins(xyz, b, c, pivot, tool):
    posted = two("head-table", f'letter = "B"\npivot_mm = [0, 0, {pivot}]', 'letter = "C"\npoint_mm = [0, 0, 0]')
    expected = max_conventional(*xyz, math.radians(b), math.radians(c), pivot + tool)
    np.testing.assert_allclose(tip_mm(posted, xyz, (0.0, b, c), tool), expected, atol=1e-9)


# -- closed cases ------------------------------------------------------------------------------------------------------

AC_TABLE = ('letter = "A"\npoint_mm = [0, 0, -50]', 'letter = "C"\npoint_mm = [0, 0, 0]')


@pytest.mark.parametrize(
    ("abc", "axis"),
    [
        ((0, 0, 0), (0, 0, 1)),
        ((90, 0, 0), (0, -1, 0)),  # the tool lies along -Y of the part
        ((-90, 0, 0), (0, 1, 0)),
        ((90, 0, 90), (1, 0, 0)),  # and C turns that by the right hand
        ((0, 0, 77), (0, 0, 1)),
        ((30, 0, 0), (0, -0.5, math.sqrt(0.75))),
    ],
)
@pytest.mark.parametrize("tcp", [False, True])
def test_tool_axis_of_an_ac_table(abc, axis, tcp):
    np.testing.assert_allclose(axis_of(two("table-table", *AC_TABLE, tcp=tcp), abc), axis, atol=1e-15)


def test_a_table_turned_by_a_quarter_shows_another_side():
    # A 90: what was up lies at -Y; the tip 50 above the axis, on the machine, then is 50 off it in -Y of the part.
    posted = two("table-table", *AC_TABLE)
    np.testing.assert_allclose(tip_mm(posted, (7, 0, 0), (90, 0, 0)), (7, -50, -50), atol=1e-12)
    np.testing.assert_allclose(tip_mm(posted, (7, 0, 0), (90, 0, 90)), (50, 7, -50), atol=1e-12)


def test_a_head_swings_the_tip_about_its_pivot():
    # The pivot is 150 + 100 above the tip: A 90 turns the tool's axis to -Y, so the tip is 250 from the pivot in +Y.
    posted = kinematics('type = "head"\ntcp = false\n[head]\nletter = "A"\npivot_mm = [0, 0, 150]')
    np.testing.assert_allclose(tip_mm(posted, (0, 0, 0), (90, 0, 0), 100.0), (0, 250, 250), atol=1e-12)
    np.testing.assert_allclose(axis_of(posted, (90, 0, 0)), (0, -1, 0), atol=1e-15)


def test_a_nutated_head_lays_the_tool_flat_at_half_a_turn():
    # B about (0, 1, 1) / sqrt 2, as on 45-degree heads: half a turn lays +Z into +Y.
    posted = two(
        "head-head", 'letter = "C"\npivot_mm = [0, 0, 0]', 'letter = "B"\naxis = [0, 1, 1]\npivot_mm = [0, 0, 0]'
    )
    np.testing.assert_allclose(axis_of(posted, (0, 180, 0)), (0, 1, 0), atol=1e-15)
    np.testing.assert_allclose(axis_of(posted, (0, 180, -90)), (1, 0, 0), atol=1e-15)
    half = axis_of(posted, (0, 90, 0))  # z + (y + z) / 2 - z / 2 - ..., by hand: (sin 45, 1/2, 1/2)
    np.testing.assert_allclose(half, (math.sqrt(0.5), 0.5, 0.5), atol=1e-15)


def test_reversed_is_the_negative_angle():
    plain = two("table-table", *AC_TABLE)
    other = two("table-table", *(axis + "\nreversed = true" for axis in AC_TABLE))
    np.testing.assert_allclose(
        tip_mm(other, (1, 2, 3), (-20, 0, -70)), tip_mm(plain, (1, 2, 3), (20, 0, 70)), atol=1e-12
    )


def test_nothing_turned_changes_no_digit():
    xyz = np.array([[0.1, -0.2, 0.3]])
    head = 'type = "head"\ntcp = false\n[head]\nletter = "B"\npivot_mm = [3, 4, 5]'  # and the tool's length unknown
    for posted in (two("table-table", *AC_TABLE), kinematics(head)):
        np.testing.assert_array_equal(tool_poses(posted, xyz, np.zeros((1, 3)))[0], xyz)


@given(st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1), min_size=1, max_size=5))
def test_roll_and_pitch_turn_the_spindle_onto_the_axis(vectors):
    axes = np.array([np.array(v) / np.linalg.norm(v) for v in vectors])
    roll, pitch = roll_pitch(axes).T
    turned = rotation_matrices(np.stack([roll, pitch, np.zeros(len(roll))], axis=1))[:, :, 2]
    np.testing.assert_allclose(turned, axes, atol=1e-8)  # along y pitch is kept: 1e-9 of the axis
