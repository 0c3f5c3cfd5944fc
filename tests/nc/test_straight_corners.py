"""Cutter compensation in the dialects fanuc and haas: against corners worked out by hand, and the contour."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.nc.test_compensation import distance_to
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller, dialect_named
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.path.sampling import sample_moves

RADIUS = 3.0
ROOT = math.sqrt(2.0)
TOOLS = {1: ToolEntry(1, 50.0, 2 * RADIUS), 2: ToolEntry(2, 50.0, 9.525)}


def read(text: str, dialect: str = "fanuc") -> ReadProgram:
    control = Controller(dialect_named(dialect), tools=TOOLS)
    return parse_program(f"G21 G90 G17 G94 F100.\n{text}\nM30\n", controller=control)


def ends(program: ReadProgram) -> list[tuple[float, float]]:
    moves = program.moves
    return [(round(x * 1e3, 6) + 0.0, round(y * 1e3, 6) + 0.0) for x, y in moves.end[moves.motion != RAPID][:, :2]]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_a_square_from_outside(dialect):
    """Clockwise, the tool on its left: each corner of 90 degrees is where the offset sides meet."""
    program = read("G0 X-10. Y-10.\nG41 D1 G1 X0 Y0\nY20.\nX20.\nY0\nX0\nG40 X-10. Y-10.", dialect)
    assert ends(program) == [(-3, 0), (-3, 23), (23, 23), (23, -3), (0, -3), (-10, -10)]
    assert not program.moves.arc_sweep.any()
    assert [t.split(" (")[0] for t in program.assumptions if "setting" in t] == [
        "cutter compensation begins and ends by type A",
        "outside corners of cutter compensation are joined by straight moves",
    ]


def test_an_inside_corner():
    program = read("G0 X10. Y5.\nG41 D1 G1 X10. Y0.\nX20.\nY20.\nX10.\nG40 Y10.")
    assert ends(program) == [(10, 3), (17, 3), (17, 17), (10, 17), (10, 10)]


@pytest.mark.parametrize("turn", [30.0, 60.0, 90.0])
def test_an_outside_corner_up_to_90_degrees(turn):
    """The offset lines meet r tan(turn/2) beyond the corner."""
    x, y = 20 + 10 * math.cos(math.radians(turn)), -10 * math.sin(math.radians(turn))
    corner = ends(read(f"G0 X0 Y-10.\nG41 D1 G1 Y0.\nX20.\nX{x:.6f} Y{y:.6f}\nG40 X40. Y40."))[1]
    assert corner == pytest.approx((20 + RADIUS * math.tan(math.radians(turn) / 2), RADIUS), abs=1e-5)


def test_a_sharper_corner_is_cut_off():
    """Fanuc's figure of an acute angle: both offset lines are longer by the radius. Turn of 135 degrees."""
    found = ends(read("G0 X0 Y-10.\nG41 D1 G1 Y0.\nX20.\nX10. Y-10.\nG40 Y-30."))
    beside = (20 + RADIUS / ROOT, -RADIUS / ROOT)  # the corner, offset by the second line
    assert found[1:3] == [
        pytest.approx((23, 3), abs=1e-5),
        pytest.approx((beside[0] + RADIUS / ROOT, beside[1] + RADIUS / ROOT), abs=1e-5),
    ]


def test_outside_corners_at_arcs():
    """Tangents at the corner meet: a half circle between two lines of a slot's outside, at right angles."""
    found = ends(read("G0 X0 Y-10.\nG41 D1 G1 Y0.\nX20.\nG3 X30. Y0 I5. J0\nG1 X50.\nG40 Y10."))
    # From heading +x to the arc's heading -y: 90 degrees outside. The arc's inside is not the tool's side.
    assert found[1:3] == [(23, 3), (23, 0)]
    assert found[4:6] == [(27, 3), (50, 3)]


# Haas, Advanced Mill Programming Techniques (training manual), "Example of Arc On Arc Off Using G41 Cutter
# Compensation": a tool of 0.375 inch, corners of radius 0.06.
ARC_ON = """G20
G00 G90 X0. Y1.25
G01 Z-0.3 F50.
G01 G41 D02 X-0.5 F50.
G03 X0. Y0.75 R0.5 F50.
G01 X1.94
G02 X2. Y0.69 R0.06
G01 Y-0.69
G02 X1.94 Y-0.75 R0.06
G01 X-1.94
G02 X-2. Y-0.69 R0.06
G01 Y0.69
G02 X-1.94 Y0.75 R0.06
G01 X0.
G03 X0.5 Y1.25 R0.5
G01 G40 X0.
G00 Z0.1"""


