"""Variables, expressions and flow: against LinuxCNC's interpreter, and Fanuc's own worked programs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.hunt import OTHER, hunt_one
from benchmarks.hunt_programs import Parametric
from tests.nc import rs274
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, dialect_named
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request

LINUXCNC, FANUC = Controller(dialect_named("linuxcnc")), Controller(dialect_named("fanuc"))


def ends(text, controller=UNKNOWN_CONTROL, **options):
    """Ends of the moves, mm."""
    return (parse_program(text, controller=controller, **options).moves.end[:, :3] * 1e3).round(6)


def last_x(expression, controller=LINUXCNC, before=""):
    """What an expression comes to."""
    moves = parse_program(
        f"G21 G90 F100.\nG0 Z9.\n{before}\n#100={expression}\nG1 X#100 Z1.\n", controller=controller
    ).moves
    return float(moves.end[-1, 0] * 1e3)


def refusal(text, controller=UNKNOWN_CONTROL, **options):
    with pytest.raises(InputError) as caught:
        parse_program(text, "part.nc", controller=controller, **options)
    return caught.value


# -- against LinuxCNC's interpreter ------------------------------------------------------------------------------------


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("seed", range(12))
def test_never_another_path_than_linuxcnc(seed, tmp_path):
    """More of them: `python -m benchmarks.hunt`."""
    outcome = hunt_one(Parametric(seed).program(), tmp_path)
    assert outcome is None or outcome.verdict != OTHER, outcome


CONTINUED = "#1=0\no2 do\n#1=[#1+1]\no2 continue\no2 while [#1 LT 2]\n"
BROKEN = "#1=0\no2 while [1]\n#1=[#1+1]\no2 break\no2 endwhile\n"
REPEAT, WHILE = "o3 repeat [2]\nG91 G1 X1\no3 endrepeat\n", "o6 while [#1 LT 9]\n#1=[#1+1]\nG1 X#1\no6 endwhile\n"
DO, BREAK = (
    "o4 do\nG1 X#1\n#1=[#1+1]\no4 while [#1 LT 5]\n",
    "o3 while [#1 LT 9]\n#1=[#1+1]\nG1 X#1\no3 break\no3 endwhile\n",
)


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize(
    ("text", "moves", "line"),
    [
        (CONTINUED + REPEAT, 4, 7),  # and not 2
        (CONTINUED + BREAK, 2, 10),  # and not 1
        (BROKEN + DO, 1, 10),  # and not 4
        (CONTINUED + WHILE, 7, None),
        (CONTINUED + WHILE + REPEAT, 9, None),
        (BROKEN + REPEAT, 2, None),
        (BROKEN + DO.replace("5", "1") + DO.replace("o4", "o5"), 4, None),
    ],
)
def test_marks_of_break_and_continue_that_linuxcnc_keeps(text, moves, line, tmp_path):
    """It runs a repeat again after the `continue` of a do, and a do but once after the `break` of a while."""
    file = tmp_path / "part.ngc"
    file.write_text(f"G21 F100\n{text}M2\n")
    theirs = rs274.run(file, tmp_path).moves
    assert len(theirs) == moves
    if line is None:
        assert np.allclose(ends(file.read_text(), LINUXCNC), [end[:3] for _, _, end, _ in theirs])
    else:
        error = refusal(file.read_text(), LINUXCNC)
        assert error.line == line and "LinuxCNC's interpreter would" in error.found


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        # Printed by rs274 2.9.0 as the X of a move.
        ("[2**3**2]", 64), ("[-2**2]", 4), ("[FIX[-2.5]]", -3), ("[FUP[-2.5]]", -2), ("[ROUND[-2.5]]", -3),
        ("[1 OR 0 AND 0]", 0), ("[7 AND 2]", 1), ("[2 + 3 GT 4]", 1), ("[1 LT 2 AND 3 GT 2]", 1),
        ("ATAN[1]/[-1]", 135), ("[5 MOD -3]", 2), ("[-5 MOD 3]", 1), ("[-5 MOD -3]", 1), ("[5 EQ 5.00009]", 1),
        ("[5 EQ 5.0002]", 0), ("[5 GE 5.0000001]", 0), ("[ASIN[-.5] MOD 30]", 0), ("[EXISTS[#<no>]]", 0),
    ],
)  # fmt: skip
def test_expressions_as_linuxcnc_works_them_out(expression, expected):
    assert last_x(expression) == pytest.approx(expected, abs=1e-9)


def test_assignments_take_effect_after_the_block():
    """rs274: `G1 X#3 #3=4 Y#3` moves to 8, 8 where #3 was 8; then #3 is 4."""
    assert ends("G21 F100\n#3=8\nG1 X#3 #3=4 Y#3\nX#3\n", LINUXCNC).tolist() == [[8, 8, 0], [4, 8, 0]]


