from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from tests.browser import needs_browser, opened, run_in
from tests.report.factory import make_analysis, short, spiral
from toolpath_stiff.documents import number
from toolpath_stiff.nc.moves import Unsupported
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.report import analysis_page as page_module
from toolpath_stiff.report.analysis_page import NONE, OUT_OF_REACH, PLUNGE, page, page_rows
from toolpath_stiff.report.pages import json_pieces

EVIL = "</script><script>alert(1)</script>"
VOID = {"meta", "input", "br", "hr", "img", "link"}


class Page(HTMLParser):
    """Elements, attributes and texts of a page; fails where tags do not nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.texts = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self.texts.append("")
        if tag not in VOID:
            self.open.append((tag, len(self.elements) - 1))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        if self.open:
            self.texts[self.open[-1][1]] += data

    def all(self, tag):
        return [text for (name, _), text in zip(self.elements, self.texts, strict=True) if name == tag]

    @property
    def data(self):
        return next(
            json.loads(text)
            for (_, attrs), text in zip(self.elements, self.texts, strict=True)
            if attrs.get("id") == "data"
        )


def render(analysis, required=None, other=None):
    return "".join(page(replace(analysis, required=required, on_other=other), {}))


def column(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype=dtype)


@pytest.fixture(scope="module")
def analysis():
    return spiral()


@pytest.fixture(scope="module")
def parsed(analysis):
    return Page(render(analysis))


def evil_analysis():
    return make_analysis(
        [{"end": (0.1, 0.0, 0.0), "tool": 1}, {"end": (0.1, 0.05, 0.0), "tool": 2}],
        name=f"a{EVIL}&\"'\u2028.nc",
        source=[f"G1 X100 ({EVIL})", "G1 Y50 ; <img src=x onerror=alert(2)> {{script}} \udc80 \u2029"],
        tools=(ToolEntry(1, np.nan, np.nan, f"<b>mill</b>{EVIL}"),),
        warnings=(f"line 1: {EVIL}",),
        unsupported=(Unsupported(1, 9, EVIL, f"<i>{EVIL}"),),
    )


def test_the_page_parses_and_loads_nothing(analysis, parsed):
    for _, attrs in parsed.elements:
        assert not {"src", "href", "srcset", "action", "data"} & set(attrs)
    text = render(analysis).replace('"http://www.w3.org/2000/svg"', "")  # a name that nothing is fetched from
    assert not re.search(r"https?://|//[a-z]+\.|@import|url\(|fetch\(|XMLHttpRequest|import\(", text)
    policy = next(attrs["content"] for _, attrs in parsed.elements if "http-equiv" in attrs)
    assert policy.startswith("default-src 'none'")


def test_only_our_own_script_may_run(parsed):
    script = next(
        text for (tag, attrs), text in zip(parsed.elements, parsed.texts, strict=True) if tag == "script" and not attrs
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = next(attrs["content"] for _, attrs in parsed.elements if "http-equiv" in attrs)
    assert f"script-src 'sha256-{digest}'" in policy


def test_what_comes_from_the_program_stays_text():
    analysis = evil_analysis()
    hostile, harmless = Page(render(analysis)), Page(render(short()))
    assert len(hostile.all("script")) == len(harmless.all("script")) == 2
    assert not hostile.all("img") + hostile.all("b") + hostile.all("i")
    assert hostile.data["source"] == [line.replace("\udc80", "\ufffd") for line in analysis.program.source]
    cells = "".join(hostile.all("td") + hostile.all("code"))
    assert cells.count(EVIL) == 5  # the program, a weakest place, the tool's remark, the word, the reason
    assert EVIL in hostile.all("h1")[0]
    render(analysis).encode("utf-8")


def test_json_for_script_reads_back_and_holds_no_markup():
    value = {"a": "<!-- </ScRiPt> & \u2028\u2029", "b": [1.5, None]}
    text = "".join(json_pieces(value))
    assert json.loads(text) == value
    assert not set("<>&\u2028\u2029") & set(text)
    assert json.loads("".join(json_pieces("a\ud800b"))) == "a\ufffdb"


def test_figures_on_the_page_are_those_of_the_summary(analysis, parsed):
    summary = analysis.to_dict()
    cells = parsed.all("td")
    for name in ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm"):
        assert any(number(summary[name]) in cell for cell in cells)
    for row in summary["per_tool"]:
        assert number(row["mean_N_per_mm"]) in cells
    for sentence in summary["assumptions"]:
        assert sentence in parsed.all("li")


def test_the_samples_on_the_page_are_those_of_the_analysis(analysis, parsed):
    data, samples = parsed.data, analysis.samples
    assert data["count"] == len(samples)
    frame = np.array(data["frame"])
    span = frame[:, 1] - frame[:, 0]
    position = frame[:, 0] + column(data["position"], "<u2").reshape(-1, 3) / 65535 * span
    # Half a step of the 16-bit fractions, and rounding.
    assert (np.abs(position - samples.position * 1e3) <= span / 65535 / 2 + 1e-9).all()
    low, high = data["stiffness_range"]
    stiffness = low + column(data["stiffness"], "<u2") / 65534 * (high - low)
    assert np.abs(stiffness - analysis.at.stiffness / 1e3).max() <= (high - low) / 65534 / 2 + 1e-6
    assert np.array_equal(column(data["line"], "<u4"), samples.line)
    assert np.array_equal(column(data["kind"], "u1") & 7, samples.motion)
    assert np.allclose(column(data["s"], "<f4"), samples.s * 1e3, rtol=1e-6)  # float32 holds seven digits
    lines = [place["line"] for place in analysis.to_dict()["weakest_places"]]
    assert samples.line[data["weakest"]].tolist() == lines


def test_out_of_reach_is_marked():
    beyond = make_analysis([{"end": (0.7, 0.0, 0.0)}, {"end": (0.9, 0.0, 0.0)}], partial=True)
    data = Page(render(beyond)).data
    assert np.array_equal(column(data["stiffness"], "<u2") == NONE, ~beyond.at.reachable)
    assert np.array_equal(column(data["kind"], "u1") >= OUT_OF_REACH, ~beyond.at.reachable)


def test_angles_are_there_when_something_is_tilted():
    tilted = make_analysis([{"end": (0.05, 0.0, 0.0, 0.1, -0.05, 0.0)}])
    data = Page(render(tilted)).data
    low, high = data["angle_ranges"][0]
    roll = low + column(data["angles"][0], "<u2") / 65534 * (high - low)
    assert np.allclose(roll, np.degrees(tilted.samples.abc[:, 0]), atol=(high - low) / 65534)
    assert Page(render(short())).data["angles"] is None


def test_required_and_comparison_are_on_the_page(analysis):
    text = render(analysis, required=5.2e7, other=spiral(load="x"))
    data = Page(text).data
    assert data["required"] == pytest.approx(52_000.0)
    assert len(column(data["other"]["s"], "<f4")) == len(column(data["other"]["stiffness"], "<f4")) > 0
    assert "below the required 52 000 N/mm" in text
    assert "Every cutting move has" in render(analysis, required=1.0)


def test_the_same_analysis_gives_the_same_page(analysis):
    assert render(analysis) == render(spiral())


def test_very_many_samples_are_thinned_aloud_and_keep_the_extremes(analysis, monkeypatch):
    monkeypatch.setattr(page_module, "MOST_SAMPLES", 1200)
    rows = page_rows(analysis)
    assert len(rows) <= 1200 < len(analysis.samples)
    stiffness, counted = analysis.at.stiffness, analysis.counted
    assert stiffness[rows][counted[rows]].min() == stiffness[counted].min()
    assert stiffness[rows][counted[rows]].max() == stiffness[counted].max()
    headline = analysis.headline
    assert stiffness[rows][headline[rows]].max() == stiffness[headline].max()
    text = render(analysis)
    assert f"{number(len(rows))} of the {number(len(analysis.samples))} samples" in text
    weakest = Page(text).data["weakest"]
    assert [int(analysis.samples.line[rows[i]]) for i in weakest] == [
        place["line"] for place in analysis.to_dict()["weakest_places"]
    ]


def test_the_table_of_operations_is_that_of_the_summary(analysis, parsed):
    summary, data = analysis.to_dict(), parsed.data
    rows = [attrs["data-operation"] for name, attrs in parsed.elements if "data-operation" in attrs]
    assert rows == [str(i) for i in range(len(summary["per_operation"]))]
    assert len(rows) == 2
    cells = parsed.all("td")
    for row in summary["per_operation"]:
        assert number(row["mean_N_per_mm"]) in cells
        assert f"{row['first_line']}-{row['last_line']}" in cells
    assert [name for _, name, _ in data["operations"]] == [row["name"] for row in summary["per_operation"]]
    operation = analysis.operations.of_move[analysis.samples.move]
    assert [first for first, *_ in data["operations"]] == [0, int(np.argmax(operation == 1))]


def test_one_operation_has_no_table():
    assert not [1 for _, attrs in Page(render(short())).elements if "data-operation" in attrs]


def test_a_thinned_page_keeps_where_operations_begin(monkeypatch):
    monkeypatch.setattr(page_module, "MOST_SAMPLES", 240)
    analysis = spiral()
    rows = page_rows(analysis)
    assert len(rows) < len(analysis.samples)
    first = np.flatnonzero(np.diff(analysis.operations.of_move[analysis.samples.move])) + 1
    assert set(first) <= set(rows)
    (_, second) = Page(render(analysis)).data["operations"]
    assert rows[second[0]] == first[0]


def rotary_axis_alone():
    return make_analysis([{"end": (0.0, 0.0, 0.0, 0.1, 0.0, 0.0)}])


@needs_browser
@pytest.mark.parametrize("make", [spiral, evil_analysis, rotary_axis_alone])
def test_a_browser_draws_the_page_without_complaint(make, tmp_path):
    file = tmp_path / "report.html"
    analysis = make()
    file.write_text(render(analysis), encoding="utf-8")
    done = opened(file.as_uri(), tmp_path)
    assert "CONSOLE" not in done.stderr
    dom = Page(done.stdout)
    rows = [attrs for _, attrs in dom.elements if "data-line" in attrs and attrs.get("class") == "row"]
    assert 1 <= len(rows) <= len(analysis.program.source)
    assert analysis.program.source[0] in done.stdout.replace("&lt;", "<").replace("&gt;", ">")
    assert "plunges 1" in done.stdout or make is not spiral  # the legend is filled by the script


def test_the_page_knows_which_samples_are_set_aside_and_the_scale(analysis, parsed):
    data = parsed.data
    assert np.array_equal((column(data["kind"], "u1") & PLUNGE) > 0, analysis.set_aside) and analysis.set_aside.any()
    headline = analysis.at.stiffness[analysis.headline] / 1e3
    assert data["scale"]["ends"] == pytest.approx([headline.min(), headline.max()])


@needs_browser
def test_a_click_shows_one_operation_alone(tmp_path):
    done = run_in(render(spiral()), "document.querySelector('[data-operation=\"1\"]').click()", tmp_path)
    assert "CONSOLE" not in done.stderr
    dom = Page(done.stdout)
    assert [attrs.get("class") for name, attrs in dom.elements if name == "tr"].count("chosen") == 1
    (shown,) = [attrs for _, attrs in dom.elements if attrs.get("id") == "operation-shown"]
    assert "hidden" not in shown
    assert "only 2 T2 ball nose" in done.stdout
