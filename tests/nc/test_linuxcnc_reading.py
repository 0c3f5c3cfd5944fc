"""Programs through LinuxCNC's interpreter: the built-in reader's path where it has one, and the lines of the file."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import TABLE_OURS, Writer, cycle_program
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.linuxcnc import runner
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.nc.reader import parse_program, read, read_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import Offsets, ToolEntry, WorkOffset, read_tool_table

needs_rs274 = pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
FOLDER = Path(__file__).parent.parent.parent / "programs"
TOOLS = FOLDER / "tools.tbl"
TOLERANCE_M = 1e-5  # 0.01 mm, as the issue asks; four decimals of an inch, some times over, are within
TOO_SHORT = 3e-5  # moves that vanish in the printed digits


def linuxcnc(text: str, **options):
    return parse_program(text, "part.nc", interpreter="linuxcnc", **options)


def real_moves(moves: Moves) -> Moves:
    return moves.take((np.abs(moves.end - moves.start).max(axis=1) > TOO_SHORT) | (moves.arc_sweep != 0.0))


def assert_same(first: Moves, second: Moves) -> None:
    one, two = real_moves(first), real_moves(second)
    np.testing.assert_array_equal(one.line, two.line)
    np.testing.assert_array_equal(one.motion, two.motion)
    np.testing.assert_array_equal(one.tool, two.tool)
    np.testing.assert_array_equal(one.from_machine[:, 1], two.from_machine[:, 1])
    for name in ("start", "end", "tool_length"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=0, atol=TOLERANCE_M, err_msg=name)
    np.testing.assert_allclose(one.feed, two.feed, rtol=1e-3)
    np.testing.assert_allclose(one.spindle, two.spindle)
    np.testing.assert_allclose(one.dwell, two.dwell, atol=1e-4)
    np.testing.assert_allclose(one.arc_normal, two.arc_normal, atol=1e-6)
    # Four decimals of an inch of a small radius are some thousandths of a radian.
    np.testing.assert_allclose(one.arc_sweep, two.arc_sweep, atol=1e-2)


SPINDLE = """G21 G90 F600
S9000 M3
G1 X10
M4 X20
M5
X30
M3
T1 M6
X40
M3 S500 X50
G96 D2500 S250
X60
G97 S100
X70
M30
"""


@needs_rs274
def test_the_spindle_turns_as_the_program_says():
    speeds = np.array([9000, -9000, 0, 0, 500, np.nan, 100]) * np.pi / 30
    for interpreter in ("builtin", "linuxcnc"):
        moves = parse_program(SPINDLE, "part.nc", interpreter=interpreter).moves
        np.testing.assert_allclose(moves.spindle, speeds)


@needs_rs274
@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.nc")), ids=lambda p: p.stem)
def test_the_programs_read_the_same(file):
    ours = read_program(file, tool_table=TOOLS)
    theirs = read_program(file, tool_table=TOOLS, interpreter="linuxcnc")
    assert_same(ours.moves, theirs.moves)
    assert (ours.interpreter, theirs.interpreter) == ("builtin", "linuxcnc")
    assert ours.origin_source == theirs.origin_source
    np.testing.assert_allclose(ours.origin, theirs.origin, rtol=0, atol=TOLERANCE_M)
    # repr, because nan is not nan
    assert list(map(repr, ours.tools)) == list(map(repr, theirs.tools))


@needs_rs274
@pytest.mark.parametrize("seed", range(1000, 1020))
@pytest.mark.parametrize("write", [lambda seed: Writer(seed).program(), cycle_program], ids=["all codes", "cycles"])
def test_random_programs_read_the_same(seed, write, tmp_path):
    table = tmp_path / "ours.tbl"
    table.write_text(TABLE_OURS)
    text, tools = write(seed), read_tool_table(table)
    control = Controller(tools=tools)
    assert_same(parse_program(text, controller=control).moves, linuxcnc(text, controller=control).moves)


@needs_rs274
@pytest.mark.parametrize(
    "after",
    [
        "G0 X4\nG0 Y3 Z3",
        "G53 G0 X3\nG43 H2\nG0 Y5\nG0 Z3",
        "T1 M6\nG0 X4\nG43 H1 Y3 Z3",
        "G28 Z8\nG0 X4\nZ3",
    ],
)
def test_a_length_that_changes_just_before_a_tool_change(after):
    """rs274 forgets at M6 what the change did to Z's number."""
    tools = {number: ToolEntry(number, 25.0 * number, 6.0) for number in (1, 2, 3)}
    text = f"G21 G90 F100\nG0 X1 Z40\nG43 H3\nG1 X2\nG49\nT2 M6\n{after}\nG1 X9\n"
    control = Controller(tools=tools)
    assert_same(parse_program(text, controller=control).moves, linuxcnc(text, controller=control).moves)
    with pytest.raises(InputError, match="the tool length changed between the last move and M6"):
        linuxcnc(text.replace("T2 M6", "T2 M6\nG91 G0 Z5\nG90"), controller=control)


