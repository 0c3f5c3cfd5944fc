"""Operations of a program: where they begin, what they are called, on texts as CAM posts write them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nc import rs274
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.operations import MOST_OPERATIONS, Operations, headings, operations, plain_name
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry

needs_rs274 = pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")


def found(text: str, **options: object) -> Operations:
    return operations(parse_program(text, "part.nc", **options))  # type: ignore[arg-type]


def names(text: str, **options: object) -> list[str]:
    return [row.name for row in found(text, **options).rows]


# What the posts write, shortened from published programs; SolidCAM's from memory.
FUSION = """%
(1001)
(BRACKET - SETUP 1)
(T1 D=6. CR=0. - ZMIN=-3. - FLAT END MILL)
(T4 D=10. CR=0. - ZMIN=-3. - FLAT END MILL)
N10 G90 G94 G17
N15 G21
(When using Fusion for Personal Use, the feedrate of rapid)
(moves is reduced to match the feedrate of cutting moves,)
(which can increase machining time.)
N20 G53 G0 Z0.

(2D CONTOUR2)
N25 M9
N30 T1 M6
(6 MM CARBIDE)
S10000 M3
G0 X35 Y-1
G1 Z5 F1000
G1 X0

(2D CONTOUR3)
G1 Z5
X20
Z15

