"""`tps check`: figures against closed forms and the sampled path; findings with their places; never a traceback."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

import numpy as np
import pytest

from tests.nc.test_nc_against_rs274 import TOOLS, Writer, cycle_program
from toolpath_stiff.analysis.program_check import machine_findings
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.courses import extents
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.path.sampling import move_figures, sample_moves

PROGRAMS = sorted((Path(__file__).parents[2] / "programs").glob("*.nc"))


def checked(text: str, **options):
    return check(Request(tuple(text.splitlines()), "part.nc", **options))


@pytest.mark.parametrize("seed", range(12))
def test_extents_hold_the_sampled_path_and_no_more(seed):
    text = Writer(seed).program() if seed < 8 else cycle_program(seed)
    moves = parse_program(text, controller=Controller(tools={n: ToolEntry(n, z, 6.0) for n, z in TOOLS.items()})).moves
    found = extents(moves)
    samples = sample_moves(moves, step=1e-4)
    for axis, name in enumerate("xyz"):
        low, high = samples.position[:, axis].min() * 1e3, samples.position[:, axis].max() * 1e3
        assert found[name][0] <= low + 1e-9 and found[name][1] >= high - 1e-9
        # A step of 0.1 mm on an arc of 1 mm radius falls short of its bulge by 0.00125 mm.
        assert found[name] == pytest.approx([low, high], abs=2e-3)


def test_figures_of_a_program_by_hand():
    moves = parse_program(
        "G0 X10 Y0 F600\nG3 X-10 I-10 (half a circle)\nG4 P2\nG1 Y-40\nG93 G1 X0 F0.5\nG0 Z30\nG95 S1000 F0.2 G1 Z0"
    ).moves
    found = move_figures(moves, rapid_feed=0.1)
    half = math.pi * 10
    assert found["lengths_mm"] == pytest.approx({"cutting": half + 40 + 10 + 30, "rapid": 40, "total": half + 120})
    cutting = half / 10 + 4 + 120 + 30 / (200 / 60)
    assert found["times_s"] == pytest.approx({"cutting": cutting, "rapid": 0.4, "dwell": 2, "total": cutting + 2.4})
    assert found["extents_mm"]["y"] == pytest.approx([-40, 10])


def test_findings_go_on_after_an_error():
    text = "G21 M8\nG0 X1 Y1 Z5\nG41 D1 X5\n#1=\nG1 F100 X9\nG77\nG64 P0.1\nM150\nG1 X20\nM99\n"
    found = checked(text)
    errors = [(f.line, f.column) for f in found.findings if f.severity == "error"]
    assert errors == [(3, 1), (4, 3), (6, 1)]
    assert not found.complete and found.program.moves.end[-1, 0] == pytest.approx(0.02)
    assert any(f.line == 10 and "read once" in f.text for f in found.findings)
    assert [(u.line, u.code) for u in found.unsupported] == [(1, "M8"), (7, "G64"), (8, "M150")]
    used = {code.code: (code.line, code.column, code.count) for code in found.used}
    assert used["G1"] == (5, 1, 2) and used["M8"] == (1, 5, 1) and "G77" in used


@pytest.mark.parametrize(
    "text", ["G0 X5\nM30", "BEGIN PGM X MM\nL X+5 FMAX", "M98 P5\nM30", "M98 P5\nM30\nO5\nG1 F1 X1"]
)
def test_what_cannot_be_a_program_is_one_error(text):
    found = checked(text)
    assert [f.severity for f in found.findings if f.severity == "error"] == ["error"]


def test_reach_and_strut_speeds():
    """A strut's speed is the part of the tip's velocity along it: u . v, at constant orientation."""
    machine = load_machine("nist")
    found = checked("G0 X0 Y0 Z0\nG1 X30 F6000\nG0 X2000\nG1 X2001", default_origin=machine.default_origin)
    findings, speed = machine_findings(found.program, machine, 1e-4)
    assert [(f.line, f.severity) for f in findings if f.code == "reach"] == [(3, "warning"), (4, "error")]
    from toolpath_stiff.machine.kinematics import solve_struts

    tip = np.array(machine.default_origin[:3]) + np.linspace(0, 0.03, 301)[:, None] * np.array([1.0, 0, 0])
    along = np.abs(solve_struts(machine, tip).directions[:, :, 0]).max() * 6000
    beyond = np.array(machine.default_origin[:3]) + np.array([[2.0, 0, 0], [2.001, 0, 0]])
    along = max(along, float(np.abs(solve_struts(machine, beyond).directions[:, :, 0]).max() * 6000))
    assert speed["mm_per_min"] == pytest.approx(along, rel=1e-3)


def test_the_command(tmp_path, capsys):
    program = tmp_path / "part.nc"
    program.write_text("G21 G0 X0 Y0 Z5\nG1 Z0 F600\nX100\nM30\n")
    assert main(["check", str(program), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {"used", "unsupported", "findings", "extents_mm", "lengths_mm", "times_s"} <= document.keys()
    assert document["extents_mm"] == {"x": [0, 100], "y": [0, 0], "z": [0, 5]}
    assert document["complete"] and set(document["used"][0]) >= {"line", "column", "code", "text", "severity"}
    assert main(["check", str(program)]) == 0
    assert "codes used" in capsys.readouterr().out
    program.write_text("G41 D1\nG1 X5 F100\n")
    assert main(["check", str(program), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["extents_mm"] == {}
    assert main(["check", str(program), "--json", "--machine", "none"]) == 1
    (finding,) = json.loads(capsys.readouterr().out)["findings"]
    assert set(finding) == {"line", "column", "code", "text", "severity"}
    program.write_text("")
    assert main(["check", str(program)]) == 2
    assert main(["check", str(program), "--interpreter", "auto"]) == 2
    capsys.readouterr()


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.name)
def test_our_own_programs_are_without_errors(path):
    if path.stat().st_size < 200_000:
        found = check(Request(tuple(path.read_text().splitlines()), path.name))
        assert [f.text for f in found.findings if f.severity == "error" and "--tools" not in f.text] == []


@pytest.mark.parametrize("seed", range(150))
def test_a_mutated_program_is_checked_and_read_or_refused(seed):
    """Bytes dropped, doubled, swapped, replaced: an error has its line, and the check has one where the reader has."""
    chance = random.Random(seed)
    text = (
        Writer(seed % 10).program(12)
        if seed % 2
        else "G68 X1 Y2 R30\nG16 G1 F9 X5 Y30\nM98 P5 L2\nG15\nM30\nO5\nX9\nM99\n"
    )
    symbols = list(text)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(symbols))
        kind = chance.randrange(4)
        if kind == 0:
            del symbols[at]
        elif kind == 1:
            symbols.insert(at, symbols[at])
        elif kind == 2:
            other = chance.randrange(len(symbols))
            symbols[at], symbols[other] = symbols[other], symbols[at]
        else:
            symbols[at] = chance.choice("GMXYZOPLNT%/();.-0123456789")
    mutated = "".join(symbols)
    refused = None
    try:
        parse_program(mutated, "part.nc")
    except InputError as error:
        refused = error
        assert error.line is not None or "no cutting move" in str(error)
    found = checked(mutated)
    assert found.complete == (refused is None)
