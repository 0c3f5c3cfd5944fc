"""`index.html` and `summary.csv` of many programs: what they say, that nothing from a file is obeyed, that it sorts."""

from __future__ import annotations

import csv
import re
from html import unescape
from urllib.parse import unquote

import pytest

from tests.browser import needs_browser, run_in
from tests.report.test_report_page import EVIL, Page
from toolpath_stiff.report.batch.index import batch_page
from toolpath_stiff.report.batch.outcomes import ProgramOutcome, summary_csv, terminal_summary
from toolpath_stiff.report.pages import script_hash


def outcome(name, low, mean, high, **more):
    figures = {
        "machine": "nist", "load": "tangential", "force_N": 1000.0, "samples": 10, "cutting_length_mm": 1000.0,
        "rapid_length_mm": 1.0, "time_s": 60.0, "mean_N_per_mm": mean, "min_N_per_mm": low, "max_N_per_mm": high,
        "range_N_per_mm": None if high is None else high - low, "weakest_line": 3, "weakest_text": "G1 X1",
        "out_of_reach_samples": 0, "extrapolated_share": 0.0, "warnings": 0, "not_acted_upon": 0, **more,
    }  # fmt: skip
    return ProgramOutcome(name, f"/jobs/{name}", "", f"{name.removesuffix('.nc')}/report.html", figures)


SOFT, STIFF = outcome("p10.nc", 20e3, 30e3, 60e3), outcome("p9.nc", 40e3, 50e3, 100e3)
BAD = ProgramOutcome("bad.nc", "/jobs/bad.nc", "/jobs/bad.nc:3:1: G77 is not known")


def bars(text):
    """(left, right) of each bar in percent of the scale."""
    found = re.findall(r'<rect class="span[^"]*" x="([\d.]+)%" width="([\d.]+)%"', text)
    return [(float(x), float(x) + float(width)) for x, width in found]


def test_bars_stand_on_one_scale():
    (low_1, high_1), (low_2, high_2) = bars(batch_page([SOFT, STIFF]))
    # One straight scale: the widths are as the ranges, 40 to 60 kN/mm, and the shift as 40 to 20.
    assert (high_2 - low_2) / (high_1 - low_1) == pytest.approx(60 / 40, rel=1e-3)  # two decimals of a percent
    assert (low_2 - low_1) / (high_1 - low_1) == pytest.approx(20 / 40, rel=1e-3)
    assert low_1 >= 0 and high_2 <= 100


PLUNGING = {"headline": "plunges only", "plunge_mean_N_per_mm": 215e3, "plunge_min_N_per_mm": 210e3,
            "plunge_max_N_per_mm": 220e3}  # fmt: skip


def test_a_program_that_only_plunges_does_not_set_the_scale():
    drill = outcome("drill.nc", 210e3, 215e3, 220e3, **PLUNGING)
    text = batch_page([SOFT, drill, STIFF])
    assert bars(text) == bars(batch_page([SOFT, STIFF]))
    assert "210 000" in text and "only plunges" in text


def test_programs_that_only_plunge_set_the_scale_among_themselves():
    text = batch_page([outcome("drill.nc", 210e3, 215e3, 220e3, **PLUNGING)])
    ((left, right),) = bars(text)
    assert 0 <= left < right <= 100 and "only plunges" in text


def test_plunges_beside_have_a_column_of_their_own():
    more = {**PLUNGING, "headline": "across the tool axis", "plunge_length_mm": 12.0}
    one = outcome("a.nc", 20e3, 30e3, 60e3, **more)
    text = batch_page([one])
    assert "215 000" in text and len(bars(text)) == 1
    (row,) = csv.DictReader(summary_csv([one]).splitlines())
    assert (row["headline"], float(row["plunge_min_N_per_mm"])) == ("across the tool axis", 210e3)
    assert "nothing else is cut: drill.nc" in terminal_summary([one, outcome("drill.nc", 1.0, 1.0, 1.0, **PLUNGING)])


def test_the_required_level_is_on_the_scale_and_marks_what_is_below():
    low = outcome("low.nc", 20e3, 30e3, 60e3, required_N_per_mm=150e3, lines_below_required=4)
    text = batch_page([low])
    required = float(re.search(r'class="required" x1="([\d.]+)%"', text)[1])
    (_, high), *_ = bars(text)
    assert high < required <= 100 and '"span below"' in text


def test_the_other_machine_is_a_mark_on_the_same_scale():
    both = {"compare_machine": "soft", "compare_mean_N_per_mm": 5e3, "compare_mean_difference_percent": -83.3}
    text = batch_page([outcome("a.nc", 20e3, 30e3, 60e3, **both)])
    mark = [float(x) for x in re.findall(r'class="other" x1="([\d.]+)%"', text)]
    ((left, right),) = bars(text)
    assert (mark[0] - left) / (right - left) == pytest.approx(-15 / 40, rel=1e-3) and mark[0] >= 0
    assert "mean on the other machine, soft" in text and "-83.3" in text


