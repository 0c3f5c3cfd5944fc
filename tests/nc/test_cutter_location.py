"""Cutter-location files: published examples, closed cases, the same path as G code, what is refused and where."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import parse_program
from toolpath_stiff.nc.cutter_location.tilting import GREAT_CIRCLE_DEG
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED, RAPID
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.path import move_lengths, sample_moves
from toolpath_stiff.path.rotations import rotation_matrices

MM = 1e-3
START = "UNITS/MM\nFEDRAT/600,MMPM\n"


def read(text: str, **options):
    return parse_program(text, "part.apt", **options)


def axes_of(abc) -> np.ndarray:
    """Tool axes, from tip to spindle, of roll, pitch, yaw."""
    return rotation_matrices(abc)[..., :, 2]


def refused(text: str, **options) -> InputError:
    with pytest.raises(InputError) as caught:
        read(text, **options)
    return caught.value


# -- published examples --------------------------------------------------------------------------------------------


def test_helix_of_ptcs_manual():
    """PTC, Creo help, "CL Output for Circular Interpolation": two orbits of thread milling, in inches."""
    program = read(
        "UNITS / INCHES\n"
        "FEDRAT / 12.000000, IPM\n"
        "GOTO / 8.198000, 0.000000, -0.625000\n"
        "FEDRAT / 8.000000, IPM\n"
        "CIRCLE / 8.000000, 0.000000, -0.625000, $ $$ 1ST ORBIT\n"
        "0.000000, 0.000000, 1.000000, 0.198000\n"
        "GOTO / 8.198000, 0.000000, -0.583333\n"
        "CIRCLE / 8.000000, 0.000000, -0.583333, $ $$ 2ND ORBIT\n"
        "0.000000, 0.000000, 1.000000, 0.198000\n"
        "GOTO / 8.198000, 0.000000, -0.541667\n"
        "FEDRAT / 12.000000, IPM\n"
    )
    moves = program.moves
    assert list(moves.line) == [7, 10] and list(moves.motion) == [ARC, ARC]
    np.testing.assert_allclose(moves.arc_sweep * moves.arc_normal[:, 2], math.tau, rtol=1e-12)
    climb = np.array([0.625 - 0.583333, 0.583333 - 0.541667])
    np.testing.assert_allclose(move_lengths(moves), 25.4 * MM * np.hypot(math.tau * 0.198, climb), rtol=1e-12)
    np.testing.assert_allclose(moves.feed, 8 * 25.4 * MM / 60)


def test_direction_of_ptcs_plane_vectors():
    """PTC, the same page: 0, 0, 1 is counter-clockwise in XY and 0, 0, -1 clockwise, by the right-hand rule."""
    for k, quarter in ((1, 1), (-1, 3)):
        moves = read(f"{START}GOTO/5,0,0\nCIRCLE/0,0,0,0,0,{k},5\nGOTO/0,5,0\n").moves
        assert move_lengths(moves)[0] == pytest.approx(quarter * math.pi / 2 * 5 * MM)


def test_arcs_as_nx_writes_them():
    """Corners of a trimmed outline and an arc from Siemens' forum, written by NX: all are quarters of a circle.

    NX' manual ("CLSF Manager", CIRCLE): the axis is that of a clockwise direction. With the right hand they were 270
    degrees. Outline: the wire path of the tests of AblationStudio; arc: community.plm.automation.siemens.com, 461633.
    """
    outline = (
        "GOTO/-5.1250,3.4613,0.0000,0.0000000,0.0000000,1.0000000\n"
        "CIRCLE/-4.2750,3.4613,0.0000,0.0000000,0.0000000,1.0000000,0.8500,0.0600,0.5000,0.0000,0.0000\n"
        "GOTO/-4.2750,4.3113,0.0000\n"
        "GOTO/-4.2750,-4.3250,0.0000\n"
        "CIRCLE/-4.2750,-3.4750,0.0000,0.0000000,0.0000000,1.0000000,0.8500,0.0600,0.5000,0.0000,0.0000\n"
        "GOTO/-5.1250,-3.4750,0.0000\n"
    )
    moves = read(START + outline).moves
    arcs = moves.arc_sweep != 0
    np.testing.assert_allclose(moves.arc_sweep[arcs] * moves.arc_normal[arcs, 2], -math.pi / 2, rtol=1e-9)
    forum = (
        "GOTO/0,0,0\nCIRCLE/-0.500000,0.000000,0.000000,0.0000000,0.0000000,-1.0000000,0.500000,0.002000,0.500000,"
        "1.000000,0.000000\nGOTO/-0.500000,0.500000,0.000000\n"
    )
    moves = read(START + forum).moves
    assert moves.arc_sweep[0] * moves.arc_normal[0, 2] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("start", "sense"), [((-4.96057, 0.62667), -1), ((4.96057, -0.62667), 1)])
def test_arc_as_catia_writes_it(start, sense):
    """A quarter in CATIA V5's words, the numbers of one of its files; the direction goes with either of two starts."""
    moves = read(
        f"{START}GOTO  / {start[0]:10.5f},{start[1]:10.5f},    2.00000\n"
        "AUTOPS\n"
        "INDIRV/    0.12533,    0.99211,    0.00000\n"
        "TLON,GOFWD/      (CIRCLE/      0.00000,      0.00000,      2.00000,$\n"
        "       5.00000),ON,(LINE/      0.00000,      0.00000,      2.00000,$\n"
        "                               0.62667,      4.96057,      2.00000)\n"
    ).moves
    assert moves.arc_sweep[0] * moves.arc_normal[0, 2] == pytest.approx(sense * math.pi / 2, abs=1e-5)
    np.testing.assert_allclose(moves.end[0, :3], [0.62667 * MM, 4.96057 * MM, 2 * MM], atol=1e-8)
    assert moves.line[0] == 6


