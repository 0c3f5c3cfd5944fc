"""Programs as posts of hobby and industry write them: each is read, to the path that stands beside it.

Written from what these posts put out (headers, comments, settings, pauses), with one line, one arc and a retract.
"""

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import read_block

CUT = "G1 Z-1. F300.\nX20. F500.\nG2 X22. Y2. I0. J2.\nG0 Z15.\n"  # from X10 Y0
CUT_PATH = "F 10 0 -1; F 20 0 -1; A 22 2 -1; R 22 2 15"
TOOLS = Controller(tools={number: ToolEntry(number, length=0.0, diameter=6.0) for number in range(1, 6)})
PROGRAMS = {  # post -> before the cut, behind it, the moves before it, the pauses in s
    "Fusion, grbl": (
        "(1001)\n(T1  D=6. CR=0. - flat end mill)\nG90 G94\nG17\nG21\nG28 G91 Z0.\nG90\n\n(2D Contour1)\nM9\n"
        "T1 M6\nS5000 M3\nG54\nM8\nG0 X10. Y0.\nZ15.\n",
        "M5\nG28 G91 Z0.\nG90\nG28 G91 X0. Y0.\nG90\nM30\n",
        "R 10 0 0; R 10 0 15", "R 22 2 0; R 0 0 0", 0.0,
    ),
    "HSMWorks, Haas": (
        "%\nO01001 (TEST)\n(T1 D=6. - FLAT END MILL)\nN10 G90 G94 G17\nN15 G21\nN25 T1 M6\nN30 S5000 M3\nN35 G54\n"
        "N40 M8\nN45 G0 X10. Y0.\nN50 G43 Z15. H1\n",
        "N85 M5\nN90 M9\nN105 M30\n%\n", "R 10 0 0; R 10 0 15", "", 0.0,
    ),
    "Estlcam": (
        "(Projekt Test)\n(Erstellt mit Estlcam Version 11)\nG00 Z15.0000\nM03 S24000\nG00 X10.0000 Y0.0000\n",
        "M05\nM30\n", "R 0 0 15; R 10 0 15", "", 0.0,
    ),
    "Vectric, Mach3": (
        "( Test )\n( Mach2/3 Arcs(mm) )\nN10 G00G21G17G90G40G49G80\nN20 G71G91.1\nN30 T1M06\nN40 G00G43Z15.000H1\n"
        "N50 S12000M03\nN70 ()\nN80 G94\nN90 X0.000Y0.000F1000.0\nN100 G00X10.000Y0.000\n",
        "N170 M09\nN180 M30\n%\n", "R 0 0 15; R 10 0 15", "", 0.0,
    ),
    "Vectric, grbl": ("T1\nG17\nG21\nG90\nG0Z15.000\nG0X0.000Y0.000\nS16000M3\nG0X10.000\n", "M30\n",
                      "R 0 0 15; R 10 0 15", "", 0.0),
    "CamBam, Mach3": (
        "( Made using CamBam )\n( T0 : 3.0 )\nG21 G90 G64 G40\nG0 Z15.0\nT0 M6\nG17\nM3 S1000\n"
        "G0 X10.0 Y0.0\n", "M5\nM30\n", "R 0 0 15; R 10 0 15", "", 0.0,
    ),
    "Marlin": (
        "; Post: Marlin\nG21\nG90\nM84 S0\nG92 X0 Y0 Z0\nM0 Attach the probe\nM117 Milling\nM3 S255\nG0 Z15.000 F1500\n"
        "G0 X10.000 F3000\nG4 S2\nM400\n", "M107\nM5\nM84\nM2\n", "R 0 0 15; R 10 0 15", "", 2.0,
    ),
    "TinyG": ("(tinyg)\nG21\nG17\nG90\nG64\n$xvm=1000\nG0 Z15\nM3 S1000\nG0 X10Y0\n", "M5\nM2\n",
              "R 0 0 15; R 10 0 15", "", 0.0),
    "FreeCAD, LinuxCNC": (
        "(Exported by FreeCAD)\n(begin preamble)\nG17 G54 G40 G49 G80 G90\nG21\n(machine units: mm/min)\nG54 \n"
        "( TC: Default Tool )\nM5\nM6 T1\nG43 H1\nM3 S1000\n(Profile)\nG0 Z15.000 \nG0 X10.000 Y0.000 \n",
        "M05\nG17 G54 G90 G80 G40\nM2\n", "R 0 0 15; R 10 0 15", "", 0.0,
    ),
    "FreeCAD, grbl": (
        "(Exported by FreeCAD)\nG17 G90\nG21\nG54\n; ( M6 T1 )\nM3 S1000\nG0 Z15.000\nG0 X10 Y0\nG98\n"
        "; ( G81 X5.000 Y5.000 Z-5.000 F75.000 R5.000 )\n", "; ( G80 )\nM5\nM2\n", "R 0 0 15; R 10 0 15", "", 0.0,
    ),
    "Carveco, Fanuc": (
        "%\n:1248\nG40 G17 G80 G49\nG0 G90 G54\nT1 M6\nG90 G54\nG0 X10.000 Y0.000 S12000 M3\nG43 Z15.000 H1\nM8\n",
        "M9\nG49 H0\nM30\n%\n", "R 10 0 0; R 10 0 15", "", 0.0,
    ),
    "Fagor 8055": (
        "%PIEZA,MX--,\nN10 G0 G71 G90 G54\nN20 T1.1\nN30 S1500 M3\nN40 G0 X10 Y0 Z15\nN50 G4 K150\n", "N100 M30\n",
        "R 10 0 15", "", 1.5,
    ),
    "pauses": ("G21 G90\nG0 X10 Y0 Z15\nG4 P0.5\nG4 X1.5\nG4 S2\nG4 K200\nG4 F3\n", "M2\n", "R 10 0 15", "", 9.0),
}  # fmt: skip


