"""Removed volume against manifold3d, which unites the swept bodies as polyhedra."""

import numpy as np
import pytest

from tests.cutting.milling import Milling

manifold3d = pytest.importorskip("manifold3d")
CORNERS = 360  # of a circle; polygons of the same area
ROUND = 0.001  # mm, sagitta of chords for arcs


def body(milling):
    """Union of what each move sweeps, mm: hulls of the flat cutter's discs at both ends; arcs by chords.

    What lies on a level is united in the plane.
    """
    radius = milling.cutter.radius * 1e3 / np.sqrt(np.sin(2.0 * np.pi / CORNERS) / (2.0 * np.pi / CORNERS))
    disc, top, levels, bodies = manifold3d.CrossSection.circle(radius, CORNERS), 5.0, {}, []
    for start, end in milling.chords(ROUND):
        places = [disc.translate(point[:2]) for point in (start, end)]
        if abs(start[2] - end[2]) < 1e-9:
            levels.setdefault(round(start[2], 6), []).append(manifold3d.CrossSection.batch_hull(places))
        else:
            heights = start[2], end[2]
            columns = [place.extrude(top - z).translate((0, 0, z)) for place, z in zip(places, heights, strict=True)]
            bodies.append(manifold3d.Manifold.batch_hull(columns))
    for z, areas in levels.items():
        area = manifold3d.CrossSection.batch_boolean(areas, manifold3d.OpType.Add)
        bodies.append(area.extrude(top - z).translate((0, 0, z)))
    return manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)


def pocket(rng):
    """A pocket of two levels from the middle outward, with rounded corners, entered by a ramp, mm."""
    wide, high, level = rng.uniform(14, 26), rng.uniform(8, 16), rng.uniform(0.8, 3.0)
    radius, over = rng.uniform(1.0, 4.0), rng.uniform(1.5, 4.0)
    lines = ["G21 G90 G17 F600", "G0 X0 Y0 Z2"]
    for number in (1, 2):
        depth = -number * level
        lines += [f"G0 Z{depth + level + 0.2:.4f}", f"G1 X{wide / 4:.4f} Z{depth + level / 2:.4f}", f"X0 Z{depth:.4f}"]
        for inset in (2 * over, over, 0.0):
            x, y = wide - inset - 5, high - inset - 5
            if y <= radius:
                continue
            lines += [
                f"G1 X{x:.4f} Y0", f"Y{y - radius:.4f}", f"G3 X{x - radius:.4f} Y{y:.4f} I{-radius:.4f} J0",
                f"G1 X{-x + radius:.4f}", f"G3 X{-x:.4f} Y{y - radius:.4f} I0 J{-radius:.4f}",
                f"G1 Y{-y + radius:.4f}", f"G3 X{-x + radius:.4f} Y{-y:.4f} I{radius:.4f} J0",
                f"G1 X{x - radius:.4f}", f"G3 X{x:.4f} Y{-y + radius:.4f} I0 J{radius:.4f}", "G1 Y0",
            ]  # fmt: skip
        lines.append("G1 X0 Y0")
    return "\n".join([*lines, "G0 Z5", "M30", ""])


@pytest.mark.parametrize("seed", range(10))
def test_the_volume_of_a_pocket_is_that_of_manifold3d(seed):
    milling = Milling(pocket(np.random.default_rng(seed)), low=(-40, -30, -8), high=(40, 30, 0))
    stock = manifold3d.Manifold.cube((80, 60, 8)).translate((-40, -30, -8))
    exact = (stock ^ body(milling)).volume()
    assert milling.removed().sum() * 1e9 == pytest.approx(exact, rel=5e-4)
