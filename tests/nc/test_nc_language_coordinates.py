"""Polar words and the rotated coordinate system, against hand-computed points and the same path spelt plainly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.reader import parse_program

ROUNDING_M = 1e-12  # sums and cosines of numbers up to 1 m


def moves_of(text: str, **options):
    return parse_program(text, "part.nc", **options).moves


def ends_mm(text: str) -> list[list[float]]:
    return [[round(float(v), 6) + 0.0 for v in 1e3 * end[:3]] for end in moves_of(text).end]


number = st.floats(-500, 500).map(lambda v: round(v, 3))
angle = st.floats(-360, 360).map(lambda v: round(v, 3))


@given(number, number, angle, st.lists(st.tuples(number, number), min_size=1, max_size=5), st.booleans())
def test_rotation_is_a_rigid_turn_of_the_programmed_points(x, y, turn, points, incremental):
    """G68 X Y R turns what is programmed about X, Y, whether the steps are absolute or not."""
    plain = f"G0 X1 Y2 F100\n{{}}G1 X{points[0][0]} Y{points[0][1]} Z1\n"
    last = points[0]
    for px, py in points[1:]:
        plain += f"G91 X{px - last[0]:.6f} Y{py - last[1]:.6f}\nG90\n" if incremental else f"X{px} Y{py}\n"
        last = (px, py)
    straight, turned = (moves_of(plain.format(extra) + "Z0") for extra in ("", f"G68 X{x} Y{y} R{turn}\n"))
    if len(straight) != len(turned):  # a first point that is the present one
        return
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    away = straight.end[1:, :2] - np.array([x, y]) / 1e3
    wanted = away @ np.array([[c, s], [-s, c]]) + np.array([x, y]) / 1e3
    np.testing.assert_allclose(turned.end[1:, :2], wanted, atol=ROUNDING_M, rtol=0)
    np.testing.assert_array_equal(turned.end[1:, 2:], straight.end[1:, 2:])


def test_rotation_turns_arcs_and_holes_and_g69_ends_it():
    text = "G0 X20 Y0 F100\nG68 X10 Y0 R90\nG3 X10 Y10 I-10 J0\nG98 G81 X20 Y0 Z-1 R1\nG80 G69\nG1 X3 Y4"
    with pytest.raises(InputError, match="first move after G68"):
        moves_of(text.replace("X10 Y10 I-10", "X10 I-10"))
    moves = moves_of("G68 X10 Y0 R90\nG1 X20 Y0 F100\nG3 X10 Y10 I-10 J0\nG98 G81 X20 Y0 Z-1 R1\nG80 G69\nG1 X3 Y4")
    np.testing.assert_allclose(moves.end[0, :2], [0.01, 0.01], atol=ROUNDING_M)
    np.testing.assert_allclose(moves.end[1, :2], [0.0, 0.0], atol=ROUNDING_M)
    np.testing.assert_allclose(moves.arc_center[1, :2], [0.01, 0.0], atol=ROUNDING_M)
    np.testing.assert_allclose(moves.end[-3, :2], [0.01, 0.01], atol=ROUNDING_M)
    np.testing.assert_allclose(moves.end[-1, :2], [0.003, 0.004], atol=ROUNDING_M)


def test_rotation_about_the_present_point():
    """Without X, Y the centre is where the tool stands: then X alone says no other point than before."""
    assert ends_mm("G1 F100 X10 Y5\nG68 R90\nX11\nG69 G0 X0 Y0")[1:] == [[10, 6, 0], [0, 0, 0]]


def test_the_manual_s_incremental_steps_turn_from_the_tool():
    """Between G68 and the first absolute words the centre is the tool's place at G68 (Fanuc's manuals)."""
    ends = ends_mm("G0 X-50 Y-50\nG68 X70 Y30 R90\nG91 G1 F100 X50 Y20")
    assert ends[-1] == [-50 - 20, -50 + 50, 0]


def test_rotation_lies_within_offsets_and_shifts():
    ends = ends_mm("G10 L2 P2 X100 R90\nG55 G52 X10\nG68 X0 Y0 R90\nG1 F100 X5 Y0")
    # Program (5, 0) turns to (0, 5), is shifted to (10, 5), turned by the offset to (-5, 10), moved to (95, 10).
    assert ends[-1] == [95, 10, 0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G68 X0 Y0", "without its angle"),
        ("G68 X0 Y0 Z0 I0 J0 K1 R30", "beside Z"),
        ("G18 G68 X0 Z0 R30", "outside of G17"),
        ("G68 X0 Y0 R30\nG18", "another plane"),
        ("G68 X0 Y0 R30\nG55", "another work offset"),
        ("G68 X0 Y0 R30\nG92 X0", "shifts the zero"),
        ("G68 X0 Y0 R30\nG52 X0", "shifts the zero"),
        ("G68 X0 Y0 R30\nG10 L2 P1 X0", "sets a work offset"),
        ("G68 X0 Y0 R30\nG28", "machine coordinates"),
        ("G68 X0 Y0 R30\nG53 G0 X0", "machine coordinates"),
        ("G68 X0 Y0 R30\nG68 X5 Y0 R60", "another centre"),
        ("G68 X0 Y0 R30\nG91 G68 X0 Y0 R60", "where R may add"),
        ("G68 X0 Y0 R30 G1 F100", "axis words"),
        ("G0 X5 Y5\nG68 X0 Y0 R30\nG1 F100 X1", "first move after G68"),
        ("G0 X5 Y5\nG68 X0 Y0 R30\nG69 G1 F100 X1", "first move after G69"),
        ("G68 X0 Y0 R30\nG1 F100 X5 Y5\nG69 G91 X1 Y0", "incremental, in the first move after G69"),
        ("G16 G1 F100 X5", "half of a polar point"),
        ("G16 G1 F100 Y5", "half of a polar point"),
        ("G16 G1 F100 X5 Y5\nG91 X5", "polar radius in incremental mode"),
        ("G16 G1 F100 X5 Y5\nG17 G3 X5 Y30 I1", "I, J or K in polar mode"),
        ("G16 G1 F100 X5 Y5\nG55 X5", "half of a polar point"),
        ("G16 G1 F100 X5 Y5\nG18 Z5", "half of a polar point"),
    ],
)
def test_what_controls_differ_in_is_refused(text, words):
    with pytest.raises(InputError, match=words):
        parse_program(text + "\nG1 F100 X1 Y1\n", "part.nc")


def test_z_alone_may_go_home_while_rotated():
    assert ends_mm("G68 X0 Y0 R90\nG1 F100 X5 Y0 Z-1\nG91 G28 Z0\nG90 X6 Y0")[-1] == [0, 6, 0]


@given(st.floats(0.001, 500).map(lambda v: round(v, 3)), angle, angle, st.sampled_from(["G17", "G18", "G19"]))
def test_polar_words(radius, first, second, plane):
    one, other = {"G17": "XY", "G18": "ZX", "G19": "YZ"}[plane]
    polar = f"{plane} G16 G1 F100 {one}{radius} {other}{first}\n{other}{second}\n"
    points = [(radius * math.cos(math.radians(a)), radius * math.sin(math.radians(a))) for a in (first, second)]
    cartesian = f"{plane} G1 F100 {one}{points[0][0]:.15f} {other}{points[0][1]:.15f}\n"
    ends = moves_of(polar + "G15 G0 X0 Y0 Z9").end
    np.testing.assert_allclose(ends[0], moves_of(cartesian).end[0], atol=ROUNDING_M, rtol=0)
    axes = ["XYZ".index(one), "XYZ".index(other)]
    if (first - second) % 360.0:
        np.testing.assert_allclose(ends[1, axes], np.array(points[1]) / 1e3, atol=ROUNDING_M, rtol=0)


def test_polar_angle_is_in_degrees_in_inch_programs_and_adds_in_incremental_mode():
    ends = ends_mm("G20 G16 G1 F10 X1 Y30\nG91 Y30\nG90 X2\nG15 X0 Y0")
    assert ends == [[21.997045, 12.7, 0], [12.7, 21.997045, 0], [25.4, 43.994091, 0], [0, 0, 0]]


def test_polar_arcs_by_radius():
    moves = moves_of("G16 G1 F100 X10 Y0\nG3 X10 Y90 R10\nG15")
    np.testing.assert_allclose(moves.arc_center[1], 0.0, atol=ROUNDING_M)
    assert moves.arc_sweep[1] == pytest.approx(math.pi / 2)


def test_polar_zero_is_that_of_the_local_system():
    assert ends_mm("G52 X10 Y20\nG16 G1 F100 X5 Y90")[-1] == [10, 25, 0]


@given(st.sampled_from(["G1 X30 Y40 Z1", "G3 X0 Y0 I-5 J3 Z7", "G2 X0 Y8 I0 J4 P2 Z-3", "G1 A30", "G1 X3 B20"]))
def test_inverse_time_is_the_time_of_the_move(text):
    moves = moves_of(f"G93 F4 {text}")
    turn = np.abs(moves.end[0, 3:] - moves.start[0, 3:]).max()
    length = move_lengths(moves)[0] or turn
    assert length / moves.feed[0] == pytest.approx(60.0 / 4.0, rel=1e-12)