def test_subprograms_recursion_and_what_they_return():
    text = """G21 F100 G1
o<f> sub
o1 if [#1 GT 0]
X#1
o<f> call [#1-1]
Y#1
o1 endif
o<f> endsub [#1*2]
o<f> call [3]
Z#<_value>
M2
"""
    assert ends(text).tolist() == [[3, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0], [1, 3, 0], [1, 3, 6]]


def test_lines_of_a_loop_are_those_of_the_program():
    program = parse_program("G21 F100 G1\no1 repeat [2]\nX[#5420+1]\no1 endrepeat\nY1\n")
    assert program.moves.line.tolist() == [3, 3, 5]


# -- Macro B: the worked programs of Fanuc's operator's manuals, "Custom macro" ----------------------------------------

TOTAL_BY_GOTO = """O9500
#1=0
#2=1
N1 IF[#2 GT 10]GOTO 2
#1=#1+#2
#2=#2+1
GOTO 1
N2 G1 X#1 F100.
M30
"""
TOTAL_BY_WHILE = """O0001
#1=0
#2=1
WHILE[#2 LE 10]DO 1
#1=#1+#2
#2=#2+1
END 1
G1 X#1 F100.
M30
"""


@pytest.mark.parametrize("text", [TOTAL_BY_GOTO, TOTAL_BY_WHILE])
@pytest.mark.parametrize("controller", [UNKNOWN_CONTROL, FANUC])
def test_the_total_of_1_to_10(text, controller):
    """Sample programs of "Conditional branch (IF statement)" and "Repetition (WHILE statement)": 55."""
    assert ends(text, controller).tolist() == [[55, 0, 0]]


DRILL = """O0001
G90 G92 X0 Y0 Z50.0
G00 G90 X100.0 Y50.0
G66 P9110 Z-20.0 R5.0 F500.
G90 X20.0 Y20.0
X50.0
Y50.0
X70.0 Y80.0
G67
X0.
M30
O9110
#1=#4001 (STORES G00/G01)
#3=#4003 (STORES G90/G91)
#4=#4109 (STORES THE CUTTING FEEDRATE)
#5=#5003 (STORES Z COORDINATE AT THE START OF DRILLING)
G00 G90 Z#18
G01 Z#26 F#9
IF[#4010 EQ 98]GOTO 1
G00 Z#18
GOTO 2
N1 G00 Z#5
N2 G#1 G#3 F#4
M99
"""


def test_drilling_by_a_modal_call():
    """Sample program of "Modal call (G66)": a cycle like G81 at four places, back to the height of the start (G98)."""
    moves = parse_program(DRILL, controller=FANUC).moves
    holes = moves.end[moves.motion == FEED, :3] * 1e3
    offset = holes[0] - (20.0, 20.0, -20.0)
    assert np.allclose(holes - offset, [(20, 20, -20), (50, 20, -20), (50, 50, -20), (70, 80, -20)])
    after = moves.end[np.flatnonzero(moves.motion == FEED) + 1, 2] * 1e3
    assert np.allclose(after - offset[2], 50.0)