def test_catias_long_arcs_ask_for_the_second_intersection():
    """270 degrees: the line through centre and end meets the circle first at 90, opposite the end."""
    text = f"{START}GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,{{}}(LINE/0,0,0,0,-5,0)\n"
    moves = read(text.format("2,INTOF,")).moves
    assert move_lengths(moves)[0] == pytest.approx(1.5 * math.pi * 5 * MM)
    assert "lies on the circle, where the motion does not end" in str(refused(text.format("")))


def test_catias_cylinder_is_a_circle_in_any_plane():
    moves = read(
        f"{START}GOTO/0,0,5\nPSIS/(PLANE/(POINT/0,0,5),PERPTO,$\n(VECTOR/0,1,0))\nINDIRV/1,0,0\n"
        "TLON,GOFWD/(CYLNDR/0,0,0,$\n0,1,0,5),ON,$\n(PLANE/PERPTO,$\n(PLANE/(POINT/0,0,0),PERPTO,$\n"
        "(VECTOR/0,1,0)),$\n(POINT/0,0,0),$\n(POINT/5,0,0))\n"
    ).moves
    assert move_lengths(moves)[0] == pytest.approx(math.pi / 2 * 5 * MM)
    np.testing.assert_allclose(moves.end[0, :3], [5 * MM, 0, 0], atol=1e-12)


def test_moves_of_autodesks_iso_4343_post():
    """MOVARC turns by the right hand, by the angle that it says."""
    text = f"{START}GOTO/5,0,0\nMOVARC/0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 5.0, ANGLE, {{}}\nGOTO/0,5,0\n"
    assert move_lengths(read(text.format(270)).moves)[0] == pytest.approx(1.5 * math.pi * 5 * MM)
    assert move_lengths(read(text.format(630)).moves)[0] == pytest.approx(3.5 * math.pi * 5 * MM)
    error = refused(text.format(90))
    assert error.line == 5 and "ANGLE says 90" in str(error)


