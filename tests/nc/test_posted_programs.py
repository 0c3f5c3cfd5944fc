"""Programs posted for other machines, from text to moves on the part."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nc import rs274
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import Controller, read_controller
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import ARC, RAPID, ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.path.sampling import move_durations, sample_moves
from toolpath_stiff.rotations import rotation_matrices

TOLERANCE_MM = 1e-3
AC = """
[kinematics]
type = "table-table"
tcp = false
points = "program"
[kinematics.primary]
letter = "A"
point_mm = [0, 10, -50]
[kinematics.secondary]
letter = "C"
point_mm = [20, -5, 0]
"""
AC_TCP = AC.replace("tcp = false", "tcp = true")
AC_MACHINE = AC.replace('"program"', '"machine"')
BC_HEAD = """
[kinematics]
type = "head-head"
tcp = false
[kinematics.primary]
letter = "C"
pivot_mm = [0, 0, 150]
[kinematics.secondary]
letter = "B"
pivot_mm = [0, 0, 150]
[[tools]]
number = 1
length_mm = 100
"""


@pytest.fixture
def control(tmp_path):
    """Text of a controller file to the control."""

    def make(text: str) -> Controller:
        path = tmp_path / "control.toml"
        path.write_text(text)
        return read_controller(path)

    return make


def axes_of(abc: np.ndarray) -> np.ndarray:
    """(n, 3) tool axes of roll, pitch, yaw."""
    return rotation_matrices(abc)[..., 2]


def durations(program: ReadProgram) -> dict[int, float]:
    """Line to the time of its moves, pauses included."""
    moves = program.moves
    times = move_durations(moves, move_lengths(moves)) + moves.dwell
    return {int(line): float(times[moves.line == line].sum()) for line in np.unique(moves.line)}


# -- an inverse written apart: matrices, homogeneous coordinates, the tables' own turning direction --------------------


def about(axis: str, degrees: float, point: tuple[float, float, float]) -> np.ndarray:
    """Homogeneous matrix (4, 4) of a right-handed turn about a line through a point."""
    t = math.radians(degrees)
    c, s = math.cos(t), math.sin(t)
    turn = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    matrix, shift = np.eye(4), np.array(point, dtype=float)
    matrix[:3, :3] = turn
    matrix[:3, 3] = shift - matrix[:3, :3] @ shift
    return matrix


def ac_table_words(tip: np.ndarray, axis: np.ndarray, before: float) -> tuple[float, float, float, float, float]:
    """X Y Z A C (mm, degrees) of the machine of `AC` that put the tool at a tip, along an axis, on the part.

    Its tables turn by minus the words (ISO 841): the part's axis must come out along the spindle, and the part's point
    where the tip is. A in [0, 180], C the one next to `before`.
    """
    a = math.degrees(math.atan2(math.hypot(axis[0], axis[1]), axis[2]))
    c = math.degrees(math.atan2(axis[0], -axis[1])) if a > 0.0 else before
    c += 360.0 * round((before - c) / 360.0)
    table = about("x", -a, (0, 10, -50)) @ about("z", -c, (20, -5, 0))
    assert np.allclose(table[:3, :3] @ axis, [0, 0, 1], atol=1e-9)
    x, y, z, _ = table @ [*tip, 1.0]
    return x, y, z, a, c


def bc_head_words(tip: np.ndarray, axis: np.ndarray, before: float) -> tuple[float, float, float, float, float]:
    """X Y Z B C of the machine of `BC_HEAD` with its tool of 100 mm: the pivot is 250 mm up the tool's axis.

    X Y Z are the tip's as it would be under the pivot.
    """
    b = math.degrees(math.atan2(math.hypot(axis[0], axis[1]), axis[2]))
    c = math.degrees(math.atan2(axis[1], axis[0])) if b > 0.0 else before
    x, y, z = tip + 250.0 * axis - [0, 0, 250.0]
    return x, y, z, b, c


locations = st.tuples(
    *[st.floats(-80.0, 80.0)] * 3, st.floats(0.0, 1.5), st.floats(-math.pi, math.pi)
)  # tip, and the axis' angles from the pole and about it


@pytest.mark.parametrize(
    ("machine", "inverse", "letters"),
    [(AC, ac_table_words, "AC"), (BC_HEAD, bc_head_words, "BC")],
    ids=["table", "head"],
)
@settings(max_examples=40, deadline=None)
@given(found=st.lists(locations, min_size=1, max_size=6))
def test_cutter_locations_come_back_from_their_posted_words(tmp_path_factory, machine, inverse, letters, found):
    path = tmp_path_factory.mktemp("control") / "control.toml"
    path.write_text(machine)
    lines, tips, axes, before = ["T1 M6", "G0 X500 Y500 Z500"], [], [], 0.0
    for x, y, z, polar, azimuth in found:
        tips.append(np.array([x, y, z]))
        axes.append([math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)])
        numbers = inverse(tips[-1], np.array(axes[-1]), before)
        before = numbers[-1]
        lines.append("G1 F1000 " + " ".join(f"{w}{n:.9f}" for w, n in zip("XYZ" + letters, numbers, strict=True)))
    moves = parse_program("\n".join(lines), controller=read_controller(path)).moves
    for line, tip, axis in zip(range(3, 3 + len(found)), tips, axes, strict=True):
        rows = np.flatnonzero(moves.line <= line)  # a location that repeats the one before has no row
        np.testing.assert_allclose(1e3 * moves.end[rows[-1], :3], tip, atol=1e-6)
        np.testing.assert_allclose(axes_of(moves.end[rows[-1], 3:]), axis, atol=1e-8)


RADIUS = 40.0


def hemisphere_program(points: int, decimals: int) -> str:
    """A spiral from 70 degrees of latitude off the pole towards it, the tool normal to the sphere."""
    lines, c = ["G21 G90 G94", "T1 M6"], 0.0
    for i in range(points + 1):
        polar, azimuth = math.radians(65.0 - 60.0 * i / points), 4.0 * math.pi * i / points
        axis = np.array([math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)])
        x, y, z, a, c = ac_table_words(RADIUS * axis, axis, c)
        numbers = f"X{x:.{decimals}f} Y{y:.{decimals}f} Z{z:.{decimals}f} A{a:.{decimals}f} C{c:.{decimals}f}"
        lines.append(f"{'G0' if i == 0 else 'G1'} {numbers}" + (" F1000" if i == 1 else ""))
    return "\n".join([*lines, "M30", ""])


def test_a_hemisphere_comes_back_from_an_ac_table(control):
    steps = 400
    program = parse_program(hemisphere_program(steps, 7), controller=control(AC))
    cutting = program.moves.take(program.moves.motion != RAPID)
    tips = 1e3 * np.concatenate([cutting.start[:, :3], cutting.end[:, :3]])
    axes = axes_of(np.concatenate([cutting.start[:, 3:], cutting.end[:, 3:]]))
    # The machine interpolates its own axes between the posted points: it leaves the sphere by its own error between
    # them (second order in the step). At the points themselves, numbers of 1e-7 mm and degrees: 1e-6 mm.
    at_points = np.flatnonzero(np.diff(cutting.line, append=0) != 0)
    ends = 1e3 * cutting.end[at_points, :3]
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), RADIUS, atol=1e-6)
    np.testing.assert_allclose(axes_of(cutting.end[at_points, 3:]), ends / RADIUS, atol=1e-8)
    step = np.linalg.norm(np.diff(ends, axis=0), axis=1).max()
    assert abs(np.linalg.norm(tips, axis=1) - RADIUS).max() < step**2 / RADIUS  # twice the chord's own error and more
    np.testing.assert_allclose(axes, tips / np.linalg.norm(tips, axis=1)[:, None], atol=step / RADIUS)
    assert len(cutting) >= steps and (cutting.start[:, 5] == 0.0).all() and (cutting.end[:, 5] == 0.0).all()


def test_the_error_between_posted_points_is_the_machines_own(control):
    """Halving the steps of the spiral takes it four times closer to the sphere: what is left is not ours."""
    errors = []
    for steps in (100, 200):
        fine = AC.replace("tcp = false", "tcp = false\ntolerance_mm = 0.00002")
        moves = parse_program(hemisphere_program(steps, 7), controller=control(fine)).moves
        cutting = moves.take(moves.motion != RAPID)
        errors.append(abs(np.linalg.norm(1e3 * cutting.end[:, :3], axis=1) - RADIUS).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


words = st.tuples(
    *[st.floats(-60.0, 60.0).map(lambda v: round(v, 3))] * 3,
    st.floats(0.0, 120.0).map(lambda v: round(v, 3)),
    st.floats(-170.0, 170.0).map(lambda v: round(v, 3)),
)


@settings(max_examples=40, deadline=None, suppress_health_check=[])
@given(st.lists(words, min_size=2, max_size=6))
def test_divided_moves_stay_within_the_tolerance_of_the_true_curve(tmp_path_factory, blocks):
    """The true curve by matrices, at shares of each move; the distance to the polyline that the reader made."""
    path = tmp_path_factory.mktemp("control") / "control.toml"
    path.write_text(AC)
    text = "\n".join(f"G1 F500 X{x} Y{y} Z{z} A{a} C{c}" for x, y, z, a, c in blocks)
    moves = parse_program(text + "\nG1 X1000", controller=read_controller(path)).moves
    previous = np.zeros(5)
    for line, block in enumerate(blocks, 1):
        rows = np.flatnonzero(moves.line == line)
        if not len(rows):
            assert np.allclose(block, previous)
            continue
        nodes = 1e3 * np.concatenate([moves.start[rows[:1], :3], moves.end[rows, :3]])
        for u in np.linspace(0.0, 1.0, 41):
            x, y, z, a, c = previous + u * (np.array(block) - previous)
            part = about("z", c, (20, -5, 0)) @ about("x", a, (0, 10, -50))
            true = (part @ [x, y, z, 1.0])[:3]
            assert distance_to_polyline(true, nodes) <= TOLERANCE_MM + 1e-9
        axis = part[:3, :3] @ [0, 0, 1]
        np.testing.assert_allclose(axes_of(moves.end[rows[-1], 3:]), axis, atol=1e-8)
        turns = np.einsum("ni,ni->n", axes_of(moves.start[rows, 3:]), axes_of(moves.end[rows, 3:]))
        assert np.degrees(np.arccos(np.clip(turns, -1.0, 1.0))).max() <= 1.0 + 1e-6
        previous = np.array(block)
    np.testing.assert_array_equal(moves.start[1:], moves.end[:-1])


OFFSET_HEAD = """
[kinematics]
type = "head-head"
tcp = false
[kinematics.primary]
letter = "C"
pivot_mm = [30, 0, 0]
[kinematics.secondary]
letter = "B"
axis = "y"
pivot_mm = [0, -15, 120]
"""
HEAD_TABLE = """
[kinematics]
type = "head-table"
tcp = false
points = "program"
[kinematics.head]
letter = "B"
pivot_mm = [12, 0, 120]
[kinematics.table]
letter = "C"
point_mm = [40, 30, 0]
"""
TOOL_9 = "[[tools]]\nnumber = 9\nlength_mm = 80\n"


def offset_head_part(x, y, z, b, c):
    """The chain of `OFFSET_HEAD` by links: from C's axis to B's, from B's to the tip, 80 + 120 below it."""
    to_c = np.array([x + 30, y, z + 80.0])  # C's axis rides with the linear axes
    to_b, to_tip = np.array([-30.0, -15.0, 120.0]), np.array([0.0, 15.0, -200.0])
    turn_c, turn_b = about("z", c, (0, 0, 0))[:3, :3], about("y", b, (0, 0, 0))[:3, :3]
    return to_c + turn_c @ (to_b + turn_b @ to_tip), turn_c @ turn_b @ [0, 0, 1]