@needs_rs274
def test_variables_loops_and_subprograms():
    """A staircase of three steps from a sub that stands before the main part: positions and lines by hand."""
    program = linuxcnc(
        "O0001 (the part's number)\n"
        "o100 sub (steps of #1 by #2)\n"
        "  N7 G1 X[#<at> + #1] F300 ; N words of the program are not ours\n"
        "  o110 if [#<up> EQ 1]\n"
        "    Z[#5422 + #2] (up)\n"
        "  o110 endif\n"
        "o100 endsub\n"
        "G21 G90\n"
        "#<up> = 1  #<at> = 0\n"
        "o120 repeat [3]\n"
        "  o<s> if [1]\n"
        "  o100 call [10] [5/2]\n"
        "  o<s> endif\n"
        "  #<at> = [#<at> + 10]\n"
        "o120 endrepeat\n"
        "G0 X0\n".replace("#<up>", "#<_up>").replace("#<at>", "#<_at>")
    )
    moves = program.moves
    assert moves.line.tolist() == [3, 5, 3, 5, 3, 5, 16]
    np.testing.assert_allclose(moves.end[:, 0] * 1e3, [10, 10, 20, 20, 30, 30, 0], atol=1e-9)
    np.testing.assert_allclose(moves.end[:, 2] * 1e3, [0, 2.5, 2.5, 5, 5, 7.5, 7.5], atol=1e-9)
    np.testing.assert_allclose(moves.feed[:6] * 6e4, 300)


@needs_rs274
def test_cutter_compensation_goes_beside_the_contour_and_keeps_its_lines():
    """Round a square of 20 mm on the outside with a tool of 6 mm: sides 3 mm off, quarter circles at the corners."""
    text = "G21 G90 G17 F100\nT3 M6\nG0 X-20 Y-10\nG41 D3 G1 X0 Y0\nY20\nX20\nY0\nX0\nG40 G1 X-20 Y-10\nM2\n"
    moves = linuxcnc(text, controller=Controller(tools={3: ToolEntry(3, 50.0, 6.0)})).moves
    arcs = moves.arc_sweep != 0.0
    np.testing.assert_allclose(moves.arc_sweep[arcs][-3:], -math.pi / 2, atol=1e-4)
    np.testing.assert_allclose(moves.arc_center[arcs][-3:] * 1e3, [[0, 20, 0], [20, 20, 0], [20, 0, 0]], atol=1e-3)
    assert moves.line[arcs][-3:].tolist() == [6, 7, 8]
    sides = {int(line): moves.end[i] * 1e3 for i, line in enumerate(moves.line) if not arcs[i]}
    np.testing.assert_allclose(sides[5][:2], [-3, 20], atol=1e-3)
    np.testing.assert_allclose(sides[6][:2], [20, 23], atol=1e-3)
    np.testing.assert_allclose(sides[7][:2], [23, 0], atol=1e-3)
    np.testing.assert_allclose(sides[9][:2], [-20, -10], atol=1e-3)