CATIA = """\
$$ -----------------------------------------------------------------
$$     Generated on Tuesday
$$     CATIA APT VERSION 1.0
$$ -----------------------------------------------------------------
$$*CATIA0
$$ Part Operation.1
$$     1.00000     0.00000     0.00000    12.00000
$$     0.00000     1.00000     0.00000     0.00000
$$     0.00000     0.00000     1.00000     0.00000
PARTNO PART OPERATION.1
COOLNT/ON
CUTCOM/OFF
PPRINT TOOL = T1 END MILL D 10, A $ AND A / IN IT
$$ OPERATION NAME : Tool Change.1
$$ TOOLCHANGEBEGINNING
CUTTER/ 10.000000,  2.000000,  3.000000,  2.000000,  0.000000,$
         0.000000, 50.000000
TOOLNO/1,MILL,1,0,   14.106000,  100.000000,$
  100.000000,  100.000000,   20.000000,   15.000000,,   40.000000,$
 1000.000000,MMPM,   70.000000,RPM,CLW,$
ON,,NOTE
TPRINT/T1 End Mill D 10,T1 End Mill D 10,T1 End Mill D 10
LOADTL/1,1,1
$$ TOOLCHANGEEND
$$ OPERATION NAME : Multi-Axis Sweeping.1
FEDRAT/  300.0000,MMPM
SPINDL/   70.0000,RPM,CLW
MULTAX
RAPID
GOTO  /   10.00000,   20.00000,   50.00000, 0.000000, 0.000000, 1.000000
GOTO  /   10.00000,   20.00000,    0.00000, 0.000000, 0.000000, 1.000000
FEDRAT/ 1000.0000,MMPM
GOTO  /   30.00000,   20.00000,    0.00000, 0.173648, 0.000000, 0.984808
SPINDL/OFF
REWIND/0
END
FINI
"""
NX = """\
TOOL PATH/CAVITY_MILL_1,TOOL,MILL D10 R1
TLDATA/MILL,10.0000,1.0000,75.0000,0.0000,0.0000
MSYS/0.0000,0.0000,-50.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000
$$ centerline data
PAINT/PATH
PAINT/SPEED,10
LOAD/TOOL,62,ADJUST,62
SELECT/TOOL,62
SPINDL/RPM,3600,CLW
PAINT/COLOR,186
RAPID
GOTO/10.0000,20.0000,50.0000,0.0000000,0.0000000,1.0000000
PAINT/COLOR,42
FEDRAT/MMPM,300.0000
GOTO/10.0000,20.0000,0.0000
PAINT/COLOR,31
FEDRAT/1000.0000
GOTO/30.0000,20.0000,0.0000,0.1736482,0.0000000,0.9848078
PAINT/TOOL,NOMORE
END-OF-PATH
"""
CREO = """\
$$* Pro/CLfile  Version 10.0
$$-> MFGNO / PART
PARTNO / PART
$$-> FEATNO / 25
MACHIN / UNCX01, 1
$$-> CUTCOM_GEOMETRY_TYPE / OUTPUT_ON_CENTER
UNITS / MM
LOADTL / 1, OSETNO, 1
$$-> CUTTER / 10.000000
$$-> CSYS / 1.0000000000, 0.0000000000, 0.0000000000, 0.0000000000, $
 0.0000000000, 1.0000000000, 0.0000000000, 0.0000000000, $
 0.0000000000, 0.0000000000, 1.0000000000, 0.0000000000
MULTAX / ON
SPINDL / RPM, 3600.000000,  CLW
RAPID
GOTO / 10.0000000000, 20.0000000000, 50.0000000000, $
0.0000000000, 0.0000000000, 1.0000000000
FEDRAT / 300.000000,  MMPM
GOTO / 10.0000000000, 20.0000000000, 0.0000000000
FEDRAT / 1000.000000,  MMPM
GOTO / 30.0000000000, 20.0000000000, 0.0000000000, $
0.1736481777, 0.0000000000, 0.9848077530
SPINDL / OFF
MULTAX / OFF
$$-> END /
FINI
"""
AUTODESK = """\
MACHIN/generic
MODE/MILL
PARTNO/'1001'
PPRINT/'1001'

PPRINT/'NEW SECTION'
CSI_TOOL_PATH/Flow1
CSI_SET_PATH_PARAM/CSI_FORCE_TOOL_CHANGE=1

UNITS/MM
MULTAX/ON

PPRINT/'MATRIX DEFINITION'
MCS/1., 0., 0., $
0., 1., 0., $
0., 0., 1., $
0., 0., 0.

CUTTER/10., 0., 0., 0., 0., 0., 30.
CSI_SET_FLUTE_LENGTH/20.
LOADTL/1, 0, 30., 1
SPINDL/RPM,3600.,CLW
COOLNT/FLOOD
ZERO/1
RAPID
GOTO/10., 20., 50., 0., 0., 1.
FEDRAT/300., MMPM
GOTO/10., 20., 0., 0., 0., 1.
FEDRAT/1000., MMPM
GOTO/30., 20., 0., 0.173648178, 0., 0.984807753
COOLNT/OFF
END
FINI
"""