def head_table_part(x, y, z, b, c):
    turn = about("y", b, (0, 0, 0))[:3, :3]
    tip = np.array([x + 12, y, z + 200.0]) + turn @ [-12.0, 0.0, -200.0]
    table = about("z", c, (40, 30, 0))
    return (table @ [*tip, 1.0])[:3], table[:3, :3] @ turn @ [0, 0, 1]


@pytest.mark.parametrize(
    ("machine", "true_part"), [(OFFSET_HEAD, offset_head_part), (HEAD_TABLE, head_table_part)], ids=["head", "mixed"]
)
@settings(max_examples=25, deadline=None)
@given(blocks=st.lists(words, min_size=2, max_size=5))
def test_divided_moves_of_heads_stay_within_the_tolerance_too(tmp_path_factory, machine, true_part, blocks):
    path = tmp_path_factory.mktemp("control") / "control.toml"
    path.write_text(machine + TOOL_9)
    text = "T9 M6\n" + "\n".join(f"G1 F500 X{x} Y{y} Z{z} B{b} C{c}" for x, y, z, b, c in blocks)
    moves = parse_program(text + "\nG1 X1000", controller=read_controller(path)).moves
    previous = np.zeros(5)
    for line, block in enumerate(blocks, 2):
        rows = np.flatnonzero(moves.line == line)
        if not len(rows):
            assert np.allclose(block, previous)
            continue
        nodes = 1e3 * np.concatenate([moves.start[rows[:1], :3], moves.end[rows, :3]])
        for u in np.linspace(0.0, 1.0, 31):
            true, axis = true_part(*(previous + u * (np.array(block) - previous)))
            assert distance_to_polyline(true, nodes) <= TOLERANCE_MM + 1e-9
        np.testing.assert_allclose(nodes[-1], true, atol=1e-8)
        np.testing.assert_allclose(axes_of(moves.end[rows[-1], 3:]), axis, atol=1e-8)
        previous = np.array(block)


