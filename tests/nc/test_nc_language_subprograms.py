"""M98 and M99: the same path as the program written out, and as LinuxCNC has it; what would never end is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import assert_same_path
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.reader import parse_program, read_program

BODIES = {
    1000: ["G91 G1 X1 Y2", "G90"],
    2000: ["G91 G1 Z-1", "G2 X5 Y5 R20", "G1 Z1", "G90"],
    3000: ["G98 G81 X3 Y3 Z-2 R1", "X4", "G80", "G91", "G0 Z1", "G90"],
    42: ["G20", "G1 X0.5 F10", "G21 F200"],
}


def program_text(calls, nested: dict[int, int]) -> str:
    lines = ["%", "O0001 (MAIN)", "G21 G90 F100", "G1 X1"]
    lines += [f"M98 P{number} L{count}" for number, count in calls]
    lines += ["G1 X50 Y50", "M30"]
    for number, body in BODIES.items():
        inner = [f"M98 P{nested[number]}"] if number in nested else []
        lines += [f"O{number}", *body, *inner, "M99"]
    return "\n".join([*lines, "%", ""])


def expanded_text(calls, nested: dict[int, int]) -> str:
    def body(number: int) -> list[str]:
        return [*BODIES[number], *(body(nested[number]) if number in nested else [])]

    lines = ["G21 G90 F100", "G1 X1"]
    for number, count in calls:
        lines += body(number) * count
    return "\n".join([*lines, "G1 X50 Y50", "M30", ""])


CALLS = st.lists(st.tuples(st.sampled_from(sorted(BODIES)), st.integers(1, 4)), min_size=1, max_size=4)
NESTED = st.sampled_from([{}, {1000: 2000}, {2000: 1000}, {1000: 3000, 3000: 42}])


@given(CALLS, NESTED)
def test_a_call_is_the_subprogram_written_out(calls, nested):
    program = parse_program(program_text(calls, nested))
    wanted = parse_program(expanded_text(calls, nested)).moves
    for name in ("motion", "start", "end", "arc_sweep", "feed"):
        np.testing.assert_array_equal(getattr(program.moves, name), getattr(wanted, name))
    called = {number for number, _ in calls}
    unused = any(number not in called | {nested[n] for n in called if n in nested} for number in BODIES)
    if nested != {1000: 3000, 3000: 42}:
        assert any("not part of the program" in warning for warning in map(str, program.warnings)) == unused


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("nested", [{}, {1000: 3000, 3000: 42}])
def test_linuxcnc_calls_alike(nested, tmp_path):
    path = tmp_path / "calls.ngc"
    path.write_text(program_text([(1000, 2), (2000, 1), (3000, 3), (42, 1)], nested))
    canon = rs274.run(path, tmp_path)
    assert not canon.error
    assert_same_path(read_program(path), canon)


def test_repeats_before_the_number():
    """Fanuc: the digits before the last four are the repeats; lines are those of the subprogram."""
    moves = parse_program("G91 G1 F100 X1\nM98 P0031000\nM30\nO1000\nY1\nM99").moves
    assert moves.line.tolist() == [1, 5, 5, 5]
    assert moves.end[-1, 1] == pytest.approx(0.003)


def test_a_block_moves_before_it_calls():
    moves = parse_program("G91 G1 F100 X1 M98 P7\nM30\nO7\nY1 M99").moves
    assert moves.line.tolist() == [1, 4]


def test_numbers_of_iso_tape_and_the_end_inside_a_subprogram():
    program = parse_program(":1\nG1 F100 X1\nM98 P2\nX9\nM30\n:2\nX2\nM30\nM99")
    assert program.moves.end[-1, 0] == pytest.approx(0.002)


def test_m99_outside_any_subprogram_is_one_run_and_said():
    program = parse_program("G1 F100 X1\nX2\nM99\n")
    assert len(program.moves) == 2
    assert any("line 3: M99" in warning and "read once" in warning for warning in map(str, program.warnings))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("M98 P5\nM30", 1, "no such subprogram"),
        ("M98 P5\nM30\n%\nO5\nS1\nM99", 1, "no such subprogram"),
        ("M98\nM30", 1, "without P"),
        ("M98 P5.5\nM30", 1, "whole number"),
        ("M98 P5 L0\nM30", 1, "whole number"),
        ("M98 P5 L10000\nM30\nO5\nS1\nM99", 1, "10000 repeats"),
        ("M98 P5\nM30\nO5\nS1\nM98 P5\nM99", 5, "more than 10 subprograms"),
        ("M98 P5\nM30\nO5\nM98 P6\nM99\nO6\nM98 P5\nM99", 7, "more than 10 subprograms"),
        ("O1\nM98 P1\nM30", 2, "more than 10 subprograms"),
        ("M98 P5\nM30\nO5\nS1", 4, "has no end"),
        ("M98 P5\nM30\nO5\nS1\nO6\nM99", 5, "has no end"),
        ("M98 P5\nM30\nO5\nS1\nM99\nO5\nM99", 6, "in line 3 already"),
        ("M98 P21000\nM30\nO1000\nM99\nO21000\nM99", 1, "the file has both"),
        ("M98 P5\nM30\nO5\nS1\nM99 P100", 5, "no block has"),
        ("G4 M98 P5\nM30\nO5\nS1\nM99", 1, "P"),
        ("O1\nG1 F100 X1\nO2\nS2\nM30", 3, "begins another program"),
        (
            "M98 P1\nM30\n" + "".join(f"O{n}\nM98 P{n + 1}\nM99\n" for n in range(1, 12)) + "O12\nS1\nM99",
            31,
            "more than 10",
        ),
    ],
)
def test_refusals(text, line, words):
    with pytest.raises(InputError, match=words) as caught:
        parse_program(text, "part.nc")
    assert caught.value.line == line


def test_repeats_of_repeats_end(monkeypatch):
    monkeypatch.setattr("toolpath_stiff.nc.program_run.MOST_BLOCKS", 1000)
    with pytest.raises(InputError, match="more than 1,000 blocks"):
        parse_program("M98 P1 L9999\nM30\nO1\nM98 P2 L9999\nM99\nO2\nS1\nM99")
