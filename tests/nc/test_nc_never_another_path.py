"""Programs that a random hunt found to be read otherwise by LinuxCNC's interpreter: now the same, or refused.

`python -m benchmarks.hunt` made them; each is the shortest one that shows its difference.
"""

from __future__ import annotations

import pytest

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import TABLE_OURS, TABLE_RS274, assert_same_path
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.reader import read_program

REFUSED = {
    "G43.1 moves to its Z too": ("F100\nG43.1 Z5 G1\nX1", "both use the axis words"),
    "a cycle's heights in the other unit": ("F100 G0 Z30\nG99 G81 X1 Y1 Z-5 R14\nG20 X1", "between G20 and G21"),
    "the level of a run in the other unit": (
        "F100 G0 Z30\nG98 G81 X1 Y1 Z-5 R14\nG20 F10 G82 X1 Z-.1 R.2 P1",
        "between G20 and G21",
    ),
    "G43 after M61": ("F100 T1 M6\nM61 Q2\nG43 G1 X1 Z1", "without H after M61"),
    "H0": ("F100 T1 M6\nG43 H0 G1 X1 Z1", "is no offset on some controls"),
    "a length in the other unit": ("F100 G43 H1\nG20 F5 G1 X1", "G49 before it"),
    "a length changed just before M6": ("F100 G1 X2\nG43 H3\nT2 M6\nG1 X4", "a cut before any Z"),
    "two codes that act once": ("F100 G1 X2\nG92.1 Z-9 G52\nG1 X3 Z3", "one of them in a block"),
    "a length changed just before M61": ("F100 G1 X2\nG43.1 Z5\nM61 Q1\nG1 X4", "a cut before any Z"),
    "a length changed just before M6, then G92": ("F100 G1 X2\nG43 H3\nT2 M6\nG92 Z0\nG0 Z3\nG1 X5", "present height"),
    "a length changed just before M6, then L20": (
        "F100 G1 X2\nG43 H3\nT2 M6\nG10 L20 P1 Z0\nG0 Z3\nG1 X5",
        "present height",
    ),
    "a length changed just before M6, then G28.1": ("F100 G1 X2\nG43 H3\nT2 M6\nG28.1\nG0 Z3\nG1 X5", "present height"),
    "a turned offset just before M6": ("F100 G10 L2 P2 R-45\nG0 X3 Y3\nG55\nM6\nG0 Y-7\nG1 X5 Y5", "both X"),
    "a turned zero moved just before M61": (
        "F100 G10 L2 P1 R20\nG1 X3 Y3\nG10 L20 P1 X5 Y5\nM61 Q1\nG91 G1 X5 Y5",
        "both X",
    ),
    "the active offset turned, then G92": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nM61 Q1\nG92 X5\nG1 X3 Y3", "turned"),
    "the active offset turned, then L20": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG10 L20 P2 Y5\nG1 X3 Y3", "turned"),
    "the active offset turned, then G53": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nM61 Q1\nG53 G1 Y0\nG1 X3 Y3", "turned"),
    "the active offset turned, then G28": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG28 Z5\nG1 X3 Y3", "turned"),
    "the active offset turned, then G28.1": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG28.1\nG1 X3 Y3", "turned"),
    "a length changed just before M6, then Z in G91": (
        "F100 G0 Z5\nG43 H3\nT2 M6\nG91 G0 Z-5\nG1 X3",
        "a cut before any Z",
    ),
    "a length changed just before M6, then G1 alone": (
        "F100 G0 X2\nG43.1 Z-3\nT2 M6\nG1\nG0 Z3\nG1 X3",
        "a cut before any Z",
    ),
    "the active offset turned": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG1 Z3", "name both X"),
    "the active offset turned, X alone": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG1 X3", "name both X"),
    "the active offset turned, in G91": ("F100 G1 X5 Y5\nG10 L2 P1 R30\nG91 G1 X3 Y3", "name both X"),
}
SAME = {
    "a turned offset before M6, then X and Y": "F100 G10 L2 P2 R-45\nG0 X3 Y3\nG55\nM6\nG0 X1 Y-7\nG1 X5",
    "a turned offset, a move, M6": "F100 G10 L2 P2 R-45\nG0 X3 Y3\nG55\nG0 X1\nM6\nG0 Y-7\nG1 X5",
    "G49 of no length before M6": "F100 G1 X2\nG49\nT2 M6\nG1 X3",
    "a length changed before M6, then cycles": "F100 G1 X2\nG43 H3\nT2 M6\nG98 G89 P1 X1 Z-1 R2\nG80 G1 X3",
    "a length changed before M6, then G52": "F100 G1 X2\nG43 H3\nT2 M6\nG52 Z5\nG0 Z3\nG1 X3",
    "E of M66 to M68 is no exponent": "F100 G1 X2\nM67 Q2E1\nM68E0Q1\nG1 X3",
    "a length changed before M6, then Z": "F100 G1 X2\nG43 H3\nT2 M6\nG0 X4\nG0 Z3\nG1 X5",
    "a length changed before M6, then G53 Z": "F100 G1 X2\nG43 H3\nT2 M6\nG53 G0 Z3\nG1 X5",
    "the active offset turned, then X and Y": "F100 G1 X5 Y5\nG10 L2 P1 R30\nG1 X3 Y3\nX7",
    "another offset turned": "F100 G1 X5 Y5\nG10 L2 P2 R30\nG1 X3\nG55 G1 X7",
    "units changed between two runs of cycles": "F100 G0 Z30\nG81 X1 Y1 Z-5 R14\nG80 G20 F5\nG81 X1 Z-.1 R.2",
}


def lines_of(text: str, folder, name: str = "part.ngc"):
    program = folder / name
    program.write_text(text + "\nM2\n")
    table = folder / "ours.tbl"
    table.write_text(TABLE_OURS)
    return program, table


@pytest.mark.parametrize("text, words", REFUSED.values(), ids=REFUSED)
def test_what_linuxcnc_reads_otherwise_is_refused(text, words, tmp_path):
    program, table = lines_of(text, tmp_path)
    with pytest.raises(InputError, match=words) as error:
        read_program(program, tool_table=table)
    assert error.value.line


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
def test_what_is_near_to_it_is_read_alike(text, tmp_path):
    program, table = lines_of(text, tmp_path)
    canon = rs274.run(program, tmp_path, TABLE_RS274)
    assert not canon.error
    feeds = [move for move in canon.moves if move[0] != "rapid"]
    read = read_program(program, tool_table=table)
    assert_same_path(only_feeds(read), rs274.Canon(feeds))


def only_feeds(program):
    from dataclasses import replace

    from toolpath_stiff.nc.moves import RAPID

    return replace(program, moves=program.moves.take(program.moves.motion != RAPID))
