"""Programs rewritten for another placement: the same path, the same figures, the same text around the words."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.nc import rs274
from tests.placement.rewriting import assert_same_path
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.tables import read_tool_table
from toolpath_stiff.path.placing import place
from toolpath_stiff.placement.placing import rewriting_differences
from toolpath_stiff.rewriting.program import rewrite_program

PROGRAMS = Path(__file__).parents[2] / "programs"
# A program with a controller file is posted for another machine, and not rewritten.
NAMES = sorted(path.name for path in PROGRAMS.glob("*.nc") if not path.with_suffix(".toml").exists())
SHORT = [name for name in NAMES if name != "surface_50000.nc"]
OFF_PLANE = ("arcs_in_planes.nc", "three_tools.nc")  # have arcs in G18 or G19
MACHINE = load_machine("nist")
FIGURES = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
UPRIGHT, TILTED = (0.0, 0.0), (math.radians(3.0), math.radians(-2.0))


def placement(turn: float, tilt=UPRIGHT):
    """A little off the present place, so that nothing cancels; degrees."""
    return (0.0312, -0.0451, 0.9003, *tilt, math.radians(turn))


def tools_for(name: str):
    return read_tool_table(PROGRAMS / "tools.tbl") if name == "three_tools.nc" else None


def reading(name: str, **more):
    table = PROGRAMS / "tools.tbl" if name == "three_tools.nc" else None
    return read_program(PROGRAMS / name, default_origin=MACHINE.default_origin, tool_table=table, **more)


@lru_cache(maxsize=1)
def placed_there(name: str, there):
    """The program as it is read at a placement, its present zero, its analysis there."""
    program = reading(name, origin=there)
    return program, reading(name).origin, analyze(MACHINE, program, origin=there, step=2e-3)


def differences(name: str, there, **options) -> dict[str, float]:
    """Relative differences of mean, range and minimum after a round trip."""
    program, origin, placed = placed_there(name, there)
    rewritten = rewrite_program(program, there, origin, control=Controller(tools=tools_for(name)), **options)
    return rewriting_differences(placed, rewritten, origin, control=Controller(tools=tools_for(name)))


@pytest.mark.parametrize(
    ("name", "turn"),  # arcs in G18 turned by 37 degrees leave their planes: test_chords_cost_little
    [
        (name, turn)
        for name in SHORT
        for turn in (0.0, 37.0, 90.0, 180.0, 270.0)
        if turn != 37.0 or name not in OFF_PLANE
    ],
)
def test_round_trip(name, turn):
    for decimals, bar in ((7, 1e-6), (None, 1e-4)):
        found = differences(name, placement(turn), decimals=decimals)
        assert found.keys() == {"mean", "range", "weakest"}
        assert max(found.values()) < bar


def test_round_trip_of_five_thousand_lines(tmp_path, monkeypatch):
    """Enough for long runs of plain lines: a tenth of the surface, read and rewritten as the whole is."""
    lines = (PROGRAMS / "surface_50000.nc").read_text().splitlines()[:5000]
    (tmp_path / "surface.nc").write_text("\n".join([*lines, "M2", ""]))
    monkeypatch.setattr(f"{__name__}.PROGRAMS", tmp_path)
    program, _, placed = placed_there("surface.nc", placement(37.0))
    assert len(program.moves) > 4900 and len(placed.samples) > 4900
    assert max(differences("surface.nc", placement(37.0), decimals=7).values()) < 1e-6


@pytest.mark.parametrize("name", ["case_study.nc", "tilted_five_axis.nc"])
def test_round_trip_of_a_tilted_set_up(name):
    for decimals, bar in ((7, 1e-6), (None, 1e-4)):
        assert max(differences(name, placement(20.0, TILTED), decimals=decimals).values()) < bar


def test_drilling_in_a_tilted_set_up_is_written_as_moves():
    found = differences("drilling.nc", placement(20.0, TILTED), decimals=7, linearise=1e-5)
    assert max(found.values()) < 1e-6  # no chords: a cycle is made of straight moves


@pytest.mark.parametrize(
    ("name", "there"),
    [(name, placement(37.0)) for name in OFF_PLANE]
    + [(name, placement(20.0, TILTED)) for name in SHORT if name != "drilling.nc"],
)
def test_chords_cost_little(name, there):
    # A chord leans by up to sqrt(2 tolerance / radius) against its arc, 0.02 rad at the smallest radius here (5 mm),
    # and a stiffness changes by about its own size in a radian; over an arc it leans to both sides alike.
    found = differences(name, there, decimals=7, linearise=1e-6)
    assert found["mean"] < 1e-4
    assert max(found.values()) < 0.02


@pytest.mark.parametrize("name", SHORT)
def test_placed_where_it_is_nothing_changes(name):
    program = reading(name)
    rewritten = rewrite_program(program, program.origin, program.origin, control=Controller(tools=tools_for(name)))
    assert rewritten.content == (PROGRAMS / name).read_bytes()


def without_words(text: str) -> list[str]:
    """Lines with their comments and N words, without the other words."""
    kept = []
    for line in text.splitlines():
        pieces = re.split(r"(\(.*?\)|;.*)", line)
        plain = [p if p[:1] in "(;" else "".join(re.findall(r"N\d+|%|O\d+|[GMTSF][\d.]+", p)) for p in pieces]
        kept.append("".join(plain))
    return kept


@pytest.mark.parametrize("name", SHORT)
def test_everything_but_the_numbers_stays(name):
    program = reading(name, origin=placement(180.0))
    rewritten = rewrite_program(
        program, placement(180.0), reading(name).origin, control=Controller(tools=tools_for(name))
    )
    original = (PROGRAMS / name).read_text()
    senses = str.maketrans("23", "__") if name in OFF_PLANE else {}  # a half turn turns the axes of G18 and G19 round
    assert [s.translate(senses) for s in without_words(rewritten.text)] == [
        s.translate(senses) for s in without_words(original)
    ]


def test_line_ends_encoding_and_letters_stay(tmp_path):
    content = (
        "%\r\nn1 g21 g90 (Stück ½)\r\n\r\nn2 g0x10y20z5;hin\r\n n3 g1 z-1 f300\r\nn4x0 ( ab ) y2.50\r\nm2\r\n%\r\n"
        "X9\x1a"
    )
    path = tmp_path / "posted.nc"
    path.write_bytes(content.encode("latin-1"))
    program = read_program(path)
    rewritten = rewrite_program(program, (0.1, 0.0, 0.2, 0.0, 0.0, 0.0), (0.0,) * 6)
    assert rewritten.content.decode("latin-1") == (
        "%\r\nn1 g21 g90 (Stück ½)\r\n\r\nn2 g0x110y20z205;hin\r\n n3 g1 z199 f300\r\nn4x100. ( ab ) y2.50\r\n"
        "m2\r\n%\r\nX9\x1a"
    )
    turned = rewrite_program(program, (0.1, 0.0, 0.2, 0.0, 0.0, math.pi / 2), (0.0,) * 6)
    assert b"n2 g0x80y10z205;hin\r\n n3 g1 z199 f300\r\nn4x97.5 ( ab ) y0.\r\n" in turned.content


def test_byte_order_mark_stays(tmp_path):
    path = tmp_path / "marked.nc"
    path.write_bytes("\ufeffG0 X1 Y0 Z0 (é)\nG1 Z-1 F9\n".encode())
    program = read_program(path)
    content = rewrite_program(program, (0.001, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0,) * 6).content
    assert content == "\ufeffG0 X2 Y0 Z0 (é)\nG1 Z-1 F9\n".encode()


@pytest.mark.parametrize("tolerance_mm", [0.05, 0.01])
@pytest.mark.parametrize("there", [placement(37.0), placement(20.0, TILTED)])
def test_chords_stay_within_the_stated_tolerance(there, tolerance_mm):
    """Half a circle of radius 50 in G18 about X0 Z0: every point written lies within the tolerance of it."""
    text = "G21 G90 F500 G0 X-50 Y0 Z0\nG18 G2 X50 Z0 I50 K0\nG1 Y5\nG3 X-50 I-50\nM2\n"
    program = parse_program(text, origin=there)
    rewritten = rewrite_program(program, there, (0.0,) * 6, linearise=tolerance_mm * 1e-3)
    moves = parse_program(rewritten.text).moves
    normal = place(program.moves, there).arc_normal[program.moves.arc_sweep != 0.0][0]
    center = np.array(there[:3])
    cuts = np.flatnonzero(moves.motion != 0)
    shares = np.linspace(0.0, 1.0, 21)[:, None]
    for i in cuts:
        points = moves.start[i, :3] + shares * (moves.end[i, :3] - moves.start[i, :3]) - center
        along = points @ normal
        radii = np.linalg.norm(points - along[:, None] * normal, axis=1)
        if abs(along[0] - along[-1]) < 1e-6:  # not the step between the two arcs
            assert radii.min() > 0.05 - tolerance_mm * 1e-3
            assert radii.max() < 0.05 + 1e-6
    chord = 2.0 * math.acos(1.0 - tolerance_mm / 50.0)
    assert len(cuts) - 1 <= 2 * math.ceil(math.pi / chord * 1.05)  # and no more of them than needed


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("turn", [0.0, 37.0, 90.0])
@pytest.mark.parametrize("name", [name for name in SHORT if name != "three_tools.nc"])
def test_linuxcnc_reads_the_placed_path(name, turn, tmp_path):
    there = placement(turn)
    program, origin = reading(name, origin=there), reading(name).origin
    linearise = 1e-5 if name in OFF_PLANE and turn == 37.0 else None
    rewritten = rewrite_program(program, there, origin, linearise=linearise)
    (tmp_path / "written.ngc").write_bytes(rewritten.content)
    canon = rs274.run(tmp_path / "written.ngc", tmp_path, "".join(f"T{n} P{n} Z0 D6\n" for n in range(1, 9)))
    assert canon.error == ""
    # Work offsets that the program sets are in LinuxCNC's numbers already; else program zero is at the origin.
    zero = np.zeros(3) if reading(name).origin_source == "program" else np.array(origin[:3])
    moves = place(program.moves, there)
    wanted = 1e3 * (moves.end[moves.motion != 0, :3] - zero)
    found = np.array([end[:3] for kind, _, end, _ in canon.moves if kind != "rapid"])
    unit = 25.4e-5 if name.startswith("inch") else 1e-4
    printed = 25.4e-4 if name.startswith("inch") else 1e-4  # rs274 prints four decimals, of offsets too
    tolerance = 2.0 * unit + 2.0 * printed
    if linearise is None:
        np.testing.assert_allclose(found, wanted, atol=tolerance, rtol=0)
    else:  # every end of the placed moves is one of LinuxCNC's, in the same order
        rows = iter(found)
        assert all(any(np.abs(row - end).max() < tolerance for row in rows) for end in wanted)


def test_text_without_a_file_is_rewritten_too():
    program = parse_program("G0 X1 Y1 Z1\nG1 X2 F100\n")
    rewritten = rewrite_program(program, (0.01, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0,) * 6)
    assert rewritten.text == "G0 X11 Y1 Z1\nG1 X12 F100\n"


@pytest.mark.parametrize("decimals", [1, 10, -4])
def test_decimals_that_make_no_program(decimals):
    program = tps.Program.from_text("G1 X2 F100\n")
    with pytest.raises(InputError, match="decimals"):
        tps.rewrite(program, to_mm_deg=(1, 0, 0), decimals=decimals)


def test_the_printed_differences_are_those_of_the_figures():
    name, there = "pocket.nc", placement(37.0)
    program, origin = reading(name, origin=there), reading(name).origin
    placed = analyze(MACHINE, program, origin=there, step=2e-3)
    wrong = rewrite_program(program, placement(36.0), origin)  # a degree off: must show
    found = rewriting_differences(placed, wrong, origin)
    again = analyze(MACHINE, parse_program(wrong.text), origin=origin, step=2e-3)
    for short, key in zip(("mean", "range", "weakest"), FIGURES, strict=True):
        old, new = (stiffness_figures(a, a.counted)[key] for a in (placed, again))
        assert found[short] == pytest.approx(abs(new / old - 1.0), rel=1e-9)
        assert found[short] > 1e-5
    assert_same_path(program, there, parse_program(rewrite_program(program, there, origin).text), origin, 1e-4)
