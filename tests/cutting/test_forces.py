"""Forces and errors against closed forms and fine sums that share no code with the package."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.forces import force_at, mean_force, peak_force
from toolpath_stiff.cutting.patches import Contact, Patches
from toolpath_stiff.cutting.surface_error import HEIGHTS, floor_error, shares, wall_error

PI = np.pi
TENTH = np.arccos(0.8)  # of a radius of 5 mm, 1 mm wide
FLAT = Cutter(1, 0.010, 0.0, 3, np.radians(30.0))
BALL = Cutter(2, 0.010, 0.005, 2, np.radians(30.0))
BULL = Cutter(3, 0.010, 0.001, 2, np.radians(30.0))
FEED, ON = np.array([[5e-5, 0.0]]), np.ones(1)
VALUES = np.array([800e6, 250e6, 150e6, 20e3, 25e3, 2e3])
COEFFICIENTS = Coefficients(VALUES[:3], VALUES[3:], 0.09 * np.outer(VALUES, VALUES), taper=0.0)
PLAIN = np.diag([20.0, 20.0, 8.0]) * 1e-9
COUPLED = np.array([[25.0, 4.0, 1.0], [4.0, 18.0, -2.0], [1.0, -2.0, 8.0]]) * 1e-9


def patch(height, entry, leave, low=0.0):
    return Patches(np.array([0]), *(np.array([value]) for value in (low, height, entry, leave)))


def sliced(cutter, values, feed, rise, patch, angle, taper=0.0, slices=4000):
    """N of one patch at one angle of flute 0, by slices of equal length of the envelope."""
    corner, (low,), (high,) = cutter.corner_radius, patch.low, patch.high
    bend = min(max(corner, low), high)
    first, last = np.arccos(1 - np.array([low, bend]) / (corner or 1.0)) if low < corner else (0.0, 0.0)
    middle = (np.arange(slices) + 0.5) / slices
    round_part, straight = first + (last - first) * middle, bend + (high - bend) * middle
    kappa = np.append(round_part, np.full(slices, PI / 2))
    z = np.append(corner * (1 - np.cos(round_part)), straight)
    length = np.repeat([corner * (last - first) / slices, (high - bend) / slices], slices)
    reach = cutter.run_out * np.cos(cutter.run_out_angle + 2 * PI * np.arange(cutter.flutes) / cutter.flutes)
    force = np.zeros(3)
    for j in range(cutter.flutes):
        phi = angle - 2 * PI * j / cutter.flutes - cutter.hand * z * np.tan(cutter.helix) / (cutter.diameter / 2)
        chips = [
            m * (feed * np.sin(phi) * np.sin(kappa) - rise * np.cos(kappa))
            + (reach[j] - reach[(j - m) % cutter.flutes]) * np.sin(kappa)
            for m in range(1, cutter.flutes + 1)
        ]
        h = np.maximum(np.min(chips, axis=0), 0.0)
        wrapped = phi % (2 * PI)
        inside = (wrapped >= patch.entry[0]) & (wrapped <= patch.exit[0]) & (h > 0)
        edge = np.minimum(h / taper, 1.0) if taper else 1.0
        t, r, a = (inside * (values[i] * h + values[i + 3] * edge) * length for i in range(3))
        a = a * cutter.hand
        side = r * np.sin(kappa) + a * np.cos(kappa)
        force += [
            np.sum(-t * np.cos(phi) - side * np.sin(phi)),
            np.sum(t * np.sin(phi) - side * np.cos(phi)),
            np.sum(r * np.cos(kappa) - a * np.sin(kappa)),
        ]
    return force


# Closed forms against 36,000 angles and 997 slices (balls 2,003), apart by less than 5e-5 N.
@pytest.mark.parametrize(
    ("cutter", "contact", "newtons"),
    [
        (FLAT, patch(0.003, 0.0, PI), (-99.7447, 147.296, -30.4859)),
        (FLAT, patch(0.003, 0.0, PI / 2), (-107.168, 28.8856, -15.2430)),
        (FLAT, patch(0.003, PI / 2, PI), (7.42342, 118.410, -15.2430)),
        (FLAT, patch(0.003, 0.0, TENTH), (-36.1277, -14.2953, -3.99209)),
        (FLAT, patch(0.003, PI - TENTH, PI), (18.8763, 35.1223, -3.99209)),
        (BALL, patch(0.0005, 0.0, PI), (-13.4316, 38.7133, 56.5652)),
        (BULL, patch(0.001, 0.0, PI), (-23.9725, 40.0000, 23.2289)),
        (BULL, patch(0.003, 0.0, PI), (-68.3035, 105.465, 9.67958)),
    ],
)
def test_mean_forces_of_closed_forms(cutter, contact, newtons):
    force = mean_force(Contact(contact, cutter, COEFFICIENTS, FEED, ON))[0]
    assert tuple(float(f"{value:.6g}") for value in force) == newtons


def test_mean_of_a_slot_to_the_last_digits():
    """The textbook's sums (Altintas, Manufacturing Automation, 2.37) for a slot."""
    n, b, c, (t, r, a, te, re, ae) = 3, 0.003, 5e-5, VALUES
    expected = [-n * b * (r * c / 4 + re / PI), n * b * (t * c / 4 + te / PI), -n * b * (a * c / PI + ae / 2)]
    assert mean_force(Contact(patch(b, 0.0, PI), FLAT, COEFFICIENTS, FEED, ON))[0] == pytest.approx(expected, rel=1e-12)


