"""The built-in reader against LinuxCNC's interpreter on every program that Debian installs; and the judge judged."""

from __future__ import annotations

import pytest

from benchmarks import conformance
from tests.nc import rs274
from toolpath_stiff.nc import parse_program

ARC = "G1 X10 F100\nG2 X30 I10\nG1 X40 A5\n"


def test_never_another_path(tmp_path):
    files = conformance.installed_programs() if rs274.AVAILABLE else []
    if not files:
        pytest.skip("LinuxCNC's programs are not installed")
    rows = conformance.measure(files, tmp_path)
    assert [row for row in rows if row.verdict == conformance.OTHER] == []
    ran = [row for row in rows if row.runs]
    assert len(ran) > 150
    # A reader that refuses everything would pass too: these it reads.
    assert sum(row.verdict == conformance.SAME for row in ran) >= 22


def test_a_path_in_other_pieces_is_the_same():
    """Straight moves cut in two, an arc in two halves, a rapid that adds nothing."""
    pieces = "G1 X4 F100\nX10\nG2 X20 Y10 I10\nG0 X20\nG2 X30 Y0 J-10\nG1 X40 A5\n"
    one, two = parse_program(ARC), parse_program(pieces)
    assert conformance.move_by_move(conformance.feed_path(one), conformance.feed_path(two)) > 1
    assert conformance.difference(one, two) < 1e-3


@pytest.mark.parametrize(
    "other",
    [
        ARC.replace("X40", "X40.02"),
        ARC.replace("G2", "G3"),
        ARC.replace("A5", "A5.1"),
        ARC + "G1 X41\n",
        ARC.replace("I10", "R10.5"),
        ARC.replace("G1 X40", "G0 X39\nG1 X40"),
        ARC.replace("G2 X30 I10", "G2 I10\nG2 X30 I10"),
    ],
)
def test_another_path_is_found_out(other):
    """In both directions: missing pieces as well as added ones, unless they lie on the path itself."""
    one, two = parse_program(ARC), parse_program(other)
    for apart in (conformance.difference(one, two), conformance.difference(two, one)):
        assert apart > conformance.TOLERANCE


def test_refusals_must_name_the_file_and_no_path_is_not_a_refusal(tmp_path):
    file = tmp_path / "part.nc"
    judge = conformance._without_a_path
    program = parse_program(ARC)
    assert judge(file, program, "read", None, "part.nc:3: G41") == conformance.REFUSED
    assert judge(file, program, "read", None, "something went wrong") == conformance.OTHER
    assert judge(file, program, "read", None, conformance.NONE) == conformance.OTHER
    assert judge(file, None, conformance.NONE, program, "read") == conformance.OTHER
    assert judge(file, None, conformance.NONE, None, conformance.NONE) == conformance.NONE
    assert judge(file, None, "part.nc:1: M190", program, "read") == conformance.UNCHECKED
    assert judge(file, program, "read", program, "read") == ""


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
def test_the_command_takes_files_and_folders_and_fails_on_another_path(tmp_path, monkeypatch, capsys):
    (tmp_path / "good.nc").write_text(ARC)
    (tmp_path / "more.ngc").write_text("M70\nG1 X5 F100\n")
    monkeypatch.setattr("sys.argv", ["conformance", str(tmp_path), "--out", str(tmp_path / "table.md")])
    assert conformance.main() == 0
    text = (tmp_path / "table.md").read_text()
    assert text == capsys.readouterr().out.removesuffix("\n")
    assert "1 same feed path" in text and "1 refused" in text
    monkeypatch.setattr(conformance, "difference", lambda one, two: 0.02)
    assert conformance.main() == 1
    assert "OTHER PATH" in capsys.readouterr().out