BOLT_HOLES = """O0002
G90 G00 X0 Y0 Z100.0
G65 P9100 X100.0 Y50.0 R30.0 Z-50.0 F500. I100.0 A0 B45.0 H5
M30
O9100
#3=#4003
IF[#3 EQ 90]GOTO 1
#24=#5001+#24
#25=#5002+#25
N1 WHILE[#11 GT 0]DO 1
#5=#24+#4*COS[#1]
#6=#25+#4*SIN[#1]
G90 G81 X#5 Y#6 Z#26 R#18 F#9
#1=#1+#2
#11=#11-1
END 1
G#3 G80
M99
"""


def test_bolt_holes_on_a_circle():
    """Sample program of "Simple call (G65)", but for its `G81 ... K0` ahead of the loop, here within it."""
    moves = parse_program(BOLT_HOLES, controller=FANUC).moves
    bottoms = np.unique((moves.end[np.isclose(moves.end[:, 2], -0.05), :2] * 1e3).round(6), axis=0)
    angles = np.radians([0, 45, 90, 135, 180])
    expected = np.column_stack([100 + 100 * np.cos(angles), 50 + 100 * np.sin(angles)])
    assert np.allclose(np.sort(bottoms, axis=0), np.sort(expected, axis=0))


@pytest.mark.parametrize(
    ("expression", "expected"),
    [("5+2*3", 11), ("[1+2]*3", 9), ("6 AND 3", 2), ("4 OR 1", 5), ("7 XOR 2", 5), ("FIX[-1.2]", -1), ("FUP[-1.2]", -2),
     ("ROUND[2.5]", 3), ("ATAN[-1]/[0]", 270), ("ATAN[1,1]", 45), ("POW[2,3]", 8), ("SQRT[16]", 4), ("ABS[-3.5]", 3.5)],
)  # fmt: skip
def test_arithmetic_of_macro_b(expression, expected):
    """Fanuc, "Arithmetic and logic operation": FIX and FUP by magnitude, angles of 0 to 360 degrees, bits."""
    assert last_x(expression, FANUC) == pytest.approx(expected)


def test_empty_variables():
    """Fanuc, "Variables": an address with an empty variable is ignored; empty is 0 in sums, and not 0 to EQ."""
    text = "G1 F100. X1. Y2.\n#2=0\nX#1 Y5.\nX[#1+3.]\nIF[#1 EQ #0]THEN #5=7.\nIF[#2 EQ #0]THEN #5=8.\nX#5\n"
    assert ends(text, FANUC).tolist() == [[1, 2, 0], [1, 5, 0], [3, 5, 0], [7, 5, 0]]


def test_arguments_with_repeated_letters():
    """Argument specification II: A, B, C are #1 to #3, the triples I, J, K follow."""
    text = "G65 P10 A1. I2. J3. I4. K5.\nM30\nO10\nG1 F100. X#1 Y#4 Z#5\nX#7 Y#9\nM99\n"
    assert ends(text, FANUC).tolist() == [[1, 2, 3], [4, 5, 3]]


def test_return_to_a_block_of_the_caller():
    text = "G21 F100 G1\n#1=1\nM98 P10\nX9\nN20 Y1\nM30\nO10\nX#1\nM99 P20\n"
    assert ends(text).tolist() == [[1, 0, 0], [1, 1, 0]]


