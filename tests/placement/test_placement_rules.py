"""What a recommended placement keeps: never worse than now, rapids, margins, strut law, bounds."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toolpath_stiff as tps
from tests.machine.test_machine_kinds import SPINDLE
from tests.placement.test_placement_search import MODEL, TANGENTIAL, headline_figures, program_of
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.cli.main import main
from toolpath_stiff.defaults import OBJECTIVES
from toolpath_stiff.errors import UnreachableError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.placement.climb import Climber
from toolpath_stiff.placement.evaluator import Evaluator
from toolpath_stiff.placement.goals import Bounds, Goal, SearchRules
from toolpath_stiff.placement.linear_programmes import least_costs
from toolpath_stiff.placement.paths import representative_path, work_path
from toolpath_stiff.placement.search import search_placements
from toolpath_stiff.placement.working import NO_FLOORS, Search
from toolpath_stiff.stiffness.model import build_model

ROOT = Path(__file__).parents[2]
# Height and turn alone: for what does not depend on X and Y, which a search pays for twice over.
UPRIGHT_BOUNDS = Bounds(np.array([0, 0, 0.4, 0, 0, 0]), np.array([0, 0, 1.25, 0, 0, 2 * np.pi]))
README_BOUNDS = Bounds(np.array([-0.3, -0.3, 0.4, 0, 0, 0]), np.array([0.3, 0.3, 1.25, 0, 0, 2 * np.pi]))
PRESENT = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
NIST = load_machine("nist")
STEP = 8e-3  # m


def searched(program, bounds=README_BOUNDS, present=PRESENT, step=STEP, **asked):
    path = work_path(program, step, TANGENTIAL)
    return search_placements(Search(MODEL, path, TANGENTIAL, bounds, SearchRules(**asked), present=np.array(present)))


@pytest.mark.parametrize(
    ("name", "objective"),
    [("pocket", "balanced"), ("pocket", "range"), ("inch_bracket", "mean"), ("inch_bracket", "weakest")],
)
def test_never_worse_than_the_present_placement(name, objective):
    """Told by plain analysis of both placements; the README's own bounds, where a corner was recommended once.

    Every objective once; all of them on all programs: `benchmarks/placement.py`.
    """
    program = program_of(name)
    found = searched(program, objective=objective)
    best = analyze(NIST, program, origin=tuple(found.front[found.best]), step=STEP)
    before = analyze(NIST, program, origin=PRESENT, step=STEP)
    now, then = headline_figures(best), headline_figures(before)
    assert now["mean_N_per_mm"] >= then["mean_N_per_mm"]
    assert now["range_N_per_mm"] <= then["range_N_per_mm"]
    assert now["min_N_per_mm"] >= then["min_N_per_mm"]
    assert best.at.reachable.all()  # rapids too
    assert not best.warnings
    assert not best.at.extrapolated[best.samples.cutting].any()
    goal = Goal(OBJECTIVES[objective], NO_FLOORS)
    no_worse = (found.figures.objectives >= found.present.objectives).all(axis=1)
    assert goal.value(found.best_figures)[0] >= goal.value(found.figures)[no_worse].max() - 1e-6


def test_the_present_placement_stays_where_nothing_is_better():
    """Only a turn may vary about the axis of a round part: one must not pay for a difference that is none."""
    bounds = Bounds(np.array(PRESENT), np.array([0.0, 0.0, 0.8, 0.0, 0.0, 0.1]))
    found = searched(program_of("inch_bracket"), bounds)
    assert (found.best_figures.objectives >= found.present.objectives - 1e-9 * found.present.mean[0]).all()


STIFF_ALIKE = """name = "alike"
kind = "serial"
[limits]
X_mm = [-400.0, 400.0]
Y_mm = [-220.0, 220.0]
Z_mm = [0.0, 450.0]
"""


def test_nothing_gets_worse_on_a_machine_that_is_as_stiff_everywhere(tmp_path):
    """Its range is 0 but for rounding, which no placement makes better or worse."""
    (tmp_path / "alike.toml").write_text(STIFF_ALIKE + SPINDLE)
    slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X41 Y3\nG1 Y30\nM2\n", name="slot.nc")
    placed = tps.place(slot, tmp_path / "alike.toml", x_mm=(-90, 70), z_mm=(100, 300), rotate_deg=(0, 40), step_mm=4)
    assert placed.worse == []


def test_what_must_give_way_is_said_first(tmp_path, capsys):
    out = tmp_path / "out"
    command = ["place", str(ROOT / "programs/pocket.nc"), "--x", "100:300", "--y=-300:300", "--z", "400:700"]
    assert main([*command, "--rotate", "0", "--step", "4", "--out", str(out)]) == 0
    printed = capsys.readouterr().out.splitlines()
    summary = json.loads((out / "placement.json").read_text())
    assert {row["figure"] for row in summary["worse"]} == {"mean", "range", "weakest"}
    for row, line in zip(summary["worse"], printed, strict=False):
        assert line.startswith("warning         WORSE")
        chosen, before = (f"{row[key]:,.0f}".replace(",", " ") for key in ("chosen_N_per_mm", "before_N_per_mm"))
        assert f"one, {chosen} instead of {before} N/mm" in line
        sign = -1.0 if row["figure"] == "range" else 1.0
        assert row["worse_by_N_per_mm"] == pytest.approx(sign * (row["before_N_per_mm"] - row["chosen_N_per_mm"]))
    # The present placement lies outside; the hints to widen are options of the command itself.
    hints = [text for text in summary["warnings"] if "widen it with" in text]
    assert any("--x=0:300" in text for text in hints) and any("--z=400:850" in text for text in hints)
    # What warns, warns everywhere.
    page = (out / "report.html").read_text()
    for text in summary["warnings"]:
        assert f"<li>{text}</li>" in page
        assert f"warning         {text}" in printed
    if shutil.which("pdftotext"):
        done = subprocess.run(["pdftotext", str(out / "setup.pdf"), "-"], capture_output=True, text=True, check=True)
        told = " ".join(done.stdout.split())
        for text in summary["warnings"]:
            assert text[:60] in told


def test_least_worse_is_found_where_all_are_worse():
    """The largest loss of the recommendation is no larger than that of any of 3,000 placements at random."""
    bounds = Bounds(np.array([0.1, -0.3, 0.4, 0, 0, 0]), np.array([0.3, 0.3, 0.7, 0, 0, 0]))
    program = program_of("pocket")
    found = searched(program, bounds)
    evaluator = Evaluator(MODEL, work_path(program, STEP), TANGENTIAL, 1000.0)
    unit = np.random.default_rng(11).uniform(size=(3000, len(bounds.free)))
    others = evaluator.figures(bounds.placements(unit)).objectives
    loss = np.nanmin((found.present.objectives - others).max(axis=1))
    assert (found.present.objectives - found.best_figures.objectives).max() <= loss


def test_a_rapid_is_a_constraint_like_a_cut():
    """A retract 700 mm above the part: cuts alone would let it rise out of the machine."""
    text = "G21 G90 F500\nG0 X0 Y0\nG0 Z700\nG0 Z5\nG1 Z0\nG1 X40\nG1 Y30\nG1 X0 Y0\nG0 Z700\nM2\n"
    program = parse_program(text, "high.nc")
    found = searched(program, UPRIGHT_BOUNDS, objective="mean")
    assert (found.figures.rapid_margin >= 0.01).all()
    for placement in (found.front[found.best], found.front[0], found.front[-1]):
        assert analyze(NIST, program, origin=tuple(placement), step=STEP).at.reachable.all()
    # It does bind: without the rapids the search goes higher.
    low = parse_program(text.replace("Z700", "Z6"), "low.nc")
    assert searched(low, UPRIGHT_BOUNDS, objective="mean").front[:, 2].max() > found.front[:, 2].max() + 0.05


def test_a_homing_rapid_out_of_reach_is_named_and_no_constraint(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = "G21 G90 F500\nG0 X0 Y0 Z50\nG0 Z5\nG1 Z0\nG1 X40\nG1 Y30\nG1 X0 Y0\nG0 Z50\nG53 G0 Z2500\nM2\n"
    Path("home.nc").write_text(text)
    command = ["place", "home.nc", "--x=-100:100", "--y=-100:100", "--z", "700:1000", "--step", "5", "--out", "out"]
    assert main([*command, "--no-plots"]) == 0
    summary = json.loads(Path("out/placement.json").read_text())
    assert any(text.startswith("line 9:") and "rapid moves are out of reach" in text for text in summary["warnings"])
    first = summary["warnings"][0]
    assert first.startswith("the recommended placement is out of reach: it has a margin of -") and "in line 9" in first
    told = " ".join(capsys.readouterr().out.split())
    assert told.startswith(f"warning {first} program") and "line 9:" in told and "margin -" in told


def test_a_homing_rapid_through_a_keep_out_is_named(tmp_path):
    part = tmp_path / "slab.nc"
    part.write_text("G21 G90 F500\nG0 X0 Y0 Z50\nG1 Z0\nG1 X20\nG0 X0 Z50\nG53 G0 Z1150\nM2\n")
    command = ["place", str(part), "--x", "0", "--y", "0", "--z", "800", "--rotate", "0", "--no-plots"]
    assert main([*command, "--keep-out", "slab:-99,-99,1000,99,99,1100", "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out/placement.json").read_text())
    words = "the recommended placement runs 50.0 mm deep into the keep-out slab in line 6"
    assert any(text.startswith(words) for text in summary["warnings"])


@pytest.mark.parametrize("margin", [0.01, 0.2])
def test_margins_are_kept_by_cuts_and_rapids(margin):
    bounds = Bounds(np.array([-0.5, -0.5, 0.6, 0, 0, 0]), np.array([0.5, 0.5, 1.4, 0, 0, 0]))
    found = searched(program_of("case_study"), bounds, margin=margin, allow_extrapolation=True)
    assert found.figures.margin.min() >= margin
    assert found.figures.rapid_margin.min() >= margin


def test_a_margin_that_cannot_be_had_is_one_error():
    with pytest.raises(UnreachableError, match=r"margin of .* --margin 49"):
        searched(program_of("case_study"), UPRIGHT_BOUNDS, margin=0.49)


def test_a_present_placement_with_less_margin_is_told(tmp_path, capsys):
    command = ["place", str(ROOT / "programs/pocket.nc"), "--origin", "0,0,1480", "--x=-100:100", "--y=-100:100"]
    command += ["--z", "900:1480", "--rotate", "0", "--step", "5", "--no-plots", "--out", str(tmp_path), "--margin"]
    assert main([*command, "15"]) == 0
    summary = json.loads((tmp_path / "placement.json").read_text())
    least = min(summary["before"]["extrapolated_share"], 1.0)
    assert summary["chosen"]["extrapolated_share"] <= least
    assert any("present placement has a margin of" in text for text in summary["warnings"])
    assert min(row["margin"] for row in summary["front"]) >= 0.15


def test_no_larger_share_outside_the_strut_law_unless_allowed():
    """High up the struts are shorter than the law was measured at, and stiffer by extrapolation."""
    bounds = Bounds(np.array([0, 0, 0.8, 0, 0, 0]), np.array([0, 0, 1.4, 0, 0, 2 * np.pi]))
    program = program_of("three_tools")
    kept = searched(program, bounds, objective="mean")
    assert kept.present.extrapolated[0] == 0.0
    assert (kept.figures.extrapolated == 0.0).all()
    allowed = searched(program, bounds, objective="mean", allow_extrapolation=True)
    assert allowed.figures.extrapolated.max() > 0.0
    assert allowed.figures.mean.max() > kept.figures.mean.max()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(1, 60))
def test_the_linear_programmes_are_those_of_highs(seed, n, m):
    from scipy.optimize import linprog

    rng = np.random.default_rng(seed)
    cost, matrix = rng.normal(size=n) * (rng.uniform(size=n) < 0.7), rng.normal(size=(m, n)).round(1)
    low, high = -rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 2.0, n)
    right = matrix @ rng.uniform(low, high) + rng.choice([0.0, 0.3, -0.2], m)  # degenerate, and now and then impossible
    ours = least_costs([(cost, matrix, right, low, high)])[0]
    theirs = linprog(cost, matrix, right, bounds=np.stack([low, high], axis=1), method="highs")
    assert (ours is None) == (theirs.x is None)
    if ours is not None:
        assert cost @ ours == pytest.approx(theirs.fun, abs=1e-7)
        assert (matrix @ ours <= right + 1e-8).all() and (low - 1e-8 <= ours).all() and (ours <= high + 1e-8).all()


def test_linear_programmes_solved_together_are_those_solved_alone():
    rng = np.random.default_rng(8)
    programmes = []
    for m in (3, 40, 1, 200, 12, 25):
        matrix, bound = rng.normal(size=(m, 6)), rng.uniform(0.5, 2.0, 6)
        programmes.append((rng.normal(size=6), matrix, rng.uniform(-0.1, 0.4, m), -bound, bound))
    programmes[4] = (*programmes[4][:2], np.full(12, -50.0), *programmes[4][3:])  # impossible
    together = least_costs(programmes)
    assert together[4] is None
    for programme, ours in zip(programmes, together, strict=True):
        alone = least_costs([programme])[0]
        assert (ours is None) == (alone is None)
        if ours is not None:
            np.testing.assert_allclose(ours, alone, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("name", "objective", "tilt"),
    [("tilted_five_axis", "mean", 0), ("arcs_in_planes", "range", 0), ("pocket", "mean", 15)],
)
def test_within_two_thousandths_of_brute_force_with_polish(name, objective, tilt):
    """6,000 placements at random, of which the best in several places are polished by scipy's simplex search."""
    from scipy.optimize import minimize

    path = representative_path(work_path(program_of(name), 5e-3, TANGENTIAL), 60)
    lean = np.radians(tilt)
    bounds = Bounds(np.array([-0.3, -0.3, 0.4, -lean, -lean, 0]), np.array([0.3, 0.3, 1.25, lean, lean, 2 * np.pi]))
    evaluator, rules, goal = (
        Evaluator(MODEL, path, TANGENTIAL, 1000.0),
        SearchRules(margin=0.01),
        Goal(OBJECTIVES[objective], NO_FLOORS),
    )

    def worth(placements):
        figures = evaluator.figures(placements)
        return goal.value(figures) - 1e10 * rules.violation(figures)

    tried = np.random.default_rng(21).uniform(size=(6000, len(bounds.free)))
    value = worth(bounds.placements(tried))
    ranked = tried[np.argsort(-np.nan_to_num(value, neginf=-1e12), kind="stable")]
    firsts = ranked[bounds.apart(bounds.placements(ranked), 3)]
    polished = [
        -minimize(
            lambda u: -worth(bounds.placements(u[None]))[0] / 1e6, first, method="Nelder-Mead", options={"maxfev": 150}
        ).fun
        * 1e6
        for first in firsts
    ]
    found = search_placements(
        Search(MODEL, path, TANGENTIAL, bounds, SearchRules(objective=objective, allow_extrapolation=True))
    )
    best = max(np.nanmax(value), *polished)
    assert goal.value(found.best_figures)[0] >= best - 2e-3 * abs(best)