@needs_rs274
def test_tables_are_in_mm_whatever_the_unit_of_the_program():
    """rs274 takes the lengths of its tables as inches."""
    offsets = Offsets()
    offsets.table[1] = WorkOffset([100.0, 20.0, 5.0, 0.0, 0.0, 10.0], 90.0, given=True)
    offsets.home_g30 = [7.0, 8.0, 9.0, 0.0, 0.0, 0.0]
    text = "{} G90 F10\nT1 M6\nG43 H1\nG0 X0 Y0 Z0\nG49\nG55 G1 X0 Y0 Z0 C0\nG54\nG30\n"
    for unit in ("G20", "G21"):
        control = Controller(offsets=offsets, tools={1: ToolEntry(1, 76.2, 6.0)})
        moves = linuxcnc(text.format(unit), controller=control).moves
        assert moves.tool_length[0] == pytest.approx(0.0762, abs=1e-8)
        np.testing.assert_allclose(moves.start[0, :3] * 1e3, [0, 0, -76.2], atol=1e-3)
        np.testing.assert_allclose(moves.end[-2, :3] * 1e3, [100, 20, 5], atol=3e-3)
        assert np.rad2deg(moves.end[-2, 5]) == pytest.approx(10.0, abs=1e-3)
        np.testing.assert_allclose(moves.end[-1, :3] * 1e3, [7, 8, 9], atol=3e-3)


@needs_rs274
@pytest.mark.parametrize("text", ["G55 G1 X1 Y2 F100\nG54 X3\n", "G54 G91 G1 X1 F100\nG90 G1 X5\nG1 Y2\nG55 X0\n"])
def test_work_offsets_that_are_turned(text):
    offsets = Offsets()
    offsets.table[0] = WorkOffset([30.0, 0.0, 0.0, 0.0, 0.0, 0.0], 25.0, given=True)
    offsets.table[1] = WorkOffset([100.0, 20.0, 5.0, 0.0, 0.0, 0.0], -60.0, given=True)
    control = Controller(offsets=offsets)
    assert_same(parse_program(text, controller=control).moves, linuxcnc(text, controller=control).moves)


@needs_rs274
@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("G53 G0 X10 Z50\nG1 X1 Y1 Z0 F100\nG28\n", {}),
        ("G53 G0 X10 Z50\nG1 X1 Y1 Z0 F100\nG28 Z5\n", {"default_origin": (0.1, 0.2, 0.9, 0.0, 0.0, 0.0)}),
        ("G0 X1\nG53 G0 X10 Z50\nG55 G1 X1 Y1 Z0 F100\n", {"origin": (0.1, 0.2, 0.9, 0.0, 0.0, 0.0)}),
        ("G10 L2 P1 X5 Z3\nG53 G0 X10\nG1 X1 Y1 Z0 F100\n", {}),
        ("G10 L2 P1 X0\nG1 X1 F100\nG10 L2 P1 X50\nG1 X1\n", {}),
        ("G55 G10 L2 P1 X7\nG1 X1 F100\n", {}),
    ],
)
def test_machine_coordinates_and_where_g54_sits(text, options):
    ours, theirs = parse_program(text, **options), linuxcnc(text, **options)
    assert_same(ours.moves, theirs.moves)
    assert ours.origin_source == theirs.origin_source
    np.testing.assert_allclose(ours.origin, theirs.origin, rtol=0, atol=TOLERANCE_M)


@needs_rs274
def test_machine_coordinates_of_turned_work_are_refused():
    text = "G1 X1 F100\nG53 G0 X10\n"
    with pytest.raises(InputError, match="machine coordinates") as error:
        linuxcnc(text, origin=(0.0, 0.0, 0.5, 0.0, 0.0, 0.3))
    assert error.value.line == 2


@needs_rs274
def test_feeds_of_every_kind():
    """By hand: per minute, per revolution, inverse time, a rotary axis alone, threading, rigid tapping."""
    moves = linuxcnc(
        "G21 G90 F600\nG1 X10\nG95 F0.2 S300 M3\nG1 X20\nG93\nG1 X40 F3\nG94 F600\nG1 A30\n"
        "G33 Z-5 K0.5\nG33.1 Z-10 K0.5\n"
    ).moves
    np.testing.assert_allclose(moves.feed[[0, 1, 2, 4]] * 6e4, [600, 60, 60, 150], rtol=1e-4)
    assert np.rad2deg(moves.feed[3]) * 60 == pytest.approx(600, rel=1e-4)
    assert moves.line.tolist()[-2:] == [10, 10]  # down and back
    np.testing.assert_allclose(moves.end[-2:, 2] * 1e3, [-10, -5], atol=1e-4)


