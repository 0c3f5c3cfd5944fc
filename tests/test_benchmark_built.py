"""`benchmarks.built`: what counts as right, listed, wrong; campaigns; a run that is stopped goes on."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from benchmarks import built
from benchmarks.built_cases import GROUPS, diagnosed, make_jobs, small_campaign
from benchmarks.case_loop import record_of, run_cases
from benchmarks.pages import write_page

TABLE = {"hidden": "floor_tilts", "names": [], "links": ["frame", "table"], "size": 0.1}
STRUT = {"hidden": "strut_weak", "names": ["weak_strut"], "links": ["joints", "one strut", "struts"], "size": 0.1}


def said(verdict, explanations, truths, *, left=1.0, portrait=()):
    return {
        "verdict": verdict,
        "explanations": explanations,
        "entries": len(explanations),
        "truths": truths,
        "after": left,
        "portrait": list(portrait),
    }


@pytest.mark.parametrize(
    ("record", "expected"),
    [
        (said("identified", [["weak_strut"]], [STRUT]), {"named"}),
        (said("identified", [["joint_clearance"]], [STRUT]), set()),  # another name of the same link
        (said("identified", [["table_compliance"]], [STRUT]), {"wrong_link"}),
        (said("identified", [["table_compliance"]], [TABLE]), set()),
        (said("identified", [["spindle_compliance"]], [TABLE]), {"wrong_link"}),
        (said("identified", [["weak_strut", "gauge_scale"]], [STRUT]), {"wrong_link"}),
        (said("identified", [["weak_strut"]], [STRUT, TABLE]), set()),  # half of a pair
        (said("identified", [["weak_strut"]], [STRUT, STRUT]), {"named"}),  # one name that is right of both
        (said("ambiguous", [["gauge_scale"], ["weak_strut"]], [STRUT]), {"listed"}),
        (said("ambiguous", [["a"], ["b"], ["c"], ["weak_strut"]], [STRUT]), set()),
        (said("adequate", [["none"]], [STRUT], left=2.9), {"negligible"}),
        (said("adequate", [["none"]], [STRUT], left=3.1), set()),
        (said("ambiguous", [["table_compliance"]], []), {"called_ill"}),
        (said("ambiguous", [["table_compliance"], ["none"]], []), set()),
        (said("unexplained", [], [TABLE], portrait=["tool", "frame"]), {"right_portrait"}),
        (said("unexplained", [], [STRUT], portrait=["joints"]), {"right_portrait"}),
    ],
)
def test_what_counts(record, expected):
    rules = (built.named, built.wrong_link, built.listed, built.negligible, built.called_ill, built.right_portrait)
    hits = {rule.__name__ for rule in rules if rule(record)}
    ill = {"called_ill"}  # is counted of sound machines, the others are not
    assert (hits - ill if record["truths"] else hits & ill) == expected


def test_campaigns_are_small_and_tell_their_noise():
    for seed in range(12):
        table = small_campaign(seed)
        points, clamps = np.unique(table["point"]), np.unique(table["clamp"])
        assert 12 <= len(points) <= 28
        assert len(clamps) >= len(points) + 2
        assert set(table["direction"]) == {"X", "Y", "Z"}


def test_jobs_have_seeds_of_their_own_and_turn_through_the_kinds():
    jobs = make_jobs(1000, dict.fromkeys(GROUPS, 40), ["fem", "springs"])
    assert len({job.seed for job in jobs}) == len(jobs) == 480
    singles = [job.hidden for job in jobs if (job.built, job.group) == ("fem", "single")]
    assert len(set(singles[: len(set(singles))])) == len(set(singles)) > 15
    assert all(len(set(job.hidden.split(","))) == 2 for job in jobs if job.group == "pair")


def test_a_run_goes_on_where_it_was_stopped(tmp_path):
    jobs = make_jobs(2000, {**dict.fromkeys(GROUPS, 0), "sound": 1}, ["fem", "springs"])
    first = record_of(diagnosed, jobs[0])
    assert "error" not in first, first["error"]
    assert {"before", "after", "verdict", "readings", "cpu"} <= first.keys()
    file = tmp_path / "records.jsonl"
    broken = {"built": "springs", "group": "sound", "seed": jobs[1].seed, "hidden": "none", "error": "stopped"}
    file.write_text(f"{json.dumps(first)}\n{json.dumps(broken)}\n")
    run_cases(jobs, _kept, 1, file, resume=True)
    records = [json.loads(line) for line in file.read_text().splitlines()]
    assert records == [first, asdict(jobs[1]) | {"kept": True}]
    text, _ = built.report([first], "command")
    assert "| fem | sound: called ill |" in text
    assert "springs |" not in text


def _kept(job, folder):
    return {"kept": folder.is_dir()}


def test_every_page_names_the_day_and_the_commit_of_its_run(tmp_path):
    write_page(tmp_path / "page.md", "# A page\n")
    pages = [tmp_path / "page.md", *(Path(__file__).parents[1] / "benchmarks").glob("*.md")]
    assert len(pages) > 8
    for page in pages:
        last = page.read_text(encoding="utf-8").splitlines()[-1]
        assert re.fullmatch(
            r"Run on 20\d\d-\d\d-\d\d.*, (committed as|commit) ([0-9a-f]{7,}(-dirty)?|unknown)\.", last
        ), page


def test_a_draft_is_put_to_readings_that_it_has_not_seen(tmp_path):
    job = make_jobs(8_840_000, {**dict.fromkeys(GROUPS, 0), "draft": 1}, ["springs"])[0]
    record = record_of(diagnosed, job)
    assert "error" not in record, record["error"]
    assert ("same" in record) == ("gone" in record) == bool(record["drafted"])
    draft = {"built": "springs", "group": "draft", "seed": 1, "drafted": ["missing"], "same": True, "gone": True}
    text, cleared = built.report([draft, {**draft, "seed": 2, "drafted": []}], "x")
    assert "| springs | draft: named though gone | 100.0 % (1 of 1)" in text and not cleared