def distance_to_rounded(points: np.ndarray, half: tuple[float, float], radius: float) -> np.ndarray:
    """Distance of points outside to a rectangle with rounded corners about the origin."""
    inner = np.maximum(np.abs(points) - (np.array(half) - radius), 0.0)
    return np.hypot(*inner.T) - radius


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_arc_on_arc_off(dialect):
    program = read(ARC_ON, dialect)
    moves = program.moves
    cuts = np.flatnonzero((moves.motion != RAPID) & (moves.start[:, 2] == moves.end[:, 2]))
    arcs = moves.take(cuts)
    assert len(arcs) == 13
    samples = sample_moves(arcs.take(np.arange(2, 11)), step=1e-3)  # the contour itself
    away = distance_to_rounded(samples.position[:, :2] * 1e3 / 25.4, (2.0, 0.75), 0.06) * 25.4
    np.testing.assert_allclose(away, 9.525 / 2, atol=1e-6)
    # Inside the arc on: its radius less the tool's; it begins where the line ends, on the arc's own side.
    on = (0.5 - 0.1875) * 25.4
    assert np.linalg.norm(arcs.start[1, :3] - arcs.arc_center[1]) * 1e3 == pytest.approx(on, abs=1e-6)
    np.testing.assert_allclose(arcs.end[0, :2] * 1e3, [-on, 31.75], atol=1e-6)
    np.testing.assert_allclose(arcs.end[-1, :2] * 1e3, [0.0, 31.75], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_the_centre_never_comes_nearer_than_the_radius(seed):
    """Around a star, beside whose corners it goes on: as near as the radius, no nearer."""
    random = np.random.default_rng(seed)
    angles = (np.arange(9) + random.uniform(-0.3, 0.3, 9)) * math.tau / 9
    corners = np.column_stack([np.cos(angles), np.sin(angles)]) * random.uniform(60, 120, 9)[:, None]
    outside = corners[0] * 2.0
    words = [f"X{x:.9f} Y{y:.9f}" for x, y in np.vstack([corners, corners[:2]])]
    text = f"G0 X{outside[0]:.9f} Y{outside[1]:.9f}\nG42 D1\nG1 " + "\n".join(words) + "\nG40 X0 Y0"
    moves = read(text).moves
    samples = sample_moves(moves.take(np.arange(3, len(moves) - 2)), step=2e-4)
    apart = distance_to(samples.position[:, :2] * 1e3, corners)
    assert apart.min() == pytest.approx(RADIUS, abs=1e-6) and apart.max() < RADIUS * ROOT + 1e-6


def test_no_offset_is_the_programmed_path():
    assert ends(read("G41 D0 G1 X10. Y0\nY20.\nG40 X0")) == [(10, 0), (10, 20), (0, 20)]


@pytest.mark.parametrize(
    ("dialect", "text", "line", "found"),
    [
        ("haas", "G41 G1 X10.", 2, "without D"),
        ("fanuc", "G41 D7 G1 X10.", 2, "diameter of tool 7"),
        ("fanuc", "G41 D1 G2 X10. I5.", 2, "an arc as the first move"),
        ("fanuc", "G41 D1 G1 X10.\nG40 X0", 3, "right after the first move"),
        ("fanuc", "G41 D1 G1 X10.\nZ-1.\nY20.", 4, "along the tool"),
        ("fanuc", "G41 D1 G1 X10.\nY20.\nZ-1.\nX0.", 5, "along the tool"),
        ("fanuc", "G41 D1 G1 X10.\nY20.\nY0.", 4, "turns back"),
        ("fanuc", "G41 D1 G1 X10.\nY20.\nX9.\nY0.", 5, "gouging"),
        ("fanuc", "G41 D1 G1 X10.\nY20.\nG3 Y24. J2.", 4, "inside arc of radius 2"),
        ("fanuc", "G41.1 D6. G1 X10.", 2, "cutter compensation"),
        ("generic", "G41 D1 G1 X10.", 2, "cutter compensation"),
    ],
)  # fmt: skip
def test_what_is_refused(dialect, text, line, found):
    with pytest.raises(InputError) as caught:
        read(text, dialect)
    assert caught.value.line == line and found in str(caught.value)
