"""Cuts along and across the tool axis: the classes, against angles by hand, and the figures that hang on them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.analysis import LOADS, parse_load
from toolpath_stiff.analysis.cut_classes import along_tool_axis, headline_rows, plunging_rows

TANGENTIAL = parse_load("tangential")


def leaning(degrees: float, about: float = 0.0) -> list[float]:
    """Unit vector at an angle from Z."""
    polar, azimuth = np.radians([degrees, about])
    return [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]


def test_five_degrees_either_sense():
    angles = (0.0, 4.9, 5.1, 45.0, 90.0, 174.9, 175.1, 180.0)
    tangent = np.array([leaning(angle, 70.0) for angle in angles])
    found = along_tool_axis(tangent, np.zeros_like(tangent))
    assert found.tolist() == [True, True, False, False, False, False, True, True]


def test_the_axis_is_that_of_the_pose():
    # Roll by 30 degrees turns +Z into (0, -sin 30, cos 30), pitch into (sin 30, 0, cos 30): the right-hand rule.
    abc = np.radians([[30.0, 0, 0], [0, 30.0, 0], [30.0, 0, 0], [30.0, 0, 90.0], [0, 0, 40.0]])
    tangent = np.array([leaning(30, -90), leaning(30, 0), leaning(0), leaning(30, 0), leaning(0)])
    assert along_tool_axis(tangent, abc).tolist() == [True, True, False, True, True]


def test_a_tip_at_rest_does_not_plunge():
    assert not along_tool_axis(np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.0]])).any()


def test_blocks_change_nothing():
    rng = np.random.default_rng(3)
    abc = np.repeat(rng.uniform(-1.0, 1.0, (3, 3)) * [[0, 0, 1], [1, 1, 1], [0, 1, 0]], 20_000, axis=0)
    tangent = rng.normal(size=(60_000, 3))
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    one_by_one = [along_tool_axis(tangent[i : i + 1], abc[i : i + 1])[0] for i in range(0, 60_000, 997)]
    assert along_tool_axis(tangent, abc)[::997].tolist() == one_by_one


@pytest.mark.parametrize("load", [load for load in LOADS if load != "tangential"] + ["1,0,2"])
def test_other_loads_have_one_class(load):
    tangent, counted = np.array([leaning(0), leaning(90), leaning(180)]), np.array([True, True, False])
    options = (parse_load(load), tangent, np.zeros((3, 3)), counted)
    assert not plunging_rows(*options).any()
    assert headline_rows(*options).tolist() == counted.tolist()


def test_plunges_alone_are_the_headline():
    tangent, counted = np.array([leaning(1), leaning(90), leaning(180)]), np.array([True, False, True])
    assert headline_rows(TANGENTIAL, tangent, np.zeros((3, 3)), counted).tolist() == counted.tolist()
    everything = np.ones(3, dtype=bool)
    assert headline_rows(TANGENTIAL, tangent, np.zeros((3, 3)), everything).tolist() == [False, True, False]


ANGLE = st.floats(-np.pi, np.pi)


@given(st.lists(st.tuples(ANGLE, ANGLE, ANGLE, ANGLE, ANGLE, st.booleans()), max_size=12), st.sampled_from(LOADS))
def test_classes_are_disjoint_and_cover_what_counts(rows, load):
    values = np.array(rows, dtype=float).reshape(-1, 6)
    polar, azimuth, abc, counted = values[:, 0], values[:, 1], values[:, 2:5], values[:, 5] > 0.0
    tangent = np.column_stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    headline, plunging = (rows(parse_load(load), tangent, abc, counted) for rows in (headline_rows, plunging_rows))
    np.testing.assert_array_equal(headline | plunging, counted)
    assert not (headline & plunging).any() or np.array_equal(headline, plunging)
    assert headline.any() == counted.any()
