"""The same program in other words is the same path: inches, G91, R for I J K, absolute centres, other spellings.

The words are those of a small writer of the tests (`tests/nc/emission.py`), which knows what each step shall do.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nc import emission, rs274
from tests.nc.emission import Style, Writer
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry

TOOLS = {number: ToolEntry(number, length, 6.0) for number, length in emission.TOOLS.items()}
# Seven decimals of a millimetre, nine of an inch, added up over a dozen steps in G91.
TOLERANCE_M = 1e-8
TOO_SHORT_M = 1e-6  # shorter than any step: what rounding leaves of none
PRINTED_M = 1e-5  # four decimals of an inch, a few times over: what rs274 prints

styles = st.builds(
    Style,
    inch=st.booleans(),
    incremental=st.booleans(),
    radius=st.booleans(),
    absolute_centers=st.booleans(),
    looks=st.integers(0, 10_000),
)


def written(steps, style: Style) -> tuple[str, np.ndarray]:
    """The program and, by line, the step that it is of."""
    writer = Writer(style)
    return writer.write(steps), np.array(writer.origin)


def read(text: str, **options) -> Moves | None:
    """Its moves; None if none cuts."""
    try:
        moves = parse_program(text, "part.nc", controller=Controller(tools=TOOLS), **options).moves
    except InputError as error:
        assert error.found == "no cutting move", f"{error}\n{text}"
        return None
    long = np.abs(moves.end - moves.start).max(axis=1) > TOO_SHORT_M
    return moves.take(long | (moves.arc_sweep != 0.0))


def assert_same(one: Moves, two: Moves, steps_of_one, steps_of_two, tolerance: float) -> None:
    np.testing.assert_array_equal(one.motion, two.motion)
    np.testing.assert_array_equal(steps_of_one[one.line - 1], steps_of_two[two.line - 1])
    for name in ("start", "end", "arc_center"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=tolerance, err_msg=name)
    np.testing.assert_allclose(one.arc_normal, two.arc_normal, atol=1e-9)
    np.testing.assert_allclose(one.arc_sweep, two.arc_sweep, rtol=0, atol=tolerance / 1e-3)  # radii of 5 mm and more
    np.testing.assert_allclose(one.tool_length, two.tool_length)
    np.testing.assert_allclose(one.dwell, two.dwell, atol=1e-9)
    # A feed of the rotary axes alone counts degrees, in inch programs too.
    linear = (np.abs(one.end - one.start)[:, :3].max(axis=1) > TOO_SHORT_M) | (one.arc_sweep != 0.0)
    np.testing.assert_allclose(one.feed[linear], two.feed[linear], rtol=1e-6)


@given(steps=emission.steps, style=styles)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_the_same_program_in_other_words(steps, style):
    plain, plain_steps = written(steps, Style())
    other, other_steps = written(steps, style)
    one, two = read(plain), read(other)
    assert (one is None) == (two is None)
    if one is not None and two is not None:
        assert_same(one, two, plain_steps, other_steps, TOLERANCE_M)


@given(steps=emission.steps)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_tool_goes_where_the_steps_say(steps):
    """Against the writer's own account: the end of the last move is where it stands."""
    writer = Writer(Style())
    moves = read(writer.write(steps))
    if moves is not None:
        here = np.array(writer.here)
        here[:3] += np.array(writer.zero) + np.array(writer.shift)
        here[2] += writer.length - (moves.tool_length[-1] * 1e3 if moves.tool_length[-1] > 0 else 0.0)
        end = np.concatenate([moves.end[-1, :3] * 1e3, np.rad2deg(moves.end[-1, 3:])])
        np.testing.assert_allclose(end, here, atol=1e-4)


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@given(steps=emission.steps, style=styles)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_random_modal_programs_are_read_the_same_by_both(steps, style):
    """Path, feeds and line numbers."""
    text, _ = written(steps, style)
    one = read(text)
    if one is None:
        return
    two = parse_program(text, "part.nc", controller=Controller(tools=TOOLS), interpreter="linuxcnc").moves
    two = two.take((np.abs(two.end - two.start).max(axis=1) > 3 * PRINTED_M) | (two.arc_sweep != 0.0))
    np.testing.assert_array_equal(one.line, two.line)
    np.testing.assert_array_equal(one.motion, two.motion)
    for name in ("start", "end"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=PRINTED_M, err_msg=name)
    np.testing.assert_allclose(one.arc_sweep, two.arc_sweep, atol=5e-3)
    np.testing.assert_allclose(one.feed, two.feed, rtol=1e-3)
    np.testing.assert_allclose(one.dwell, two.dwell, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "style"),
    [
        (("X", "Y"), Style()),
        (("G2 ", "G3 "), Style()),
        (("G91", "G90"), Style(incremental=True)),
        (("G20", "G21"), Style(inch=True)),
        ((" R", " R-"), Style(radius=True)),
    ],
)
def test_another_program_is_found_out(change, style):
    """The comparison itself: one slip, and it is not the same."""
    steps = [emission.Line(False, {0: 10.0, 1: 20.0}), emission.Turn("G17", (5.0, 0.0), -90.0, 0.0, 1)]
    steps.append(emission.Line(False, {0: 30.0}))
    text, of = written(steps, style)
    wrong = text.replace(*change)
    assert wrong != text
    try:
        other = read(wrong)
    except AssertionError:  # refused, with its reason
        return
    with pytest.raises(AssertionError):
        assert_same(read(text), other, of, of, TOLERANCE_M)
