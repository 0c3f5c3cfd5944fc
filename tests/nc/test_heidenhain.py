"""Heidenhain's plain language: small programs whose paths are known from geometry; refusals; the table of statements.

A path (`heidenhain_paths.txt`) is written as its moves: R rapid, F feed, A arc, C feed of a cycle, with X Y Z in mm; of
an arc behind @ the centre X Y and the angle in degrees (counter-clockwise positive), of a tilted tool behind ^ roll and
pitch; behind = the feed in mm/min, behind & the pause in s.
"""

import math
import random
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks import heidenhain
from docs.from_code import HUNTED
from tests.nc.plain_language import random_program
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.heidenhain import functions
from toolpath_stiff.nc.heidenhain.vocabulary import REFUSED, STATEMENTS
from toolpath_stiff.nc.kinematics import TABLE, PostedKinematics, RotaryAxis
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.rewriting.program import rewrite_program

FOLDER = Path(__file__).parent
TOOLS = Controller(tools={1: ToolEntry(1, diameter=10.0, remark="MILL 10"), 2: ToolEntry(2, length=50.0, diameter=4.0)})
DRILL = "CYCL DEF 200 BOHREN ~\n Q200=2 ;A ~\n Q201=-{depth} ;B ~\n Q206=150 ~\n Q202=5 ~\n Q203=+0 ~\n Q204={far}\n"
BORE = "CYCL DEF 208 B Q200=2 Q201=-6 Q206=100 Q334=4 Q203=0 Q{}={}"
SL = (
    "CYCL DEF 14.1 LABEL 1\nCYCL DEF 20 D Q1=-4 Q2=1 Q3=0 Q4=0 Q5=0 Q6=2 Q7=9 Q8=0 Q9=1\n"
    "CYCL DEF 22 R Q10=2 Q11=50 Q12=300 Q18=0\nM3\nCYCL CALL"
)
SQUARE = "LBL 1\nL X+0 Y+0 RL\nL X+30\nL Y+30\nL X+0\nL X+0 Y+0\nLBL 0"
POCKET = "CYCL DEF {} P Q215=0 Q368=0 Q207=300 Q201=-10 Q202=4 Q369=0 Q206=50 Q200=2 Q203=0 Q204=5 {}"
PATHS = {  # name -> statements, path
    name: (body, path)
    for name, body, path in re.findall(
        r"^== (.*)\n((?:.*\n)*?)=> ((?:.*\n?)*?)(?=\n== |\Z)",
        (FOLDER / "heidenhain_paths.txt").read_text(),
        re.MULTILINE,
    )
}


def read(body: str, unit: str = "MM", controller: Controller = TOOLS):
    return parse_program(
        f"0 BEGIN PGM T {unit}\nTOOL CALL 1 Z S1000 F200\n{body}\nEND PGM T {unit}\n", "t.h", controller=controller
    )


def check_path(program, path: str) -> None:
    moves, expected = program.moves, [part.strip() for part in path.split(";")]
    shown = [f"{'RFAC'[m]} {np.round(e[:3] * 1e3, 6)}" for m, e in zip(moves.motion, moves.end, strict=True)]
    assert len(moves) == len(expected), shown
    for row, text in enumerate(expected):
        parts = re.fullmatch(r"([^@^=&]+)(?:@([^^=&]+))?(?:\^([^=&]+))?(?:=([^&]+))?(?:&(.+))?", text)
        point_of_it, arc, lean, feed, pause = (part or "" for part in parts.groups())
        kind, *point = point_of_it.split()
        assert "RFAC"[moves.motion[row]] == kind, (row, shown)
        assert moves.end[row, :3] * 1e3 == pytest.approx([float(v) for v in point], abs=1e-7), (row, shown)
        assert np.degrees(moves.end[row, 3:5]) == pytest.approx([float(v) for v in lean.split()] or [0, 0], abs=1e-4)
        if arc:
            *center, angle = (float(v) for v in arc.split())
            normal = moves.arc_normal[row]
            plane = [1, 2] if normal[0] else [2, 0] if normal[1] else [0, 1]
            assert moves.arc_center[row, plane] * 1e3 == pytest.approx(center, abs=1e-7), (row, shown)
            assert math.degrees(moves.arc_sweep[row]) * normal.sum() == pytest.approx(angle, abs=1e-6), (row, shown)
        if feed:
            assert moves.feed[row] * 6e4 == pytest.approx(float(feed))
        assert moves.dwell[row] == float(pause or 0)


@pytest.mark.parametrize("name", PATHS)
def test_paths_known_from_geometry(name):
    check_path(read(PATHS[name][0]), PATHS[name][1])


def test_there_are_forty_of_them():
    assert len(PATHS) >= 40


@pytest.mark.parametrize("first", range(0, 100, 25))
def test_random_programs_are_read_as_the_independent_reader_reads_them(first):
    assert [seed for seed in range(first, first + 25) if heidenhain.difference(random_program(seed))] == []