(POCKET1)
M5
T4 M6
S5000 M3
G0 X1
G1 Z-1
M30
%
"""
FREECAD = """(Exported by FreeCAD)
(Post Processor: linuxcnc_post)
(Output Time:2019-08-18 19:02:12.259952)
(begin preamble)
G17 G90
G21
(begin operation: Fixture)
(Path: Fixture)
G54
G0 Z25
(finish operation: Fixture)
(begin operation: TC: end mill 1.4)
(Path: TC: end mill 1.4)
(begin toolchange)
M5
M6 T7
M3 S10000
(finish operation: TC: end mill 1.4)
(begin operation: Drilling)
(Path: Drilling)
(Begin Drilling)
G0 Z6
G99 G81 X1 Y1 Z-2 R1 F100
G80
(finish operation: Drilling)
(begin operation: Profile)
(Path: Profile)
G1 X5 F300
(finish operation: Profile)
(begin postamble)
M5
M2
"""
SOLIDCAM = """%
O1000 (TEST)
( MCV-OP ) (28-OCT-2019)
(SUBROUTINES: O2 .. O0)
G90 G17
G80 G40
M6 T1
(TOOL -1- MILL DIA 10.0 R0. MM )
G90 G00 G40 G54
X1. Y1. Z50. S1000 M3
(------------------)
(F-CONTOUR - PROFILE)
(------------------)
G1 Z-1. F100.
X20.
G0 Z50.
(------------------)
(P-POCKET - T1)
(------------------)
G1 X5. F100.
M30
%
"""
MASTERCAM = """%
O1000
(PROGRAM NAME - HELLOWORLD)
(DATE=DD-MM-YY - 30-06-05 TIME=HH:MM - 19:37)
N10G21
N20G0G17G40G49G80G90
( 1/16 FLAT ENDMILL TOOL - 1 DIA. OFF. - 1 LEN. - 1 DIA. - .0625)
(CONTOUR)
N60T1M6
N70G0G90X0.Y1.A0.S5000M3
N90Z.25
N100G1Z-.005F2.
N120G0Z.5
( TOOL - 6 2"  FACE MILL    DIA. OFF. - 6  LEN. - 6  DIA. - 2. )
( MACHINE GROUP-1 )
T6 M6
G0 X5.
G1 Z-1.
M30
%
"""
VECTRIC = """( sign )
( File created: Monday )
(Toolpaths used in this file:)
(Pocket 1)
(Profile 2)
(Tools used in this file: )
(1 = End Mill {6 mm})
N100G00G21G17G90G40
N110G80
N120T1M06
N130 (End Mill {6 mm})
N140S18000M03
N150(Toolpath:- Pocket 1)
N160()
N170G94
N180G00X0.000Y0.000F1000.0
N190G1Z-2.000F500.0
N200G1X10.000F1000.0
N210G00Z20
N220(| Toolpath:- 'Profile 2'    )
N230G1X0.000
M30
"""
ESTLCAM = """( Zero is the XY centre )
(Project sign)
G90
M03 S12000
(No. 1: Hole 1)
G00 X1 Y1
G01 Z-1 F100
(No. 2: Part 3)
G00 Z5
G00 X5
G01 Z-1
M30
"""
GCODETOOLS = """(Header)
G21 (All units in mm)
(Start cutting path id: path1-4)
(Change tool to Default tool)
G00 Z5
G00 X24 Y2
G01 Z-1 F100 (Penetrate)
G01 X3
G00 Z5
(End cutting path id: path1-4)
(Start cutting path id: path9)
G00 X0
G01 Z-1
G00 Z5
(End cutting path id: path9)
M2
"""
CAMBAM = """( Made using CamBam )
( craftsman 2/4/2014 9:29:48 PM )
( T1 : 0.3 )
G21 G90 G64 P0.25 G40
G0 Z5.0
( T1 : 0.3 )
T1 M6
( Engrave1 )
M3 S20000
G0 X16.4 Y16.9
G1 F700.0 Z-0.5
G0 Z5
( Engrave2 )
G1 Z-0.5
"""
FIVE_AXIS = """(!!! Touch Off: Table = -13.25 == Z max neg extent !!!)
(BOAT-XYZAC)
( 11/20/2011 19:50:48 )

( OPERATION=  ROUGH7  Z LEVEL  SRF_MILL1  )
( TOOL: T1 = 10.0 dia. ENDMILL )
G00 G17 G40 G90 G94
Z5
T1 M6
G54 X-49.65 Y-23.015 A0. C0. S630 M03
G01 Z4. F500
G00 Z5.0

( FINISH1 FLOWLINE SRF_MILL1 )
G00 Z5.
G54 X-34.78 Y-2.436 A-5.546 C-25.602 S600
G01 Z3.573
G00 Z5.0
(A0.)
A-75.0 C33.636
G01 Z-3.879 F43.6112
"""
JSCUT = """G21
G1 Z2.54 F254
;
; Operation:    0
; Name:         pocket
; Type:         Pocket
;
; Retract
G1 Z25.4 F254
; Rapid to initial position
G1 X10 Y8 F2540
; plunge
G1 Z-3 F127
; cut
G1 X20 F1016
; Retract
G1 Z25.4 F254
;
; Operation:    1
; Type:         Inside
;
; Rapid to initial position
G1 X30 Y8 F2540
; plunge
G1 Z-3 F127
; Path 1
G1 X40 F1016
M2
"""
MARLIN = """(Fusion CAM 2.0.18961)
( Posts processor: MPCNC21.cps)
( *** START begin ***)
G21 G90
( *** START end ***)
( *** SECTION begin ***)
(   X Min: 11.35 - X Max: 145.87)
( boxDoorDrill - Milling - Tool: 1 -  drill)
( COMMAND_START_SPINDLE)
M3 S5000
G0 Z3
( MOVEMENT_CUTTING)
G1 Z-3 F1000
( MOVEMENT_LEAD_OUT)
G1 Z-2
( MOVEMENT_CUTTING)
G1 X5
M30
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (FUSION, ["2D CONTOUR2", "2D CONTOUR3", "POCKET1"]),
        (FREECAD, ["Drilling", "Profile"]),
        (SOLIDCAM, ["F-CONTOUR - PROFILE", "P-POCKET - T1"]),
        (MASTERCAM, ["CONTOUR", 'T6 2" FACE MILL']),
        (VECTRIC, ["Pocket 1", "Profile 2"]),
        (ESTLCAM, ["No. 1: Hole 1", "No. 2: Part 3"]),
        (GCODETOOLS, ["path1-4", "path9"]),
        (CAMBAM, ["Engrave1", "Engrave2"]),
        (FIVE_AXIS, ["ROUGH7 Z LEVEL SRF_MILL1", "FINISH1 FLOWLINE SRF_MILL1"]),
        (JSCUT, ["part.nc", "pocket", "Inside"]),
        (MARLIN, ["boxDoorDrill - Milling - Tool: 1 - drill"]),
    ],
    ids=[
        "fusion",
        "freecad",
        "solidcam",
        "mastercam",
        "vectric",
        "estlcam",
        "gcodetools",
        "cambam",
        "five axes",
        "jscut",
        "marlin",
    ],
)
def test_programs_as_posts_write_them(text: str, expected: list[str]) -> None:
    assert names(text) == expected


def test_where_operations_begin_and_end() -> None:
    got = found(FUSION)
    lines = FUSION.split("\n")
    assert [lines[row.first_line - 1] for row in got.rows[1:]] == ["(2D CONTOUR3)", "(POCKET1)"]
    assert [row.tool for row in got.rows] == [1, 1, 4]
    assert [lines[row.last_line - 1] for row in got.rows] == ["G1 X0", "Z15", "G1 Z-1"]
    assert [row.number for row in got.rows] == [1, 2, 3]