@pytest.mark.parametrize(("text", "tool"), [(CATIA, 1), (NX, 62), (CREO, 1), (AUTODESK, 1)])
def test_one_path_in_the_words_of_four_systems(text, tool):
    """Down by 50 at 300 mm/min, then 20 across at 1000 while the tool leans by 10 degrees. Numbers ours."""
    program = read(text)
    moves = program.moves
    assert set(moves.motion) == {FEED} and set(moves.tool) == {tool}
    np.testing.assert_allclose(move_lengths(moves), [50 * MM, 20 * MM])
    np.testing.assert_allclose(moves.feed, [300 * MM / 60, 1000 * MM / 60])
    np.testing.assert_allclose(np.degrees(moves.end[-1, 3:]), [0, 10, 0], atol=1e-4)
    assert not program.warnings


# -- closed cases --------------------------------------------------------------------------------------------------


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


tilt = st.tuples(st.floats(0, 80), st.floats(-180, 180)).map(lambda t: (math.radians(t[0]), math.radians(t[1])))


def leaning(angles) -> np.ndarray:
    away, around = angles
    return np.array([math.sin(away) * math.cos(around), math.sin(away) * math.sin(around), math.cos(away)])


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


# -- the words -----------------------------------------------------------------------------------------------------


def test_rapids_are_for_one_motion_and_from_is_where_the_tool_stands():
    moves = read(f"{START}FROM/0,0,100\nRAPID\nGOTO/0,0,5\nGOTO/0,0,0\nRAPID\nGODLTA/0,0,7\nGODLTA/1,0,0\n").moves
    assert list(moves.motion) == [RAPID, FEED, RAPID, FEED]
    np.testing.assert_allclose(moves.start[0, :3], [0, 0, 0.1])
    np.testing.assert_allclose(moves.end[:, 2], [0.005, 0, 0.007, 0.007])


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
    assert moves.tool_length[0] == pytest.approx(0.0508) and program.tools[0].diameter == pytest.approx(0.0127)
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
    tabled = read(text, tools={3: ToolEntry(3, 120.0, 6.0), 4: ToolEntry(4, 90.0)})
    np.testing.assert_allclose(tabled.moves.tool_length, [0.12, 0.09])
    assert [tool.number for tool in tabled.tools] == [3, 4] and tabled.tools[0].diameter == pytest.approx(0.006)


def test_lines_columns_and_labels():
    """Physical lines of the first part of a statement, whatever continues it."""
    program = read(
        "$$ head\n\nUNITS/MM\nN10 FEDRAT/100,MMPM\nL1) GOTO/0,$ $$ more\n 0,$\n0\nGOTO/1,$\n0,0\n\ngoto/2,0,0\n"
    )
    assert list(program.moves.line) == [8, 11]
    assert (program.dialect, program.interpreter) == ("cutter-location file", "builtin")
    error = refused("UNITS/MM\nFEDRAT/1\nGOTO/0,0,0\nGOTO/1,$\n  0,abc\n")
    assert (error.line, error.column) == (5, 5)