def test_a_reading_that_errs_is_found_out():
    text = random_program(8)
    assert not heidenhain.difference(text)
    for right, wrong in (("DR+", "DR-"), (" FMAX", " F20"), ("+ 0", "+ 0")):
        wronged = text.replace(right, wrong, 1)
        assert (wronged == text) == (moves_of(wronged) == moves_of(text))


def moves_of(text: str) -> list:
    return [
        (kind, points.round(6).tolist()) for kind, points, _ in heidenhain.seen(parse_program(text, "hunt.h").moves)
    ]


@pytest.mark.parametrize("seed", range(30))
def test_the_tool_beside_a_random_contour_touches_it_and_never_cuts_into_it(seed):
    """Distances from the tool's centre to the contour, which the test makes itself."""
    chance, side = random.Random(seed), "RL" if seed % 2 else "RR"
    radius, wide = 5.0, 8 * 2.0 * math.pi
    corners = sorted(chance.uniform(0.0, wide) / 8 for _ in range(7))
    points = [complex(math.cos(t), math.sin(t)) * chance.uniform(60, 90) for t in corners]
    points = [p for p, q in zip(points, points[1:] + points[:1], strict=True) if abs(p - q) > 25]
    if side == "RL":
        points.reverse()  # clockwise with the tool on the left: outside
    away = points[0] * 2.0
    body = f"L X{away.real:+.4f} Y{away.imag:+.4f}\nL X{points[0].real:+.4f} Y{points[0].imag:+.4f} {side}\n"
    body += "".join(
        f"L X{p.real:+.4f} Y{p.imag:+.4f}\n" + ("RND R12\n" if chance.random() < 0.3 else "") for p in points[1:]
    )
    try:
        moves = heidenhain.seen(
            read(body.removesuffix("RND R12\n") + f"L X{away.real:+.4f} Y{away.imag:+.4f} R0").moves
        )
    except InputError as error:
        assert "gouging" in str(error) or "corner" in str(error) or "turns back" in str(error)
        return
    contour = heidenhain.seen(read(body.removesuffix("RND R12\n").replace(f" {side}", "")).moves)[1:]
    lines = [part[1] for part in contour]
    dense = np.concatenate([_densely(a[1][-1], b) for a, b in zip(contour, lines[1:], strict=False)])
    for _, places, _ in moves[2:-1]:
        apart = np.linalg.norm(dense[:, None, :2] - places[None, :, :2], axis=2).min(axis=0)
        assert apart.min() > radius - 1e-3 and apart.max() < radius + 0.02


