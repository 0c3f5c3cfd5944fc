from __future__ import annotations

import copy

import pytest

from tests.report.factory import make_analysis, short, spiral
from toolpath_stiff.analysis.results import compare_summaries
from toolpath_stiff.documents import number
from toolpath_stiff.report.analysis import MOST_OPERATIONS, terminal_text
from toolpath_stiff.report.analysis_tables import comparison
from toolpath_stiff.report.words import WIDTH, duration


@pytest.fixture(scope="module")
def summary():
    return spiral().to_dict()


def test_the_table_shows_the_figures_of_the_summary(summary):
    text = terminal_text(summary)
    for name in ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm"):
        assert number(summary[name]) in text
    assert f"line {summary['weakest']['line']}" in text
    assert summary["weakest"]["text"] in text
    for row in summary["per_tool"]:
        assert number(row["mean_N_per_mm"]) in text
        assert row["remark"] in text


def test_operations_are_listed_if_there_are_several(summary):
    lines = terminal_text(summary).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("operation "))
    for row, line in zip(summary["per_operation"], lines[at + 1 :], strict=False):
        assert line.startswith(f"{row['operation']} {row['name']} ")
        assert number(row["min_N_per_mm"]) in line
        assert f"{row['first_line']}-{row['last_line']}" in line
    assert "operation " not in terminal_text({**summary, "per_operation": summary["per_operation"][:1]})


def test_many_operations_are_counted_and_long_names_cut(summary):
    row = {**summary["per_operation"][0], "name": "long \x1b[2J name " * 20, "weakest": None, "mean_N_per_mm": None}
    many = [{**row, "operation": i + 1} for i in range(100)]
    text = terminal_text({**summary, "per_operation": many})
    assert f"and {100 - MOST_OPERATIONS} more operations in summary.json" in text
    assert max(map(len, text.splitlines())) <= WIDTH
    assert all(c.isprintable() or c == "\n" for c in text)


def test_warnings_are_told_in_full_and_no_line_is_too_long():
    warning = "the spindle stands still while the tool moves through the work " * 6
    text = terminal_text(short(warnings=(warning,), name="n" * 300, source=["x" * 300] * 2).to_dict())
    assert max(map(len, text.splitlines())) <= WIDTH
    assert " ".join(text.split()).endswith(warning.strip())


def test_a_program_cannot_steer_the_terminal():
    text = terminal_text(short(name="a\x1b[2J\r.nc", source=["G1 (\x07\x1b]0;x\x07)"] * 2).to_dict())
    assert all(c.isprintable() or c == "\n" for c in text)


def test_missing_figures_are_a_dash_not_an_error(summary):
    bare = {**summary, "weakest": None, "per_tool": []}
    bare.update(dict.fromkeys(("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm")))
    assert "mean - N/mm" in terminal_text(bare)


def test_comparing_a_machine_with_itself_gives_no_difference(summary):
    change = compare_summaries(summary, copy.deepcopy(summary))["difference_percent"]
    assert set(change.values()) == {0.0}


def test_half_as_stiff_is_minus_fifty_percent(summary):
    half = {**summary, "mean_N_per_mm": summary["mean_N_per_mm"] / 2.0, "machine": "soft"}
    assert compare_summaries(summary, half)["difference_percent"]["mean"] == -50.0
    text = "\n".join(comparison(summary, half).lines())
    assert "-50.0 %" in text
    assert "soft" in text


def test_out_of_reach_is_told():
    beyond = make_analysis([{"end": (0.7, 0.0, 0.0)}, {"end": (0.9, 0.0, 0.0)}], partial=True)
    assert "out of reach and left out" in terminal_text(beyond.to_dict())


@pytest.mark.parametrize(("value", "text"), [(1234567.4, "1 234 567"), (-0.2, "0"), (None, "-"), (float("nan"), "-")])
def test_numbers(value, text):
    assert number(value) == text


@pytest.mark.parametrize(("seconds", "text"), [(59.94, "59.9 s"), (61.0, "0:01:01"), (7384.6, "2:03:05")])
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_plunges_stand_beside_the_headline(summary):
    (line,) = [line for line in terminal_text(summary).splitlines() if line.startswith("plunges ")]
    plunges = summary["plunges"]
    assert f"{number(plunges['length_mm'], 1)} mm in {plunges['moves']} move" in line
    assert f"mean {number(plunges['mean_N_per_mm'])} N/mm, min {number(plunges['min_N_per_mm'])}" in line
    assert "plunges " not in terminal_text(short().to_dict())


def test_a_plunge_weaker_than_all_other_cuts_is_named(summary):
    weak = {**summary, "plunges": {**summary["plunges"], "min_N_per_mm": summary["min_N_per_mm"] - 1.0}}
    words = [" ".join(terminal_text(one).split()) for one in (summary, weak)]
    assert ["weaker than all other cuts" in text for text in words] == [False, True]


def test_what_only_plunges_is_said_to(summary):
    down = make_analysis([{"end": (0.0, 0.0, -0.05)}]).to_dict()
    assert "this program only plunges" in " ".join(terminal_text(down).split())
    first, second = summary["per_operation"]
    text = terminal_text({**summary, "per_operation": [first, {**second, "headline": "plunges only"}]})
    assert "operation 2: figures of plunges, there is no other cut" in text


def test_two_machines_are_compared_by_their_plunges_too(summary):
    half = {**summary, "plunges": {**summary["plunges"], "mean_N_per_mm": summary["plunges"]["mean_N_per_mm"] / 2.0}}
    compared = compare_summaries(summary, half)
    assert compared["plunges_difference_percent"] == -50.0 and set(compared["difference_percent"].values()) == {0.0}
    (row,) = [line for line in comparison(summary, half).lines() if line.startswith("plunges N/mm")]
    assert row.endswith("-50.0 %")
    assert "plunges N/mm" not in "".join(comparison(short().to_dict(), short().to_dict()).lines())