def test_file_ends_with_fini():
    program = read(f"{START}GOTO/0,0,0\nGOTO/1,0,0\nEND\nFINI\nGOTO/2,0,0\n")
    assert len(program.moves) == 1 and "FINI ends the file" in program.warnings[0]


def test_what_is_not_acted_upon_is_listed_once_with_its_count():
    program = read(
        f"{START}PAINT/COLOR,1\nGOTO/0,0,0\nPAINT/COLOR,2\nGOTO/1,0,0\nCOOLNT/ON\nAUXFUN/99\nAUXFUN/98\nFOOBAR/1,2\n"
    )
    listed = {word.word: word for word in program.unsupported}
    assert set(listed) == {"PAINT", "COOLNT", "AUXFUN", "FOOBAR"} and listed["PAINT"].line == 3
    assert "2 times" in listed["PAINT"].reason
    assert len(program.warnings) == 2 and "line 8" in program.warnings[0] and "FOOBAR" in program.warnings[1]


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
        ("CUTCOM/LEFT,1", 3, "cutter compensation"),
        ("CALSUB/5", 3, "CALSUB"),
        ("TLRGT,GORGT/L1", 3, "TLRGT"),
        ("RETRCT", 3, "retracts"),
        ("CYCLE/TAP,10,IPM,2", 3, "CYCLE/TAP"),
        ("CYCLE/DRILL, 126.0, 85.0, 1.0,MMPR", 3, "order hangs on"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2,RAPTO,1", 3, "RAPTO"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2,RETURN,0", 3, "RETURN,0"),
        ("CYCLE/DRILL,DEEP,STEP,20,CLEAR,3,FEDTO,-72,RTRCTO,AUTO,MMPM,250", 3, "AUTO"),
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
        ("1,2,3", 3, "no statement"),
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
        ("MODE/TURN", 3, "not milling"),
        ("CUTCOM/ON,LEFT", 3, "cutter compensation"),
        ("RAPD0", 3, "may move the tool"),
        ("GOT/1,2,3", 3, "may move the tool"),
        ("STRANGE/1,2,3", 3, "may move the tool"),
        ("CYCLE/DRILL,DEPTH,5,MMPM,100,CLEAR,2\nRAPID", 4, "is the next point a hole"),
        ("ZERO/1\nGOTO/0,0,0\nZERO/2", 5, "another coordinate system"),
        ("G1 X10 Y5", 3, "no statement"),
        ("%", 3, "no statement"),
    ],
)
def test_refusals_name_word_and_line(text, line, words):
    with pytest.raises(InputError, match=words) as caught:
        read(START + text + "\n")
    assert caught.value.line == line and caught.value.column is not None and caught.value.file == "part.apt"


def test_units_must_be_certain():
    assert "inches" in str(refused("FEDRAT/10,IPM\nGOTO/0,0,0\nGOTO/1,0,0\n"))
    assert refused("FEDRAT/10\nGOTO/0,0,0\nGOTO/1,0,0\nUNITS/INCHES\n").line == 4
    assert any("taken as mm" in text for text in read("FEDRAT/10\nGOTO/0,0,0\nGOTO/1,0,0\n").assumptions)


def test_arcs_that_turn_the_other_way_are_noticed():
    """A path that goes up into an arc and would turn back there: the file means the axis the other way round."""
    text = f"{START}GOTO/10,-5,0\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,{{}},10\nGOTO/0,10,0\n"
    assert not read(text.format(1)).warnings
    assert "turns back" in read(text.format(-1)).warnings[0]


def test_no_cut_is_an_error():
    assert "no cutting move" in str(refused("UNITS/MM\nRAPID\nGOTO/0,0,0\nRAPID\nGOTO/1,0,0\n"))