def distance_to_polyline(point: np.ndarray, nodes: np.ndarray) -> float:
    start, along = nodes[:-1], np.diff(nodes, axis=0)
    length = np.maximum(np.einsum("ni,ni->n", along, along), 1e-300)
    share = np.clip(np.einsum("ni,ni->n", point - start, along) / length, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * along - point, axis=1).min())


# -- times, lines, what stays what it was ------------------------------------------------------------------------------


def test_every_line_keeps_its_time(control):
    text = "G1 F600 X10 Y20\nG4 P2\nA30 C40\nX50 A10 C90\nG93\nX0 C0 F4\nC300 F2\nG0 Z30\nG94 G1 Z0 F100\n"
    plain, found = parse_program(text), parse_program(text, controller=control(AC))
    before, after = durations(plain), durations(found)
    for line in (1, 3, 4, 6, 7, 9):
        assert after[line] == pytest.approx(before[line], rel=1e-9)
    assert after[6] == pytest.approx(15.0, rel=1e-12) and after[7] == pytest.approx(30.0, rel=1e-12)  # G93
    assert set(found.moves.line) == set(plain.moves.line)


def test_a_turn_that_moves_neither_tip_nor_axis_is_a_pause(control):
    # The tip stands on the axis of C and the tool along it.
    program = parse_program("G1 F600 X20 Y-5\nG93\nC90 F2\nX30 F2\n", controller=control(AC))
    assert set(program.moves.line) == {1, 4}
    assert program.moves.dwell[program.moves.line == 1][-1] == pytest.approx(30.0)


