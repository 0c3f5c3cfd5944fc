"""Arcs and tool axes of cutter-location files against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.nc.cutter_location import MM, START, leaning, read, refused, tilt
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import ARC
from toolpath_stiff.nc.tool_axes import GREAT_CIRCLE_DEG
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.rotations import rotation_matrices


def axes_of(abc) -> np.ndarray:
    """Tool axes, from tip to spindle, of roll, pitch, yaw."""
    return rotation_matrices(abc)[..., :, 2]


def test_semicircle_full_circle_and_arcs_through_points():
    half = f"{START}GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/-10,0,0\n"
    assert move_lengths(read(half).moves)[0] == pytest.approx(math.pi * 10 * MM)
    full = f"{START}GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/10,0,0\n"
    assert move_lengths(read(full).moves)[0] == pytest.approx(math.tau * 10 * MM)
    # Creo: one GOTO, its points on lines of their own, or all on one.
    for points in ("GOTO/0,10,0\n-10,0,0\n0,-10,0\n", "GOTO/0,10,0,$\n-10,0,0,$\n0,-10,0\n"):
        moves = read(f"{START}GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\n{points}").moves
        assert len(moves) == 3 and set(moves.motion) == {ARC}
        assert move_lengths(moves).sum() == pytest.approx(1.5 * math.pi * 10 * MM)
    backwards = f"{START}GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,-10,0\n-10,0,0\n"
    assert "do not follow each other" in str(refused(backwards))


@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: math.hypot(*v) > 0.1),
    st.floats(1, 200),
    st.floats(0.01, math.tau - 0.01),
    st.floats(-20, 20),
)
def test_arcs_about_any_axis_have_their_length(axis, radius, sweep, climb):
    """Length and end of a helix about any axis, from its closed form."""
    n = np.array(axis) / np.linalg.norm(axis)
    u = np.cross(n, [1, 0, 0] if abs(n[0]) < 0.7 else [0, 1, 0])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    center = np.array([3.0, -4.0, 5.0])
    start = center + radius * u
    end = center + radius * (math.cos(sweep) * u + math.sin(sweep) * v) + climb * n

    def numbers(vector):
        return ",".join(f"{value:.12f}" for value in vector)

    moves = read(
        f"{START}GOTO/{numbers(start)}\nCIRCLE/{numbers(center)},{numbers(n)},{radius!r}\nGOTO/{numbers(end)}\n"
    ).moves
    assert move_lengths(moves)[0] == pytest.approx(MM * math.hypot(radius * sweep, climb), rel=1e-6)
    np.testing.assert_allclose(moves.end[0, :3], MM * end, atol=1e-12)
    samples = sample_moves(moves, step=5 * MM)
    away = samples.position / MM - center
    from_axis = np.linalg.norm(away - (away @ n)[:, None] * n, axis=1)
    np.testing.assert_allclose(from_axis, radius, rtol=1e-6)


def test_tool_axis_of_45_degrees():
    half = math.sqrt(0.5)
    moves = read(
        f"{START}MULTAX/ON\nGOTO/0,0,0,{half:.7f},0,{half:.7f}\nGOTO/9,0,0\nGOTO/9,0,1,0,{half:.7f},{half:.7f}\n"
    )
    assert any("yaw" in text for text in moves.assumptions)
    ends = np.degrees(moves.moves.end[:, 3:])
    np.testing.assert_allclose(ends[0], [0, 45, 0], atol=1e-9)  # leans towards +X: a pitch
    np.testing.assert_allclose(ends[-1], [-45, 0, 0], atol=1e-9)  # towards +Y: a negative roll
    upright = read(f"{START}GOTO/0,0,0,0,0,1\nGOTO/9,0,0\n")
    assert not any("yaw" in text for text in upright.assumptions)


@given(tilt, tilt, st.booleans())
def test_tool_axis_turns_along_the_great_circle(first, second, around):
    """Sampled axes stay near the plane of the two, and turn evenly; tips stay on their line or arc."""
    a, b = leaning(first), leaning(second)

    def numbers(vector):
        return ",".join(f"{value:.9f}" for value in vector)

    circle = "CIRCLE/15,0,0,0,0,1,15\n" if around else ""
    moves = read(f"{START}GOTO/0,0,0,{numbers(a)}\n{circle}GOTO/30,0,0,{numbers(b)}\n").moves
    samples = sample_moves(moves, step=1 * MM)
    axes = axes_of(samples.abc)
    total = math.acos(np.clip(a @ b, -1, 1))
    share = samples.s / samples.s[-1]
    even = (
        a + share[:, None] * (b - a)
        if total < 1e-6
        else (np.sin((1 - share) * total)[:, None] * a + np.sin(share * total)[:, None] * b) / math.sin(total)
    )
    off = np.degrees(np.linalg.norm(axes - even, axis=1))
    assert off.max() <= GREAT_CIRCLE_DEG + 1e-6
    if around:
        np.testing.assert_allclose(np.hypot(samples.position[:, 0] - 15 * MM, samples.position[:, 1]), 15 * MM)
    else:
        np.testing.assert_allclose(samples.position[:, 1:], 0, atol=1e-15)
    assert set(moves.line) == {4 + around + 0}
    np.testing.assert_allclose(move_lengths(moves).sum(), (math.pi * 15 if around else 30) * MM)


def test_pitch_goes_on_where_the_tool_turns_right_round():
    """The tool axis goes round in XZ: pitch counts on over half a turn and does not jump back."""
    points = "".join(
        f"GOTO/{i},0,0,{math.sin(math.radians(20 * i)):.9f},0,{math.cos(math.radians(20 * i)):.9f}\n" for i in range(19)
    )
    pitch = np.degrees(read(START + points).moves.end[:, 4])
    assert np.diff(pitch).max() < 21 and pitch[-1] == pytest.approx(360, abs=1e-6)


@given(st.floats(0.02, 40), st.floats(0, math.tau), st.floats(0.5, 5.5), st.sampled_from(["INCHES", "MM"]))
def test_arcs_rounded_to_four_decimals_are_read(radius, start, sweep, units):
    """As NX rounds: in inches that is more than LinuxCNC allows of a small arc's radii."""

    def at(angle):
        return f"{1 + radius * math.cos(angle):.4f},{2 + radius * math.sin(angle):.4f},0.0000"

    text = (
        f"UNITS/{units}\nFEDRAT/10\nGOTO/{at(start)}\n"
        f"CIRCLE/1.0000,2.0000,0.0000,0.0000000,0.0000000,1.0000000,{radius:.4f}\nGOTO/{at(start + sweep)}\n"
    )
    moves = read(text).moves
    assert move_lengths(moves)[0] == pytest.approx(
        radius * sweep * (0.0254 if units == "INCHES" else MM), rel=0.03, abs=1e-5
    )
