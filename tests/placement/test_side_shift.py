"""Programs whose moves are shifted sideways: where the tool then goes, what is written, what is left, what is refused.

The measure of a shift is the distance of the written path from the untouched one, by points along both; it shares no
formula with the code.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import assert_same_path as assert_linuxcnc_agrees
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.courses import points_along
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.rewriting.program import shift_program
from toolpath_stiff.rewriting.side_shift import SideShift

HERE = (0.0,) * 6
START = "G21 G90 F500\nG0 X0 Y0 Z0\n"


def shift(text: str, shifts: dict[int, object], origin=HERE):
    """The written program, read again, its row map and the courses; shifts in mm by line, to the left."""
    program = parse_program(text)
    knots = {}
    for row, line in enumerate(program.moves.line):
        if int(line) in shifts and program.moves.motion[row]:
            values = np.atleast_1d(np.asarray(shifts[int(line)], dtype=float))
            values = np.repeat(values, 2) if len(values) == 1 else values
            knots[row] = (np.linspace(0.0, 1.0, len(values)), values)
    side = SideShift(program.moves, knots)
    written, rows, _ = shift_program(program, origin, side.courses)
    again = parse_program(written.text)
    assert len(rows) == len(again.moves)
    return written, again, rows, side


def points(moves, rows, count=400):
    """(k, 3) mm along some moves."""
    rows = np.atleast_1d(rows)
    return points_along(moves, np.repeat(rows, count), np.tile(np.linspace(0, 1, count), len(rows)))[0] * 1e3


def distance(points_mm, moves, row):
    """(k,) mm of points from a move's whole line or circle in plan view, positive to the left of its feed."""
    start, end = (ends[row, :2] * 1e3 for ends in (moves.start, moves.end))
    if moves.arc_sweep[row] == 0.0:
        along = (end - start) / np.linalg.norm(end - start)
        return (points_mm[:, 1] - start[1]) * along[0] - (points_mm[:, 0] - start[0]) * along[1]
    center, turn = moves.arc_center[row, :2] * 1e3, moves.arc_sweep[row] * moves.arc_normal[row, 2]
    radius = np.linalg.norm(start - center)
    return np.sign(turn) * (radius - np.linalg.norm(points_mm[:, :2] - center, axis=1))


@pytest.mark.parametrize(
    ("text", "shifts", "body"),
    [
        # A corner: both meet where their shifted courses intersect; what follows ramps back.
        ("G1 X10\nY20\nX0", {3: 0.02, 4: 0.02}, ["G1 X1 Y0.02", "X9.98", "Y20", "X0"]),
        ("G1 X10\nG1 Y20 (wall)\nG1 X0", {4: -0.02}, ["G1 X10.02", "G1 Y20 (wall)", "G1 X0"]),
        # From a rapid, and to one, the shift comes and goes within the move.
        ("G1 X10\nG0 X0", {3: 0.02}, ["G1 X1 Y0.02", "X9", "X10 Y0", "G0 X0"]),
        ("N7 g1x10.f100 ; in\nG0 X0", {3: 0.02}, ["N7 g1x1.y0.02f100 ; in", "x9.", "x10.y0.", "G0 X0"]),
        ("G91 G1 X10\nY20\nX-10\nG90 G0 Z9", {4: -0.02}, ["G91 G1 X10.02", "Y20", "X-10.02", "G90 G0 Z9"]),
        # Arcs of constant shift keep their centre, and R becomes I, J; quarter circles that lead in stay arcs.
        ("G1 X10\nG3 X20 Y10 R10\nG1 Y30\nX0", {4: -0.02, 5: -0.02},
         ["G1 X10 Y-0.02", "G3 X20.02 Y10 J10.02", "G1 Y30", "X0"]),
        ("G1 Z-1\nG1 X5\nG3 X10 Y5 J5\nG1 Y30\nG3 X5 Y35 I-5\nG1 X0\nG0 Z5", {6: -0.05},
         ["G1 Z-1", "G1 X5", "G3 X10.05 Y5 I0.025 J5.025", "G1 Y30", "G3 X5 Y35 I-5.025 J-0.025", "G1 X0", "G0 Z5"]),
        ("G1 X20 Y0\nG3 X20 Y0 Z-2 I-20 P2\nG1 X0", {4: 0.02}, ["G1 X19.98 Y0", "G3 Z-2 I-19.98 P2", "G1 X0"]),
        # Plunges, cycles, standing arcs stay; nothing is moved by what is not asked for.
        ("G1 Z-1\nX10.12345\nG18 G2 X20.12345 Z-1 I5 K0\nG17 G81 X30 Z-5 R1", {6: 0.02}, None),
        ("M8\nG1 X10 S900 M3\nT2 M6\nG1 Y20 (a) F80 M8 (b)\nG0 Y30", {6: -0.02},
         ["M8", "G1 X10 S900 M3", "T2 M6", "G1 X10.02 Y1 (a) F80 M8 (b)", "Y19", "X10 Y20", "G0 Y30"]),
    ],
)  # fmt: skip
def test_what_is_written(text, shifts, body):
    written, _, _, _ = shift(START + text + "\nM30\n", shifts)
    wanted = text.splitlines() if body is None else body
    lines = written.text.splitlines()[2:-1]
    assert lines == wanted