def test_arcs_with_standing_axes_stay_arcs(control):
    program = parse_program("G0 A90\nX10 Y0\nG2 X10 Y20 I0 J10 F100\nG17 G3 X0 Y0 Z-5 R20\n", controller=control(AC))
    plain = parse_program("G0 X10 Y0\nG2 X10 Y20 I0 J10 F100\nG17 G3 X0 Y0 Z-5 R20\n")
    arcs, flat = (p.moves.take(p.moves.arc_sweep != 0.0) for p in (program, plain))
    assert len(arcs) == 2 and (arcs.motion == ARC).all()
    np.testing.assert_allclose(arcs.arc_normal, [[0, -1, 0]] * 2, atol=1e-12)  # A 90: +Z of the machine is -Y there
    np.testing.assert_allclose(move_lengths(arcs), move_lengths(flat), rtol=1e-12)
    # The samples along the arc of the part are those of the machine's arc, turned.
    there, here = (sample_moves(moves, step=1e-3) for moves in (arcs, flat))
    turned = np.concatenate([1e3 * here.position, np.ones((len(here), 1))], axis=1) @ about("x", 90, (0, 10, -50)).T
    np.testing.assert_allclose(1e3 * there.position, turned[:, :3], atol=1e-9)


def test_arcs_with_turning_axes_are_divided(control):
    text = "G0 X20 Y0 Z5\nG3 X0 Y20 Z5 I-20 J0 A30 C60 F300\n"
    moves = parse_program(text, controller=control(AC)).moves
    rows = np.flatnonzero(moves.line == 2)
    nodes = 1e3 * np.concatenate([moves.start[rows[:1], :3], moves.end[rows, :3]])
    assert (moves.arc_sweep == 0.0).all() and (moves.motion[rows] == 1).all()
    for u in np.linspace(0.0, 1.0, 101):
        angle = math.radians(90.0 * u)
        point = [20 * math.cos(angle), 20 * math.sin(angle), 5.0, 1.0]
        true = (about("z", 60 * u, (20, -5, 0)) @ about("x", 30 * u, (0, 10, -50)) @ point)[:3]
        assert distance_to_polyline(true, nodes) <= TOLERANCE_MM + 1e-9


# -- tool centre point control -----------------------------------------------------------------------------------------


def test_under_tool_centre_point_control_the_tip_is_as_programmed(control):
    text = "G0 X5 Y5 Z10\nG1 F500 X40 Y5 Z2 A40 C100\nG3 X40 Y45 I0 J20 A10 C30\nG1 A20\nX0 Y0\n"
    plain, found = parse_program(text), parse_program(text, controller=control(AC_TCP))
    for line in (1, 2, 3, 5):
        np.testing.assert_allclose(
            found.moves.end[found.moves.line == line][-1, :3], plain.moves.end[plain.moves.line == line][-1, :3]
        )
    lengths = [{int(n): move_lengths(p.moves)[p.moves.line == n].sum() for n in (1, 2, 3, 5)} for p in (plain, found)]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-9)
    np.testing.assert_allclose(
        found.moves.feed[found.moves.line == 2], plain.moves.feed[plain.moves.line == 2][0], rtol=1e-9
    )
    arc = found.moves.take(found.moves.line == 3)
    assert (arc.arc_sweep != 0.0).all() and len(arc) > 40
    samples = sample_moves(arc, step=1e-3)
    np.testing.assert_allclose(np.linalg.norm(1e3 * samples.position - [40, 25, 2], axis=1), 20.0, atol=1e-9)
    assert durations(found) == pytest.approx(durations(plain), rel=1e-9)


def test_a_helix_under_tool_centre_point_control(control):
    text = "G0 X20 Y0 Z0\nG3 X20 Y0 Z-9 I-20 J0 P3 A30 F300\n"
    moves = parse_program(text, controller=control(AC_TCP)).moves
    helix = moves.take(moves.line == 2)
    assert move_lengths(helix).sum() == pytest.approx(math.hypot(3 * math.tau * 0.020, 0.009), rel=1e-12)
    np.testing.assert_allclose(helix.arc_center[:, :2], 0.0, atol=1e-15)
    np.testing.assert_allclose(helix.arc_center[:, 2], helix.start[:, 2], atol=1e-15)


