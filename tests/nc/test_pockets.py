"""Milled pockets: what the rings leave and where the tool goes, by a raster of points and distances to a polyline."""

import cmath
import math
from itertools import pairwise

import numpy as np
import pytest

from toolpath_stiff.nc.pockets import Outline, edge, pocket


def walked(cuts, start: complex) -> np.ndarray:
    """Points of the tool's centre along cuts (x, y, height), each move in 80 points."""
    here, height, points = start, math.inf, []
    for place, floor, feed, center, turn in cuts:
        if center is None:
            points += [(here + (place - here) * t, max(height, floor), feed) for t in np.linspace(0.0, 1.0, 80)]
        else:
            begin, sweep = here - center, turn * (cmath.phase((place - center) / (here - center)) * turn % math.tau)
            sweep = sweep or turn * math.tau
            points += [
                (center + begin * cmath.exp(1j * sweep * t), max(height, floor), feed)
                for t in np.linspace(0.0, 1.0, 80)
            ]
        here, height = place, floor
    return np.array([(point.real, point.imag, floor) for point, floor, feed in points if feed is not None])


def inside(outline: Outline, points: np.ndarray) -> np.ndarray:
    """How far points lie inside a rectangle with rounded corners (negative: outside), from its definition."""
    turned = (points[:, 0] + 1j * points[:, 1] - outline.middle) * cmath.exp(-1j * outline.angle)
    local = np.abs(np.column_stack([turned.real, turned.imag]))
    x, y = local[:, 0] - outline.length / 2.0 + outline.corner, local[:, 1] - outline.width / 2.0 + outline.corner
    beyond = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
    return outline.corner - np.where((x > 0.0) & (y > 0.0), beyond, np.maximum(x, y))


@pytest.mark.parametrize("seed", range(6))
def test_rings_leave_nothing_and_stay_inside(seed):
    chance, radius = np.random.default_rng(seed), 5.0
    length, width = chance.uniform(12.0, 60.0, 2)
    shape = Outline(
        complex(*chance.uniform(-9.0, 9.0, 2)), length, width, chance.uniform(radius, min(length, width) / 2.0),
        chance.uniform(0.0, 3.0),
    )  # fmt: skip
    center, way = shape.grown(-radius), ("", "ramp", "helix")[seed % 3]
    sizes = (min(center.length, center.width) / 2.0, 1.0) if way == "helix" else (center.length / 2.0, 0.05)
    step = chance.uniform(2.0, 1.4 * radius)  # beyond sqrt(2) radii sharp corners of rings leave something between them
    cuts = list(pocket(center, step, ([-2.0, -4.0], 1.0, 1.0), (9.0, 9.0), 1, (way, *sizes)))
    cuts += edge(center, ([-4.0], 1.0, 1.0), (9.0, 9.0), -1, min(2.0, center.width / 2.0, center.length / 2.0))
    path = walked(cuts, shape.middle)
    assert inside(center, path).min() > -1e-9
    floor = path[np.abs(path[:, 2] + 4.0) < 1e-9][:, :2]
    grid = np.stack(np.meshgrid(*[np.linspace(-45.0, 45.0, 41)] * 2), -1).reshape(-1, 2)
    grid = np.add(grid, (shape.middle.real, shape.middle.imag))
    pocketed = grid[inside(shape, grid) > 0.0]
    nearest = [np.hypot(*(floor - point).T).min() for point in pocketed]
    assert max(nearest) <= radius + 0.06  # points of the path are up to 0.75 mm apart: sqrt(5^2 + 0.38^2) - 5 = 0.015
    assert {round(z, 9) for z in path[:, 2] if z in (-2.0, -4.0)} == {-4.0, -2.0}


@pytest.mark.parametrize("turn", [1, -1])
def test_a_stud_is_touched_and_never_cut(turn):
    stud, radius = Outline(3 + 2j, 30.0, 20.0, 4.0, 0.7), 5.0
    cuts = list(edge(stud.grown(radius), ([-4.0], 1.0, 1.0), (9.0, 9.0), turn, -radius))
    beside = -inside(stud, walked(cuts, cuts[0][0]))
    assert radius - 1e-9 < beside.min() < radius + 1e-6
    turned = sum(((a - 3 - 2j).conjugate() * (b - 3 - 2j)).imag for (a, *_), (b, *_) in pairwise(cuts[3:-1]))
    assert turned * turn > 0.0
