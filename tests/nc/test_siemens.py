"""Siemens' language: small programs whose paths are known from geometry; refusals; the table of words.

Paths (`siemens_paths.txt`) are written as those of `test_heidenhain`.
"""

import math
import random
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks import heidenhain
from tests.nc.siemens_reader import random_program
from tests.nc.test_heidenhain import check_path
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.kinematics import PostedKinematics, RotaryAxis
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.siemens.vocabulary import REFUSED, TABLE
from toolpath_stiff.nc.tables import Offsets, ToolEntry, WorkOffset
from toolpath_stiff.rewriting.program import rewrite_program

TOOLS = Controller(
    DIALECTS["siemens"],
    tools={1: ToolEntry(1, diameter=10.0, remark="MILL 10"), 2: ToolEntry(2, length=50.0, diameter=4.0)},
)
PATHS = {  # name -> program, path
    name: (body, path)
    for name, body, path in re.findall(
        r"^== (.*)\n((?:.*\n)*?)=> ((?:.*\n?)*?)(?=\n== |\Z)",
        (Path(__file__).parent / "siemens_paths.txt").read_text(),
        re.MULTILINE,
    )
}


def read(body: str, controller: Controller = TOOLS):
    return parse_program(body, "t.mpf", controller=controller)


@pytest.mark.parametrize("name", PATHS)
def test_paths_known_from_geometry(name):
    program = read(PATHS[name][0])
    check_path(program, PATHS[name][1])


def test_there_are_forty_of_them():
    assert len(PATHS) >= 40


@pytest.mark.parametrize("first", range(0, 100, 25))
def test_random_programs_are_read_as_the_independent_reader_reads_them(first):
    texts = [random_program(seed) for seed in range(first, first + 25)]
    assert [text for text in texts if heidenhain.difference(text, "siemens")] == []


def test_a_reading_that_errs_is_found_out():
    text = next(
        text for text in map(random_program, range(99)) if "G2 " in text and "CR=" in text and "CR=-" not in text
    )
    moves = [points.round(6).tolist() for _, points, _ in heidenhain.seen(read(text).moves)]
    for right, wrong in (("G2 ", "G3 "), ("CR=", "CR=1+"), ("G90 G0", "G0 G90")):
        again = [points.round(6).tolist() for _, points, _ in heidenhain.seen(read(text.replace(right, wrong)).moves)]
        assert (again == moves) == (right == "G90 G0")