def test_a_retract_belongs_to_what_it_leaves_and_an_approach_to_what_it_goes_to() -> None:
    program = parse_program("G0 X1\nG1 X2 F100\nG0 Z5\n(B)\nG0 X9\nG1 X8\nG0 Z9\n(C)\nG0 X0\nM30\n")
    got = operations(program)
    assert [program.source[line - 1] for line in program.moves.line[got.of_move == 0]] == [
        "G0 X1",
        "G1 X2 F100",
        "G0 Z5",
    ]
    assert [row.name for row in got.rows][1:] == ["B"]  # nothing is cut after C: its rapid stays with B
    assert program.moves.line[got.of_move == 1].tolist() == [5, 6, 7, 9]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X1 F100\nX2\n", ["part.nc"]),
        ("(BRACKET)\n(JOE)\nG1 X1 F100\nX2\n", ["BRACKET"]),
        ("O12 (BRACKET)\nT3 M6\nG1 X1 F100\nX2\n", ["BRACKET"]),
        ("T3 M6\nG1 X1 F100\n", ["part.nc"]),
        ("(PLATE)\nG1 X1 F100\n(WALL)\nX2\n", ["PLATE", "WALL"]),
        ("(BRACKET)\nT3 M6\nG1 X1 F100\nT4 M6\nG1 X2\n", ["T3", "T4"]),
        ("T3 M6 (ROUGHER)\nG1 X1 F100\nT4 M6 ; finisher\nG1 X2\n", ["T3 ROUGHER", "T4 finisher"]),
        ("T3 M6\nG1 X1 F100\n(T4 D=6. BALL)\nT4 M6\nG1 X2\n", ["T3", "T4 D=6. BALL"]),
        ("T3 M6\nG1 X1 F100\nT3 M6\nG1 X2\n", ["part.nc"]),
        ("T3 M6 G0 X1 (A)\nG1 X2 F100\nT4 M6 G1 X9 (B)\n", ["T3 A", "T4 B"]),
        ("G1 X1 F100\nX2 (finish)\nX3 ; wall\n", ["part.nc"]),
        ("G1 X1 F100\n(MSG, NOW THE WALL)\nX3\n", ["part.nc", "NOW THE WALL"]),
        ("G1 X1 F100\n(debug,wall)\nX3\n", ["part.nc", "wall"]),
        ("G1 X1 F100\n; OPERATION 2: POCKET\nX3\n", ["part.nc", "OPERATION 2: POCKET"]),
        ("G1 X1 F100\n; Operation: POCKET\nX3\n", ["part.nc", "POCKET"]),
        ("G1 X1 F100\nN200 (WALL)\nX3\n", ["part.nc", "WALL"]),
        ("G1 X1 F100\n(=====)\n(* WALL *)\n(=====)\nX3\n", ["part.nc", "WALL"]),
        ("G1 X1 F100\n(17)\nX3\n", ["part.nc"]),
        ("G1 X1 F100\n;Operation: 0\n;Name:\nX3\n", ["part.nc", "Operation: 0"]),
        ("(Tool = 3)\n(Toolpath name      = Boring_2)\nG0 X3\n(Cutting Move Starts)\nG1 X1 F100\n", ["Boring_2"]),
        ("G1 X1 F100\n(row 1 done)\nX3\n", ["part.nc"]),
        ("G1 X1 F100\n(M5 T2)\nX3\n", ["part.nc"]),
        ("G1 X1 F100\n;G04 P1 ; dwell\nX3\n", ["part.nc"]),
        ("G1 X1 F100\n(A)\n(B)\n\n(C)\nX3\n", ["part.nc", "A"]),
        ("G1 X1 F100\nM5\n(WALL)\nM30\n", ["part.nc"]),
    ],
)
def test_names(text: str, expected: list[str]) -> None:
    assert names(text) == expected


def test_a_tool_without_comment_has_its_remark_from_the_tool_table() -> None:
    tools = {3: ToolEntry(3, remark="face mill"), 4: ToolEntry(4)}
    assert names("T3 M6\nG1 X1 F100\nT4 M6\nG1 X2\n", controller=Controller(tools=tools)) == ["T3 face mill", "T4"]


def test_marks_take_the_place_of_comments() -> None:
    program = replace(parse_program("G1 X1 F100\n(NO)\nX2\nX3\n", "part.nc"), marks=((1, "ROUGH"), (3, "WALL")))
    assert [(row.name, row.first_line, row.last_line) for row in operations(program).rows] == [
        ("ROUGH", 1, 1),
        ("WALL", 3, 4),
    ]