TAPERED = replace(COEFFICIENTS, taper=1e-6)
ANGLE = st.floats(0.0, 2 * PI)


@given(
    cutter=st.sampled_from([FLAT, BALL, BULL]),
    flutes=st.integers(1, 5),
    helix=st.floats(0.05, 0.9),
    hand=st.sampled_from([1, -1]),
    run_out=st.sampled_from([0.0, 3e-6, 3e-5]),
    arc=st.tuples(ANGLE, ANGLE).filter(lambda pair: abs(pair[0] - pair[1]) > 0.05),
    heights=st.tuples(st.floats(0.0, 0.012), st.floats(0.0002, 0.006)),
    angle=st.floats(-8.0, 8.0),
    rise=st.sampled_from([0.0, -1e-5]),
)
@settings(max_examples=60, deadline=None)
def test_any_cutter_is_the_sum_of_its_slices(cutter, flutes, helix, hand, run_out, arc, heights, angle, rise):
    cutter = replace(cutter, flutes=flutes, helix=helix, hand=hand, run_out=run_out, run_out_angle=0.7)
    contact = patch(sum(heights), min(arc), max(arc), heights[0])
    force = force_at(Contact(contact, cutter, TAPERED, np.array([[5e-5, rise]]), ON), np.array([[angle]]))[0, 0]
    summed = sliced(cutter, VALUES, 5e-5, rise, contact, angle, 1e-6)
    # 4,000 slices miss an end of the arc by a part of a slice. Where the chip begins within a corner, or is thinner
    # than the taper near the tip, Gauss's rule misses it by a part of a node, with the force at the edge along it.
    begins = cutter.corner_radius and (run_out or rise)
    length = heights[1] + np.sqrt(2 * cutter.corner_radius * heights[1])
    missed = flutes / 12 if begins else 0.05 * flutes if cutter.corner_radius else 0.005
    tolerance = 0.004 * np.abs(summed).sum() + 30e3 * length * missed
    assert force == pytest.approx(summed, abs=tolerance)


ECCENTRIC = replace(FLAT, run_out=6e-6, run_out_angle=0.4)


LIGHT = patch(0.001, 0.0, 0.3)  # the force of one tooth is there for a twentieth of a turn


@pytest.mark.parametrize("contact", [patch(0.0035, 0.3, 2.4), LIGHT, patch(0.002, PI - 0.45, PI)])
@pytest.mark.parametrize("cutter", [FLAT, BULL, ECCENTRIC, replace(BALL, helix=0.0), replace(FLAT, flutes=1, hand=-1)])
def test_mean_and_peak_are_those_of_the_turn(cutter, contact):
    angles = np.linspace(0.0, 2 * PI, 2880, endpoint=False)[None]
    force = force_at(Contact(contact, cutter, TAPERED, FEED, ON), angles)[0]
    mean = mean_force(Contact(contact, cutter, TAPERED, FEED, ON))[0]
    assert mean == pytest.approx(force.mean(axis=0), abs=2e-3 * np.ptp(force))
    peak = peak_force(Contact(contact, cutter, TAPERED, FEED, ON))[0]
    largest = force[np.abs(force).argmax(axis=0), range(3)]
    assert peak == pytest.approx(largest, rel=0.02)


def test_run_out_moves_chips_from_flute_to_flute_but_removes_no_more():
    without_edge = replace(TAPERED, edge=np.zeros(3))
    contact, cutter = patch(0.003, 0.0, PI), replace(FLAT, run_out=2e-5, run_out_angle=1.0)
    with_run_out, without = (mean_force(Contact(contact, tool, without_edge, FEED, ON)) for tool in (cutter, FLAT))
    assert with_run_out == pytest.approx(without, rel=1e-12)  # what one flute leaves the next takes
    with_run_out, without = (
        peak_force(Contact(contact, tool, without_edge, FEED, ON))[0, 1] for tool in (cutter, FLAT)
    )
    assert with_run_out > 1.2 * without