def test_inch_and_work_offsets():
    text = "G20 G90 F20\nG10 L2 P1 X1 Y2 Z0 R90\nG54\nG0 X0 Y0 Z0\nG1 X1\nY2\nX0\nM2\n"
    written, again, rows, _ = shift(text, {6: -0.0254}, (0.0254, 0.0508, 0.0, 0.0, 0.0, 0.0))
    assert written.text.splitlines()[4:7] == ["G1 X1.001", "Y2", "X0"]
    assert rows == list(range(len(again.moves)))


@pytest.mark.parametrize(
    "values", [[0.01, 0.05, 0.02, 0.03], [-0.09, 0.0, 0.09], list(0.02 * np.sin(np.linspace(0, 9, 60)))]
)
@pytest.mark.parametrize(
    "move", ["G1 X40 Y30", "G3 X20 Y20 J20", "G2 X6 Y-6 J-6", "G3 X0 Y0 Z-3 I12", "G3 X0 Y-0.3 J-8 P2"]
)
def test_a_shift_that_varies(move, values):
    """Where nothing ramps (2 mm from either end), points of the written path have the shift within the tolerance."""
    if "P2" in move:
        move = "G3 X0.1 Y0 Z-4 J-8 P2"
    text = START + move + "\nG0 Z9\nM30\n"
    _, again, rows, side = shift(text, {3: values})
    old = parse_program(text).moves
    row = int(np.flatnonzero(old.line == 3)[0])
    new = np.flatnonzero(np.array(rows) == row)
    there = points(again.moves, new, 12)
    untouched = points(old, row, 10_000)
    nearest = np.array([np.linalg.norm(untouched - p, axis=1).argmin() for p in there]) / (len(untouched) - 1)
    length = np.linalg.norm(np.diff(untouched, axis=0), axis=1).sum()
    inner = (nearest * length > 2.0) & ((1.0 - nearest) * length > 2.0)
    wanted = np.interp(nearest, np.linspace(0, 1, len(values)), values)
    off = np.abs(distance(there, old, row) - wanted)[inner]
    assert off.max() < 1.3e-3 + side.error  # 1 um, and the rounding to 4 decimals
    assert side.error < 1.5e-3
    pieces = np.linalg.norm(again.moves.end[new, :3] - again.moves.start[new, :3], axis=1) * 1e3
    assert pieces.min() > 0.15


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_closed_contours_keep_their_distance(data):
    """Pockets and bosses of lines and arcs: every point of a shifted contour has the shift as its distance."""
    width, height, radius = (data.draw(st.floats(*span)) for span in ((20, 60), (20, 60), (0.5, 8.0)))
    left = data.draw(st.sampled_from([-1, 1])) * data.draw(st.floats(0.002, 0.1))
    clockwise, increments = data.draw(st.booleans()), data.draw(st.booleans())
    x, y, r = round(width / 2, 3), round(height / 2, 3), round(radius, 3)
    corners = [(x - r, -y), (x, r - y), (x, y - r), (x - r, y), (r - x, y), (-x, y - r), (-x, r - y), (r - x, -y)]
    centers = [(x - r, r - y), (x - r, y - r), (r - x, y - r), (r - x, r - y)]
    if clockwise:
        corners, centers = [(a, -b) for a, b in corners], [(a, -b) for a, b in centers]
    here, lines = (0.0, corners[0][1]), []

    def go(point, words=""):
        nonlocal here
        step = (point[0] - here[0], point[1] - here[1]) if increments else point
        here = point
        return f"X{step[0]:.6f} Y{step[1]:.6f}{words}"

    for side in range(4):
        lines.append("G1 " + go(corners[2 * side]))
        i, j = centers[side][0] - here[0], centers[side][1] - here[1]
        lines.append(("G2 " if clockwise else "G3 ") + go(corners[2 * side + 1], f" I{i:.6f} J{j:.6f}"))
    lines.append("G1 " + go((0.0, corners[0][1])))
    head = f"G21 G90 F500\nG0 X0 Y0 Z0\nG1 Y{corners[0][1]:.6f}\n{'G91' if increments else 'G90'}\n"
    text = head + "\n".join(lines) + "\nG90 G1 Y0\nM30\n"
    first = head.count("\n") + 1
    _, again, _, side = shift(text, {first + k: left for k in range(len(lines))})
    old = parse_program(text).moves
    assert not side.refused
    assert len(again.moves) == len(old)  # arcs stay arcs, nothing is divided
    shifted = [row for row in range(len(old)) if first <= old.line[row] < first + len(lines)]
    for row in shifted:
        assert (again.moves.arc_sweep[row] == 0.0) == (old.arc_sweep[row] == 0.0)
        off = distance(points(again.moves, row), old, row) - left
        assert np.abs(off).max() < 4e-4  # of the rounding to 4 decimals, a centre's in particular
    np.testing.assert_allclose(again.moves.start[1:, :3], again.moves.end[:-1, :3], atol=1e-9)