SWITCHED = """T1 M6
G0 X10 Y20 Z30 A25 C50
G43.4 H1 Z{height}
G1 F400 X{x:.9f} Y{y:.9f} Z{z:.9f} A5 C-20
A-15
G49
G1 X0 Y0 Z0 A0 C0
"""


@pytest.mark.parametrize("tool", [0.0, 80.0])
def test_g43_4_holds_the_tip_from_there_to_g49(control, tool):
    """With the tool's length L the spindle's nose stands at X10 Y20 Z30, and the tip L below it."""
    table = f"[[tools]]\nnumber = 1\nlength_mm = {tool}\n"
    standing = (about("z", 50, (20, -5, 0)) @ about("x", 25, (0, 10, -50)) @ [10, 20, 30 - tool, 1])[:3]
    x, y, z = standing
    # Z is named where it is: nothing moves but the angles.
    program = parse_program(SWITCHED.format(height=f"{z:.9f}", x=x, y=y, z=z), controller=control(AC + table))
    held = program.moves.take((program.moves.line == 4) | (program.moves.line == 5))
    np.testing.assert_allclose(1e3 * held.start[:, :3], [standing] * len(held), atol=1e-6)
    np.testing.assert_allclose(1e3 * held.end[:, :3], [standing] * len(held), atol=1e-6)
    axis = about("z", -20, (0, 0, 0)) @ about("x", -15, (0, 0, 0)) @ [0, 0, 1, 0]
    np.testing.assert_allclose(axes_of(held.end[-1:, 3:])[0], axis[:3], atol=1e-12)
    before = program.moves.line < 6  # with a length, the moves are those of the nose first, of the tip then
    if not tool:
        np.testing.assert_allclose(program.moves.start[before][1:], program.moves.end[before][:-1], atol=1e-11)
    # G49 puts the numbers back to the axes', those of the spindle's nose: the machine stands still.
    last = program.moves.take(program.moves.line == 7)
    back = about("z", -20, (20, -5, 0)) @ about("x", -15, (0, 10, -50))
    nose = np.linalg.solve(back, [*standing, 1.0])[:3] + np.array([0.0, 0.0, tool])
    np.testing.assert_allclose(1e3 * last.start[0, :3], (back @ [*nose, 1.0])[:3], atol=1e-6)
    np.testing.assert_allclose(last.end[-1], 0.0, atol=1e-12)
    assert any("from G43.4 on to G43 or G49" in text for text in program.assumptions)


def test_the_same_part_posted_with_and_without_g43_4(control):
    plain = parse_program(hemisphere_program(60, 7), controller=control(AC))
    text = hemisphere_program(60, 7).replace("G0 X", "G43.4 H1\nG0 X")  # upright still
    lines = text.splitlines()
    ends = plain.moves.end[np.flatnonzero(np.diff(plain.moves.line, append=0) != 0)]
    words = iter(ends)
    for i, line in enumerate(lines):
        if line.startswith(("G0 ", "G1 ")):
            x, y, z = 1e3 * next(words)[:3]
            code, *_, a, c = [word for word in line.split() if not word.startswith("F")]
            feed = " F1000" if code == "G1" else ""
            lines[i] = f"{code} X{x:.7f} Y{y:.7f} Z{z:.7f} {a} {c}{feed}"
    table = "[[tools]]\nnumber = 1\nlength_mm = 0\n"
    held = parse_program("\n".join(lines), controller=control(AC + table))
    again = held.moves.end[np.flatnonzero(np.diff(held.moves.line, append=0) != 0)]
    np.testing.assert_allclose(again, ends, atol=1e-9)


def test_g43_4_without_kinematics_is_refused_as_before(control):
    with pytest.raises(InputError, match=r"G43.4 is tool centre point control.*kinematics"):
        parse_program("G43.4 H1\nG1 F100 X1\n")


def test_haas_says_g234(control):
    table = "[[tools]]\nnumber = 1\nlength_mm = 0\n"
    text = "G43.4 H1\nG1 F100. X9. Y3. Z2. A20. C30.\nG49\nX1. Y2. Z3. A0. C0.\n"
    fanuc, haas = (control(f'dialect = "{name}"\n{AC}{table}') for name in ("fanuc", "haas"))
    ours, theirs = parse_program(text, controller=fanuc), parse_program(text.replace("43.4", "234"), controller=haas)
    np.testing.assert_array_equal(ours.moves.end, theirs.moves.end)
    with pytest.raises(InputError, match="expected haas"):
        parse_program(text.replace("43.4", "234"), controller=fanuc)


def test_machine_points_while_the_tip_is_held_are_refused(control):
    table = "[[tools]]\nnumber = 1\nlength_mm = 0\n"
    for home in ("G53 G0 Z0", "G28 G91 Z0"):
        with pytest.raises(InputError, match="while tool centre point control is on") as error:
            parse_program(f"G1 F100 X1\nG43.4 H1\n{home}\n", controller=control(AC + table))
        assert error.value.line == 3


