"""Kinks, slopes and lost work of raw loops, against loops made with known figures."""

from __future__ import annotations

import numpy as np
import pytest

from toolpath_stiff.readings.raw_shape import shape_of

UP = np.linspace(0.0, 1000.0, 9)
FORCE = np.concatenate([UP, np.linspace(1000.0, -1000.0, 17)[1:], -UP[::-1][1:]])
MAIN = [slice(8, 25)]
C = 20e-9  # m/N


def noise(sd: float = 0.1e-6, seed: int = 0):
    return sd * np.random.default_rng(seed).standard_normal(len(FORCE))


def masing(force, limit: float, stuck: float, free: float):
    """A spring that sticks until `limit` N beside one that always gives: Jenkins' element, step by step."""
    found, stretched, last = [], 0.0, 0.0
    for f in force:
        change = f - last
        # Of a change of force the element takes what its friction allows; the rest moves the free spring alone.
        stuck_part = np.clip(stretched + change, -limit, limit) - stretched
        stretched += stuck_part
        found.append((found[-1] if found else 0.0) + stuck * stuck_part + free * (change - stuck_part))
        last = f
    return np.array(found)


def test_a_straight_loop_has_no_shape():
    told = [shape_of(FORCE, C * FORCE + noise(seed=seed), MAIN).kind for seed in range(60)]
    assert sum(map(bool, told)) <= 2


def test_breakaway_of_sticking_joints():
    found = shape_of(FORCE, masing(FORCE, 300.0, 0.5 * C, C) + noise(0.03e-6), MAIN)
    assert found.kind == "sticking"
    # Between two steps of 125 N on the way back: half of that in the breakaway force.
    assert found.force == pytest.approx(300.0, abs=40.0)
    assert (found.first, found.second) == pytest.approx((2.0 / C, 1.0 / C), rel=0.05)
    assert "breaks away at" in str(found)


def test_contacts_that_close():
    y = np.where(np.abs(FORCE) < 400.0, 2.0 * C * FORCE, C * FORCE + 400.0 * C * np.sign(FORCE))
    found = shape_of(FORCE, y + noise(), MAIN)
    assert found.kind == "kink" and str(found).startswith("closes at")
    assert found.force == pytest.approx(400.0, abs=65.0)
    assert (found.first, found.second) == pytest.approx((0.5 / C, 1.0 / C), rel=0.1)


def test_softer_in_tension():
    found = shape_of(FORCE, np.where(FORCE > 0.0, 1.3, 1.0) * C * FORCE + noise(), MAIN)
    assert found.kind == "sides" and np.isnan(found.force)
    assert (found.first, found.second) == pytest.approx((1.0 / (1.3 * C), 1.0 / C), rel=0.03)
    assert "softer in tension" in str(found)


def test_work_lost_is_the_area():
    """A parallelogram of 2 x 1000 N by 3 um."""
    force = np.array([1000.0, -1000.0, -1000.0, 1000.0])
    assert shape_of(force, C * force + np.array([0.0, 0.0, 3e-6, 3e-6]), [slice(0, 2)]).lost == pytest.approx(6e-3)
