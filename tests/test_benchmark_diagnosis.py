"""The diagnosis benchmark: its statistics against published figures, its counting, and a tiny run."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.bars import holds_truth, mean, middle_of, misnamed, named, share, wilson
from benchmarks.diagnosis import FIRST_SEED, report
from benchmarks.diagnosis_bars import floor_ratio
from benchmarks.diagnosis_cases import Job, choice_is_right, interval_checks, make_jobs, run
from toolpath_stiff.rig import case as rig
from toolpath_stiff.rig.effects import CATALOGUE, at_strength, draw_shape
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
    assert mean("tilted", "of no cases", [], 1.6).cleared is None


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
    assert (named(right), misnamed(right), holds_truth(right)) == (True, False, True)
    assert (named(more), misnamed(more), holds_truth(more)) == (False, True, True)
    assert (named(open_), misnamed(open_), holds_truth(open_)) == (False, False, True)
    assert holds_truth(_record([], "adequate", ["none", "gauge_scale"]))
    assert not holds_truth(_record([], "unexplained", []))


def test_an_effect_without_a_fit_is_beyond_every_floor() -> None:
    assert floor_ratio({"held_out_percent": None}) == float("inf")
    # 0.8 of the root of 2 % and 1 % in squares is 1.789 %.
    assert floor_ratio({"held_out_percent": 1.789}) == pytest.approx(1.0, abs=1e-3)


def test_bars_are_cleared_from_their_value_on() -> None:
    hits = [True] * 19 + [False]
    assert share("tilted", "", hits, at_least=0.95).cleared
    assert not share("tilted", "", hits, at_least=0.96).cleared
    assert share("tilted", "", hits, at_least=0.92, at_most=0.98).cleared
    assert not share("tilted", "", [True] * 20, at_least=0.92, at_most=0.98).cleared


def test_every_case_has_a_seed_of_its_own() -> None:
    jobs = make_jobs(FIRST_SEED, 8, 150, 60)
    seeds = [job.seed for job in jobs]
    assert len(set(seeds)) == len(jobs)
    drawn = {(job.layout, job.seed, job.hidden) for job in jobs}
    assert len({seed for _, seed, _ in drawn}) == len(drawn)
    assert sum(job.group == "one" for job in jobs) == 8 * sum(
        len(rig.effects_of_layout(x)) for x in ("tilted", "paper")
    )


def test_more_cases_of_one_group_leave_the_others_as_they_were() -> None:
    few, many = make_jobs(FIRST_SEED, 3, 5, 4), make_jobs(FIRST_SEED, 8, 50, 20)
    assert set(few) <= set(many)


def test_the_rig_can_hide_every_effect_built_in_one_way_or_the_other() -> None:
    assert set(known_effects()) <= {*CATALOGUE, *(name for fault in FAULTS.values() for name in fault.names)}


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_hidden_parameter_is_found_in_the_document(name: str) -> None:
    rng = np.random.default_rng(1)
    true = at_strength(name, draw_shape(name, rng, 3, ["riser", "table"]), 0.1)
    parameters = [p for p in known_effects()[name].parameters if not p.discrete]
    document = {p.key: {"value": 0.0, "interval": [None, None]} for p in parameters}
    checks = interval_checks(document, true)
    assert [check["key"] for check in checks] == list(document)
    numbers = {key: value for key, value in true.items() if key not in ("strut", "vertex", "direction", "setup")}
    assert sorted(check["true"] for check in checks) == sorted(numbers.values())


def test_intervals_hold_their_ends_and_infinity() -> None:
    fitted = {
        "x_nm_per_N": {"value": 1.0, "interval": [0.0, 2.0]},
        "rate_um_per_min": {"value": 1, "interval": [2, None]},
    }
    assert [c["holds"] for c in interval_checks(fitted, {"x": 0.0, "rate": 1e9})] == [True, True]
    assert [c["holds"] for c in interval_checks(fitted, {"x": 2.1, "rate": 1.9})] == [False, False]


def test_a_choice_is_right_where_the_effect_has_one() -> None:
    assert choice_is_right({"strut": 3}, {"strut": 3, "factor": 0.8})
    assert not choice_is_right({"strut": 4}, {"strut": 3, "factor": 0.8})
    assert choice_is_right({}, {"error": 12.0})
    assert not choice_is_right({}, {"vertex": 0, "radial": 1.0, "vertical": 0.0})


def test_a_tiny_run_prints_every_table() -> None:
    jobs = [Job("one", "paper", 777, "weak_strut"), Job("none", "paper", 778, "none")]
    records = [run(job) for job in jobs]
    assert [r.get("error") for r in records] == [None] * 2
    records = json.loads(json.dumps(records))
    assert records[0]["parameters"][0]["key"] == "factor"
    text, _ = report(records, "python -m benchmarks.diagnosis")
    assert "| paper | none | 1 |" in text
    assert "| weak_strut | 1 |" in text
    assert text == report(list(reversed(records)), "python -m benchmarks.diagnosis")[0]


def test_a_case_that_breaks_is_counted_against_the_run() -> None:
    record = run(Job("one", "paper", 780, "no_such_effect"))
    assert "no_such_effect" in record["error"]
    text, cleared = report([record, run(Job("none", "paper", 781, "none"))], "")
    assert not cleared
    assert "Cases that broke" in text