def test_a_long_path_is_climbed_on_what_decides(monkeypatch):
    """With every path long, the recommendation is that of the climb on all samples, within two thousandths."""
    from toolpath_stiff.placement import search

    program, goal = program_of("pocket"), Goal(OBJECTIVES["balanced"], NO_FLOORS)
    bounds = Bounds(np.array([-0.1, -0.1, 0.9, 0, 0, 0.3]), np.array([0.1, 0.1, 1.2, 0, 0, 0.3]))
    whole = searched(program, bounds)
    monkeypatch.setattr(search, "SHORT", 0)
    monkeypatch.setattr(search, "WHOLE_POSES", 0)
    long = searched(program, bounds)
    value, wanted = (float(goal.value(found.best_figures)[0]) for found in (long, whole))
    assert value >= wanted - 2e-3 * abs(wanted)
    assert (long.best_figures.objectives >= long.present.objectives).all()


def test_a_climb_ends_no_lower_than_nelder_mead():
    """An independent way up, scipy's simplex search from the same place: each may end on another kink, within 1 %."""
    from scipy.optimize import minimize

    path = representative_path(work_path(program_of("pocket"), 5e-3, TANGENTIAL), 150)
    evaluator = Evaluator(MODEL, path, TANGENTIAL, 1000.0)
    climber = Climber(evaluator, README_BOUNDS, SearchRules(margin=0.01))
    goal = Goal(OBJECTIVES["balanced"], NO_FLOORS)
    for first in ([0.1, 0.05, 0.9, 0, 0, 1.0], [-0.05, 0.1, 1.0, 0, 0, 4.0]):
        ours = climber.climb(np.array([first], dtype=float), goal, 40)[0]

        def loss(unit):
            return -float(goal.value(evaluator.figures(README_BOUNDS.placements(unit[None])))[0]) / 1e6

        start = README_BOUNDS.unit(np.array([first], dtype=float))[0]
        theirs = minimize(loss, start, method="Nelder-Mead", options={"maxfev": 500})
        assert goal.value(evaluator.figures(ours[None]))[0] / 1e6 >= -0.99 * theirs.fun