SUBPROGRAM = """O1 (PLATE)
G90 G94
(ROUGH)
G0 X0
M98 P1000 L3
(FINISH)
G0 X5
M98 P1000
G0 X9
(REST)
G1 X9.5
M30
O1000 (CONTOUR)
(FROM THE LEFT)
G91
G1 X1 F100
X-2
G90
M99
"""


def test_a_subprogram_belongs_to_the_operation_that_calls_it() -> None:
    got = found(SUBPROGRAM)
    assert [row.name for row in got.rows] == ["ROUGH", "FINISH", "REST"]
    assert np.bincount(got.of_move).tolist() == [6, 1 + 2 + 1, 1]


def test_a_list_of_calls_has_the_subprograms_for_operations() -> None:
    text = "O1\nM98 P10\nM98 P20\nM98 P10\nM30\nO10\n(BORE)\nG1 X1 F100\nX0\nM99\nO20\n(WALL)\nG1 Y1 F100\nY0\nM99\n"
    assert names(text) == ["BORE", "WALL", "BORE"]


def test_comments_between_calls_of_one_line_name_its_runs() -> None:
    text = "O1\nG91\n(LEFT)\nM98 P10\n(RIGHT)\nM98 P10 L2\nM98 P10\nM30\nO10\nG1 X1 F100\nM99\n"
    got = found(text)
    assert [row.name for row in got.rows] == ["LEFT", "RIGHT"]
    assert got.of_move.tolist() == [0, 1, 1, 1]
    local = "G91\n(LEFT)\nM97 P100\n(RIGHT)\nM97 P100\nM30\nN100 G1 X1. F100.\nM99\n"
    assert names(local, controller=Controller(dialect=DIALECTS["haas"])) == ["LEFT", "RIGHT"]


@needs_rs274
def test_the_second_interpreter_gives_the_same_operations() -> None:
    for text in (FREECAD, SUBPROGRAM.replace("O1 (PLATE)\n", ""), ESTLCAM):
        assert found(text, interpreter="linuxcnc").rows == found(text).rows


@needs_rs274
def test_a_loop_passes_its_comments_again_without_a_new_operation() -> None:
    text = "(HEAD)\nG21\n(LAYERS)\n#1=0\no1 while [#1 lt 3]\n(LAYER)\nG1 X1 F100\nX#1\n#1=[#1+1]\n"
    text += "o1 endwhile\n(WALL)\nG1 Y1\nM2\n"
    assert names(text, interpreter="linuxcnc") == ["LAYERS", "WALL"]


def test_comments_between_all_moves_name_no_operations() -> None:
    count = MOST_OPERATIONS + 5
    text = "T1 M6\nG1 F100\n" + "".join(f"(MOVE {i})\nX{i + 1}\n" for i in range(count)) + "T2 M6\n(WALL)\nY1\n"
    assert names(text) == ["T1", "T2"]


LINES = st.lists(
    st.sampled_from(
        [
            "G0 X1",
            "G0 X2 Z5",
            "G1 X3 F100",
            "G1 X4 F50",
            "G1 X5 F70",
            "T1 M6",
            "T2 M6",
            "(ROUGH)",
            "(WALL)",
            "; x",
            "",
            "M8",
            "(END OF OP)",
        ]
    ),
    min_size=1,
    max_size=25,
)


@settings(deadline=None, max_examples=150)
@given(LINES, st.data())
def test_comments_beside_words_change_no_operation(lines: list[str], data: st.DataObject) -> None:
    lines = [*lines, "G1 X99 F100"]
    beside = [
        f"{line} {data.draw(st.sampled_from(['(finish)', '; finish', '']))}"
        if line[:1] in "GXM" and line and data.draw(st.booleans())
        else line
        for line in lines
    ]
    plain, commented = found("\n".join(lines)), found("\n".join(beside))
    assert plain.rows == commented.rows
    assert plain.of_move.tolist() == commented.of_move.tolist()


@settings(deadline=None, max_examples=150)
@given(LINES)
def test_operations_are_stretches_that_cut_and_hold_one_tool(lines: list[str]) -> None:
    program = parse_program("\n".join([*lines, "G1 X99 F100"]))
    got, moves = operations(program), program.moves
    assert (np.diff(got.of_move) >= 0).all()
    assert sorted(set(got.of_move.tolist())) == list(range(len(got.rows)))
    for i, row in enumerate(got.rows):
        mine = moves.take(got.of_move == i)
        cuts = mine.motion != 0
        assert cuts.any()
        assert set(mine.tool[cuts].tolist()) == {row.tool}
        assert row.first_line <= mine.line.min()
        assert row.last_line == mine.line.max()
        assert row.name


