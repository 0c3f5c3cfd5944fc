"""Cutter-location files of CAM systems: published examples, and one path in the words of four systems."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.nc.cutter_location import MM, START, read, refused
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED
from toolpath_stiff.path.sampling import sample_moves


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


def test_a_slot_that_creo_wrote():
    """One level of `profilfräsen_2.ncl.2` of github.com/MichaHofft/CreoPost: a rectangle, corners of 1.5 mm."""
    corners = [((0, 0), (1.5, 0)), ((0, -33), (0, -34.5)), ((-24, -33), (-25.5, -33)), ((-24, 0), (-24, 1.5))]
    starts = [(0, 1.5), (1.5, -33), (-24, -34.5), (-25.5, 0)]
    text = "UNITS / MM\nRAPID \nGOTO / 0.0000000000, 1.5000000000, 2.0000000000\nFEDRAT / 400.000000,  MMPM\n"
    for start, (center, end) in zip(starts, corners, strict=True):
        text += f"GOTO / {start[0]:.10f}, {start[1]:.10f}, -1.5000000000\n"
        text += f"CIRCLE / {center[0]:.10f}, {center[1]:.10f}, -1.5000000000,  $\n"
        text += "0.0000000000, 0.0000000000, -1.0000000000,  1.5000000000\n"
        text += f"GOTO / {end[0]:.10f}, {end[1]:.10f}, -1.5000000000\n"
    program = read(text + "GOTO / 0.0000000000, 1.5000000000, -1.5000000000\nSPINDL / OFF\n$$-> END / \nFINI \n")
    down, *around = move_lengths(program.moves)
    assert down == pytest.approx(3.5 * MM)
    assert sum(around) == pytest.approx((2 * 33 + 2 * 24 + math.tau * 1.5) * MM)
    assert all("LOADTL without a length" in remark.text for remark in program.warnings)


def corner_angles(program) -> np.ndarray:
    """Degrees by which the path turns where one move meets the next."""
    samples = sample_moves(program.moves, step=1 * MM)
    joins = np.flatnonzero(np.diff(samples.move))
    cosines = np.einsum("ni,ni->n", samples.tangent[joins], samples.tangent[joins + 1])
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def test_a_contour_that_nx_wrote_goes_on_smoothly():
    """From `_1_KONTUR_NAR_40_N2.cls` of github.com/HumMan/CLSFProcessor: arcs both ways, to 0.0001 mm.

    Read by the other hand, every arc would turn back where it begins.
    """
    program = read(
        "TOOL PATH/8_KONTUR_NAR_40_N2,TOOL,FACE_MILL_1\n"
        "MSYS/393.0000,-297.5000,3.0000,0.0000000,1.0000000,0.0000000,1.0000000,0.0000000,0.0000000\n"
        "FEDRAT/MMPM,621.0000\nGOTO/741.2841,-9.9637,466.0000,0.0000000,0.0000000,1.0000000\nPAINT/COLOR,31\n"
        "GOTO/1221.5423,14.3929,466.0000\n"
        "CIRCLE/1245.5000,-458.0000,466.0000,0.0000000,0.0000000,1.0000000,473.0000,0.0600,0.5000,40.0000,1.0000\n"
        "GOTO/1563.1794,-107.5591,466.0000\n"
        "CIRCLE/1749.2200,97.6673,466.0000,0.0000000,0.0000000,-1.0000000,277.0000,0.0600,0.5000,40.0000,1.0000\n"
        "GOTO/1597.8754,-134.3323,466.0000\n"
        "CIRCLE/1749.3435,97.9506,466.0000,0.0000000,0.0000000,-1.0000000,277.3047,0.0600,0.5000,40.0000,1.0000\n"
        "GOTO/1682.2255,-171.1090,466.0000\nGOTO/1688.9327,-172.7813,466.0000\nGOTO/1889.9378,-222.8975,466.0000\n"
        "CIRCLE/1884.3736,-245.2143,466.0000,0.0000000,0.0000000,1.0000000,23.0000,0.0600,0.5000,40.0000,1.0000\n"
        "GOTO/1906.6904,-250.7786,466.0000\nGOTO/1899.7068,-278.7886,466.0000\nPAINT/TOOL,NOMORE\nEND-OF-PATH\n"
    )
    assert all("LOADTL without a length" in remark.text for remark in program.warnings)
    assert np.abs(program.moves.arc_sweep).max() < math.pi
    assert corner_angles(program).max() < 0.2


def test_arcs_without_a_radius():
    """From `basemach.apt` of github.com/aamorim1913/AptPostProcessor: `UNIT/`, `RAPID/`, circles of six numbers."""
    program = read(
        "PARTNO/1\nUNIT/MM\nCUTTER/8.,0,4.,0,0,0,40.\nLOAD/TOOL,17\nCSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0\nRAPID/\n"
        "GOTO/46.615938,17.969848,-4.\nFEDRAT/190.023753,MMPM\nGOTO/50.292893,14.292893,-4.\nCIRCLE/51.,15.,-4.,0,0,1.\n"
        "GOTO/51.,14.,-4.\nFEDRAT/253.365004,MMPM\nGOTO/56.,14.,-4.\nFINI\n"
    )
    assert corner_angles(program).max() < 0.01
    assert move_lengths(program.moves)[1] == pytest.approx(math.pi / 4 * MM, rel=1e-5)


def test_holes_that_creo_wrote():
    """`bohren_1.ncl.8` of github.com/MichaHofft/CreoPost: pecks of 1 mm from 1 mm above each hole."""
    program = read(
        "UNITS / MM\nLOADTL / 1\nSPINDL / RPM, 9000.000000,  CLW\nRAPID \n"
        "GOTO / -7.2290790757, -23.0000000000, 2.0000000000\n"
        "CYCLE / DEEP, DEPTH, 3.500000, STEP, 1.000000, MMPM, 50.000000, CLEAR,$\n 1.000000\n"
        "GOTO / -7.2290790757, -23.0000000000, 0.5000000000\nGOTO / -16.7803891180, -23.0000000000, 0.5000000000\n"
        "CYCLE / OFF\nRAPID \nGOTO / -16.7803891180, -23.0000000000, 2.0000000000\nSPINDL / OFF\n$$-> END / \nFINI \n"
    )
    moves = program.moves
    assert moves.end[moves.motion == CYCLE, 2].min() == pytest.approx((0.5 - 3.5) * MM)
    assert len(moves.take(moves.motion == CYCLE)) == 2 * 5  # from 1.5 to -3 in pecks of 1
    assert moves.end[moves.line == 8][0, 2] == pytest.approx(1.5 * MM)  # across to the second hole, 1 mm above it


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
    assert all("LOADTL without a length" in remark.text for remark in program.warnings)