# -- where controls differ, and what cannot be -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "controller", "line", "says"),
    [
        ("G1 F9 X#1\n", UNKNOWN_CONTROL, 1, "0 on LinuxCNC and empty"),
        ("G1 F9 X[1 AND 1]\n", UNKNOWN_CONTROL, 1, "no operator of either family"),
        ("G1 F9 X[FIX[-1.5]]\n", UNKNOWN_CONTROL, 1, "controls differ in FIX"),
        ("#33=1\nG1 F9 X#33\n", UNKNOWN_CONTROL, 1, "#33 cannot be set here"),
        ("IF[1 EQ 1]GOTO1\no1 if [1]\no1 endif\nN1 G1 X1 F9\n", UNKNOWN_CONTROL, 2, "is of LinuxCNC's language"),
        ("G1 F9 X" + "#" * 1900 + "1", LINUXCNC, 1, "characters without comments"),
        ("G1 F9 X[" + "1+" * 3000 + "1]", LINUXCNC, 1, "characters without comments"),
        ("#[10**300]=1\n", LINUXCNC, 1, "#1e+300"),
        ("#1=1 T1.5 M6\n", LINUXCNC, 1, "'T1.5' cannot be read"),
        ("T[1.5] M6\n", LINUXCNC, 1, "T[1.5] is T1.5"),
        ("G1 F9 X1\nG2 X10 I[10**15]\n", LINUXCNC, 2, "beyond any number"),
        ("#1=1\nO" + "1" * 500, FANUC, 2, "501 characters without comments"),
        ("GOTO 7\nWHILE[1 EQ 0]DO1\nN7 X5.\nEND1\n", FANUC, 1, "a jump into the loop that begins in line 2"),
        ("N0 G1 F9. X1.\nGOTO 1.5\n", FANUC, 2, "N1.5, which no block has"),
        ("G1 F9. X#500\n", FANUC, 1, "which keep those from #500 on"),
        ("G1 F9. X#3001\n", FANUC, 1, "#3001 is a parameter of the control"),
        ("G1 F9. X[ROUND[1.5]]\n", FANUC, 1, "least increment"),
        ("G65 P1 A1\nO1\nM99\n", FANUC, 1, "no decimal point"),
        ("#3000=1 (NO TOOL)\n", FANUC, 1, "alarm 1"),
        ("G1 F9 X#5161\n", LINUXCNC, 1, "#5161 is a parameter of the control"),
        ("G1 F9 X#<nothing>\n", LINUXCNC, 1, "#<nothing> is read before it is set"),
        ("G65 P1\n", LINUXCNC, 1, "not a code of the dialect linuxcnc"),
        ("G1 F9 X[1/0]\n", LINUXCNC, 1, "division by zero"),
        ("G1 F9 X[SQRT[-1]]\n", LINUXCNC, 1, "SQRT cannot be worked out"),
        ("G1 F9 X[TAN[90]]\n", LINUXCNC, 1, "the angle is 90 degrees"),
        ("G1 F9\nX[1\n", LINUXCNC, 2, "a bracket that is not closed"),
        ("G1 F9 X[1+]\n", LINUXCNC, 1, "is not a value"),
        ("#1=\n", LINUXCNC, 1, "an assignment without a value"),
        ("o1 if [1]\nG1 X1 F9\n", LINUXCNC, 1, "has no end"),
        ("o1 endwhile\n", LINUXCNC, 1, "does not belong to what is open"),
        ("o1 if [1]\no1 endif\no1 if [1]\no1 endif\n", LINUXCNC, 3, "label that is there already"),
        ("o<a> call\n", LINUXCNC, 1, "no such sub"),
        ("o<a> sub\no<a> call\no<a> endsub\no<a> call\n", LINUXCNC, 2, "within each other"),
        ("GOTO 5\n", FANUC, 1, "N5, which no block has"),
        ("WHILE[1 EQ 1]DO1\nEND2\n", FANUC, 1, "WHILE DO1 (line 1) has no end"),
        ("G1 F9\nEND2\n", FANUC, 2, "END2 does not belong"),
        ("o1 repeat [2]\no1 break\no1 endrepeat\n", LINUXCNC, 2, "o1 break does not belong"),
    ],
)  # fmt: skip
def test_refused_with_line_and_reason(text, controller, line, says):
    error = refusal(text, controller)
    assert error.line == line and says in error.found, error


@pytest.mark.parametrize("leave", ["break", "continue"])
@pytest.mark.parametrize("loop", ["while [1]", "do"])
def test_check_goes_on_behind_a_loop_without_its_end(loop, leave):
    text = f"F100\nG0 X0\no10 {loop}\no10 {leave}\nG1 X1\nM2"
    findings = check(Request(tuple(text.splitlines()), "p.nc", controller=LINUXCNC)).findings
    assert [(f.line, "has no end" in f.text) for f in findings if f.severity == "error"] == [(3, True), (4, True)]