@pytest.mark.parametrize("post", PROGRAMS)
def test_what_a_post_writes_is_read(post):
    before, behind, to_it, from_it, pauses = PROGRAMS[post]
    moves = parse_program(before + CUT + behind, "part.nc", controller=TOOLS).moves
    shown = [
        f"{'RFAC'[kind]} " + " ".join(f"{v * 1e3:.6g}" for v in end[:3] + 0.0)
        for kind, end in zip(moves.motion, moves.end, strict=True)
    ]
    assert "; ".join(shown) == "; ".join(filter(None, (to_it, CUT_PATH, from_it)))
    assert moves.dwell.sum() == pytest.approx(pauses) and set(moves.feed[moves.motion == 1] * 6e4) == {300.0, 500.0}


@pytest.mark.parametrize(("line", "words"), [("%A,MX--,", 0), ("%000001,-MX-,", 0), ("T1.2 M6", 3), ("M117 Ready", 1)])
def test_words_of_headers_and_messages(line, words):
    assert len(read_block(line, 1, "p.nc").words) == words


@pytest.mark.parametrize("line", ["%G0 X5", "$H", "%name", '{"gc":"G0 X5"}', "G4 K1 X5", "M117X"])
def test_what_may_hide_a_move_is_refused(line):
    with pytest.raises(InputError):
        parse_program(f"G21 F100\n{line}\nG1 X1\n", "p.nc")


def test_a_long_pause_is_doubted():
    program = parse_program("G21 F100\nG1 X1\nG4 P500\nG1 X2\n", "p.nc")
    assert program.moves.dwell.sum() == 500.0 and "milliseconds" in program.warnings[0].text


SAVED = {
    "M70 and M72": "G21 G90 F612.37\nG0 X0 Y0 Z5\nM70\nG20 G91 F5 G55\nG1 X1\nM72\nG1 X0\nM2\n",
    "M73 in a subprogram": "G21 G90 F600\nG0 Z5\nM98 P100\nG1 X5\nM2\nO100\nM73\nG91 F100 G20\nG1 X1\nM99\n",
    "M73 in a sub": "o<x> sub\nM73\nG91 G18 F9\nG1 X3\no<x> endsub\nG21 G90 F600\nG0 Z5\no<x> call\nG2 X13 I5 J0\nM2\n",
    "M73, M72": "G21 G90 F600\nG0 Z5\nM73\nG91 G55 F100\nG1 X5\nM72\nG1 X50\nM71\nG1 X1\nM2\n",
}
SAVED_ENDS = {"M70 and M72": (0.0, 612.4), "M73 in a subprogram": (5.0, 600.0), "M73 in a sub": (13.0, 600.0),
              "M73, M72": (1.0, 600.0)}  # fmt: skip


@pytest.mark.parametrize("name", SAVED)
def test_modes_saved_and_restored_as_linuxcnc_restores_them(name):
    """Ends and feeds are those of rs274 2.9 for these programs."""
    moves = parse_program(SAVED[name], "p.ngc").moves
    assert (moves.end[-1, 0] * 1e3, moves.feed[-1] * 6e4) == pytest.approx(SAVED_ENDS[name])