REFUSALS = {
    "SLOT1(5,0,1,-23,,4,30,15,40,45,20,45,90,100,320,6,2,0.5,0)": "cycle whose path the manual draws without numbers",
    "T9 D1\nPOCKET3(50,0,1,-5,40,20,5,0,0,0,2,0,0,99,99,0,11)": "POCKET3 needs the radius of tool 9.*--tools",
    "T1 D0\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11)": "POCKET4 with a tool of no radius",
    "T1 D1\nPOCKET4(50,0,1)": "POCKET4 without VARI",
    "T1 D1\nPOCKET4(50,0,1,5,20,0,0,2,0,0,99,99,0,11)": "RTP, RFP, SDIS, DP and FALD cross",
    "T1 D1\nPOCKET4(50,0,1,-5,4,0,0,2,0,0,99,99,0,11)": "POCKET4 narrower than the tool",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,4,11)": "CDIR=4 is no milling direction",
    "T1 D1\nPOCKET2(50,0,1,-5,,20,0,0,99,99,2,0,0,1)": "CDIR=0 is no milling direction",
    "T1 D1\nPOCKET2(50,0,1,-5,,20,0,0,99,99,2,2,0,0,0,0,500)": "SSF=500 changes the speed",
    "T1 D1\nPOCKET2(50,0,1,-5,,20,0,0,99,99,2,2,0,4)": "VARI=4 is no roughing",
    "T1 D1\nPOCKET2(50,0,1,-5,,4,0,0,99,99,2,2,0,2)": "POCKET2 narrower than the tool",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,15)": "VARI=15 is no roughing",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,12)": "VARI=12 finishes nothing",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,21)": "plunges without its sizes.*RAD1",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,0,99,0,11)": "cuts without a feed",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11,12)": "MIDA=12 is more than the tool's diameter",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11,0,9)": "AP1=9 is of a pocket",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11,0,,,,,0,,,10100,111)": "DMODE=111 counts PRAD otherwise",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,1EX-6,0,0,99,99,0,11)": "infeeds in too many steps",
    "T1 D1\nPOCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11,1EX-6)": "a pocket in too many rings",
    "CYCLE81(10,0,2,-5,,0,0,2)": "DMODE=2 names another plane",
    "T1 D1\nPOCKET3(50,0,1,-5,-40,20,5,0,0,0,2,0,0,99,99,0,11)": "measured from a corner",
    "T1 D1\nPOCKET3(50,0,1,-5,40,20,5,0,0,0,2,0,0,99,99,0,11,,,,,,,0,,,12100)": "GMODE=12100 measures from a corner",
    "T1 D1\nPOCKET3(50,0,1,-5,40,20,15,0,0,0,2,0,0,99,99,0,11)": "measured from a corner, or of no size",
    "T1 D1\nMCALL POCKET4(50,0,1,-5,20,0,0,2,0,0,99,99,0,11)": "POCKET4 behind MCALL",
    "T1 D1\nCYCLE71(10,0,1,-1,0,0,20,16,0,0,8,1,0,500,61)": "VARI=61 names no direction of the rows",
    "T1 D1\nCYCLE61(10,0,1,-1,5,5,29,-11,0,80,0,500,21,1,1,11010)": "LIM=1 limits the face",
    'T1 D1\nCYCLE72("NOWHERE",10,0,1,-3,0,0,0,300,100,1,41,2,4,300,1,3)': "NOWHERE is no word.*--subprograms",
    'T1 D1\nCYCLE72("A:B",10,0,1,-3,0,0,0,300,100,1,41,2,4,300,1,3)': "no such label",
    'T1 D1\nAB: X1 Y2\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,300,100,1,41,2,4,300,1,3)': "CYCLE72 along no contour",
    'T1 D1\nAB: X1\nX5 Y3\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,9,9,1,41,2,4,300,1,3)': "say where it begins",
    'T1 D1\nAB: X1 Y2\nX5 Z1\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,9,9,1,41,2,4,300,1,3)': "leaves its plane",
    'T1 D1\nAB: X1 Y2\nX5\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,9,9,1,41,12,4,300,1,3)': "AS1=12 is no lead",
    'T1 D1\nAB: X1 Y2\nX5\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,9,9,1,43,1,4,300,1,3)': "RL=43 is no side",
    'T1 D1\nAB: X1 Y2\nIF TRUE\nENDIF\nBC:\nCYCLE72("AB:BC",10,0,1,-3,0,0,0,9,9,1,41,1,4,9,1,3)': "jumps, loops",
    "MCALL CYCLE81(10,0,2,-5)\nCYCLE801(0,0,0,9,9,2,2,1)": "CYCLE801 of a frame",
    "$P_UIFR[1]=CSCALE(X,2)": "more than a shift: CSCALE",
    "$P_UIFR[1]=CTRANS(X,2):CROT(Z,9)": "more than a shift: CROT",
    "$P_UIFR[1,X,FI]=2": "no shift of an axis",
    "G1 X2\n$P_UIFR[1]=CTRANS(X,2)": "writes the offset in force",
    "$P_UIFR[R1]=CTRANS(X,2)": "without its number",
    "$P_UIFR[0]=CTRANS(X,2)": "no settable offset",
    "G1 X1 DISC=50": "DISC is corners between an arc",
    "UP1\nM30\n%_N_UP1_SPF\nPROC UP1 SAVE\nTRANS X5\nM17": "SAVE brings back frames",
    "Y1\nG96 S100": "G96 is a code of lathes",
    "G94 G97 X1": "act alike",
    "CYCLE95(1)": "a code of lathes",
    "BSPLINE X1": "spline of coefficients",
    "G58 X10": "an offset axis by axis.*TRANS",
    "G331 Z-5 K1": "tapping without a cycle.*CYCLE84",
    "G247 X1": "smooth approach",
    "WHEN TRUE DO M8": "synchronised action",
    "TRACYL(40)": "transformation of the machine",
    "G77 X1": "not a G code that is known",
    "X1 X2": "repeats a word",
    "G0 G1 X1": "act alike",
    "X=IC(1,2)": "no value, or several",
    "X200000": "beyond 100 m",
    "X=R7": "R7 is read before it is set",
    "LENGTH=5": "no variable that is declared",
    "X=1/0": "cannot be worked out",
    "X=(1+2": "bracket that is not closed",
    "X=" + "(" * 99: "too many brackets",
    "X=" + "-" * 400 + "1": "a sign after a sign",
    "X=FOO(1)": "no function that is known",
    'X="A"': "is no number",
    "IF 1==1 AND 2==2\nENDIF": "binds tighter than comparisons",
    "IF TRUE\nX5": "has no end",
    "ENDIF": "does not belong",
    "GOTOF NOWHERE": "no such label",
    "GOTOB LATER\nLATER:": "no such label",
    "LOOP\nENDLOOP": "never ends",
    "R1=1\nBACK: R1=1\nGOTOB BACK": "never ends",
    "DRILL_ALL(1)": "no subprogram of the file.*--subprograms",
    "DEF FRAME F": "DEF FRAME is not supported",
    "G2 X10": "an arc without a centre",
    "G2 X10 Y0 CR=2": "whose radius 2 mm cannot reach its end 10.0000 mm away",
    "G2 X10 Y0 I5 CR=5": "a centre are both given",
    "G2 X10 I4": "off its circle",
    "CIP X10 I1=5": "points of CIP on a line",
    "CT X10": "without a contour element",
    "G1 RP=5 AP=0": "without a pole",
    "G111 X0 Y0\nG91 RP=5 AP=0": "in G91",
    "G18 G1 X5": "a lathe's program: G18 and never Y",
    "LIMS=2000 G96 S200": "a lathe's program: LIMS and never Y",
    "G1 X5 RND=9\nY5": "does not fit",
    "G1 X5 RND=1\nTRANS X5": "stands between a corner",
    "SCALE X2 Y3": "factors that differ",
    "TRANS X5\nG91 X1": "a step right after another frame",
    "T9 D1 M6\nG1 G41 X5": "radius of tool 9.*--tools",
    "G41 G2 X5 CR=5": "an arc as the first move",
    "KONT G41 X1": "under KONT",
    "G2 SUPA X1 I1": "in a cut",
    "G54\nG500\nX1": "in a cut",
    "G54\nTRANS X5\nG500 G0 X1": "a frame under G500",
    "TRAORI\nG1 X1 A5": "turns rotary axes under TRAORI",
    "G1 A3=0 B3=0 C3=1": "without TRAORI",
    'CYCLE800(1,"T",0,192,0,0,0,10,0,0,0,0,0,-1)': "no angles about axes",
    'CYCLE800(1,"T",0,57,0,0,0,10,0,0,0,0,0,-1)\nX1': "tool's place is not known",
    "CYCLE81(10,0,2,5)": "depth is not below",
    'MCALL CYCLE81(10,0,2,-5)\nHOLES1(0,0,0,10,10,3,0,,"1,3",,1)': "HOLES1 with hidden positions",
    "MCALL CYCLE81(10,0,2,-5)\nHOLES2(0,0,10,0,90,4,1010)": "VARI=1010 goes from hole to hole on the circle",
    'CYCLE81("A",0,2,-5)': "CYCLE81 with the text 'A' for RTP",
    "CYCLE84(10,0,2,-5,,,3,,1,,200,200,1)": "AXN=1 is another axis",
    "CYCLE82(10,0,2,-5,,-1)": "DTB=-1 is no time in seconds",
    "CYCLE82(10,0,2,-5,,1,0,0,20)": "AMODE=20 counts dwells in revolutions",
    "CYCLE83(10,0,2,-20,,-5,,2,0,-1,1,1)": "DTS=-1 is no time in seconds",
    "CYCLE83(10,0,2,-20,,-5,,50,,,1,1,,1,1,,0,0,0,2201111)": "DAM=50 shortens the pecks without a least one",
    "CYCLE83(10,0,2,-20,,-5,,-0.5,,,1,1)": "DAM=-0.5 shortens the pecks without a least one",
    "CYCLE83(10,0,2,-20,,5,,,,,1,1,,1,1,,0,0,0,11111)": "FDEP=5 counts from RFP",
    'CYCLE62("A",3,"B","C")': "TYPE=3 calls labels of a subprogram",
    'CYCLE62("A",1)': "no such label",
    'T1 D1\nBB: G1 X0\nCC:\nCYCLE62(,2,"BB","CC")\nCYCLE62(,2,"BB","CC")\nCYCLE72("",9,0,1,-2)': "several CYCLE62",
    "CYCLE81(1,0,2,-5)": "RTP is below",
    "CYCLE84(10,0,2,-5)": "without a pitch",
    "CYCLE81(10,0,2,-5,,0,10)": "from a diameter",
    "HOLES2(0,0,10,0,0,3)": "without a cycle",
    "G4": "needs its time",
    "X1 Q5": "not used by any code",
    "G1 ANG=30": "ANG=30 names no end",
    "G1 X5 Y5 ANG=30": "ANG=30 names no end",
    "G1 X-5 ANG=30": "ANG=30 leads away",
    "G1 X5 ANG=90": "ANG=90 leads away",
    "TRANS Y5\nG1 X5 ANG=30": "ANG=30 right after another frame",
    "RNDM=-1": "RNDM=-1 is the radius of corners",
    "RNDM=2 G1 X9\nG0 Y5": "before a corner",
    "RNDM=2 G1 X9\nRNDM=0\nY5": "between a corner",
    "T1 D1\nG451 NORM\nG1 G41 X5": "G41 under G451",
    "T1 D1\nCUT3DC\nG1 G41 X5": "G41 under CUT3DC",
    "R1=1\nCASE R1 OF 1 GOTOF NO": "no such label",
    "R1=1\nCASE R1 OF 1": "CASE of another form",
    "DEFINE A AS G0": "a macro of another form",
    "$AC_TIMER[1]=0\nR1=$AC_TIMER[1]": "is read before it is set",
    "$TC_DP15[1,1]=1": "no variable that is declared",
    "$AA_OFF[X]=1": "no variable that is declared",
}  # fmt: skip