def test_another_length_under_a_leaning_tool_with_the_tip_held_for_good(control):
    """Where the tip is then is not known until X, Y and Z are named: there are no pivots."""
    table = "[[tools]]\nnumber = 1\nlength_mm = 80\n"
    start = "T1 M6\nG0 A30\nG43.4 H1 Z100\n"
    program = parse_program(start + "X2 Y2\nX1\nG1 F100 Z0\n", controller=control(AC_TCP + table))
    assert set(program.moves.line) == {2, 5, 6} and str(program.warnings[0]).startswith("line 3: rapids")
    with pytest.raises(InputError, match="a cut that begins or ends at a point") as error:
        parse_program(start + "G1 F100 X7\n", controller=control(AC_TCP + table))
    assert error.value.line == 4
    upright = parse_program(start.replace("A30", "X5") + "G1 F100 X7\n", controller=control(AC_TCP + table))
    assert not upright.warnings


# -- heads: what the tool's length has to do with it -------------------------------------------------------------------


def test_a_heads_tool_length_is_that_of_g43_or_of_the_table(control):
    with_g43 = parse_program("T1 M6\nG43 H1\nG0 X0 Y0 Z0\nG1 F100 B90\n", controller=control(BC_HEAD))
    without = parse_program("T1 M6\nG0 X0 Y0 Z0\nG1 F100 B90\n", controller=control(BC_HEAD))
    for program in (with_g43, without):  # 250 mm from the pivot to the tip
        np.testing.assert_allclose(1e3 * program.moves.end[-1, :3], [-250, 0, 250], atol=1e-9)
    shorter = BC_HEAD.replace("100", "40")
    moved = parse_program("T1 M6\nG0 X0 Y0 Z0\nG1 F100 B90\n", controller=control(shorter))
    np.testing.assert_allclose(1e3 * moved.moves.end[-1, :3], [-190, 0, 190], atol=1e-9)


def test_a_tilted_head_without_a_tool_length_is_refused(control):
    with pytest.raises(InputError, match="length of tool 7 is not known") as error:
        parse_program("T7 M6\nG1 F100 X10\nB90\n", "part.nc", controller=control(BC_HEAD))
    assert error.value.line == 3
    parse_program("T7 M6\nG1 F100 X10\nX0\n", controller=control(BC_HEAD))  # upright, nobody asks


# -- zeros and machine points ------------------------------------------------------------------------------------------


def test_points_in_machine_coordinates_need_g54_and_are_relative_to_it(control):
    text = "G0 X0 Y0 Z0\nG1 F100 X10 Y5 Z3 A30 C60\n"
    with pytest.raises(InputError, match='points = "machine" needs the place of G54'):
        parse_program(text, controller=control(AC_MACHINE))
    moved = AC_MACHINE.replace("[0, 10, -50]", "[300, 210, 50]").replace("[20, -5, 0]", "[320, 195, 0]")
    there = parse_program(text, controller=control(moved + "[offsets]\nG54 = [300, 200, 100]\n"))
    here = parse_program(text, controller=control(AC))
    expected = here.moves.end  # there a rapid comes before, from 0, 0, 0 of that machine
    np.testing.assert_allclose(there.moves.end[-len(expected) :], expected, atol=1e-12)
    zeroed = parse_program("G10 L2 P1 X300 Y200 Z100\n" + text, controller=control(moved))
    np.testing.assert_allclose(zeroed.moves.end[-len(expected) :], expected, atol=1e-12)


def test_g54_of_the_posted_machine_does_not_place_the_work_here(control):
    posted = control(AC + "[offsets]\nG54 = [300, 200, 100]\n")
    program = parse_program("G1 F100 X10\n", controller=posted, default_origin=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0))
    assert program.origin == (0.1, 0.2, 0.3, 0.0, 0.0, 0.0) and program.origin_source == "default"
    assert any("does not say where the work sits here" in text for text in program.assumptions)
    asked = parse_program("G1 F100 X10\n", controller=posted, origin=(0.5, 0, 0, 0, 0, 0))
    assert asked.origin[0] == 0.5 and asked.origin_source == "option"


HOME = "G1 F100 X10 Y0 Z5 A20\nG91 G28 Z0\nG90 G0 X0 Y0\nG0 A0 C0\nZ50\nG1 Z0\n"


def test_machine_points_with_g54_known_are_where_that_machine_has_them(control):
    program = parse_program(HOME, controller=control(AC + "[offsets]\nG54 = [0, 0, -400]\n"))
    home = program.moves.take(program.moves.line == 2)
    true = about("x", 20, (0, 10, -50)) @ [10, 0, 400, 1]  # C stands at 0
    np.testing.assert_allclose(1e3 * home.end[-1, :3], true[:3], atol=1e-9)
    assert not program.moves.from_machine.any()
    assert any("their place on this machine means nothing" in text for text in program.assumptions)