# -- against G code ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cycle", "code"),
    [
        ("DRILL,DEPTH,12,MMPM,80,CLEAR,2", "G81 R2 Z-12"),
        ("DRILL,DEPTH,12,MMPM,80,CLEAR,2,DWELL,1.5", "G82 R2 Z-12 P1.5"),
        ("DEEP,DEPTH,12,STEP,5,MMPM,80,CLEAR,2", "G83 R2 Z-12 Q5"),
        ("DRILL,DEEP,FEDTO,-12,STEP,5,MMPM,80,CLEAR,2", "G83 R2 Z-12 Q5"),
        ("BRKCHP,DEPTH,12,INCR,5,MMPM,80,CLEAR,2", "G73 R2 Z-12 Q5"),
    ],
)
def test_holes_as_g_code_drills_them(cycle, code):
    """In upright holes the strokes are those of the canned cycles, which are held against LinuxCNC's."""
    ours = read(
        f"UNITS/MM\nFEDRAT/500\nFROM/0,0,30\nCYCLE/{cycle}\nGOTO/10,0,0\nGOTO/20,5,0\nCYCLE/OFF\nRAPID\nGOTO/20,5,30\n"
    ).moves
    theirs = parse_program(f"G0 Z30\nG99 {code} X10 Y0 F80\nX20 Y5\nG80\nG0 Z30\n").moves
    theirs = theirs.take(slice(1, None))  # without the way up to Z30
    np.testing.assert_allclose(ours.end, theirs.end, atol=1e-12)
    np.testing.assert_array_equal(ours.motion, theirs.motion)
    np.testing.assert_allclose(ours.feed, theirs.feed)
    np.testing.assert_allclose(ours.dwell, theirs.dwell)


def test_tilted_holes_go_along_the_tool():
    moves = read(
        f"{START}GOTO/0,0,20,0,.6,.8\nCYCLE/DRILL,DEPTH,10,MMPM,80,CLEAR,3\nGOTO/0,0,0\nCYCLE/OFF\nGOTO/0,0,30\n"
    ).moves
    drill = moves.take(moves.motion == CYCLE)
    np.testing.assert_allclose(drill.start[0, :3], MM * 3 * np.array([0, 0.6, 0.8]), atol=1e-15)
    np.testing.assert_allclose(drill.end[0, :3], -MM * 10 * np.array([0, 0.6, 0.8]), atol=1e-15)


number = st.floats(-200, 200).map(lambda v: round(v, 3))
vectors = tilt.map(leaning)


@st.composite
def paths(draw):
    """Steps of a path: rapid, cut, arc in XY, each with an axis or without."""
    steps = []
    for _ in range(draw(st.integers(2, 8))):
        kind = draw(st.sampled_from(["rapid", "cut", "feed", "arc"]))
        if kind == "feed":
            steps.append(("feed", draw(st.integers(1, 5000))))
        elif kind == "arc":
            steps.append(("arc", draw(st.integers(1, 50)), draw(st.sampled_from([1, -1])), draw(st.integers(5, 355))))
        else:
            axis = draw(st.none() | vectors)
            steps.append((kind, draw(number), draw(number), draw(number), axis))
    return steps


def written(steps, value, words, ending="\n", inch=False):
    """A path as statements; `value` formats numbers, `words` joins a word and its arguments."""
    unit = 25.4 if inch else 1.0
    lines = [words("UNITS", ["INCHES" if inch else "MM"]), words("FEDRAT", [value(100 / unit)])]
    point = [0.0, 0.0, 0.0]
    lines.append(words("FROM", [value(0.0)] * 3))
    for step in steps:
        if step[0] == "feed":
            lines.append(words("FEDRAT", [value(float(step[1])), "MMPM"]))
        elif step[0] == "arc":
            _, radius, sense, degrees = step
            center = [point[0] - radius, point[1], point[2]]
            turn = math.radians(sense * degrees)
            point = [center[0] + radius * math.cos(turn), center[1] + radius * math.sin(turn), point[2]]
            given = [*(v / unit for v in center), 0.0, 0.0, float(sense), radius / unit]
            lines.append(words("CIRCLE", [value(v) for v in given]))
            lines.append(words("GOTO", [value(v / unit) for v in point]))
        else:
            kind, x, y, z, axis = step
            point = [x, y, z]
            if kind == "rapid":
                lines.append("RAPID")
            axis = [] if axis is None else list(axis)
            lines.append(words("GOTO", [*(value(v / unit) for v in point), *(value(v) for v in axis)]))
    return ending.join([*lines, words("GODLTA", [value(0.0), value(0.0), value(1 / unit)]), "FINI", ""])