@pytest.mark.parametrize(
    ("text", "controller", "line"),
    [
        ("o1 while [1]\no1 endwhile\n", LINUXCNC, 2),
        ("F9\no1 while [1]\nG1 X1\nX0\no1 endwhile\n", LINUXCNC, 5),
        ("F9\nN10 G1 X1\nX0\nGOTO 10\n", FANUC, 4),
        ("#1=0\nWHILE[#1 LT 3]DO1\n#2=#1+1\nEND1\n", FANUC, 4),
    ],
)
def test_a_loop_in_which_nothing_changes_is_refused_at_once(text, controller, line, monkeypatch):
    monkeypatch.setattr("toolpath_stiff.nc.program_run.MOST_BLOCKS", 200)
    error = refusal(text, controller)
    assert "never ends" in error.found and error.line == line


def test_a_loop_without_an_end_is_stopped(monkeypatch):
    monkeypatch.setattr("toolpath_stiff.nc.program_run.MOST_IDLE", 500)
    error = refusal("#1=0\no1 while [1]\n#1=[#1+1]\no1 endwhile\n", LINUXCNC)
    assert "never ends" in error.found and error.line == 4
    monkeypatch.setattr("toolpath_stiff.nc.program_run.MOST_BLOCKS", 900)
    error = refusal("F9\n#1=0\no1 while [1]\nG1 X#1\n#1=[#1+1]\no1 endwhile\n", LINUXCNC)
    assert "900 blocks" in error.found


@pytest.mark.parametrize("nest", ["[", "#", "#[", "-[", "ABS[", "1+"])
def test_a_block_as_long_as_linuxcnc_reads_is_worked_out(nest):
    """No text within the length of a block reaches Python's own limit of calls within calls."""
    times = 245 // (len(nest) + nest.count("["))
    text = f"G1F9X{nest * times}1{']' * times * nest.count('[')}"
    if nest != "1+":
        parse_program(f"F9\n#1=1\n{text}\nG1 X9\n", controller=LINUXCNC)
    else:
        refusal(text, LINUXCNC)


def test_loops_that_read_the_position_end():
    text = "F9\nG91\no1 while [#5420 lt 40]\nG1 X1\no1 endwhile\no2 repeat [300]\nX1\nX-1\no2 endrepeat\n"
    assert len(parse_program(text, controller=LINUXCNC).moves) == 40 + 600


def test_a_variable_that_no_block_sets_is_an_assumption():
    program = parse_program("G1 F9 X1 Y#50\nX2\n", controller=LINUXCNC)
    assert any("#50" in sentence and "0" in sentence for sentence in program.assumptions)


# -- files of subprograms ----------------------------------------------------------------------------------------------


def test_subprograms_of_a_folder(tmp_path):
    (tmp_path / "slot.ngc").write_text("o<slot> sub\nG1 X#1\nX[1/#2]\no<slot> endsub\n")
    text = "G21 F100\no<slot> call [5] [4]\nY2\n"
    program = parse_program(text, controller=replace(LINUXCNC, subprograms=str(tmp_path)))
    assert (program.moves.end[:, :3] * 1e3).round(6).tolist() == [[5, 0, 0], [0.25, 0, 0], [0.25, 2, 0]]
    assert program.moves.line.tolist() == [2, 2, 3], "moves of the file are of the line that calls it"
    error = refusal("G21 F100\no<slot> call [5] [0]\n", replace(LINUXCNC, subprograms=str(tmp_path)))
    assert (error.file, error.line) == ("slot.ngc", 3)


def test_check_names_the_line_of_a_subprogram_s_file(tmp_path):
    (tmp_path / "slot.ngc").write_text("o<slot> sub\nG1 X[1/#1]\nG77\no<slot> endsub\n")
    control = replace(LINUXCNC, subprograms=str(tmp_path))
    checked = check(Request(("G21 F100", "o<slot> call [0]", "G1 X2"), "part.ngc", controller=control))
    errors = [finding for finding in checked.findings if finding.severity == "error"]
    assert [error.line for error in errors] == [2, 3] and len(checked.program.moves) == 1


