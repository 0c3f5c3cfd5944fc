"""The benchmark of wild readings, noise and slips: what counts as right, on stub records, and its jobs."""

from __future__ import annotations

from typing import Any

from benchmarks.spoiled import FIRST_SEED, report
from benchmarks.spoiled_bars import (
    false_name,
    figures,
    meant_named,
    named_rows,
    slip_found,
)
from benchmarks.spoiled_cases import GROUPS, make_jobs, noise_remarks, suspects_of_refusal


def record(truth: dict[str, float], verdict: str, plausible: list[str], **more: Any) -> dict[str, Any]:
    effects = [{"effect": name, "size": size, "detectability": 9.0} for name, size in truth.items()]
    return {"group": "outliers", "layout": "tilted", "seed": 1, "hidden": "two", "slip": "", "outliers": 0.02,
            "truth": list(truth), "effects": effects, "verdict": verdict, "plausible": plausible,
            "suspects": [], **more}  # fmt: skip


def test_a_part_of_the_truth_is_no_false_name_and_an_open_list_is_none_either() -> None:
    pair = {"weak_strut": 0.1, "gauge_scale": 0.05}
    assert not false_name(record(pair, "identified", ["weak_strut"]))
    assert not false_name(record(pair, "ambiguous", ["weak_strut", "strut_law"]))
    assert false_name(record(pair, "identified", ["weak_strut", "strut_law"]))


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
    for hidden in ("none", "one", "two"):
        mine = [job for job in few if (job.group, job.hidden) == ("outliers", hidden)]
        assert {j.seed for j in mine if j.outliers == 0.02} == {j.seed for j in mine if j.outliers == 0.1}
    assert all(job.group == "slip" for job in make_jobs(1, 5, ["slip"]))


def test_the_cost_of_wild_readings_is_a_difference_of_shares() -> None:
    def machine(outliers: float, verdict: str) -> dict[str, Any]:
        return record({}, verdict, ["none"], group="outliers", hidden="none", outliers=outliers)

    records = [machine(0.02, "adequate")] * 4 + [machine(0.1, "adequate")] * 3 + [machine(0.1, "unexplained")]
    cost = next(figure for figure in figures(records) if "cost" in figure.what)
    assert (cost.value, cost.cleared) == ("+25.0 points", False)


def test_the_document_does_not_depend_on_the_order_of_records_and_counts_broken_cases() -> None:
    pair = {"weak_strut": 0.1, "gauge_scale": 0.05}
    records = [record(pair, "identified", ["weak_strut", "gauge_scale"]), record(pair, "unexplained", [], seed=2)]
    text, cleared = report(records, "x")
    assert cleared
    assert "2 % wild, two: both in `plausible` | 50.0 %" in text
    assert text == report(records[::-1], "x")[0]
    assert "Cases that broke" in report([*records, {"group": "slip", "seed": 3, "error": "boom"}], "x")[0]