@pytest.mark.parametrize("body", REFUSALS)
def test_refusals_name_line_and_word(body):
    with pytest.raises(InputError, match=REFUSALS[body]) as caught:
        read(f"G17 F100 G90\n{body}\nG1 X1")
    assert caught.value.line in range(2, 3 + body.count("\n"))


def test_every_word_has_its_source_and_meaning_and_stands_in_a_program():
    assert all(row.meaning and row.source for row in TABLE.values()) and not REFUSED.keys() & TABLE.keys()
    assert all(row.what and row.hint and row.source.startswith("SIEMENS") for row in REFUSED.values())
    bodies = "\n".join(body for body, _ in PATHS.values())
    own = [name for name, row in TABLE.items() if row.controls == ("siemens",) and not row.listed]
    unproved = {name for name in own if not re.search(rf"(?<![A-Z]){name[0]}0*{name[1:]}(?!\d\d)", bodies)}
    siblings = {"G53", "G153", "KONT", "G450", "G451", "NORM", "ASCALE", "AMIRROR", "CSPLINE", "WORKPIECE",
                 "G74", "M17", "$P_UIFR", "CFC", "CUT3DF", "CUT3DFS"}  # fmt: skip
    assert {name for name in unproved if not re.fullmatch(r"G5[0-9]{1,2}", name)} <= siblings