@pytest.mark.parametrize(
    ("comment", "name"),
    [
        ("--- POCKET ---", "POCKET"),
        ("*** ROUGH ***", "ROUGH"),
        ("-X SIDE", "-X SIDE"),
        ("R.5 CHAMFER, 2.", "R.5 CHAMFER, 2."),
        ("| Toolpath:- 'Profile 2'    ", "Toolpath:- 'Profile 2"),
        ("=====", ""),
        ("MSG, - WALL -", "WALL"),
        ("A ---- B", "A ---- B"),
    ],
)
def test_frames_around_names(comment: str, name: str) -> None:
    assert plain_name(comment) == name


@pytest.mark.parametrize(
    "line",
    [
        "(" + "-" * 3000 + "X" + "-" * 3000 + "Y)",
        "(" + "X1111 " * 500 + "POCKET)",
        " " * 20000 + "O" + " " * 20000 + "(A)",
        "(" * 5000,
        ";" + "A1 " * 3000 + "!",
        "N" + "1" * 5000 + "(",
        "M" + "0" * 5000 + "X",
    ],
)
def test_no_line_takes_forever(line: str) -> None:
    headings([line] * 3)
    program = replace(parse_program("G1 X1 F100\nX2\n"), source=(line, "", line))
    assert len(operations(program).rows) >= 1


@given(st.lists(st.text(alphabet="(); NOMGTX019-*\t:.%/#<>[]äß", max_size=12), max_size=8))
def test_any_text_is_looked_through(lines: list[str]) -> None:
    for heading in headings(lines):
        assert heading.name
        assert 1 <= heading.line <= len(lines)


ITEM = st.sampled_from(["cut", "cut", "rapid", "head", "blank"])
CALL = st.sampled_from(["call 20", "twice 20"])
ITEMS = st.lists(ITEM, max_size=5)


@settings(deadline=None, max_examples=100)
@given(
    st.lists(ITEM | CALL | st.sampled_from(["call 10", "twice 10"]), max_size=12),
    st.lists(ITEM | CALL, max_size=5),
    ITEMS,
)
def test_operations_of_calls_are_those_of_the_run(main: list[str], ten: list[str], twenty: list[str]) -> None:
    """A run line by line, which notes the headings that it passes, finds the same operations."""
    lines = ["O1", "G21 G94 F100", "G91"]
    where: dict[str, tuple[int, list[str]]] = {}
    programs = {"1": ["cut", *main, "cut"], "10": ten, "20": twenty}
    for name, items in programs.items():
        lines += [] if name == "1" else [f"O{name}"]
        where[name] = (len(lines) + 1, items)
        for item in items:
            plain = {"cut": "G1 X1", "rapid": "G0 X1", "head": f"(HEAD {len(lines)})", "blank": ""}
            call = f"M98 P{item.split()[-1]}" + (" L2" if item.startswith("twice") else "")
            lines.append(plain.get(item, call))
        lines.append("M30" if name == "1" else "M99")
    program = parse_program("\n".join(lines), "part.nc")

    expected: list[tuple[str, int]] = [("part.nc", 0)]  # name, moves
    current: set[int] = set()
    passed: list[int] = []
    waiting = early = 0  # rapids before and after the first heading since the last cut

    def run(name: str) -> None:
        nonlocal current, passed, waiting, early
        first, items = where[name]
        for number, item in enumerate(items, first):
            if item == "head":
                passed.append(number)
            elif item == "rapid":
                fresh = [head for head in passed if head not in current]
                waiting, early = (waiting + 1, early) if fresh else (waiting, early + 1)
            elif item == "cut":
                fresh = [head for head in passed if head not in current]
                expected[-1] = (expected[-1][0], expected[-1][1] + early)
                if fresh and expected[0][1]:
                    expected.append((lines[fresh[0] - 1].strip("()"), 0))
                    current = set(passed)
                expected[-1] = (expected[-1][0], expected[-1][1] + waiting + 1)
                passed, waiting, early = [], 0, 0
            elif item != "blank":
                for _ in range(2 if item.startswith("twice") else 1):
                    run(item.split()[-1])

    run("1")
    expected[-1] = (expected[-1][0], expected[-1][1] + waiting + early)
    got = operations(program)
    assert list(zip([row.name for row in got.rows], np.bincount(got.of_move).tolist(), strict=True)) == expected
