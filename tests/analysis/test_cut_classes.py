"""Cuts along and across the tool axis: the classes, against angles by hand, and the figures that hang on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.factory import make_analysis
from toolpath_stiff.analysis.loads import LOADS, along_tool_axis, headline_rows, parse_load, plunging_rows
from toolpath_stiff.analysis.results import analyze, required_stiffness_missed
from toolpath_stiff.analysis.statistics import FIGURES, stiffness_figures
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.placement.case_study import case_study_program, wavy_program
from toolpath_stiff.stiffness.model import build_model

TANGENTIAL = parse_load("tangential")


def leaning(degrees: float, about: float = 0.0) -> list[float]:
    """Unit vector at an angle from Z."""
    polar, azimuth = np.radians([degrees, about])
    return [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]


def test_five_degrees_either_sense():
    angles = (0.0, 4.9, 5.1, 45.0, 90.0, 174.9, 175.1, 180.0)
    tangent = np.array([leaning(angle, 70.0) for angle in angles])
    found = along_tool_axis(tangent, np.zeros_like(tangent))
    assert found.tolist() == [True, True, False, False, False, False, True, True]


def test_the_axis_is_that_of_the_pose():
    # Roll by 30 degrees turns +Z into (0, -sin 30, cos 30), pitch into (sin 30, 0, cos 30): the right-hand rule.
    abc = np.radians([[30.0, 0, 0], [0, 30.0, 0], [30.0, 0, 0], [30.0, 0, 90.0], [0, 0, 40.0]])
    tangent = np.array([leaning(30, -90), leaning(30, 0), leaning(0), leaning(30, 0), leaning(0)])
    assert along_tool_axis(tangent, abc).tolist() == [True, True, False, True, True]


def test_a_tip_at_rest_does_not_plunge():
    assert not along_tool_axis(np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.0]])).any()


def test_blocks_change_nothing():
    rng = np.random.default_rng(3)
    abc = np.repeat(rng.uniform(-1.0, 1.0, (3, 3)) * [[0, 0, 1], [1, 1, 1], [0, 1, 0]], 20_000, axis=0)
    tangent = rng.normal(size=(60_000, 3))
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    one_by_one = [along_tool_axis(tangent[i : i + 1], abc[i : i + 1])[0] for i in range(0, 60_000, 997)]
    assert along_tool_axis(tangent, abc)[::997].tolist() == one_by_one


@pytest.mark.parametrize("load", [load for load in LOADS if load != "tangential"] + ["1,0,2"])
def test_other_loads_have_one_class(load):
    tangent, counted = np.array([leaning(0), leaning(90), leaning(180)]), np.array([True, True, False])
    plunging = plunging_rows(parse_load(load), tangent, np.zeros((3, 3)), counted)
    assert not plunging.any()
    assert headline_rows(counted, plunging).tolist() == counted.tolist()


def test_plunges_alone_are_the_headline():
    tangent, counted = np.array([leaning(1), leaning(90), leaning(180)]), np.array([True, False, True])
    everything = np.ones(3, dtype=bool)
    for rows, headline in ((counted, [True, False, True]), (everything, [False, True, False])):
        plunging = plunging_rows(TANGENTIAL, tangent, np.zeros((3, 3)), rows)
        assert headline_rows(rows, plunging).tolist() == headline


ANGLE = st.floats(-np.pi, np.pi)


@given(st.lists(st.tuples(ANGLE, ANGLE, ANGLE, ANGLE, ANGLE, st.booleans()), max_size=12), st.sampled_from(LOADS))
def test_classes_are_disjoint_and_cover_what_counts(rows, load):
    values = np.array(rows, dtype=float).reshape(-1, 6)
    polar, azimuth, abc, counted = values[:, 0], values[:, 1], values[:, 2:5], values[:, 5] > 0.0
    tangent = np.column_stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    plunging = plunging_rows(parse_load(load), tangent, abc, counted)
    headline = headline_rows(counted, plunging)
    np.testing.assert_array_equal(headline | plunging, counted)
    assert not (headline & plunging).any() or np.array_equal(headline, plunging)
    assert headline.any() == counted.any()


PROGRAMS = Path(__file__).parents[2] / "programs"
NIST = load_machine("nist")


def analyzed(text, **options):
    return analyze(NIST, parse_program(text, "part.nc"), **options)


def alone(text, **options):
    """Figures of a program of one class alone."""
    return analyzed(text, **options).to_dict()


def test_plunges_no_longer_rule_the_range_of_the_readmes_example():
    summary = analyze(NIST, read_program(str(PROGRAMS / "pocket.nc"))).to_dict()
    # Three feeds down in the program's text: lines 13, 39 and 65, 5 + 3 + 12 mm.
    assert (summary["plunges"]["moves"], summary["plunges"]["length_mm"]) == (3, pytest.approx(20.0))
    assert summary["headline"] == "across the tool axis"
    assert summary["range_N_per_mm"] < 4_000 and summary["max_N_per_mm"] < 60_000  # 70 853 and 123 770 with plunges
    assert summary["weakest"]["stiffness_N_per_mm"] == summary["min_N_per_mm"]
    assert 120_000 < summary["plunges"]["min_N_per_mm"] == summary["plunges"]["weakest"]["stiffness_N_per_mm"]


def test_a_program_that_only_plunges_says_so():
    summary = analyze(NIST, read_program(str(PROGRAMS / "drilling.nc"))).to_dict()
    assert summary["headline"] == "plunges only"
    assert all(summary[name] == summary["plunges"][name] for name in FIGURES)
    assert {row["headline"] for row in (*summary["per_tool"], *summary["per_operation"])} == {"plunges only"}


def test_the_headline_is_what_a_program_without_its_plunges_has():
    cut, plunge = "G1 X40 F500\nY30\n", "G1 Z-4 F100\n"
    both, across = alone(f"G0 Z0\n{plunge}{cut}"), alone(f"G0 Z-4\n{cut}")
    along = alone(f"G0 Z0\n{plunge}")
    assert along["headline"] == "plunges only"
    for name in FIGURES:
        assert both[name] == pytest.approx(across[name], rel=1e-12)
        assert both["plunges"][name] == pytest.approx(along[name], rel=1e-12)
    assert both["weakest"]["line"] == across["weakest"]["line"] + 1


def test_a_plunge_of_a_leaning_tool():
    # Roll by 20 degrees leans the axis to (0, -sin 20, cos 20): 10 mm along it are a plunge, 10 mm along Z a cut.
    lean = np.radians(20.0)
    down = -0.01 * np.array([0.0, -np.sin(lean), np.cos(lean)])
    pose = (lean, 0.0, 0.0)
    moves = [{"start": (0, 0, 0, *pose), "end": (*down, *pose)}, {"end": (*down[:2], down[2] + 0.01, *pose)}]
    analysis = make_analysis(moves)
    assert analysis.samples.move[analysis.plunging].tolist() == [0] * int((analysis.samples.move == 0).sum())
    assert analysis.to_dict()["plunges"]["length_mm"] == pytest.approx(10.0)


@pytest.mark.parametrize("load", ["normal", "axial", "softest", "z"])
def test_other_loads_count_every_cut(load):
    summary = alone("G1 Z-4 F100\nX40\n", load=load)
    assert summary["headline"] == "all cuts" and summary["plunges"] is None


def test_require_catches_a_weak_plunge():
    analysis = analyzed("G1 Z-4 F100\nG1 X40\n")
    level = analysis.to_dict()["plunges"]["max_N_per_mm"] * 1e3 + 1.0
    assert {line for line, _ in required_stiffness_missed(analysis, level)} == {1, 2}
    assert analysis.weakest_rows and not analysis.plunging[analysis.weakest_rows].any()


STEPS = st.lists(st.sampled_from(["G1 X{}", "G1 Y{}", "G1 Z-{}", "G1 X{0} Z-{0}", "G0 Z{}", "G1 B{}"]), max_size=6)


@settings(deadline=None, max_examples=30)
@given(STEPS, st.integers(1, 9))
def test_the_classes_together_are_the_old_figures(steps, size):
    lines = [step.format(size + i) for i, step in enumerate(steps)]
    analysis = analyzed("\n".join(["F500", *lines, "G1 X20 Y20", ""]))
    counted, plunging = analysis.counted, analysis.plunging
    assert not (analysis.headline & analysis.set_aside).any()
    np.testing.assert_array_equal(analysis.headline | analysis.set_aside, counted)
    whole, summary = stiffness_figures(analysis, counted), analysis.to_dict()
    blocks = [summary, *([summary["plunges"]] if plunging.any() else [])]
    length = [float(analysis.samples.weight[rows].sum()) for rows in (counted & ~plunging, plunging)]
    assert min(block["min_N_per_mm"] for block in blocks) == whole["min_N_per_mm"]
    assert max(block["max_N_per_mm"] for block in blocks) == whole["max_N_per_mm"]
    for name in ("mean_N_per_mm", "mean_deflection_um"):
        mean = np.average([block[name] for block in blocks], weights=length[: len(blocks)])
        assert mean == pytest.approx(whole[name], rel=1e-12)


def test_the_papers_path_has_no_plunges():
    for program in (case_study_program(), wavy_program(40.0)):
        analysis = analyze(NIST, program, origin=(0.15, 0.1, 0.4, 0.0, 0.0, 0.0))
        assert not analysis.plunging.any() and analysis.headline.tolist() == analysis.counted.tolist()


def test_the_table_of_samples_says_the_class_whatever_the_load():
    text = "G0 Z5\nG1 Z-4 F100\nX40\nA3\n"
    for load in ("tangential", "x"):
        frame = analyzed(text, load=load).to_frame()
        found = frame.groupby("line")["cut"].agg(lambda cut: "".join(sorted(set(cut))))
        assert found.to_dict() == {1: "", 2: "plunge", 3: "across", 4: ""}, load


@pytest.mark.parametrize("arc", ["G18 G3 X20 Z25 I20 K0", "G19 G2 Y20 Z25 J20 K0", "G1 Z30 B20"])
def test_the_range_of_cuts_that_begin_within_a_plunge_does_not_depend_on_the_step(arc):
    model, program = build_model(load_machine("nist")), parse_program(f"G21 G90 F600\nG0 Z5\n{arc}\nM30\n")
    origin = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
    coarse, fine = (
        [stiffness_figures(found, found.headline)[key] for key in ("range_N_per_mm", "mean_N_per_mm")]
        for found in (analyze(model, program, origin=origin, step=step) for step in (1e-3, 5e-5))
    )
    assert coarse == pytest.approx(fine, rel=1e-3)
