"""Figures of each tool and each operation: they are parts of the whole."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.factory import make_analysis, spiral
from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.analysis.statistics import FIGURES, PLUNGES_ONLY, stiffness_figures
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry

TWO = """(PLATE)
T1 M6
G0 X0 Y0 Z5
G1 Z0 F600
X60
G4 P2
G0 Z5
(WALL)
G0 Y20
G1 Z0
X0 F1200
T2 M6
G0 Z50
G1 Y60
X10
M30
"""


def analyzed(text: str, **options: object) -> Analysis:
    return analyze(load_machine("nist"), parse_program(text, "part.nc"), **options)


def test_operations_by_hand() -> None:
    rows = analyzed(TWO).to_dict()["per_operation"]
    assert [row["name"] for row in rows] == ["T1", "WALL", "T2"]
    assert [row["tool"] for row in rows] == [1, 1, 2]
    first, second, third = rows
    # 5 mm down and 60 mm along at 600 mm/min, 2 s of dwell; rapids take the machine's rapid feed.
    rapid = load_machine("nist").rapid_feed * 1e3
    assert first["cutting_length_mm"] == pytest.approx(65.0)
    assert first["rapid_length_mm"] == pytest.approx(5.0 + 5.0)
    assert first["time_s"] == pytest.approx(65.0 / 10.0 + 2.0 + 10.0 / rapid)
    assert second["time_s"] == pytest.approx(5.0 / 10.0 + 60.0 / 20.0 + 20.0 / rapid)
    assert third["cutting_length_mm"] == pytest.approx(50.0)
    assert (first["first_line"], first["last_line"]) == (2, 7)
    assert (second["first_line"], second["last_line"]) == (8, 11)
    assert (third["first_line"], third["last_line"]) == (12, 15)


def check_parts(analysis: Analysis, key: str) -> None:
    """Lengths, times and samples of the parts make the whole; mean, min and max of each class of cuts too.

    A tool that never cuts has no row: its rapids and their time are in none.
    """
    summary = analysis.to_dict()
    rows = summary[key]
    whole = ("rapid_length_mm", "time_s") if key == "per_operation" else ()
    for name in ("cutting_length_mm", "out_of_reach_samples", *whole):
        assert sum(row[name] for row in rows) == pytest.approx(summary[name], abs=1e-9)
    cutting = [row for row in rows if row["mean_N_per_mm"] is not None and row["headline"] == summary["headline"]]
    assert min(row["min_N_per_mm"] for row in cutting) == summary["min_N_per_mm"]
    assert max(row["max_N_per_mm"] for row in cutting) == summary["max_N_per_mm"]
    assert min(row["weakest"]["stiffness_N_per_mm"] for row in cutting) == summary["min_N_per_mm"]
    assert min(row["min_margin"] for row in rows if row["min_margin"] is not None) == summary["min_margin"]
    check_plunges([row["plunges"] for row in rows if row["plunges"]], summary["plunges"])
    if summary["out_of_reach_samples"] == 0:
        beside = [row["plunges"]["length_mm"] if row["plunges"] else 0.0 for row in cutting]
        aside = np.array(beside) * (summary["headline"] != PLUNGES_ONLY)
        length = np.array([row["cutting_length_mm"] for row in cutting]) - aside
        for name in ("mean_N_per_mm", "mean_deflection_um"):
            # Rounding: a mean of means over some hundred samples.
            assert np.average([row[name] for row in cutting], weights=length) == pytest.approx(summary[name], rel=1e-12)


def check_plunges(parts: list[dict[str, Any]], whole: dict[str, Any] | None) -> None:
    if whole is None:
        assert parts == []
        return
    for name in ("samples", "moves", "length_mm"):
        assert sum(part[name] for part in parts) == pytest.approx(whole[name])
    assert min(part["min_N_per_mm"] for part in parts) == whole["min_N_per_mm"]
    assert max(part["max_N_per_mm"] for part in parts) == whole["max_N_per_mm"]
    length = [part["length_mm"] for part in parts]
    assert np.average([part["mean_N_per_mm"] for part in parts], weights=length) == pytest.approx(
        whole["mean_N_per_mm"]
    )


def test_the_parts_make_the_whole() -> None:
    for analysis in (analyzed(TWO), spiral()):
        check_parts(analysis, "per_operation")
        check_parts(analysis, "per_tool")


LINES = st.lists(
    st.sampled_from(
        [
            "G0 X1",
            "G0 X20 Z5",
            "G1 X30 F100",
            "G1 Y4 F50",
            "G1 Z-3 F50",
            "G1 A3 F200",
            "G4 P1",
            "T1 M6",
            "T2 M6",
            "(ROUGH)",
            "(WALL)",
        ]
    ),
    max_size=20,
)


@settings(deadline=None, max_examples=40)
@given(LINES)
def test_the_parts_of_any_program_make_the_whole(lines: list[str]) -> None:
    analysis = analyzed("\n".join([*lines, "G1 X99 Y-5 F100", "X98 Z1"]), step=5e-3)
    check_parts(analysis, "per_operation")
    check_parts(analysis, "per_tool")


def test_an_operation_out_of_reach_has_no_figures() -> None:
    text = "G1 X10 F500\nX0\n(TOO FAR)\nG0 X5000\nG1 X5100\n(BACK)\nG0 X0\nG1 X10\n"
    analysis = analyzed(text, partial=True)
    near, far, back = analysis.to_dict()["per_operation"]
    assert far["name"] == "TOO FAR"
    assert all(far[name] is None for name in (*FIGURES, "weakest", "min_margin", "min_margin_limit"))
    assert far["out_of_reach_samples"] == int(analysis.out_of_reach.sum())
    assert far["cutting_length_mm"] == pytest.approx(100.0)
    assert near["out_of_reach_samples"] == back["out_of_reach_samples"] == 0
    check_parts(analysis, "per_operation")


def test_a_tool_of_two_lengths_is_one_row() -> None:
    moves = [
        {"end": (0.1, 0.0, 0.0), "tool": 1},
        {"end": (0.1, 0.05, 0.0), "tool": 1, "tool_length": 0.08},
        {"end": (0.0, 0.05, 0.0), "tool": 1},
    ]
    rows = make_analysis(moves).to_dict()["per_tool"]
    (row,) = rows
    assert (row["tool"], row["length_mm"]) == (1, None)  # that of its first cut
    assert row["cutting_length_mm"] == pytest.approx(250.0)


def test_the_approach_before_a_tools_length_is_in_force_is_the_tools_time() -> None:
    text = "T3 M6\nG0 X100\nG43 H3 Z20\nG1 Z0 F600\nX90\n"
    program = parse_program(text, "part.nc", controller=Controller(tools={3: ToolEntry(3, length=100.0)}))
    analysis = analyze(load_machine("nist"), program)
    (row,) = analysis.to_dict()["per_tool"]
    assert row["length_mm"] == pytest.approx(100.0)
    assert row["time_s"] == pytest.approx(analysis.to_dict()["time_s"])


def test_the_samples_tell_their_operation() -> None:
    analysis = analyzed(TWO)
    frame = analysis.to_frame()
    assert frame.groupby("operation")["line"].agg(["min", "max"]).to_numpy().tolist() == [[3, 7], [9, 11], [13, 15]]


def test_figures_of_nothing() -> None:
    assert stiffness_figures(spiral(), np.empty(0, dtype=int)) == dict.fromkeys(FIGURES)