def test_blank_tools_and_what_is_said():
    text = 'WORKPIECE(,"",,"BOX",112,0,-20,-80,-5,0,100,80)\nT="MILL 10" M6\nG54 D1\nT2 M6 D1\nS900 M3 F100 M8\nG0 Z5\n'
    program = read(text + "G1 X10 SPOS=90\nM30\nGROUP_END(0,0)")
    assert program.stock == ((-0.005, 0.0, -0.02), (0.1, 0.08, 0.0)) and program.dialect == "siemens"
    assert [tool.number for tool in program.tools] == [2] and program.moves.tool_length[-1] == 0.05
    assert {"M8", "SPOS=90"} <= {word.word for word in program.unsupported} and not program.warnings
    sized = read('WORKPIECE(,"",,"BOX",0,2,-30,-80,-2,-2,184,170)\nF9\nG1 X1')
    assert np.allclose(sized.stock, ((-0.002, -0.002, -0.028), (0.182, 0.168, 0.002)))


def test_subprograms_in_files_and_skipped_blocks(tmp_path):
    (tmp_path / "Side.spf").write_text("PROC SIDE(REAL A)\nG91 G1 X=A\nIF A<3\nSIDE(A+1)\nENDIF\nG90\nM17\n")
    control = Controller(DIALECTS["siemens"], subprograms=str(tmp_path), switches=frozenset({3}))
    check_path(read("F100\n/3 X99\n/1 Y1\nSIDE(1)\nX0", control), "F 0 1 0; F 1 1 0; F 3 1 0; F 6 1 0; F 0 1 0")
    for name, text in (("EMPTY", ""), ("BARE", "G1 Y2")):  # the main program goes on behind a file that has no end
        (tmp_path / f"{name}.SPF").write_text(text)
    check_path(read("F100\nEMPTY\nG1 X1\nBARE\nX2\nEMPTY\nX3", control), "F 1 0 0; F 1 2 0; F 2 2 0; F 3 2 0")
    with pytest.raises(InputError, match="subprograms within each other") as caught:
        (tmp_path / "AGAIN.SPF").write_text("\nAGAIN\n")
        read("F100\nAGAIN", control)
    assert caught.value.line == 2


