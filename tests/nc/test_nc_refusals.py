"""What the reader refuses: file, line and column, what was found, what to do. Each row is one program."""

from __future__ import annotations

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.tables import read_offsets

REFUSALS = [
    ("G77 X1", 1, 1, "not a G code"),
    ("G1 F100 X1\nG1 G2 X2", 2, 4, "modal group"),
    ("G90 G91 X1", 1, 5, "modal group"),
    ("M3 M4", 1, 4, "modal group"),
    ("G1 F100 X1 X2", 1, 12, "repeats"),
    ("G1 F100 (pocket\nX1", 1, 9, "not closed"),
    ("G1 F100 (a (b c) X1", 1, 9, "is not closed"),
    ("G1 F100 X1)", 1, 11, "without"),
    ("G1 F100 Xnan", 1, 9, "no number"),
    ("G1 F100 X1e999", 1, 9, "not a finite number"),
    ("G1 F100 Xinf", 1, 9, "no number"),
    ("G1 F100 X", 1, 9, "no number"),
    ("G1 F100 X1\x00", 1, 11, "binary byte"),
    ("G0 X1\nG1 X2", 2, 1, "before any feed"),
    ("G1 F0 X2", 1, 1, "before any feed"),
    ("G1 F-10 X2", 1, 4, "no feed that moves"),
    ("F100\nG2 X10 I4", 2, 1, "off its circle"),
    ("F100\nG2 X10 R2", 2, 1, "cannot reach"),
    ("F100\nG2 X0 Y0 R2", 2, 1, "ends where it starts"),
    ("F100\nG2 X10", 2, 1, "without a centre"),
    ("F100\nG2 X10 I5 R5", 2, 11, "both given"),
    ("F100\nG2 X10 I5 K1", 2, 11, "off the plane"),
    ("F100\nG2 X10 I5 P0.5", 2, 11, "not a count"),
    ("#1=", 1, 3, "without a value"),
    ("G1 F100 X#1", 1, 11, "read before it is set"),
    ("G1 F100 X[1+2", 1, 10, "not closed"),
    ("G1 F100 X-[1+/2]", 1, 14, "not a value"),
    ("G1 F100 X-#", 1, 11, "the block ends here"),
    ("G1 F100 X1 E2", 1, 12, "not used"),  # two words, not X100
    ("G1 F100 X\N{FULLWIDTH DIGIT ONE}", 1, 9, "not a word"),
    ("G1 F100 \N{LATIN SMALL LETTER DOTLESS I}1", 1, 9, "not a word"),
    ("O100 sub", 1, None, "has no end"),
    ("O<thing> call", 1, 1, "no such sub"),
    ("M98 P100", 1, 1, "no such subprogram"),
    ("G65 P100", 1, 1, "no program O100"),
    ("G41 D1 X1", 1, 1, "cutter compensation"),
    ("G1 F100 @5", 1, 9, "polar word of LinuxCNC"),
    ("G91 ^30", 1, 5, "--interpreter linuxcnc"),
    ("G5.1 I1 J1", 1, 1, "spline"),
    ("G38.2 Z-5", 1, 1, "probing"),
    ("G88 Z-5 R1", 1, 1, "manual feed out"),
    ("G1 F100 U1", 1, 9, "axis that this machine does not have"),
    ("G1 F100 X1e7", 1, 9, "beyond 100 m"),
    ("X1", 1, 1, "motion mode"),
    ("G43 H1", 1, 1, "--tools"),
    ("F100\nG81 X1 Z-5", 2, 1, "without R"),
    ("F100\nG81 X1 R5", 2, 1, "without Z"),
    ("F100\nG83 X1 Z-5 R5", 2, 1, "without a peck"),
    ("F100\nG82 X1 Z-5 R5", 2, 1, "without its dwell"),
    ("F100\nG81 X1 Z5 R1", 2, 1, "below the bottom"),
    ("F100\nG81 X1 Z-5 R1 L20000", 2, 15, "number of repeats"),
    ("G4 F2 X5", 1, 7, "may count milliseconds"),
    ("G4 P-1", 1, 1, "needs its time"),
    ("G10 L2 P12 X1", 1, 1, "needs the number of a tool or a work offset"),
    ("G10 L5 P1", 1, 1, "with L5"),
    ("G53 X1", 1, 5, "motion mode"),
    ("G91 G53 G0 X1", 1, 5, "incremental"),
    ("G28 G92 X1", 1, 5, "act once"),
    ("G0 G92 X1", 1, 4, "axis words"),
    ("G1 F100 X1 K4", 1, 12, "not used"),
    ("G1 F100 X1 N5", 1, 12, "line number"),
    ("G95 F0.1\nG1 X5", 2, 1, "S0"),
    ("G93\nG1 X5", 2, 1, "without F"),
]


@pytest.mark.parametrize(("text", "line", "column", "words"), REFUSALS)
def test_refusals_name_line_and_column(text, line, column, words):
    with pytest.raises(InputError) as caught:
        parse_program(text + "\nG1 F100 X1 Y1\n", "part.nc")
    error = caught.value
    assert words in str(error)
    assert (error.file, error.line, error.column) == ("part.nc", line, column)


@pytest.mark.parametrize("text", ["", "\n\n", "   \n\t\n"])
def test_empty_program(text):
    with pytest.raises(InputError, match=r"part\.nc: the program is empty"):
        parse_program(text, "part.nc")


@pytest.mark.parametrize("text", ["G0 X1 Y2\nM2", "(nothing)\n", "%\n%", "G0 X1\nM30\nG1 F100 X5"])
def test_program_without_cutting_move(text):
    with pytest.raises(InputError, match="no cutting move"):
        parse_program(text, "part.nc")


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        read_program(tmp_path / "nothing.nc")
    with pytest.raises(InputError, match="cannot read"):
        read_program(tmp_path)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", "empty"),
        ("tool,length\n1,5", "expected length_mm"),
        ("tool,diameter_mm\n1,5", "G43 needs the length of tool 1"),
        ("number,length_mm\n1,5", "missing|not known"),
        ("tool,length_mm\n1,abc", "length_mm = 'abc'"),
        ("tool,length_mm\n1.5,10", "tool number 1.5; expected a whole number"),
        ("tool,length_mm\n1,10\n1,20", "appears twice"),
        ("T1 P1 Z5 D6\nnonsense", "not a tool"),
        ("T1 Z1e9", "Z = "),
        ("T1 Z5\nT\N{SUPERSCRIPT TWO} Z5", "tools.tbl:2: .* is not a tool"),
        (f"T{'1' * 5000} Z5", "is not a tool"),
        (f'tool,length_mm,remark\n1,5,"{"x" * 140_000}"', "tools.tbl:2: not a CSV file: field larger"),
    ],
)
def test_bad_tool_tables(tmp_path, table, words):
    path = tmp_path / "tools.tbl"
    path.write_text(table)
    program = tmp_path / "part.nc"
    program.write_text("T1 M6\nG43 H1\nG1 F100 X1\n")
    with pytest.raises(InputError, match=words):
        read_program(program, tool_table=path)


@pytest.mark.parametrize(
    ("offsets", "words"),
    [
        ("", "empty"),
        ("G54 = [1, two]", "offsets.toml:1:13: the offsets file is not TOML"),
        ("G60 = [1]", "not an offset"),
        ("G54 = [1,2,3,4,5,6,7,8]", "expected 1 to 7 numbers"),
    ],
)
def test_bad_offset_files(tmp_path, offsets, words):
    path = tmp_path / "offsets.toml"
    path.write_text(offsets)
    with pytest.raises(InputError, match=words):
        read_offsets(path)
