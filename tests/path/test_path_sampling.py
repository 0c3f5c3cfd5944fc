"""Sampling: closed-form curves, ends, weights, times, rigid turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.moves_factory import make_moves
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import RAPID, held_once
from toolpath_stiff.path.placing import place, place_orientations
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices

ROUNDING = 1e-12  # m: a few hundred units in the last place of a metre

coordinate = st.floats(-0.5, 0.5)
point = st.tuples(coordinate, coordinate, coordinate)
angle = st.floats(-3.0, 3.0)


def test_full_circle_has_the_circumference_and_lies_on_the_circle():
    radius = 0.025
    moves = make_moves([{"start": [radius, 0, 0], "end": [radius, 0, 0], "sweep": 2 * np.pi}])
    samples = sample_moves(moves, step=1e-3)
    assert move_lengths(moves)[0] == pytest.approx(2 * np.pi * radius, rel=1e-14)
    np.testing.assert_allclose(np.hypot(*samples.position[:, :2].T), radius, atol=ROUNDING)
    np.testing.assert_allclose(np.sum(samples.position * samples.tangent, axis=1), 0.0, atol=ROUNDING)
    quarter = sample_moves(moves, step=2 * np.pi * radius / 4).position
    expected = radius * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]])
    np.testing.assert_allclose(quarter, expected, atol=ROUNDING)


@pytest.mark.parametrize("column", [[3, 3, 3], [np.nan] * 2, [0.1, np.nan], [1, 2], [7], []])
def test_a_column_of_one_value_holds_it_once(column):
    given = np.array(column)
    held = held_once(given)
    np.testing.assert_array_equal(held, given)
    assert (held is not given) == (len(column) > 0 and len({str(value) for value in column}) == 1)


def test_clockwise_arc_goes_the_other_way():
    moves = make_moves([{"start": [0.01, 0, 0], "end": [0, 0.01, 0], "sweep": -1.5 * np.pi}])
    middle = sample_moves(moves, step=1.5 * np.pi * 0.01 / 2).position[1]
    np.testing.assert_allclose(middle, [-0.01 / np.sqrt(2), -0.01 / np.sqrt(2), 0], atol=ROUNDING)


def test_helix_of_three_turns():
    radius, climb, turns = 0.01, -0.006, 3
    moves = make_moves(
        [{"start": [radius, 0, 0], "end": [radius, 0, climb], "sweep": 2 * np.pi * turns, "normal": [0, 0, 1]}]
    )
    assert move_lengths(moves)[0] == pytest.approx(np.hypot(2 * np.pi * radius * turns, climb), rel=1e-14)
    samples = sample_moves(moves, step=1e-4)
    theta = np.unwrap(np.arctan2(samples.position[:, 1], samples.position[:, 0]))
    np.testing.assert_allclose(samples.position[:, 2], climb * theta / (2 * np.pi * turns), atol=1e-11)


def test_spiral_length_against_quadrature():
    # Radii 20 and 20.5 mm over a half turn: the length formula is exact to second order in the difference.
    from scipy.integrate import quad

    r0, r1, sweep = 0.020, 0.0205, np.pi
    moves = make_moves([{"start": [r0, 0, 0], "end": [-r1, 0, 0], "sweep": sweep}])
    exact = quad(lambda u: np.hypot((r0 + u * (r1 - r0)) * sweep, r1 - r0), 0, 1)[0]
    assert move_lengths(moves)[0] == pytest.approx(exact, rel=(0.5 / 20) ** 2)


@pytest.mark.parametrize("normal", [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
def test_arcs_in_every_plane_tangents_against_finite_differences(normal):
    n = np.array(normal, dtype=float)
    e1 = np.roll(n, 1)
    center = np.array([0.1, -0.2, 0.3])
    moves = make_moves(
        [
            {
                "start": center + 0.05 * e1,
                "end": center + 0.05 * np.cross(n, e1) + 0.02 * n,
                "sweep": np.pi / 2,
                "center": center,
                "normal": n,
            }
        ]
    )
    samples = sample_moves(moves, step=1e-5)
    slope = np.gradient(samples.position, samples.s, axis=0)
    # Central differences of a circle of 50 mm at 10 um: error (h/r)^2/6, far below 1e-6.
    np.testing.assert_allclose(samples.tangent[1:-1], slope[1:-1], atol=1e-6)


@given(st.lists(point, min_size=1, max_size=8), st.floats(1e-3, 0.3))
def test_polyline_ends_steps_and_weights(points, step):
    rows = [{"end": [0.9, 0.9, 0.9]}, *({"end": p} for p in points)]
    moves = make_moves(rows)
    samples = sample_moves(moves, step=step)
    lengths = move_lengths(moves)
    assert samples.weight.sum() == pytest.approx(lengths.sum(), rel=1e-12)
    for i in range(len(moves)):
        mine = samples.position[samples.move == i]
        np.testing.assert_array_equal(mine[0], moves.start[i, :3])
        np.testing.assert_array_equal(mine[-1], moves.end[i, :3])
        gaps = np.linalg.norm(np.diff(mine, axis=0), axis=1)
        assert gaps.max(initial=0.0) <= step * (1 + 1e-9)
    assert (np.diff(samples.s) >= -1e-15).all() and (np.diff(samples.t) >= -1e-12).all()


def test_rapids_weigh_nothing_and_take_the_rapid_feed():
    moves = make_moves([{"end": [0.1, 0, 0], "motion": RAPID, "feed": np.nan}, {"end": [0.1, 0.03, 0], "dwell": 2.0}])
    samples = sample_moves(moves, step=0.01, rapid_feed=0.2)
    assert samples.weight.sum() == pytest.approx(0.03)
    assert samples.t[samples.move == 0][-1] == pytest.approx(0.5)
    assert samples.t[-1] == pytest.approx(0.5 + 0.03 / 0.01)
    assert np.isnan(samples.feed[0]) and not samples.cutting[0]


def test_rotary_move_alone_has_no_tangent_and_no_weight():
    moves = make_moves([{"end": [0, 0, 0, np.deg2rad(10)], "feed": np.deg2rad(5)}])
    samples = sample_moves(moves, step=1e-3)
    assert len(samples) == 11  # one degree at a time
    assert not samples.tangent.any() and not samples.weight.any()
    assert samples.t[-1] == pytest.approx(2.0)


def test_too_fine_a_step_is_refused_with_the_step_to_use():
    with pytest.raises(InputError, match="--step"):
        sample_moves(make_moves([{"end": [1.0, 0, 0]}]), step=1e-9)


@given(st.tuples(angle, st.floats(-1.5, 1.5), angle))
def test_roll_pitch_yaw_round_trip(abc):
    turn = rotation_matrices(abc)
    np.testing.assert_allclose(rotation_matrices(roll_pitch_yaw(turn)), turn, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)


def test_rotation_matrix_is_yaw_pitch_roll():
    quarter = np.pi / 2
    np.testing.assert_allclose(rotation_matrices([quarter, 0, 0]) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(rotation_matrices([0, quarter, 0]) @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rotation_matrices([0, 0, quarter]) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    # Roll first, yaw last: x stays under roll and goes to y under yaw.
    np.testing.assert_allclose(rotation_matrices([quarter, 0, quarter]) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_gimbal_lock_comes_back_as_the_same_rotation():
    turn = rotation_matrices([0.3, np.pi / 2, 0.5])
    np.testing.assert_allclose(rotation_matrices(roll_pitch_yaw(turn)), turn, atol=1e-9)


@settings(max_examples=50)
@given(point, angle)
def test_turn_about_z_turns_path_and_tool_axis_but_a_vertical_platform_never_yaws(shift, turn):
    origin = (*shift, 0.0, 0.0, turn)
    moves = make_moves(
        [{"end": [0.1, 0, 0]}, {"end": [0.1, 0.1, 0, 0.2, -0.1]}, {"start": [0.1, 0.1, 0], "end": [0.1, 0.2, 0]}]
    )
    plain = sample_moves(moves, step=0.05)
    turned = sample_moves(moves, step=0.05, origin=origin)
    about_z = rotation_about_z(turn)
    np.testing.assert_allclose(turned.position, plain.position @ about_z.T + shift, atol=ROUNDING)
    np.testing.assert_allclose(turned.tangent, plain.tangent @ about_z.T, atol=ROUNDING)
    axes = rotation_matrices(turned.abc)[:, :, 2]
    np.testing.assert_allclose(axes, rotation_matrices(plain.abc)[:, :, 2] @ about_z.T, atol=ROUNDING)
    vertical = ~plain.abc.any(axis=1)
    np.testing.assert_allclose(turned.abc[vertical], 0.0, atol=ROUNDING)


def test_tilted_set_up_tilts_path_and_tool_axis():
    origin = (0.0, 0.0, 0.8, 0.0, np.deg2rad(10), np.deg2rad(90))
    moves = make_moves([{"end": [0.1, 0, 0]}])
    samples = sample_moves(moves, step=0.1, origin=origin)
    # x of the set-up: down by 10 degrees about y, then turned to y.
    expected = [0.0, 0.1 * np.cos(np.deg2rad(10)), 0.8 - 0.1 * np.sin(np.deg2rad(10))]
    np.testing.assert_allclose(samples.position[-1], expected, atol=ROUNDING)
    axis = rotation_matrices(samples.abc[-1])[:, 2]
    np.testing.assert_allclose(axis, [0.0, np.sin(np.deg2rad(10)), np.cos(np.deg2rad(10))], atol=ROUNDING)


@given(st.floats(0.01, 0.1), st.floats(0.01, 0.1), st.floats(0.5, 12.0), st.floats(-0.05, 0.05), st.floats(5e-4, 0.05))
def test_no_step_is_exceeded_where_the_radii_of_an_arc_differ(start, end, sweep, climb, step):
    moves = make_moves(
        [{"start": [start, 0, 0], "end": [end * np.cos(sweep), end * np.sin(sweep), climb], "sweep": sweep}]
    )
    gaps = np.linalg.norm(np.diff(sample_moves(moves, step).position, axis=0), axis=1)
    # A chord is never longer than its arc; the rest is the rounding of a whole number of steps.
    assert gaps.max() <= step * (1 + 1e-9)


@settings(max_examples=50)
@given(point, st.tuples(angle, angle, angle), st.lists(point, min_size=1, max_size=5))
def test_a_rigid_turn_keeps_lengths_times_and_weights(shift, turn, points):
    moves = make_moves(
        [
            {"end": [0.9, 0.9, 0.9]},
            *({"end": p} for p in points),
            {"start": [0.05, 0, 0], "end": [0, 0.05, 0.01], "sweep": 2.5 * np.pi},
        ]
    )
    origin = (*shift, *turn)
    plain, turned = sample_moves(moves, 0.05), sample_moves(moves, 0.05, origin=origin)
    # A length next to a whole number of steps may gain or lose one by rounding; the totals may not.
    assert turned.weight.sum() == pytest.approx(plain.weight.sum(), rel=1e-12)
    assert turned.s[-1] == pytest.approx(plain.s[-1], rel=1e-12)
    assert turned.t[-1] == pytest.approx(plain.t[-1], rel=1e-12)


@pytest.mark.parametrize(
    ("move", "borders"),
    [
        ({"start": [0, 0, 0], "end": [0.02, 0, 0.02], "center": [0.02, 0, 0], "normal": [0, 1, 0]}, 1),
        ({"start": [0, 0, 0], "end": [0, 0, 0], "center": [3e-4, 0, 0], "normal": [0, 1, 0], "sweep": 2 * np.pi}, 4),
        ({"end": [0, 0, 0.02, 0, 0.3]}, 1),  # pitch by 0.3 rad
        ({"end": [0, 0, 0.02, 0, 0.08]}, 0),
        ({"start": [0.02, 0, 0], "end": [0, 0.02, 0], "sweep": np.pi / 2}, 0),
    ],
)
@pytest.mark.parametrize("origin", [(0.0,) * 6, (0.1, 0.0, 0.8, 0.2, -0.3, 0.5)])
def test_where_a_plunge_becomes_a_cut_the_cut_has_a_sample(move, borders, origin):
    if "center" in move:
        move.setdefault("sweep", np.pi / 2)
    moves = make_moves([move])
    samples = sample_moves(moves, 1e-3, origin=origin)
    axis = rotation_matrices(samples.abc)[:, :, 2]
    lean = np.degrees(np.arccos(np.clip(np.abs(np.sum(axis * samples.tangent, axis=1)), 0.0, 1.0)))
    assert np.count_nonzero((lean > 5.0) & (lean < 5.0 + 1e-8)) == borders
    assert (np.diff(samples.s) > 0.0).all()
    assert samples.weight.sum() == pytest.approx(move_lengths(moves)[0], rel=1e-12)


def test_three_turns_of_120_degrees_are_none():
    third = (0.0, 0.0, 0.0, 0.0, 0.0, 2 * np.pi / 3)
    moves = make_moves(
        [
            {"end": [0.1, 0.05, -0.02, 0.2, -0.1, 0.3]},
            {"start": [0.05, 0, 0, 0.2, -0.1, 0.3], "end": [0, 0.05, 0.01, -0.1, 0.2], "sweep": np.pi / 2},
        ]
    )
    plain = sample_moves(moves, 0.01)
    placed, abc = moves, plain.abc
    for _ in range(3):
        placed, abc = place(placed, third), place_orientations(abc, third)
    np.testing.assert_allclose(sample_moves(placed, 0.01).position, plain.position, atol=ROUNDING)
    np.testing.assert_allclose(rotation_matrices(abc), rotation_matrices(plain.abc), atol=ROUNDING)