@pytest.mark.parametrize("seed", range(60))
def test_mutated_programs_are_read_or_refused(seed):
    chance = random.Random(seed)
    bodies = [body for body, _ in PATHS.values()] + list(REFUSALS)
    text = list("F100\n" + "\n".join(chance.sample(bodies, 3)) + "\nM30\n")
    for _ in range(chance.randrange(1, 9)):
        place = chance.randrange(len(text))
        text[place : place + chance.randrange(2)] = chance.choice('XYZIR+-.0123456789\n GMF=()";,[]')
    checked = check(Request(tuple("".join(text).split("\n")), "t.mpf", controller=TOOLS))
    assert checked.complete or any(finding.severity == "error" for finding in checked.findings)


def test_check_says_the_language_and_why(capsys, tmp_path):
    file = tmp_path / "part.nc"
    file.write_text("G17 G90\nG0 X1\n" * 40 + "MCALL CYCLE81(10,0,2,-5)\nX5 F100\nMCALL\n")
    assert main(["check", str(file)]) == 0
    assert (
        "language: Siemens' own language (Sinumerik) (line 81: 'MCALL CYCLE81(10,0,2,-5)')" in capsys.readouterr().out
    )
    (tmp_path / "part.mpf").write_text("G1 X5 F100\n")
    assert main(["check", str(tmp_path / "part.mpf")]) == 0
    assert "(its ending)" in capsys.readouterr().out
    (tmp_path / "iso.mpf").write_text("G21 G90\nT1 M6 (D 10)\nG81 X5 Z-3 R2 F100\nG80\nM30\n")
    assert main(["check", str(tmp_path / "iso.mpf")]) == 0
    assert "G code (the ISO dialect in spite of its ending: 'G21 G90')" in capsys.readouterr().out


WRITTEN = """%_N_P_MPF
N1 G17 G90 G71 T1 D1 M6
N2 G54 F200 S1000 M3
N3 G0 X10 Y0 Z2 ; start
N4 G1 Z-2
N5 G3 X0 Y10 I-10 J0
N6 G1 X5 RND=1
N7 X=IC(2) Y=IC(-3)
N8 G2 X20 Y20 CR=30
N9 CT X30 Y=AC(35)
N10 G3 X20 Y45 I=AC(20) J=AC(35)
N11 G91 G1 X5 Y=AC(50)
N12 X-3
N13 G90 MCALL CYCLE81(10,0,2,-5)
N14 X60 Y60
N15 MCALL
N16 TRAORI
N17 G1 X70 Y0 A3=0.1 B3=0.2 C3=1
N18 TRAFOOF
N19 SUPA G0 Z100 D0
M30
"""


