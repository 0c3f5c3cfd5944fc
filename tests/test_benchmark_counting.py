"""The statistics of the benchmarks against published figures, and their counting."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.bars import holds_truth, middle_of, named, share, wilson
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.stiffness.catalogue import known_effects


# Newcombe (1998), Statistics in Medicine 17, 857: Table I, method 3 (score, without continuity correction).
@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_are_the_published_ones(count: int, of: int, low: float, high: float) -> None:
    assert wilson(count, of) == pytest.approx((low, high), abs=6e-5)  # printed to four digits


@given(of=st.integers(1, 500), part=st.floats(0.0, 1.0))
def test_wilson_intervals_solve_the_score_equation(of: int, part: float) -> None:
    # The interval's ends are the shares p at which the observed one is 1.96 standard errors sqrt(p (1 - p) / n) away.
    count = round(part * of)
    low, high = wilson(count, of)
    assert 0.0 <= low <= count / of <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            assert (count / of - end) ** 2 == pytest.approx(1.959964**2 * end * (1 - end) / of, rel=1e-5)
    assert wilson(of - count, of) == pytest.approx((1.0 - high, 1.0 - low), abs=1e-12)


def test_nothing_counted_says_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    assert share("tilted", "of no cases", [], at_least=0.9).cleared is None
    assert middle_of("tilted", "of no cases", [], 1.6).cleared is None


def test_medians_intervals_cover_the_median() -> None:
    # 400 samples of 81 from a skewed law whose median is ln 2: 95 % within three standard errors of a share (3.3 %).
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(400):
        figure = middle_of("tilted", "", rng.exponential(size=81).tolist())
        low, high = (float(end) for end in figure.interval.split(" to "))
        hits += low - 0.005 <= np.log(2.0) <= high + 0.005  # printed to two digits
    assert 0.917 <= hits / 400 <= 1.0


def _record(truth: list[str], verdict: str, plausible: list[str], **more: Any) -> dict[str, Any]:
    return {"truth": truth, "verdict": verdict, "plausible": plausible, **more}


def test_a_second_name_beside_the_right_one_is_wrong() -> None:
    right = _record(["weak_strut"], "identified", ["weak_strut"])
    more = _record(["weak_strut"], "identified", ["weak_strut", "gauge_scale"])
    open_ = _record(["weak_strut"], "ambiguous", ["weak_strut", "gauge_scale"])
    assert (named(right), holds_truth(right)) == (True, True)
    assert (named(more), holds_truth(more)) == (False, True)
    assert (named(open_), holds_truth(open_)) == (False, True)
    assert holds_truth(_record([], "adequate", ["none", "gauge_scale"]))
    assert not holds_truth(_record([], "unexplained", []))


def test_bars_are_cleared_from_their_value_on() -> None:
    hits = [True] * 19 + [False]
    assert share("tilted", "", hits, at_least=0.95).cleared
    assert not share("tilted", "", hits, at_least=0.96).cleared
    assert share("tilted", "", hits, at_least=0.92, at_most=0.98).cleared
    assert not share("tilted", "", [True] * 20, at_least=0.92, at_most=0.98).cleared


def test_the_rig_can_hide_every_effect_built_in_one_way_or_the_other() -> None:
    assert set(known_effects()) <= {*CATALOGUE, *(name for fault in FAULTS.values() for name in fault.names)}
