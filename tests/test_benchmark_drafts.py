"""The benchmark of drafts: what counts as confirmed, on stub records, and its jobs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from benchmarks.drafts import FIRST_SEED, NOISE, confirmed, figures, make_jobs, report
from benchmarks.pages import write_page
from toolpath_stiff.rig.unknowns import UNKNOWNS


def record(
    hidden: str, same: str, gone: str = "adequate", links: tuple[str, ...] = ("table",), seed: int = 1
) -> dict[str, Any]:
    def judged(verdict: str) -> dict[str, Any]:
        named = ["missing"] if verdict == "identified" else ["none"]
        return {"verdict": verdict, "explanations": named, "drawn": {"gain": 5.0} if named == ["missing"] else None}

    more = {} if hidden == NOISE else {"gone": judged(gone)}
    return {"seed": seed, "hidden": hidden, "verdict": "unexplained", "drafted": ["missing"], "links": list(links),
            "truth": ["table", "frame"], "judged": {"same": judged(same), **more}}  # fmt: skip


def test_only_an_answer_that_names_the_draft_confirms_it() -> None:
    assert confirmed(record("bed_sag", "identified"), "same")
    assert not confirmed(record("bed_sag", "described"), "same")
    other = record("bed_sag", "identified")
    other["judged"]["same"]["explanations"] = ["table_compliance"]
    assert not confirmed(other, "same")


def test_figures_are_counted_by_what_the_draft_was_read_off() -> None:
    none = record("bed_sag", "identified") | {"judged": {}, "drafted": []}
    records = [
        record("bed_sag", "identified"), record("bed_sag", "ambiguous", "identified", seed=2),
        record("bed_sag", "identified", links=("tool",), seed=3), record(NOISE, "ambiguous", seed=4),
        none | {"seed": 5},
    ]  # fmt: skip
    values = [figure.value for figure in figures(records)]
    assert values == [
        "75.0 % (3 of 4)", "50.0 % (1 of 2)", "100.0 % (1 of 1)", "33.3 % (1 of 3)",
        "100.0 % (1 of 1)", "0.0 % (0 of 1)",
    ]  # fmt: skip
    text, cleared = report(records, "x")
    assert not cleared
    assert text == report(records[::-1], "x")[0]
    assert "no draft: unexplained" in text


def test_more_jobs_leave_the_first_ones_and_all_kinds_come_in_turn() -> None:
    few, many = make_jobs(FIRST_SEED, 5, 2, "springs"), make_jobs(FIRST_SEED, len(UNKNOWNS), 3, "springs")
    assert set(few) <= set(many)
    assert {job.hidden for job in many} == {*UNKNOWNS, NOISE}


def test_every_page_names_the_day_and_the_commit_of_its_run(tmp_path):
    write_page(tmp_path / "page.md", "# A page\n")
    pages = [tmp_path / "page.md", *(Path(__file__).parents[1] / "benchmarks").glob("*.md")]
    assert len(pages) > 8
    for page in pages:
        last = page.read_text(encoding="utf-8").splitlines()[-1]
        assert re.fullmatch(
            r"Run on 20\d\d-\d\d-\d\d.*, (committed as|commit) ([0-9a-f]{7,}(-dirty)?|unknown)\.", last
        ), page