@pytest.mark.parametrize(
    ("x", "y", "z", "degrees"), [(100, 20, 0, 0), (0, 0, 0, 90), (12.5, -7, 0, 33.3), (5, 5, 0, -150)]
)
def test_a_program_is_written_for_another_placement(x, y, z, degrees):
    program, turn = read(WRITTEN), math.radians(degrees)
    text = rewrite_program(program, (x / 1e3, y / 1e3, z / 1e3, 0.0, 0.0, turn), (0.0,) * 6, control=TOOLS).text
    frame = next(line for line in text.splitlines(keepends=True) if line.startswith("TRANS"))
    frame += "".join(line for line in text.splitlines(keepends=True) if line.startswith("AROT"))
    assert text.replace(frame, "") == WRITTEN
    before, after = (cuts_by_line(moves) for moves in (program.moves, read(text).moves))
    after = {line - frame.count("\n"): row for line, row in after.items()}
    assert before.keys() == after.keys()
    for line, (a, b, c, lean, sweep) in before.items():
        there = (a * math.cos(turn) - b * math.sin(turn) + x, a * math.sin(turn) + b * math.cos(turn) + y, c)
        assert after[line] == pytest.approx((*there, lean, sweep), abs=3e-3), line


def cuts_by_line(moves) -> dict:
    """Where the last cut of each line ends in mm, how far the tool leans there, its sweep."""
    cuts = moves.take(moves.motion > 0)
    lean = np.cos(cuts.end[:, 3]) * np.cos(cuts.end[:, 4])
    rows = zip(cuts.line.tolist(), cuts.end[:, :3] * 1e3, lean, cuts.arc_sweep, strict=True)
    return {line: (*end.tolist(), float(leaning), float(sweep)) for line, end, leaning, sweep in rows}


@pytest.mark.parametrize(
    ("body", "placement", "line"),
    [
        ("TRANS X5\nG1 X1 Y1 F9", (0.1, 0, 0, 0, 0, 0), 2),
        ("G91 G1 X1 F9", (0.1, 0, 0, 0, 0, 0), 1),
        ("G1 X1 Y1 F9", (0, 0, 0, 0.1, 0, 0), 1),
    ],
)
def test_what_cannot_be_written_is_refused_by_line(body, placement, line):
    with pytest.raises(InputError) as caught:
        rewrite_program(read(body), placement, (0.0,) * 6, control=TOOLS)
    assert caught.value.line == line and "--write" in str(caught.value)


def test_settable_offsets_are_those_of_the_controller():
    given = [WorkOffset([10.0 * n, 0, 0, 0, 0, 0], given=True) for n in range(9)]
    offsets = Offsets(given, {5: WorkOffset([70, 0, 0, 0, 0, 0]), 99: WorkOffset([90, 0, 0, 0, 0, 0])})
    program = read("F9\nG54 G1 X1\nG55 X1\nG57 X1\nG505 X1\nG599 X1", Controller(DIALECTS["siemens"], offsets=offsets))
    check_path(program, "F 1 0 0; F 11 0 0; F 31 0 0; F 71 0 0; F 91 0 0")


def test_a_machine_that_it_was_posted_for_turns_as_under_fanuc():
    axes = (
        RotaryAxis("A", "table", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        RotaryAxis("C", "table", (0.0, 0.0, 1.0), (0.0,) * 3),
    )
    machine = PostedKinematics("table-table", axes, tcp=False)
    body = "G90 G54 F100\n{}\nG0 X0 Y0 Z9\nG1 X5 Y3 Z1 A20\nY8 A-30 C40\n{}\nG0 Z50\n"
    ours = read(body.format("TRAORI", "TRAFOOF"), Controller(DIALECTS["siemens"], kinematics=machine)).moves
    fanuc = Controller(tools={1: ToolEntry(1, 0.0)}, kinematics=machine)
    theirs = parse_program(body.format("G43.4 H1", "G49"), "t.nc", controller=fanuc).moves
    assert ours.motion.tolist() == theirs.motion.tolist() and np.allclose(ours.end, theirs.end)
