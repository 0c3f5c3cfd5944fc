"""The words of cutter-location files: what they do, what is refused and where."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.nc.cutter_location import MM, START, read, refused
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.cutter_location.vocabulary import TABLE, WORDS
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.nc.tables import ToolEntry


def test_rapids_are_for_one_motion_and_from_is_where_the_tool_stands():
    moves = read(f"{START}FROM/0,0,100\nRAPID\nGOTO/0,0,5\nGOTO/0,0,0\nRAPID\nGODLTA/0,0,7\nGODLTA/1,0,0\n").moves
    assert list(moves.motion) == [RAPID, FEED, RAPID, FEED]
    np.testing.assert_allclose(moves.start[0, :3], [0, 0, 0.1])
    np.testing.assert_allclose(moves.end[:, 2], [0.005, 0, 0.007, 0.007])


def test_home_is_a_point_or_the_controls():
    there = read(f"{START}GOTO/0,0,0\nGOTO/1,0,0\nRAPID\nGOHOME/0,0,50\n")
    assert list(there.moves.motion) == [FEED, RAPID] and there.moves.end[-1, 2] == pytest.approx(0.05)
    unknown = read(f"{START}GOTO/0,0,0\nGOTO/1,0,0\nRAPID\nGOHOME\nGOTO/2,0,0\n")
    assert list(unknown.moves.motion) == [FEED, FEED] and "way there is not part" in str(unknown.warnings[0])


@pytest.mark.parametrize(
    ("feed", "mm_per_min"),
    [
        ("FEDRAT/500,MMPM", 500),
        ("FEDRAT / MMPM , 500.", 500),
        ("FEDRAT/500", 500),
        ("FEDRAT/5.0E+2,PERMIN", 500),
        ("FEDRAT/10,IPM", 254),
        ("SPINDL/RPM,2000,CLW\nFEDRAT/0.1,MMPR", 200),
        ("SPINDL/ 2000.0000,RPM,CLW\nFEDRAT/PERREV,0.1", 200),
        ("SPINDL/CCLW,2000\nFEDRAT/MMPR,0.1", 200),
        ("SPINDL/2000,CLW\nSPINDL/OFF\nSPINDL/ON\nFEDRAT/MMPR,0.1", 200),
    ],
)
def test_feeds(feed, mm_per_min):
    moves = read(f"UNITS/MM\n{feed}\nGOTO/0,0,0\nGOTO/1,0,0\n").moves
    assert moves.feed[0] == pytest.approx(mm_per_min * MM / 60)


def test_inches():
    program = read(
        "UNITS/INCHES\nLOADTL/1,LENGTH,2\nCUTTER/0.5\nFEDRAT/10\nGOTO/0,0,0\nGOTO/1,0,0\nGOTO/1,0,0,0,.6,.8\n"
    )
    moves = program.moves
    assert moves.end[0, 0] == pytest.approx(0.0254) and moves.feed[0] == pytest.approx(0.254 / 60)
    assert moves.tool_length[0] == pytest.approx(0.0508) and program.tools[0].diameter == pytest.approx(12.7)
    # The tip stands, the tool turns: the feed's mm count as degrees, whatever the unit of the file.
    assert moves.feed[-1] == pytest.approx(math.radians(254) / 60)


def test_tools_lengths_and_pauses():
    text = (
        f"{START}LOADTL/3,LENGTH,80\nGOTO/0,0,0\nGOTO/1,0,0\nDELAY/2\nSPINDL/600,RPM\nDELAY/5,REV\n"
        "LOAD/TOOL,4,ADJUST,4\nGOTO/2,0,0\n"
    )
    program = read(text)
    assert list(program.moves.tool) == [3, 4]
    np.testing.assert_allclose(program.moves.tool_length, [0.08, math.nan])
    assert program.moves.dwell[0] == pytest.approx(2.5)
    assert any("LENGTH of LOADTL" in text for text in program.assumptions)
    tabled = read(text, controller=Controller(tools={3: ToolEntry(3, 120.0, 6.0), 4: ToolEntry(4, 90.0)}))
    np.testing.assert_allclose(tabled.moves.tool_length, [0.12, 0.09])
    assert [tool.number for tool in tabled.tools] == [3, 4] and tabled.tools[0].diameter == pytest.approx(6.0)


def test_lines_columns_and_labels():
    """Physical lines of the first part of a statement, whatever continues it."""
    program = read(
        "$$ head\n\nUNITS/MM\nN10 FEDRAT/100,MMPM\nL1) GOTO/0,$ $$ more\n 0,$\n0\nGOTO/1,$\n0,0\n\ngoto/2,0,0\n"
    )
    assert list(program.moves.line) == [8, 11]
    assert (program.dialect, program.interpreter) == ("cutter-location file", "builtin")
    error = refused("UNITS/MM\nFEDRAT/1\nGOTO/0,0,0\nGOTO/1,$\n  0,abc\n")
    assert (error.line, error.column) == (4, 1)


def test_file_ends_with_fini():
    program = read(f"{START}GOTO/0,0,0\nGOTO/1,0,0\nEND\nFINI\nGOTO/2,0,0\n")
    assert len(program.moves) == 1 and "FINI ends the file" in str(program.warnings[0])


def test_what_is_not_acted_upon_is_listed_once():
    program = read(
        f"{START}PAINT/COLOR,1\nGOTO/0,0,0\nPAINT/COLOR,2\nGOTO/1,0,0\nCOOLNT/ON\nAUXFUN/99\nAUXFUN/98\nFOOBAR/1,2\n"
    )
    listed = {word.word: word for word in program.unsupported}
    assert set(listed) == {"PAINT", "COOLNT", "AUXFUN", "FOOBAR"} and listed["PAINT"].line == 3
    assert len(program.warnings) == 2 and "line 8" in str(program.warnings[0]) and "FOOBAR" in str(program.warnings[1])


def test_creos_coordinate_system_is_a_comment_over_several_lines():
    program = read(
        "$$-> CSYS / 1.0000000000, 0.0000000000, 0.0000000000, 0.0000000000,  $\n"
        "            0.0000000000, 1.0000000000, 0.0000000000, 0.0000000000,  $\n"
        "            0.0000000000, 0.0000000000, 1.0000000000, 0.0000000000\n"
        f"{START}GOTO / 0.0000000000, 0.0000000000, 1.0000000000\nGOTO / 1.0, 0., 1.\n"
    )
    assert len(program.moves) == 1 and not program.warnings


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("COPY/1,TRANSL,1,0,0,3", 3, "COPY"),
        ("TRACUT/1", 3, "TRACUT"),
        ("TRANS/0,0,5", 3, "TRANS"),
        ("ORIGIN/1,2,3", 3, "ORIGIN"),
        ("ROTABL/90,BAXIS", 3, "ROTABL"),
        ("$$-> CUTCOM_GEOMETRY_TYPE / OUTPUT_ON_PROFILE\nCUTCOM/LEFT,1", 4, "points of the contour"),
        ("CYCLE/DRILL,RAPTO,3,CLEAR,2,FEDTO,-5,MMPM,100", 3, "RAPTO beside CLEAR|CLEAR twice"),
        ("CALSUB/5", 3, "CALSUB"),
        ("TLRGT,GORGT/L1", 3, "TLRGT"),
        ("RETRCT", 3, "retracts"),
        ("CYCLE/TAP,10,IPM,2", 3, "numbers without words"),
        ("CYCLE/DRILL, 126.0, 85.0, 1.0,MMPR", 3, "order depends on"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2,RAPTO,1", 3, "RAPTO"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2,RETURN,0", 3, "RETURN,0"),
        ("GOTO/PT1", 3, "APT's processor"),
        ("P1=POINT/1,2,3", 3, "APT's processor"),
        ("GOTO/1,2", 3, "2 numbers"),
        ("GOTO/1,2,3,4", 3, "4 numbers"),
        ("GOTO/1,2,3,", 3, "4 numbers|''"),
        ("GOTO/1,2,1e400", 3, "within"),
        ("GOTO/1,2,2e5", 3, "within"),
        ("GOTO/1,2,3,0,0,0", 3, "length 0"),
        ("GOTO/1,2,3,0,0,1.01", 3, "length 1.01"),
        ("GOTO/0,0,0,0,0,1\nGOTO/0,0,1,0,0,-1", 4, "turns over"),
        ("1,2,3", 3, "not a statement"),
        ("GOTO/1,2,$", 3, "continues"),
        ("GOTO/1,2,$\nGOTO/3,4,5", 3, "continues"),
        ("GOTO/1,2 $ 3", 3, "after a \\$"),
        ("GODLTA/1,2,3", 3, "before any point"),
        ("CIRCLE/0,0,0,0,0,1,5", 3, "before any point"),
        ("GOTO/5,0,0\nCIRCLE/0,0,0,0,0,2,5\nGOTO/0,5,0", 4, "circle's axis"),
        ("GOTO/5,0,0\nCIRCLE/0,0,0,5\nGOTO/0,5,0", 4, "INDIRV"),
        ("GOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,6\nGOTO/0,5,0", 5, "radius 6"),
        ("GOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,5.2,0", 5, "off its circle"),
        ("GOTO/0,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,5,0", 5, "centre"),
        ("GOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,5\nFINI", 5, "waits"),
        ("GOTO/5,0,0\nGOTO/6,0,0\nCIRCLE/0,0,0,0,0,1,6", 5, "the end of the file"),
        ("GOTO/5,0,0\nRAPID\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,5,0", 5, "RAPID"),
        ("GOTO/5,0,0\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", 5, "along the circle"),
        ("GOTO/5,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", 4, "INDIRV"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),TO,(LINE/0,0,0,0,5,0)", 5, "TLON"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/9,0,0,9,5,0)", 5, "does not meet"),
        ("RAPID\nFEDRAT/100\nGOTO/1,2,3", 4, "after the RAPID"),
        ("FEDRAT/100,FOO", 3, "MMPM"),
        ("FEDRAT/-5", 3, "above 0"),
        ("FEDRAT/0.1,MMPR\nGOTO/0,0,0\nGOTO/1,0,0", 5, "spindle speed"),
        ("FEDRAT/0\nGOTO/0,0,0\nGOTO/1,0,0", 5, "before any feed"),
        ("UNITS/FURLONG", 3, "UNITS/MM"),
        ("LOADTL/1.5", 3, "whole number"),
        ("DELAY/-1", 3, "seconds"),
        ("MULTAX/MAYBE", 3, "MULTAX"),
        ("GOTO/0,0,0,0,.6,.8\nMULTAX/OFF\nGOTO/1,0,0", 5, "tool axis"),
        ("MULTAX/OFF\nGOTO/1,0,0,0,.6,.8", 4, "MULTAX/OFF"),
        ("MSYS/0,0,0,1,0,0,0,1,0\nGOTO/0,0,0\nMSYS/5,0,0,1,0,0,0,1,0", 5, "another coordinate system"),
        ("MODE/LASER", 3, "MODE/LASER"),
        ("CUTCOM/SIDEWAYS", 3, "CUTCOM/SIDEWAYS"),
        ("RAPD0", 3, "may move the tool"),
        ("TLCOMP/ON,LEFT", 3, "cutter compensation"),
        ("CALLSUB/1001", 3, "repeats or calls"),
        ("CYCLE/DRILL,DEEP,FEDTO,9,INCR,3,MMPM,80,CLEAR,15,RETURN,5", 3, "below CLEAR"),
        ("CYCLE/DRILL,DEEP,FEDTO,9,INCR,3,MMPM,80,CLEAR,5,RETURN,15", 3, "that differ"),
        ("GOT/1,2,3", 3, "may move the tool"),
        ("STRANGE/1,2,3", 3, "may move the tool"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2\nRAPID", 4, "is the next point a hole"),
        ("ZERO/1\nGOTO/0,0,0\nZERO/2", 5, "another coordinate system"),
        ("G1 X10 Y5", 3, "not a statement"),
        ("%", 3, "not a statement"),
    ],
)
def test_refusals_name_word_and_line(text, line, words):
    with pytest.raises(InputError, match=words) as caught:
        read(START + text + "\n")
    assert caught.value.line == line and caught.value.column is not None and caught.value.file == "part.apt"


@pytest.mark.parametrize(
    "frame",
    [
        "$$*CATIA0\n$$ Part Operation.1\n$$ 1.0 0.0 0.0 {0}\n$$ 0.0 1.0 0.0 0.0\n$$ 0.0 0.0 1.0 0.0\n",
        "$$-> CSYS / 1.0, 0.0, 0.0, {0}, $\n 0.0, 1.0, 0.0, 0.0, $\n 0.0, 0.0, 1.0, 0.0\n",
        "MSYS/{0},0,0,1,0,0,0,1,0\n",
        "MCS/1,0,0,0,1,0,0,0,1,{0},0,0\n",
    ],
)
def test_a_second_coordinate_system_is_refused(frame):
    """CATIA and Creo say it in comments. The same one again is harmless."""
    cut = "GOTO/0,0,0\nGOTO/1,0,0\n"
    same = START + frame.format("5.0") + cut + frame.format("5.00000") + cut
    assert len(read(same).moves) == 3
    other = START + frame.format("5.0") + cut + frame.format("6.0") + cut
    error = refused(other)
    assert "another coordinate system" in str(error)
    assert other.splitlines()[error.line - 1] in frame.format("6.0")


def test_units_must_be_certain():
    assert "inches" in str(refused("FEDRAT/10,IPM\nGOTO/0,0,0\nGOTO/1,0,0\n"))
    assert refused("FEDRAT/10\nGOTO/0,0,0\nGOTO/1,0,0\nUNITS/INCHES\n").line == 4
    assert any("taken as mm" in text for text in read("FEDRAT/10\nGOTO/0,0,0\nGOTO/1,0,0\n").assumptions)


def test_arcs_that_turn_the_other_way_are_noticed():
    """A path that goes up into an arc and would turn back there: the file means the axis the other way round."""
    text = f"{START}GOTO/10,-5,0\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,{{}},10\nGOTO/0,10,0\n"
    assert not read(text.format(1)).warnings
    assert "turns back" in str(read(text.format(-1)).warnings[0])


def test_a_diameter_is_that_of_its_tool():
    """CUTTER before LOADTL (CATIA) or after it; a tool without one has none."""
    cut = "GOTO/0,0,0\nGOTO/1,0,0\n"
    program = read(
        f"{START}CUTTER/10\nLOADTL/1\n{cut}LOADTL/2\nCUTTER/8\n{cut}LOADTL/3\n{cut}CUTTER/6\nLOADTL/4\n{cut}"
    )
    np.testing.assert_allclose([tool.diameter for tool in program.tools], [10.0, 8.0, math.nan, 6.0])


def test_no_cut_is_an_error():
    assert "no cutting move" in str(refused("UNITS/MM\nRAPID\nGOTO/0,0,0\nRAPID\nGOTO/1,0,0\n"))


def test_every_word_is_in_the_table_once_with_its_meaning_and_source():
    assert all(word.meaning and word.source for word in WORDS.values())
    assert len(WORDS) == len(TABLE)


@pytest.mark.parametrize(
    ("words", "per_minute"),
    [
        ("SPINDL/RPM,2000,CLW", 2000),
        ("SPINDL/2000,CCLW", -2000),
        ("SPINDL/2000,CCLW\nSPINDL/OFF\nSPINDL/ON", -2000),
        ("SPINDL/2000\nSPINDL/OFF", 0),
        ("SPINDL/SMM,120", math.nan),
        ("", 0),
    ],
)
def test_the_spindle_turns_as_the_file_says(words, per_minute):
    moves = read(f"{START}{words}\nGOTO/0,0,0\nGOTO/1,0,0\n").moves
    np.testing.assert_allclose(moves.spindle, per_minute * np.pi / 30.0)


HOLE = "UNITS/MM\nRAPID/\nGOTO/20,125,25\nCYCLE/INIT\n{}\nGOTO/20,125,0\nCYCLE/OFF\nFINI\n"


@pytest.mark.parametrize(
    ("cycle", "heights"),
    [
        ("CYCLE/DEEP2,FEDTO,6,1STPECK,6,SUBPECK,2.,MMPM,382,RAPTO,3.,RTRCTO,25.",
         "R 3 C -3 R 3 R -2.746 C -5 R 3 R -4.746 C -6 R 25"),
        ("CYCLE/DRILL,RAPTO,3.,FEDTO,-5.,RTRCTO,AUTO,MMPM,382", "R 3 C -5 R 25"),
        ("CYCLE/BORE,DEPTH,5,CLEAR,3,MMPM,100", "R 3 C -5 C 3"),
        ("CYCLE/BORE,DEPTH,5,CLEAR,3,MMPM,100,DWELL,1,RETURN,9", "R 3 C -5 C 3 R 9"),
    ],
)  # fmt: skip
def test_holes_as_nx_and_solidworks_write_them(cycle, heights):
    moves = read(HOLE.format(cycle)).moves
    shown = [f"{'RFAC'[kind]} {end[2] * 1e3:.6g}" for kind, end in zip(moves.motion, moves.end, strict=True)]
    assert " ".join(shown) == heights and set(moves.end[:, 0]) == {0.02}


@pytest.mark.parametrize(("words", "doubt"), [("ON,LENGTH,20", 0), ("OFF", 0), ("LEFT", 1), ("RIGHT,XYPLAN", 1)])
def test_points_are_the_tool_centres_under_compensation_of_the_control(words, doubt):
    program = read(f"FEDRAT/600,MMPM\nGOTO/0,0,0\nCUTCOM/{words}\nGOTO/5,0,0\n")
    assert program.moves.end[-1, 0] * 1e3 == pytest.approx(5)
    assert sum("off by the tool's radius" in remark.text for remark in program.warnings) == doubt