def test_a_program_that_only_plunges_says_so(tmp_path, capsys):
    part = tmp_path / "holes.nc"
    part.write_text("G21 G90 F200\nG0 X0 Y0 Z5\nG81 X0 Y0 Z-5 R2\nX40\nY30\nG80\nM2\n")
    command = ["place", str(part), "--x=-50:50", "--y=-50:50", "--z", "700:900", "--rotate", "0", "--no-plots"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    assert "the program only plunges along the tool axis" in capsys.readouterr().out


def test_effects_are_placed_by_the_plain_analysis(tmp_path):
    """A model with an effect takes the other route; its figures are those of `analyze`."""
    from toolpath_stiff.machine.model import EffectEntry

    machine = NIST.with_changes(effects=(EffectEntry("platform_flexibility", {"bar_stiffness_N_per_m": 2e8}),))
    model = build_model(machine)
    program = program_of("inch_bracket")
    placement = np.array([[0.05, -0.1, 0.8, 0, 0, 0.7]])
    found = Evaluator(model, work_path(program, STEP), TANGENTIAL, 1000.0).figures(placement)
    wanted = headline_figures(analyze(model, program, origin=tuple(placement[0]), step=STEP))
    assert found.mean[0] / 1e3 == pytest.approx(wanted["mean_N_per_mm"], rel=1e-9)
    assert found.spread[0] / 1e3 == pytest.approx(wanted["range_N_per_mm"], rel=1e-9)


@pytest.mark.parametrize("load", ["normal", "softest", "radial", "axial", "x", "1,1,0.5"])
def test_other_loads_are_those_of_the_plain_analysis(load):
    from toolpath_stiff.analysis.loads import parse_load

    program, direction = program_of("tilted_five_axis"), parse_load(load)
    placements = np.array([[0.05, -0.1, 0.8, 0, 0, 0.7], [0.0, 0.05, 0.8, 0.05, -0.03, 0.2]])
    found = Evaluator(MODEL, work_path(program, STEP, direction), direction, 1000.0).figures(placements)
    for i, placement in enumerate(placements):
        analysis = analyze(MODEL, program, origin=tuple(placement), step=STEP, load=direction)
        k = analysis.at.stiffness[analysis.counted]
        assert found.lowest[i] == pytest.approx(k.min(), rel=1e-9)
        assert found.mean[i] == pytest.approx(
            np.average(k, weights=analysis.samples.weight[analysis.counted]), rel=1e-9
        )
        assert found.margin[i] == pytest.approx(analysis.at.reach.margin[analysis.samples.cutting].min(), rel=1e-9)
