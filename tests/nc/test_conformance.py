"""The built-in reader against LinuxCNC's interpreter on every program that Debian installs; and the judge judged."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import conformance
from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import assert_same_path, debian_programs
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program

ARC = "G1 X10 F100\nG2 X30 I10\nG1 X40 A5\n"


# Lengths that rs274's four decimals of an inch hold; its own table is in inches.
LENGTHS_MM = {n: n * 2.54 for n in range(1, 100)}
OURS = "tool,length_mm,diameter_mm\n" + "".join(f"{n},{z:.2f},6.35\n" for n, z in LENGTHS_MM.items())
THEIRS = "".join(f"T{n} P{n} Z{z / 25.4:.1f} D0.25 ;\n" for n, z in LENGTHS_MM.items())


class Installed:
    """The programs that Debian installs: each is read once by either reader, and run once by rs274 itself."""

    original = staticmethod(conformance.read)

    def __init__(self, folder: Path) -> None:
        files = conformance.installed_programs() if rs274.AVAILABLE else []
        if not files:
            pytest.skip("LinuxCNC's programs are not installed")
        self.folder, self.canons, self.readings = folder, {}, {}
        self.harmless = debian_programs()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(conformance, "read", self.reading)
            patch.setattr(conformance, "TOOL_TABLE", OURS)
            self.rows = conformance.measure(files, folder)

    def reading(self, file: Path, control: Controller, interpreter: str, rs274: str | None) -> tuple:
        """`conformance.read`, which is kept."""
        self.readings[file, interpreter] = found = self.original(file, control, interpreter, rs274)
        return found

    def read(self, file: Path, interpreter: str) -> ReadProgram | None:
        """The program, or None where it is refused with file, line and column or makes no cut."""
        program, said = self.readings[file, interpreter]
        assert program or said == conformance.NONE or said.startswith(file.name), said
        return program

    def canon(self, file: Path) -> rs274.Canon:
        """The file itself, not what `linuxcnc` makes of it, through the tests' own parser; in a home of its own."""
        if file not in self.canons:
            home = self.folder / f"home{len(self.canons)}"  # rs274 keeps its parameters from run to run
            home.mkdir()
            self.canons[file] = rs274.run(file, home, THEIRS)
        return self.canons[file]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return Installed(tmp_path_factory.mktemp("installed"))


def test_never_another_path(installed):
    assert [row for row in installed.rows if row.verdict == conformance.OTHER] == []
    ran = [row for row in installed.rows if row.linuxcnc in ("read", conformance.NONE)]
    assert len(ran) > 150
    # A reader that refuses everything would pass too: these it reads.
    assert sum(row.verdict == conformance.SAME for row in ran) >= 22


def test_programs_of_others(installed):
    """Each is read as LinuxCNC does, or refused with file, line and column."""
    same = 0
    for file in installed.harmless:
        program = installed.read(file, "builtin")
        # rs274 on its own forgets at `M6 G43` in one block what the length did to Z (docs/nc.md): another rapid.
        if program is None or "M6 G43" in file.read_text(errors="replace"):
            continue
        canon = installed.canon(file)
        said = [line for line in canon.error.splitlines() if not line.strip().startswith(("executing", "link"))]
        if said:  # it refuses user M codes above 199, which do not concern us
            assert any("M-code greater than 199" in line for line in said), (file, canon.error)
            continue
        assert_same_path(program, canon)
        same += 1
    assert same >= 20


def test_programs_of_others_against_an_independent_reading(installed):
    """O words and all: LinuxCNC's interpreter as the tool runs it against the original file."""
    read = 0
    for file in installed.harmless:
        program = installed.read(file, "linuxcnc")
        if program is None or "G33.1" in file.read_text(errors="replace"):  # the tests' parser knows no rigid tapping
            continue
        assert_same_path(program, installed.canon(file))
        read += 1
    assert read >= 25


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


def test_refusals_must_name_the_file_and_no_path_is_not_a_refusal():
    program, none = parse_program(ARC), conformance.NONE

    def verdict(theirs, heard, ours, answer):
        return conformance.judged("part.nc", theirs, heard, ours, answer)[0]

    assert verdict(program, "read", None, "part.nc:3: G41") == conformance.REFUSED
    assert verdict(program, "read", None, "something went wrong") == conformance.OTHER
    assert verdict(program, "read", None, none) == conformance.OTHER
    assert verdict(None, none, program, "read") == conformance.OTHER
    assert verdict(None, none, None, none) == none
    assert verdict(None, "part.nc:1: M190", program, "read") == conformance.UNCHECKED
    assert verdict(program, "read", program, "read") == conformance.SAME


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
def test_the_command_takes_files_and_folders_and_fails_on_another_path(tmp_path, monkeypatch, capsys):
    (tmp_path / "good.nc").write_text(ARC)
    (tmp_path / "more.ngc").write_text("#1=#<_task>\nG1 X5 F100\n")
    monkeypatch.setattr("sys.argv", ["conformance", str(tmp_path), "--out", str(tmp_path / "table.md")])
    assert conformance.main() == 0
    text = (tmp_path / "table.md").read_text()
    assert text.startswith(capsys.readouterr().out.rstrip("\n"))
    assert "1 same feed path" in text and "1 refused" in text
    monkeypatch.setattr(conformance, "difference", lambda one, two: 0.02)
    assert conformance.main() == 1
    assert "OTHER PATH" in capsys.readouterr().out
