"""The benchmark of several effects, noise and slips: what counts as right, on stub records, and its jobs."""

from __future__ import annotations

from typing import Any

from benchmarks.several import FIRST_SEED, report
from benchmarks.several_bars import (
    false_name,
    figures,
    meant_named,
    named_rows,
    slip_found,
    strongest_right,
)
from benchmarks.several_cases import GROUPS, make_jobs, noise_remarks, suspects_of_refusal


def record(truth: dict[str, float], verdict: str, plausible: list[str], **more: Any) -> dict[str, Any]:
    effects = [{"effect": name, "size": size, "detectability": 9.0} for name, size in truth.items()]
    return {"group": "pair", "layout": "tilted", "seed": 1, "hidden": "pair", "slip": "", "outliers": 0.02,
            "truth": list(truth), "effects": effects, "verdict": verdict, "plausible": plausible, "not_excluded": {},
            "suspects": [], **more}  # fmt: skip


def test_a_part_of_the_truth_is_no_false_name_and_an_open_list_is_none_either() -> None:
    pair = {"weak_strut": 0.1, "gauge_scale": 0.05}
    assert not false_name(record(pair, "identified", ["weak_strut"]))
    assert not false_name(record(pair, "ambiguous", ["weak_strut", "strut_law"]))
    assert false_name(record(pair, "identified", ["weak_strut", "strut_law"]))


def test_the_strongest_two_are_those_with_the_largest_sizes() -> None:
    three = {"weak_strut": 0.05, "gauge_scale": 0.10, "strut_law": 0.07}
    assert strongest_right(record(three, "identified", ["gauge_scale", "strut_law"]))
    assert not strongest_right(record(three, "identified", ["gauge_scale", "weak_strut"]))
    assert not strongest_right(record(three, "identified", ["gauge_scale", "strut_law", "spindle_compliance"]))


def test_a_refusal_by_the_reader_names_its_row() -> None:
    assert suspects_of_refusal("measurements.csv:152: stiffness ...")[0]["rows"] == [151]


def test_a_slip_is_found_by_its_row_and_named_by_what_belongs_there() -> None:
    slip = {"kind": "sign_of_angle", "rows": [5], "meant": {"a_deg": [12.5]}, "detectability": 9.0}
    found = record({}, "adequate", ["none"], slips=[slip], suspects=[{"rows": [5], "words": "would be 12.5"}])
    other = record({}, "adequate", ["none"], slips=[slip], suspects=[{"rows": [6], "words": "a_deg would be 12.5"}])
    blunt = record({}, "adequate", ["none"], slips=[slip], suspects=[{"rows": [5], "words": "wild"}])
    assert (slip_found(found), meant_named(found)) == (True, True)
    assert (slip_found(other), meant_named(other), named_rows(other)) == (False, False, {6})
    assert (slip_found(blunt), meant_named(blunt)) == (True, False)


def test_a_wrong_noise_is_noticed_only_by_a_sentence_about_it() -> None:
    def document(*why: str) -> dict[str, Any]:
        return {"text": "", "why": why, "warnings": [], "notes": [], "noise": {"origin": "stated: 1 % a reading"}}

    assert noise_remarks(document("The stated noise of 1 % is too small: the repeats show 2.1 %."))
    assert noise_remarks(document("The readings scatter 0.5 times as much as sd_N_per_mm says."))
    assert not noise_remarks(document("Half of the readings are softer.", "Noise stated: 2 %."))


def test_jobs_keep_their_seeds_when_there_are_more_and_compare_on_the_same_machines() -> None:
    few, many = make_jobs(FIRST_SEED, 20), make_jobs(FIRST_SEED, 60)
    assert set(few) <= set(many)
    assert {job.group for job in few} == set(GROUPS)
    for hidden in ("none", "one", "pair"):
        mine = [job for job in few if (job.group, job.hidden) == ("outliers", hidden)]
        assert {j.seed for j in mine if j.outliers == 0.02} == {j.seed for j in mine if j.outliers == 0.1}
    assert all(job.group == "pair" for job in make_jobs(1, 5, ["pair"]))


def test_the_cost_of_wild_readings_is_a_difference_of_shares() -> None:
    def machine(outliers: float, verdict: str) -> dict[str, Any]:
        return record({}, verdict, ["none"], group="outliers", hidden="none", outliers=outliers)

    records = [machine(0.02, "adequate")] * 4 + [machine(0.1, "adequate")] * 3 + [machine(0.1, "unexplained")]
    cost = next(figure for figure in figures(records) if "cost" in figure.what)
    assert (cost.value, cost.cleared) == ("+25.0 points", False)


def test_what_is_listed_as_not_excluded_is_counted_beside_what_is_plausible() -> None:
    pair = {"weak_strut": 0.1, "joint_compliance": 0.05}
    listed = record(pair, "identified", ["weak_strut"], not_excluded={"joint_compliance": 0.02, "gauge_scale": 0.04})
    found = {figure.what: figure.value for figure in figures([listed, record(pair, "unexplained", [])])}
    assert found["pairs: both in `plausible`"].startswith("0.0 %")
    assert found["pairs: both in `plausible` or `not_excluded`"].startswith("50.0 %")
    assert found["pairs: effects in `not_excluded`"] == "1.00"
    assert found["pairs: one that is listed there is hidden"] == "50.0 % (1 of 2)"
    assert found["pairs: probability (%) that is given with it"] == "3.00"


def test_the_document_does_not_depend_on_the_order_of_records_and_counts_broken_cases() -> None:
    pair = {"weak_strut": 0.1, "gauge_scale": 0.05}
    records = [record(pair, "identified", ["weak_strut", "gauge_scale"]), record(pair, "unexplained", [], seed=2)]
    text, cleared = report(records, "x")
    assert not cleared
    assert "pairs: both in `plausible` | 50.0 %" in text
    assert text == report(records[::-1], "x")[0]
    assert "Cases that broke" in report([*records, {"group": "pair", "seed": 3, "error": "boom"}], "x")[0]