@given(paths(), st.randoms(use_true_random=False), st.booleans())
def test_the_same_path_however_it_is_written(steps, chance, inch):
    """Blanks, exponents, continuations, comments, case, inches and ends of lines do not change a path."""

    def plainly(v):
        return f"{v:.9f}"

    def freely(v):
        text = chance.choice([f"{v:.9f}", f"{v:+.10f}", f"{v:.12E}", f"{v:.12e}".replace("e", "D"), f"{v:.9f}000"])
        return text if "." not in text or abs(v) >= 1 or "E" in text.upper() else text.replace("0.", ".", 1)

    def plain(word, arguments):
        return f"{word}/{','.join(arguments)}"

    def free(word, arguments):
        blank = chance.choice(["", " ", "   ", "\t"])
        text = chance.choice([word, word.lower()]) + blank + "/"
        for i, argument in enumerate(arguments):
            if i:
                text += "," + chance.choice(["", " ", "$\n  ", "$ $$ a remark, with GOTO/1,2,3\n"])
            text += blank + argument
        return (
            chance.choice(["", "$$ remark\n", "\n", "PPRINT what, $ ever / it says\n"])
            + text
            + chance.choice(["", "  "])
        )

    def moves_of(text):  # without moves that are the rounding of a number written twice
        moves = read(text).moves
        return moves.take((moves.arc_sweep != 0) | (np.abs(moves.end - moves.start).max(axis=1) > 1e-8))

    first = moves_of(written(steps, plainly, plain))
    second = moves_of(written(steps, freely, free, chance.choice(["\n", "\r\n", "\r"]), inch))
    np.testing.assert_array_equal(first.motion, second.motion)
    np.testing.assert_allclose(first.end, second.end, atol=2e-9)
    np.testing.assert_allclose(
        first.arc_sweep * first.arc_normal[:, 2], second.arc_sweep * second.arc_normal[:, 2], atol=1e-6
    )
    np.testing.assert_allclose(first.feed, second.feed, rtol=1e-6)


@given(paths())
def test_the_same_path_as_g_code(steps):
    """Without tool axes a path is the same as in G0, G1, G2, G3."""
    steps = [step if step[0] in ("arc", "feed") else (*step[:4], None) for step in steps]
    lines, point = ["G21 G90 G94 F100"], [0.0, 0.0, 0.0]
    for step in steps:
        if step[0] == "feed":
            lines.append(f"F{step[1]}")
        elif step[0] == "arc":
            _, radius, sense, degrees = step
            turn = math.radians(sense * degrees)
            end = [point[0] - radius + radius * math.cos(turn), point[1] + radius * math.sin(turn)]
            lines.append(f"{'G3' if sense > 0 else 'G2'} X{end[0]:.9f} Y{end[1]:.9f} I{-radius} J0")
            point[:2] = end
        else:
            point = list(step[1:4])
            lines.append(f"{'G0' if step[0] == 'rapid' else 'G1'} X{point[0]:.3f} Y{point[1]:.3f} Z{point[2]:.3f}")
    lines.append("G91 G1 Z1")
    ours = read(written(steps, lambda v: f"{v:.9f}", lambda word, arguments: f"{word}/{','.join(arguments)}")).moves
    theirs = parse_program("\n".join(lines)).moves
    np.testing.assert_array_equal(ours.motion, theirs.motion)
    np.testing.assert_allclose(ours.end, theirs.end, atol=2e-9)
    np.testing.assert_allclose(
        ours.arc_sweep * ours.arc_normal[:, 2], theirs.arc_sweep * theirs.arc_normal[:, 2], atol=1e-6
    )
    np.testing.assert_allclose(ours.feed, theirs.feed)
