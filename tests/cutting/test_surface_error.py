"""Walls and floors against a cutter stepped through time, which shares nothing with the package."""

import numpy as np
import pytest

from tests.cutting.simulator import Mill
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.forces import mean_force
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.surface_error import STRIPS, floor_error, shares, wall_error

ALUMINIUM = (767.0, 169.0, 222.0, 27.7, 26.6, 0.7)  # N/mm2, N/mm: 10.1186/s10033-021-00536-9, table 5
STEEL = (2520.0, 756.0, 300.0, 41.0, 41.0, 5.0)
STIFF = np.diag([20.0, 20.0, 8.0]) * 1e-6  # mm/N
SLIM = np.array([[85.0, 14.0, 3.0], [14.0, 78.0, -5.0], [3.0, -5.0, 10.0]]) * 1e-6
MEAN, RANGE, FLOOR = (0.06, 0.15), (0.08, 0.3), 0.3  # of the simulator's, or um

CASES = {
    "light, up": ("left", 1.0, 3.0, {}),
    "light, down": ("right", 1.0, 3.0, {}),
    "finishing, up": ("left", 0.5, 4.0, {"compliance": SLIM}),
    "finishing, down": ("right", 0.5, 4.0, {"compliance": SLIM}),
    "several teeth, up": ("left", 0.2, 6.0, {"compliance": SLIM, "teeth": 4, "helix": 45.0, "feed": 0.03}),
    "several teeth, down": ("right", 0.2, 6.0, {"compliance": SLIM, "teeth": 4, "helix": 45.0, "feed": 0.03}),
    "steel, up": ("left", 2.0, 5.0, {"coefficients": STEEL, "teeth": 4, "helix": 38.0}),
    "steel, down": ("right", 2.0, 5.0, {"coefficients": STEEL, "teeth": 4, "helix": 38.0}),
    "slot": ("both", 10.0, 3.0, {}),
    "half": ("left", 5.0, 3.0, {"compliance": SLIM, "teeth": 2}),
    "thin chips": ("right", 0.02, 4.0, {"compliance": SLIM}),
    "hardly a helix": ("right", 0.5, 4.0, {"compliance": SLIM, "helix": 8.0}),
    "run-out, up": ("left", 0.5, 4.0, {"compliance": SLIM, "run_out": 0.01}),
    "run-out, down": ("right", 0.5, 4.0, {"compliance": SLIM, "run_out": 0.01}),
    "ball": ("both", 10.0, 0.4, {"compliance": SLIM, "ball": True, "teeth": 2}),
}


@pytest.mark.parametrize("name", CASES)
def test_surface_of_a_cutter_stepped_through_time(name):
    side, width, depth, others = CASES[name]
    options = {"teeth": 3, "helix": 30.0, "feed": 0.05, "coefficients": ALUMINIUM, "compliance": STIFF, **others}
    mill = Mill(radius=5.0, depth=depth, width=width, side=side, run_out_angle=0.5, **options)
    arc = np.pi if side == "both" else np.arccos(1.0 - width / 5.0)
    start = np.pi - arc if side == "right" else 0.0
    cutter = Cutter(
        number=1,
        diameter=0.010,
        corner_radius=0.005 * mill.ball,
        flutes=mill.teeth,
        helix=np.radians(mill.helix),
        run_out=mill.run_out / 1e3,
        run_out_angle=0.5,
    )
    coefficients = np.array(mill.coefficients) * [1e6, 1e6, 1e6, 1e3, 1e3, 1e3]
    contact = Patches(np.array([0]), *(np.array([value]) for value in (0.0, depth / 1e3, start, start + arc)))
    known = Coefficients(coefficients[:3], coefficients[3:], np.zeros((6, 6)))
    job = (contact, cutter, known, np.array([[mill.feed / 1e3, 0.0]]), np.ones(1))
    compliance = mill.compliance[None] / 1e3
    # What yields cuts a little otherwise than what is rigid.
    assert mean_force(*job)[0] == pytest.approx(mill.force[-mill.steps :].mean(axis=0), rel=0.02, abs=3.5)
    reach = 1.5 if mill.ball else 4.0
    strip = np.array([[-reach, reach]])
    floor = 1e6 * floor_error(*job, compliance, strip / 1e3)[0][0]
    aside = strip[0, 0] + 2 * reach * (np.arange(STRIPS) + 0.5) / STRIPS
    aside[STRIPS // 2] += 1e-9
    assert floor == pytest.approx(mill.below(aside), abs=FLOOR)
    for which in () if mill.ball else ("left", "right") if side == "both" else (side,):
        walls = np.full((1, 2, 2), np.nan)
        walls[0, int(which == "right")] = 0.0, depth / 1e3
        error = 1e6 * wall_error(*job, compliance, walls)[0][0, int(which == "right")]
        simulated = mill.wall(which)
        assert error @ shares()[1] == pytest.approx(simulated.mean(), rel=MEAN[0], abs=MEAN[1])
        assert np.ptp(error) == pytest.approx(np.ptp(simulated), rel=RANGE[0], abs=RANGE[1])


def test_the_mean_force_would_not_do():
    """A negative control: by the mean force these walls are 20 to 60 % off, beyond the tolerance above."""
    mill = Mill(5.0, 3, 30.0, 3.0, 0.05, ALUMINIUM, STIFF, 1.0)
    by_mean = -1e3 * (STIFF @ mill.force[-mill.steps :].mean(axis=0))[1]
    assert abs(by_mean - mill.wall("left").mean()) > 2 * max(MEAN[0] * mill.wall("left").mean(), MEAN[1])
