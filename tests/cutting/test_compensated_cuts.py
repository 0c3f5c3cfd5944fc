"""Compensation through the whole chain: twenty small programs, each cut again as written, with other coefficients too.

The error of the compensated surface is told apart from the tool's result: the error of the cut along the written path,
less how far that path lies from the untouched one, by distances of points from lines and circles.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.cutting.simulator import Mill
from tests.placement.test_side_shift import distance
from toolpath_stiff.cutting.coefficients import material
from toolpath_stiff.cutting.compensation import ELSEWHERE
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.cutting.setup import CutSetup
from toolpath_stiff.cutting.tip import station_axes, tip_compliances, with_tools
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.rewriting.program import shift_program
from toolpath_stiff.stiffness.model import build_model

HEAD = "G21 G90 G17 G94\nT1 M6\nS8000 M3\n"
MODEL = build_model(load_machine("nist"))
STEP = 2.0  # mm
ORIGIN = MODEL.machine.default_origin


def setup(diameter, stick_out):
    """A block of aluminium of 80 x 40 x 20 mm, zero in the middle of its top, a carbide cutter of three flutes."""
    tool = ToolEntry(1, diameter=diameter, stick_out=stick_out, cutter={"flutes": 3, "helix_deg": 30.0})
    return CutSetup(material("Al7075"), (0.08, 0.04, 0.02), (-0.04, -0.02, -0.02), tools={1: tool})


def wall(ae, ap, up, diameter):
    """A side of the block, from beyond one corner to beyond the other."""
    y, x = -20.0 - diameter / 2 + ae, -50 if up else 50
    return f"G0 X{x} Y{y - 5} Z5\nG1 Z{-ap} F500\nG1 Y{y} F900\nX{-x}\nY{y - 5}\nG0 Z5\n"


def contour(x, y, c, up):
    """A rounded rectangle within, from the middle of its right side; quarter circles lead in and out."""
    code, s = ("G2", -1) if up else ("G3", 1)
    lines = [f"X{x - 3} Y{-3 * s}", f"{code} X{x} Y0 I0 J{3 * s}"]
    for (a, b), (i, j) in (
        (((x, s * (y - c)), (x - c, s * y)), (-c, 0)), (((c - x, s * y), (-x, s * (y - c))), (0, -c * s)),
        (((-x, s * (c - y)), (c - x, -s * y)), (c, 0)), (((x - c, -s * y), (x, s * (c - y))), (0, c * s)),
    ):  # fmt: skip
        lines += [f"G1 X{a[0]} Y{a[1]}", f"{code} X{b[0]} Y{b[1]} I{i} J{j}"]
    return "\n".join([*lines, "G1 Y0", f"{code} X{x - 3} Y{3 * s} I-3 J0", "G1 X0 Y0", ""])


def pocket(ae, ap, up, diameter):
    x, y = 22.0, 14.0
    i, j = x - ae, y - ae
    rough = [(i / 2, 0), (i / 2, j / 2), (-i / 2, j / 2), (-i / 2, -j / 2), (i / 2, -j / 2), (i / 2, 0), (i, 0)]
    rough += [(i, j), (-i, j), (-i, -j), (i, -j), (i, 0)]
    moves = "\n".join(f"X{a} Y{b}" for a, b in rough)
    return f"G0 X0 Y0 Z5\nG1 Z{-ap} F200\nF900\n{moves}\n{contour(x, y, 3.0, up)}G0 Z5\n"


def boss(ae, ap, up, diameter):
    """A full circle about a boss, with the waste about it left standing."""
    radius = 20.0 + diameter / 2 - ae
    code, s = ("G3", 1) if up else ("G2", -1)
    return (
        f"G0 X{radius + 6} Y{-6 * s} Z5\nG1 Z{-ap} F400\nG1 X{radius} Y0 F900\n{code} X{radius} Y0 I{-radius} J0\n"
        f"G1 X{radius + 6} Y{6 * s}\nG0 Z5\n"
    )


def slot(ae, ap, up, diameter):
    """A slot, then one of its walls from a sharp inner corner on; no lead-in."""
    return f"G0 X-50 Y0 Z5\nG1 Z{-ap} F400\nX25 F900\nY{ae if up else -ae}\nX-50\nG0 Z5\n"


CASES = [
    (wall, 0.2, 6, True, 10, 30), (wall, 0.5, 4, False, 10, 35), (wall, 1.0, 8, False, 8, 25),
    (wall, 3.0, 5, True, 12, 50), (wall, 0.3, 10, False, 6, 20), (wall, 2.0, 3, True, 16, 40),
    (pocket, 0.3, 4, False, 10, 30), (pocket, 0.5, 6, True, 10, 30), (pocket, 0.2, 5, False, 8, 30),
    (pocket, 1.0, 3, True, 12, 45), (pocket, 0.4, 8, False, 10, 25), (pocket, 0.3, 3, True, 6, 20),
    (boss, 0.5, 5, False, 10, 30), (boss, 1.0, 4, True, 12, 36), (boss, 0.3, 8, False, 10, 40),
    (boss, 0.8, 3, True, 8, 24), (slot, 0.5, 3, False, 8, 24), (slot, 0.3, 4, True, 10, 30),
    (slot, 1.0, 2, False, 6, 18), (slot, 0.6, 3, True, 12, 40),
]  # fmt: skip


def surfaces(untouched, program, given):
    """Of each final wall: which it is of the untouched program, error of the cut and shift (um), length.

    The coefficients enter the error as a factor, where no effect depends on the load.
    """
    cut = evaluate_cut(MODEL, program, ORIGIN, given, STEP * 1e-3)
    station, side = np.nonzero(np.isfinite(cut.wall_mean))
    points, heading = cut.samples.position[station] * 1e3, cut.samples.tangent[station]
    moves = untouched.moves
    best, away = np.full(len(station), -1), np.full(len(station), np.inf)
    flat = np.abs(moves.end[:, :2] - moves.start[:, :2]).any(axis=1) | (moves.arc_sweep != 0.0)
    for row in np.flatnonzero((moves.motion != 0) & flat):
        start, end = moves.start[row, :2] * 1e3, moves.end[row, :2] * 1e3
        off = distance(points, moves, row)
        if moves.arc_sweep[row] == 0.0:
            along = (end - start) / max(math.dist(start, end), 1e-9)
            place = (points[:, :2] - start) @ along
            beside = (place > -0.2) & (place < math.dist(start, end) + 0.2) & (heading[:, :2] @ along > 0.9)
        else:
            center = moves.arc_center[row, :2] * 1e3
            turned = np.angle(((points[:, :2] - center) @ [1, 1j]) / ((start - center) @ [1, 1j]))
            sweep = moves.arc_sweep[row] * moves.arc_normal[row, 2]
            turned = np.where(turned * sweep < -0.02 * abs(sweep), turned + np.sign(sweep) * 2 * np.pi, turned)
            beside = np.abs(turned) < abs(sweep) + 0.02
        nearer = beside & (np.abs(off) < np.abs(away))
        best[nearer], away[nearer] = row, off[nearer]
    assert (best >= 0).all() and np.abs(away).max() < 0.12
    into = np.where(side == 0, 1e3, -1e3) * away
    return best * 2 + side, cut.wall_mean[station, side] * 1e6, into, cut.samples.weight[station] + 1e-9


@pytest.mark.parametrize(("kind", "ae", "ap", "up", "diameter", "stick_out"), CASES)
def test_a_fifth_is_left_and_no_wall_is_worse(kind, ae, ap, up, diameter, stick_out):
    text = HEAD + kind(ae, ap, up, diameter) + "M2\n"
    given = setup(diameter, stick_out)
    compensated = tps.compensate(tps.Program.from_text(text, name="part.nc"), cut=given, step_mm=STEP)
    untouched, written = parse_program(text), parse_program(compensated.rewritten.text)
    of, error, _, length = surfaces(untouched, untouched, given)
    wall_of, cut, shift, weight = surfaces(untouched, written, given)
    before = np.average(np.abs(error), weights=length)
    assert compensated.walls["mean_before_um"] == pytest.approx(before, rel=1e-6)
    for scale, most in ((1.0, 0.2), (1.2, 0.35), (0.8, 0.35)):  # coefficients as assumed, and a fifth wrong
        assert np.average(np.abs(scale * cut - shift), weights=weight) <= most * scale * before
    for number in np.intersect1d(of, wall_of):
        then, now = of == number, wall_of == number
        size = np.average(np.abs(cut[now] - shift[now]), weights=weight[now])
        assert size <= np.average(np.abs(error[then]), weights=length[then]) + 0.05  # um: 4 decimals
    elsewhere = [bool(reason) for reason in compensated.lines["left_alone"]]  # ends of arcs that lead in or out
    assert set(compensated.lines["left_alone"]) <= {"", ELSEWHERE}
    assert max(np.array(compensated.lines["length_mm"])[elsewhere], default=0.0) <= STEP


@pytest.mark.parametrize(("ae", "ap", "up"), [(0.3, 6, True), (0.5, 4, False)])
def test_a_compensated_wall_stepped_through_time(ae, ap, up):
    """The middle of a wall, untouched and as written, by the simulator of single teeth: a fifth of its mean is left."""
    text = HEAD + wall(ae, ap, up, 10) + "M2\n"
    given = setup(10, 30)
    compensated = tps.compensate(tps.Program.from_text(text, name="part.nc"), cut=given, step_mm=STEP)
    cut, written = compensated.before, compensated.after
    middle, shifted = (int(np.argmin(np.abs(c.samples.position[:, 0]) + 9.0 * (c.ae == 0.0))) for c in (cut, written))
    shift = (written.samples.position[shifted, 1] - cut.samples.position[middle, 1]) * 1e3  # mm, into the block
    samples = cut.samples.take(np.array([middle]))
    axes = station_axes(samples, ORIGIN)
    machine = tip_compliances(MODEL, samples, ORIGIN, axes, cut.mean_force[[middle]])
    compliance = with_tools(machine, samples, cut.cutters)[0] * 1e3
    coefficients = (*(given.coefficients.values[:3] / 1e6), *(given.coefficients.values[3:] / 1e3))
    side = "left" if up else "right"
    untouched, now = (
        Mill(5.0, 3, 30.0, float(ap), 900.0 / 8000.0 / 3, coefficients, compliance, width, side, slices=40, steps=360)
        .wall(side)
        .mean()
        for width in (ae, ae + shift)
    )
    assert abs(now - 1e3 * shift) <= 0.2 * abs(untouched)
    assert abs(untouched) > 2.0


def test_a_contour_of_chords_is_walls_as_arcs_are():
    """A boss as CAM systems write it: chords of 1.5 mm; a few between two walls do not keep the others from it."""
    turn = -2.0 * np.pi * np.arange(101) / 100
    chords = "".join(f"X{24.7 * np.cos(t):.4f} Y{24.7 * np.sin(t):.4f}\n" for t in turn[1:])
    text = f"{HEAD}G0 X40 Y-8 Z5\nG1 Z-1 F500\nX24.7 Y0 F900\n{chords}X40 Y8\nG0 Z5\nM2\n"
    compensated = tps.compensate(tps.Program.from_text(text, name="part.nc"), cut=setup(10, 30), step_mm=STEP)
    assert compensated.walls["left_percent"] < 20.0
    assert sum(map(bool, compensated.lines["left_alone"])) < 5


COMPENSATED = "G0 X60 Y44 Z5\nG1 Z-4 F500\nG42.1 D10 X52 Y19 F900\nX-52\nG40 X-60 Y44\nG0 Z5\n"
CYCLE = "G0 X0 Y0 Z5\nG81 X5 Y5 Z-3 R2 F200\nX-5\nG80\n"


def test_what_the_shift_does_not_belong_to_stays_as_it_stands():
    """A wall under cutter compensation stays with the reason, holes too; the other is shifted."""
    head, first = HEAD.replace("T1", "(a comment) T1"), wall(0.5, 4, True, 10)
    text = f"{head}{first}{COMPENSATED}{CYCLE}M2\n"
    program = tps.Program.from_text(text, name="part.nc", dialect="linuxcnc")
    compensated = tps.compensate(program, cut=setup(10, 30), step_mm=STEP)
    old, new = text.splitlines(), compensated.rewritten.text.splitlines()
    start = len(f"{head}{first}".splitlines())
    assert new[-(len(old) - start) :] == old[start:] and new[:3] == old[:3] and new[3:] != old[3:]
    reasons = dict(zip(compensated.lines["line"], compensated.lines["left_alone"], strict=True))
    assert "G41, G42" in reasons[start + 4] and not reasons[7]
    left = dict(zip(compensated.lines["line"], compensated.lines["size_after_um"], strict=True))
    program = tps.Program.from_text(f"{head}{COMPENSATED}M2\n", dialect="linuxcnc")
    alone = tps.compensate(program, cut=setup(10, 30), step_mm=STEP)
    assert not alone.changed and left[start + 4] == pytest.approx(alone.lines["size_before_um"][0], rel=1e-6)


def test_the_wall_of_a_tilted_tool_is_left_alone_and_the_other_is_shifted():
    tilted = "G0 Z60\nG0 A-30\nG0 X-50 Y0 Z30\nZ1\nG1 X50\nG0 Z60\n"
    compensated = tps.compensate(
        tps.Program.from_text(HEAD + wall(0.5, 4, True, 10) + tilted + "M2\n", name="part.nc"), cut=setup(10, 30)
    )
    assert tilted in compensated.rewritten.text and compensated.changed
    reasons = dict(zip(compensated.lines["line"], compensated.lines["left_alone"], strict=True))
    assert reasons.pop(14).endswith("a tilted tool") and not any(reasons.values())


BOSS = (
    "G0 X-65 Y-55 Z5\nG1 Z-8 F500\nX-46.3 F1200\nY36.3\nX46.3\nY-36.3\nX-65\nG0 Z5\nX-65 Y-55\nG1 Z-8 F500\n"
    "X-45 F900\nY30\nG2 X-40 Y35 I5 J0\nG1 X40\nG2 X45 Y30 I0 J-5\nG1 Y-30\nG2 X40 Y-35 I-5 J0\nG1 X-65\nG0 Z5\n"
)


def test_a_line_whose_wall_others_make_afterwards_says_so():
    """Round a sharp corner of a boss the tool only turns: shifted neighbours make what that arc made."""
    blank = replace(setup(10, 30), size=(0.1, 0.08, 0.03), corner=(-0.05, -0.04, -0.03))
    compensated = tps.compensate(tps.Program.from_text(f"{HEAD}{BOSS}M2\n"), cut=blank, step_mm=STEP)
    after = np.array(compensated.lines["size_after_um"])
    said = [reason == ELSEWHERE for reason in compensated.lines["left_alone"]]
    assert compensated.changed and np.isnan(after).tolist() == said and any(said)
    longest = compensated.lines["length_mm"][np.flatnonzero(np.isnan(after))[0]]
    assert longest < 0.02 * compensated.walls["length_mm"] and compensated.walls["left_percent"] < 20.0


@pytest.mark.parametrize(
    ("name", "text", "where"),
    [
        ("part.ngc", "G21\n#<d> = 4\nG1 X#<d> F100\nM2\n", "part.ngc:2: a program with variables or O words"),
        ("part.ngc", "o<a> sub\nG1 X4 F100\no<a> endsub\no<a> call\nM2\n", "part.ngc:1: a program with variables"),
        ("part.h", "BEGIN PGM A MM\nL X+4 F100\nEND PGM A MM\n", "as 'heidenhain'"),
    ],
)
def test_what_cannot_be_shifted_is_refused_without_talk_of_placements(name, text, where):
    with pytest.raises(InputError) as error:
        shift_program(parse_program(text, name), ORIGIN, {})
    assert where in str(error.value) and "ost it as G code" in str(error.value) and "--write" not in str(error.value)