def test_a_computed_number_never_counts_increments():
    """Fanuc: a value has a decimal point; X[5] is 5 mm where X5 is 0.005 mm, a large one too."""
    assert ends("G1 F100. X[5]\nX[90000]\n#1=5\nX#1\nX5\n", FANUC)[:, 0].tolist() == [5, 90000, 5, 0.005]


@pytest.mark.parametrize("name", ["../slot", "/etc/slot", "a/b"])
def test_no_file_outside_of_the_folder(name, tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "slot.ngc").write_text("o<slot> sub\no<slot> endsub\n")
    error = refusal(f"o<{name}> call\nG1 X1 F9\n", replace(LINUXCNC, subprograms=str(tmp_path / "in")))
    assert "has no such sub" in error.found


def test_without_a_folder_the_message_says_how_to_name_one():
    assert "--subprograms FOLDER" in refusal("o<slot> call\n", LINUXCNC).expected


# -- checks, properties ------------------------------------------------------------------------------------------------


def test_check_counts_what_runs_and_goes_on_after_an_error():
    checked = check(
        Request(("G21 F100", "o1 repeat [3]", "G91 G1 X1", "o1 endrepeat", "G1 X[1/0]", "G1 Y1"), "part.ngc")
    )
    assert {code.code: code.count for code in checked.used}["G1"] == 4
    assert [(f.line, f.severity) for f in checked.findings if f.severity == "error"] == [(5, "error")]
    assert not checked.complete and len(checked.program.moves) == 4


@settings(max_examples=30)
@given(st.integers(-99, 99), st.integers(-99, 99), st.sampled_from(["+", "-", "*"]))
def test_sums_and_products_agree_in_both_families(one, other, operator):
    expected = {"+": one + other, "-": one - other, "*": one * other}[operator]
    for controller in (LINUXCNC, FANUC, UNKNOWN_CONTROL):
        assert last_x(f"[{one}{operator}{other}]", controller) == pytest.approx(expected, rel=1e-12)


@given(st.floats(0.5, 89.5))
def test_angles_come_back(angle):
    assert last_x(f"ATAN[SIN[{angle:.3f}]]/[COS[{angle:.3f}]]") == pytest.approx(round(angle, 3), abs=1e-9)
    assert math.isclose(last_x(f"[TAN[{angle:.3f}]-SIN[{angle:.3f}]/COS[{angle:.3f}]]"), 0.0, abs_tol=1e-8)


@given(st.text("#[]<>=+-*/OoXYZGMNIF1 2.3DWE", max_size=25))
def test_any_text_is_read_or_refused(text):
    try:
        parse_program(f"G21 F100\nG1 X1\n{text}\nG1 X2\n", controller=LINUXCNC)
    except InputError as error:
        assert error.found


def test_rapids_of_a_macro_are_rapids():
    moves = parse_program("G65 P10 X5.\nM30\nO10\nG0 X#24\nG1 X1. F9.\nM99\n", controller=FANUC).moves
    assert moves.motion.tolist() == [RAPID, FEED]


def test_a_loop_that_counts_in_a_work_offset_ends():
    text = "G21 G90 F100\nG10 L2 P1 X0.\nWHILE[#5221 LT 3.] DO1\nG10 L2 P1 X[#5221+1.]\nEND1\nG1 X2.\nM30\n"
    program = parse_program(text, "p.nc", controller=Controller(dialect_named("fanuc")))
    assert program.moves.start[0, 0] == pytest.approx(-3e-3)  # three passes


@pytest.mark.parametrize("value", ["[[0-8]**0.5]", "[0**[0-1]]", "[10**400]", "POW[-8,0.5]"])
def test_a_power_that_is_no_real_number_is_refused_with_its_place(value: str) -> None:
    """`python -m benchmarks.hunt --seed 770000` met one: Python's own power of such numbers is complex."""
    with pytest.raises(InputError, match=r"program:2:.* cannot be worked out"):
        parse_program(f"G21 G90 F100\n#1={value}\nG1 X#1\nM2\n")
