"""The free turn about the tool's axis: dynamic programming against every way there is, a robot against fine grids."""

from __future__ import annotations

import re
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toolpath_stiff as tps
from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.analysis.turning import choose_turn
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.path.turning import constant_costs, feed_turns, least_costly_way, turned_about_tool
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.model import build_model

DATA = Path(__file__).parent.parent / "machine" / "data"
ROBOT = build_model(load_machine(DATA / "robot200.toml"))
SOFTEST = parse_load("softest")


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_the_least_costly_way_is_the_least_of_all_ways(seed):
    rng = np.random.default_rng(seed)
    n, configurations, turns, window, weight = 3, 2, 5, 1, 0.1
    joints = rng.uniform(-3.0, 3.0, (n, configurations, turns, 2))
    cost = rng.uniform(1.0, 2.0, (n, configurations, turns))
    cost[rng.random(cost.shape) < 0.2] = np.inf
    joints[np.isinf(cost)] = np.nan
    winds = np.array([True, False])
    chosen = least_costly_way(joints, cost, winds, 2.5, weight, window)

    def of_way(way) -> tuple[int, float]:
        """Changes, and costs and squared steps together."""
        total, changes = sum(cost[i][node] for i, node in enumerate(way)), 0
        for i, (before, after) in enumerate(pairwise(way)):
            step = joints[i + 1][after] - joints[i][before]
            step[0] = (step[0] + np.pi) % (2.0 * np.pi) - np.pi
            apart = (after[1] - before[1]) % turns
            if before[0] == after[0] and min(apart, turns - apart) <= window and (np.abs(step) <= 2.5).all():
                total += weight * (step**2).sum()
            else:
                changes += 1
        return changes, total

    nodes = list(product(range(configurations), range(turns)))
    best = min(way for way in map(of_way, product(nodes, repeat=n)) if np.isfinite(way[1]))
    mine = of_way(list(zip(*(numbers.tolist() for numbers in chosen), strict=True)))
    assert mine[0] == best[0] and mine[1] == pytest.approx(best[1], abs=1e-9)
    kept = constant_costs(joints, cost, np.array([[-9.0, 9.0]] * 2), winds, 2.5)
    for node in nodes:
        steps = [joints[i + 1][node] - joints[i][node] for i in range(n - 1)]
        steps = np.array([[(s[0] + np.pi) % (2.0 * np.pi) - np.pi, s[1]] for s in steps])
        allowed = np.isfinite(cost[:, *node]).all() and (np.abs(steps) <= 2.5).all()
        assert kept[node] == (pytest.approx(cost[:, *node].mean()) if allowed else np.inf)


def path(n: int = 60):
    """A bow of a metre before the robot, tool upright."""
    s = np.linspace(0.0, 1.0, n)
    position = np.column_stack([1.5 + 0.15 * np.sin(2.0 * np.pi * s), -0.4 + 0.8 * s, np.full(n, 0.45)])
    tangent = np.gradient(position, axis=0)
    return position, np.zeros((n, 3)), tangent / np.linalg.norm(tangent, axis=1)[:, None], np.full(n, np.nan)


def test_the_best_turn_is_within_a_percent_of_a_fine_grid_and_below_all_constant_ones():
    position, abc, tangent, tool = path(15)
    best = choose_turn(ROBOT, position, abc, tangent, tool, SOFTEST)
    machine, softest = ROBOT.machine, np.full(15, np.inf)
    constant = []
    for angle, configuration in product(np.deg2rad(np.arange(0.0, 360.0, 2.5)), range(8)):
        turned = turned_about_tool(rotation_matrices(abc), np.full(15, angle))
        stance = machine.solve(position, turned, tool, configuration)
        low, high = machine.joint_limits.T
        good = ((stance.joints >= low) & (stance.joints <= high)).all(axis=1)
        good &= (machine.singularities(stance) >= machine.singularity_margins).all(axis=1)
        compliance = np.full(15, np.inf)
        if good.any():
            compliance[good] = np.linalg.eigvalsh(stance.take(good).tip_compliance()[:, :3, :3])[:, -1]
        softest = np.minimum(softest, compliance)
        constant.append(compliance.mean())
    assert softest.mean() <= best.mean < 1.01 * softest.mean()
    assert best.mean < 1.001 * min(constant) and best.median_constant > 1.05 * best.mean
    assert not len(best.changes) and len(np.unique(best.configuration)) == 1
    stance = machine.solve(position, rotation_matrices(best.abc), tool, int(best.configuration[0]))
    along = np.linalg.eigvalsh(stance.tip_compliance()[:, :3, :3])[:, -1]
    assert along.mean() == pytest.approx(best.mean, rel=1e-9)  # every pose is a node


def test_the_tool_follows_the_feed_without_whole_turns():
    angle = np.linspace(0.0, 4.0 * np.pi, 50)
    tangent = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    tangent[7] = 0.0
    turns = feed_turns(np.broadcast_to(np.eye(3), (50, 3, 3)), tangent)
    expected = angle.copy()
    expected[7] = angle[6]
    np.testing.assert_allclose(turns, expected, atol=1e-12)
    chosen = choose_turn(ROBOT, *path(20)[:2], path(20)[2], path(20)[3], SOFTEST, "feed")
    x = rotation_matrices(chosen.abc)[:, :, 0]
    np.testing.assert_allclose(x, path(20)[2], atol=1e-12)