@needs_rs274
@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("G1 X1 F100\nG1 Y[1/0]\n", 2, "divide by zero"),
        ("G1 X1 F100\n\n\nG77 X2\n", 4, "g code"),
        ("G1 X1 F100\nG1 X#<nothing>\n", 2, "not defined"),
        ("G1 X1 F100\nG5.2 X0 Y1 P1 L3\nX2 Y2 P1\nX2 Y0 P1\nX0 Y0 P2\nG5.3\n", 6, "spline"),
        ("G1 X1 F100\nG38.2 Z-5\n", 2, "probing"),
        ("G1 X1 F100\nT4 M6\nG43\nG1 X2\n", 3, "tool table"),
        ("G1 X1 F100\nT4 M6\nG41 G1 X20\nG1 X40\nG1 Y40\n", 3, "diameter"),
        ("G1 X1 F100\nG43.1 Z50\nG20 G1 X1\n", 3, "unit"),
        ("G1 X1 F100\nG10 L2 P1 R30\nG1 X2\n", 2, "X and Y"),
        ("G1 X1 F100\no100 if [0]\nG1 X2\n", None, "missing"),
        ("G1 X1 F100\nG1 X2 é\n", 2, "outside a comment"),
        ("G1 X1 F100\n(abort, no good)\nG1 X5\n", 2, "stopped by the program"),
        ("G1 X1 F100\nG1 X" + "+".join(["[1"] * 99) + "]" * 99 + "\n", 2, "characters"),
        ("T1 M6\nT2\nM61 Q2\nG43\nG1 X1 F10\n", 3, "M61"),
        ("G1 X1 F100\nG1 X2 U3\n", 2, "character"),
    ],
)
def test_refusals_name_their_line(text, line, what):
    tools = {1: ToolEntry(1, 50.0, 6.0), 2: ToolEntry(2, 60.0, 6.0)}
    with pytest.raises(InputError, match=what) as error:
        linuxcnc(text, controller=Controller(tools=tools))
    assert (error.value.file, error.value.line) == ("part.nc", line)


@needs_rs274
@pytest.mark.parametrize(("words", "tool"), [("G43", 4), ("G43 H7", 7), ("H007 G43", 7)])
def test_both_readers_give_the_same_tool_table_to_copy(words, tool):
    for interpreter in ("linuxcnc", "builtin"):
        with pytest.raises(InputError) as error:
            parse_program(f"G1 X1 F100\nT4 M6\n{words}\nG1 X2\n", interpreter=interpreter)
        assert error.value.hint.endswith(f":\ntool,length_mm\n{tool},LENGTH")


@needs_rs274
def test_block_delete_percent_and_what_follows_the_end():
    text = "%\nG1 X1 F100\n/ X2\n/3 X3\n%\nX4\n"
    np.testing.assert_allclose(linuxcnc(text).moves.end[:, 0] * 1e3, [1, 2, 3])
    np.testing.assert_allclose(linuxcnc(text, controller=Controller(switches=ALL_SWITCHES)).moves.end[:, 0] * 1e3, [1])


def test_where_it_is_missing_the_message_says_how_to_get_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="apt install linuxcnc-uspace"):
        linuxcnc("G1 X1 F100\n")
    program = tmp_path / "part.nc"
    program.write_text("G1 X1 F100\nG7\n")
    assert main(["path", str(program), "--interpreter", "auto"]) == 2
    message = capsys.readouterr().err
    assert "part.nc:2:1" in message and "apt install linuxcnc-uspace" in message
    assert main(["path", str(program), "--interpreter", "linuxcnc", "--rs274", "no/such/rs274"]) == 2
    assert "no/such/rs274" in capsys.readouterr().err


@needs_rs274
def test_auto_takes_the_second_only_where_the_first_refuses(monkeypatch):
    assert parse_program("G1 X1 F100\n", interpreter="auto").interpreter == "builtin"
    program = parse_program("#1 = 5\nG1 X#1 F100\nG7\n", interpreter="auto")
    assert program.interpreter == "linuxcnc"
    assert program.moves.end[0, 0] == pytest.approx(5e-3)
    assert any("rs274" in sentence for sentence in program.assumptions)


@needs_rs274
def test_words_that_change_nothing_are_listed_with_their_place():
    text = "G21 G90 F100 m 0 8\n#1 = 1\n G64 P0.1\nG1 X#1 (M9) M9\n"
    notes = [(note.line, note.column, note.word) for note in linuxcnc(text).unsupported]
    assert notes == [(1, 14, "M08"), (3, 2, "G64"), (4, 13, "M9")]