@pytest.mark.parametrize("value", [1e3, 1.0, 123456.789])
def test_equal_values_are_drawn_too(value):
    ((left, right),) = bars(batch_page([outcome("a.nc", value, value, value)]))
    assert 0 < left < right < 100


def test_a_program_without_stiffness_has_a_row_and_no_bar():
    nothing = outcome("turn.nc", None, None, None, weakest_line=None, weakest_text=None)
    text = batch_page([SOFT, nothing])
    assert len(bars(text)) == 1 and "turn.nc" in text
    assert "No stiffness" in batch_page([nothing])
    assert "turn.nc" in terminal_summary([nothing])


def test_failures_have_their_reason_and_no_row():
    text = batch_page([BAD, SOFT])
    page = Page(text)
    assert "/jobs/bad.nc:3:1: G77 is not known" in page.all("li")
    assert page.all("a") == ["p10.nc"] and "1 of 2 programs failed" in text
    assert Page(batch_page([BAD])).all("table") == []


@pytest.mark.parametrize("name", [EVIL, 'a"b.nc', "ä ü%20#?.nc", "\udcff.nc", "$1{{headline}}.nc", "<b>.nc"])
def test_names_are_text_and_links_lead_to_their_folder(name):
    text = batch_page([outcome(name, 1e3, 2e3, 3e3, weakest_text=EVIL), ProgramOutcome("b", "b", f"b: {EVIL}")])
    page = Page(text)
    (link,) = [attrs["href"] for tag, attrs in page.elements if tag == "a"]
    assert unquote(link, errors="surrogateescape") == f"{name.removesuffix('.nc')}/report.html"
    assert "alert(1)" not in page.all("script")[0] and len(page.all("script")) == 1
    text.encode("utf-8")  # raises for what no file can hold


def test_the_page_runs_its_own_script_alone_and_loads_nothing():
    text = batch_page([SOFT])
    policy = unescape(re.search(r'Content-Security-Policy" content="([^"]+)"', text)[1])
    script = re.search(r"<script>(.*?)</script>", text, re.DOTALL)[1]
    assert "default-src 'none'" in policy and f"script-src '{script_hash(script)}'" in policy
    assert not re.search(r"(?:src|href)=\"(?!p10/)", text) and "://" not in text and "url(" not in text
    assert "script-src" not in batch_page([BAD])


def test_the_table_for_spreadsheets_has_units_in_its_headings_and_a_row_for_failures():
    rows = list(
        csv.DictReader(summary_csv([BAD, outcome("a,b.nc", 1.0, 2.0, 3.0, weakest_text='G1 "X"\x07')]).splitlines())
    )
    assert rows[0]["reason"] == BAD.reason and rows[0]["mean_N_per_mm"] == ""
    assert rows[1]["program"] == "a,b.nc" and float(rows[1]["range_N_per_mm"]) == 2.0
    assert rows[1]["weakest_text"] == 'G1 "X"?' and rows[1]["required_N_per_mm"] == ""


def test_the_terminal_keeps_to_its_width_but_for_reasons():
    long = outcome("n" * 200 + ".nc", 1e3, 2e3, 3e3, weakest_text="X" * 200)
    lines = terminal_summary([long, SOFT, BAD]).splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[-1] == f"  {BAD.reason}"


@needs_browser
@pytest.mark.parametrize(
    ("column", "clicks", "expected"),
    [
        (0, 1, "p9.nc p10.nc turn.nc"),  # numbers within names count as numbers
        (1, 1, "p10.nc p9.nc turn.nc"),  # the lowest; what has none is last, whichever way
        (1, 2, "p9.nc p10.nc turn.nc"),
        (1, 3, "turn.nc p10.nc p9.nc"),  # as given
    ],
)
def test_headings_sort(column, clicks, expected, tmp_path):
    nothing = outcome("turn.nc", None, None, None, weakest_line=None, weakest_text=None)
    click = f'document.querySelectorAll("thead button")[{column}].click();' * clicks
    told = 'document.title = [...document.querySelectorAll("#programs a")].map((link) => link.textContent).join(" ");'
    done = run_in(batch_page([nothing, SOFT, STIFF]), click + told, tmp_path)
    assert "CONSOLE" not in done.stderr
    assert f"<title>{expected}</title>" in done.stdout
    assert len(re.findall("<th [^>]*aria-sort=", done.stdout)) == (1 if clicks < 3 else 0)