def _densely(start: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points of a line or of an arc through its start and three of its quarters."""
    middle = points[1]
    (px, py), (qx, qy) = (points[3] - start)[:2], (middle - start)[:2]
    bend = px * qy - py * qx
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    if abs(bend) < 1e-6:
        return start + shares * (points[3] - start)
    (ax, ay), (bx, by), (cx, cy) = start[:2], middle[:2], points[3][:2]
    d = 2.0 * (ax * (by - cy) + bx * (cy - ay) + cx * (ay - by))
    squares = [ax**2 + ay**2, bx**2 + by**2, cx**2 + cy**2]
    ux = (squares[0] * (by - cy) + squares[1] * (cy - ay) + squares[2] * (ay - by)) / d
    uy = (squares[0] * (cx - bx) + squares[1] * (ax - cx) + squares[2] * (bx - ax)) / d
    first, last = math.atan2(ay - uy, ax - ux), math.atan2(cy - uy, cx - ux)
    turn = math.remainder(last - first, 2.0 * math.pi)
    angle = first + shares * turn
    radius = math.hypot(ax - ux, ay - uy)
    return np.hstack([ux + radius * np.cos(angle), uy + radius * np.sin(angle), np.full_like(angle, start[2])])


REFUSALS = {
    "FL AN+90 LEN5\nFSELECT 2": ("FSELECT is a choice of solutions", 4),
    "FL X+10": ("not determined by its own data", 3),
    "CYCL DEF 200 D Q200=2 Q201=-5 Q206=9 Q202=5 Q203=0\nFL AN+90 M99": ("calls a cycle inside a contour", 4),
    "FL AN+90\nL X+10": ("not determined by its own data", 3),
    "FL X+9 Y+9 AN+90": ("contradict each other", 3),
    "FL X+9 AN+90\nFL X+9 Y+9 AN+0": ("not determined|contradict", 3),
    "FL AN+0\nFC DR+ R5 CCX+20 CCY+3": ("not determined", 3),
    "FL AN+0\nFCT DR+ R5 CCX+20 CCY+3": ("contradict each other", 4),
    "FC DR+ R10 CCX+9 CCY+0 CCA90": ("contradict each other", 3),
    "FC R10 CCX+10 CCY+0 CCA90": ("without its direction", 3),
    "FLT LEN5": ("without a contour element before it", 3),
    "FL AN+90 LEN5 PDX+3": ("no word of FL", 3),
    "FL PR+5": ("not determined", 3),
    "L X-9\nAPPR LT X+0 Y+9 LEN5 RL\nCT X+5 Y+9": ("without a contour element in the plane", 5),
    "CYCL DEF 254 SLOT": ("cycle that is not supported", 3),
    "CYCL DEF 251 POCKET": ("without Q200", 3),
    f"{BORE.format(335, 9)}\nM99": ("narrower than its tool", 4),
    f"{BORE.format(335, 21)}\nM99": ("a core would be left", 4),
    f"{BORE.format(335, 40)} Q342=20 Q370=1\nM99": ("several helices", 4),
    f"TOOL CALL 9 Z\n{BORE.format(335, 40)}\nM99": ("radius of tool 9.*--tools", 5),
    f"L M4\n{BORE.format(335, 15)}\nM99": ("under M4", 5),
    f"CYCL DEF 8.1 X\n{POCKET.format(252, 'Q223=40')}\nM99": ("under M4 or cycle 8", 5),
    f"{POCKET.format(252, 'Q223=40 Q439=3')}\nM99": ("feeds of the cutting edge", 4),
    f"{POCKET.format(257, 'Q223=40 Q222=50').replace('Q368=0', 'Q368=1')}\nM99": ("finishes a stud", 4),
    f"{BORE.format(335, 15)}\n9 Q201 = -9\nM99": ("Q201 was set again", 5),
    f"{POCKET.format(251, 'Q218=9 Q219=40')}\nM99": ("narrower than its tool", 4),
    f"{POCKET.format(251, 'Q218=40 Q219=40 Q367=5')}\nM99": ("no position", 4),
    f"{POCKET.format(253, 'Q218=20 Q219=40')}\nM99": ("shorter than the slot is wide", 4),
    f"{POCKET.format(252, 'Q223=40 Q370=-1')}\nM99": ("no overlap", 4),
    f"{POCKET.format(252, 'Q223=40').replace('Q202=4', 'Q202=0.0001')}\nM99": ("too many rounds", 4),
    f"{POCKET.format(252, 'Q223=40').replace('Q207=300', 'Q207=MAX')}\nM99": ("mills at FMAX", 4),
    f"{SL.replace('Q18=0', 'Q18=3')}\nM30\n{SQUARE}": ("Q18 names a tool of unknown radius", 7),
    f"{SL.replace('Q1=-4', 'Q1=4')}\nM30\n{SQUARE}": ("is not below the surface", 7),
    f"{SL.replace('Q7=9', 'Q7=1')}\nM30\n{SQUARE}": ("is below the surface and its clearance", 7),
    f"{SL.replace('Q10=2', 'Q10=0.0001')}\nM30\n{SQUARE}": ("too many infeeds", 7),
    f"{SL.replace('Q2=1', 'Q2=2')}\nM30\n{SQUARE}": ("is no overlap", 7),
    f"{SL.replace('Q12=300', 'Q12=MAX')}\nM30\n{SQUARE}": ("mills at FMAX", 7),
    f"{SL.replace('M3', 'M4')}\nM30\n{SQUARE}": ("M4 or cycle 8 decides", 7),
    f"{SL.replace('CYCL CALL', 'Q10 = 5')}\nM99\nM30\n{SQUARE}": ("after Q10 was set again", 8),
    f"{SL.replace('Q10=2', 'Q99=2')}\nM30\n{SQUARE}": ("without Q10", 5),
    f"{SL}\nM30\n{SQUARE.replace(' RL', '')}": ("contour that is open, or has no side", 7),
    f"{SL}\nM30\n{SQUARE.replace(' RL', ' RR')}": ("islands without a pocket", 7),
    f"{SL}\nM30\n{SQUARE.replace('X+0 Y+0', 'X+0 Y+1', 1)}": ("contour that is open, or has no side", 7),
    f"{SL}\nM30\n{SQUARE.replace('L Y+30', 'L Y+30 Z-1')}": ("leaves its plane", 7),
    f"{SL}\nM30\n{SQUARE.replace(' Y+0 RL', ' RL')}": ("does not say where it begins", 7),
    f"{SL}\nM30\n{SQUARE.replace('LBL 0', 'RND R5')}\nLBL 0": ("ends before the element behind a corner", 7),
    f"{SL}\nM30\n{SQUARE.replace('L Y+30', 'CYCL DEF 7.1 X+9')}": ("CYCL DEF 7.1 in a contour of cycle 14", 12),
    f"{SL}\nM30\n{SQUARE.replace('LBL 0', 'END PGM T MM')}": ("END PGM in a contour", 15),
    f"{SL}\nL X+1 F100\nM30\n{SQUARE}": ("tool's place is not known", 8),
    "CYCL DEF 25 T Q1=-2 Q3=0 Q5=0 Q7=1 Q10=1 Q11=9 Q12=9 Q15=1\nM99": ("cycles 14 and 20 before it", 4),
    "Q5 = 1\nTCH PROBE 0.0 PLANE Q5 X-\nTCH PROBE 0.1 X+5\nL X+Q5": ("Q5 is read before it is set", 6),
    "TCH PROBE 412 X ~\n Q320=5\nL X+1": ("place is not known", 5),
    "PATTERN DEF POS1": ("form that is not known", 3),
    "PATTERN DEF FRAME1 (X+0 Y+0 DX+8 DY+8 NUMX4 NUMY4)": ("form that is not known", 3),
    "PATTERN DEF ROW1 (X+0 Y+0 NUM2)": ("ROW with other words", 3),
    "PATTERN DEF POS1 (X+0 Y+0 FOO)": ("POS with other words", 3),
    "PATTERN DEF POS1 (X+0 Y+0 D+5)": ("POS with other words", 3),
    "PATTERN DEF ROW1 (X+0 Y+0 D+8 NUM2.5)": ("2.5 for a number of points", 3),
    "PATTERN DEF POS1 (X+0 Y+0)\nCYCL CALL PAT": ("without a cycle to call", 4),
    'SEL PATTERN "A.PNT"': ("of other files", 3),
    "PLANE VECTOR BX1": ("given otherwise", 3),
    "PLANE AXIAL B+45 STAY": ("machine's axes", 3),
    "FN 18: SYSREAD Q1 = ID230 NR3 IDX3\nQ2 = Q1 + 1\nL Z+Q2": ("Q2 is read before it is set", 5),
    "FN 18: SYSREAD Q1 = ID270 NR1 IDX1\nFN 9: IF +Q1 EQU +0 GOTO LBL 1\nLBL 1": ("Q1 is read before", 4),
    "G1 X10": ("no statement that is known", 3),
    "?? 5": ("is no statement", 3),
    "L X+10 FOO": ("no word of L", 3),
    "L X+10 X+5": ("X.5 repeats a word", 3),
    "L X+10 IX+5": ("both given", 3),
    "L X+10 F0": ("no feed that moves", 3),
    "L X+10 M97 M98\nL X+Q7": ("Q7 is read before it is set", 4),
    "L X+200000": ("beyond 100 m", 3),
    "TOOL CALL 9 Z\nL X+1 RL": ("radius of tool 9.*--tools", 4),
    "L X+1 M92": ("machine builder", 3),
    "L X+1 FMAX M92\nL X+2 Y+2": ("place is not known", 4),
    "L Z-5 RL": ("does not move in the plane", 3),
    "C X+1 Y+1 DR+": ("without a circle centre", 3),
    "CC X+0 Y+0\nL X+10\nC X+0 Y+10.1 DR+": ("0.1000 mm off its circle", 5),
    "L X+1\nCC X+5 Y+0\nC X+1 Y+0": ("without its direction", 5),
    "CC X+1\n": ("other coordinates than two of a plane", 3),
    "L X+0 RL\nL X+20\nCC X+10 Z+0\nC X+10 Z+10 DR+": ("in another plane than G17", 6),
    "CC X+0 Y+0\nL X+10\nCP IPA+90 DR-": ("against the direction", 5),
    "CR X+20 R+5 DR+": ("radius 5 mm cannot reach", 3),
    "CT X+10 Y+10": ("without a contour element", 3),
    "L X+10\nRND R20\nL Y+10": ("does not fit", 4),
    "L X+10\nRND R2\nL Z+10": ("out of the plane", 5),
    "L X+10\nRND R2\nM5": ("stands between a corner", 5),
    "L X+10\nRND R2": ("stands between a corner", 5),
    "RND R2\nL X+1": ("without a contour element", 3),
    "APPR CT X+0 Y+10 CCA90 R+10 RL\nL Z+1": ("no direction in the plane", 4),
    "L X-20\nAPPR LCT X+0 Y+10 R30 RL\nL Y+50": ("holds the point", 4),
    "CYCL DEF 10.1 ROT+10\nCYCL DEF 7.1 X+5\nL X+1": ("order decides", 5),
    "CYCL DEF 8.1 X\nCYCL DEF 10.1 ROT+10\nL X+1": ("order decides", 5),
    "L X+1\nCYCL DEF 7.1 #3": ("another datum than before", 4),
    "CYCL DEF 7.1 X+9\nPLANE SPATIAL SPA+9 SPB+0 SPC+0 STAY\nCYCL DEF 7.1 X+0\nL X+1 FMAX": ("order decides", 6),
    "CYCL DEF 7.1 X+9\nPLANE SPATIAL SPA+9 SPB+0 SPC+0 STAY\nCYCL DEF 7.1 Y+3": ("before the tilting", 5),
    "L X+1\nCYCL DEF 247 D ~\n Q339=2": ("table of the control", 4),
    "CC X+0 Y+0\nCYCL DEF 7.1 X+5\nLP PR+5 PA+0": ("after a change of the coordinates", 5),
    "PLANE SPATIAL SPA+0 SPB+9 SPC+0 STAY\nL X+1": ("tool's place is not known", 4),
    "M128\nLN X+2 Y+0 Z+5 TX+0.1 TY+0 TZ+0.99498\nM140 MB20": ("along a tool that leans", 5),
    "M138 C\nM140 MB MAX\nL X+1": ("tool's place is not known", 5),
    "M128\nL X+1 A+5": ("under tool centre point control", 4),
    "M99": ("calls a cycle, and none is defined", 3),
    "CYCL DEF 200 D Q200=2 Q201=-5\nM99": ("without Q206", 3),
    "CYCL DEF 200 D Q200=2 Q201=5 Q206=9 Q202=5 Q203=0": ("above the surface", 3),
    "CYCL DEF 1.1 SET UP 2": ("without its heading", 3),
    "CYCL DEF 1.0 PECKING\nCYCL DEF 1.1 SET UP 2\nM99": ("cycle that is not whole", 5),
    "CALL LBL 7": ("LBL 7: the program has none", 3),
    "LBL 1\nLBL 1\nCALL LBL 1": ("has several", 5),
    "LBL 1\nCALL LBL 1": ("subprograms within each other", 4),
    "LBL 1\nQ1 = 2\nFN 9: IF +Q1 EQU +2 GOTO LBL 1": ("never ends", 5),
    "CALL PGM OTHER": ("--subprograms FOLDER", 3),
    "FN 14: ERROR= 1000": ("stops with its error", 3),
    "Q1 = 5\nFN 18: SYSREAD Q1 = ID1\nL X+Q1": ("Q1 is read before it is set", 5),
    "FUNCTION MODE TURN": ("turning is not supported", 3),
    "L X+10\nRND R2 X+3\nL Y+10": ("X.3 is no word of RND", 4),
    "CYCL DEF 9.1 V.ZEIT": ("needs its time", 3),
    "FUNCTION DWELL REV5.8": ("FUNCTION DWELL REV is no statement that is known", 3),
    "Q = 5": ("Q is no statement that is known", 3),
    "Q1 = 3 / 0": ("cannot be worked out", 3),
    "Q1 = ((3": ("3:7: a bracket that is not closed", 3),
    "L X+1 L Y+2": ("no word|is no word", 3),
}  # fmt: skip


@pytest.mark.parametrize("body", REFUSALS)
def test_refusals_name_line_and_word(body):
    text, line = REFUSALS[body]
    with pytest.raises(InputError, match=text) as caught:
        read(body + "\nL X+1" if not body.startswith(("L X+10\nRND R2",)) or body.endswith(("+10", "M5")) else body)
    assert caught.value.line == line


def test_every_statement_and_function_has_its_source_and_meaning():
    for name, row in STATEMENTS.items():
        assert row.meaning and row.source.startswith("HEIDENHAIN") and row.controls == ("heidenhain",), name
    assert all(refused.what and refused.hint and refused.source for refused in REFUSED.values())
    assert not REFUSED.keys() & STATEMENTS.keys() and set(functions.SHARED) <= CODES.keys()
    assert not functions.PASSIVE.keys() & functions.REFUSED.keys()
    # each statement that moves or changes coordinates stands in a program above
    bodies = "\n".join(body for body, _ in PATHS.values())
    silent = (functions.nothing, functions.listed)
    unproved = [name for name, row in STATEMENTS.items() if row.act not in silent and name not in bodies]
    milled = {f"CYCL DEF {number}" for number in (4, 5, 208, 251, 252, 253, 256, 257)}
    unproved = [name for name in unproved if name.partition(".")[0] not in milled]
    other = {
        "BEGIN PGM",
        "BLK FORM 0.1",
        "BLK FORM 0.2",
        "CYCL DEF 247",
        "STOP",
        "TCH PROBE",
        "CYCL DEF 300",
    }
    assert {*unproved} == other | {f"CYCL DEF 7.{n}" for n in (3, 4, 5, 6)} | {"FUNCTION RESET TCPM"}


def test_what_the_page_calls_hunted_is_in_the_random_programs():
    texts = "".join(random_program(seed) for seed in range(60))
    assert [
        name for name in HUNTED if not re.search(rf"\d {name.replace('FN12', 'FN 12:').rstrip('Q') or 'Q'}", texts)
    ] == []


def test_inch_programs_count_feeds_in_tenths():
    program = read("L X+1 R0 F100\nCC X+1 Y+1\nC X+2 Y+1 DR-", "INCH")
    assert program.moves.end[:, 0] * 1e3 == pytest.approx([25.4, 50.8])
    assert program.moves.feed * 6e4 == pytest.approx([254.0, 254.0])


@pytest.mark.parametrize("cycle", [4, 251, 252, 253, 256, 257])
@pytest.mark.parametrize("seed", range(4))
def test_walls_and_floors_of_milled_forms_are_those_of_the_cycle(cycle, seed):
    """The tool's centre stays a radius off the wall, reaches it on every side, and takes the infeeds asked for."""
    chance, radius, stud = random.Random(10 * cycle + seed), 5.0, cycle > 253
    length, width, corner = chance.uniform(40, 60), chance.uniform(22, 38), chance.uniform(6, 10)
    turn, spare, low = chance.uniform(-180, 180), (0.0, 0.75)[seed % 2], (0.0, 0.5)[seed % 2]
    own = {
        251: f"Q218={length} Q219={width} Q220={corner} Q224={turn} Q370=1.2",
        252: f"Q223={width} Q370=1.2",
        253: f"Q218={length} Q219={width} Q374={turn}",
        256: f"Q218={length} Q219={width} Q220={corner} Q224={turn} Q370=1.2 Q424={length + 30} Q425={width + 20}",
        257: f"Q223={width} Q222={width + 20} Q370=1.2",
    }
    low = 0.0 if stud else low
    body = POCKET.format(cycle, own.get(cycle, "")).replace("Q368=0", f"Q368={spare}").replace("Q369=0", f"Q369={low}")
    body = body.replace("Q215=0 ", "" if stud else "Q215=0 ")
    if cycle in (252, 257):
        length = width
    if cycle in (252, 253, 257):
        corner = width / 2.0
    turn = 0.0 if cycle in (4, 252, 257) else turn
    if cycle == 4:
        spare = low = 0.0
        parts = ("0 T", "1 A 2", "2 T -10", "3 Z 4 F50", f"4 X{length}", f"5 Y{width}", f"6 F300 DR+ RADIUS{corner}")
        body = "\n".join(f"CYCL DEF 4.{part}" for part in parts)
    moves = read(f"L Z+2 FMAX\n{body}\nL X+20 Y-7 FMAX\nCYCL CALL").moves
    cuts = [row for row in range(1, len(moves)) if moves.motion[row] and moves.end[row, 2] < 1e-3]
    dense = []
    for row in cuts:
        (x, y, z), (u, v, _) = moves.end[row, :3] * 1e3, moves.end[row - 1, :3] * 1e3
        shares, middle = np.linspace(0.0, 1.0, 4001), complex(*moves.arc_center[row, :2] * 1e3)
        if moves.motion[row] == 2:
            sweep = moves.arc_sweep[row] * moves.arc_normal[row].sum()
            dense.append(middle + (complex(u, v) - middle) * np.exp(1j * sweep * shares))
        elif abs(z - moves.end[row - 1, 2] * 1e3) < 1e-9:
            dense.append(complex(u, v) + (complex(x, y) - complex(u, v)) * shares)
    along = (np.concatenate(dense) - complex(20, -7)) * np.exp(-1j * math.radians(turn))
    beyond = np.maximum(np.abs(along.real) - length / 2 + corner, 0) + 1j * np.maximum(
        np.abs(along.imag) - width / 2 + corner, 0
    )
    inner = np.maximum(np.abs(along.real) - length / 2, np.abs(along.imag) - width / 2)
    off = np.where(np.abs(beyond) > 0, np.abs(beyond) - corner, inner)  # above 0: outside the form
    wall = radius + spare if stud else -radius
    assert (off.min() if stud else off.max()) == pytest.approx(wall, abs=2e-3)
    there = along[np.abs(off - wall) < 2e-3]
    sides = there.real.max(), -there.real.min(), there.imag.max(), -there.imag.min()
    assert sides == pytest.approx((length / 2 + wall,) * 2 + (width / 2 + wall,) * 2, abs=2e-3)
    assert {round(float(moves.end[row, 2]) * 1e3, 6) for row in cuts} == {-4.0, -8.0, -10.0 + low, -10.0}
    assert sum("is assumed" in warning.text for warning in read(f"{body}\nCYCL CALL\nCYCL CALL").warnings) == 1


def test_blank_tools_and_what_is_said():
    text = "BLK FORM 0.1 Z X-5 Y+0 Z-20\nBLK FORM 0.2 X+100 IY+80 Z+0\nL Z+0 FMAX M91\nCYCL DEF 247 D Q339=+1\n"
    text += 'CYCL DEF 240 Z Q200=2 Q343=0 Q201=-1 Q206=9 Q203=0\nTOOL CALL "MILL 10" Z S500\nSTOP M0\nL X+1 M8\n'
    text += "CYCL CALL POS X+5 Y+5 F MAX\nTOOL CALL 2 Z\nFUNCTION TCPM F TCP AXIS POS\nL X+7\nFUNCTION RESET TCPM"
    program = read(text)
    assert program.stock == ((-0.005, 0.0, -0.02), (0.1, 0.08, 0.0))
    assert program.dialect == "heidenhain" and [tool.number for tool in program.tools] == [1, 2]
    assert program.moves.tool_length[-1] == 0.05 and ("M8", 10) in [(u.word, u.line) for u in program.unsupported]
    assert program.moves.end[-1, 2] == pytest.approx(0.002 - 0.05)  # the numbers of the tip change with the length
    assert any("cycle 247" in text for text in program.assumptions)
    left_out = read("CYCL DEF 392 ATC ~\n Q240=2\nBLK FORM 0.1 Z X+Q7 Y+0 Z-20\nL X+1")
    assert "392 is left out" in left_out.warnings[0].text and left_out.stock is None and len(left_out.moves) == 1


def test_m128_holds_the_tip_of_a_machine_that_kinematics_describe():
    """A table that turns about X through zero: at A90 the point Z100 of the axes is Y-100 of the part."""
    table = RotaryAxis("A", TABLE, direction=(1.0, 0.0, 0.0), point=(0.0, 0.0, 0.0))
    control = Controller(kinematics=PostedKinematics("table", (table,), tcp=False))
    text = "L Z+100 FMAX\nL A+90 F100\nL Y+20\nM128\nL X+5 Y+6 Z+7 A+45\nM129\nL A+0"
    moves = read(text, controller=control).moves
    ends = [[0, 0, 100], [0, -100, 0], [0, -100, 20], [5, 6, 7], [5, 13 / math.sqrt(2), 1 / math.sqrt(2)]]
    last = np.flatnonzero(np.append(np.diff(moves.line), 1))  # the way of a turning table is cut into pieces
    assert moves.end[last, :3] * 1e3 == pytest.approx(np.array(ends), abs=1e-9)
    assert np.degrees(moves.end[last, 3]) == pytest.approx([0, 90, 90, 45, 0])


def test_m13_and_m14_turn_the_spindle():
    assert (read("L X+1 M13\nL X+2 M14\nL X+3 M5").moves.spindle * 30 / math.pi).round(6).tolist() == [1000, -1000, 0]
    spindle = parse_program("G21 S500 F100 M13\nG1 X1\nM14 X2\n", "p.nc").moves.spindle
    assert (spindle * 30 / math.pi).round(6).tolist() == [500, -500]


def test_programs_that_are_called(tmp_path):
    (tmp_path / "SUB.H").write_text("BEGIN PGM SUB MM\nL IX+Q5\nLBL 1\nL IY+1\nCALL LBL 1 REP 1\nEND PGM SUB MM\n")
    control = Controller(subprograms=str(tmp_path))
    check_path(read("Q5 = 2\nLBL 1\nCALL PGM SUB.H\nCALL LBL 1 REP 1\nL X+9", controller=control),
               "F 2 0 0; F 2 1 0; F 2 2 0; F 4 2 0; F 4 3 0; F 4 4 0; F 9 4 0")  # fmt: skip
    for name, text in (("EMPTY", ""), ("BARE", "L Y+2")):  # the main program goes on behind a file that has no end
        (tmp_path / f"{name}.H").write_text(text)
    called = "CALL PGM EMPTY\nL X+1\nCALL PGM BARE.H\nL X+2\nCALL PGM EMPTY\nL X+3"
    check_path(read(called, controller=control), "F 1 0 0; F 1 2 0; F 2 2 0; F 3 2 0")


def test_check_says_the_language_why_and_what_it_needs(capsys, tmp_path):
    file = tmp_path / "part.h"
    file.write_text("0 BEGIN PGM PART MM\n1 TOOL CALL 3 Z S1 F100\n2 L X+10\n3 L X+20 RL\n4 END PGM PART MM\n")
    assert main(["check", str(file)]) == 1
    said = capsys.readouterr().out
    assert "language: Heidenhain's conversational language (line 1: '0 BEGIN PGM PART MM')" in said
    assert "needs: --tools (line 4)" in said and "extents" not in said
    file.write_text("G21\nG1 X5 F100\n")
    assert main(["check", str(file)]) == 0
    said = capsys.readouterr().out
    assert "language: G code (no sign of another language)" in said and "extents" in said
    assert main(["check", str(file), "--dialect", "heidenhain"]) == 1
    assert "as asked for: --dialect heidenhain" in capsys.readouterr().out


def test_check_of_a_polar_point_that_is_not_known(capsys, tmp_path):
    """Of the machine (M91), by a parameter that the machine alone knows (FN 18)."""
    file = tmp_path / "part.h"
    lines = (
        "BEGIN PGM P MM",
        "TOOL CALL 1 Z S1",
        "FN 18: SYSREAD Q9 = ID990 NR1 IDX0",
        "CC X+0 Y+0",
        "LP PR+Q9 PA+0 FMAX M91",
    )
    file.write_text("\n".join([*lines, "END PGM P MM"]))
    assert main(["check", str(file)]) == 1
    assert "leads to a point that is not known" in capsys.readouterr().out


WRITTEN = """0 BEGIN PGM P MM
1 TOOL CALL 1 Z S1000 F200
2 L X+10 Y+0 R0 FMAX M3 ; start
3 L Z-2 F100
4 CC X+0 Y+0
5 C X+0 Y+10 DR+
6 L X+5
7 RND R1
8 L IX+2 IY-3
9 CR X+20 Y+20 R+30 DR-
10 CT X+30 Y+35
11 LP PR+10 PA+20
12 L X+60 Y+60 RL
13 L IX+30
14 L X+99 Y+0 R0
15 L X+0 Y+0 Z+50 R0 FMAX M91
16 END PGM P MM
"""


@pytest.mark.parametrize(
    ("x", "y", "z", "degrees"), [(100, 20, 3, 0), (0, 0, 0, 90), (12.5, -7, 0.125, 33.3), (5, 5, 0, -150)]
)
def test_a_program_is_written_for_another_placement(x, y, z, degrees):
    program, turn = parse_program(WRITTEN, "p.h", controller=TOOLS), math.radians(degrees)
    placement = (x / 1e3, y / 1e3, z / 1e3, 0.0, 0.0, turn)
    text = rewrite_program(program, placement, (0.0,) * 6, control=TOOLS).text
    frame = text.replace(WRITTEN[: WRITTEN.index("2 L")], "").partition("2 L")[0]
    assert frame.count("\n") == (6 if degrees else 4) and text.replace(frame, "") == WRITTEN
    again, cuts = parse_program(text, "p.h", controller=TOOLS).moves, program.moves.motion > 0
    a, b = program.moves.end[cuts, 0] * 1e3, program.moves.end[cuts, 1] * 1e3
    there = np.column_stack([a * math.cos(turn) - b * math.sin(turn) + x, a * math.sin(turn) + b * math.cos(turn) + y])
    assert again.end[cuts, :2] * 1e3 == pytest.approx(there, abs=2e-3)
    assert again.end[cuts, 2] * 1e3 == pytest.approx(program.moves.end[cuts, 2] * 1e3 + z, abs=1e-3)
    assert again.arc_sweep == pytest.approx(program.moves.arc_sweep, abs=1e-3)


def test_cycles_parameters_and_repeats_are_placed_by_the_frame():
    body = "Q1 = 5\nLBL 1\nL X+Q1 Y+2 Z+9 F9\n" + DRILL.format(depth=4, far=9) + "L IX+1 M99\nCALL LBL 1 REP 1"
    program = read(body)
    text = rewrite_program(program, (0.1, 0, 0.003, 0, 0, math.pi / 2), (0.0,) * 6, control=TOOLS).text
    cuts, again = program.moves.end[:, :3], parse_program(text, "p.h", controller=TOOLS).moves.end[:, :3]
    assert again == pytest.approx(np.column_stack([0.1 - cuts[:, 1], cuts[:, 0], cuts[:, 2] + 0.003]), abs=1e-7)


@pytest.mark.parametrize(
    ("body", "placement", "line"),
    [
        ("CYCL DEF 7.1 X+5\nL X+1 Y+1 F9", (0.1, 0, 0, 0, 0, 0), 4),
        ("L X+1 Y+1 Z+1 F9\nCYCL DEF 7.1 X+5\nL X+1 Y+1", (0.1, 0, 0, 0, 0, 0), 5),
        ("L X+1 Y+1 F9", (0, 0, 0, 0.1, 0, 0), 1),
        ("L IX+1 F9\nL Y+3", (0.1, 0, 0, 0, 0, 0.5), 3),
        ("L X+1 Y+1 Z+1 F9\nL A+5", (0, 0, 0, 0, 0, 0.5), 4),
        ("PLANE SPATIAL SPA+0 SPB+9 SPC+0 STAY\nL X+1 Y+1 Z+1 FMAX\nL X+5 F9", (0, 0, 0, 0, 0, 0.5), 3),
    ],
)
def test_what_cannot_be_written_is_refused_by_line(body, placement, line):
    with pytest.raises(InputError) as caught:
        rewrite_program(read(body), placement, (0.0,) * 6, control=TOOLS)
    assert caught.value.line == line and "--write" in str(caught.value)


@pytest.mark.parametrize("seed", range(60))
def test_mutated_programs_are_read_or_refused(seed):
    chance = random.Random(seed)
    bodies = [body for body, _ in PATHS.values()] + list(REFUSALS)
    text = list("BEGIN PGM T MM\nTOOL CALL 1 Z S9 F200\n" + "\n".join(chance.sample(bodies, 3)) + "\nEND PGM T MM\n")
    for _ in range(chance.randrange(1, 9)):
        place = chance.randrange(len(text))
        text[place : place + chance.randrange(2)] = chance.choice('XYZIQR+-.0123456789\n LCMF=()"~;')
    checked = check(Request(tuple("".join(text).split("\n")), "t.h", controller=TOOLS))
    assert checked.complete or any(finding.severity == "error" for finding in checked.findings)