def test_where_the_configuration_has_to_change_the_place_is_told():
    """Round the robot's base by more than axis 1 turns: somewhere the arm must go back."""
    angle = np.linspace(-0.95 * np.pi, 1.35 * np.pi, 80)
    position = np.column_stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), np.full(80, 0.5)])
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
    chosen = choose_turn(ROBOT, position, np.zeros((80, 3)), tangent, np.full(80, np.nan), SOFTEST)
    assert not chosen.constant and len(chosen.changes) >= 1
    assert choose_turn(ROBOT, *path(20), SOFTEST, "fixed").constant


ROUND = "\n".join(
    ["G21 G90 F6000", "G0 X{:.3f} Y{:.3f} Z500".format(*(1400.0 * np.array([np.cos(-2.98), np.sin(-2.98)])))]
    + [f"G1 X{1400 * np.cos(a):.3f} Y{1400 * np.sin(a):.3f}" for a in np.linspace(-2.9, 4.2, 60)]
)


def test_a_program_round_the_base_is_evaluated_as_its_joints_have_to_go(tmp_path):
    """Axis 1 turns by 340 degrees: on the way round the arm stands otherwise, and every sample is within reach."""
    program = tps.Program.from_text(ROUND, name="round.nc")
    found = tps.analyze(program, DATA / "robot200.toml", origin_mm_deg=(0, 0, 0), step_mm=20, turn="best")
    assert found.complete and found.to_dict()["configuration"].startswith("shoulder ")
    told = next(words for words in found.warnings if "in this configuration; it has to change" in words)
    cutting = found.samples.cutting[1:] & found.samples.cutting[:-1]
    jumps = np.flatnonzero((np.abs(np.diff(found.at.joints, axis=0)).max(axis=1) > 0.35) & cutting)
    assert len(jumps) and {f"{found.samples.line[row + 1]}" for row in jumps} <= set(re.findall(r"\d+", told))
    low, high = ROBOT.machine.joint_limits.T
    held = found.at.joints[found.samples.cutting]
    assert (held >= low).all() and (held <= high).all()


def test_lines_that_ask_more_than_a_joints_speed_are_told(tmp_path):
    text = (DATA / "robot200.toml").read_text()
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("min_deg", "speed_deg_per_s = 40.0\nmin_deg"))
    cuts = "G21 G90\nG0 X1800 Y-200 Z900\nG1 Y200 F1000\nG1 X1700 Y0 F90000\nG1 Y200 F1000\nM2"
    program = tps.Program.from_text(cuts, name="cuts.nc")
    here = {"origin_mm_deg": (0, 0, 0), "step_mm": 2}
    found = tps.analyze(program, slow, **here)
    told = [words for words in found.warnings if "need a joint to exceed its speed" in words]
    assert len(told) == 1 and told[0].startswith("lines 4 need") and " of 40; reduce the feed there" in told[0]
    rows = found.to_frame()
    line = rows[rows.line == 4]
    rates = [(line[f"joint_J{i}_deg"].diff().abs() / line["t_s"].diff()).max() for i in range(1, 7)]
    assert max(rates) == pytest.approx(float(re.search(r"([\d.]+) deg/s of", told[0])[1]), rel=0.01)
    assert not [words for words in tps.analyze(program, DATA / "robot200.toml", **here).warnings if "speed" in words]


def test_a_placement_is_chosen_with_the_tools_turn(tmp_path):
    """The search finds what a grid of turns and places finds, and its figures are those of the analysis."""
    program = tps.Program.from_text("G21 G90\nG0 X-60 Y0 Z5\nG1 Z0 F600\nG1 X60\nG1 Y50\nM2", name="slot.nc")
    where = {"x_mm": 1500, "y_mm": (-300, 300), "z_mm": 600, "rotate_deg": 0, "margin_percent": 0, "step_mm": 20}
    robot = DATA / "robot200.toml"
    placed = tps.place(program, robot, turn="best", origin_mm_deg=(1500, 0, 600), **where)
    chosen = placed.chosen
    options = {"origin_mm_deg": chosen.origin_mm_deg, "step_mm": 20, "turn": chosen.tool_turn_deg}
    assert tps.analyze(program, robot, **options).mean_N_per_mm == pytest.approx(chosen.mean_N_per_mm, rel=1e-9)
    grid = []
    for y, turn in product(np.linspace(-300, 300, 7), range(0, 360, 30)):
        try:
            found = tps.analyze(program, robot, origin_mm_deg=(1500, y, 600), step_mm=20, turn=turn)
        except tps.UnreachableError:
            continue
        grid.append(found.mean_N_per_mm)
    assert max(row.mean_N_per_mm for row in placed.front) > 0.999 * max(grid) and len(grid) > 30
    assert "tool_turn_deg" in placed.to_dict()["chosen"] and "turned about its axis" in str(placed)
    for way, options in (("feed", {}), ("best", {"write": "new.nc"})):
        with pytest.raises(InputError, match="--turn"):
            tps.place(program, robot, turn=way, **where, **options)


def test_a_machine_without_a_free_turn_refuses():
    mill = build_model(load_machine(DATA / "mill5.toml"))
    with pytest.raises(InputError, match="no free rotation about the tool's axis"):
        choose_turn(mill, *path(5), SOFTEST, "best")
    with pytest.raises(InputError, match="reaches no pose"):
        position, *rest = path(5)
        choose_turn(ROBOT, position + 9.0, *rest, SOFTEST, "best")
