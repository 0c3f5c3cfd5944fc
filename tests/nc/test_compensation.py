"""Cutter compensation: by hand, by distance to the contour, and against rs274."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import hunt
from benchmarks.hunt_compensation import Beside, Tolerances
from tests.nc import rs274
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.compensation import CORNER
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.rewriting.program import rewrite_program

LINUXCNC = Controller(DIALECTS["linuxcnc"])
TOOLS = {1: ToolEntry(1, 50.0, 6.0), 2: ToolEntry(2, 50.0, -6.0), 3: ToolEntry(3, 50.0)}
SQUARE = "G1 X0 Y-20\nX20\nY20\nX-20\nY-20\nX1\n"


def read(text: str):
    return parse_program(f"G21 G90 F600\n{text}\nM2\n", controller=replace(LINUXCNC, tools=TOOLS))


def ends(text: str) -> list[list[float]]:
    return (read(text).moves.end[:, :2] * 1e3).round(6).tolist()


def test_around_a_square_by_hand():
    """From the middle to its side, then inside or outside; the tool of 6 mm stays 3 mm away."""
    inside = ends(f"T1 M6\nG41\n{SQUARE}G40\nG0 X0 Y0")
    # The entry ends beside its end point; its end is then moved back to the concave corner with the side
    assert inside[0] == [3, -17] and inside[1:5] == [[17, -17], [17, 17], [-17, 17], [-17, -17]]
    assert inside[5:] == [[1, -17], [0, 0]]
    outside = read(f"G42.1 D6\n{SQUARE}G40\nG0 X0 Y0").moves
    arcs = outside.arc_sweep != 0.0
    assert np.rad2deg(outside.arc_sweep[arcs]).round(6).tolist() == [90] * 5  # counter-clockwise about each corner
    points = [[0, -20], [20, -20], [20, 20], [-20, 20], [-20, -20]]
    assert (outside.arc_center[arcs, :2] * 1e3).round(6).tolist() == points
    assert ends(f"T2 M6\nG42\n{SQUARE}G40\nG0 X0 Y0") == inside  # a negative diameter changes the side


def distance_to(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of points to a closed polygon, (n,)."""
    found = np.full(len(points), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return found


@pytest.mark.parametrize("seed", range(6))
def test_the_centre_keeps_the_radius_from_the_contour(seed):
    """A star around the origin: however convex and concave, the centre is always a radius away."""
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * math.pi, 9)) + np.arange(9) * 0.2
    angles *= 2 * math.pi / (angles[-1] + 0.5)
    corners = np.column_stack([np.cos(angles), np.sin(angles)]) * random.uniform(60, 120, 9)[:, None]
    words = [f"X{x:.9f} Y{y:.9f}" for x, y in np.vstack([corners, corners[:2]])]
    start = corners[0] - 30 * (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    text = f"G0 X{start[0]:.9f} Y{start[1]:.9f}\nG42.1 D4\nG1 " + "\n".join(words) + "\nG40\nG0 X0 Y0"
    moves = read(text).moves
    samples = sample_moves(moves.take(slice(3, len(moves) - 2)), step=2e-4)
    apart = distance_to(samples.position[:, :2] * 1e3, corners)
    least = math.cos(CORNER)  # a corner of less is none
    assert apart.min() > 2.0 * least and apart.max() < 2.0 / least and abs(np.median(apart) - 2.0) < 1e-9


@pytest.mark.parametrize(
    ("text", "line", "found"),
    [
        ("G41.1 D6\nG1 X2", 3, "entry move"),
        ("G41.1 D6\nG1 X10\nY-1\nX20", 5, "gouging"),
        ("G41.1 D6\nG1 X10\nG3 X14 I2", 4, "inside arc of radius 2"),
        ("G41 D3\nG1 X10", 2, "diameter of tool 3"),
        ("G41 D9\nG1 X10", 2, "diameter of tool 9"),
        ("G41.1\nG1 X10", 2, "without the diameter"),
        ("G41.1 D6\nG42.1 D6", 3, "while cutter compensation is on"),
        ("G41.1 D6\nG1 X10\nG55", 4, "while cutter compensation is on"),
        ("G41.1 D6\nG1 X10\nG28", 4, "while cutter compensation is on"),
        ("G41.1 D6\nG1 X10\nM0", 4, "while cutter compensation is on"),
        ("G41.1 D6\nG1 X10\nG81 Z-1 R2", 4, "while cutter compensation is on"),
        ("G41.1 D6\nG1 X10\nX[#5420 + 1]", 4, "cutter compensation"),
        ("G41.1 D6\nG1 X10\nG40\nG2 X20 I5", 5, "first move after cutter compensation"),
        ("G19\nG41.1 D6", 3, "G19"),
        ("M72", 2, "none are saved"),
        ("G33 Z5 K1", 2, "synchronised"),
        ("G71.1 Q1", 2, "lathe cycle"),
        ("G12.1", 2, "polar coordinates"),
        ("G150 P1", 2, "pocket"),
    ],
)
def test_refusals_name_their_line(text, line, found):
    with pytest.raises(InputError, match=found) as refusal:
        read(f"{text}\nG1 X99")
    assert refusal.value.line == line


@pytest.mark.parametrize("dialect", ["generic", "fanuc", "haas"])
@pytest.mark.parametrize("text", ["G41 D1", "G33 X5. K1."])
def test_other_controls_do_otherwise(text, dialect):
    with pytest.raises(InputError) as refusal:
        parse_program(f"G21 S100 F100.\nG1 X1.\n{text}\nG1 X30.\nM2\n", controller=Controller(DIALECTS[dialect]))
    assert refusal.value.line == 3


def test_the_check_goes_on_after_an_error_under_compensation():
    lines = ("G21 F100", "G41.1 D6", "G1 X1", "G1 X10", "G55", "G3 X20 I1", "G1 Y5", "G40", "G1 X0 Y0", "M2")
    found = check(Request(lines, "p.nc", controller=LINUXCNC))
    assert [f.line for f in found.findings if f.severity == "error"] == [3, 5, 6]


def test_a_program_beside_its_contour_is_not_rewritten():
    program = read("G41.1 D6\nG1 X10\nY10\nG40")
    with pytest.raises(InputError, match="cutter compensation"):
        rewrite_program(program, (0.1, 0, 0, 0, 0, 0.3), (0.0,) * 6)


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("kind", [Beside, Tolerances])
def test_random_programs_as_linuxcnc_reads_them(kind, tmp_path):
    outcomes = [hunt.hunt_one(kind(seed).program(), tmp_path, LINUXCNC) for seed in range(12)]
    assert [one for one in outcomes if one is not None and one.verdict not in (hunt.SAME, hunt.REFUSED)] == []
    assert sum(one is not None and one.verdict == hunt.SAME for one in outcomes) >= 8