@pytest.mark.parametrize("text", [AC, AC_TCP + "[offsets]\nG54 = [0, 0, -400]\n"])
def test_machine_points_that_are_not_known_are_left_out_and_said(control, text):
    program = parse_program(HOME, controller=control(text))
    # Line 5 names Z again, but starts from the height of the machine point.
    assert set(program.moves.line) == {1, 6}
    assert any(
        remark.line == 2
        and remark.text.startswith("rapids to or from points of the machine")
        and "in 4 lines" in remark.text
        for remark in program.warnings
    )
    with pytest.raises(InputError, match="a cut that begins or ends at a point of the machine") as error:
        parse_program("G1 F100 X10 Z5 A20\nG53 Z0\n", "part.nc", controller=control(text))
    assert error.value.line == 2


def test_homing_the_rotary_axes_alone_loses_nothing(control):
    program = parse_program("G91 G28 A0 C0\nG90 G1 F100 X10\nX20\n", controller=control(AC))
    assert set(program.moves.line) == {2, 3} and not any("left out" in text for text in map(str, program.warnings))


def test_rotary_work_offsets_under_tool_centre_point_control_are_refused(control):
    with pytest.raises(InputError, match="a work offset with A, B or C"):
        parse_program("G1 F100 X10\n", controller=control(AC_TCP + "[offsets]\nG54 = [0, 0, 0, 0, 0, 30]\n"))


# -- roll-over, letters, what is said ----------------------------------------------------------------------------------


def test_roll_over_takes_the_shorter_way(control):
    text = "G0 X60 C350\nG1 F100 C10\n"
    long = parse_program(text, controller=control(AC))
    short = parse_program(text, controller=control(AC + "rollover = true\n"))
    assert any("C turns by 340 degrees within one cut" in text for text in map(str, long.warnings))
    assert not short.warnings
    ends = [program.moves.end[-1] for program in (long, short)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    ways = [move_lengths(program.moves.take(program.moves.line == 2)).sum() for program in (long, short)]
    radius = math.hypot(60 - 20, 5)
    assert 1e3 * ways[0] == pytest.approx(math.radians(340) * radius, rel=1e-4)
    assert 1e3 * ways[1] == pytest.approx(math.radians(20) * radius, rel=1e-4)


def test_letters_that_the_machine_does_not_have(control):
    with pytest.raises(InputError, match=r"B turns, and the kinematics .* has A and C alone") as error:
        parse_program("G1 F100 X1\nB5\n", "part.nc", controller=control(AC))
    assert error.value.line == 2


def test_the_program_says_what_was_made_of_it(control):
    program = parse_program("G1 F100 X10 A5\n", controller=control(AC))
    assert program.kinematics == "table-table A C"
    assert any("table-table A C" in text and "the free yaw about the tool is 0" in text for text in program.assumptions)
    assert parse_program("G1 F100 X10 A5\n").kinematics == ""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type = "table-table"', "", "kinematics.type is missing"),
        ('type = "table-table"', 'type = "robot"', "kinematics.type = 'robot'"),
        ("tcp = false", "", "kinematics.tcp is missing"),
        ("tcp = false", "tcp = 1", "kinematics.tcp = 1"),
        ("tcp = false", "tcp = false\ncolour = 3", "kinematics.colour is not known"),
        ('points = "program"', "", "kinematics.points is missing"),
        ('points = "program"', 'points = "part"', "kinematics.points = 'part'"),
        ("tcp = false", "tcp = false\ntolerance_mm = 0", "kinematics.tolerance_mm = 0"),
        ('letter = "A"', 'letter = "X"', "kinematics.primary.letter = 'X'"),
        ('letter = "A"', "", "kinematics.primary.letter is missing"),
        ('letter = "A"', 'letter = "C"', "kinematics.primary.letter and kinematics.secondary.letter are both 'C'"),
        ('letter = "A"', 'letter = "A"\naxis = "w"', "kinematics.primary.axis = 'w'"),
        ('letter = "A"', 'letter = "A"\naxis = [0, 0, 0]', "kinematics.primary.axis = .* has no direction"),
        ('letter = "A"', 'letter = "A"\naxis = "z"', "kinematics.primary.axis and kinematics.secondary.axis are paral"),
        ('letter = "A"', 'letter = "A"\npivot_mm = [0, 0, 1]', "kinematics.primary.pivot_mm is not known"),
        ('letter = "A"', 'letter = "A"\nreversed = 1', "kinematics.primary.reversed = 1"),
        ("point_mm = [0, 10, -50]", "", "kinematics.primary.point_mm is missing, and tcp is false"),
        ("point_mm = [0, 10, -50]", "point_mm = [0, 10]", "kinematics.primary.point_mm = .*three numbers"),
        ("point_mm = [0, 10, -50]", "point_mm = [0, 10, nan]", "kinematics.primary.point_mm = nan"),
        ("[kinematics.secondary]", "[kinematics.tertiary]", "kinematics.tertiary is not known"),
        ("[kinematics.secondary]", "[other]", "'other' is not known"),
        ('"table-table"', '"table-table"\nsecondary = 3', "control.toml"),
    ],
)
def test_broken_kinematics_name_their_key(control, old, new, words):
    assert AC.count(old) == 1
    with pytest.raises(InputError, match=words) as error:
        control(AC.replace(old, new))
    assert "control.toml" in str(error.value)


