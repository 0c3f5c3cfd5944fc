"""Paths beside contours and over the area between them: distances to densely drawn contours, and a raster of points."""

import cmath
import math

import numpy as np
import pytest

from tests.nc.test_heidenhain import read
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.contouring.drawing import backward, path_beside
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.geometry import GeometryError
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.nc.words import Block, Word

HEAD = (
    "CYCL DEF 14.0 K\nCYCL DEF 14.1 LABEL 1 /2\nCYCL DEF 20 D Q1=-6 Q2={step} Q3={spare} Q4=0 Q5=0 Q6=2 Q7=9"
    " Q8=0 Q9={way}\nCYCL DEF {cycle} C Q9={way} Q10=4 Q11=100 Q12=300 Q14={spare}\nL Z+9 FMAX M3\nCYCL CALL\nM30\n"
)
ROUND_ISLAND = "LBL 2\nCC X{x:+} Y{y:+}\nL X{e:+} Y{y:+} RR\nC X{e:+} Y{y:+} DR+\nLBL 0"


STATE = State("t.h", frames=Frames(Offsets(), None, (0.0,) * 6))
BLOCK = CurrentBlock("t.h", Block(1, (Word("", 0.0, 1, "CYCL CALL"),)))


def dense(moves, rows) -> np.ndarray:
    """Points of the tool's centre along moves in their plane, mm."""
    points = []
    for row in rows:
        start, end = (complex(*side[row, :2]) * 1e3 for side in (moves.start, moves.end))
        shares, middle = np.linspace(0.0, 1.0, 400), complex(*moves.arc_center[row, :2]) * 1e3
        turn = moves.arc_sweep[row] * moves.arc_normal[row].sum()
        points.append(
            middle + (start - middle) * np.exp(1j * turn * shares) if turn else start + (end - start) * shares
        )
    return np.concatenate(points)


def corners(chance, count=7) -> list[complex]:
    """Corners of a star-shaped polygon about 0, counter-clockwise, with room for a tool of 5 mm in its corners."""
    angles = np.sort(chance.uniform(0.0, 0.5, count) + np.arange(count)) * math.tau / count
    return [
        complex(r * math.cos(a), r * math.sin(a))
        for r, a in zip(chance.uniform(38.0, 55.0, count), angles, strict=True)
    ]


def to_polygon(points: np.ndarray, polygon: list[complex]) -> tuple[np.ndarray, np.ndarray]:
    """Distances of points from a polygon's edge, and whether they lie within (by the angle that it sweeps)."""
    near, swept = np.full(len(points), np.inf), np.zeros(len(points))
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        share = np.clip(((points - a) / (b - a)).real, 0.0, 1.0)
        near, swept = np.minimum(near, abs(points - a - share * (b - a))), swept + np.angle((b - points) / (a - points))
    return near, abs(swept) > math.pi


def program(cycle, way, step, spare, polygon, island="LBL 2\nL X+0 Y+0 RR\nLBL 0") -> str:
    body = HEAD.format(cycle=cycle, way=way, step=step, spare=spare)
    line = next(line for line in body.splitlines() if line.startswith(f"CYCL DEF {cycle}"))
    words = [w for w in line.split() if w.split("=")[0] not in (("Q9", "Q14") if cycle == 22 else ())]
    places = [f"X{point.real:+.6f} Y{point.imag:+.6f}" for point in (*polygon, polygon[0])]
    drawn = "\n".join(f"L {place}{' RL' * (not index)}" for index, place in enumerate(places))
    return body.replace(line, " ".join(words)) + f"LBL 1\n{drawn}\nLBL 0\n{island}"


