"""Walls and floors against a cutter stepped through time, which shares nothing with the package."""

from dataclasses import replace

import numpy as np
import pytest

from tests.cutting.simulator import Corner, Mill
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.engagement import engage
from toolpath_stiff.cutting.final_surface import walls_of_passes
from toolpath_stiff.cutting.forces import mean_force
from toolpath_stiff.cutting.patches import Contact, Patches, of_stations
from toolpath_stiff.cutting.stock import box_stock
from toolpath_stiff.cutting.surface_error import STRIPS, floor_error, shares, wall_error
from toolpath_stiff.cutting.tip import axes_at
from toolpath_stiff.cutting.workpiece import stages_of
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.path.sampling import sample_moves

ALUMINIUM = (767.0, 169.0, 222.0, 27.7, 26.6, 0.7)  # N/mm2, N/mm: 10.1186/s10033-021-00536-9, table 5
STEEL = (2520.0, 756.0, 300.0, 41.0, 41.0, 5.0)
STIFF = np.diag([20.0, 20.0, 8.0]) * 1e-6  # mm/N
SLIM = np.array([[85.0, 14.0, 3.0], [14.0, 78.0, -5.0], [3.0, -5.0, 10.0]]) * 1e-6
MEAN, RANGE, FLOOR = (0.07, 0.15), (0.08, 0.3), 0.3  # of the simulator's, or um; 10 and 20 % are promised

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
    job = Contact(contact, cutter, known, np.array([[mill.feed / 1e3, 0.0]]), np.ones(1))
    compliance = mill.compliance[None] / 1e3
    # What yields cuts a little otherwise than what is rigid.
    assert mean_force(job)[0] == pytest.approx(mill.force[-mill.steps :].mean(axis=0), rel=0.02, abs=3.5)
    aside = (np.arange(STRIPS) + 0.5) / STRIPS * 8.0 - 4.0
    strips = np.array([[-4.0, 4.0]])
    if mill.ball:
        aside = np.array([-1.5, -0.3, 1e-6, 0.8, 1.9])
        strips = np.stack([aside, aside], axis=1)
    floors = [1e6 * floor_error(job, compliance, strip[None] / 1e3)[0][0] for strip in strips]
    assert np.concatenate(floors) == pytest.approx(mill.below(aside), abs=FLOOR)
    for climb in () if mill.ball else (-0.05, -1e-5, 2e-5, 0.05):  # of the lowest passes, and where either may be it
        ramp = replace(job, feed=np.array([[mill.feed / 1e3, climb * mill.feed / 1e3]]))
        tilted = np.diag([0.0, 0.0, 1.0]) @ compliance  # the floor's normal leans with the ramp: along z alone
        errors = 1e6 * floor_error(ramp, tilted, strips / 1e3)[0][0]
        assert errors == pytest.approx(mill.below(aside, climb), abs=FLOOR), climb
    for which in () if mill.ball else ("left", "right") if side == "both" else (side,):
        walls = np.full((1, 2, 2), np.nan)
        walls[0, int(which == "right")] = 0.0, depth / 1e3
        error = 1e6 * wall_error(job, compliance, walls)[0][0, int(which == "right")]
        simulated = mill.wall(which)
        assert error @ shares()[1] == pytest.approx(simulated.mean(), rel=MEAN[0], abs=MEAN[1])
        assert np.ptp(error) == pytest.approx(np.ptp(simulated), rel=RANGE[0], abs=RANGE[1])


def test_the_mean_force_would_not_do():
    """A negative control: by the mean force these walls are 20 to 60 % off, beyond the tolerance above."""
    mill = Mill(5.0, 3, 30.0, 3.0, 0.05, ALUMINIUM, STIFF, 1.0)
    by_mean = -1e3 * (STIFF @ mill.force[-mill.steps :].mean(axis=0))[1]
    assert abs(by_mean - mill.wall("left").mean()) > 2 * max(MEAN[0] * mill.wall("left").mean(), MEAN[1])


POCKET = """G21 G90 G17
T1 M6
S6000 M3
G0 X{near} Y{aside} Z5
G1 Z-4 F300
G1 X{rough} F1440
G1 Y20
G0 Z5
G0 X-25 Y0
G1 Z-4 F300
G1 X0 F1440
G1 Y20
G0 Z5
M30
"""


def test_an_inner_corner_of_a_program():
    """The whole way: a program's stock and engagement, which walls stay, their error; against the simulated corner."""
    corner = Corner(5.0, 3, 30.0, 4.0, 0.08, ALUMINIUM, SLIM, 0.5, "right", slices=24, steps=180, turns=44)
    text = POCKET.format(near=-25.5, aside=0.5, rough=-0.5)
    program = parse_program(text, "corner.nc")
    samples = sample_moves(program.moves, 0.1e-3)
    cutter = Cutter(1, 0.010, 0.0, 3, np.radians(30.0))
    stock = box_stock((-0.040, -0.010, -0.010), (0.010, 0.040, 0.0), "")
    engaged = engage(
        stages_of(stock, program.moves, {1: cutter}),
        program.moves,
        samples,
        {1: cutter},
    )
    walls = walls_of_passes(engaged.work, np.zeros(len(samples), int), samples, {1: cutter})[1]
    values = np.array(ALUMINIUM) * [1e6, 1e6, 1e6, 1e3, 1e3, 1e3]
    known = Coefficients(values[:3], values[3:], np.zeros((6, 6)))
    turned, count = axes_at(samples), len(samples)
    compliance = turned.swapaxes(1, 2) @ (SLIM / 1e3) @ turned
    patches, feed = of_stations(engaged.patches, engaged.source), np.tile([[8e-5, 0.0]], (count, 1))
    error, _, _ = wall_error(Contact(patches, cutter, known, feed, np.ones(count)), compliance, walls)
    mean, spread = 1e6 * error[:, 1] @ shares()[1], 1e6 * np.ptp(error[:, 1], axis=1)
    x, y, _ = 1e3 * samples.position.T
    compared = 0
    for past, left, reach in corner.walls():
        if not -4.5 < past < 3.5:
            continue
        at_hand = (np.hypot(x - min(past, 0.0), y - max(past, 0.0)) < 0.06) & np.isfinite(mean)
        at_hand &= (turned[:, 0, 0] > 0.99) == (past < 0.0)
        if at_hand.any():
            compared += 1
            assert mean[at_hand].mean() == pytest.approx(left, rel=0.10, abs=0.5), past
            assert spread[at_hand].mean() == pytest.approx(reach, rel=0.20, abs=1.0), past
    assert compared > 60