def test_chords_of_a_circle_stay_chords():
    """As CAM systems write arcs: each keeps to two ends, and meets its neighbours where both are shifted."""
    turn, radius = np.linspace(0.0, 2.0 * np.pi, 201), 10.0
    chords = "".join(f"X{radius * np.cos(t):.4f} Y{radius * np.sin(t):.4f}\n" for t in turn[1:])
    text = f"{START}G1 X12 Y-3\nX{radius} Y0\n{chords}X12 Y3\nG0 Z5\nM30\n"
    wanted = 0.02 + 0.01 * np.sin(3.0 * turn)
    _, again, rows, side = shift(text, {5 + k: wanted[[k, k + 1]] for k in range(200)})
    ends = again.moves.start[2:202, :2] * 1e3
    assert rows == list(range(len(again.moves))) and not side.refused
    assert np.abs(radius - np.hypot(*ends.T) - wanted[:-1]).max() < 2e-4


CONTOUR = (
    "%\nO12 (A WALL)\nN10 G21 G17 G90 G40\nT1 M6\nS9000 M3\nG54\nG0 X0 Y0\nZ5\nG1 Z-3 F200\nN20 X20 F900 (wall)\n"
    "G3 X25 Y5 R5\nG1 Y20\nG2 X30 Y25 I5 J0\nG1 X40\nG3 X40 Y25 I0 J6\nG1 Y30\nG0 Z9\n"
    "G81 X50 Y9 Z-4 R2 F90\nG80\nM9\nM30\n%\n"
)


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC is not installed")
@pytest.mark.parametrize("unit", ["G21", "G20"])
def test_linuxcnc_reads_the_same(tmp_path, unit):
    text = CONTOUR.replace("G21", unit)
    shifts = {10: 0.03, 11: [0.03, 0.01, 0.04], 12: [0.04, -0.02], 13: -0.02, 14: [-0.02, 0.0], 15: [0.0, 0.04, 0.0]}
    written, again, _, side = shift(text, shifts)
    assert not side.refused
    assert re.sub(r"[XYIJR][-\d.]+ ?", "", written.text).count("(wall)") == 1
    file = tmp_path / "wall.ngc"
    file.write_bytes(written.content)
    canon = rs274.run(file, tmp_path, "T1 P1 Z0\n")
    assert not canon.error, canon.error
    assert_linuxcnc_agrees(again, canon)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("G41 D1 G1 X9\nX20\nG40 X30\nM30\n", 4, "compensation"),
        ("G1 X5\nM98 P7\nM30\nO7\nG1 X9\nM99\n", 3, "subprogram"),
        ("#1=5\nG1 X#1\nM30\n", 4, "variables"),
        ("G93 G1 X20 F2\nM30\n", 3, "G93"),
    ],
)
def test_what_is_refused(text, line, what):
    with pytest.raises(InputError) as error:
        shift(START + text, {line: 0.02})
    assert what in str(error.value)


def test_moves_shorter_than_their_shift_are_left_out():
    """A notch of 0.05 mm would turn around: its moves and their neighbours stay, with the reason."""
    text = START + "G1 X10\nY-0.05\nX20\nY5\nX0\nM30\n"
    _, _, _, side = shift(text, {3: -0.08, 4: 0.01, 5: 0.08})
    assert side.refused and all("shorter" in reason for reason in side.refused.values())