@pytest.mark.parametrize("seed", range(6))
def test_side_finishing_touches_every_wall_and_goes_the_way_asked_for(seed):
    chance = np.random.default_rng(seed)
    polygon, spare, way = corners(chance), (0.0, 0.7)[seed % 2], (1, -1)[seed // 2 % 2]
    x, y = chance.uniform(-3.0, 3.0, 2)
    island = ROUND_ISLAND.format(x=x, y=y, e=x + 8.0)
    moves = read(program(24, way, 1, spare, polygon, island)).moves
    cuts = [row for row in range(len(moves)) if moves.motion[row] and moves.end[row, 2] == moves.start[row, 2] == -6e-3]
    points, reach = dense(moves, cuts), 5.0 + spare
    near, within = to_polygon(points, polygon)
    beside = abs(points - complex(x, y)) - 8.0
    assert (
        within.all() and near.min() == pytest.approx(reach, abs=1e-6) and beside.min() == pytest.approx(reach, abs=1e-6)
    )
    touching = points[near < reach + 1e-6]
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        assert abs(((touching - a) / (b - a)).imag * abs(b - a) - reach).min() < 1e-6
    around = [
        np.sum(np.angle(part[1:] / part[:-1]))
        for part in (points[near < reach + 1e-6] - 0.0, points[beside < reach + 1e-6] - complex(x, y))
    ]
    assert around[0] * way > 5.0 and around[1] * way < -5.0
    assert {round(z * 1e3, 9) for z in moves.end[moves.motion > 0, 2] if z < 0.0} == {-4.0, -6.0}


@pytest.mark.parametrize("seed", range(6))
def test_rough_out_leaves_nothing_that_the_tool_can_reach_and_cuts_nothing_else(seed):
    chance = np.random.default_rng(100 + seed)
    polygon, spare, step = corners(chance), (0.0, 0.7)[seed % 2], chance.uniform(0.4, 0.95)
    x, y, size = *chance.uniform(-14.0, 14.0, 2), chance.uniform(6.0, 14.0)
    island = ROUND_ISLAND.format(x=x, y=y, e=x + size)
    moves = read(program(22, 1, step, spare, polygon, island)).moves
    cuts = [row for row in range(len(moves)) if moves.motion[row] and moves.end[row, 2] == moves.start[row, 2] == -6e-3]
    points, reach = dense(moves, cuts), 5.0 + spare
    near, within = to_polygon(points, polygon)
    assert within.all() and min(near.min(), (abs(points - complex(x, y)) - size).min()) > reach - 0.011
    grid = (np.linspace(-55.0, 55.0, 89) + 1j * np.linspace(-55.0, 55.0, 89)[:, None]).ravel()
    room, in_room = to_polygon(grid, polygon)
    reached = grid[in_room & (np.minimum(room, abs(grid - complex(x, y)) - size) > reach)]  # by the tool's centre
    left = [abs(points - place).min() for place in reached]
    assert max(left) <= 5.0 + 0.02
    moved = abs(moves.end[:, :2] - moves.start[:, :2]).max(axis=1) > 1e-9
    assert moves.end[moved & (moves.motion == 0), 2].min() == moves.start[moved & (moves.motion == 0), 2].min() == 9e-3


@pytest.mark.parametrize("seed", range(4))
def test_a_smaller_tool_mills_just_what_a_larger_one_has_left(seed):
    chance = np.random.default_rng(200 + seed)
    polygon, spare = corners(chance), (0.0, 0.5)[seed % 2]
    text = program(22, 1, 0.8, spare, polygon).replace("1 /2", "1")
    cycle = next(line for line in text.splitlines() if line.startswith("CYCL DEF 22"))
    moves = read(text.replace("M30\n", f"TOOL CALL 2 Z S1000\nL Z+9 FMAX M3\n{cycle} Q18=1\nCYCL CALL\nM30\n", 1)).moves
    cuts = [row for row in range(len(moves)) if moves.motion[row] and moves.end[row, 2] == moves.start[row, 2] == -6e-3]
    coarse, fine = (dense(moves, [row for row in cuts if moves.tool[row] == tool]) for tool in (1, 2))
    near, within = to_polygon(fine, polygon)
    assert within.all() and near.min() > 2.0 + spare - 0.011
    around = zip(polygon, [*polygon[1:], polygon[0]], [*polygon[2:], *polygon[:2]], strict=True)
    sharpest = min(around, key=lambda three: abs(math.pi - cmath.phase((three[2] - three[1]) / (three[1] - three[0]))))[
        1
    ]
    grid = sharpest + (np.linspace(-6.0, 6.0, 49) + 1j * np.linspace(-6.0, 6.0, 49)[:, None]).ravel()
    room, in_room = to_polygon(grid, polygon)
    inside, reached = grid[in_room & (room > spare)], grid[in_room & (room > 2.0 + spare)]
    left = [place for place in inside if abs(coarse - place).min() > 5.02]
    left = [place for place in left if abs(reached - place).min() < 1.9]
    assert left and max(abs(fine - place).min() for place in left) <= 2.0 + 0.02
    assert max(abs(np.array(polygon) - place).min() for place in fine) < 9.0  # nothing away from the corners


@pytest.mark.parametrize("seed", range(8))
def test_a_path_beside_lines_and_arcs_stays_at_its_distance(seed):
    """Chains of lines and tangent arcs: every point of the path is at its distance from the chain, to its left."""
    chance, left = np.random.default_rng(seed), (3.0, -3.0)[seed % 2]
    chain, here, heading = [], 0j, 1.0 + 0.0j
    for turned in chance.uniform(-1.2, 1.2, 6):
        there = here + heading * chance.uniform(14.0, 20.0)
        chain.append((here, there, None, 0))
        turn = 1 if turned > 0.0 else -1
        center = there + turn * 1j * heading * 8.0
        end = center + (there - center) * cmath.exp(1j * turned)
        chain.append((there, end, center, turn))
        here, heading = end, heading * cmath.exp(1j * turned)
    path = path_beside(STATE, BLOCK, chain, left)
    for (start, end, center, turn), (a, b, c, way) in zip(chain, path, strict=True):
        assert (c, way) == (center, turn)
        assert abs(a - start) == pytest.approx(3.0) and abs(b - end) == pytest.approx(3.0)
        if c is not None:
            assert abs(a - c) == pytest.approx(8.0 - turn * left)
    mirrored = path_beside(STATE, BLOCK, backward(chain), -left)
    assert [(b, a) for a, b, _, _ in reversed(mirrored)] == [
        (pytest.approx(a), pytest.approx(b)) for a, b, _, _ in path
    ]


def test_what_does_not_fit_is_refused():
    with pytest.raises(GeometryError, match="gouging"):
        path_beside(
            STATE,
            BLOCK,
            [(0j, 9 + 0j, None, 0), (9 + 0j, 9 + 1j, None, 0), (9 + 1j, 18 + 1j, None, 0), (18 + 1j, 18 - 9j, None, 0)],
            -2.0,
        )
    with pytest.raises(GeometryError, match="turns back"):
        path_beside(STATE, BLOCK, [(0j, 9 + 0j, None, 0), (9 + 0j, 0j + 1, None, 0)], 2.0)
    square = [0j, 30 + 0j, 30 + 30j, 30j]
    with pytest.raises(ProgramError, match="narrower than its tool"):
        read(program(22, 1, 1, 0, [place / 4.0 for place in square], "").replace("1 /2", "1"))