def test_an_unknown_interpreter_is_an_error():
    with pytest.raises(InputError, match="builtin, linuxcnc, auto"):
        parse_program("G1 X1 F100\n", interpreter="fanuc")


@needs_rs274
def test_the_report_names_who_read_the_program(tmp_path, capsys):
    program = tmp_path / "part.nc"
    program.write_text("G21 G90 F500 G7\nG8\n#1 = 5\no1 repeat [3]\nG1 X#1\n#1 = [#1 + 5]\no1 endrepeat\nG1 Y4\n")
    common = ["analyze", str(program), "--interpreter", "auto", "--no-plots", "--out", str(tmp_path / "out")]
    assert main([*common, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["interpreter"] == "linuxcnc"
    assert main(common) == 0
    assert "LinuxCNC" in capsys.readouterr().out


@needs_rs274
def test_without_bubblewrap_it_is_refused_unless_that_is_wanted(monkeypatch):
    text = "#1 = 5\nG1 X#1 F100\nG2 X15 I5\n"
    confined = linuxcnc(text).moves
    monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    with pytest.raises(
        InputError, match=r"bubblewrap.* is not there or may not work\. Install bubblewrap .*--unconfined"
    ):
        linuxcnc(text)
    assert_same(confined, read(Request(split_lines(text, "p"), "p", interpreter="linuxcnc", unconfined=True)).moves)


@needs_rs274
def test_a_placement_is_found_but_no_program_rewritten(tmp_path, capsys):
    """Blocks with variables cannot be turned; the offset that does the same is told."""
    program, out = tmp_path / "part.nc", tmp_path / "out"
    program.write_text("#1 = 5\nG21 G90 F500\nG1 X#1 Y20\nY0\nX0\n")
    common = ["place", str(program), "--interpreter", "auto", "--points", "2", "--rotate", "0", "--out", str(out)]
    assert main([*common, "--write", str(tmp_path / "placed.nc")]) == 2
    assert "cannot be rewritten" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [program]


@needs_rs274
@pytest.mark.parametrize("block", ["M200 M150", "M99.9", "M[100+50]", "M200 M0150 P1"])
def test_leaving_words_out_opens_no_gap_in_the_fence(block):
    with pytest.raises(InputError, match=r"is not started on such a program|not an M code|M-code greater than 199"):
        parse_program(f"F100\nG1 X1\n{block}\nM2\n", interpreter="linuxcnc")


@needs_rs274
def test_user_codes_are_nothing_with_a_warning():
    program = parse_program("F100\nG1 X1\nM150 P1 Q2\nG1 X2 M101\nM2\n", interpreter="linuxcnc")
    assert [(remark.line, remark.text[:4]) for remark in program.warnings] == [(3, "M150"), (4, "M101")]
    assert (program.moves.end[:, 0] * 1e3).round(6).tolist() == [1, 2]


@needs_rs274
def test_subprograms_of_a_folder_are_read_as_by_the_built_in_reader(tmp_path):
    (tmp_path / "slot.ngc").write_text(
        "(of a file)\no<slot> sub\nG1 X#1 Y#2 F100\nM110 P2\no<deep> call [#1]\no<slot> endsub\nM2\n"
    )
    (tmp_path / "deep.ngc").write_text("o<deep> sub\nG1 Z-[#1] F50\nG2 X0 Y0 R50\nG0 Z5\no<deep> endsub\n")
    text = "%\nG21 G90 G17\nG0 X0 Y0 Z5\no<slot> call [10] [20]\n\no<slot> call [30] [5]\nM111\nG1 X1\nM2\n%\n"
    control = Controller(subprograms=str(tmp_path))
    other, own = (parse_program(text, controller=control, interpreter=name) for name in ("linuxcnc", "builtin"))
    assert other.moves.end == pytest.approx(own.moves.end, abs=1e-8)
    assert other.moves.line.tolist() == [3, 4, 4, 4, 4, 4, 4, 4, 4, 8]  # of the first call
    assert [(w.line, w.text[:4]) for w in other.warnings] == [(7, "M111"), (4, "M110")]
    with pytest.raises(InputError, match=r"O<SLOT> is not in the program.*--subprograms"):
        parse_program(text, interpreter="linuxcnc")
