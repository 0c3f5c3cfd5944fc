"""The benchmark of descriptions: what counts as right, on stub documents of the agreed form, and its jobs."""

from __future__ import annotations

import math
from typing import Any

from benchmarks.diagnosis_cases import kinds_of
from benchmarks.portrait import FIRST_SEED, report
from benchmarks.portrait_bars import figures, first_right, ratio, right_set
from benchmarks.portrait_cases import in_short, make_jobs
from toolpath_stiff.rig.unknowns import UNKNOWNS

TERM = {"link": "table", "where": None, "direction": "X", "variable": "y", "shape": "square", "size": 3.0,
        "unit": "nm/N", "interval": [2.0, 4.0], "rms_percent": 8.0, "words": "the table gives along X"}  # fmt: skip


def portrait(links: dict[str, float], variables: dict[str, float], held: float | None = 2.4) -> dict[str, Any]:
    """As it stands in diagnose.json."""
    return {
        "text": "...",
        "links": [{"link": link, "probability": p} for link, p in links.items()],
        "variables": [{"variable": variable, "probability": p} for variable, p in variables.items()],
        "terms": [TERM], "indistinguishable": [TERM | {"probability": 0.2}],
        "explained_percent": 90.0, "error_percent": 2.0,
        "held_out_rms_percent": held, "noise_floor_percent": 2.0, "look_elsewhere": 0.001,
    }  # fmt: skip


def record(found: dict[str, Any] | None, hidden: str = "bed_sag", **more: Any) -> dict[str, Any]:
    kind = UNKNOWNS.get(hidden)
    effects = [] if kind is None else [{"links": sorted(kind.links), "variables": sorted(kind.variables), "size": 0.08}]
    verdict = "unexplained" if found else "adequate"
    return {"layout": "tilted", "seed": 1, "hidden": hidden, "effects": effects, "verdict": verdict, "cpu": 4.0,
            "plausible": [], "portrait": in_short(found), **more}  # fmt: skip


def test_a_set_is_right_if_it_holds_the_truth_and_says_something() -> None:
    good = record(portrait({"tool": 0.6, "table": 0.3}, {"x": 0.95}))
    assert right_set(good, "links")
    assert not first_right(good, "links")
    assert first_right(good, "variables")
    assert not right_set(record(portrait({"tool": 0.95}, {"x": 0.95})), "links")
    assert not right_set(record(portrait({}, {})), "links")
    everything = record(portrait(dict.fromkeys(("tool", "table", "frame", "struts", "joints"), 0.2), {"x": 1.0}))
    assert not right_set(everything, "links")
    many = record(portrait({"table": 1.0}, dict.fromkeys("xyz", 0.3) | {"tilt": 0.1}))
    assert not right_set(many, "variables")
    assert not right_set(record(None), "links")


def test_held_out_errors_count_from_the_noise_floor() -> None:
    assert ratio(record(portrait({}, {}, 2.4))) == 1.2
    assert ratio(record(portrait({}, {}, None))) == ratio(record(None)) == math.inf


def test_bars() -> None:
    good, wrong = portrait({"table": 0.9}, {"x": 0.9}), portrait({"tool": 0.9}, {"z": 0.9}, 3.2)
    records = [record(good, seed=k) for k in range(19)] + [record(wrong, seed=19)]
    records += [record(None, "none", seed=20 + k) for k in range(40)] + [record(good, "none", seed=60)]
    found = {figure.what: figure for figure in figures(records)}
    assert found["portrait: links, the set holds the truth"].value == "95.0 % (19 of 20)"
    assert found["portrait: variables, the set holds the truth"].cleared
    assert found["portrait: held-out error at most 1.5 of the noise floor"].cleared
    assert found["unknown: `unexplained` or `described`"].cleared
    assert found["sound machine: a portrait all the same"].cleared  # 1 of 41
    named = [record(None, verdict="identified", seed=90 + k) for k in range(3)]
    found = {figure.what: figure for figure in figures([*records, *named])}
    assert found["unknown: `unexplained` or `described`"].cleared is False
    # A case without a portrait does not count against what portraits say, but does in the line beside it.
    assert found["portrait: links, the set holds the truth"].value == "95.0 % (19 of 20)"
    assert found["unknown: links right, cases without a portrait counted as wrong"].value == "82.6 % (19 of 23)"


def test_what_looks_the_same_as_a_name_is_counted() -> None:
    same = {"links": ["frame", "table"], "variables": ["z"]}
    named = [record(None, verdict="identified", same=same), record(None, verdict="identified", same=None)]
    found = {figure.what: figure for figure in figures(named)}
    assert found["`identified`: something is said to look the same"].value == "50.0 % (1 of 2)"
    assert found["`identified`: links, what looks the same holds the truth"].value == "50.0 % (1 of 2)"
    assert found["`identified`: variables, what looks the same holds the truth"].value == "0.0 % (0 of 2)"


def test_jobs_are_the_same_whatever_else_is_run() -> None:
    jobs = make_jobs(FIRST_SEED, 2, 3)
    assert len(jobs) == 2 * (len(UNKNOWNS) + len(kinds_of("springs", "paper")[1])) + 6
    assert len({(job.layout, job.seed) for job in jobs}) == len(jobs)
    assert set(make_jobs(FIRST_SEED, 1, 0, ["tilted"], ["bed_sag"])) <= set(jobs)
    assert {job.hidden for job in make_jobs(1, 1, 0, ["paper"], built="fem")} == {*kinds_of("fem", "paper")[1]}
    assert "joints_loose" not in kinds_of("fem", "paper")[1]
    assert "damping_plate" not in kinds_of("springs", "paper")[1]


def test_the_document_names_every_failure_and_broken_case() -> None:
    wrong = record(portrait({"tool": 0.9}, {"z": 0.9}, 3.2))
    broken = {"layout": "tilted", "seed": 3, "hidden": "bed_sag", "error": "boom"}
    text, cleared = report([wrong, record(None, "none"), broken], "x")
    assert not cleared
    assert "links wrong; variables wrong; held-out 1.60 of the floor" in text
    assert "tool 90 %" in text
    assert "boom" in text
    assert text == report([record(None, "none"), broken, wrong], "x")[0]