def test_stations_do_not_touch_each_other():
    """Rows in any number, stations without any, standing ones; the same as one by one."""
    rng = np.random.default_rng(3)
    station = np.sort(rng.integers(0, 5000, 6000))
    entry = rng.uniform(0.0, 2.0, 6000)
    many = Patches(station, np.zeros(6000), rng.uniform(0.001, 0.004, 6000), entry, entry + rng.uniform(0.1, 4.0, 6000))
    feed = np.stack([rng.choice([0.0, 3e-5, 6e-5], 5000), np.zeros(5000)], axis=1)
    turning = rng.choice([1.0, -1.0], 5000)
    means, peaks = (f(Contact(many, BULL, TAPERED, feed, turning)) for f in (mean_force, peak_force))
    for k in (0, 17, 2048, 4999):
        single = many.take(station == k)
        single = replace(single, station=np.zeros_like(single.station))
        for all_of_them, f in ((means, mean_force), (peaks, peak_force)):
            assert all_of_them[k] == pytest.approx(
                f(Contact(single, BULL, TAPERED, feed[[k]], turning[[k]]))[0], rel=1e-9, abs=1e-9
            )
    still = (feed[:, 0] == 0.0) | ~np.isin(np.arange(5000), station)
    assert not means[still].any()
    assert means[~still].any(axis=1).all()


# Closed antiderivative against 200,000 slices, apart by less than 3e-6 um; heights in mm, errors in um.
@pytest.mark.parametrize(
    ("side", "entry", "leave", "compliance", "microns", "mean"),
    [
        (1, PI - TENTH, PI, PLAIN, (1.70320, 1.00205, 0.397110, 0.127383), 0.877291),
        (0, 0.0, TENTH, PLAIN, (0.124386, 0.602291, 1.02761, 1.21189), 0.692317),
        (0, 0.0, TENTH, COUPLED, (0.131832, 0.659136, 1.16676, 1.40490), 0.779056),
        (1, 0.0, PI, PLAIN, (2.83252, 2.63512, 2.52020, 2.48486), 2.62805),
        (0, 0.0, PI, PLAIN, (-3.84388, -3.31022, -2.75512, -2.48116), -3.16745),
    ],
)
def test_errors_at_heights(side, entry, leave, compliance, microns, mean):
    contact = patch(0.003, entry, leave)
    for height, expected in zip((0.25e-3, 1.25e-3, 2.25e-3, 2.75e-3), microns, strict=True):
        walls = np.full((1, 2, 2), np.nan)
        walls[0, side] = height
        error, _, _ = wall_error(Contact(contact, FLAT, COEFFICIENTS, FEED, ON), compliance[None], walls)
        assert 1e6 * error[0, side] == pytest.approx(np.full(HEIGHTS, expected), abs=1e-5)
        assert np.isnan(error[0, 1 - side]).all()
    walls[0, side] = 0.0, 0.003
    error, deviation, force = wall_error(Contact(contact, FLAT, COEFFICIENTS, FEED, ON), compliance[None], walls)
    assert 1e6 * error[0, side] @ shares()[1] == pytest.approx(mean, abs=1e-5)
    outward = (-1.0, 1.0)[side]
    assert 1e6 * outward * (compliance @ force[0, side])[1] == pytest.approx(mean, abs=1e-5)
    assert 1e6 * deviation[0, side] == pytest.approx(0.3 * abs(mean), abs=1e-5)  # 30 % of all coefficients alike


def test_a_spindle_that_turns_the_other_way_is_the_mirror_image():
    mirror = np.diag([1.0, -1.0, 1.0])
    walls, strip = np.array([[[0.0, 0.003], [0.001, 0.002]]]), np.array([[-0.004, 0.002]])
    for cutter in (FLAT, BULL, replace(FLAT, run_out=4e-6)):
        plain = Contact(patch(0.003, 0.2, 2.5), cutter, TAPERED, FEED, ON)
        turned = Contact(patch(0.003, PI - 2.5, PI - 0.2), replace(cutter, hand=-1), TAPERED, FEED, -ON)
        for f in (mean_force, peak_force):
            assert f(turned) @ mirror == pytest.approx(f(plain), rel=1e-12)
        mirrored = turned, (mirror @ COUPLED @ mirror)[None]
        error, _, _ = wall_error(plain, COUPLED[None], walls)
        assert wall_error(*mirrored, walls[:, ::-1])[0][:, ::-1] == pytest.approx(error, rel=1e-9)
        floor, _ = floor_error(plain, COUPLED[None], strip)
        assert floor_error(*mirrored, -strip[:, ::-1])[0][:, ::-1] == pytest.approx(floor, rel=1e-9)
    contact = patch(0.003, 0.2, 2.5)
    tools = (FLAT, replace(FLAT, hand=-1))
    right_hand, left_hand = (mean_force(Contact(contact, tool, COEFFICIENTS, FEED, ON)) for tool in tools)
    assert left_hand == pytest.approx(right_hand * [1, 1, -1], rel=1e-12)


def test_an_arc_across_the_left_is_mirrored_into_two():
    ramp = np.array([[5e-5, -2e-5]])
    across = np.array([0.0, 3 * PI - 3.8]), np.array([PI - 2.5, 2 * PI])
    image = Patches(np.array([0, 0]), np.zeros(2), np.full(2, 0.003), *across)
    left = mean_force(Contact(patch(0.003, 2.5, 3.8), replace(BALL, hand=-1), COEFFICIENTS, ramp, -ON))
    assert left * [1, -1, 1] == pytest.approx(mean_force(Contact(image, BALL, COEFFICIENTS, ramp, ON)), rel=0.03)
