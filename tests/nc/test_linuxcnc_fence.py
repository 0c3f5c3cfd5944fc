"""What LinuxCNC's interpreter must never do: run a program's Python, write a file, run for ever."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import parse_program, read_program
from toolpath_stiff.nc.linuxcnc import reading, runner
from toolpath_stiff.nc.linuxcnc.runner import Limits
from toolpath_stiff.nc.tables import Offsets

INSTALLED = shutil.which("rs274") is not None
needs_rs274 = pytest.mark.skipif(not INSTALLED, reason="LinuxCNC's rs274 is not installed")
ZERO = (0.0,) * 6

RUNS_PYTHON = [
    ";py,{0}",
    "; PY , {0}",
    "(py,{0})",
    "( P y\t,{0})",
    "G1 X1 F9 (Py,{0})",
    ";pyrun,{0}",
    "(PyRun, {0})",
    "( p y r u n ,{0})",
    ";pyreload",
    "; (py,{0})",
    "(;py,{0})",
    "(pyreload)",
    ";py {0}",
    "(first) G1 X2 F5 (py,{0})",
    "(a ; b) ;py,{0}",
    "o100 sub (py,{0})",
    "o100 if [1] ;py,{0}",
    "/ ;py,{0}",
    "\tN20 ;\t pY,{0}",
]
RUNS_M_CODES = [
    "M100",
    "m199 P1",
    "M 1 0 1",
    "M1\t0\t1",
    "m0101",
    "M+150",
    "M150.0",
    "G1 X1 F9 M110",
    "o100 sub M101",
    "N5M101",
    "/M101",
    "/2 m 101",
    "M[50+51]",
    "M#1",
    "M#<code>",
    "MABS[101]",
    "M\u00a0101",
    "(comment) M1 (in between) 05",
    "#1=[7 MOD 4] M102",
]
CALLS_FILES = [
    "o<other> call",
    "O <../evil> CALL [1]",
    "o123 call",
    "M98 P77",
    "M98 P#1",
    "o[100+1] call",
    "o#1 call",
]


def program_with(line: str) -> str:
    return f"G21 G90\nG1 X5 F100\n#1 = 101\n{line}\nG1 X6\nM2\n"


@pytest.fixture
def started(monkeypatch):
    """The runs of the interpreter that are asked for; none takes place."""
    runs = []

    def run(program, *args, **options):
        runs.append(program)
        raise InputError("started")

    monkeypatch.setattr(reading, "run_rs274", run)
    monkeypatch.setattr(reading, "find_rs274", lambda path=None: "/usr/bin/rs274")
    monkeypatch.setattr(runner, "find_rs274", lambda path=None: "/usr/bin/rs274")
    return runs


@pytest.mark.parametrize("interpreter", ["linuxcnc", "auto"])
@pytest.mark.parametrize("line", [*RUNS_PYTHON, *RUNS_M_CODES, *CALLS_FILES])
def test_refused_before_anything_runs_with_its_line(line, interpreter, started):
    text = program_with(line.format("open('x','w')"))
    if interpreter == "auto":  # something that the built-in reader refuses, so that the second would have its turn
        text += "o100 while [0]\n"
    with pytest.raises(InputError) as error:
        parse_program(text, "part.nc", interpreter=interpreter)
    assert not started
    if interpreter == "linuxcnc":
        assert error.value.line == 4


@pytest.mark.parametrize(
    "line",
    [
        "(pythagoras)",
        "(copy, python)",
        "(M101 is not used here)",
        "; no M150",
        "#<m101> = 5",
        "o<m100> sub\no<m100> endsub",
        "#1 = [7 MOD 4]",
        "M5",
        "M9 M61 Q1",
        "(pyramid)",
        "o<here> sub\no<here> endsub\no<here> call",
        "O200\nM99",
    ],
)
def test_harmless_lines_pass_the_fence(line, started):
    with pytest.raises(InputError, match="started"):
        parse_program(program_with(line), interpreter="linuxcnc")
    assert len(started) == 1


def test_no_comment_reaches_the_interpreter(started):
    """Were the fence to miss one, it would be gone: the copy has no comments but numbers and `abort`."""
    text = program_with("(msg,hello) G1 X1 (LOGOPEN,x.txt) ; print") + "(abort, (\n"
    with pytest.raises(InputError, match="within"):
        parse_program(text, interpreter="linuxcnc")
    with pytest.raises(InputError, match="started"):
        parse_program(program_with("(msg,hello) G1 X1 (LOGOPEN,x.txt) ; print"), interpreter="linuxcnc")
    assert "(" not in started[0] and ";" not in started[0]


def marker_program(marker: Path) -> str:
    return f";py,open('{marker}','w').close()\nG1 X1 F100\nM2\n"


@needs_rs274
def test_the_danger_is_real(tmp_path):
    """Unfenced, rs274 does run it: the tests beside this one can fail."""
    marker, program = tmp_path / "marker", tmp_path / "part.ngc"
    program.write_text(marker_program(marker))
    subprocess.run(["rs274", "-g", program.name, "out"], cwd=tmp_path, env={"HOME": str(tmp_path)}, check=False)
    assert marker.exists()


@needs_rs274
def test_no_file_appears(tmp_path, monkeypatch):
    """Neither what the program would write nor what rs274 leaves at home, even past the fence."""
    home, temporary = tmp_path / "home", tmp_path / "tmp"
    home.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.chdir(home)
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    marker, log = home / "marker", home / "log.txt"
    text = marker_program(marker)
    with pytest.raises(InputError):
        parse_program(text, interpreter="linuxcnc")
    monkeypatch.setattr(reading.fence, "check", lambda lines, name: None)
    parse_program(text, interpreter="linuxcnc")
    program = parse_program(f"(LOGOPEN,{log})\n(LOG,hello)\n(PROBEOPEN {log})\nG1 X1 F100\nM2", interpreter="linuxcnc")
    assert [(note.line, note.reason) for note in program.unsupported] == [
        (1, "no file is written"),
        (3, "no file is written"),
    ]
    assert not [*home.iterdir(), *temporary.iterdir()]


@needs_rs274
def test_a_program_is_not_changed_and_a_run_leaves_no_trace_in_the_next(tmp_path):
    """Parameters persist in LinuxCNC; here each run begins anew."""
    file = tmp_path / "part.ngc"
    file.write_text("#500 = [#500 + 1]\nG10 L2 P2 X5\nG1 X#500 F100\nG55 X0\nM2\n")
    before = file.read_bytes()
    ends = [read_program(file, interpreter="linuxcnc").moves.end[0, 0] for _ in range(2)]
    assert ends == [1e-3, 1e-3]
    assert file.read_bytes() == before and list(tmp_path.iterdir()) == [file]


def read_limited(text: str, limits: Limits) -> reading.Reading:
    return reading.read(text.split("\n"), "part.nc", None, ZERO, Offsets(), None, False, limits=limits)


@needs_rs274
@pytest.mark.parametrize("confined", [True, False])
def test_an_endless_loop_ends(confined, monkeypatch):
    if not confined:
        monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    with pytest.raises(InputError, match=r"part\.nc.*after 1 s of processor time.*endless loop"):
        read_limited("G1 X1 F100\no100 while [1]\n#1 = 1\no100 endwhile\nM2", Limits(seconds=1))


@needs_rs274
def test_an_endless_path_ends():
    with pytest.raises(InputError, match=r"part\.nc:3: .*after 1 MB of output"):
        read_limited("G91\no100 while [1]\nG1 X1 F100\no100 endwhile\nM2", Limits(file_bytes=1_000_000))


@needs_rs274
def test_endless_recursion_ends():
    with pytest.raises(InputError, match=r"part\.nc"):
        read_limited("o100 sub\no100 call\no100 endsub\nG1 X1 F100\no100 call\nM2", Limits(seconds=5))


@pytest.mark.skipif(runner._bubblewrap() is None, reason="bubblewrap is not installed, or may not work here")
def test_in_bubblewrap_nothing_else_can_be_written_and_there_is_no_network(tmp_path):
    """A stand-in for rs274 that tries."""
    outside = tmp_path / "outside"
    fake = tmp_path / "rs274"
    fake.write_text(f"#!/bin/sh\necho x > {outside}\ncat /proc/net/dev > canon.txt\n")
    fake.chmod(0o755)
    run = runner.run_rs274("M2\n", "", "", rs274=str(fake))
    assert not outside.exists()
    interfaces = [line.split(":")[0].strip() for line in run.canon.splitlines() if ":" in line]
    assert interfaces == ["lo"]


def test_it_is_started_without_a_shell_in_a_home_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET", "42")
    fake = tmp_path / "rs; touch x"
    fake.write_text("#!/bin/sh\nenv > canon.txt\npwd >> canon.txt\n")
    fake.chmod(0o755)
    monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    run = runner.run_rs274("M2\n", "", "", rs274=str(fake))
    home = next(line for line in run.canon.splitlines() if line.startswith("HOME=")).removeprefix("HOME=")
    assert run.canon.splitlines()[-1] == home and home != os.environ.get("HOME")
    assert "SECRET" not in run.canon
    assert not Path(home).exists()
