"""What LinuxCNC's interpreter must never do: run a program's Python, write a file, run for ever."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller
from toolpath_stiff.nc.linuxcnc import reader, runner
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.request import Request

INSTALLED = shutil.which("rs274") is not None
needs_rs274 = pytest.mark.skipif(not INSTALLED, reason="LinuxCNC's rs274 is not installed")

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
    "M+150",
    "M150.0",
    "o100 sub M101",
    "M[50+51]",
    "M#1",
    "M#<code>",
    "MABS[101]",
    "G4 P1 M101",
    "M101 P[1",
]
TAKEN_M_CODES = [
    "M100", "m199 P1", "M 1 0 1", "M1\t0\t1", "m0101", "G1 X1 F9 M110", "N5M101", "/M101", "/2 m 101", "M\u00a0101",
    "(comment) M1 (in between) 05", "#1=[7 MOD 4] M102", "M101 P#1 Q[2*3]", "M101 M102 P1",
]  # fmt: skip
CALLS_FILES = [
    "o<other> call",
    "O <../evil> CALL [1]",
    "o123 call",
    "M98 P77",
    "M98 P#1",
    "o[100+1] call",
    "o#1 call",
    "M098 P77",
    "o+100 call",
    "o</srv/evil> call\no</srv/evil> sub\no</srv/evil> endsub",
    "/o<../evil> sub",
    "o<sub/evil> call",
    "1o</srv/evil> call",  # the digits join the line number of the copy, and what is left is a call
    "N5 .5 o<other> call",
    "/1 2 o<other> call",
]


def program_with(line: str, more: str = "") -> str:
    return f"G21 G90\nG1 X5 F100\n#1 = 101{more}\n{line}\nG1 X6\nM2\n"


@pytest.fixture
def started(monkeypatch):
    """The runs of the interpreter that are asked for; none takes place."""
    runs = []

    def run(program, *args, **options):
        runs.append(program)
        raise InputError("started")

    monkeypatch.setattr(reader, "run_rs274", run)
    monkeypatch.setattr(reader, "find_rs274", lambda path=None, unconfined=False: "/usr/bin/rs274")
    monkeypatch.setattr(reader, "find_rs274", lambda path=None, unconfined=False: "/usr/bin/rs274")
    return runs


@pytest.mark.parametrize("interpreter", ["linuxcnc", "auto"])
@pytest.mark.parametrize("line", [*RUNS_PYTHON, *RUNS_M_CODES, *CALLS_FILES])
def test_refused_before_anything_runs_with_its_line(line, interpreter, started):
    # Something that the built-in reader refuses, so that the second would have its turn.
    text = program_with(line.format("open('x','w')"), " G33 K1 Z1" if interpreter == "auto" else "")
    with pytest.raises(InputError) as error:
        parse_program(text, "part.nc", interpreter=interpreter)
    assert not started
    if interpreter == "linuxcnc":
        assert error.value.line == 4


@pytest.mark.parametrize("line", TAKEN_M_CODES)
def test_plain_user_codes_are_taken_out_of_the_copy(line, started):
    with pytest.raises(InputError, match="started"):
        parse_program(program_with(line), "part.nc", interpreter="linuxcnc")
    assert not RUNS.search(started[0]) and ("G1X1F9" in started[0]) == ("G1" in line)


RUNS = re.compile(r"M\s*0*1\s*\d\s*\d|P\s*Y", re.IGNORECASE)


@pytest.mark.parametrize(
    "text",
    [
        "G1 X5 F100\rM101\rM2\r",
        "G1 X5 F100\r;py,open('x','w')\rM2\r",
        "G1 X5 F100\nM1\x0001\nM2",
        "G1 X5 F100\n;\x00py,open('x','w')\nM2",
        "\ufeff;py,open('x','w')\nG1 X5 F100\nM2",
        "G1 X5 F100\nM\ufeff101\nM2",
        "G1 X5 F100\nM\u2007101\nM2",
        "G1 X5 F100\nM\u0661\u0660\u0661\nM2",
        "G1 X5 F100\n\uff2d101\nM2",
        "G1 X5 F100\n\u041c101\nM2",
        "G1 X5 F100\n\u24dc101\nM2",
        "G1 X5 F100\n;\u200bpy,open('x','w')\nM\u200b101\nM2",
        "G1 X5 F100\nM1\x1a01\nM2",
        "G1 X5 F100\nM1\x0c01\nM2",
        "G1 X5 F100\nM1\x8501\nM2",
        "G1 X5 F100\n;py\u2028,open('x','w')\nM2",
        "%\nG1 X5 F100\n%\nM101\n",
        "G1 X5 F100\nM2\nM101\n",
        "G1 X5 F100\no<\u0131f> call\nM2\n",
    ],
)
@pytest.mark.parametrize("interpreter", ["linuxcnc", "auto"])
def test_spellings_of_other_editors_and_scripts_do_not_pass(text, interpreter, started):
    """Line ends of old Macs, NUL, byte-order marks, blanks and letters of other scripts, text after the end."""
    if interpreter == "auto":
        text = "G33 K1 Z1 (refused by the built-in reader)\n" + text
    with pytest.raises(InputError):
        parse_program(text, "part.nc", interpreter=interpreter)
    assert not any(map(RUNS.search, started))


@pytest.mark.parametrize("text", ["G1 X5 F100\n(a\u0131b)\n", "G1 X5 F100 (LOGOPEN,x)\n(PROBEOPEN y)\n;DEBUG,#1\n"])
def test_what_other_comments_say_does_not_reach_it(text, started):
    with pytest.raises(InputError, match="started"):
        parse_program(text, interpreter="linuxcnc")
    assert set(re.sub(r"\(\d+\)", "", started[0])) <= set("N0123456789G XF\nM")


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
    with pytest.raises(InputError, match="not closed"):
        parse_program(text, interpreter="linuxcnc")
    with pytest.raises(InputError, match="started"):
        parse_program(program_with("(msg,hello) G1 X1 (LOGOPEN,x.txt) ; print"), interpreter="linuxcnc")
    assert not set("(;") & set(re.sub(r"\(\d+\)", "", started[0]))


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
    monkeypatch.setattr(reader, "refuse_other_programs", lambda lines, name: None)
    parse_program(text, interpreter="linuxcnc")
    parse_program(f"(LOGOPEN,{log})\n(LOG,hello)\n(PROBEOPEN {log})\nG1 X1 F100\nM2", interpreter="linuxcnc")
    assert not [*home.iterdir(), *temporary.iterdir()]


@needs_rs274
@pytest.mark.parametrize(
    "call",
    [
        "%\no<{0}> call\nG1 X1 F100\n%\no<{0}> sub\no<{0}> endsub\n",
        "/o<{0}> sub\n/o<{0}> endsub\no<{0}> call\nG1 X1 F100\nM2\n",
        "G1 X1 F100\n1o<{0}> call\nM2\n",
    ],
)
def test_a_file_beside_the_program_is_not_run(call, tmp_path, monkeypatch):
    """A subprogram that is only seemingly in the program: what defines it never reaches the interpreter."""
    marker, other = tmp_path / "marker", tmp_path / "other.ngc"
    other.write_text(f"o<other> sub\n;py,open('{marker}','w').close()\no<other> endsub\n")
    program = call.format(other.with_suffix(""))
    with pytest.raises(InputError, match=r"path|begins with a number"):
        parse_program(program, interpreter="linuxcnc", controller=Controller(switches=ALL_SWITCHES))
    with pytest.raises(InputError):  # by its name alone, from beside the program
        monkeypatch.chdir(tmp_path)
        parse_program(call.format("other"), interpreter="linuxcnc", controller=Controller(switches=ALL_SWITCHES))
    assert not marker.exists()


@needs_rs274
def test_a_program_is_not_changed_and_a_run_leaves_no_trace_in_the_next(tmp_path):
    """Parameters persist in LinuxCNC; here each run begins anew."""
    file = tmp_path / "part.ngc"
    file.write_text("#500 = [#500 + 1]\nG10 L2 P2 X5\nG1 X#500 F100\nG55 X0\nM2\n")
    before = file.read_bytes()
    ends = [read_program(file, interpreter="linuxcnc").moves.end[0, 0] for _ in range(2)]
    assert ends == [1e-3, 1e-3]
    assert file.read_bytes() == before and list(tmp_path.iterdir()) == [file]


def read_limited(text: str, monkeypatch, seconds: int, file_bytes: int = 1 << 28, confined: bool = True) -> ReadProgram:
    monkeypatch.setattr(runner, "SECONDS", seconds)
    monkeypatch.setattr(runner, "FILE_BYTES", file_bytes)
    lines = tuple(text.split("\n"))
    return reader.read(Request(lines, "part.nc", interpreter="linuxcnc", unconfined=not confined))


@needs_rs274
@pytest.mark.parametrize("confined", [True, False])
def test_an_endless_loop_ends(confined, monkeypatch):
    if not confined:
        monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    with pytest.raises(InputError, match=r"part\.nc.*after 1 s of processor time.*endless loop"):
        read_limited("G1 X1 F100\no100 while [1]\n#1 = 1\no100 endwhile\nM2", monkeypatch, 1, confined=confined)


@pytest.mark.skipif(os.getuid() == 0, reason="the kernel's limit does not bind on root")
@pytest.mark.parametrize("confined", [True, False])
def test_it_starts_no_process(confined, monkeypatch, tmp_path):
    """A stand-in for rs274 that tries; what it is itself, it still does."""
    if not confined:
        monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    fake = tmp_path / "rs274"
    fake.write_text(
        "#!/bin/sh\necho alive > canon.txt\n/bin/true && echo started >> canon.txt\necho late >> canon.txt\n"
    )
    fake.chmod(0o755)
    assert runner.run_rs274("M2\n", "", "", rs274=str(fake)).canon == "alive\n"


@needs_rs274
def test_an_endless_path_ends(monkeypatch):
    with pytest.raises(InputError, match=r"part\.nc:3: .*after 1 MB of output"):
        read_limited("G91\no100 while [1]\nG1 X1 F100\no100 endwhile\nM2", monkeypatch, 2, 1_000_000)


@needs_rs274
def test_endless_recursion_ends(monkeypatch):
    with pytest.raises(InputError, match=r"part\.nc"):
        read_limited("o100 sub\no100 call\no100 endsub\nG1 X1 F100\no100 call\nM2", monkeypatch, 5)


@pytest.mark.skipif(runner._bubblewrap() is None, reason="bubblewrap is not installed, or may not work here")
def test_in_bubblewrap_nothing_else_can_be_written_and_there_is_no_network(tmp_path):
    """A stand-in for rs274 that tries."""
    outside = tmp_path / "outside"
    fake = tmp_path / "rs274"
    fake.write_text(
        f"#!/bin/sh\necho x > {outside}\nwhile read line; do echo $line; done < /proc/net/dev > canon.txt\n"
    )
    fake.chmod(0o755)
    run = runner.run_rs274("M2\n", "", "", rs274=str(fake))
    assert not outside.exists()
    interfaces = [line.split(":")[0].strip() for line in run.canon.splitlines() if ":" in line]
    assert interfaces == ["lo"]


def test_it_is_started_without_a_shell_in_a_home_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET", "42")
    fake = tmp_path / "rs; touch x"
    fake.write_text("#!/bin/sh\nexport -p > canon.txt\npwd >> canon.txt\n")
    fake.chmod(0o755)
    monkeypatch.setattr(runner, "_bubblewrap", lambda: None)
    run = runner.run_rs274("M2\n", "", "", rs274=str(fake))
    home = next(line for line in run.canon.splitlines() if line.startswith("export HOME=")).split("=")[1].strip("'")
    assert run.canon.splitlines()[-1] == home and home != os.environ.get("HOME")
    assert "SECRET" not in run.canon
    assert not Path(home).exists()