def test_too_many_pieces_are_refused(control):
    fine = AC.replace("tcp = false", "tcp = false\ntolerance_mm = 0.00001")
    text = "G0 X90000 Y0 Z0\n" + "".join(f"G1 F100 C{9000 * (i % 2)}\n" for i in range(300))
    with pytest.raises(InputError, match="pieces; expected at most"):
        parse_program(text, controller=control(fine))


# -- commands and the second interpreter -------------------------------------------------------------------------------


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("text", [AC, AC_TCP])
def test_linuxcncs_interpreter_gives_the_same_moves(control, text):
    program = hemisphere_program(30, 4).replace("M30", "G2 X10 Y10 R50\nM30")
    posted = control(text)
    ours, theirs = (parse_program(program, controller=posted, interpreter=name) for name in ("builtin", "linuxcnc"))
    assert theirs.interpreter == "linuxcnc" and theirs.kinematics == ours.kinematics
    for name in ("line", "motion", "tool"):
        np.testing.assert_array_equal(getattr(ours.moves, name), getattr(theirs.moves, name))
    np.testing.assert_allclose(ours.moves.end, theirs.moves.end, atol=1e-6)  # rs274 prints four decimals
    np.testing.assert_allclose(*(move_durations(m, move_lengths(m)) for m in (ours.moves, theirs.moves)), rtol=1e-3)


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("part.nc").write_text("G0 X0 Y0 Z20\nG1 F500 Z0\nX20 A10 C20\nX30 Y30\n")
    Path("posted.toml").write_text(AC)
    return ["part.nc", "--controller", "posted.toml"]


def test_check_places_the_part_where_it_is_asked_for(files):
    """Not where the machine that it was posted for has its G54."""
    lines, place = tuple(Path(files[0]).read_text().splitlines()), (0.1, -0.2, 0.9, 0.0, 0.0, 0.5)
    found = check(Request(lines, "part.nc", origin=place, controller=read_controller(files[2])))
    assert found.program.origin == pytest.approx(place)


def test_check_analyze_and_path_take_it(files, capsys):
    assert main(["check", *files, "--json"]) == 0
    checked = json.loads(capsys.readouterr().out)
    assert checked["kinematics"] == "table-table A C" and checked["complete"]
    assert any("free yaw" in finding["text"] for finding in checked["findings"])
    assert checked["extents_deg"]["c"] == [0.0, 0.0]
    assert main(["analyze", *files, "--json", "--no-plots"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["kinematics"] == "table-table A C" and summary["out_of_reach_samples"] == 0
    assert summary["cutting_length_mm"] == pytest.approx(checked["lengths_mm"]["cutting"])
    assert main(["path", *files]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 20


def test_check_says_what_does_not_suit_the_kinematics(files, capsys):
    Path("part.nc").write_text("G1 F100 X1\nB5\n")
    assert main(["check", *files, "--json"]) == 1
    checked = json.loads(capsys.readouterr().out)
    assert [f["line"] for f in checked["findings"] if f["severity"] == "error"] == [2]
    assert checked["extents_mm"] == {}


def test_place_works_and_write_is_refused(files, capsys):
    few = ["--points", "2", "--no-plots", "--step", "20", "--x", "0", "--y", "0", "--z", "750", "--rotate", "0"]
    assert main(["place", *files, *few, "--json"]) == 0
    blocks = json.loads(capsys.readouterr().out)["offset_blocks"]
    assert not blocks["linuxcnc"] and "posted for another kinematics" in blocks["linuxcnc_reason"]
    assert main(["place", *files, *few, "--write", "placed.nc"]) == 2
    assert "posted for another kinematics (table-table A C) cannot be rewritten" in capsys.readouterr().err
    assert not Path("placed.nc").exists()


def test_without_the_kinematics_the_words_turn_the_platform_and_that_is_said(files, capsys):
    """Out of reach then, most often; the message points to the controller file."""
    assert main(["analyze", "part.nc", "--no-plots", "--json"]) == 0
    assert any(
        "roll, pitch, yaw of the platform" in text for text in json.loads(capsys.readouterr().out)["assumptions"]
    )
    Path("part.nc").write_text("G0 X0 Y0 Z20\nG1 F500 Z0\nX20 A80\n")
    assert main(["analyze", "part.nc", "--no-plots"]) == 2
    assert "posted for another machine" in capsys.readouterr().err
