"""The programs of `programs/`, and those of LinuxCNC that Debian installs, through the tool as users run it."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import assert_same_path, debian_programs
from toolpath_stiff.cli.main import main
from toolpath_stiff.nc.controller import read_controller
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.reader import read_program
from toolpath_stiff.path.sampling import move_durations
from toolpath_stiff.rotations import rotation_matrices

FOLDER = Path(__file__).parent.parent / "programs"
PROGRAMS = sorted(FOLDER.glob("*.nc"))
TOOLS = FOLDER / "tools.tbl"


def cutting_length_mm(name: str, lines: range | None = None) -> float:
    moves = read_program(FOLDER / name, tool_table=TOOLS).moves
    rows = moves.motion != 0
    if lines is not None:
        rows &= (moves.line >= lines.start) & (moves.line < lines.stop)
    return float(1e3 * move_lengths(moves)[rows].sum())


def line_of(name: str, text: str) -> int:
    return next(i for i, line in enumerate((FOLDER / name).read_text().splitlines(), 1) if text in line)


def test_there_are_enough():
    assert len(PROGRAMS) >= 8


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.stem)
def test_each_ends_in_a_report(program, tmp_path, capsys):
    out = tmp_path / "out"
    control = program.with_suffix(".toml")  # of a program that was posted for another machine
    posted = ["--controller", str(control)] if control.exists() else []
    code = main(["analyze", str(program), "--no-plots", "--json", "--tools", str(TOOLS), "--out", str(out), *posted])
    assert code == 0
    summary = json.loads(capsys.readouterr().out)
    assert 10_000 < summary["min_N_per_mm"] <= summary["mean_N_per_mm"] <= summary["max_N_per_mm"] < 200_000
    assert summary["warnings"] == [] and summary["out_of_reach_samples"] == 0


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.stem)
def test_linuxcnc_takes_the_same_path(program, tmp_path):
    lengths = {1: 120.0, 2: 185.5, 3: 96.25}  # of tools.tbl; rs274 reads its table in inches
    table = "".join(f"T{n} P{n} Z{lengths.get(n, 100.0) / 25.4:.8f} D0.25 ;\n" for n in range(1, 10))
    canon = rs274.run(program, tmp_path, table)
    assert not canon.error
    assert_same_path(read_program(program, tool_table=TOOLS), canon)


def test_lengths_known_by_hand():
    start = line_of("pocket.nc", "N590 X-60.")
    quarter = np.pi / 2 * 10
    profile = 15 + 2 * 60 + 2 * 100 + 4 * quarter + 15  # in, sides of 120 x 80 less corners, out
    assert cutting_length_mm("pocket.nc", range(start, start + 11)) == pytest.approx(profile, abs=1e-9)
    turns = line_of("helix_bore.nc", "P8")
    helix = np.hypot(8 * 2 * np.pi * 17, 24.0)
    assert cutting_length_mm("helix_bore.nc", range(turns, turns + 1)) == pytest.approx(helix, abs=1e-9)
    circle = line_of("arcs_in_planes.nc", "G3 X70")
    assert cutting_length_mm("arcs_in_planes.nc", range(circle, circle + 1)) == pytest.approx(2 * np.pi * 20)
    spots = line_of("drilling.nc", "G82")
    assert cutting_length_mm("drilling.nc", range(spots, spots + 8)) == pytest.approx(8 * 5)  # from R2 to Z-3
    slot = line_of("inch_bracket.nc", "X3. F30.")
    assert cutting_length_mm("inch_bracket.nc", range(slot, slot + 1)) == pytest.approx(2 * 25.4)


def test_surface_is_what_its_script_writes():
    text = runpy.run_path(str(FOLDER / "make_surface.py"))["program"]()
    assert (FOLDER / "surface_50000.nc").read_text() == text
    assert len(text.splitlines()) > 50_000


def test_dome_is_what_its_script_writes_and_lies_on_its_sphere():
    script = runpy.run_path(str(FOLDER / "make_dome.py"))
    assert (FOLDER / "dome_ac_table.nc").read_text() == script["program"]()
    program = read_program(
        FOLDER / "dome_ac_table.nc", controller=read_controller(FOLDER / "dome_ac_table.toml"), tool_table=TOOLS
    )
    assert program.kinematics == "table-table A C" and not program.warnings
    moves = program.moves
    posted = np.flatnonzero((np.diff(moves.line, append=0) != 0) & (moves.motion != 0))[
        1:
    ]  # ends of the program's cuts
    tips = 1e3 * moves.end[posted, :3]
    out = tips - np.array([0.0, 0.0, -script["RADIUS"]])  # from the sphere's centre
    # Words of four decimals: angles of 5e-5 degrees at 500 mm or less from the tables' axes, and 5e-5 mm.
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), script["RADIUS"], atol=1e-3)
    axes = rotation_matrices(moves.end[posted, 3:])[:, :, 2]
    np.testing.assert_allclose(axes, out / script["RADIUS"], atol=1e-5)
    seconds = move_durations(moves, move_lengths(moves))[np.isin(moves.line, moves.line[posted])].sum()
    lengths = sum(
        np.linalg.norm(np.subtract(script["cutter_location"](i)[0], script["cutter_location"](i - 1)[0]))
        for i in range(1, script["POINTS"] + 1)
    )
    assert seconds == pytest.approx(60.0 * lengths / script["FEED"], rel=1e-4)  # G93, three decimals


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's programs are not installed")
def test_programs_of_others_end_in_a_report_or_a_clear_refusal(tmp_path, capsys):
    """None needs variables or O words; some leave this machine's workspace, some ask for a tool table."""
    tools = tmp_path / "tools.tbl"
    tools.write_text("".join(f"T{n} P{n} Z{100 + n} D6 ;\n" for n in range(1, 100)))
    reports = refusals = 0
    for file in debian_programs():
        text = file.read_text(errors="replace")
        if "#" in text or any(line.lstrip().lower().startswith("o") for line in text.splitlines()):
            continue
        out = tmp_path / "out" / f"{reports + refusals}"
        code = main(["analyze", str(file), "--no-plots", "--step", "5", "--tools", str(tools), "--out", str(out)])
        captured = capsys.readouterr()
        if code == 0:
            reports += 1
            assert (out / "samples.csv").exists() and (out / "summary.json").exists()
        else:
            refusals += 1
            assert code == 2
            assert captured.err.startswith(f"tps: error: {file.name}")
            assert not out.exists()
    assert reports >= 5 and reports + refusals >= 15
